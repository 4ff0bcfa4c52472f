"""What drives a train over the phase of its reference mesh: stiffness levels, deviations, run-out.

The stiffness of a mesh is at its upper level while its own phase rate tau - 2 pi g, g being its
phase in mesh periods, lies within pi (epsilon - 1) of a whole period; see `engines.pair.stiffness`.
"""

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from gearlib.models.trains import turning
from gearlib.models.trains.structure import FLOATS

#: Boundaries that are closer in phase are one.
SAME_PHASE = 1e-12


class Segments(NamedTuple):
    """Segments of the common period in which no stiffness and no sliding changes."""

    starts: np.ndarray  #: phases of the reference mesh, shape (p + 1,)
    first_segment: np.ndarray  #: where each reference mesh period begins, shape (repeats + 1,)
    low: np.ndarray  #: whether at the lower level, coast and drive side, shape (2, p, m)
    sense: np.ndarray  #: of the sliding, 1 or -1, 1 without friction, as `low`, shape (2, p, m)
    kinds: list  #: of each mesh those that come: 2 at the lower level, 1 more for sliding by -1


def segments(train, first, count):
    """Return the `Segments` of `count` reference mesh periods from the `first` on.

    The n-th period lies at n modulo `count`, so that those before it come after the last ones.
    """
    marks = [math.tau * k for k in range(count + 1)]
    early = first % count
    timings = [_timing(train, mesh) for mesh in train.meshes]
    cuts = [np.array(marks)]
    for mesh, rate, (shifts, turns) in zip(train.meshes, train.rates, timings, strict=True):
        changes = set()
        if mesh.varies:
            half = (mesh.contact_ratio - 1.0) / 2.0
            changes |= {g + side for g in shifts for side in (half, -half)}
        if any(mesh.friction):
            changes |= {turn + half for turn in turns for half in (0.0, 0.5)}
        # A change comes back every mesh period; the first of them begins `lead` from `first`.
        before = math.floor(first * rate)
        periods = np.arange(math.ceil((first + count) * rate) - before)
        lead = float(before / rate - first)
        for change in changes:
            places = lead + (change % 1.0 + periods) / float(rate)
            places = places[(places >= 0.0) & (places <= count)]
            wrapped = places + early
            cuts.append(math.tau * np.where(wrapped > count, wrapped - count, wrapped))
    starts = _distinct(np.sort(np.concatenate(cuts)), set(marks))
    middles = (starts[:-1] + starts[1:]) / (2.0 * math.tau)
    low = np.zeros((2, middles.size, len(train.meshes)), dtype=bool)
    sense = np.ones(low.shape)
    kinds = []
    for j, (mesh, rate, (shifts, turns)) in enumerate(
        zip(train.meshes, train.rates, timings, strict=True)
    ):
        offsets = [float((first + lag) * rate % 1) for lag in (-early, count - early)]
        phases = middles * float(rate) + np.where(middles > early, *offsets)
        low[:, :, j] = at_lower_level(mesh, shifts, phases)
        rubs = any(mesh.friction)
        if rubs:
            sense[:, :, j] = np.where(
                np.mod(phases - np.array(turns)[:, None], 1.0) < 0.5, 1.0, -1.0
            )
        levels = (0, 1) if mesh.varies else (int(low[0, 0, j]),)
        kinds.append([2 * level + way for level in levels for way in ((0, 1) if rubs else (0,))])
    first_segment = np.searchsorted(starts, np.array(marks) - SAME_PHASE)
    return Segments(starts, first_segment, low, sense, kinds)


def _timing(train, mesh):
    """Return phases of the stiffness and of the sliding of (coast, drive) in mesh periods."""
    coast, drive = train.inverse_phases[mesh.name], train.phases[mesh.name]
    turns = turning.sliding_turns(mesh, train.speeds)
    return (coast, drive), tuple(drive + turn for turn in turns)


def at_lower_level(mesh, shifts, phases):
    """Return whether (coast, drive) sides are at the lower stiffness level, shape (2, p).

    `shifts` are the phases of the stiffness of both, `phases` those of the mesh, in mesh periods.
    """
    if not mesh.varies:
        return np.full((2, len(phases)), mesh.contact_ratio < 2.0 and mesh.two_levels)
    away = np.abs(np.mod(phases - np.array(shifts)[:, None] + 0.5, 1.0) - 0.5)
    return away > (mesh.contact_ratio - 1.0) / 2.0


def _distinct(cuts, marks):
    """Return ascending cuts without those of the same phase, of which a mark stays."""
    kept = [0.0]
    for cut in cuts.tolist():
        if cut - kept[-1] > SAME_PHASE:
            kept.append(cut)
        elif cut in marks:
            kept[-1] = cut
    return np.array(kept)


def stiffness_harmonic(mesh, order, phase):
    """Return twice a Fourier coefficient of the stiffness of a mesh, N/m, complex.

    The order is over the frequency of the mesh, the phase that of the middle of the upper level, in
    mesh periods.
    """
    jump = mesh.max_stiffness * (1.0 - mesh.stiffness_ratio)
    size = 2.0 * jump * math.sin(math.pi * order * (mesh.contact_ratio - 1.0)) / (math.pi * order)
    return size * np.exp(-2.0j * np.pi * order * phase)


def excitation(train):
    """Return (frequencies, waves, constants): what is added to d_j beside the motion, m.

    Frequencies by reference mesh phase, shape (h,); waves of shape (2, m, 2 h), cosines and sines
    by turns, and constants of shape (2, m), each for coast and drive side.
    """
    rows, constants = excited(train, train.structure.arms)
    frequencies = sorted(rows)
    waves = np.array([rows[f] for f in frequencies]).reshape(-1, 2, len(train.meshes), 2)
    waves = waves.transpose(1, 2, 0, 3).reshape(2, len(train.meshes), -1)
    return np.array([float(f) for f in frequencies]), waves, constants


def excited(train, arms, numbers=FLOATS):
    """Return (rows, constants) in a kind of numbers; `arms` are those of a `Structure` of it.

    Rows are frequency, `Fraction` -> cosine and sine, shape (2, m, 2); constants as above.
    """
    rows: dict = {}
    of, constants = numbers.of, numbers.zeros(2, len(train.meshes))

    def add(frequency, j, sides, cosine, sine):
        # A pair for each frequency; -sin of a gear that turns clockwise.
        entry = rows.setdefault(abs(frequency), numbers.zeros(2, len(train.meshes), 2))
        entry[sides, j] += (cosine, math.copysign(1.0, frequency) * sine)

    for j, mesh in enumerate(train.meshes):
        # A coast side that moves with the axes meets nothing of what only they do.
        axes = [1] if mesh.moving_backlash else [0, 1]
        constants[:, j] += of(mesh.error)
        for name, arm in zip((mesh.pinion, mesh.wheel), arms[j], strict=True):
            body = train.by_name[name]
            c, s = numbers.cos_sin(body.angle) if body.carrier else (1.0, 0.0)
            x, y = map(of, body.offset)
            constants[axes, j] += arm @ (c * x - s * y, s * x + c * y)
            if body.eccentricity:
                # arm . e (cos(theta + phase), sin(theta + phase))
                length, angle = numbers.polar(*arm)
                size, lead = of(body.eccentricity) * length, of(body.eccentricity_phase) - angle
                lead += body.angle if body.carrier else 0.0
                c, s = numbers.cos_sin(lead)
                add(train.speeds[name], j, axes, size * c, -size * s)
        rate, g = train.rates[j], train.phases[mesh.name]
        deviations = (mesh.inverse_deviation, mesh.deviation)
        for side, deviation in enumerate(deviations):
            for order, cosine, sine in deviation.table().tolist():
                c, s = numbers.cos_sin(2.0 * numbers.pi * order * g)
                add(int(order) * rate, j, [side], cosine * c - sine * s, cosine * s + sine * c)
    return rows, constants


def common_period(train):
    """Return after how many reference mesh periods stiffness, deviations and run-out repeat."""
    rates = list(train.rates)
    for mesh in train.meshes:
        rates += [
            train.speeds[b] for b in (mesh.pinion, mesh.wheel) if train.by_name[b].eccentricity
        ]
    return math.lcm(*(Fraction(rate).denominator for rate in rates))

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
_SAME_PHASE = 1e-12


class Segments(NamedTuple):
    """Segments of the common period in which no stiffness and no sliding changes."""

    starts: np.ndarray  #: phases of the reference mesh, shape (p + 1,)
    first_segment: np.ndarray  #: where each reference mesh period begins, shape (repeats + 1,)
    low: np.ndarray  #: whether at the lower level, coast and drive side, shape (2, p, m)
    sense: np.ndarray  #: of the sliding, 1 or -1, 1 without friction, as `low`, shape (2, p, m)
    kinds: list  #: of each mesh those that come: 2 at the lower level, 1 more for sliding by -1


def segments(meshes, rates, phases, turns, first, count):
    """Return the `Segments` of so many reference mesh periods from the `first` on, as from phase 0.

    The other arguments have an entry for each mesh. Phases and `turning.sliding_turns` are pairs,
    coast and drive, these after the drive side.
    """
    whole = 2.0 * math.pi
    marks = [whole * k for k in range(count + 1)]
    cuts = [np.array(marks)]
    for mesh, rate, shifts, pitch in zip(meshes, rates, phases, turns, strict=True):
        local = set()
        if mesh.varies:
            half = (mesh.contact_ratio - 1.0) / 2.0
            local |= {(g + side) for g in shifts for side in (half, -half)}
        if any(mesh.friction):
            local |= {shifts[1] + turn + half for turn in pitch for half in (0.0, 0.5)}
        # A cut at c mesh periods comes back every mesh period.
        before = math.floor(first * rate)
        own = np.arange(math.ceil((first + count) * rate) - before)
        # So far back of the first period the first of these mesh periods begins, to the last place.
        lead = float(before / rate - first)
        cuts += [whole * (lead + (c % 1.0 + own) / float(rate)) for c in local]
    ordered = np.sort(np.concatenate(cuts))
    kept, bounds = [0.0], set(marks)
    for cut in ordered[(ordered >= 0.0) & (ordered <= marks[-1])].tolist():
        if cut - kept[-1] > _SAME_PHASE:
            kept.append(cut)
        elif cut in bounds:
            kept[-1] = cut
    starts = np.array(kept)
    middle = (starts[:-1] + starts[1:]) / 2.0
    low = np.zeros((2, middle.size, len(meshes)), dtype=bool)
    sense = np.ones(low.shape)
    kinds = []
    for j, (mesh, rate, shifts, pitch) in enumerate(zip(meshes, rates, phases, turns, strict=True)):
        at = middle * float(rate) / whole + float(first * rate % 1)
        for side, (g, turn) in enumerate(zip(shifts, pitch, strict=True)):
            away = np.abs(np.mod(at - g + 0.5, 1.0) - 0.5)
            low[side, :, j] = away > (mesh.contact_ratio - 1.0) / 2.0
            if any(mesh.friction):
                sense[side, :, j] = np.where(np.mod(at - shifts[1] - turn, 1.0) < 0.5, 1.0, -1.0)
        if not mesh.varies:
            low[:, :, j] = mesh.contact_ratio < 2.0 and mesh.two_levels
        levels = (0, 1) if mesh.varies else (int(low[0, 0, j]),)
        ways = (0, 1) if any(mesh.friction) else (0,)
        kinds.append([2 * level + way for level in levels for way in ways])
    places = np.searchsorted(starts, np.array(marks) - _SAME_PHASE)
    return Segments(starts, places, low, sense, kinds)


def stretch(train, first, count):
    """Return the `Segments` of some reference mesh periods, the n-th at n modulo `count`."""
    both = [(train.inverse_phases[name], train.phases[name]) for name in train.mesh_names]
    turns = [turning.sliding_turns(mesh, train.speeds) for mesh in train.meshes]
    parts = train.meshes, train.rates, both, turns
    if not (early := first % count):
        return segments(*parts, first, count)
    late = segments(*parts, first, count - early)
    return _joined(segments(*parts, first + count - early, early), late)


def _joined(one, other):
    """Return the `Segments` of one stretch with those of another one behind it."""
    return Segments(
        np.append(one.starts[:-1], one.starts[-1] + other.starts),
        np.append(one.first_segment[:-1], one.first_segment[-1] + other.first_segment),
        np.concatenate([one.low, other.low], axis=1),
        np.concatenate([one.sense, other.sense], axis=1),
        one.kinds,
    )


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

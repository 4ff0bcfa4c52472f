"""Excitation of a train over its reference mesh phase: stiffness levels, deviations, run-out.

The stiffness of a mesh with the phase g, in mesh periods, is at its upper level while the angle
rate tau - 2 pi g is at most pi (epsilon - 1) from a whole period; see `engines.pair.stiffness`.
"""

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gearlib.models.trains import turning
from gearlib.models.trains.elements import HarmonicForce, Mesh
from gearlib.models.trains.structure import AXES, FLOAT_ARITHMETIC

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

#: Boundaries of segments closer than this in phase count as equal.
SAME_PHASE_TOLERANCE = 1e-12


class Segments(NamedTuple):
    """Intervals of the common period without a change of stiffness or sliding direction."""

    starts: np.ndarray  #: reference mesh phases of the p starts and the end, rad, shape (p + 1,)
    first_segment: np.ndarray  #: first segment of each reference mesh period, shape (repeats + 1,)
    low: np.ndarray  #: whether (coast, drive) sides are at the lower level, shape (2, p, m)
    sliding_signs: np.ndarray  #: 1 or -1 for (coast, drive) sides, 1 without friction, (2, p, m)
    #: For each mesh, the kinds of segments that occur: 2 at the lower stiffness level, else 0, plus
    #: 1 if the sliding is negative.
    kinds: list


def segments(train: "GearTrain", first: int, count: int) -> Segments:
    """Return the `Segments` of mesh phase in which no stiffness or sliding direction changes.

    They cover `count` periods of the reference mesh that begin with period number `first`. Periods
    are stored cyclically: period n lies at position n modulo `count`.
    """
    period_starts = [math.tau * k for k in range(count + 1)]
    offset = first % count  # position of period `first`
    mesh_phases = [_stiffness_and_sliding_phases(train, mesh) for mesh in train.meshes]
    boundaries = [np.array(period_starts)]
    meshes = list(zip(train.meshes, train.frequency_ratios, mesh_phases, strict=True))
    for mesh, ratio, (stiffness_phases, sliding_phases) in meshes:
        times = _change_times(mesh, ratio, stiffness_phases, sliding_phases, first, count) + offset
        boundaries.append(math.tau * np.where(times > count, times - count, times))
    distinct = [0.0]  # without duplicates up to rounding; starts of periods stay exact
    for boundary in np.sort(np.concatenate(boundaries)).tolist():
        if boundary - distinct[-1] > SAME_PHASE_TOLERANCE:
            distinct.append(boundary)
        elif boundary in period_starts:
            distinct[-1] = boundary
    starts = np.array(distinct)
    midpoints = (starts[:-1] + starts[1:]) / (2.0 * math.tau)
    low = np.zeros((2, midpoints.size, len(train.meshes)), dtype=bool)
    sliding_signs = np.ones(low.shape)
    kinds = []
    for j, (mesh, ratio, (stiffness_phases, sliding_phases)) in enumerate(meshes):
        # Phases of this mesh at position 0, counted back from the periods stored from position
        # `offset` on, and from earlier positions, whose periods follow after the last position.
        phase_from_offset = float((first - offset) * ratio % 1)
        phase_before_offset = float((first + (count - offset)) * ratio % 1)
        initial_phases = np.where(midpoints > offset, phase_from_offset, phase_before_offset)
        phases = midpoints * float(ratio) + initial_phases
        low[:, :, j] = at_lower_level(mesh, stiffness_phases, phases)
        sliding_bits = [0]
        if any(mesh.friction):
            is_positive = np.mod(phases - np.array(sliding_phases)[:, None], 1.0) < 0.5
            sliding_signs[:, :, j] = np.where(is_positive, 1.0, -1.0)
            sliding_bits = [0, 1]
        levels = [0, 1] if mesh.varies else [int(low[0, 0, j])]  # 1: the lower level
        kinds.append([2 * level + bit for level in levels for bit in sliding_bits])
    first_segment = np.searchsorted(starts, np.array(period_starts) - SAME_PHASE_TOLERANCE)
    return Segments(starts, first_segment, low, sliding_signs, kinds)


def _change_times(mesh, ratio, stiffness_phases, sliding_phases, first, count) -> np.ndarray:
    """Return the times at which the stiffness or sliding direction of a mesh changes.

    Times are in periods of the reference mesh from the start of its period `first`, between 0 and
    `count`. `ratio` is the frequency of the mesh over that of the reference mesh, a `Fraction`.
    `stiffness_phases` are the middles of the upper stiffness level, and `sliding_phases` the
    changes to positive sliding, each for (coast, drive) sides in mesh periods.
    """
    phases = set()
    if mesh.varies:
        half_length = (mesh.contact_ratio - 1.0) / 2.0  # of the upper stiffness level
        phases |= {phase + half_length for phase in stiffness_phases}
        phases |= {phase - half_length for phase in stiffness_phases}
    if any(mesh.friction):
        # The sliding changes its sign again half a period later.
        phases |= {phase + half_period for phase in sliding_phases for half_period in (0.0, 0.5)}
    # A change recurs in every period of this mesh, the first of which starts at `start`.
    earlier_periods = math.floor(first * ratio)
    periods = np.arange(math.ceil((first + count) * ratio) - earlier_periods)
    start = float(earlier_periods / ratio - first)
    times = [start + (phase % 1.0 + periods) / float(ratio) for phase in phases]
    all_times = np.concatenate([np.empty(0), *times])
    return all_times[(all_times >= 0.0) & (all_times <= count)]


def _stiffness_and_sliding_phases(train: "GearTrain", mesh: Mesh) -> tuple[tuple, tuple]:
    """Return (stiffness phases, sliding phases) of a mesh, each for the (coast, drive) sides.

    A stiffness phase is the middle of the upper stiffness level, and a sliding phase is the change
    to positive sliding, in mesh periods.
    """
    coast, drive = train.coast_phases[mesh.name], train.phases[mesh.name]
    sliding_phases = turning.sliding_phases(mesh, train.speeds_at(mesh))
    return (coast, drive), tuple(drive + phase for phase in sliding_phases)


def at_lower_level(mesh, stiffness_phases, phases) -> np.ndarray:
    """Return whether (coast, drive) sides have the lower stiffness at p mesh phases, shape (2, p).

    `stiffness_phases` are the phases in the middle of the upper stiffness level of the (coast,
    drive) sides. They and `phases`, shape (p,), are in periods of this mesh.
    """
    if not mesh.varies:
        # If the levels differ, one pair of teeth (contact ratio 1) has the lower one, two (ratio 2)
        # have the upper one.
        return np.full((2, len(phases)), mesh.contact_ratio < 2.0 and mesh.two_levels)
    # Distance from the middle of the nearest upper level, whose length is the contact ratio minus
    # 1.
    distance = np.abs(np.mod(phases - np.array(stiffness_phases)[:, None] + 0.5, 1.0) - 0.5)
    return distance > (mesh.contact_ratio - 1.0) / 2.0


def stiffness_harmonic(mesh: Mesh, order: int, phase: float) -> complex:
    """Return the complex Fourier amplitude, N/m, of a harmonic of the rectangular mesh stiffness.

    `order`, at least 1, counts waves per period of this mesh; `phase`, in mesh periods, is the
    middle of the upper stiffness level, whose length is the contact ratio minus 1.
    """
    stiffness_jump = mesh.max_stiffness * (1.0 - mesh.stiffness_ratio)
    amplitude = 2.0 * stiffness_jump * math.sin(math.pi * order * (mesh.contact_ratio - 1.0))
    return amplitude / (math.pi * order) * np.exp(-2.0j * np.pi * order * phase)


def excitation(train: "GearTrain") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the changes of flank distances of m meshes by errors, deviations and run-out.

    The result is (frequencies, amplitudes, constants). The h frequencies, shape (h,), are in
    radians per radian of reference mesh phase, and include those of harmonic forces. Amplitudes in
    m, shape (2, m, 2 h), alternate between cosine and sine of each frequency; constants are in m,
    shape (2, m). The first axis is (coast side, drive side).
    """
    harmonics, constants = excitation_harmonics(train, train.structure.line_vectors)
    m = len(train.meshes)
    for force in train.forces:
        # A force changes no distance, but the engines need its frequency.
        harmonics.setdefault(force_frequency(train, force), np.zeros((2, m, 2)))
    frequencies = sorted(harmonics)
    amplitudes = np.array([harmonics[frequency] for frequency in frequencies])
    amplitudes = amplitudes.reshape(-1, 2, m, 2).transpose(1, 2, 0, 3).reshape(2, m, -1)
    return np.array([float(frequency) for frequency in frequencies]), amplitudes, constants


def force_frequency(train: "GearTrain", force: HarmonicForce) -> Fraction:
    """Return the frequency of a harmonic force in radians per radian of reference mesh phase.

    The order of the force refers to a mesh or to the revolutions of a body, named `force.of`.
    """
    if force.of in train.mesh_names:
        return force.order * train.frequency_ratios[train.mesh_names.index(force.of)]
    return force.order * abs(train.speeds.in_housing[force.of])


def force_row(train: "GearTrain", force: HarmonicForce, motions: np.ndarray) -> np.ndarray:
    """Return the row vector, shape (n,), of the motion on which a harmonic force does work.

    It maps the n coordinates to a displacement in m or, for a torque, to a rotation in rad.
    `motions`, shape (bodies, 3, n), holds the rows of all bodies for x, y and the rotation as arc
    length, in floats or balls (intervals).
    """
    if train.matrices is not None and force.body in train.matrices.coordinates:
        return train.matrices.motion(force.body)
    row = motions[train.body_names.index(force.body), AXES.index(force.axis)]
    return row / train.by_name[force.body].base_radius if force.axis == "rotation" else row


def force_harmonics(train, motions, arithmetic=FLOAT_ARITHMETIC) -> dict:
    """Return the harmonic forces on n coordinates: frequency -> cosine and sine parts in N, (2, n).

    Frequencies are in radians per radian of reference mesh phase. `motions`, shape (bodies, 3, n),
    holds the row vectors of all bodies for x, y and rotation, in floats or balls (intervals).
    """
    harmonics: dict = {}
    for force in train.forces:
        row = force_row(train, force, motions)
        cosine, sine = arithmetic.cos_sin(force.phase)
        amplitude = arithmetic.convert(force.amplitude)
        frequency = force_frequency(train, force)
        parts = harmonics.setdefault(frequency, arithmetic.zeros(2, motions.shape[2]))
        parts += np.stack([amplitude * cosine * row, -amplitude * sine * row])
    return harmonics


def excitation_harmonics(train, line_vectors, arithmetic=FLOAT_ARITHMETIC):
    """Return the changes of flank distances of m meshes as (harmonics, constants) in m.

    `harmonics` is a dict, frequency -> cosines and sines, shape (2, m, 2), and `constants` has the
    shape (2, m); the first axis is (coast side, drive side). `line_vectors`, shape (m, 2, 2), are
    the unit vectors of the lines of action with the signs of pinion and wheel. `arithmetic`
    computes with floats, or with balls (intervals that enclose the numbers).
    """
    harmonics: dict = {}
    convert, constants = arithmetic.convert, arithmetic.zeros(2, len(train.meshes))

    def add_harmonic(frequency: Fraction, j: int, sides: list[int], cosine: Any, sine: Any) -> None:
        """Add a cosine and a sine to some sides of mesh j: 0 is the coast and 1 the drive side.

        A negative frequency is made positive, which changes the sign of the sine.
        """
        amplitudes = harmonics.setdefault(abs(frequency), arithmetic.zeros(2, len(train.meshes), 2))
        amplitudes[sides, j] += (cosine, math.copysign(1.0, frequency) * sine)

    for j, mesh in enumerate(train.meshes):
        # A coast-side flank that moves with the axes is not excited by their errors and run-out.
        sides = [1] if mesh.moving_backlash else [0, 1]
        constants[:, j] += convert(mesh.error)
        for name, line_vector in zip((mesh.pinion, mesh.wheel), line_vectors[j], strict=True):
            body = train.by_name[name]
            # The offset of a carried body is radial and tangential.
            c, s = arithmetic.cos_sin(body.angle) if body.carrier else (1.0, 0.0)
            x, y = map(convert, body.offset)
            constants[sides, j] += line_vector @ (c * x - s * y, s * x + c * y)
            if body.eccentricity:
                # The run-out e (cos(theta + phase), sin(theta + phase)) along the line of action.
                length, angle = arithmetic.polar(*line_vector)
                run_out = convert(body.eccentricity) * length
                phase = convert(body.eccentricity_phase) - angle
                phase += body.angle if body.carrier else 0.0
                c, s = arithmetic.cos_sin(phase)
                add_harmonic(train.speeds_at(mesh)[name], j, sides, run_out * c, -run_out * s)
        ratio, mesh_phase = train.frequency_ratios[j], train.phases[mesh.name]
        for side, deviation in enumerate((mesh.coast_deviation, mesh.deviation)):
            tooth_phase, tooth_table = deviation_of_teeth(train, mesh, side)
            for phase, table in ((mesh_phase, deviation.table()), (tooth_phase, tooth_table)):
                for order, cosine, sine in table.tolist():
                    # The deviation lags by the phase.
                    c, s = arithmetic.cos_sin(2.0 * arithmetic.pi * order * phase)
                    lagging = cosine * c - sine * s, cosine * s + sine * c
                    add_harmonic(int(order) * ratio, j, [side], *lagging)
    return harmonics, constants


def deviation_of_teeth(train: "GearTrain", mesh: Mesh, side: int) -> tuple[float, np.ndarray]:
    """Return (phase, deviation) by which loaded teeth excite a side, 0 coast or 1 drive.

    The phase is in mesh periods, and the rows of the deviation are (order, cosine, sine) in m. The
    deviation is the transmission error: while the gears follow it, the mesh force is constant.
    """
    pinion_drives = turning.driving_gear(mesh, train.speeds_at(mesh)) == mesh.pinion
    # Where the wheel drives, the contact moves the other way along the path of contact. On the
    # coast side the other gear drives.
    direction = 1.0 if pinion_drives == bool(side) else -1.0
    if side:
        sign, phase = -1.0, train.phases[mesh.name]
    else:
        sign, phase = 1.0, train.coast_phases[mesh.name]
    return phase, mesh.transmission_error.table() * (1.0, sign, sign * direction)


def common_period(train: "GearTrain") -> int:
    """Return the number of reference mesh periods after which the whole excitation repeats.

    The excitation consists of all meshes, run-outs and harmonic forces. The number is the least
    common multiple of the denominators of their frequencies, which are fractions.
    """
    frequencies = list(train.frequency_ratios)
    for mesh in train.meshes:
        for name in (mesh.pinion, mesh.wheel):
            if train.by_name[name].eccentricity:
                frequencies.append(train.speeds_at(mesh)[name])
    frequencies += [force_frequency(train, force) for force in train.forces]
    return math.lcm(*(Fraction(frequency).denominator for frequency in frequencies))

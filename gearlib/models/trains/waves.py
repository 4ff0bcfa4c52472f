"""Excitation of a train over its reference mesh phase: stiffness levels, deviations, run-out.

The stiffness of a mesh with the phase g, in mesh periods, is at its upper level while the distance
of the angle rate tau - 2 pi g from the nearest multiple of 2 pi is at most pi (epsilon - 1); see
`engines.pair.stiffness`.
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

#: Segment boundaries closer than this phase difference are merged.
SAME_PHASE_TOLERANCE = 1e-12


class Segments(NamedTuple):
    """Phase segments of a train with m meshes, with constant stiffness and sliding directions."""

    starts: np.ndarray  #: reference mesh phases that bound the p segments, rad, shape (p + 1,)
    first_segment: np.ndarray  #: first segment of each reference mesh period, shape (repeats + 1,)
    is_low: np.ndarray  #: whether (coast, drive) sides are at the lower level, shape (2, p, m)
    sliding_signs: np.ndarray  #: 1 or -1 for (coast, drive) sides, 1 without friction, (2, p, m)
    #: For each mesh, the kinds of forces that occur, which are coded as 2 * level + sliding: the
    #: level is 1 for the lower stiffness level, and sliding is 1 for negative sliding.
    force_kinds: list


def segments(train: "GearTrain", first: int, count: int) -> Segments:
    """Compute the `Segments` of mesh phase with constant stiffness and sliding directions.

    They cover `count` periods of the reference mesh, starting with period number `first`. Periods
    are stored cyclically: period n is stored at position n modulo `count`.
    """
    period_starts = [math.tau * k for k in range(count + 1)]
    offset = first % count  # position of period `first`
    mesh_phases = [_stiffness_and_sliding_phases(train, mesh) for mesh in train.meshes]
    boundaries = [np.array(period_starts)]
    meshes = list(zip(train.meshes, train.frequency_ratios, mesh_phases, strict=True))
    for mesh, ratio, (stiffness_phases, sliding_phases) in meshes:
        times = _change_times(mesh, ratio, stiffness_phases, sliding_phases, first, count) + offset
        boundaries.append(math.tau * np.where(times > count, times - count, times))
    unique_boundaries = [0.0]
    for boundary in np.sort(np.concatenate(boundaries)).tolist():
        if boundary - unique_boundaries[-1] > SAME_PHASE_TOLERANCE:
            unique_boundaries.append(boundary)
        elif boundary in period_starts:  # Starts of periods must be exact.
            unique_boundaries[-1] = boundary
    starts = np.array(unique_boundaries)
    midpoints = (starts[:-1] + starts[1:]) / (2.0 * math.tau)
    is_low = np.zeros((2, midpoints.size, len(train.meshes)), dtype=bool)
    sliding_signs = np.ones(is_low.shape)
    force_kinds = []
    for j, (mesh, ratio, (stiffness_phases, sliding_phases)) in enumerate(meshes):
        # Phases of this mesh at position 0, extrapolated from the periods stored at and after
        # `offset`, and from the later periods, which are stored before `offset`.
        phase_from_offset = float((first - offset) * ratio % 1)
        phase_before_offset = float((first + (count - offset)) * ratio % 1)
        initial_phases = np.where(midpoints > offset, phase_from_offset, phase_before_offset)
        phases = midpoints * float(ratio) + initial_phases
        is_low[:, :, j] = is_at_lower_level(mesh, stiffness_phases, phases)
        sliding_codes = [0]
        if any(mesh.friction):
            is_positive = np.mod(phases - np.array(sliding_phases)[:, None], 1.0) < 0.5
            sliding_signs[:, :, j] = np.where(is_positive, 1.0, -1.0)
            sliding_codes = [0, 1]
        levels = [0, 1] if mesh.varies else [int(is_low[0, 0, j])]
        force_kinds.append([2 * level + code for level in levels for code in sliding_codes])
    first_segment = np.searchsorted(starts, np.array(period_starts) - SAME_PHASE_TOLERANCE)
    return Segments(starts, first_segment, is_low, sliding_signs, force_kinds)


def _change_times(mesh, ratio, stiffness_phases, sliding_phases, first, count) -> np.ndarray:
    """Return the times at which the stiffness or the sliding direction of a mesh changes.

    The times, from 0 to `count`, are in periods of the reference mesh after the start of its period
    `first`. `ratio` is the mesh frequency over the reference mesh frequency, a `Fraction`. For the
    (coast, drive) sides, `stiffness_phases` are the middles of the upper stiffness level, and
    `sliding_phases` are the changes to positive sliding, in mesh periods.
    """
    phases = set()
    if mesh.varies:
        half_length = (mesh.contact_ratio - 1.0) / 2.0  # half length of the upper level
        phases |= {phase + half_length for phase in stiffness_phases}
        phases |= {phase - half_length for phase in stiffness_phases}
    if any(mesh.friction):
        # The sliding becomes negative half a period later.
        phases |= {phase + half_period for phase in sliding_phases for half_period in (0.0, 0.5)}
    # All changes recur in each period of this mesh; `start` is the start of the first period.
    earlier_periods = math.floor(first * ratio)
    periods = np.arange(math.ceil((first + count) * ratio) - earlier_periods)
    start = float(earlier_periods / ratio - first)
    times = [start + (phase % 1.0 + periods) / float(ratio) for phase in phases]
    all_times = np.concatenate([np.empty(0), *times])
    return all_times[(all_times >= 0.0) & (all_times <= count)]


def _stiffness_and_sliding_phases(train: "GearTrain", mesh: Mesh) -> tuple[tuple, tuple]:
    """Return (stiffness phases, sliding phases) of a mesh, each for the (coast, drive) sides.

    The stiffness phase is the middle of the upper stiffness level, and the sliding phase is the
    change to positive sliding, in mesh periods.
    """
    coast, drive = train.coast_phases[mesh.name], train.phases[mesh.name]
    sliding_phases = turning.sliding_phases(mesh, train.speeds_at(mesh))
    return (coast, drive), tuple(drive + phase for phase in sliding_phases)


def is_at_lower_level(mesh, stiffness_phases, phases) -> np.ndarray:
    """Return whether the (coast, drive) sides have the lower stiffness at p phases, shape (2, p).

    `stiffness_phases` are the middles of the upper stiffness level of the (coast, drive) sides.
    They and `phases`, shape (p,), are in mesh periods.
    """
    if not mesh.varies:
        # With a contact ratio of 1, always one tooth pair is in contact, at the lower level.
        return np.full((2, len(phases)), mesh.contact_ratio < 2.0 and mesh.two_levels)
    # The length of an upper level is the contact ratio minus 1.
    distance = np.abs(np.mod(phases - np.array(stiffness_phases)[:, None] + 0.5, 1.0) - 0.5)
    return distance > (mesh.contact_ratio - 1.0) / 2.0


def stiffness_harmonic(mesh: Mesh, order: int, phase: float) -> complex:
    """Return the complex Fourier amplitude, N/m, of a harmonic of the rectangular mesh stiffness.

    `order` is the order of the harmonic, >= 1, and `phase`, in mesh periods, is the middle of the
    upper stiffness level.
    """
    stiffness_jump = mesh.max_stiffness * (1.0 - mesh.stiffness_ratio)
    amplitude = 2.0 * stiffness_jump * math.sin(math.pi * order * (mesh.contact_ratio - 1.0))
    return amplitude / (math.pi * order) * np.exp(-2.0j * np.pi * order * phase)


def excitation(train: "GearTrain") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (frequencies, amplitudes, constants) of the flank distances of m meshes.

    The flank distances change by errors, deviations and run-out. The frequencies, shape (h,), are
    in radians per radian of reference mesh phase and include the frequencies of harmonic forces.
    The amplitudes, shape (2, m, 2 h), are a cosine and a sine for each frequency, in m. The
    constants, in m, have the shape (2, m). The first axis is (coast side, drive side).
    """
    harmonics, constants = excitation_harmonics(train, train.structure.line_vectors)
    m = len(train.meshes)
    for force in train.forces:
        # A force does not change a distance, but the engines need its frequency.
        harmonics.setdefault(force_frequency(train, force), np.zeros((2, m, 2)))
    frequencies = sorted(harmonics)
    amplitudes = np.array([harmonics[frequency] for frequency in frequencies])
    amplitudes = amplitudes.reshape(-1, 2, m, 2).transpose(1, 2, 0, 3).reshape(2, m, -1)
    return np.array([float(frequency) for frequency in frequencies]), amplitudes, constants


def force_frequency(train: "GearTrain", force: HarmonicForce) -> Fraction:
    """Return the frequency of a harmonic force in radians per radian of reference mesh phase.

    `force.of` is the name of the mesh or body to which the order of the force refers.
    """
    if force.of in train.mesh_names:
        return force.order * train.frequency_ratios[train.mesh_names.index(force.of)]
    return force.order * abs(train.speeds.in_housing[force.of])


def force_direction(train: "GearTrain", force: HarmonicForce, motions: np.ndarray) -> np.ndarray:
    """Return the row vector, shape (n,), of the motion on which a harmonic force does work.

    It maps the n coordinates to a displacement in m or, for a torque, to a rotation in rad.
    `motions`, shape (bodies, 3, n), are the rows of x, y and rotation (as arc length) of all
    bodies, in floats or balls (intervals).
    """
    if train.matrices is not None and force.body in train.matrices.coordinates:
        return train.matrices.coordinate_row(force.body)
    row = motions[train.body_names.index(force.body), AXES.index(force.axis)]
    return row / train.by_name[force.body].base_radius if force.axis == "rotation" else row


def force_harmonics(train, motions, arithmetic=FLOAT_ARITHMETIC) -> dict:
    """Return the harmonic forces on n coordinates, a dict frequency -> amplitudes in N, (2, n).

    The amplitudes are cosines and sines, and the frequencies are in radians per radian of reference
    mesh phase. `motions`, shape (bodies, 3, n), are the rows of x, y and rotation (as arc length)
    of all bodies, in floats or balls (intervals).
    """
    harmonics: dict = {}
    for force in train.forces:
        row = force_direction(train, force, motions)
        cosine, sine = arithmetic.cos_sin(force.phase)
        amplitude = arithmetic.convert(force.amplitude)
        frequency = force_frequency(train, force)
        amplitudes = harmonics.setdefault(frequency, arithmetic.zeros(2, motions.shape[2]))
        amplitudes += np.stack([amplitude * cosine * row, -amplitude * sine * row])
    return harmonics


def excitation_harmonics(train, line_vectors, arithmetic=FLOAT_ARITHMETIC):
    """Return the (harmonics, constants) of the flank distances of m meshes, in m.

    The flank distances change by errors, deviations and run-out. `harmonics` is a dict frequency ->
    amplitudes, shape (2, m, 2), and `constants` has the shape (2, m). The first axis is (coast
    side, drive side), and the last axis of the amplitudes is (cosine, sine). `line_vectors`, shape
    (m, 2, 2), are the unit vectors of the lines of action with the signs of pinion and wheel.
    `arithmetic` is the number type, floats or balls (intervals).
    """
    harmonics: dict = {}
    convert, constants = arithmetic.convert, arithmetic.zeros(2, len(train.meshes))

    def add_harmonic(frequency: Fraction, j: int, sides: list[int], cosine: Any, sine: Any) -> None:
        """Add a cosine and a sine to sides of mesh j: 0 is the coast side, 1 the drive side.

        For a negative frequency, the signs of the frequency and of the sine are reversed.
        """
        amplitudes = harmonics.setdefault(abs(frequency), arithmetic.zeros(2, len(train.meshes), 2))
        amplitudes[sides, j] += (cosine, math.copysign(1.0, frequency) * sine)

    for j, mesh in enumerate(train.meshes):
        # Errors and run-out of the axes do not excite coast-side flanks that move with the axes.
        sides = [1] if mesh.moving_backlash else [0, 1]
        constants[:, j] += convert(mesh.error)
        for name, line_vector in zip((mesh.pinion, mesh.wheel), line_vectors[j], strict=True):
            body = train.by_name[name]
            # The offset of a body on a carrier is radial and tangential.
            c, s = arithmetic.cos_sin(body.angle) if body.carrier else (1.0, 0.0)
            x, y = map(convert, body.offset)
            constants[sides, j] += line_vector @ (c * x - s * y, s * x + c * y)
            if body.eccentricity:
                # Run-out e (cos(theta + phase), sin(theta + phase)) along the line of action.
                length, angle = arithmetic.polar(*line_vector)
                run_out = convert(body.eccentricity) * length
                phase = convert(body.eccentricity_phase) - angle
                phase += body.angle if body.carrier else 0.0
                c, s = arithmetic.cos_sin(phase)
                add_harmonic(train.speeds_at(mesh)[name], j, sides, run_out * c, -run_out * s)
        ratio, mesh_phase = train.frequency_ratios[j], train.phases[mesh.name]
        for side, deviation in enumerate((mesh.coast_deviation, mesh.deviation)):
            tooth_phase, tooth_table = tooth_deviation(train, mesh, side)
            for phase, table in ((mesh_phase, deviation.table()), (tooth_phase, tooth_table)):
                for order, cosine, sine in table.tolist():
                    # The deviation lags by `phase` mesh periods.
                    c, s = arithmetic.cos_sin(2.0 * arithmetic.pi * order * phase)
                    lagging = cosine * c - sine * s, cosine * s + sine * c
                    add_harmonic(int(order) * ratio, j, [side], *lagging)
    return harmonics, constants


def tooth_deviation(train: "GearTrain", mesh: Mesh, side: int) -> tuple[float, np.ndarray]:
    """Return (phase, deviation) of the excitation by loaded teeth on a side, 0 coast or 1 drive.

    The phase is in mesh periods, and the rows of the deviation are (order, cosine, sine) in m. It
    represents the transmission error of the mesh: if the gears follow it, the mesh force is
    constant.
    """
    pinion_drives = turning.driving_gear(mesh, train.speeds_at(mesh)) == mesh.pinion
    # If the wheel drives, the contact moves in the opposite direction along the path of contact. On
    # the coast side the other gear drives.
    direction = 1.0 if pinion_drives == bool(side) else -1.0
    if side:
        sign, phase = -1.0, train.phases[mesh.name]
    else:
        sign, phase = 1.0, train.coast_phases[mesh.name]
    return phase, mesh.transmission_error.table() * (1.0, sign, sign * direction)


def common_period(train: "GearTrain") -> int:
    """Return the number of reference mesh periods after which the excitation repeats.

    It is the least common multiple of the denominators of the frequencies of all meshes, run-outs
    and harmonic forces, which are fractions.
    """
    frequencies = list(train.frequency_ratios)
    for mesh in train.meshes:
        for name in (mesh.pinion, mesh.wheel):
            if train.by_name[name].eccentricity:
                frequencies.append(train.speeds_at(mesh)[name])
    frequencies += [force_frequency(train, force) for force in train.forces]
    return math.lcm(*(Fraction(frequency).denominator for frequency in frequencies))

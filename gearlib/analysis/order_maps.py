"""`order_map`: orders of run-ups and signals in blocks; `orders`: of runs at constant speed.

The shaft angle is known, so neither a window nor leakage is involved: Fourier integrals over the
angle are weighted sums of samples. Motions are smooth between switches of the stiffness and contact
events. The weights integrate cubic polynomials through neighbouring samples, and no polynomial
extends across a jump. Sums over every second sample give an estimate of the error.

Signals over time are interpolated at equal angles of the shaft by cubic splines (`rig_signals`).
Blocks of `order_map` are whole revolutions, so orders on its grid do not leak into each other; the
amplitude of an order between two grid points is up to 3.9 dB too small.
"""

import json
import math
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Annotated, Any, Literal

import numpy as np
import xarray as xr
from annotated_types import Gt, Le, MinLen
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid

from gearlib import checks
from gearlib.analysis.rig_signals import RigSignal, rig_signal
from gearlib.data.files import canonical_json
from gearlib.data.result import result_of_many
from gearlib.models.from_values import model_from_json
from gearlib.models.harmonics import Harmonics
from gearlib.parameters import CHOICE, Count, Finite, NonNegative, Positive, Unit, Values, checked

#: Phases, and revolutions, closer than this count as equal.
PHASE_TOLERANCE = 1e-9
#: Number of samples of an interpolating polynomial, and a Gauss rule that integrates it exactly.
STENCIL = 4
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(2)
#: Kind of amplitude -> function from the magnitude of the complex Fourier coefficient of an order
#: > 0 to the amplitude of this order.
_AMPLITUDES = {
    "rms": lambda magnitude: math.sqrt(2.0) * magnitude,
    "peak": lambda magnitude: 2.0 * magnitude,
    "power": lambda magnitude: 2.0 * magnitude**2,
}
#: Highest mesh order by default.
_DEFAULT_MESH_ORDERS = 5
#: Variables of runs -> (function from a run of `simulate` to their scale in SI units, units).
_VARIABLES = {
    "displacement": (lambda run: run.static_deflection, "m"),
    "velocity": (lambda run: run.static_deflection * run.mesh_frequency, "m s-1"),
    "acceleration": (lambda run: run.static_deflection * run.mesh_frequency**2, "m s-2"),
    "dynamic_force": (lambda run: run.force_scale, "N"),
}
#: Largest change of a coefficient if every second sample is left out, over the root mean square.
MAX_CHANGE = 0.05


@dataclass
class Motion:
    """Samples of a variable of a run over the mesh phase, with the speed course of the run."""

    phase: np.ndarray  #: mesh phase since the first sample, rad, shape (k,)
    values: np.ndarray  #: samples, shape (k,), for a train with m meshes (k, m)
    jumps: np.ndarray  #: sorted phases at which the variable or its slope jumps, rad
    speeds: np.ndarray  #: speed course: rows (time since the first sample in s, speed in rpm)
    teeth: float  #: mesh periods per revolution
    max_order: float  #: highest order by default
    units: str
    coords: dict = field(default_factory=dict)  #: dimensions of the values other than the phase
    attrs: dict = field(default_factory=dict)  #: attributes of the order map

    @property
    def travel(self) -> float:
        """Number of revolutions of the run, the integral of the speed in rpm over the time in s."""
        return float(np.trapezoid(self.speeds[:, 1], self.speeds[:, 0])) / 60.0


@dataclass
class FourierSums:
    """Fourier coefficients of the blocks of a signal, with an estimate of their errors."""

    coefficients: np.ndarray  #: complex, shape (blocks, orders) or, for trains, (..., meshes)
    #: Absolute changes of the coefficients if every second sample is left out, same shape.
    changes: np.ndarray
    mean_squares: np.ndarray  #: mean squares of the samples of each block, without the orders

    @property
    def rms(self) -> float:
        """Largest root mean square of the samples among the blocks."""
        return math.sqrt(self.mean_squares.max())


class ShaftRotation:
    """Rotation of a shaft with a piecewise linear speed course."""

    def __init__(self, speed_course: ArrayLike):
        """Integrate a speed course, rows (time in s, speed in rpm), shape (n, 2), to revolutions.

        The speed is linear between the rows, so the revolutions are exact by the trapezoidal rule.
        """
        self._time, speed_rpm = np.array(speed_course, float).T
        #: Speed in rev/s, its slope in rev/s^2, and revolutions since the first row.
        self._speed = speed_rpm / 60.0
        self._slope = np.diff(self._speed) / np.diff(self._time)
        self._revolutions = cumulative_trapezoid(self._speed, self._time, initial=0.0)

    def revolutions(self, time: np.ndarray) -> np.ndarray:
        """Return the number of revolutions at times in s, counted from the first row of the course.

        Between two rows the acceleration is constant; after the last row the speed is constant.
        """
        i = np.clip(np.searchsorted(self._time, time, "right") - 1, 0, None)
        slope = np.append(self._slope, 0.0)[i]
        duration = time - self._time[i]
        return self._revolutions[i] + (self._speed[i] + 0.5 * slope * duration) * duration

    def time_and_speed(self, revolutions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (times in s, speeds in rpm) after given numbers of revolutions.

        Revolutions are counted from the first row of the course, up to its last row. This is the
        inverse of the method `revolutions`; between two rows the time is the root of a quadratic
        equation.
        """
        i = np.searchsorted(self._revolutions, revolutions, "right") - 1
        i = np.clip(i, 0, self._slope.size - 1)
        start_speed = self._speed[i]
        angle = revolutions - self._revolutions[i]  # since row i, in revolutions
        speed = np.sqrt(np.maximum(start_speed**2 + 2.0 * self._slope[i] * angle, 0.0))
        # This form of the root of the quadratic equation is accurate also if the start speed is 0.
        duration = np.zeros(angle.shape)
        np.divide(2.0 * angle, start_speed + speed, where=angle > 0.0, out=duration)
        return self._time[i] + duration, 60.0 * speed


@checked
def order_map(
    run,
    *,
    variable="displacement",
    resolution: Annotated[float, Gt(0), Le(1), Unit("1")] = 1.0,
    highest: Positive | None = None,
    amplitude: Annotated[Literal["rms", "peak", "power"], CHOICE] = "rms",
    tacho: Annotated[tuple[Finite, ...] | None, Values()] = None,
    pulses_per_revolution: Count = 1,
    teeth: Count = 1,
    orders: Annotated[tuple[NonNegative, ...] | None, Values(), MinLen(1)] = None,
):
    """Compute the order amplitudes of a run-up or a signal in blocks of whole revolutions.

    Parameters
    ----------
    run : xarray.Dataset
        A result of `gearlib.run_up` with samples_per_period, or of `gearlib.simulate`. With 128
        samples per mesh period the error relative to the largest amplitude is about 1e-6 for the
        displacement, and 1e-4 for the force, which jumps with the stiffness. Times and phases count
        from the first sample.
        Alternatively any signal over ``time`` (s) with ``speed`` (min-1), such as a result of
        `gearlib.read_measured`: it is interpolated at equal angles by cubic splines. NaN marks a
        missing sample. A gap is a step between samples that exceeds three times the usual step, or
        a quarter of the wave of the highest order; blocks with a gap are left out. Where the speed
        is missing, it is interpolated linearly. A negative speed means backward rotation; blocks in
        which the speed is 0 over several samples or changes its sign are left out.
    variable : {"displacement", "velocity", "acceleration", "dynamic_force"}
        Name of the variable; of a signal any variable.
    resolution : float, default 1
        Largest order spacing, > 0 and <= 1. Blocks have a whole number of revolutions, and the
        actual spacing, ``order_resolution``, is the reciprocal of this number.
    highest : float, optional
        Highest order. By default the fifth mesh order, or for a signal the highest order with four
        samples per wave.
    amplitude : {"rms", "peak", "power"}
        Root mean square, amplitude or mean square of a sine. Order 0 is the mean, or its square.
    tacho : sequence of float, optional
        For a signal, instead of its speed: times of tacho pulses in s. The map extends from the
        first to the last pulse. Each interval between pulses is compared with its neighbours. A
        single missing pulse is counted. A single double pulse is left out (if two pulses are closer
        than 1 % of an interval, the later one). Irregular pulses at either end are left out, too;
        any other irregular pulse raises an error with its time.
    pulses_per_revolution : int, default 1
        Number of tacho pulses per revolution, at equal angles.
    teeth : int, default 1
        For a signal: mesh periods per revolution.
    orders : sequence of float, optional
        Selected orders, multiples of the order spacing. By default all up to the highest.

    Returns
    -------
    xarray.Dataset
        Over ``time`` (s, the middle of each block of whole revolutions) and ``order`` (waves per
        revolution of the gear to which the speed refers): amplitude; phase (rad, of a cosine of
        order times the shaft angle since the start of the run, or since the first tacho pulse);
        amplitude_error, an estimate. Over ``time``: rpm, the mean speed, and overall, the root mean
        square of the variable without its mean. Trains have the dimension ``mesh`` as well. Scalars
        order_resolution and teeth. For a signal, the attribute ``comment`` describes what was left
        out or repaired and why, and the attributes ``left_out`` (intervals without a block),
        ``missing_pulses`` (the pulses before and after each) and ``double_pulses`` have the times
        in s as JSON.

    Raises
    ------
    ValueError
        If an argument is invalid, or if a coefficient changes by more than 5 % of the root mean
        square when every second sample is left out.
    """
    allowed = f"one of {', '.join(map(repr, _VARIABLES))}, or of a signal the name of any variable"
    checks.require(isinstance(variable, str), "variable", variable, allowed)
    if orders is not None and highest is None:
        highest = max(*orders, resolution)
    motion = _motion(run, variable, highest, tacho, pulses_per_revolution, teeth)
    revolutions = math.ceil(1.0 / resolution - 1e-12)  # per block
    run_revolutions = motion.travel
    block_count = int(run_revolutions / revolutions + PHASE_TOLERANCE)
    if block_count < 1:
        raise ValueError(
            f"resolution = {resolution!r} is not allowed for this run: a block must have "
            f"{revolutions} whole revolutions, and the run has {run_revolutions:.4g}"
        )
    highest = motion.max_order if highest is None else highest
    # The orders are 0, 1 / revolutions, 2 / revolutions, ... up to the highest.
    order_count = int(highest * revolutions + 1e-9) + 1
    if isinstance(motion, RigSignal):
        sums, start_times, end_times, directions = _signal_sums(
            motion, variable, revolutions, highest, order_count
        )
        motion.attrs |= motion.left_out(start_times, end_times, revolutions)
    else:
        sums = _run_sums(motion, revolutions, highest, block_count, order_count)
        bounds = revolutions * np.arange(block_count + 1.0)
        times, _ = ShaftRotation(motion.speeds).time_and_speed(bounds)
        start_times, end_times, directions = times[:-1], times[1:], 1.0
    indices = np.arange(order_count)
    if orders is not None:
        indices = np.array([round(order * revolutions) for order in orders])
        largest_order = (order_count - 1) / revolutions
        allowed = f"one of 0, {1.0 / revolutions:.4g}, ..., {largest_order:.4g}"
        for order, index in zip(orders, indices.tolist(), strict=True):
            is_on_grid = abs(index - order * revolutions) <= 1e-09 * max(order, 1.0)
            checks.require(is_on_grid and index < order_count, "orders", order, allowed)
    rpm = 60.0 * revolutions * directions / (end_times - start_times)
    return _dataset(
        motion, variable, amplitude, sums, indices, revolutions, start_times, end_times, rpm
    )


def _run_sums(
    motion: Motion, revolutions: int, highest: float, block_count: int, order_count: int
) -> FourierSums:
    """Return the Fourier coefficients of the blocks of a run, after a check of their errors.

    Each of the `block_count` blocks has the whole number `revolutions` of shaft revolutions. The
    `order_count` orders (waves per revolution) are 0, 1 / `revolutions`, 2 / `revolutions`, ...
    Raise ValueError if `highest`, the highest order, has fewer than four samples per wave, or if
    the coefficients change too much when every second sample is left out.
    """
    samples_per_period = _samples_per_period(motion.phase)
    max_order = 0.25 * samples_per_period * motion.teeth
    if highest > max_order * (1.0 + PHASE_TOLERANCE):
        raise ValueError(
            f"highest = {highest:g} is not allowed with samples_per_period = {samples_per_period}: "
            f"it must be at most {max_order:.4g}, orders with four samples a wave"
        )
    # Wave numbers are in radians of the wave per radian of the mesh phase: order over teeth.
    step = 1.0 / (motion.teeth * revolutions)
    blocks = math.tau / step, block_count, step, order_count
    sums = fourier(motion.phase, motion.values, motion.jumps, *blocks)
    _check_changes(sums, motion.phase)
    return sums


def _signal_sums(
    signal: RigSignal, variable: str, revolutions: int, highest: float, order_count: int
) -> tuple:
    """Return (Fourier sums, start times, end times, directions) of the blocks of a measured signal.

    Blocks have the whole number `revolutions` of shaft revolutions, and the `order_count` orders
    (waves per revolution) are multiples of 1 / `revolutions` from 0 to `highest`. Times are in s,
    and directions of rotation are 1 or -1; all are sorted by time. `variable` is the name of the
    signal for the error message. The errors of the coefficients are returned, but not checked,
    because noise changes the coefficients.
    """
    coefficients, changes, mean_squares, blocks = [], [], [], []
    for samples, start_time, end_time, direction in signal.blocks(revolutions, highest):
        # The trapezoidal rule takes half of the first and half of the last sample.
        periodic_samples, squares = samples[:-1].copy(), samples[:-1] ** 2
        periodic_samples[0] = 0.5 * (samples[0] + samples[-1])
        squares[0] = 0.5 * (samples[0] ** 2 + samples[-1] ** 2)
        fine = np.fft.rfft(periodic_samples, norm="forward")[:order_count]
        # With every second sample left out, the coefficients show their sampling error.
        coarse = np.fft.rfft(periodic_samples[::2], norm="forward")[:order_count]
        coefficients.append(fine)
        changes.append(np.abs(fine - coarse))
        mean_squares.append(squares.mean())
        blocks.append((start_time, end_time, direction))
    if not blocks:
        reasons = ", ".join(dict.fromkeys(reason for _, _, reason in signal.breaks))
        raise ValueError(
            f"{variable} is not allowed: no block of {revolutions} whole revolutions is complete "
            f"({reasons}), and there must be one at least"
        )
    order = np.argsort([start_time for start_time, _, _ in blocks])
    sums = FourierSums(
        np.array(coefficients)[order], np.array(changes)[order], np.array(mean_squares)[order]
    )
    return sums, *np.array(blocks)[order].T


def _motion(
    run, variable: str, highest: float | None, tacho: Any, pulses_per_revolution: int, teeth: int
) -> Motion | RigSignal:
    """Return the samples of a variable as a `Motion` of a run, or as a measured `RigSignal`.

    `run` is a dataset of `run_up` or `simulate`, or a measured signal, which has a time but no mesh
    phase. `highest` is the highest order or None. For signals, `tacho` has the times of the tacho
    pulses in s, or is None, and `teeth` is the number of mesh periods per revolution. Raise
    ValueError if an argument of `order_map` does not suit the dataset.
    """
    names = set(getattr(run, "variables", ()))  # empty unless `run` is a dataset
    if "time" in names and "phase" not in names:
        return rig_signal(run, variable, highest, tacho, pulses_per_revolution, teeth)
    checks.check_choice("variable", variable, tuple(_VARIABLES))
    condition = "for a run-up, whose shaft angle is known"
    checks.require(tacho is None, "tacho", tacho, f"None {condition}")
    if pulses_per_revolution != 1:
        raise checks.InputError("pulses_per_revolution", pulses_per_revolution, f"1 {condition}")
    simulated_names = {"mesh_frequency", "static_deflection", "force_scale", "contact", *_VARIABLES}
    is_simulation = simulated_names <= names and run.displacement.dims[0] == "phase"
    is_run_up = names >= {variable, "time", "speed", "phase"} and "time" in run.sizes
    if not (is_simulation or is_run_up):
        expected = "a dataset of gearlib.run_up with samples_per_period, or of gearlib.simulate"
        raise checks.InputError("run", _name_of_run(run), expected)
    return _motion_of_run(run, variable)


def _name_of_run(run: Any) -> Any:
    """Return the title or type of a dataset for an error message; other objects are returned."""
    return run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run


def _check_status(run: xr.Dataset) -> None:
    """Raise ValueError if a run has failed."""
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")


def _motion_of_run(run: xr.Dataset, variable: str) -> Motion:
    """Return the samples of a variable of `gearlib.run_up` or `gearlib.simulate`, in SI units.

    The result is a `Motion`: the samples over the mesh phase, the phases of their jumps, the speed
    course, and the number of mesh periods per revolution, found from phase and shaft angle.
    """
    _check_status(run)
    is_run_up = "time" in run.sizes
    parameters, phase = json.loads(run.attrs["parameters"]), run.phase.values
    if is_run_up:
        speed, time = run.speed.values, run.time.values
        speed_course = np.array(parameters["speed"])
        # Shaft angle in rad from speeds in rpm, by the trapezoidal rule.
        angle = math.pi / 60.0 * ((speed[1:] + speed[:-1]) * np.diff(time)).sum()
        scale, units = 1.0, run[variable].attrs["units"]  # run-ups are in SI units
        courses = run.attrs["parameters"]
    else:
        # A run of `simulate` has a constant speed; its samples are dimensionless.
        phase = phase - phase[0]
        rpm, omega = float(run.speed), float(run.mesh_frequency)  # omega in rad/s
        duration = math.tau * parameters["record_periods"] / omega
        speed_course = np.array([[0.0, rpm], [duration, rpm]])
        angle = math.pi / 30.0 * rpm * phase[-1] / omega
        scale_function, units = _VARIABLES[variable]
        scale = float(scale_function(run))
        courses = _courses_json(speed_course)
    teeth = float((phase[-1] - phase[0]) / angle) if angle > 0.0 else 1.0
    # Mesh periods per revolution are an integer, apart from rounding errors and turning carriers.
    if abs(teeth - round(teeth)) < 1e-6 * teeth:
        teeth = float(round(teeth))
    if is_run_up:
        # The variable or its slope may jump at corners of the courses and at contact events.
        times = [row[0] for row in (*parameters["speed"], *parameters["load"])]
        times.extend(run.event_time.values if "event_time" in run else ())
        event_phases = math.tau * teeth * ShaftRotation(speed_course).revolutions(np.array(times))
    else:
        event_phases = _event_phases(run)
    return Motion(
        phase=phase,
        values=run[variable].values * scale,
        jumps=_jumps(run, variable, event_phases),
        speeds=speed_course,
        teeth=teeth,
        max_order=_DEFAULT_MESH_ORDERS * teeth,
        units=units,
        coords={name: run[name].variable for name in run[variable].dims[1:]},
        attrs=_attributes(run, "references", "gear_pair", "model") | {"parameters": courses},
    )


def _event_phases(run: xr.Dataset) -> np.ndarray:
    """Return the phases of the start, end and contact events of the record of a run of `simulate`.

    They are in rad of the mesh phase since the first sample.
    """
    end_phase = math.tau * recorded_periods(run)
    return np.array([0.0, end_phase, *(run.event_phase.values - run.phase.values[0])])


def _attributes(run: xr.Dataset, *names: str) -> dict:
    """Return those attributes of a run whose names are given, without names that it lacks."""
    return {name: run.attrs[name] for name in names if name in run.attrs}


def _courses_json(speed_course: np.ndarray) -> str:
    """Return a speed course, rows (time in s, speed in rpm), with a constant load as JSON text."""
    return canonical_json({"speed": speed_course.tolist(), "load": [[0.0, 1.0]]})


def _jumps(run: xr.Dataset, variable: str, event_phases: np.ndarray) -> np.ndarray:
    """Return the sorted mesh phases, in rad since the first sample, at which a variable may jump.

    These are `event_phases`, the phases of contact events and ends of the record, and the phases at
    which the mesh stiffness jumps, if the attributes of the run describe the model. Displacement
    and velocity are continuous, so they have none.
    """
    if variable in ("displacement", "velocity"):
        return np.empty(0)  # treated as smooth
    phases = event_phases
    # The model is None if the attributes do not describe it.
    model = model_from_json(run.attrs.get("gear_pair") or run.attrs.get("model", ""))
    if model is not None:
        # The mesh phase of a run-up starts at 0.
        start_phase = 0.0 if "time" in run.dims else float(run.phase[0])
        end_phase = float(run.phase[-1])
        switches, period = _stiffness_switches(model)
        # One mesh period is added at both ends, so that no switch at an end is missed.
        first_period = (start_phase - math.tau) // period
        last_period = (end_phase + math.tau) // period
        period_starts = period * np.arange(first_period, last_period + 1.0)
        phases = np.concatenate([phases, (period_starts[:, None] + switches).ravel() - start_phase])
    phases = np.sort(phases)
    return phases[np.diff(phases, prepend=-np.inf) > PHASE_TOLERANCE]


def _stiffness_switches(model: Any) -> tuple:
    """Return (mesh phases at which the mesh stiffness of a model jumps, its period), both in rad.

    The period is one mesh period, or several if the stiffness repeats only after more of them.
    """
    if model.equation is None:
        # Models with several coordinates have intervals of constant stiffness.
        segment_bounds = model.system(tuning=1.0).starts  # the same at all tunings
        return segment_bounds[:-1], segment_bounds[-1]
    switches = [[0.0]]
    # The stiffness is piecewise linear over the phase, with (value at the start, slope) per piece.
    for pieces in (model.equation.drive_stiffness, model.equation.coast_stiffness):
        start_values, slopes = pieces.lines.T
        end_values = start_values + slopes * np.diff(pieces.breaks)
        jumps = np.abs(np.roll(end_values, 1) - start_values)
        is_jump = jumps > PHASE_TOLERANCE * np.abs(start_values).max()
        switches.append(pieces.breaks[:-1][is_jump])
    return np.unique(np.concatenate(switches)), math.tau


def fourier(
    phase, values, jumps, block_length, block_count, wave_number_step, order_count
) -> FourierSums:
    """Compute Fourier coefficients of samples in consecutive blocks, with an error estimate.

    `values`, shape (k,) or (k, meshes), are samples at the sorted phases `phase`, shape (k,), in
    rad. Block b extends from b * block_length to (b + 1) * block_length, for b < block_count.
    Coefficient n < order_count is the mean of values * exp(-i w phase) over the block, with the
    wave number w = n * wave_number_step. The values or their slopes jump at the sorted phases
    `jumps`. The error estimate is the change of a coefficient without every second sample.
    """
    blocks = block_length, block_count, wave_number_step, order_count
    sums, mean_squares = _block_sums(phase, values, jumps, *blocks)
    coarse_sums, _ = _block_sums(phase[::2], values[::2], jumps, *blocks)
    return FourierSums(sums, np.abs(sums - coarse_sums), mean_squares)


def _block_sums(
    phase, values, jumps, block_length, block_count, wave_number_step, order_count
) -> tuple:
    """Return (Fourier coefficients, mean squares) of samples in consecutive blocks of phase.

    `values`, shape (k,) or (k, meshes), are samples at the sorted phases `phase` in rad, and jump
    at the sorted phases `jumps`. Block b starts at b * block_length, and coefficient n has the wave
    number n * wave_number_step. Coefficients have the shape (block_count, order_count, ...) and
    mean squares (block_count, ...), with further dimensions as in `values`.
    """
    inner_shape = values.shape[1:]
    table = values.reshape(len(values), -1).T  # one row per mesh
    sums = np.zeros((block_count, order_count, len(table)), complex)
    mean_squares = np.zeros((block_count, len(table)))
    # A sample at a jump may belong to either side, so it is left out.
    ends = np.concatenate([[-np.inf], jumps, [np.inf]])
    segments = np.searchsorted(jumps, phase)
    distances = np.minimum(phase - ends[segments], ends[segments + 1] - phase)
    phase, table = phase[distances > PHASE_TOLERANCE], table[:, distances > PHASE_TOLERANCE]
    for b in range(block_count):
        start = b * block_length
        bounds = start - PHASE_TOLERANCE, (b + 1) * block_length - PHASE_TOLERANCE
        first, stop = np.searchsorted(phase, bounds)
        # Polynomials at the ends of a block need samples outside it.
        indices = np.arange(max(first - STENCIL, 0), min(stop + STENCIL, len(phase)))
        block_phase = phase[indices] - start
        weights = _integration_weights(block_phase, jumps - start, block_length)
        samples = table[:, indices]
        weighted_samples = weights / block_length * samples
        # Each order multiplies the terms by the same factors once more.
        rotation = np.exp(-1j * wave_number_step * block_phase)
        terms = weighted_samples.astype(complex)
        for n in range(order_count):
            sums[b, n] = terms.sum(axis=1)
            terms *= rotation
        mean_squares[b] = (weighted_samples * samples).sum(axis=1)
    sums = sums.reshape(block_count, order_count, *inner_shape)
    return sums, mean_squares.reshape(block_count, *inner_shape)


def _integration_weights(phase: np.ndarray, jumps: np.ndarray, length: float) -> np.ndarray:
    """Return the quadrature weights, shape (k,), of samples for an integral from 0 to `length`.

    The integrand is sampled at the sorted phases `phase`, shape (k,), which may extend beyond both
    ends. Cubic polynomials interpolate neighbouring samples, but do not extend across the sorted
    phases `jumps`, where the integrand jumps.
    """
    jumps = jumps[(jumps > phase[0]) & (jumps < phase[-1])]
    ends = np.concatenate([[0.0, length], phase, jumps])
    bounds = np.unique(ends[(ends >= 0.0) & (ends <= length)])
    # Intervals between these bounds have one polynomial each.
    half_lengths, middles = 0.5 * np.diff(bounds), 0.5 * (bounds[1:] + bounds[:-1])
    # The number of a smooth segment is the number of jumps before it.
    segment_of_sample = np.searchsorted(jumps, phase)
    segment_of_interval = np.searchsorted(jumps, middles)
    # Indices of the samples that lie in the segment of each interval.
    low = np.searchsorted(segment_of_sample, segment_of_interval, side="left")
    high = np.searchsorted(segment_of_sample, segment_of_interval, side="right")
    # A segment between two jumps without samples uses the neighbouring samples on both sides.
    is_empty = (low == high).astype(int)
    low, high = np.maximum(low - is_empty, 0), np.minimum(high + is_empty, phase.size)
    stencil_sizes = np.minimum(high - low, STENCIL)
    first_samples = np.searchsorted(phase, middles) - stencil_sizes // 2
    first_samples = np.clip(first_samples, low, high - stencil_sizes)
    weights = np.zeros(phase.size)
    # A segment with fewer than four samples has polynomials of a lower degree.
    for n in np.unique(stencil_sizes).tolist():
        intervals = np.flatnonzero(stencil_sizes == n)
        indices = first_samples[intervals] + np.arange(n)[:, None]
        # Positions of samples and Gauss nodes relative to the middle of each interval.
        positions = phase[indices] - middles[intervals]
        nodes = half_lengths[intervals] * GAUSS_NODES[:, None]
        for i in range(n):
            lagrange = np.ones(nodes.shape)
            for j in range(n):
                if j != i:
                    lagrange *= (nodes - positions[j]) / (positions[i] - positions[j])
            integrals = half_lengths[intervals] * (GAUSS_WEIGHTS @ lagrange)
            weights += np.bincount(indices[i], integrals, minlength=phase.size)
    return weights


def _samples_per_period(phase: np.ndarray) -> int:
    """Return the number of samples in a mesh period, from the median step of phases in rad."""
    return round(math.tau / float(np.median(np.diff(phase)))) if phase.size > 1 else 1


def _check_changes(sums: FourierSums, phase: np.ndarray) -> None:
    """Raise ValueError if a coefficient changes too much when every second sample is left out.

    `sums` are Fourier coefficients with these changes. The limit is 5 % (`MAX_CHANGE`) of the root
    mean square of the samples. `phase` has the phases of the samples in rad, for the message.
    """
    largest_change = sums.changes.max()
    if largest_change > MAX_CHANGE * sums.rms:
        raise ValueError(
            f"samples_per_period = {_samples_per_period(phase)} is not allowed for these orders: "
            f"with half of the samples one changes by {largest_change / sums.rms:.2g} of the "
            f"root mean square, and it must be at most {MAX_CHANGE:g}"
        )


def _dataset(
    motion, variable, amplitude, sums, indices, revolutions, start_times, end_times, rpm
) -> xr.Dataset:
    """Return the order map of a variable, the dataset that `order_map` returns.

    `motion` is the run (a `Motion`) or the measured signal (a `RigSignal`), and `sums` are the
    `FourierSums` of its blocks. `amplitude` is "rms", "peak" or "power". The orders are `indices` /
    `revolutions`, where `revolutions` is the number of revolutions of a block. Blocks extend from
    `start_times` to `end_times` in s and have the mean speeds `rpm`.
    """
    means = np.abs(sums.coefficients[:, 0])
    overall = np.sqrt(np.maximum(sums.mean_squares - means**2, 0.0))
    coefficients, changes = sums.coefficients[:, indices], sums.changes[:, indices]
    unit, label = motion.units, variable.replace("_", " ")
    magnitudes = np.abs(coefficients)
    # A sine, unlike the mean at order 0, has two complex coefficients of this magnitude.
    is_sine = (indices > 0).reshape(1, -1, *[1] * (magnitudes.ndim - 2))
    mean_levels, level_unit = magnitudes, unit
    if amplitude == "power":
        mean_levels = magnitudes**2
        level_unit = f"({unit})2" if " " in unit else f"{unit}2"
    levels = np.where(is_sine, _AMPLITUDES[amplitude](magnitudes), mean_levels)
    errors = np.where(is_sine, 2.0, 1.0) * changes
    dims, block_dims = ("time", "order", *motion.coords), ("time", *motion.coords)
    phase_name = "of a cosine of the order times the shaft angle"
    overall_name = f"root mean square of the {label} without its mean"
    # Each variable is (dimensions, values, units, long name).
    variables = {
        "amplitude": (dims, levels, level_unit, f"{amplitude} of the orders of the {label}"),
        "phase": (dims, np.angle(coefficients), "rad", phase_name),
        "amplitude_error": (dims, errors, unit, "estimated error of the peak amplitude"),
        "rpm": ("time", rpm, "min-1", "mean speed in the block, negative backwards"),
        "overall": (block_dims, overall, unit, overall_name),
        "order_resolution": ((), 1.0 / revolutions, "1", "order spacing"),
        "teeth": ((), motion.teeth, "1", "mesh periods in a revolution"),
        "time": ("time", 0.5 * (start_times + end_times), "s", "middle of the block"),
        "order": ("order", indices / revolutions, "1", "order, waves per revolution"),
    }
    data = {
        name: (dims, values, {"units": units, "long_name": long_name})
        for name, (dims, values, units, long_name) in variables.items()
    }
    coords = {name: data.pop(name) for name in ("time", "order")} | motion.coords
    title, method = f"Order map of the {label}", "Fourier sums over the shaft angle"
    names = {"variable": variable, "amplitude": amplitude}
    return result_of_many(title, data, coords, method, **names, **motion.attrs)


@checked
def orders(run, *, count: Count | None = None):
    """Compute the order spectrum of the mesh force and the transmission error of a run.

    Parameters
    ----------
    run : xarray.Dataset
        A result of `gearlib.simulate` that records whole revolutions or whole periods of an orbit.
    count : int, optional
        Highest mesh order, at most a quarter of the samples per period. By default 10.

    Returns
    -------
    xarray.Dataset
        Over ``order`` (waves per revolution of the gear to which the speed refers, from 0):
        mesh_order (order over teeth), force_amplitude (N, peak; the mean at order 0), force_phase,
        error_amplitude (m) and error_phase (rad; of a cosine of the mesh phase times the mesh
        order); force_amplitude_error and error_amplitude_error, estimated from the changes with
        half of the samples; mean_square_force and mean_square_error, of the samples. Trains have
        the dimension ``mesh`` as well.

    Raises
    ------
    ValueError
        If the run failed or has no whole revolutions, or if a coefficient changes by more than 5 %
        of the root mean square when every second sample is left out.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        expected = "a dataset of gearlib.simulate for a model with rotating bodies"
        raise checks.InputError("run", _name_of_run(run), expected)
    mesh_orders, sums = record_sums(run, count)
    dims = ("order", *run.displacement.dims[1:])
    column_shape = -1, *[1] * (len(dims) - 1)
    # Phases of the orders refer to the mesh phase 0, not to the first sample.
    rotation = np.exp(-1j * mesh_orders * float(run.phase[0])).reshape(column_shape)
    peak_factor = np.where(mesh_orders > 0.0, 2.0, 1.0).reshape(column_shape)
    data: dict = {"mesh_order": ("order", mesh_orders)}
    for name, (values, block_sums) in sums.items():
        _check_changes(block_sums, run.phase.values)
        coefficients, changes = block_sums.coefficients[0], block_sums.changes[0]
        data[f"{name}_amplitude"] = dims, peak_factor * np.abs(coefficients)
        data[f"{name}_phase"] = dims, np.angle(coefficients * rotation)
        data[f"{name}_amplitude_error"] = dims, peak_factor * changes
        data[f"mean_square_{name}"] = dims[1:], (values**2).mean(axis=0)
    data |= {name: run[name].values for name in ("tuning", "speed", "mesh_frequency", "period")}
    periods = recorded_periods(run)
    coords = {"order": np.arange(mesh_orders.size) * float(_periods_per_revolution(run)) / periods}
    coords |= {name: run[name].values for name in dims[1:]}
    dataset = result_of_many("Order spectrum of a gear mesh", data, coords, "Fourier sums")
    long_name = "order, waves per revolution of the gear to which the speed refers"
    dataset["order"].attrs["long_name"] = long_name
    dataset.attrs |= _attributes(run, "references", "gear_pair", "parameters")
    return dataset


def _periods_per_revolution(run: xr.Dataset) -> Fraction:
    """Return the mesh periods per revolution of the gear to which the speed of a run refers.

    This is the number of teeth of the gear, except in a planetary train whose carrier turns, where
    it is a fraction. It is computed from the mesh frequency in rad/s and the speed in rpm.
    """
    ratio = float(run.mesh_frequency) * 60.0 / (math.tau * float(run.speed))
    return Fraction(ratio).limit_denominator(10_000)


def recorded_periods(run: xr.Dataset) -> int:
    """Return the number of mesh periods in the record of a run of `simulate`."""
    return json.loads(run.attrs["parameters"])["record_periods"]


def record_sums(run: xr.Dataset, count: int | None = None, fractional_orders: bool = True) -> tuple:
    """Compute the Fourier sums of mesh force and transmission error of a run of `simulate`.

    Return (mesh orders, {"force": (samples, sums), "error": (samples, sums)}) with samples in N and
    m and their `FourierSums` over the whole record. A mesh order is a frequency over the mesh
    frequency. `count` is the highest one, by default 10 or a quarter of the samples per period, if
    that is less. The mesh orders are integers from 0, or with `fractional_orders` multiples of 1
    over the number of recorded mesh periods; the record must then have whole revolutions or whole
    periods of a periodic orbit.
    """
    _check_status(run)
    periods, teeth = recorded_periods(run), _periods_per_revolution(run).numerator
    orbit_periods = int(run.period)
    is_periodic = orbit_periods > 0 and periods % orbit_periods == 0
    if fractional_orders and periods % teeth and not is_periodic:
        raise ValueError(
            f"record_periods = {periods} is not allowed: it must be a multiple of {teeth}, whole "
            "revolutions of the gear to which the speed refers"
            + (f", or of the {orbit_periods} periods of the orbit" if orbit_periods else "")
        )
    max_count = max(run.phase.size // periods // 4, 1)
    count = min(10, max_count) if count is None else count
    checks.require(count <= max_count, "count", count, f"an integer from 1 to {max_count}")
    steps_per_order = periods if fractional_orders else 1
    length = math.tau * periods
    order_count = count * steps_per_order + 1
    phase = run.phase.values - run.phase.values[0]
    margin = 2 * STENCIL
    if is_periodic:
        # The record is extended periodically, so that samples surround its first and last phase.
        phase = np.concatenate([phase[-margin:] - length, phase, phase[:margin] + length])
    sums = {}
    for name, values, variable in (
        ("force", run.dynamic_force.values * float(run.force_scale), "dynamic_force"),
        ("error", transmission_error(run) * float(run.static_deflection), "displacement"),
    ):
        extended_values, jumps = values, _jumps(run, variable, _event_phases(run))
        if is_periodic:
            extended_values = np.concatenate([values[-margin:], values, values[:margin]])
        step = 1.0 / steps_per_order
        sums[name] = values, fourier(phase, extended_values, jumps, length, 1, step, order_count)
    return np.arange(order_count) / steps_per_order, sums


def mesh_order_amplitudes(run: xr.Dataset) -> tuple:
    """Return (mesh orders from 1, mesh force amplitudes in N, transmission error amplitudes in m).

    `run` is a dataset of `simulate`; mesh order n is n times the mesh frequency. An amplitude is
    NaN if it changes by more than 5 % of the root mean square when every second sample is left out.
    """
    mesh_orders, sums = record_sums(run, fractional_orders=False)
    amplitudes = []
    for name in ("force", "error"):
        _, block_sums = sums[name]
        is_unreliable = block_sums.changes[0] > MAX_CHANGE * block_sums.rms
        # The real amplitude of a cosine is twice the magnitude of its complex coefficient.
        peaks = np.where(is_unreliable, math.nan, 2.0 * np.abs(block_sums.coefficients[0]))
        amplitudes.append(peaks[1:])  # without the mean, order 0
    return mesh_orders[1:], *amplitudes


def transmission_error(run: xr.Dataset) -> np.ndarray:
    """Return the transmission error at each sample of a run, in static deflections.

    `run` is a dataset of `simulate`. The transmission error is the displacement of the mesh minus
    its profile deviation; the displacement itself for a model without profile deviation.
    """
    displacement = run.displacement.values
    # The attributes of the dataset describe the model as JSON.
    model = json.loads(run.attrs.get("gear_pair") or run.attrs["model"])
    deviation = model.get("deviation") if "profile" in model else None
    if not deviation:
        return displacement
    # The amplitudes of the deviation in m become static deflections.
    phase, scale = run.phase.values, 1.0 / run.static_deflection.item()
    # Each harmonic has the order k and the amplitudes a and b of cosine and sine.
    waves = Harmonics(deviation["cosines"], deviation["sines"]).table(scale)
    return displacement - sum(a * np.cos(k * phase) + b * np.sin(k * phase) for k, a, b in waves)

"""`order_map`: orders of run-ups and signals in blocks; `orders`: of runs at constant speed.

The shaft angle is known, so no window is needed and there is no leakage: Fourier integrals over the
angle are weighted sums of samples. Motions are smooth between stiffness jumps and contact events.
The weights integrate cubic polynomials through neighbouring samples, and no polynomial extends
across a jump. Sums over every second sample give an error estimate.

Measured signals are resampled at equal shaft angles by cubic splines (`rig_signals`). The blocks of
`order_map` are whole revolutions, so orders on its grid do not leak into each other; the amplitude
of an order between two grid points is up to 3.9 dB too small.
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
from gearlib.analysis.rig_signals import RigSignal, create_rig_signal
from gearlib.data.files import canonical_json
from gearlib.data.result import make_study_result
from gearlib.models.from_values import model_from_json
from gearlib.models.harmonics import Harmonics
from gearlib.parameters import CHOICE, Count, Finite, NonNegative, Positive, Unit, Values, checked

#: Phases or numbers of revolutions that differ by less than this are equal.
PHASE_TOLERANCE = 1e-9
#: Number of samples of an interpolating polynomial, and a Gauss rule that integrates it exactly.
STENCIL_SIZE = 4
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(2)
#: Kind of amplitude -> function that converts the magnitude of the complex Fourier coefficient of
#: an order > 0 to the amplitude of this order.
_AMPLITUDES = {
    "rms": lambda magnitude: math.sqrt(2.0) * magnitude,
    "peak": lambda magnitude: 2.0 * magnitude,
    "power": lambda magnitude: 2.0 * magnitude**2,
}
#: Highest mesh order by default.
_DEFAULT_MESH_ORDERS = 5
#: Variable of a run -> (function that returns its scale in SI units for a run of `simulate`,
#: units).
_VARIABLES = {
    "displacement": (lambda run: run.static_deflection, "m"),
    "velocity": (lambda run: run.static_deflection * run.mesh_frequency, "m s-1"),
    "acceleration": (lambda run: run.static_deflection * run.mesh_frequency**2, "m s-2"),
    "dynamic_force": (lambda run: run.force_scale, "N"),
}
#: Largest change of a coefficient when every second sample is omitted, relative to the root mean
#: square of the samples.
MAX_RELATIVE_CHANGE = 0.05


@dataclass
class Motion:
    """Samples of a variable over the mesh phase of a run, and the speed course of the run."""

    phase: np.ndarray  #: mesh phase since the first sample, rad, shape (k,)
    values: np.ndarray  #: samples, shape (k,), for a train with m meshes (k, m)
    jumps: np.ndarray  #: sorted phases at which the variable or its slope jumps, rad
    speed_course: np.ndarray  #: speed course: rows (time since the first sample in s, speed in rpm)
    teeth: float  #: mesh periods per revolution
    max_order: float  #: highest order by default
    units: str
    coords: dict = field(default_factory=dict)  #: dimensions of the values other than the phase
    attrs: dict = field(default_factory=dict)  #: attributes of the order map

    @property
    def total_revolutions(self) -> float:
        """Number of revolutions of the run, the integral of the speed over time."""
        return float(np.trapezoid(self.speed_course[:, 1], self.speed_course[:, 0])) / 60.0


@dataclass
class FourierSums:
    """Fourier coefficients of the blocks of a signal, with an estimate of their errors."""

    coefficients: np.ndarray  #: complex, shape (blocks, orders) or, for trains, (..., meshes)
    #: Absolute changes of the coefficients when every second sample is omitted, same shape.
    changes: np.ndarray
    mean_squares: np.ndarray  #: mean square of the samples of each block, shape (blocks, ...)

    @property
    def rms(self) -> float:
        """Largest root mean square of the samples of any block."""
        return math.sqrt(self.mean_squares.max())


class ShaftRotation:
    """Rotation of a shaft with a piecewise linear speed course."""

    def __init__(self, speed_course: ArrayLike):
        """Integrate a speed course with rows (time in s, speed in rpm), shape (n, 2).

        The speed is linear between the rows, so the trapezoidal rule is exact.
        """
        self._time, speed_rpm = np.array(speed_course, float).T
        #: Speed in rev/s, acceleration in rev/s^2, and number of revolutions since the first row.
        self._speed = speed_rpm / 60.0
        self._slope = np.diff(self._speed) / np.diff(self._time)
        self._revolutions = cumulative_trapezoid(self._speed, self._time, initial=0.0)

    def revolutions(self, time: np.ndarray) -> np.ndarray:
        """Return the number of revolutions from the first row of the course to given times in s.

        The acceleration is constant between two rows, and the speed is constant after the last row.
        """
        i = np.clip(np.searchsorted(self._time, time, "right") - 1, 0, None)
        slope = np.append(self._slope, 0.0)[i]
        duration = time - self._time[i]
        return self._revolutions[i] + (self._speed[i] + 0.5 * slope * duration) * duration

    def time_and_speed(self, revolutions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (times in s, speeds in rpm) after given numbers of revolutions.

        This is the inverse of the method `revolutions`. Revolutions are counted from the first row
        and must not exceed those at the last row. Between two rows the time is the root of a
        quadratic equation.
        """
        i = np.searchsorted(self._revolutions, revolutions, "right") - 1
        i = np.clip(i, 0, self._slope.size - 1)
        start_speed = self._speed[i]
        angle = revolutions - self._revolutions[i]  # since row i, in revolutions
        speed = np.sqrt(np.maximum(start_speed**2 + 2.0 * self._slope[i] * angle, 0.0))
        # This form of the root is accurate even if the initial speed is 0.
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
        samples per mesh period, the error relative to the largest amplitude is about 1e-6 for the
        displacement, and 1e-4 for the force, which jumps with the stiffness. Times and phases are
        counted from the first sample.
        Alternatively, a measured signal over ``time`` (s) with ``speed`` (min-1), e.g. a result of
        `gearlib.read_measured`, which is resampled at equal angles by cubic splines. NaN marks a
        missing sample. A gap is a step between samples that exceeds three times the usual step or
        a quarter of the wavelength of the highest order; blocks with a gap are omitted. Where the
        speed is missing, it is interpolated linearly. A negative speed means backward rotation;
        blocks in which the speed is 0 over several samples or changes sign are omitted.
    variable : {"displacement", "velocity", "acceleration", "dynamic_force"}
        Name of the variable; for a measured signal, any variable of the dataset.
    resolution : float, default 1
        Largest order spacing, > 0 and <= 1. Blocks have a whole number of revolutions, and the
        actual spacing, ``order_resolution``, is the reciprocal of this number.
    highest : float, optional
        Highest order. By default the fifth mesh order or, for a measured signal, the highest order
        with four samples per wave.
    amplitude : {"rms", "peak", "power"}
        Root mean square, amplitude or mean square of a sine. Order 0 is the mean or its square.
    tacho : sequence of float, optional
        For a measured signal, times of tacho pulses in s, used instead of the speed. The map
        extends from the first to the last pulse. Each interval between pulses is compared with its
        neighbours. A single missing pulse is counted, and a single double pulse is omitted (the
        later one if two pulses are closer than 1 % of an interval). Irregular pulses at either end
        are omitted as well; any other irregular pulse raises an error that states its time.
    pulses_per_revolution : int, default 1
        Number of tacho pulses per revolution, at equal angles.
    teeth : int, default 1
        For a measured signal, the number of mesh periods per revolution.
    orders : sequence of float, optional
        Selected orders, multiples of the order spacing. By default all orders up to the highest.

    Returns
    -------
    xarray.Dataset
        Over ``time`` (s, the middle of each block of whole revolutions) and ``order`` (waves per
        revolution of the gear to which the speed refers): amplitude; phase (rad, of a cosine of
        order times the shaft angle since the start of the run, or since the first tacho pulse);
        amplitude_error, an estimate. Over ``time``: rpm, the mean speed, and overall, the root mean
        square of the variable without its mean. Trains also have the dimension ``mesh``. Scalars:
        order_resolution and teeth. For a measured signal, the attribute ``comment`` describes what
        was omitted or repaired and why, and the attributes ``left_out`` (intervals without a
        block), ``missing_pulses`` (the pulses before and after each) and ``double_pulses`` contain
        the times in s as JSON.

    Raises
    ------
    ValueError
        If an argument is invalid, or if a coefficient changes by more than 5 % of the root mean
        square when every second sample is omitted.
    """
    allowed = f"one of {', '.join(map(repr, _VARIABLES))}, or the name of a variable of a signal"
    checks.require(isinstance(variable, str), "variable", variable, allowed)
    if orders is not None and highest is None:
        highest = max(*orders, resolution)
    motion = _create_motion(run, variable, highest, tacho, pulses_per_revolution, teeth)
    revolutions = math.ceil(1.0 / resolution - 1e-12)  # per block
    run_revolutions = motion.total_revolutions
    block_count = int(run_revolutions / revolutions + PHASE_TOLERANCE)
    if block_count < 1:
        raise ValueError(
            f"resolution = {resolution!r} is not allowed for this run: a block has {revolutions} "
            f"revolutions, but the run has only {run_revolutions:.4g}"
        )
    highest = motion.max_order if highest is None else highest
    # The orders are 0, 1 / revolutions, 2 / revolutions, ... up to the highest.
    order_count = int(highest * revolutions + 1e-9) + 1
    if isinstance(motion, RigSignal):
        sums, start_times, end_times, directions = _fourier_sums_of_signal(
            motion, variable, revolutions, highest, order_count
        )
        motion.attrs |= motion.describe_omissions(start_times, end_times, revolutions)
    else:
        sums = _fourier_sums_of_run(motion, revolutions, highest, block_count, order_count)
        bounds = revolutions * np.arange(block_count + 1.0)
        times, _ = ShaftRotation(motion.speed_course).time_and_speed(bounds)
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
    return _order_map_dataset(
        motion, variable, amplitude, sums, indices, revolutions, start_times, end_times, rpm
    )


def _fourier_sums_of_run(
    motion: Motion, revolutions: int, highest: float, block_count: int, order_count: int
) -> FourierSums:
    """Compute the Fourier coefficients of the blocks of a run and check their accuracy.

    Each of the `block_count` blocks has `revolutions` shaft revolutions, an integer. The
    `order_count` orders (waves per revolution) are 0, 1 / `revolutions`, 2 / `revolutions`, ...
    Raise ValueError if there are fewer than four samples per wave of the `highest` order, or if the
    coefficients change too much when every second sample is omitted.
    """
    samples_per_period = _samples_per_period(motion.phase)
    max_order = 0.25 * samples_per_period * motion.teeth
    if highest > max_order * (1.0 + PHASE_TOLERANCE):
        raise ValueError(
            f"highest = {highest:g} is not allowed with samples_per_period = {samples_per_period}: "
            f"it must be at most {max_order:.4g}, so that there are four samples per wave"
        )
    # A wave number, in radians of the wave per radian of the mesh phase, is order / teeth.
    step = 1.0 / (motion.teeth * revolutions)
    blocks = math.tau / step, block_count, step, order_count
    sums = fourier_sums(motion.phase, motion.values, motion.jumps, *blocks)
    _check_sampling_error(sums, motion.phase)
    return sums


def _fourier_sums_of_signal(
    signal: RigSignal, variable: str, revolutions: int, highest: float, order_count: int
) -> tuple:
    """Return (Fourier sums, start times, end times, directions) of the blocks of a measured signal.

    Each block has `revolutions` shaft revolutions, an integer. The `order_count` orders (waves per
    revolution) are multiples of 1 / `revolutions` from 0 to `highest`. Times are in s, directions
    of rotation are 1 or -1, and blocks are sorted by time. `variable` is the name of the signal in
    the error message. The error estimates are not checked, because they include noise.
    """
    coefficients, changes, mean_squares, blocks = [], [], [], []
    for samples, start_time, end_time, direction in signal.blocks(revolutions, highest):
        # The trapezoidal rule gives the first and the last sample half the weight.
        periodic_samples, squares = samples[:-1].copy(), samples[:-1] ** 2
        periodic_samples[0] = 0.5 * (samples[0] + samples[-1])
        squares[0] = 0.5 * (samples[0] ** 2 + samples[-1] ** 2)
        fine = np.fft.rfft(periodic_samples, norm="forward")[:order_count]
        # Coefficients from every second sample show the sampling error.
        coarse = np.fft.rfft(periodic_samples[::2], norm="forward")[:order_count]
        coefficients.append(fine)
        changes.append(np.abs(fine - coarse))
        mean_squares.append(squares.mean())
        blocks.append((start_time, end_time, direction))
    if not blocks:
        reasons = ", ".join(dict.fromkeys(reason for _, _, reason in signal.interruptions))
        raise ValueError(
            f"{variable} has no complete block of {revolutions} whole revolutions ({reasons}): "
            "there must be at least one"
        )
    order = np.argsort([start_time for start_time, _, _ in blocks])
    sums = FourierSums(
        np.array(coefficients)[order], np.array(changes)[order], np.array(mean_squares)[order]
    )
    return sums, *np.array(blocks)[order].T


def _create_motion(
    run, variable: str, highest: float | None, tacho: Any, pulses_per_revolution: int, teeth: int
) -> Motion | RigSignal:
    """Return the samples of a variable of a run as a `Motion`, or of a signal as a `RigSignal`.

    `run` is a dataset of `run_up` or `simulate`, or a measured signal, which has a time but no mesh
    phase. `highest` is the highest order or None. For a signal, `tacho` contains the times of the
    tacho pulses in s or is None, and `teeth` is the number of mesh periods per revolution. Raise
    ValueError if an argument of `order_map` is not allowed for this kind of dataset.
    """
    names = set(getattr(run, "variables", ()))  # empty unless `run` is a dataset
    if "time" in names and "phase" not in names:
        return create_rig_signal(run, variable, highest, tacho, pulses_per_revolution, teeth)
    checks.check_choice("variable", variable, tuple(_VARIABLES))
    condition = "for a simulated run, whose shaft angle is known"
    checks.require(tacho is None, "tacho", tacho, f"None {condition}")
    if pulses_per_revolution != 1:
        raise checks.InputError("pulses_per_revolution", pulses_per_revolution, f"1 {condition}")
    simulated_names = {"mesh_frequency", "static_deflection", "force_scale", "contact", *_VARIABLES}
    is_simulation = simulated_names <= names and run.displacement.dims[0] == "phase"
    is_run_up = names >= {variable, "time", "speed", "phase"} and "time" in run.sizes
    if not (is_simulation or is_run_up):
        expected = "a dataset of gearlib.run_up with samples_per_period, or of gearlib.simulate"
        raise checks.InputError("run", _describe_argument(run), expected)
    return _motion_from_run(run, variable)


def _describe_argument(run: Any) -> Any:
    """Return the title or type name of a dataset for an error message; return other objects."""
    return run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run


def _check_status(run: xr.Dataset) -> None:
    """Raise ValueError if a run has failed."""
    if int(run.status):
        raise ValueError(f"the run has failed: {run.status.attrs['message']}")


def _motion_from_run(run: xr.Dataset, variable: str) -> Motion:
    """Return a variable of a run of `run_up` or `simulate` in SI units as a `Motion`.

    A `Motion` contains the samples over the mesh phase, the phases of jumps, the speed course, and
    the number of mesh periods per revolution, which follows from mesh phase and shaft angle.
    """
    _check_status(run)
    is_run_up = "time" in run.sizes
    parameters, phase = json.loads(run.attrs["parameters"]), run.phase.values
    if is_run_up:
        speed, time = run.speed.values, run.time.values
        speed_course = np.array(parameters["speed"])
        # The shaft angle in rad follows from speeds in rpm by the trapezoidal rule.
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
        courses = _courses_as_json(speed_course)
    teeth = float((phase[-1] - phase[0]) / angle) if angle > 0.0 else 1.0
    # The ratio is an integer, up to rounding errors, unless a carrier rotates.
    if abs(teeth - round(teeth)) < 1e-6 * teeth:
        teeth = float(round(teeth))
    if is_run_up:
        # The variable or its slope may jump at kinks of the courses and at contact events.
        times = [row[0] for row in (*parameters["speed"], *parameters["load"])]
        times.extend(run.event_time.values if "event_time" in run else ())
        event_phases = math.tau * teeth * ShaftRotation(speed_course).revolutions(np.array(times))
    else:
        event_phases = _event_phases(run)
    return Motion(
        phase=phase,
        values=run[variable].values * scale,
        jumps=_jump_phases(run, variable, event_phases),
        speed_course=speed_course,
        teeth=teeth,
        max_order=_DEFAULT_MESH_ORDERS * teeth,
        units=units,
        coords={name: run[name].variable for name in run[variable].dims[1:]},
        attrs=_select_attributes(run, "references", "gear_pair", "model") | {"parameters": courses},
    )


def _event_phases(run: xr.Dataset) -> np.ndarray:
    """Return the mesh phases of start, end and contact events of the record of a run in rad.

    `run` is a dataset of `simulate`. Phases are counted from the first sample.
    """
    end_phase = math.tau * recorded_periods(run)
    return np.array([0.0, end_phase, *(run.event_phase.values - run.phase.values[0])])


def _select_attributes(run: xr.Dataset, *names: str) -> dict:
    """Return the attributes of a run with the given names, ignoring names that it does not have."""
    return {name: run.attrs[name] for name in names if name in run.attrs}


def _courses_as_json(speed_course: np.ndarray) -> str:
    """Return a speed course, rows (time in s, speed in rpm), with a constant load as JSON text."""
    return canonical_json({"speed": speed_course.tolist(), "load": [[0.0, 1.0]]})


def _jump_phases(run: xr.Dataset, variable: str, event_phases: np.ndarray) -> np.ndarray:
    """Return the sorted mesh phases in rad at which a variable may jump.

    Phases are counted from the first sample. A variable may jump at the `event_phases` (contact
    events and both ends of the record) and, if the attributes of the run describe its model, where
    the mesh stiffness jumps. Displacement and velocity are continuous and have no jumps.
    """
    if variable in ("displacement", "velocity"):
        return np.empty(0)
    phases = event_phases
    # The result is None if the attributes do not describe the model.
    model = model_from_json(run.attrs.get("gear_pair") or run.attrs.get("model", ""))
    if model is not None:
        # The mesh phase of a run-up starts at 0.
        start_phase = 0.0 if "time" in run.dims else float(run.phase[0])
        end_phase = float(run.phase[-1])
        switches, period = _stiffness_switches(model)
        # One mesh period is added at both ends, so that no jump at an end is missed.
        first_period = (start_phase - math.tau) // period
        last_period = (end_phase + math.tau) // period
        period_starts = period * np.arange(first_period, last_period + 1.0)
        phases = np.concatenate([phases, (period_starts[:, None] + switches).ravel() - start_phase])
    phases = np.sort(phases)
    return phases[np.diff(phases, prepend=-np.inf) > PHASE_TOLERANCE]


def _stiffness_switches(model: Any) -> tuple:
    """Return (phases at which the mesh stiffness of a model jumps, period of the stiffness) in rad.

    The period is one mesh period, or more if the stiffness repeats only after several mesh periods.
    """
    if model.equation is None:
        # Models with several coordinates have piecewise constant stiffness, whose segments are the
        # same at all tunings.
        segment_bounds = model.system(tuning=1.0).starts
        return segment_bounds[:-1], segment_bounds[-1]
    switches = [[0.0]]
    # The stiffness is piecewise linear over the phase.
    for stiffness in (model.equation.drive_stiffness, model.equation.coast_stiffness):
        start_values, slopes = stiffness.values_and_slopes.T
        end_values = start_values + slopes * np.diff(stiffness.breakpoints)
        jumps = np.abs(np.roll(end_values, 1) - start_values)
        is_jump = jumps > PHASE_TOLERANCE * np.abs(start_values).max()
        switches.append(stiffness.breakpoints[:-1][is_jump])
    return np.unique(np.concatenate(switches)), math.tau


def fourier_sums(
    phase, values, jumps, block_length, block_count, wave_number_step, order_count
) -> FourierSums:
    """Compute Fourier coefficients of samples in consecutive blocks, with an error estimate.

    `values`, shape (k,) or (k, meshes), are samples at the sorted phases `phase` in rad, shape
    (k,). The values or their slopes jump at the sorted phases `jumps`. Block b extends from
    b * block_length to (b + 1) * block_length, b = 0 ... block_count - 1. Coefficient n,
    n = 0 ... order_count - 1, is the mean of values * exp(-i w phase) over the block with
    w = n * wave_number_step. The error estimate is the change when every second sample is omitted.
    """
    blocks = block_length, block_count, wave_number_step, order_count
    sums, mean_squares = _block_coefficients(phase, values, jumps, *blocks)
    coarse_sums, _ = _block_coefficients(phase[::2], values[::2], jumps, *blocks)
    return FourierSums(sums, np.abs(sums - coarse_sums), mean_squares)


def _block_coefficients(
    phase, values, jumps, block_length, block_count, wave_number_step, order_count
) -> tuple:
    """Return (Fourier coefficients, mean squares) of samples in consecutive blocks of phase.

    The arguments are described in `fourier_sums`. Coefficients have the shape (block_count,
    order_count, ...) and mean squares (block_count, ...), with the trailing dimensions of `values`.
    """
    inner_shape = values.shape[1:]
    table = values.reshape(len(values), -1).T  # one row per mesh
    sums = np.zeros((block_count, order_count, len(table)), complex)
    mean_squares = np.zeros((block_count, len(table)))
    # A sample at a jump may belong to either side, so it is omitted.
    ends = np.concatenate([[-np.inf], jumps, [np.inf]])
    segments = np.searchsorted(jumps, phase)
    distances = np.minimum(phase - ends[segments], ends[segments + 1] - phase)
    phase, table = phase[distances > PHASE_TOLERANCE], table[:, distances > PHASE_TOLERANCE]
    for b in range(block_count):
        start = b * block_length
        bounds = start - PHASE_TOLERANCE, (b + 1) * block_length - PHASE_TOLERANCE
        first, stop = np.searchsorted(phase, bounds)
        # Polynomials at the ends of a block extend to samples outside the block.
        indices = np.arange(max(first - STENCIL_SIZE, 0), min(stop + STENCIL_SIZE, len(phase)))
        block_phase = phase[indices] - start
        weights = _integration_weights(block_phase, jumps - start, block_length)
        samples = table[:, indices]
        weighted_samples = weights / block_length * samples
        # From one order to the next, the terms are multiplied by the same factors.
        rotation = np.exp(-1j * wave_number_step * block_phase)
        terms = weighted_samples.astype(complex)
        for n in range(order_count):
            sums[b, n] = terms.sum(axis=1)
            terms *= rotation
        mean_squares[b] = (weighted_samples * samples).sum(axis=1)
    sums = sums.reshape(block_count, order_count, *inner_shape)
    return sums, mean_squares.reshape(block_count, *inner_shape)


def _integration_weights(phase: np.ndarray, jumps: np.ndarray, length: float) -> np.ndarray:
    """Return the quadrature weights of samples, shape (k,), for an integral from 0 to `length`.

    The integrand is sampled at the sorted phases `phase`, shape (k,), which may extend beyond both
    limits. It is interpolated by cubic polynomials through neighbouring samples, which do not
    extend across the sorted phases `jumps`, where the integrand jumps.
    """
    jumps = jumps[(jumps > phase[0]) & (jumps < phase[-1])]
    ends = np.concatenate([[0.0, length], phase, jumps])
    bounds = np.unique(ends[(ends >= 0.0) & (ends <= length)])
    # Each interval between two bounds has one polynomial.
    half_lengths, middles = 0.5 * np.diff(bounds), 0.5 * (bounds[1:] + bounds[:-1])
    # The index of a smooth segment is the number of jumps before it.
    segment_of_sample = np.searchsorted(jumps, phase)
    segment_of_interval = np.searchsorted(jumps, middles)
    # Indices of the samples that lie in the segment of each interval.
    low = np.searchsorted(segment_of_sample, segment_of_interval, side="left")
    high = np.searchsorted(segment_of_sample, segment_of_interval, side="right")
    # A segment between two jumps without samples uses the neighbouring samples on both sides.
    is_empty = (low == high).astype(int)
    low, high = np.maximum(low - is_empty, 0), np.minimum(high + is_empty, phase.size)
    stencil_sizes = np.minimum(high - low, STENCIL_SIZE)
    first_samples = np.searchsorted(phase, middles) - stencil_sizes // 2
    first_samples = np.clip(first_samples, low, high - stencil_sizes)
    weights = np.zeros(phase.size)
    # A segment with fewer than four samples has polynomials of lower degree.
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
    """Return the number of samples per mesh period, from the median step of mesh phases in rad."""
    return round(math.tau / float(np.median(np.diff(phase)))) if phase.size > 1 else 1


def _check_sampling_error(sums: FourierSums, phase: np.ndarray) -> None:
    """Raise ValueError if a coefficient changes too much when every second sample is omitted.

    `sums` are Fourier coefficients with these changes. The limit is `MAX_RELATIVE_CHANGE` (5 %) of
    the root mean square of the samples. `phase` are the phases of the samples in rad, which the
    message needs.
    """
    largest_change = sums.changes.max()
    if largest_change > MAX_RELATIVE_CHANGE * sums.rms:
        raise ValueError(
            f"samples_per_period = {_samples_per_period(phase)} is not allowed for these orders: "
            f"with half the samples an amplitude changes by {largest_change / sums.rms:.2g} times "
            f"the root mean square, and at most {MAX_RELATIVE_CHANGE:g} is allowed"
        )


def _order_map_dataset(
    motion, variable, amplitude, sums, indices, revolutions, start_times, end_times, rpm
) -> xr.Dataset:
    """Return the dataset of `order_map` for a variable.

    `motion` is a `Motion` or a `RigSignal`, and `sums` are the `FourierSums` of its blocks.
    `amplitude` is "rms", "peak" or "power". The orders are `indices` / `revolutions`, with the
    number of `revolutions` per block. Blocks extend from `start_times` to `end_times` in s and have
    the mean speeds `rpm`.
    """
    means = np.abs(sums.coefficients[:, 0])
    overall = np.sqrt(np.maximum(sums.mean_squares - means**2, 0.0))
    coefficients, changes = sums.coefficients[:, indices], sums.changes[:, indices]
    unit, label = motion.units, variable.replace("_", " ")
    magnitudes = np.abs(coefficients)
    # An order > 0 has two complex coefficients of this magnitude; order 0 is the mean.
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
    # Each entry is (dimensions, values, units, long name).
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
    return make_study_result(title, data, coords, method, **names, **motion.attrs)


@checked
def orders(run, *, count: Count | None = None):
    """Compute the order spectrum of the mesh force and the transmission error of a run.

    Parameters
    ----------
    run : xarray.Dataset
        A result of `gearlib.simulate` that records whole revolutions or whole periods of an orbit.
    count : int, optional
        Highest mesh order, at most a quarter of the samples per period, by default at most 10.

    Returns
    -------
    xarray.Dataset
        Over ``order`` (waves per revolution of the gear to which the speed refers, from 0):
        mesh_order (order over teeth), force_amplitude (N, peak; the mean at order 0), force_phase,
        error_amplitude (m) and error_phase (rad; of a cosine of the mesh phase times the mesh
        order); force_amplitude_error and error_amplitude_error, estimated by omitting every second
        sample; mean_square_force and mean_square_error, of the samples. Trains also have the
        dimension ``mesh``.

    Raises
    ------
    ValueError
        If the run failed or has no whole revolutions, or if a coefficient changes by more than 5 %
        of the root mean square when every second sample is omitted.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        expected = "a dataset of gearlib.simulate for a model with rotating bodies"
        raise checks.InputError("run", _describe_argument(run), expected)
    mesh_orders, sums = record_fourier_sums(run, count)
    dims = ("order", *run.displacement.dims[1:])
    column_shape = -1, *[1] * (len(dims) - 1)
    # The phases of the orders refer to mesh phase 0, not to the first sample.
    rotation = np.exp(-1j * mesh_orders * float(run.phase[0])).reshape(column_shape)
    peak_factor = np.where(mesh_orders > 0.0, 2.0, 1.0).reshape(column_shape)
    data: dict = {"mesh_order": ("order", mesh_orders)}
    for name, (values, block_sums) in sums.items():
        _check_sampling_error(block_sums, run.phase.values)
        coefficients, changes = block_sums.coefficients[0], block_sums.changes[0]
        data[f"{name}_amplitude"] = dims, peak_factor * np.abs(coefficients)
        data[f"{name}_phase"] = dims, np.angle(coefficients * rotation)
        data[f"{name}_amplitude_error"] = dims, peak_factor * changes
        data[f"mean_square_{name}"] = dims[1:], (values**2).mean(axis=0)
    data |= {name: run[name].values for name in ("tuning", "speed", "mesh_frequency", "period")}
    periods = recorded_periods(run)
    coords = {"order": np.arange(mesh_orders.size) * float(_periods_per_revolution(run)) / periods}
    coords |= {name: run[name].values for name in dims[1:]}
    dataset = make_study_result("Order spectrum of a gear mesh", data, coords, "Fourier sums")
    long_name = "order, waves per revolution of the gear to which the speed refers"
    dataset["order"].attrs["long_name"] = long_name
    dataset.attrs |= _select_attributes(run, "references", "gear_pair", "parameters")
    return dataset


def _periods_per_revolution(run: xr.Dataset) -> Fraction:
    """Return the number of mesh periods per revolution of the gear to which the speed refers.

    It is the number of teeth of the gear or, in a planetary train with a rotating carrier, a
    fraction. It is computed from the mesh frequency in rad/s and the speed in rpm of the run.
    """
    ratio = float(run.mesh_frequency) * 60.0 / (math.tau * float(run.speed))
    return Fraction(ratio).limit_denominator(10_000)


def recorded_periods(run: xr.Dataset) -> int:
    """Return the number of mesh periods in the record of a run of `simulate`."""
    return json.loads(run.attrs["parameters"])["record_periods"]


def record_fourier_sums(
    run: xr.Dataset, count: int | None = None, fractional_orders: bool = True
) -> tuple:
    """Compute the Fourier sums of mesh force and transmission error of a run of `simulate`.

    Return (mesh orders, {"force": (samples, sums), "error": (samples, sums)}) with samples in N and
    m and their `FourierSums` over the whole record. A mesh order is a frequency divided by the mesh
    frequency. `count` is the highest mesh order, by default 10 or, if that is less, a quarter of
    the samples per period. The mesh orders are 0, 1, 2, ... or, with `fractional_orders`, multiples
    of 1 / (number of recorded mesh periods). In the latter case the record must consist of whole
    revolutions or whole periods of a periodic orbit.
    """
    _check_status(run)
    periods, teeth = recorded_periods(run), _periods_per_revolution(run).numerator
    orbit_periods = int(run.period)
    is_periodic = orbit_periods > 0 and periods % orbit_periods == 0
    if fractional_orders and periods % teeth and not is_periodic:
        raise ValueError(
            f"record_periods = {periods} is not allowed: it must be a multiple of {teeth} (whole "
            "revolutions of the gear to which the speed refers)"
            + (f", or of the {orbit_periods} periods of the orbit" if orbit_periods else "")
        )
    max_count = max(run.phase.size // periods // 4, 1)
    count = min(10, max_count) if count is None else count
    checks.require(count <= max_count, "count", count, f"an integer from 1 to {max_count}")
    steps_per_order = periods if fractional_orders else 1
    length = math.tau * periods
    order_count = count * steps_per_order + 1
    phase = run.phase.values - run.phase.values[0]
    margin = 2 * STENCIL_SIZE
    if is_periodic:
        # The record is extended periodically, so that samples surround its first and last phase.
        phase = np.concatenate([phase[-margin:] - length, phase, phase[:margin] + length])
    sums = {}
    for name, values, variable in (
        ("force", run.dynamic_force.values * float(run.force_scale), "dynamic_force"),
        ("error", transmission_error(run) * float(run.static_deflection), "displacement"),
    ):
        extended_values, jumps = values, _jump_phases(run, variable, _event_phases(run))
        if is_periodic:
            extended_values = np.concatenate([values[-margin:], values, values[:margin]])
        step = 1.0 / steps_per_order
        sums[name] = (
            values,
            fourier_sums(phase, extended_values, jumps, length, 1, step, order_count),
        )
    return np.arange(order_count) / steps_per_order, sums


def mesh_order_amplitudes(run: xr.Dataset) -> tuple:
    """Return (mesh orders from 1, mesh force amplitudes in N, transmission error amplitudes in m).

    `run` is a dataset of `simulate`; mesh order n has n times the mesh frequency. An amplitude is
    NaN if it changes by more than 5 % of the root mean square when every second sample is omitted.
    """
    mesh_orders, sums = record_fourier_sums(run, fractional_orders=False)
    amplitudes = []
    for name in ("force", "error"):
        _, block_sums = sums[name]
        is_unreliable = block_sums.changes[0] > MAX_RELATIVE_CHANGE * block_sums.rms
        # The real amplitude of a cosine is twice the magnitude of its complex coefficient.
        peaks = np.where(is_unreliable, math.nan, 2.0 * np.abs(block_sums.coefficients[0]))
        amplitudes.append(peaks[1:])  # without the mean, order 0
    return mesh_orders[1:], *amplitudes


def transmission_error(run: xr.Dataset) -> np.ndarray:
    """Return the transmission error at each sample of a run in units of the static deflection.

    `run` is a dataset of `simulate`. The transmission error is the displacement of the mesh minus
    the profile deviation, if the model has one.
    """
    displacement = run.displacement.values
    # The attributes of the dataset describe the model as JSON.
    model = json.loads(run.attrs.get("gear_pair") or run.attrs["model"])
    deviation = model.get("deviation") if "profile" in model else None
    if not deviation:
        return displacement
    # The amplitudes of the deviation are converted from m to units of the static deflection.
    phase, scale = run.phase.values, 1.0 / run.static_deflection.item()
    # Each harmonic has the order k and the amplitudes a and b of cosine and sine.
    waves = Harmonics(deviation["cosines"], deviation["sines"]).table(scale)
    return displacement - sum(a * np.cos(k * phase) + b * np.sin(k * phase) for k, a, b in waves)

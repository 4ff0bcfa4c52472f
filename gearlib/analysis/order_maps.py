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
#: Functions from the magnitude of a complex Fourier coefficient to the amplitude of its order > 0.
_AMPLITUDES = {
    "rms": lambda c: math.sqrt(2.0) * c,
    "peak": lambda c: 2.0 * c,
    "power": lambda c: 2.0 * c**2,
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
#: Largest change of a coefficient with half of the samples, relative to the root mean square.
MAX_CHANGE = 0.05


@dataclass
class Motion:
    """Samples of a variable over the mesh phase, with the speed course."""

    phase: np.ndarray  #: mesh phase since the first sample, shape (k,)
    values: np.ndarray  #: shape (k,), for trains (k, m)
    jumps: np.ndarray  #: sorted phases at which values or slopes jump
    speeds: np.ndarray  #: speed course since the first sample, rows of s and rpm
    teeth: float  #: mesh periods per revolution
    max_order: float  #: highest order by default
    units: str
    coords: dict = field(default_factory=dict)  #: dimensions of the values other than the phase
    attrs: dict = field(default_factory=dict)  #: attributes of the order map

    @property
    def travel(self) -> float:
        """Number of revolutions."""
        return float(np.trapezoid(self.speeds[:, 1], self.speeds[:, 0])) / 60.0


@dataclass
class FourierSums:
    """Fourier coefficients of blocks of a motion, and their changes with half of the samples."""

    coefficients: np.ndarray  #: complex, shape (blocks, orders, ...)
    changes: np.ndarray  #: absolute values of the changes, same shape
    mean_squares: np.ndarray  #: mean squares of the samples, shape (blocks, ...)

    @property
    def rms(self) -> float:
        """Largest root mean square of the samples of a block."""
        return math.sqrt(self.mean_squares.max())


class ShaftRotation:
    """Rotation of a shaft with a piecewise linear speed course."""

    def __init__(self, speed_course: ArrayLike):
        """Integrate the speed; it has rows (time in s, speed in rpm), shape (n, 2)."""
        self._time, speed = np.array(speed_course, float).T
        #: Speed in rev/s, its slope in rev/s^2, and revolutions since the first row.
        self._speed = speed / 60.0
        self._slope = np.diff(self._speed) / np.diff(self._time)
        self._revolutions = cumulative_trapezoid(self._speed, self._time, initial=0.0)

    def revolutions(self, time: np.ndarray) -> np.ndarray:
        """Return the revolutions at times in s; the speed is constant after the last row."""
        i = np.clip(np.searchsorted(self._time, time, "right") - 1, 0, None)
        t, slope = time - self._time[i], np.append(self._slope, 0.0)[i]
        return self._revolutions[i] + (self._speed[i] + 0.5 * slope * t) * t

    def time_and_speed(self, revolutions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (time in s, speed in rpm) after the given numbers of revolutions."""
        i = np.searchsorted(self._revolutions, revolutions, "right") - 1
        i = np.clip(i, 0, self._slope.size - 1)
        start_speed, angle = self._speed[i], revolutions - self._revolutions[i]
        speed = np.sqrt(np.maximum(start_speed**2 + 2.0 * self._slope[i] * angle, 0.0))
        # This form of the root of the quadratic equation is accurate for a start from standstill.
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
    """Compute the amplitudes of the orders of a run-up in blocks of revolutions.

    Parameters
    ----------
    run : xarray.Dataset
        A result of `gearlib.run_up` with samples_per_period, or of `gearlib.simulate`. With 128
        samples per mesh period the error is about 1e-6 of the largest amplitude of the
        displacement, and 1e-4 of that of the force, which jumps with the stiffness. Times and
        phases count from the first sample. Alternatively any signal over ``time`` (s) with
        ``speed`` (min-1), such as a result of `gearlib.read_measured`: it is interpolated at equal
        angles by cubic splines. Samples with NaN are missing. Blocks that a gap touches are left
        out: a step between samples of more than three usual ones, or of more than a quarter of the
        wave of the highest order. The speed is taken as linear across its gaps. A negative speed
        is a rotation backwards; blocks in which the speed is 0 over several samples or changes its
        sign are left out.
    variable : {"displacement", "velocity", "acceleration", "dynamic_force"}
        Name of the variable; a signal may have any other.
    resolution : float, default 1
        Largest order spacing, > 0 and <= 1. Blocks have a whole number of revolutions, and the
        actual spacing, ``order_resolution``, is its reciprocal.
    highest : float, optional
        Highest order. By default the fifth mesh order, or for a signal the highest order with four
        samples per wave.
    amplitude : {"rms", "peak", "power"}
        Root mean square, amplitude or mean square of a sine. Order 0 is the mean, or its square.
    tacho : sequence of float, optional
        For a signal without speed, or in its place: times of tacho pulses in s. The map extends
        from the first to the last. Each interval is compared with the speed of its neighbours: a
        single pulse that is missing is counted, a single double pulse is left out (of two closer
        than 1 % of an interval the later one), and so are irregular pulses at either end. Any other
        irregular pulse is refused with its time.
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
        order_resolution and teeth. Of a signal the attribute ``comment`` says what was left out or
        repaired and why, and ``left_out`` (intervals without a block), ``missing_pulses`` (the
        pulses around each) and
        ``double_pulses`` have the times in s, as JSON.

    Raises
    ------
    ValueError
        If an argument is invalid, or if a coefficient changes by more than 5 % of the root mean
        square when every second sample is omitted.
    """
    allowed = f"one of {', '.join(map(repr, _VARIABLES))}, or of a signal the name of any variable"
    checks.require(isinstance(variable, str), "variable", variable, allowed)
    if orders is not None:
        highest = max(*orders, resolution) if highest is None else highest
    motion = _motion(run, variable, highest, tacho, pulses_per_revolution, teeth)
    revolutions = math.ceil(1.0 / resolution - 1e-12)
    run_revolutions = motion.travel
    blocks = int(run_revolutions / revolutions + PHASE_TOLERANCE)
    if blocks < 1:
        raise ValueError(
            f"resolution = {resolution!r} is not allowed for this run: a block must have "
            f"{revolutions} whole revolutions, and the run has {run_revolutions:.4g}"
        )
    highest = motion.max_order if highest is None else highest
    count = int(highest * revolutions + 1e-9) + 1
    if isinstance(motion, RigSignal):
        sums, begins, ends, directions = _signal_sums(motion, variable, revolutions, highest, count)
        motion.attrs |= motion.left_out(begins, ends, revolutions)
    else:
        sums = _run_sums(motion, revolutions, highest, blocks, count)
        turns = revolutions * np.arange(blocks + 1.0)
        bounds, _ = ShaftRotation(motion.speeds).time_and_speed(turns)
        begins, ends, directions = bounds[:-1], bounds[1:], 1.0
    indices = np.arange(count)
    if orders is not None:
        indices = np.array([round(order * revolutions) for order in orders])
        for order, index in zip(orders, indices.tolist(), strict=True):
            allowed = f"one of 0, {1.0 / revolutions:.4g}, ..., {(count - 1) / revolutions:.4g}"
            is_valid = abs(index - order * revolutions) <= 1e-09 * max(order, 1.0) and index < count
            checks.require(is_valid, "orders", order, allowed)
    rpm = 60.0 * revolutions * directions / (ends - begins)
    return _dataset(motion, variable, amplitude, sums, indices, revolutions, begins, ends, rpm)


def _run_sums(motion, revolutions: int, highest: float, blocks: int, count: int) -> FourierSums:
    """Return the Fourier coefficients of the blocks of a run for the arguments of `order_map`."""
    samples_per_period = _samples_per_period(motion.phase)
    max_order = 0.25 * samples_per_period * motion.teeth
    if highest > max_order * (1.0 + PHASE_TOLERANCE):
        raise ValueError(
            f"highest = {highest:g} is not allowed with samples_per_period = {samples_per_period}: "
            f"it must be at most {max_order:.4g}, orders with four samples a wave"
        )
    step = 1.0 / (motion.teeth * revolutions)
    sums = fourier(motion.phase, motion.values, motion.jumps, math.tau / step, blocks, step, count)
    _check_changes(sums, motion.phase)
    return sums


def _signal_sums(
    signal: RigSignal, variable: str, revolutions: int, highest: float, count: int
) -> tuple:
    """Return (Fourier sums, start times, end times, directions) of the blocks of a signal.

    The coefficients are not checked, because noise changes them.
    """
    coefficients, changes, squares, places = [], [], [], []
    for samples, begin, end, direction in signal.blocks(revolutions, highest):
        # The trapezoidal rule takes half of the first and half of the last sample.
        wave, square = samples[:-1].copy(), samples[:-1] ** 2
        wave[0] = 0.5 * (samples[0] + samples[-1])
        square[0] = 0.5 * (samples[0] ** 2 + samples[-1] ** 2)
        fine, coarse = (np.fft.rfft(x, norm="forward")[:count] for x in (wave, wave[::2]))
        coefficients.append(fine)
        changes.append(np.abs(fine - coarse))
        squares.append(square.mean())
        places.append((begin, end, direction))
    if not places:
        reasons = ", ".join(dict.fromkeys(why for _, _, why in signal.breaks))
        raise ValueError(
            f"{variable} is not allowed: no block of {revolutions} whole revolutions is complete "
            f"({reasons}), and there must be one at least"
        )
    order = np.argsort([begin for begin, _, _ in places])
    sums = FourierSums(*(np.array(x)[order] for x in (coefficients, changes, squares)))
    return sums, *np.array(places)[order].T


def _motion(
    run: Any, variable: str, highest: float | None, tacho: Any, per_turn: int, teeth: int
) -> Motion | RigSignal:
    """Return the samples of a variable of a run or a signal for the arguments of `order_map`."""
    names = set(getattr(run, "variables", ()))  # empty unless `run` is a dataset
    if "time" in names and "phase" not in names:
        return rig_signal(run, variable, highest, tacho, per_turn, teeth)
    checks.one_of("variable", variable, tuple(_VARIABLES))
    allowed = "for a run-up, whose shaft angle is known"
    checks.require(tacho is None, "tacho", tacho, f"None {allowed}")
    checks.require(per_turn == 1, "pulses_per_revolution", per_turn, f"1 {allowed}")
    simulated_names = {"mesh_frequency", "static_deflection", "force_scale", "contact", *_VARIABLES}
    is_simulation = simulated_names <= names and run.displacement.dims[0] == "phase"
    is_run_up = names >= {variable, "time", "speed", "phase"} and "time" in run.sizes
    if not (is_simulation or is_run_up):
        expected = "a dataset of gearlib.run_up with samples_per_period, or of gearlib.simulate"
        raise checks.refusal("run", _name_of_run(run), expected)
    return _motion_of_run(run, variable)


def _name_of_run(run: Any) -> Any:
    """Return the title or type of a run for an error message."""
    return run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run


def _check_status(run: xr.Dataset) -> None:
    """Raise ValueError if a run has failed."""
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")


def _motion_of_run(run: xr.Dataset, variable: str) -> Motion:
    """Return the samples of a variable of `gearlib.run_up` or `gearlib.simulate`, in SI units."""
    _check_status(run)
    parameters, phase = json.loads(run.attrs["parameters"]), run.phase.values
    if "time" in run.sizes:
        speed, time, speeds = run.speed.values, run.time.values, np.array(parameters["speed"])
        # Shaft angle in rad from speeds in rpm, by the trapezoidal rule.
        angle = math.pi / 60.0 * ((speed[1:] + speed[:-1]) * np.diff(time)).sum()
        scale, units, courses = 1.0, run[variable].attrs["units"], run.attrs["parameters"]
    else:
        phase, rpm, omega = phase - phase[0], float(run.speed), float(run.mesh_frequency)
        speeds = np.array([[0.0, rpm], [math.tau * parameters["record_periods"] / omega, rpm]])
        angle = math.pi / 30.0 * rpm * phase[-1] / omega
        scale_of, units = _VARIABLES[variable]
        scale, courses = float(scale_of(run)), _courses_json(speeds)
    teeth = float((phase[-1] - phase[0]) / angle) if angle > 0.0 else 1.0
    # Mesh periods per revolution are an integer, apart from rounding errors.
    teeth = float(round(teeth)) if abs(teeth - round(teeth)) < 1e-6 * teeth else teeth
    if "time" in run.sizes:
        # The variable or its slope may jump at corners of the courses and at contact events.
        times = [row[0] for row in (*parameters["speed"], *parameters["load"])]
        times.extend(run.event_time.values if "event_time" in run else ())
        event_phases = math.tau * teeth * ShaftRotation(speeds).revolutions(np.array(times))
    else:
        event_phases = _event_phases(run)
    return Motion(
        phase=phase,
        values=run[variable].values * scale,
        jumps=_jumps(run, variable, event_phases),
        speeds=speeds,
        teeth=teeth,
        max_order=_DEFAULT_MESH_ORDERS * teeth,
        units=units,
        coords={name: run[name].variable for name in run[variable].dims[1:]},
        attrs=_attributes(run, "references", "gear_pair", "model") | {"parameters": courses},
    )


def _event_phases(run: xr.Dataset) -> np.ndarray:
    """Return [start, end, *contact events] of a run as phases (rad) since the first sample."""
    end = math.tau * json.loads(run.attrs["parameters"])["record_periods"]
    return np.array([0.0, end, *(run.event_phase.values - run.phase.values[0])])


def _attributes(run: xr.Dataset, *names: str) -> dict:
    """Return {name: attribute} of the named attributes that a run has."""
    return {name: run.attrs[name] for name in names if name in run.attrs}


def _courses_json(speeds: np.ndarray) -> str:
    """Return a speed course, rows of s and rpm, and a constant load course as JSON."""
    return canonical_json({"speed": speeds.tolist(), "load": [[0.0, 1.0]]})


def _jumps(run: xr.Dataset, variable: str, event_phases: np.ndarray) -> np.ndarray:
    """Return the sorted phases, since the first sample, at which a variable of a run may jump.

    These are `event_phases` and, if the attributes describe the model, switches of its stiffness.
    """
    if variable in ("displacement", "velocity"):
        return np.empty(0)  # treated as smooth
    phases = event_phases
    model = model_from_json(run.attrs.get("gear_pair") or run.attrs.get("model", ""))
    if model is not None:
        # The mesh phase of a run-up starts at 0.
        start = 0.0 if "time" in run.dims else float(run.phase[0])
        stop = float(run.phase[-1])
        switches, period = _stiffness_switches(model)
        first, last = (start - math.tau) // period, (stop + math.tau) // period
        period_starts = period * np.arange(first, last + 1.0)
        phases = np.concatenate([phases, (period_starts[:, None] + switches).ravel() - start])
    phases = np.sort(phases)
    return phases[np.diff(phases, prepend=-np.inf) > PHASE_TOLERANCE]


def _stiffness_switches(model: Any) -> tuple:
    """Return (mesh phases of jumps of the stiffness in a period, length of the period in rad)."""
    if model.equation is None:
        segment_bounds = model.system(tuning=1.0).starts  # the same at all tunings
        return segment_bounds[:-1], segment_bounds[-1]
    switches = [[0.0]]
    for pieces in (model.equation.drive_stiffness, model.equation.coast_stiffness):
        start_values, slopes = pieces.lines.T
        end_values = start_values + slopes * np.diff(pieces.breaks)
        jumps = np.abs(np.roll(end_values, 1) - start_values)
        is_jump = jumps > PHASE_TOLERANCE * np.abs(start_values).max()
        switches.append(pieces.breaks[:-1][is_jump])
    return np.unique(np.concatenate(switches)), math.tau


def fourier(phase, values, jumps, block_length, blocks, step, count) -> FourierSums:
    """Return the Fourier coefficients 0 ... count - 1 of samples in consecutive blocks of phase.

    Block b starts at the phase b * block_length, and coefficient n belongs to the wave number
    n * step. Values or slopes jump at the sorted phases `jumps`.
    """
    sums, mean_squares = _block_sums(phase, values, jumps, block_length, blocks, step, count)
    coarse_sums, _ = _block_sums(phase[::2], values[::2], jumps, block_length, blocks, step, count)
    return FourierSums(sums, np.abs(sums - coarse_sums), mean_squares)


def _block_sums(phase, values, jumps, block_length, blocks, step, count) -> tuple:
    """Return (Fourier coefficients, mean squares) of the blocks for the arguments of `fourier`."""
    table, inner_shape = values.reshape(len(values), -1).T, values.shape[1:]
    sums = np.zeros((blocks, count, len(table)), complex)
    squares = np.zeros((blocks, len(table)))
    # A sample at a jump may belong to either side, so it is omitted.
    ends = np.concatenate([[-np.inf], jumps, [np.inf]])
    segments = np.searchsorted(jumps, phase)
    distances = np.minimum(phase - ends[segments], ends[segments + 1] - phase)
    phase, table = phase[distances > PHASE_TOLERANCE], table[:, distances > PHASE_TOLERANCE]
    for b in range(blocks):
        start = b * block_length
        bounds = start - PHASE_TOLERANCE, (b + 1) * block_length - PHASE_TOLERANCE
        first, last = np.searchsorted(phase, bounds)
        indices = np.arange(max(first - STENCIL, 0), min(last + STENCIL, len(phase)))
        block_phase = phase[indices] - start
        weights = _integration_weights(block_phase, jumps - start, block_length)
        samples = table[:, indices]
        weighted, rotation = weights / block_length * samples, np.exp(-1j * step * block_phase)
        waves = weighted.astype(complex)
        for n in range(count):
            sums[b, n] = waves.sum(axis=1)
            waves *= rotation
        squares[b] = (weighted * samples).sum(axis=1)
    return sums.reshape(blocks, count, *inner_shape), squares.reshape(blocks, *inner_shape)


def _integration_weights(phase: np.ndarray, jumps: np.ndarray, length: float) -> np.ndarray:
    """Return quadrature weights of samples at sorted phases for the integral over 0 ... `length`.

    Cubic polynomials interpolate neighbouring samples, but do not extend across sorted `jumps`.
    """
    jumps = jumps[(jumps > phase[0]) & (jumps < phase[-1])]
    ends = np.concatenate([[0.0, length], phase, jumps])
    bounds = np.unique(ends[(ends >= 0.0) & (ends <= length)])
    half, middle = 0.5 * np.diff(bounds), 0.5 * (bounds[1:] + bounds[:-1])
    # The number of a smooth segment is the number of jumps before it.
    segment_of_sample = np.searchsorted(jumps, phase)
    segment_of_interval = np.searchsorted(jumps, middle)
    low = np.searchsorted(segment_of_sample, segment_of_interval, side="left")
    high = np.searchsorted(segment_of_sample, segment_of_interval, side="right")
    # A segment without samples uses the neighbouring samples on both sides.
    is_empty = (low == high).astype(int)
    low, high = np.maximum(low - is_empty, 0), np.minimum(high + is_empty, phase.size)
    size = np.minimum(high - low, STENCIL)
    first = np.clip(np.searchsorted(phase, middle) - size // 2, low, high - size)
    weights = np.zeros(phase.size)
    for n in np.unique(size).tolist():
        intervals = np.flatnonzero(size == n)
        indices = first[intervals] + np.arange(n)[:, None]
        x, nodes = phase[indices] - middle[intervals], half[intervals] * GAUSS_NODES[:, None]
        for i in range(n):
            lagrange = np.ones(nodes.shape)
            for j in range(n):
                if j != i:
                    lagrange *= (nodes - x[j]) / (x[i] - x[j])
            integrals = half[intervals] * (GAUSS_WEIGHTS @ lagrange)
            weights += np.bincount(indices[i], integrals, minlength=phase.size)
    return weights


def _samples_per_period(phase: np.ndarray) -> int:
    """Return the number of samples in a mesh period, from the median step of their phases."""
    return round(math.tau / float(np.median(np.diff(phase)))) if phase.size > 1 else 1


def _check_changes(sums: FourierSums, phase: np.ndarray) -> None:
    """Raise ValueError if a coefficient changes too much with half of the samples."""
    change = sums.changes.max()
    if change > MAX_CHANGE * sums.rms:
        raise ValueError(
            f"samples_per_period = {_samples_per_period(phase)} is not allowed for these orders: "
            f"with half of the samples one changes by {change / sums.rms:.2g} of the "
            f"root mean square, and it must be at most {MAX_CHANGE:g}"
        )


def _dataset(
    motion: Motion | RigSignal, variable, amplitude, sums, indices, revolutions, begins, ends, rpm
) -> xr.Dataset:
    """Return the order map of a variable as a dataset.

    `indices` select the orders, `revolutions` is the number of revolutions per block; blocks extend
    from `begins` to `ends`, s.
    """
    mean = np.abs(sums.coefficients[:, 0])
    overall = np.sqrt(np.maximum(sums.mean_squares - mean**2, 0.0))
    coefficients, changes = sums.coefficients[:, indices], sums.changes[:, indices]
    magnitudes, unit, label = np.abs(coefficients), motion.units, variable.replace("_", " ")
    is_wave = (indices > 0).reshape(1, -1, *[1] * (magnitudes.ndim - 2))  # all orders but 0
    mean_level, level_unit = magnitudes, unit
    if amplitude == "power":
        mean_level, level_unit = magnitudes**2, f"({unit})2" if " " in unit else f"{unit}2"
    levels = np.where(is_wave, _AMPLITUDES[amplitude](magnitudes), mean_level)
    errors = np.where(is_wave, 2.0, 1.0) * changes
    dims, block_dims = ("time", "order", *motion.coords), ("time", *motion.coords)
    phase_name = "of a cosine of the order times the shaft angle"
    overall_name = f"root mean square of the {label} without its mean"
    variables = {
        "amplitude": (dims, levels, level_unit, f"{amplitude} of the orders of the {label}"),
        "phase": (dims, np.angle(coefficients), "rad", phase_name),
        "amplitude_error": (dims, errors, unit, "estimated error of the peak amplitude"),
        "rpm": ("time", rpm, "min-1", "mean speed in the block, negative backwards"),
        "overall": (block_dims, overall, unit, overall_name),
        "order_resolution": ((), 1.0 / revolutions, "1", "order spacing"),
        "teeth": ((), motion.teeth, "1", "mesh periods in a revolution"),
        "time": ("time", 0.5 * (begins + ends), "s", "middle of the block"),
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
        half of the samples; mean squares. Trains have the dimension ``mesh`` as well.

    Raises
    ------
    ValueError
        If the run failed or has no whole revolutions, or if a coefficient changes by more than 5 %
        of the root mean square when every second sample is omitted.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        expected = "a dataset of gearlib.simulate, of gears that turn"
        raise checks.refusal("run", _name_of_run(run), expected)
    mesh_orders, sums = record_sums(run, count)
    dims = ("order", *run.displacement.dims[1:])
    shape = -1, *[1] * (len(dims) - 1)
    # Phases of the orders refer to the mesh phase 0, not to the first sample.
    rotation = np.exp(-1j * mesh_orders * float(run.phase[0])).reshape(shape)
    peak_factor = np.where(mesh_orders > 0.0, 2.0, 1.0).reshape(shape)
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

    They are its teeth, but in a turning planetary train not a whole number.
    """
    ratio = float(run.mesh_frequency) * 60.0 / (math.tau * float(run.speed))
    return Fraction(ratio).limit_denominator(10_000)


def recorded_periods(run: xr.Dataset) -> int:
    """Return the number of recorded mesh periods of a run of `simulate`."""
    return json.loads(run.attrs["parameters"])["record_periods"]


def record_sums(run: xr.Dataset, count: int | None = None, fractional_orders: bool = True) -> tuple:
    """Return (mesh orders, {"force": (samples, sums), "error": (samples, sums)}) of a run.

    These are samples and `FourierSums` of the mesh force (N) and the transmission error (m) of a
    run of `simulate`, with `fractional_orders` in steps of 1 over the recorded mesh periods.
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
    steps_per_order, length = periods if fractional_orders else 1, math.tau * periods
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
        extended, jumps = values, _jumps(run, variable, _event_phases(run))
        if is_periodic:
            extended = np.concatenate([values[-margin:], values, values[:margin]])
        step = 1.0 / steps_per_order
        sums[name] = values, fourier(phase, extended, jumps, length, 1, step, order_count)
    return np.arange(order_count) / steps_per_order, sums


def mesh_order_amplitudes(run: xr.Dataset) -> tuple:
    """Return (mesh orders >= 1, amplitudes of the mesh force in N, of the transmission error in m).

    An amplitude is NaN if it differs too much from that of half of the samples.
    """
    mesh_orders, sums = record_sums(run, fractional_orders=False)
    amplitudes = []
    for name in ("force", "error"):
        _, block_sums = sums[name]
        is_unreliable = block_sums.changes[0] > MAX_CHANGE * block_sums.rms
        peaks = np.where(is_unreliable, math.nan, 2.0 * np.abs(block_sums.coefficients[0]))
        amplitudes.append(peaks[1:])
    return mesh_orders[1:], *amplitudes


def transmission_error(run: xr.Dataset) -> np.ndarray:
    """Return the displacement less the profile deviation at the samples, static deflections."""
    displacement = run.displacement.values
    model = json.loads(run.attrs.get("gear_pair") or run.attrs["model"])
    deviation = model.get("deviation") if "profile" in model else None
    if not deviation:
        return displacement
    phase, scale = run.phase.values, 1.0 / run.static_deflection.item()
    waves = Harmonics(deviation["cosines"], deviation["sines"]).table(scale)
    return displacement - sum(c * np.cos(k * phase) + s * np.sin(k * phase) for k, c, s in waves)

"""`order_map`: orders of run-ups and signals in blocks; `orders`: of runs at constant speed.

The shaft angle is known, so that no window and no leakage enter: Fourier integrals over the angle
are sums over samples. Between switches of the stiffness and contact events a motion is smooth. The
weights of the samples integrate cubic polynomials through neighbouring samples; no polynomial
reaches across a jump. Sums over every second sample give an estimate of the error.

Signals over time are interpolated at equal angles of the shaft by cubic splines. The angle is the
integral of the speed, or that of a tacho of one pulse a revolution. Blocks of `order_map` are whole
revolutions, so that orders on its grid do not leak into each other; the amplitude of an order
between two of them comes out up to 3.9 dB too small.
"""

import json
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from gearlib import checks
from gearlib.data.files import canonical_json
from gearlib.data.result import result_of_many
from gearlib.models.from_values import model_from_json
from gearlib.models.harmonics import Harmonics

#: Phases, and revolutions, closer than this count as equal.
PHASE_TOLERANCE = 1e-9
#: Samples through which a polynomial goes, and a rule of Gauss that integrates it exactly.
STENCIL = 4
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(2)
#: Amplitude of an order above 0 by the absolute value of its Fourier coefficient.
_AMPLITUDES = {
    "rms": lambda c: math.sqrt(2.0) * c,
    "peak": lambda c: 2.0 * c,
    "power": lambda c: 2.0 * c**2,
}
#: Highest mesh order by default.
_DEFAULT_MESH_ORDERS = 5
#: Variables of runs that have orders -> (their scale in a run at constant speed, units).
_VARIABLES = {
    "displacement": (lambda run: run.static_deflection, "m"),
    "velocity": (lambda run: run.static_deflection * run.mesh_frequency, "m s-1"),
    "acceleration": (lambda run: run.static_deflection * run.mesh_frequency**2, "m s-2"),
    "dynamic_force": (lambda run: run.force_scale, "N"),
}
#: Largest change of a coefficient with half of the samples, relative to the root mean square.
MAX_CHANGE = 0.05
#: Samples that the shortest wave of a signal must have. A cubic spline lowers it by the factor
#: 3 sinc(f)^4 / (2 + cos(2 pi f)), f = 1 / samples: with four by 1.5 %, with ten by 0.02 %.
_MIN_SAMPLES_PER_WAVE = 4.0
#: Largest number of interpolated samples of a signal in a revolution.
_MAX_SAMPLES_PER_REVOLUTION = 2**16


@dataclass
class Motion:
    """Samples of one variable over the mesh phase, with the speed profile."""

    phase: np.ndarray  #: mesh phase from the first sample on, shape (k,)
    values: np.ndarray  #: shape (k,), of trains (k, m)
    jumps: np.ndarray | None  #: rising phases at which values or slopes jump; None: not known
    speeds: np.ndarray  #: speed profile from the first sample on, rows of s and rpm
    teeth: float  #: mesh periods in a revolution
    highest: float  #: highest order by default
    units: str
    coords: dict = field(default_factory=dict)  #: dimensions of the values beside the phase
    attrs: dict = field(default_factory=dict)  #: attributes of the order map
    start_time: float = 0.0  #: time of the first sample, s


@dataclass
class FourierSums:
    """Fourier coefficients of blocks of a motion, and their changes with half of the samples."""

    coefficients: np.ndarray  #: complex, shape (blocks, count, ...)
    changes: np.ndarray  #: absolute values of the changes, the same shape
    mean_squares: np.ndarray  #: mean squares of the samples, shape (blocks, ...)

    @property
    def rms(self) -> float:
        """Largest root mean square of the values, with which changes are compared."""
        return math.sqrt(self.mean_squares.max())


class Turning:
    """Revolutions of a shaft with a piecewise linear speed profile, rows of s and rpm."""

    def __init__(self, speed_profile: ArrayLike):
        self._time, speed = np.array(speed_profile, float).T
        #: Speed in revolutions per second, its slope, and revolutions since the first row.
        self._rate = speed / 60.0
        self._slope = np.diff(self._rate) / np.diff(self._time)
        self._turned = cumulative_trapezoid(self._rate, self._time, initial=0.0)

    def revolutions(self, time: np.ndarray) -> np.ndarray:
        """Return the revolutions at times in s; the speed is constant after the last row."""
        i = np.clip(np.searchsorted(self._time, time, "right") - 1, 0, None)
        t = time - self._time[i]
        return self._turned[i] + (self._rate[i] + 0.5 * np.append(self._slope, 0.0)[i] * t) * t

    def at(self, revolutions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (time in s, speed in rpm) after numbers of revolutions."""
        i = np.searchsorted(self._turned, revolutions, "right") - 1
        i = np.clip(i, 0, self._slope.size - 1)
        first_rate, turned = self._rate[i], revolutions - self._turned[i]
        rate = np.sqrt(np.maximum(first_rate**2 + 2.0 * self._slope[i] * turned, 0.0))
        # This form of the solution of the quadratic equation is accurate at a start from rest.
        mean_rate, zeros = first_rate + rate, np.zeros(turned.shape)
        time = np.divide(2.0 * turned, mean_rate, where=turned > 0.0, out=zeros)
        return self._time[i] + time, 60.0 * rate


def order_map(
    run,
    *,
    variable="displacement",
    resolution=1.0,
    highest=None,
    amplitude="rms",
    tacho=None,
    teeth=1,
    orders=None,
):
    """Compute the amplitudes of the orders of a run-up in blocks of revolutions.

    Parameters
    ----------
    run : xarray.Dataset
        A result of `gearlib.run_up` with samples_per_period, or of `gearlib.simulate`. With 128
        samples in a mesh period the error is about 1e-6 of the largest amplitude of the
        displacement, and 1e-4 of that of the force, which jumps where the stiffness does. Times and
        phases count from the first sample.
        Or any signal over ``time`` (s) with ``speed`` (min-1), for instance from
        `gearlib.read_measured`: it is interpolated at equal angles by cubic splines.
    variable : {"displacement", "velocity", "acceleration", "dynamic_force"}
        For a signal the name of its variable.
    resolution : float, default 1
        Distance of orders, > 0 and <= 1: a block has as many revolutions as it takes, so that the
        distance obtained, ``order_resolution``, is 1 over a whole number.
    highest : float, optional
        Highest order; by default 5 per tooth, for a signal the highest with four samples a wave.
    amplitude : {"rms", "peak", "power"}
        Root mean square, amplitude or mean square of a sine. Order 0 is the mean, or its square.
    tacho : sequence of float, optional
        For a signal without speed: times of pulses, one in each revolution, s.
    teeth : int, default 1
        For a signal: mesh periods in a revolution.
    orders : sequence of float, optional
        Single orders, multiples of the distance of orders; by default all up to the highest.

    Returns
    -------
    xarray.Dataset
        Over ``time`` (s, the middle of each block of whole revolutions) and ``order`` (waves per
        revolution of the gear whose teeth count): amplitude; phase (rad, of a cosine of order times
        the shaft angle from the start of the run); amplitude_error, an estimate. Over ``time``:
        rpm, the mean speed, and overall, the root mean square of the variable without its mean.
        For trains over ``mesh`` too. Scalars order_resolution and teeth.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range; or if a coefficient changes by more
        than 5 % of the root mean square when every second sample is left out.
    """
    checks.one_of("amplitude", amplitude, tuple(_AMPLITUDES))
    teeth = checks.integer("teeth", teeth, 1)
    if orders is not None:
        orders = [checks.finite_nonnegative("orders", order) for order in orders]
        checks.require(orders, "orders", orders, "a list of at least one entry")
        highest = max(*orders, resolution) if highest is None else highest
    motion = _motion(run, variable, highest, tacho, teeth)
    resolution = checks.number(
        "resolution", resolution, "a finite number > 0 and <= 1", lambda x: 0.0 < x <= 1.0
    )
    revolutions = math.ceil(1.0 / resolution - 1e-12)
    turned = np.trapezoid(motion.speeds[:, 1], motion.speeds[:, 0]) / 60.0
    blocks = int(turned / revolutions + PHASE_TOLERANCE)
    if blocks < 1:
        raise ValueError(
            f"resolution = {resolution!r} is not allowed for this run: a block must have "
            f"{revolutions} whole revolutions, and the run has {turned:.4g}"
        )
    highest = checks.finite_positive("highest", motion.highest if highest is None else highest)
    per_period = _samples_per_period(motion.phase)
    max_order = 0.25 * per_period * motion.teeth
    if highest > max_order * (1.0 + PHASE_TOLERANCE):
        raise ValueError(
            f"highest = {highest:g} is not allowed with samples_per_period = {per_period}: it must "
            f"be at most {max_order:.4g}, orders with four samples a wave"
        )
    count = int(highest * revolutions + 1e-9) + 1
    step = 1.0 / (motion.teeth * revolutions)
    sums = fourier(motion.phase, motion.values, motion.jumps, math.tau / step, blocks, step, count)
    # Noise changes the coefficients of a measured signal: their changes are not checked.
    if motion.jumps is not None:
        _check_changes(sums, motion.phase)
    indices = np.arange(count)
    if orders is not None:
        indices = np.array([_order_index(order, revolutions, count) for order in orders])
    block_revolutions = revolutions * np.arange(blocks + 1.0)
    bounds = motion.start_time + Turning(motion.speeds).at(block_revolutions)[0]
    return _dataset(motion, variable, amplitude, sums, indices, revolutions, bounds)


def _motion(run: Any, variable: str, highest: float | None, tacho: Any, teeth: int) -> Motion:
    """Return the samples of a variable of a run-up, a run at constant speed or a signal.

    The arguments are those of `order_map`, which are checked.
    """
    names = set(getattr(run, "variables", ()))  # empty if it is no dataset
    if "time" in names and "phase" not in names:
        return _motion_of_signal(run, variable, highest, tacho, teeth)
    checks.one_of("variable", variable, tuple(_VARIABLES))
    if tacho is not None:
        raise checks.refusal("tacho", tacho, "None for a run-up, whose shaft angle is known")
    scales = {"mesh_frequency", "static_deflection", "force_scale", "contact"}
    if names >= scales | {*_VARIABLES} and run.displacement.dims[0] == "phase":
        _check_status(run)
        return _motion_of_simulation(run, variable)
    if not (names >= {variable, "time", "speed", "phase"} and "time" in run.sizes):
        expected = "a dataset of gearlib.run_up with samples_per_period, or of gearlib.simulate"
        raise checks.refusal("run", _name_of_run(run), expected)
    _check_status(run)
    return _motion_of_run_up(run, variable)


def _name_of_run(run: Any) -> Any:
    """Return the name of a run for an error message: its title, or its type."""
    return run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run


def _check_status(run: xr.Dataset) -> None:
    """Raise ValueError if a run could not go on."""
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")


def _motion_of_run_up(run: xr.Dataset, variable: str) -> Motion:
    """Return the samples of a variable in a dataset of `gearlib.run_up`."""
    speed, time, phase = (run[name].values for name in ("speed", "time", "phase"))
    profiles = json.loads(run.attrs["parameters"])
    # Corners of the profiles and contact events, where the variable or its slope may jump.
    jump_times = [row[0] for row in (*profiles["speed"], *profiles["load"])]
    if "event_time" in run:
        jump_times.extend(run.event_time.values)
    angle = math.pi / 60.0 * ((speed[1:] + speed[:-1]) * np.diff(time)).sum()
    teeth = _periods_per_revolution(phase, angle)
    phases = math.tau * teeth * Turning(profiles["speed"]).revolutions(np.array(jump_times))
    return Motion(
        phase,
        run[variable].values,
        _jumps(run, variable, phases),
        np.array(profiles["speed"]),
        teeth,
        _DEFAULT_MESH_ORDERS * teeth,
        run[variable].attrs["units"],
        {name: run[name].variable for name in run[variable].dims[1:]},
        _attributes(run, "references", "gear_pair", "model", "parameters"),
    )


def _motion_of_simulation(run: xr.Dataset, variable: str) -> Motion:
    """Return the samples of a variable in a dataset of `gearlib.simulate`, in SI units."""
    phase, rpm = run.phase.values - run.phase.values[0], float(run.speed)
    omega, phases = float(run.mesh_frequency), _event_phases(run)
    scale, units = _VARIABLES[variable]
    teeth = _periods_per_revolution(phase, math.pi / 30.0 * rpm * phase[-1] / omega)
    speeds = np.array([[0.0, rpm], [phases[1] / omega, rpm]])
    attrs = _attributes(run, "references", "model", "gear_pair")
    return Motion(
        phase,
        run[variable].values * float(scale(run)),
        _jumps(run, variable, phases),
        speeds,
        teeth,
        _DEFAULT_MESH_ORDERS * teeth,
        units,
        {name: run[name].variable for name in run[variable].dims[1:]},
        attrs | {"parameters": _profiles_json(speeds)},
    )


def _event_phases(run: xr.Dataset) -> np.ndarray:
    """Return the phases of both ends and of the events of a run of `simulate`.

    Phases are those after the first sample, in rad.
    """
    end = math.tau * json.loads(run.attrs["parameters"])["record_periods"]
    return np.array([0.0, end, *(run.event_phase.values - run.phase.values[0])])


def _periods_per_revolution(phase: np.ndarray, angle: float) -> float:
    """Return the mesh periods in a revolution: a whole number unless it is far from one.

    `phase` are the mesh phases of the samples, `angle` is how far the shaft turns in them, in rad.
    """
    # One sample has no ratio; it gives no block either.
    ratio = float((phase[-1] - phase[0]) / angle) if angle > 0.0 else 1.0
    return float(round(ratio)) if abs(ratio - round(ratio)) < 1e-6 * ratio else ratio


def _attributes(run: xr.Dataset, *names: str) -> dict:
    """Return the attributes of a run among the given names that exist."""
    return {name: run.attrs[name] for name in names if name in run.attrs}


def _profiles_json(speeds: np.ndarray) -> str:
    """Return a speed profile, rows of s and rpm, with a constant load as JSON."""
    return canonical_json({"speed": speeds.tolist(), "load": [[0.0, 1.0]]})


def _motion_of_signal(
    data: xr.Dataset, variable: str, highest: float | None, tacho: Any, teeth: int
) -> Motion:
    """Return a signal over time as samples at equal angles of the shaft.

    The angle follows from the speed in the dataset, or from the times of tacho pulses. `highest` is
    the highest order that is needed, `teeth` the mesh periods in a revolution.
    """
    time, values = _signal(data, variable)
    angle_at, profile = _angle_by_speed(data, time) if tacho is None else _angle_by_tacho(tacho)
    inside = (time >= profile[0, 0]) & (time <= profile[-1, 0])
    if inside.sum() < 4:
        raise ValueError("tacho is not allowed: it must have four samples or more between pulses")
    time, values = time[inside], values[inside]
    angles = angle_at(time)
    steps = np.diff(angles)
    if not (steps > 0.0).all():
        raise ValueError("speed is not allowed: it must be > 0 at all samples")
    max_order = 1.0 / (_MIN_SAMPLES_PER_WAVE * float(steps.max()))
    if highest is not None and highest > max_order:
        raise ValueError(
            f"highest = {highest!r} is not allowed: it must be at most {max_order:.4g}, orders "
            f"with {_MIN_SAMPLES_PER_WAVE:g} samples a wave at the highest speed"
        )
    count = min(2 * math.ceil(0.5 / float(steps.min())), _MAX_SAMPLES_PER_REVOLUTION)
    turned = np.arange(int((angles[-1] - angles[0]) * count) + 1) / count
    speeds = profile[profile[:, 0] > time[0]]
    first_speed = float(np.interp(time[0], profile[:, 0], profile[:, 1]))
    speeds = np.vstack([[time[0], first_speed], speeds])
    speeds[:, 0] -= time[0]
    # The piecewise linear speed is scaled to the angle of the spline, so that blocks agree.
    total_angle = float(angle_at(profile[-1, 0]) - angles[0])
    speeds[:, 1] *= total_angle / (np.trapezoid(speeds[:, 1], speeds[:, 0]) / 60.0)
    return Motion(
        math.tau * teeth * turned,
        CubicSpline(angles, values)(angles[0] + turned),
        None,
        speeds,
        float(teeth),
        max_order,
        data[variable].attrs.get("units", "1"),
        attrs={"parameters": _profiles_json(speeds)},
        start_time=float(time[0]),
    )


def _signal(data: xr.Dataset, variable: str) -> tuple:
    """Return (time, values) of a signal in a dataset; raise ValueError unless both are usable."""
    if variable not in data.variables or data[variable].shape != data["time"].shape:
        raise checks.refusal("variable", variable, "a variable of the dataset over time")
    time = np.asarray(data["time"].values, float)
    values = np.asarray(data[variable].values, float)
    if not (time.ndim == 1 and time.size > 3 and np.isfinite(values).all()):
        raise ValueError(
            f"{variable} is not allowed: it must have four samples or more, all finite"
        )
    if not (np.isfinite(time).all() and (np.diff(time) > 0.0).all()):
        raise ValueError("time is not allowed: it must rise from sample to sample")
    return time, values


def _angle_by_speed(data: xr.Dataset, time: np.ndarray) -> tuple:
    """Return (function from time in s to revolutions, speed profile as rows of s and rpm).

    Both follow from the speeds in a dataset at rising times.
    """
    if "speed" not in data.variables or data["speed"].shape != time.shape:
        raise ValueError("tacho = None is not allowed for a dataset without speed")
    speed = np.asarray(data["speed"].values, float)
    if not (np.isfinite(speed).all() and (speed > 0.0).all()):
        raise ValueError("speed is not allowed: it must be > 0 at all samples")
    turned = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    return CubicSpline(time, turned), np.column_stack([time, speed])


def _angle_by_tacho(tacho: Any) -> tuple:
    """Return (function from time in s to revolutions, speed profile as rows of s and rpm).

    Both follow from the times of tacho pulses in s, one in each revolution.
    """
    pulses = np.array(checks.finite("tacho", tacho))
    if pulses.size < 4 or not (np.diff(pulses) > 0.0).all():
        raise ValueError("tacho is not allowed: it must be four times or more that rise")
    angle_at = CubicSpline(pulses, np.arange(pulses.size))
    return angle_at, np.column_stack([pulses, 60.0 * angle_at(pulses, 1)])


def _jumps(run: xr.Dataset, variable: str, event_phases: np.ndarray) -> np.ndarray:
    """Return the rising phases at which a variable of a run or its slope jumps.

    These are `event_phases` and, if the run names its model, switches of the stiffness. Phases
    count from the first sample.
    """
    if variable in ("displacement", "velocity"):
        return np.empty(0)
    phases = event_phases
    model = model_from_json(run.attrs.get("gear_pair") or run.attrs.get("model", ""))
    if model is not None:
        # Phases of run-ups count from the mesh phase 0.
        begin = 0.0 if "time" in run.dims else float(run.phase[0])
        end = float(run.phase[-1])
        switches, period = _stiffness_switches(model)
        first, last = (begin - math.tau) // period, (end + math.tau) // period
        starts = period * np.arange(first, last + 1.0)
        phases = np.concatenate([phases, (starts[:, None] + switches).ravel() - begin])
    phases = np.sort(phases)
    return phases[np.diff(phases, prepend=-np.inf) > PHASE_TOLERANCE]


def _stiffness_switches(model: Any) -> tuple:
    """Return (phases at which mesh forces of a model may jump, phase after which they repeat)."""
    if model.equation is None:
        starts = model.system(1.0).starts
        return starts[:-1], starts[-1]
    switches = [[0.0]]
    for side in (model.equation.drive_stiffness, model.equation.coast_stiffness):
        ends = side.lines[:, 0] + side.lines[:, 1] * np.diff(side.breaks)
        jumps = np.abs(np.roll(ends, 1) - side.lines[:, 0])
        switches.append(side.breaks[:-1][jumps > PHASE_TOLERANCE * np.abs(side.lines[:, 0]).max()])
    return np.unique(np.concatenate(switches)), math.tau


def fourier(
    phase: np.ndarray,
    values: np.ndarray,
    jumps: np.ndarray | None,
    span: float,
    blocks: int,
    step: float,
    count: int,
) -> FourierSums:
    """Return the Fourier coefficients 0 ... count - 1 of samples, in blocks of a span of phase.

    `phase` has shape (k,), `values` (k,) or (k, m). Block b begins at phase b span, and coefficient
    n belongs to the wave number n step. Values or slopes jump at the rising phases `jumps`, None if
    these are not known.
    """
    sums, mean_squares = _block_sums(phase, values, jumps, span, blocks, step, count)
    coarse_sums, _ = _block_sums(phase[::2], values[::2], jumps, span, blocks, step, count)
    return FourierSums(sums, np.abs(sums - coarse_sums), mean_squares)


def _block_sums(
    phase: np.ndarray,
    values: np.ndarray,
    jumps: np.ndarray | None,
    span: float,
    blocks: int,
    step: float,
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (coefficients, mean squares) of the blocks, for the arguments of `fourier`.

    Without known jumps the samples are integrated by the trapezoidal rule.
    """
    table, inner_shape = values.reshape(len(values), -1), values.shape[1:]
    sums = np.zeros((blocks, count, table.shape[1]), complex)
    squares = np.zeros((blocks, table.shape[1]))
    if jumps is not None:
        # A sample at a jump may belong to either side, so it is left out.
        ends = np.concatenate([[-np.inf], jumps, [np.inf]])
        after = np.searchsorted(jumps, phase)
        distances = np.minimum(phase - ends[after], ends[after + 1] - phase)
        phase, table = phase[distances > PHASE_TOLERANCE], table[distances > PHASE_TOLERANCE]
    for b in range(blocks):
        bounds = b * span - PHASE_TOLERANCE, (b + 1) * span - PHASE_TOLERANCE
        first, last = np.searchsorted(phase, bounds)
        if jumps is None:
            # The next block begins where this one ends, unless the signal is over.
            indices = np.append(np.arange(first, last), min(last, len(phase) - 1))
            block_phase = np.append(phase[first:last] - b * span, span)
            weights = np.gradient(block_phase)
            weights[[0, -1]] *= 0.5
        else:
            indices = np.arange(max(first - STENCIL, 0), min(last + STENCIL, len(phase)))
            block_phase = phase[indices] - b * span
            weights = _integration_weights(block_phase, jumps - b * span, span)
        samples, weights = table[indices], weights / span
        weighted, wave = weights[:, None] * samples, np.exp(-1j * step * block_phase)
        power = np.ones(block_phase.size, complex)
        for n in range(count):
            # A matrix product would start the threads of BLAS for small sums.
            sums[b, n] = np.einsum("i,im->m", power, weighted)
            power *= wave
        squares[b] = np.einsum("im,im->m", weighted, samples)
    return sums.reshape(blocks, count, *inner_shape), squares.reshape(blocks, *inner_shape)


def _integration_weights(phase: np.ndarray, jumps: np.ndarray, span: float) -> np.ndarray:
    """Return the weights (n,) with which samples at phases (n,) add up to the integral.

    The integral goes from phase 0 to `span`. Cubic polynomials interpolate neighbouring samples;
    none reaches across one of the rising phases `jumps`.
    """
    jumps = jumps[(jumps > phase[0]) & (jumps < phase[-1])]
    ends = np.concatenate([[0.0, span], phase, jumps])
    bounds = np.unique(ends[(ends >= 0.0) & (ends <= span)])
    half, middle = 0.5 * np.diff(bounds), 0.5 * (bounds[1:] + bounds[:-1])
    # Smooth segments are numbered by the jumps before them.
    segment_of_sample = np.searchsorted(jumps, phase)
    segment_of_interval = np.searchsorted(jumps, middle)
    low = np.searchsorted(segment_of_sample, segment_of_interval, side="left")
    high = np.searchsorted(segment_of_sample, segment_of_interval, side="right")
    # In a segment without samples the neighbours on both sides are used.
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
    """Raise ValueError if a coefficient changes too much with half of the samples.

    `phase` are the mesh phases of the samples.
    """
    change = sums.changes.max()
    if change > MAX_CHANGE * sums.rms:
        raise ValueError(
            f"samples_per_period = {_samples_per_period(phase)} is not allowed for these orders: "
            f"with half of the samples one changes by {change / sums.rms:.2g} of the "
            f"root mean square, and it must be at most {MAX_CHANGE:g}"
        )


def _order_index(order: float, revolutions: int, count: int) -> int:
    """Return the index of an order among the `count` multiples of 1 / revolutions, checked."""
    index = round(order * revolutions)
    if abs(index - order * revolutions) > 1e-9 * max(order, 1.0) or index >= count:
        raise ValueError(
            f"orders = {order!r} is not allowed: it must be one of 0, "
            f"{1.0 / revolutions:.4g}, ..., {(count - 1) / revolutions:.4g}"
        )
    return index


def _dataset(
    motion: Motion,
    variable: str,
    amplitude: str,
    sums: FourierSums,
    indices: np.ndarray,
    revolutions: int,
    bounds: np.ndarray,
) -> xr.Dataset:
    """Return the order map of a variable as a dataset.

    `indices` are those of its orders in `sums`, `amplitude` is a key of `_AMPLITUDES`. Each block
    has `revolutions`; `bounds` are the times of their ends, shape (blocks + 1,), s.
    """
    mean = np.abs(sums.coefficients[:, 0])
    overall = np.sqrt(np.maximum(sums.mean_squares - mean**2, 0.0))
    coefficients, changes = sums.coefficients[:, indices], sums.changes[:, indices]
    size, unit, label = np.abs(coefficients), motion.units, variable.replace("_", " ")
    is_wave = (indices > 0).reshape(1, -1, *[1] * (size.ndim - 2))
    constant_level, level_unit = size, unit
    if amplitude == "power":
        constant_level, level_unit = size**2, f"({unit})2" if " " in unit else f"{unit}2"
    levels = np.where(is_wave, _AMPLITUDES[amplitude](size), constant_level)
    errors = np.where(is_wave, 2.0, 1.0) * changes
    times, rpm = 0.5 * (bounds[1:] + bounds[:-1]), 60.0 * revolutions / np.diff(bounds)
    dims, block_dims = ("time", "order", *motion.coords), ("time", *motion.coords)
    angle = "of a cosine of the order times the shaft angle"
    table = {
        "amplitude": (dims, levels, level_unit, f"{amplitude} of the orders of the {label}"),
        "phase": (dims, np.angle(coefficients), "rad", angle),
        "amplitude_error": (dims, errors, unit, "estimated error, of a peak"),
        "rpm": ("time", rpm, "min-1", "mean speed in the block"),
        "overall": (
            block_dims,
            overall,
            unit,
            f"root mean square of the {label} without its mean",
        ),
        "order_resolution": ((), 1.0 / revolutions, "1", "order spacing"),
        "teeth": ((), motion.teeth, "1", "mesh periods in a revolution"),
        "time": ("time", times, "s", "middle of the block"),
        "order": ("order", indices / revolutions, "1", "order, waves per revolution"),
    }
    data = {
        name: (dims, values, {"units": units, "long_name": long_name})
        for name, (dims, values, units, long_name) in table.items()
    }
    coords = {name: data.pop(name) for name in ("time", "order")} | motion.coords
    title, method = f"Order map of the {label}", "Fourier sums over the shaft angle"
    names = {"variable": variable, "amplitude": amplitude}
    return result_of_many(title, data, coords, method, **names, **motion.attrs)


def orders(run, *, count=None):
    """Compute the order spectrum of the mesh force and of the transmission error of a run.

    Parameters
    ----------
    run : xarray.Dataset
        A result of `gearlib.simulate`, with a record of whole revolutions or whole orbits.
    count : int, optional
        Highest mesh order; by default 10, at most a quarter of the samples per period.

    Returns
    -------
    xarray.Dataset
        Over ``order`` (per revolution of the gear whose teeth count, from 0): mesh_order (order
        over teeth), force_amplitude (N, peak; the mean at order 0), force_phase,
        error_amplitude (m) and error_phase (rad; of a cosine of the mesh phase times the mesh
        order); force_amplitude_error and error_amplitude_error, estimates (not bounds) by the
        change with half of the samples; mean squares. For trains over ``mesh`` too.

    Raises
    ------
    ValueError
        If the run could not go on, has no whole revolutions, or a coefficient changes by more than
        5 % of the root mean square when every second sample is left out.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        expected = "a dataset of gearlib.simulate, of gears that turn"
        raise checks.refusal("run", _name_of_run(run), expected)
    mesh_orders, sums = record_sums(run, count)
    dims = ("order", *run.displacement.dims[1:])
    shape = -1, *[1] * (len(dims) - 1)
    # Phases of the orders count from the mesh phase 0, not from the first sample.
    turn = np.exp(-1j * mesh_orders * float(run.phase[0])).reshape(shape)
    peak_factor = np.where(mesh_orders > 0.0, 2.0, 1.0).reshape(shape)
    data: dict = {"mesh_order": ("order", mesh_orders)}
    for name, (values, block) in sums.items():
        _check_changes(block, run.phase.values)
        coefficients, changes = block.coefficients[0], block.changes[0]
        data[f"{name}_amplitude"] = dims, peak_factor * np.abs(coefficients)
        data[f"{name}_phase"] = dims, np.angle(coefficients * turn)
        data[f"{name}_amplitude_error"] = dims, peak_factor * changes
        data[f"mean_square_{name}"] = dims[1:], (values**2).mean(axis=0)
    data |= {name: run[name].values for name in ("tuning", "speed", "mesh_frequency", "period")}
    periods = _record_periods(run)
    coords = {"order": np.arange(mesh_orders.size) * _teeth_of(run) / periods}
    coords |= {name: run[name].values for name in dims[1:]}
    dataset = result_of_many("Order spectrum of a gear mesh", data, coords, "Fourier sums")
    dataset["order"].attrs["long_name"] = (
        "order, waves per revolution of the gear whose teeth count"
    )
    dataset.attrs |= _attributes(run, "references", "gear_pair", "parameters")
    return dataset


def _teeth_of(run: xr.Dataset) -> int:
    """Return the mesh periods in a revolution of the gear that turns with the run's speed."""
    return round(float(run.mesh_frequency) * 60.0 / (math.tau * float(run.speed)))


def _record_periods(run: xr.Dataset) -> int:
    """Return the number of recorded mesh periods of a run of `simulate`."""
    return json.loads(run.attrs["parameters"])["record_periods"]


def record_sums(run: xr.Dataset, count: int | None = None, fractions: bool = True) -> tuple:
    """Return (mesh orders, {"force": ..., "error": ...}) of a run of `simulate`.

    The mesh force (N) and the transmission error (m) have (values at the samples, `FourierSums` of
    one block). Mesh orders go up to `count`, in steps of 1 over the recorded mesh periods, or of 1
    without `fractions`.
    """
    _check_status(run)
    periods, teeth = _record_periods(run), _teeth_of(run)
    orbit_periods = int(run.period)
    repeats = orbit_periods and periods % orbit_periods == 0
    if periods % teeth and not repeats:
        raise ValueError(
            f"record_periods = {periods} is not allowed: it must be a multiple of {teeth}, whole "
            "revolutions of the gear whose teeth count"
            + (f", or of the {orbit_periods} periods of the orbit" if orbit_periods else "")
        )
    max_count = max(run.phase.size // periods // 4, 1)
    count = checks.integer("count", min(10, max_count) if count is None else count, 1, max_count)
    steps_per_order, span = periods if fractions else 1, math.tau * periods
    order_count = count * steps_per_order + 1
    phase = run.phase.values - run.phase.values[0]
    margin = 2 * STENCIL
    if repeats:
        # The record is continued periodically, so that polynomials at both ends are central.
        phase = np.concatenate([phase[-margin:] - span, phase, phase[:margin] + span])
    sums = {}
    for name, values, variable in (
        ("force", run.dynamic_force.values * float(run.force_scale), "dynamic_force"),
        ("error", transmission_error(run) * float(run.static_deflection), "displacement"),
    ):
        record, jumps = values, _jumps(run, variable, _event_phases(run))
        if repeats:
            record = np.concatenate([values[-margin:], values, values[:margin]])
        sums[name] = (
            values,
            fourier(phase, record, jumps, span, 1, 1.0 / steps_per_order, order_count),
        )
    return np.arange(order_count) / steps_per_order, sums


def mesh_order_amplitudes(run: xr.Dataset) -> tuple:
    """Return (mesh orders from 1 on, amplitudes of the mesh force, of the transmission error).

    The amplitudes are in N and m, NaN if half of the samples gives a different one.
    """
    mesh_orders, sums = record_sums(run, fractions=False)
    amplitudes = []
    for name in ("force", "error"):
        _, block = sums[name]
        is_unreliable = block.changes[0] > MAX_CHANGE * block.rms
        peaks = np.where(is_unreliable, math.nan, 2.0 * np.abs(block.coefficients[0]))
        amplitudes.append(peaks[1:])
    return mesh_orders[1:], *amplitudes


def transmission_error(run: xr.Dataset) -> np.ndarray:
    """Return the transmission error at the samples of a run, in static deflections.

    If the model has a deviation of the flanks, the run's displacement is that of the flanks, and
    the deviation is subtracted.
    """
    displacement = run.displacement.values
    model = json.loads(run.attrs.get("gear_pair") or run.attrs["model"])
    deviation = model.get("deviation") if "profile" in model else None
    if not deviation:
        return displacement
    phase, scale = run.phase.values, 1.0 / run.static_deflection.item()
    waves = Harmonics(deviation["cosines"], deviation["sines"]).table(scale)
    return displacement - sum(c * np.cos(k * phase) + s * np.sin(k * phase) for k, c, s in waves)

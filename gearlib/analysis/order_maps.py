"""`order_map`: orders of run-ups and signals, block by block; `orders`: of runs at constant speed.

The shaft angle is known, so that no window and no leakage enter: Fourier integrals over the angle
are sums over samples. Between switches of the stiffness and contact events a motion is smooth. Each
sample weighs as much as cubic polynomials through neighbouring samples give it; no polynomial
reaches across a jump. Sums over every second sample tell the error.

Signals over time are interpolated at equal angles of the shaft by cubic splines. The angle is the
integral of the speed, or that of a tacho of one pulse a revolution. Blocks of `order_map` are whole
revolutions, so that orders on its grid do not leak into each other; of what lies between two of
them a block sees up to 3.9 dB too little.
"""

import json
import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from gearlib import checks
from gearlib.data.files import canonical_json
from gearlib.data.result import result_of_many
from gearlib.models.from_values import model_of
from gearlib.models.harmonics import Harmonics

#: Phases, and revolutions, closer than this count as equal.
SAME_PHASE = 1e-9
#: Samples through which a polynomial goes, and a rule of Gauss that integrates it exactly.
STENCIL = 4
NODES, WEIGHTS = np.polynomial.legendre.leggauss(2)
#: Amplitude of an order above 0 by the absolute value of its Fourier coefficient.
_AMPLITUDES = {
    "rms": lambda c: math.sqrt(2.0) * c,
    "peak": lambda c: 2.0 * c,
    "power": lambda c: 2.0 * c**2,
}
#: Highest mesh order by default.
_MESH_ORDERS = 5
#: Variables of runs that have orders -> (their scale in a run at constant speed, units).
_VARIABLES = {
    "displacement": (lambda run: run.static_deflection, "m"),
    "velocity": (lambda run: run.static_deflection * run.mesh_frequency, "m s-1"),
    "acceleration": (lambda run: run.static_deflection * run.mesh_frequency**2, "m s-2"),
    "dynamic_force": (lambda run: run.force_scale, "N"),
}
#: Largest change of a coefficient with half of the samples, of the root mean square.
MAX_CHANGE = 0.05
#: Samples that the shortest wave of a signal must have. A cubic spline lowers it by the factor
#: 3 sinc(f)^4 / (2 + cos(2 pi f)), f = 1 / samples: with four by 1.5 %, with ten by 0.02 %.
_SAMPLES_PER_WAVE = 4.0
#: Most samples of a signal in a revolution.
_MAX_SAMPLES = 2**16


@dataclass
class Motion:
    """One variable over the mesh phase, as `order_map` needs it."""

    phase: np.ndarray  #: mesh phase from the first sample on, shape (k,)
    values: np.ndarray  #: shape (k,), of trains (k, m)
    jumps: np.ndarray | None  #: rising phases at which values or slopes jump; None: not known
    speeds: np.ndarray  #: course of the speed from the first sample on, rows of s and rpm
    teeth: float  #: mesh periods in a revolution
    highest: float  #: highest order by default
    units: str
    coords: dict  #: dimension of the values beside the phase -> its coordinate
    attrs: dict  #: attributes that the order map keeps
    begin: float = 0.0  #: time of the first sample, s


class Turning:
    """A course of speed, rows of s and rpm; revolutions count from its first row."""

    def __init__(self, rows):
        self._time, speed = np.array(rows, float).T
        self._rate = speed / 60.0
        self._slope = np.diff(self._rate) / np.diff(self._time)
        self._turned = cumulative_trapezoid(self._rate, self._time, initial=0.0)

    def revolutions(self, time):
        """Return how far the shaft has turned (array); behind the last row its speed stays."""
        i = np.clip(np.searchsorted(self._time, time, "right") - 1, 0, None)
        t = time - self._time[i]
        return self._turned[i] + (self._rate[i] + 0.5 * np.append(self._slope, 0.0)[i] * t) * t

    def at(self, revolutions):
        """Return (time, speed in rpm) after so many revolutions (arrays)."""
        i = np.searchsorted(self._turned, revolutions, "right") - 1
        i = np.clip(i, 0, self._slope.size - 1)
        first, ahead = self._rate[i], revolutions - self._turned[i]
        rate = np.sqrt(np.maximum(first**2 + 2.0 * self._slope[i] * ahead, 0.0))
        # From rest, the root of a difference would cancel.
        passed = np.divide(2.0 * ahead, first + rate, where=ahead > 0.0, out=np.zeros(ahead.shape))
        return self._time[i] + passed, 60.0 * rate


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
    """Return how strong the orders of a run-up are, block of revolutions by block.

    Parameters
    ----------
    run : xarray.Dataset
        Of `gearlib.run_up` with samples_per_period, or of `gearlib.simulate`. Its samples are
        summed: with 128 in a mesh period the error is about 1e-6 of the largest amplitude of the
        displacement, 1e-4 of that of the force, which jumps where the stiffness does. Times and
        phases count from the first sample.
        Or any signal over ``time`` (s) with ``speed`` (min-1), as of `gearlib.read_measured`: it is
        interpolated at equal angles, by cubic splines.
    variable : {"displacement", "velocity", "acceleration", "dynamic_force"}
        Of a signal its name.
    resolution : float, default 1
        Distance of orders, > 0 and <= 1: a block has as many revolutions as it takes, so that the
        distance obtained, ``order_resolution``, is 1 over a whole number.
    highest : float, optional
        Highest order; by default 5 per tooth, of a signal the highest with four samples a wave.
    amplitude : {"rms", "peak", "power"}
        Of a sine: its root mean square, its amplitude, its mean square. Order 0 is the mean, or its
        square.
    tacho : sequence of float, optional
        Of a signal without speed: times of pulses, one a revolution, s.
    teeth : int, default 1
        Of a signal: mesh periods in a revolution.
    orders : sequence of float, optional
        Single orders, multiples of the distance of orders; by default all up to the highest.

    Returns
    -------
    xarray.Dataset
        Over ``time`` (s, the middle of each block of whole revolutions) and ``order`` (waves per
        revolution of the gear whose teeth count): amplitude, phase (rad, of a cosine of order times
        the shaft angle from the start of the run), of trains over ``mesh`` too;
        amplitude_error, an estimate; over ``time``: rpm, the mean speed, and overall, the root mean
        square of all without the mean. Scalars order_resolution and teeth.

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
    blocks = int(turned / revolutions + SAME_PHASE)
    if blocks < 1:
        raise ValueError(
            f"resolution = {resolution!r} is not allowed for this run: a block must have "
            f"{revolutions} whole revolutions, and the run has {turned:.4g}"
        )
    top = checks.finite_positive("highest", motion.highest if highest is None else highest)
    per_period = _samples_per_period(motion.phase)
    most = 0.25 * per_period * motion.teeth
    if top > most * (1.0 + SAME_PHASE):
        raise ValueError(
            f"highest = {top:g} is not allowed with samples_per_period = {per_period}: it must be "
            f"at most {most:.4g}, orders with four samples a wave"
        )
    count = int(top * revolutions + 1e-9) + 1
    step = 1.0 / (motion.teeth * revolutions)
    sums = fourier(motion.phase, motion.values, motion.jumps, math.tau / step, blocks, step, count)
    # Noise changes a measured signal, and where it jumps is not known: its changes pass.
    if motion.jumps is not None:
        _check_change(sums, motion.phase)
    number = np.arange(count)
    if orders is not None:
        number = np.array([_number(order, revolutions, count) for order in orders])
    bounds = motion.begin + Turning(motion.speeds).at(revolutions * np.arange(blocks + 1.0))[0]
    return _dataset(motion, variable, amplitude, sums, number, revolutions, bounds)


def _motion(run, variable, highest, tacho, teeth):
    """Return the `Motion` of a run-up, of a run at constant speed or of a signal, checked."""
    names = set(getattr(run, "variables", ()))
    if "time" in names and "phase" not in names:
        return _motion_of_signal(run, variable, highest, tacho, teeth)
    checks.one_of("variable", variable, tuple(_VARIABLES))
    if tacho is not None:
        raise checks.refusal("tacho", tacho, "None for a run-up, whose shaft angle is known")
    scales = {"mesh_frequency", "static_deflection", "force_scale", "contact"}
    simulated = names >= scales | {*_VARIABLES} and run.displacement.dims[0] == "phase"
    if not simulated and not (
        names >= {variable, "time", "speed", "phase"} and "time" in run.sizes
    ):
        words = "a dataset of gearlib.run_up with samples_per_period, or of gearlib.simulate"
        raise checks.refusal("run", _shown(run), words)
    _check_status(run)
    make = _course_of_simulation if simulated else _course_of_run_up
    phase, values, marks, speeds, teeth, units, attrs = make(run, variable)
    jumps = _jumps_of(run, variable, marks)
    coords = {name: run[name].variable for name in run[variable].dims[1:]}
    highest = _MESH_ORDERS * teeth
    return Motion(phase, values, jumps, speeds, teeth, highest, units, coords, attrs)


def _shown(run):
    """Return the words that stand for a run in a refusal."""
    return run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run


def _check_status(run):
    """Refuse a run that could not go on."""
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")


def _course_of_run_up(run, variable):
    """Return (phase, values, marks, speeds, teeth, units, attributes) of a run-up, see `Motion`.

    Marks are phases at which its variable, or its slope, may jump beside switches of the stiffness.
    """
    speed, time, phase = (run[name].values for name in ("speed", "time", "phase"))
    course = json.loads(run.attrs["parameters"])
    marks = [row[0] for row in (*course["speed"], *course["load"])]
    marks = np.array([*marks, *(run.event_time.values if "event_time" in run else ())])
    teeth = _whole(phase, math.pi / 60.0 * ((speed[1:] + speed[:-1]) * np.diff(time)).sum())
    marks = math.tau * teeth * Turning(course["speed"]).revolutions(marks)
    attrs = _kept(run, "references", "gear_pair", "model", "parameters")
    values, units = run[variable].values, run[variable].attrs["units"]
    return phase, values, marks, np.array(course["speed"]), teeth, units, attrs


def _course_of_simulation(run, variable):
    """Return what `_course_of_run_up` does, of a run of `gearlib.simulate`."""
    phase, rpm = run.phase.values - run.phase.values[0], float(run.speed)
    omega, marks, (scale, units) = float(run.mesh_frequency), _marks(run), _VARIABLES[variable]
    teeth = _whole(phase, math.pi / 30.0 * rpm * phase[-1] / omega)
    speeds = np.array([[0.0, rpm], [marks[1] / omega, rpm]])
    attrs = _kept(run, "references", "model", "gear_pair") | {"parameters": _course_text(speeds)}
    return phase, run[variable].values * float(scale(run)), marks, speeds, teeth, units, attrs


def _marks(run):
    """Return phases from the first sample on: the ends of the record of `simulate`, its events."""
    end = math.tau * json.loads(run.attrs["parameters"])["record_periods"]
    return np.array([0.0, end, *(run.event_phase.values - run.phase.values[0])])


def _whole(phase, angle):
    """Return the mesh periods in a revolution by the mesh phase and the angle of the shaft."""
    # One sample has no ratio, and no block either.
    ratio = float((phase[-1] - phase[0]) / angle) if angle > 0.0 else 1.0
    return float(round(ratio)) if abs(ratio - round(ratio)) < 1e-6 * ratio else ratio


def _kept(run, *names):
    """Return these attributes of a run, as far as it has them."""
    return {name: run.attrs[name] for name in names if name in run.attrs}


def _course_text(speeds):
    """Return the attribute that tells a course of speed at constant load."""
    return canonical_json({"speed": speeds.tolist(), "load": [[0.0, 1.0]]})


def _motion_of_signal(data, variable, highest, tacho, teeth):
    """Return the `Motion` of samples over time; `tacho` are times of pulses, one a revolution."""
    time, values = _samples(data, variable)
    turns, course = _turns_by_speed(data, time) if tacho is None else _turns_by_tacho(tacho)
    inside = (time >= course[0, 0]) & (time <= course[-1, 0])
    if inside.sum() < 4:
        raise ValueError("tacho is not allowed: it must have four samples or more between pulses")
    time, values = time[inside], values[inside]
    angles = turns(time)
    steps = np.diff(angles)
    if not (steps > 0.0).all():
        raise ValueError("speed is not allowed: it must be > 0 at all samples")
    limit = 1.0 / (_SAMPLES_PER_WAVE * float(steps.max()))
    if highest is not None and highest > limit:
        raise ValueError(
            f"highest = {highest!r} is not allowed: it must be at most {limit:.4g}, orders with "
            f"{_SAMPLES_PER_WAVE:g} samples a wave at the highest speed"
        )
    count = min(2 * math.ceil(0.5 / float(steps.min())), _MAX_SAMPLES)
    turned = np.arange(int((angles[-1] - angles[0]) * count) + 1) / count
    rows = course[course[:, 0] > time[0]]
    rows = np.vstack([[time[0], float(np.interp(time[0], *course.T))], rows])
    rows[:, 0] -= time[0]
    # Straight lines between these turn by nearly as much: that many blocks there are.
    whole = float(turns(course[-1, 0]) - angles[0])
    rows[:, 1] *= whole / (np.trapezoid(rows[:, 1], rows[:, 0]) / 60.0)
    return Motion(
        math.tau * teeth * turned,
        CubicSpline(angles, values)(angles[0] + turned),
        None,
        rows,
        float(teeth),
        limit,
        data[variable].attrs.get("units", "1"),
        {},
        {"parameters": _course_text(rows)},
        float(time[0]),
    )


def _samples(data, variable):
    """Return (time, values) of a signal, checked."""
    if variable not in data.variables or data[variable].shape != data["time"].shape:
        raise checks.refusal("variable", variable, "a variable of the dataset over time")
    time, values = (np.asarray(data[name].values, float) for name in ("time", variable))
    if not (time.ndim == 1 and time.size > 3 and np.isfinite(values).all()):
        raise ValueError(
            f"{variable} is not allowed: it must have four samples or more, all finite"
        )
    if not (np.isfinite(time).all() and (np.diff(time) > 0.0).all()):
        raise ValueError("time is not allowed: it must rise from sample to sample")
    return time, values


def _turns_by_speed(data, time):
    """Return (function of time that gives revolutions, rows of s and rpm)."""
    if "speed" not in data.variables or data["speed"].shape != time.shape:
        raise ValueError("tacho = None is not allowed for a dataset without speed")
    speed = np.asarray(data["speed"].values, float)
    if not (np.isfinite(speed).all() and (speed > 0.0).all()):
        raise ValueError("speed is not allowed: it must be > 0 at all samples")
    turned = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    return CubicSpline(time, turned), np.column_stack([time, speed])


def _turns_by_tacho(tacho):
    """Return the same as `_turns_by_speed`, by the times of pulses."""
    pulses = np.array(checks.finite("tacho", tacho))
    if pulses.size < 4 or not (np.diff(pulses) > 0.0).all():
        raise ValueError("tacho is not allowed: it must be four times or more that rise")
    turns = CubicSpline(pulses, np.arange(pulses.size))
    return turns, np.column_stack([pulses, 60.0 * turns(pulses, 1)])


def _jumps_of(run, variable, marks):
    """Return the rising phases at which a variable or its slope jumps; `marks` are some of them."""
    if variable in ("displacement", "velocity"):
        return np.empty(0)
    model = model_of(run.attrs.get("gear_pair") or run.attrs.get("model", ""))
    if model is not None:
        # Phases of run-ups count from the mesh phase 0.
        begin = 0.0 if "time" in run.dims else float(run.phase[0])
        end = float(run.phase[-1])
        switches, period = _switches(model)
        first, last = ((begin - math.tau) // period, (end + math.tau) // period)
        turns = period * np.arange(first, last + 1.0)
        marks = np.concatenate([marks, (turns[:, None] + switches).ravel() - begin])
    marks = np.sort(marks)
    return marks[np.diff(marks, prepend=-np.inf) > SAME_PHASE]


def _switches(model):
    """Return the phases at which forces of a model may jump, and after which they repeat."""
    if model.equation is None:
        starts = model.system(1.0).starts
        return starts[:-1], starts[-1]
    jumps = [[0.0]]
    for side in (model.equation.near, model.equation.far):
        before = side.lines[:, 0] + side.lines[:, 1] * np.diff(side.breaks)
        jump = np.abs(np.roll(before, 1) - side.lines[:, 0])
        jumps.append(side.breaks[:-1][jump > SAME_PHASE * np.abs(side.lines[:, 0]).max()])
    return np.unique(np.concatenate(jumps)), math.tau


def fourier(phase, values, jumps, span, blocks, step, count):
    """Return Fourier coefficients, their changes with half of the samples, and mean squares.

    Shapes (blocks, count, ...), twice, and (blocks, ...). Block k begins at phase k span, and
    coefficient n belongs to the wave number n step. Values or slopes jump at `jumps`, rising.
    """
    sums, squares = _block_sums(phase, values, jumps, span, blocks, step, count)
    coarse, _ = _block_sums(phase[::2], values[::2], jumps, span, blocks, step, count)
    return sums, np.abs(sums - coarse), squares


def _block_sums(phase, values, jumps, span, blocks, step, count):
    """Return coefficients and mean squares of `fourier`; without `jumps`, by trapezia."""
    table, inner = values.reshape(len(values), -1), values.shape[1:]
    sums = np.zeros((blocks, count, table.shape[1]), complex)
    squares = np.zeros((blocks, table.shape[1]))
    if jumps is not None:
        # The value at a jump is that of one of its sides, and nobody knows of which.
        ends, after = np.concatenate([[-np.inf], jumps, [np.inf]]), np.searchsorted(jumps, phase)
        smooth = np.minimum(phase - ends[after], ends[after + 1] - phase) > SAME_PHASE
        phase, table = phase[smooth], table[smooth]
    for k in range(blocks):
        first, last = np.searchsorted(phase, (k * span - SAME_PHASE, (k + 1) * span - SAME_PHASE))
        if jumps is None:
            # The next block begins where this one ends, or the signal is over.
            near = np.append(np.arange(first, last), min(last, len(phase) - 1))
            places = np.append(phase[first:last] - k * span, span)
            weights = np.gradient(places)
            weights[[0, -1]] *= 0.5
        else:
            near = np.arange(max(first - STENCIL, 0), min(last + STENCIL, len(phase)))
            places = phase[near] - k * span
            weights = _weights(places, jumps - k * span, span)
        part, weights = table[near], weights / span
        weighted, wave = weights[:, None] * part, np.exp(-1j * step * places)
        turned = np.ones(places.size, complex)
        for n in range(count):
            # BLAS would wake threads for small sums.
            sums[k, n] = np.einsum("i,im->m", turned, weighted)
            turned *= wave
        squares[k] = np.einsum("im,im->m", weighted, part)
    return sums.reshape(blocks, count, *inner), squares.reshape(blocks, *inner)


def _weights(phase, jumps, span):
    """Return weights of samples whose sum is the integral from 0 to span, shape (n,)."""
    jumps = jumps[(jumps > phase[0]) & (jumps < phase[-1])]
    marks = np.concatenate([[0.0, span], phase, jumps])
    bounds = np.unique(marks[(marks >= 0.0) & (marks <= span)])
    half, middle = 0.5 * np.diff(bounds), 0.5 * (bounds[1:] + bounds[:-1])
    # Samples and intervals are numbered by the jumps before them.
    of_sample, of_interval = np.searchsorted(jumps, phase), np.searchsorted(jumps, middle)
    low = np.searchsorted(of_sample, of_interval, side="left")
    high = np.searchsorted(of_sample, of_interval, side="right")
    # Between jumps without a sample the neighbours on both sides stand in.
    empty = (low == high).astype(int)
    low, high = np.maximum(low - empty, 0), np.minimum(high + empty, phase.size)
    size = np.minimum(high - low, STENCIL)
    first = np.clip(np.searchsorted(phase, middle) - size // 2, low, high - size)
    weights = np.zeros(phase.size)
    for n in np.unique(size).tolist():
        rows = np.flatnonzero(size == n)
        places = first[rows] + np.arange(n)[:, None]
        x, at = phase[places] - middle[rows], half[rows] * NODES[:, None]
        for i in range(n):
            lagrange = np.ones(at.shape)
            for j in range(n):
                if j != i:
                    lagrange *= (at - x[j]) / (x[i] - x[j])
            integrals = half[rows] * (WEIGHTS @ lagrange)
            weights += np.bincount(places[i], integrals, minlength=phase.size)
    return weights


def _samples_per_period(phase):
    """Return how many samples a mesh period has, most of the time."""
    return round(math.tau / float(np.median(np.diff(phase)))) if phase.size > 1 else 1


def _size(squares):
    """Return the root mean square with which changes of coefficients are compared."""
    return math.sqrt(squares.max())


def _check_change(sums, phase):
    """Refuse the sums of `fourier` if half of the samples gives others."""
    _, change, squares = sums
    if change.max() > MAX_CHANGE * _size(squares):
        raise ValueError(
            f"samples_per_period = {_samples_per_period(phase)} is not allowed for these orders: "
            f"with half of the samples one changes by {change.max() / _size(squares):.2g} of the "
            f"root mean square, and it must be at most {MAX_CHANGE:g}"
        )


def _number(order, revolutions, count):
    """Return the number of an order in a map."""
    number = round(order * revolutions)
    if abs(number - order * revolutions) > 1e-9 * max(order, 1.0) or number >= count:
        raise ValueError(
            f"orders = {order!r} is not allowed: it must be one of 0, "
            f"{1.0 / revolutions:.4g}, ..., {(count - 1) / revolutions:.4g}"
        )
    return number


def _dataset(motion, variable, amplitude, sums, number, revolutions, bounds):
    """Return the order map of the orders with these numbers; blocks have these bounds in time."""
    coefficients, error, squares = sums
    overall = np.sqrt(np.maximum(squares - np.abs(coefficients[:, 0]) ** 2, 0.0))
    coefficients, error = coefficients[:, number], error[:, number]
    size, unit, words = np.abs(coefficients), motion.units, variable.replace("_", " ")
    above = (number > 0).reshape(1, -1, *[1] * (size.ndim - 2))
    mean, shown_unit = size, unit
    if amplitude == "power":
        mean, shown_unit = size**2, f"({unit})2" if " " in unit else f"{unit}2"
    levels = np.where(above, _AMPLITUDES[amplitude](size), mean)
    errors = np.where(above, 2.0, 1.0) * error
    times, rpm = 0.5 * (bounds[1:] + bounds[:-1]), 60.0 * revolutions / np.diff(bounds)
    over, inner = ("time", "order", *motion.coords), ("time", *motion.coords)
    shaft, level = "of a cosine of the order times the shaft angle", f"the {words} without its mean"
    table = {
        "amplitude": (over, levels, shown_unit, f"{amplitude} of the orders of the {words}"),
        "phase": (over, np.angle(coefficients), "rad", shaft),
        "amplitude_error": (over, errors, unit, "estimated error, of a peak"),
        "rpm": ("time", rpm, "min-1", "mean speed in the block"),
        "overall": (inner, overall, unit, f"root mean square of {level}"),
        "order_resolution": ((), 1.0 / revolutions, "1", "order spacing"),
        "teeth": ((), motion.teeth, "1", "mesh periods in a revolution"),
        "time": ("time", times, "s", "middle of the block"),
        "order": ("order", number / revolutions, "1", "order, waves per revolution"),
    }
    data = {
        name: (dims, values, {"units": units, "long_name": long_name})
        for name, (dims, values, units, long_name) in table.items()
    }
    coords = {name: data.pop(name) for name in ("time", "order")} | motion.coords
    title, by = f"Order map of the {words}", "Fourier sums over the shaft angle"
    names = {"variable": variable, "amplitude": amplitude}
    return result_of_many(title, data, coords, by, **names, **motion.attrs)


def orders(run, *, count=None):
    """Return the order spectrum of the mesh force and of the transmission error of a run.

    Parameters
    ----------
    run : xarray.Dataset
        Of `gearlib.simulate`; its record has to hold whole revolutions, or whole orbits.
    count : int, optional
        Highest mesh order; by default 10, at most a quarter of the samples per period.

    Returns
    -------
    xarray.Dataset
        Over ``order`` (per revolution of the gear whose teeth count, from 0): mesh_order (order
        over teeth), force_amplitude (N, peak; the mean at order 0), force_phase,
        error_amplitude (m) and error_phase (rad; of a cosine of the mesh phase times the mesh
        order), force_amplitude_error and error_amplitude_error, estimates and no bounds: the
        difference that every second sample makes; mean squares. Of a train over ``mesh`` too.

    Raises
    ------
    ValueError
        If the run could not go on, has no whole revolutions, or a coefficient changes by more than
        5 % of the root mean square when every second sample is left out.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        raise checks.refusal(
            "run", _shown(run), "a dataset of gearlib.simulate, of gears that turn"
        )
    number, parts, sums = record_sums(run, count)
    mesh_orders, teeth = number / parts, _teeth_of(run)
    dims = ("order", *run.displacement.dims[1:])
    shape = -1, *[1] * (len(dims) - 1)
    # A period that begins later turns the phases only: they count from the mesh phase 0.
    turn = np.exp(-1j * mesh_orders * float(run.phase[0])).reshape(shape)
    peak = np.where(mesh_orders > 0.0, 2.0, 1.0).reshape(shape)
    data: dict = {"mesh_order": ("order", mesh_orders)}
    for name, (values, *block) in sums.items():
        _check_change(block, run.phase.values)
        coefficients, change, _ = (array[0] for array in block)
        data[f"{name}_amplitude"] = dims, peak * np.abs(coefficients)
        data[f"{name}_phase"] = dims, np.angle(coefficients * turn)
        data[f"{name}_amplitude_error"] = dims, peak * change
        data[f"mean_square_{name}"] = dims[1:], (values**2).mean(axis=0)
    data |= {name: run[name].values for name in ("tuning", "speed", "mesh_frequency", "period")}
    coords = {"order": number * teeth / parts}
    coords |= {name: run[name].values for name in dims[1:]}
    dataset = result_of_many("Order spectrum of a gear mesh", data, coords, "Fourier sums")
    dataset["order"].attrs["long_name"] = (
        "order, waves per revolution of the gear whose teeth count"
    )
    dataset.attrs |= _kept(run, "references", "gear_pair", "parameters")
    return dataset


def _teeth_of(run):
    """Return the mesh periods in a revolution of a run of `simulate`."""
    return round(float(run.mesh_frequency) * 60.0 / (math.tau * float(run.speed)))


def record_sums(run, count=None, fractions=True):
    """Return the numbers of the orders of a run of `simulate`, orders per mesh order, and sums.

    Sums has for "force" (N) and "error" (m) the values and what `fourier` returns of one block, the
    record; without `fractions` only of the multiples of the mesh frequency. `count` is the highest
    mesh order, at most a quarter of the samples per period.
    """
    _check_status(run)
    periods, teeth = json.loads(run.attrs["parameters"])["record_periods"], _teeth_of(run)
    orbit = int(run.period)
    repeats = orbit and periods % orbit == 0
    if periods % teeth and not repeats:
        raise ValueError(
            f"record_periods = {periods} is not allowed: it must be a multiple of {teeth}, whole "
            "revolutions of the gear whose teeth count"
            + (f", or of the {orbit} periods of the orbit" if orbit else "")
        )
    most = max(run.phase.size // periods // 4, 1)
    count = checks.integer("count", min(10, most) if count is None else count, 1, most)
    parts, span = periods if fractions else 1, math.tau * periods
    phase = run.phase.values - run.phase.values[0]
    if repeats:
        # An orbit goes on behind the record, and before it, as in it.
        margin = 2 * STENCIL
        phase = np.concatenate([phase[-margin:] - span, phase, phase[:margin] + span])
    sums = {}
    for name, values, variable in (
        ("force", run.dynamic_force.values * float(run.force_scale), "dynamic_force"),
        ("error", transmission_error(run) * float(run.static_deflection), "displacement"),
    ):
        record, jumps = values, _jumps_of(run, variable, _marks(run))
        if repeats:
            record = np.concatenate([values[-margin:], values, values[:margin]])
        block = fourier(phase, record, jumps, span, 1, 1.0 / parts, count * parts + 1)
        sums[name] = values, *block
    return np.arange(count * parts + 1), parts, sums


def mesh_order_amplitudes(run):
    """Return mesh orders from 1 on, and peaks of force (N) and error (m), nan if unreliable."""
    mesh_orders, _, sums = record_sums(run, fractions=False)
    peaks = [
        np.where(change[0] > MAX_CHANGE * _size(squares), math.nan, 2.0 * np.abs(coefficients[0]))
        for _, coefficients, change, squares in sums.values()
    ]
    return mesh_orders[1:] + 0.0, *(peak[1:] for peak in peaks)


def transmission_error(run):
    """Return the transmission error at the samples, static deflections.

    Displacements of models with deviations of the flanks are those of the flanks.
    """
    x = run.displacement.values
    model = json.loads(run.attrs.get("gear_pair") or run.attrs["model"])
    given = model.get("deviation") if "profile" in model else None
    if not given:
        return x
    phase, scale = run.phase.values, 1.0 / run.static_deflection.item()
    waves = Harmonics(given["cosines"], given["sines"]).table(scale)
    return x - sum(c * np.cos(k * phase) + s * np.sin(k * phase) for k, c, s in waves)

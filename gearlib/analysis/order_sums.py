"""Fourier integrals over the mesh phase, as sums over the samples of a recorded run or a signal.

Between switches of the stiffness and contact events a motion is smooth. Each sample weighs as much
as cubic polynomials through neighbouring samples give it; no polynomial reaches across a jump.

Signals over time are interpolated at equal angles of the shaft by cubic splines. The angle is the
integral of the speed, or that of a tacho of one pulse a revolution. Blocks of `order_map` are whole
revolutions, so that orders on its grid do not leak into each other; of what lies between two of
them a block sees up to 3.9 dB too little.
"""

import json
import math

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from gearlib import checks
from gearlib.data.provenance import canonical_json
from gearlib.models.from_values import model_of

#: Phases closer than this count as equal.
SAME_PHASE = 1e-9
#: Samples through which a polynomial goes, and a rule of Gauss that integrates it exactly.
STENCIL = 4
NODES, WEIGHTS = np.polynomial.legendre.leggauss(2)
#: What order maps take of a run -> (powers of length, of the mesh frequency; CF units).
_LENGTHS = {
    "displacement": (0, "m"),
    "velocity": (1, "m s-1"),
    "acceleration": (2, "m s-2"),
}
#: Samples that the shortest wave must have. A cubic spline lowers it by the factor
#: 3 sinc(f)^4 / (2 + cos(2 pi f)), f = 1 / samples: with four by 1.5 %, with ten by 0.02 %.
_PER_WAVE = 4.0
#: Most samples in a revolution.
_MOST = 2**16


def jump_phases(run, teeth):
    """Return the phases at which variables of a run-up or their slopes jump, rising.

    A revolution has `teeth` mesh periods.
    """
    asked = json.loads(run.attrs["parameters"])
    times = [row[0] for row in (*asked["speed"], *asked["load"])]
    times = np.array([*times, *(run.event_time.values if "event_time" in run else ())])
    phases = [math.tau * teeth * Turning(asked["speed"]).revolutions(times)]
    model = model_of(run.attrs.get("gear_pair") or run.attrs.get("model", ""))
    if model is not None:
        begin, (switches, period) = float(run.attrs.get("first_phase", 0.0)), _switches(model)
        first, last = (
            math.floor((begin + end) / period)
            for end in (-math.tau, float(run.phase[-1]) + math.tau)
        )
        turns = period * np.arange(first, last + 1)
        phases.append((turns[:, None] + switches).ravel() - begin)
    jumps = np.sort(np.concatenate(phases))
    return jumps[np.diff(jumps, prepend=-np.inf) > SAME_PHASE]


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


def summed(phase, values, blocks, span, step, count, jumps=None):
    """Return Fourier coefficients (blocks, orders, ...) and mean squares (blocks, ...) of samples.

    Blocks of length `span` begin at phase 0; orders are 0 ... count - 1 times the wave number
    `step`. At `jumps`, rising, values or their slopes jump; by default samples have the weights of
    trapezia.
    """
    table = values.reshape(len(values), -1)
    coefficients = np.zeros((blocks, count, table.shape[1]), complex)
    squares = np.zeros((blocks, table.shape[1]))
    if jumps is not None:
        # The value at a jump is that of one of its sides, and nobody knows of which.
        ends, after = np.concatenate([[-np.inf], jumps, [np.inf]]), np.searchsorted(jumps, phase)
        smooth = np.minimum(phase - ends[after], ends[after + 1] - phase) > SAME_PHASE
        phase, table = phase[smooth], table[smooth]
    for k in range(blocks):
        first, last = np.searchsorted(phase, (k * span - SAME_PHASE, (k + 1) * span - SAME_PHASE))
        if jumps is None:
            places, part = phase[first:last] - k * span, table[first:last]
            # The next block begins where this one ends, or the run is over.
            part = np.concatenate([part, table[min(last, len(table) - 1)][None]])
            places = np.append(places, span)
            weights = np.gradient(places, edge_order=1)
            weights[[0, -1]] *= 0.5
        else:
            near = slice(max(first - STENCIL, 0), last + STENCIL)
            places, part = phase[near] - k * span, table[near]
            between = np.searchsorted(jumps, places[[0, -1]] + k * span)
            weights = smooth_weights(places, jumps[slice(*between)] - k * span, span)
        weights = weights / span
        coefficients[k] = _waves(places, weights[:, None] * part, step, count)
        squares[k] = np.einsum("i,im->m", weights, part**2)
    inner = values.shape[1:]
    return coefficients.reshape(blocks, count, *inner), squares.reshape(blocks, *inner)


def smooth_weights(phase, jumps, span):
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


def _waves(phase, values, step, count):
    """Return sums of values times exp(-i n step phase) for each n < count, shape (count, m)."""
    wave, turned = np.exp(-1j * step * phase), np.ones(phase.size, complex)
    sums = np.empty((count, values.shape[1]), complex)
    for n in range(count):
        # BLAS would wake threads for small sums.
        sums[n] = np.einsum("i,im->m", turned, values)
        turned *= wave
    return sums


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


def as_run_up(run):
    """Return a dataset with what order maps take of a run-up, of a run of `gearlib.simulate`.

    Anything else comes back as it is: who takes it tells what it lacks.
    """
    needed = {"mesh_frequency", "static_deflection", "force_scale", "contact", *_LENGTHS}
    if not needed <= set(getattr(run, "variables", ())) or run.displacement.dims[0] != "phase":
        return run
    omega, length, rpm = (
        float(run[name]) for name in ("mesh_frequency", "static_deflection", "speed")
    )
    phase = run.phase.values - float(run.phase[0])
    over = ("time", *run.displacement.dims[1:])
    data: dict = {
        name: (over, run[name].values * (length * omega**power), {"units": units})
        for name, (power, units) in _LENGTHS.items()
    }
    data["dynamic_force"] = over, run.dynamic_force.values * float(run.force_scale), {"units": "N"}
    data |= {"contact": (over, run.contact.values), "phase": ("time", phase)}
    data["speed"] = "time", 0.0 * phase + rpm
    data |= {name: ("event", run[name].values) for name in ("event_from", "event_to")}
    data["event_time"] = "event", (run.event_phase.values - float(run.phase[0])) / omega
    data["event_velocity"] = "event", run.event_velocity.values * (length * omega)
    data["status"] = run.status
    coords = {"time": phase / omega} | {name: run[name].variable for name in over[1:]}
    dataset = xr.Dataset(data, coords)
    kept = ("references", "model", "gear_pair")
    dataset.attrs = {name: run.attrs[name] for name in kept if name in run.attrs}
    end = math.tau * json.loads(run.attrs["parameters"])["record_periods"] / omega
    course = {"speed": [[0.0, rpm], [end, rpm]], "load": [[0.0, 1.0]]}
    dataset.attrs |= {"title": run.attrs["title"], "parameters": canonical_json(course)}
    dataset.attrs["first_phase"] = float(run.phase[0])
    return dataset


def is_sampled(run):
    """Return whether a dataset has no angle of its own, but samples over time."""
    names = getattr(run, "variables", ())
    return "time" in names and "phase" not in names


def at_equal_angles(data, variable, highest, *, tacho=None, teeth=1):
    """Return (signal as `gearlib.order_map` takes a run-up, its highest order, its first time).

    The speed is that of the dataset, or of a `tacho`, times of pulses (s), one a revolution. What
    cannot be is refused.
    """
    if variable not in data.variables or data[variable].shape != data["time"].shape:
        raise checks.refusal("variable", variable, "a variable of the dataset over time")
    time, values = (np.asarray(data[name].values, float) for name in ("time", variable))
    if not (time.ndim == 1 and time.size > 3 and np.isfinite(values).all()):
        raise ValueError(
            f"{variable} is not allowed: it must have four samples or more, all finite"
        )
    if not (np.isfinite(time).all() and (np.diff(time) > 0.0).all()):
        raise ValueError("time is not allowed: it must rise from sample to sample")
    if tacho is None:
        turns, course = _of_speed(data, time)
    else:
        turns, course = _of_tacho(tacho)
    inside = (time >= course[0, 0]) & (time <= course[-1, 0])
    if inside.sum() < 4:
        raise ValueError("tacho is not allowed: it must have four samples or more between pulses")
    time, values = time[inside], values[inside]
    angles = turns(time)
    steps = np.diff(angles)
    if not (steps > 0.0).all():
        raise ValueError("speed is not allowed: it must be > 0 at all samples")
    limit = 1.0 / (_PER_WAVE * float(steps.max()))
    if highest is not None and highest > limit:
        raise ValueError(
            f"highest = {highest!r} is not allowed: it must be at most {limit:.4g}, orders with "
            f"{_PER_WAVE:g} samples a wave at the highest speed"
        )
    count = min(2 * math.ceil(0.5 / float(steps.min())), _MOST)
    first = angles[0]
    at = first + np.arange(int((angles[-1] - first) * count) + 1) / count
    when = CubicSpline(angles, time)(at)
    dataset = xr.Dataset(
        {
            "time": ("time", when),
            "speed": ("time", 60.0 / CubicSpline(angles, time)(at, 1)),
            "phase": ("time", math.tau * teeth * (at - first)),
            variable: ("time", CubicSpline(angles, values)(at), dict(data[variable].attrs)),
            "status": ((), 0),
            "teeth": ((), float(teeth)),
        }
    )
    dataset[variable].attrs.setdefault("units", "1")
    rows = course[course[:, 0] > time[0]]
    rows = np.vstack([[time[0], float(np.interp(time[0], *course.T))], rows])
    rows[:, 0] -= time[0]
    # Straight lines between these turn by nearly as much: that many blocks there are.
    turned = np.trapezoid(rows[:, 1], rows[:, 0]) / 60.0
    whole = turns(course[-1, 0]) - first
    rows[:, 1] *= float(whole) / turned
    said = {"speed": rows.tolist(), "load": [[0.0, 1.0]]}
    dataset.attrs["parameters"] = canonical_json(said)
    return dataset, limit, float(time[0])


def _of_speed(data, time):
    """Return (function of time that gives revolutions, rows of s and rpm)."""
    if "speed" not in data.variables or data["speed"].shape != time.shape:
        raise ValueError("tacho = None is not allowed for a dataset without speed")
    speed = np.asarray(data["speed"].values, float)
    if not (np.isfinite(speed).all() and (speed > 0.0).all()):
        raise ValueError("speed is not allowed: it must be > 0 at all samples")
    turned = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    return CubicSpline(time, turned), np.column_stack([time, speed])


def _of_tacho(tacho):
    pulses = np.array(checks.finite("tacho", tacho))
    if pulses.size < 4 or not (np.diff(pulses) > 0.0).all():
        raise ValueError("tacho is not allowed: it must be four times or more that rise")
    turns = CubicSpline(pulses, np.arange(pulses.size))
    return turns, np.column_stack([pulses, 60.0 * turns(pulses, 1)])

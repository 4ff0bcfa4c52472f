"""Signals of a rig over the angle of the shaft: gaps, standstill, both directions, tacho pulses.

Blocks of whole revolutions lie on one grid of shaft angles. A block that a gap, a standstill or a
change of direction touches is left out, so that the others are those of the complete signal.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter

from gearlib import checks

#: Revolutions closer than this count as equal.
_REVOLUTION_TOLERANCE = 1e-9
#: Smallest number of samples per wave of a signal. A cubic spline reduces the amplitude by a factor
#: 3 sinc(f)^4 / (2 + cos(2 pi f)), f = 1 / samples: by 1.5 % with four, by 0.02 % with ten samples.
_MIN_SAMPLES_PER_WAVE = 4.0
#: Largest number of samples in a revolution; where the shaft is slower, samples are averaged.
_MAX_SAMPLES_PER_REVOLUTION = 2**16
#: Number of neighbouring steps whose median is the usual one, and the share of all steps that are
#: at most this median times a factor; the factor is 1 without jitter.
_NEIGHBOURS, _USUAL_SHARE = 31, 0.98
#: Steps that do not count for the highest order, and those that are gaps, over the usual step.
_IRREGULAR_STEP, _GAP = 1.5, 3.0
#: Largest deviation of an interval between tacho pulses from that of its neighbours, in pulses.
_PULSE_TOLERANCE = 0.4
#: Number of neighbours on each side with which an interval is compared.
_PULSE_NEIGHBOURS = 3
#: The same of the first and the last interval, which have neighbours on one side, and after repairs
#: close to them.
_END_TOLERANCE, _END_REPAIR_TOLERANCE = 0.2, 0.1
#: A repair is the only one if the squares of deviations after any other are larger by this factor.
#: Of pulses closer than this share of an interval the later one is the double one, a bounce.
_DECISIVE, _BOUNCE = 4.0, 0.01
#: Most pulses that are left out at either end; a revolution of them if that is more.
_MAX_LEFT_OUT = 8
#: Largest number of places that a comment lists.
_MAX_LISTED = 10


@dataclass
class RigSignal:
    """Samples of a signal over the shaft angle, in stretches of one direction without gaps."""

    time: np.ndarray  #: s, shape (k,)
    revolutions: np.ndarray  #: shaft angle, which falls where the speed is negative, shape (k,)
    values: np.ndarray  #: shape (k,)
    stretches: list  #: (first sample, last sample, direction 1 or -1) of each stretch
    breaks: list  #: (start in s, end in s, reason) of what lies between stretches
    known_time: np.ndarray  #: times with a known shaft angle, s
    path: np.ndarray  #: revolutions in either direction at these times
    max_order: float  #: highest order with four samples a wave at the highest speed
    units: str
    teeth: float  #: mesh periods per revolution
    attrs: dict  #: attributes of the order map, with the times of pulses missing or double
    notes: list  #: sentences on what the tacho lacked
    coords: dict = field(default_factory=dict)  #: dimensions of the values other than the sample

    @property
    def travel(self) -> float:
        """Number of revolutions in either direction."""
        return float(self.path[-1])

    def blocks(self, length: int, highest: float) -> Iterator[tuple]:
        """Yield (samples at equal angles, start in s, end in s, direction) of whole blocks.

        A block has `length` revolutions, and its samples go up to and include its end.
        """
        for first, last, direction in self.stretches:
            part = slice(first, last + 1)
            time, turns, values = self.time[part], self.revolutions[part], self.values[part]
            if direction < 0:
                time, turns, values = time[::-1], turns[::-1], values[::-1]
            start = math.ceil(turns[0] / length - _REVOLUTION_TOLERANCE)
            stop = math.floor(turns[-1] / length + _REVOLUTION_TOLERANCE)
            if stop <= start:
                continue
            cells = np.floor(turns * _MAX_SAMPLES_PER_REVOLUTION)
            starts = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1.0))
            counts = np.diff(starts, append=cells.size)
            angles = np.add.reduceat(turns, starts) / counts
            spline = CubicSpline(angles, np.add.reduceat(values, starts) / counts)
            for k in range(start, stop):
                edges = length * np.array([k, k + 1.0])
                i, j = np.searchsorted(angles, edges)
                shortest = np.diff(angles[max(i - 1, 0) : j + 1]).min()
                half = min(math.ceil(0.5 / shortest), _MAX_SAMPLES_PER_REVOLUTION // 2)
                size = 2 * max(half, 2 * math.ceil(highest)) * length
                samples = spline(length * (k + np.arange(size + 1.0) / size))
                begin, end = sorted(np.interp(edges, turns, time))
                yield samples, begin, end, direction

    def left_out(self, begins: np.ndarray, ends: np.ndarray, length: int) -> dict:
        """Return attributes on the times that no block covers; blocks are sorted by time.

        A rest of less than a block at the start and the end of a signal is not mentioned.
        """
        first, last = self.known_time[[0, -1]]
        limits = np.column_stack([[first, *ends], [*begins, last]])
        lengths = np.diff(np.interp(limits, self.known_time, self.path))[:, 0]
        # Signals begin and end within a block.
        is_part = lengths < length - _REVOLUTION_TOLERANCE
        is_part[1:-1] = False
        limits = limits[~is_part]
        smallest = 1e-6 * float((ends - begins).min())
        intervals = limits[limits[:, 1] - limits[:, 0] > smallest].tolist()
        attrs, notes, places = {}, list(self.notes), []
        for start, end in intervals:
            reasons = dict.fromkeys(why for a, b, why in self.breaks if a <= end and b >= start)
            places.append(f"{start:.6g} to {end:.6g} s ({', '.join(reasons)})")
        if places:
            attrs["left_out"] = intervals
            notes.append(f"Revolutions are left out: {_listed(places)}.")
        return attrs | ({"comment": " ".join(notes)} if notes else {})


def _listed(places: list) -> str:
    """Return the first places of a list, and the number of the others, as a text."""
    others = len(places) - _MAX_LISTED
    return "; ".join(places[:_MAX_LISTED]) + (f"; and {others} more" if others > 0 else "")


def rig_signal(
    data: xr.Dataset,
    variable: str,
    highest: float | None,
    tacho: ArrayLike | None,
    per_turn: int,
    teeth: int,
) -> RigSignal:
    """Return the samples of a variable over the shaft angle.

    The angle is the integral of the variable "speed" (rpm), or follows from the times (s) of tacho
    pulses, `per_turn` in a revolution. It counts from the first sample, or the first pulse.
    """
    time, values = _samples(data, variable)
    attrs, notes = {}, []
    if tacho is None:
        checks.require(per_turn == 1, "pulses_per_revolution", per_turn, "1 without tacho")
        if "speed" not in data.variables or data["speed"].shape != data["time"].shape:
            raise ValueError("tacho = None is not allowed for a dataset without speed")
        speed = np.asarray(data["speed"].values, float)
        _require_no_infinity("speed", speed)
        known = np.isfinite(time) & np.isfinite(speed)
        time, values, speed = time[known], values[known], speed[known]
        turns = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    else:
        pulses, counts, attrs, notes = _counted_pulses(_pulse_times(tacho), per_turn)
        time, values = time[np.isfinite(time)], values[np.isfinite(time)]
        # A sample on either side surrounds the first and the last pulse.
        first, last = np.searchsorted(time, pulses[[0, -1]])
        first, last = max(first - 1, 0), last + 1
        time, values = time[first:last], values[first:last]
        if time.size < 4:
            raise ValueError(
                f"tacho = {pulses[0]:.6g} to {pulses[-1]:.6g} s is not allowed: it must have at "
                "least four samples between pulses"
            )
        turns = CubicSpline(pulses, counts / per_turn)(time)
        speed = np.ones(time.size)
    present = np.isfinite(values)
    if present.sum() < 4:
        text = "is not allowed: it must have at least four samples with time and speed"
        raise ValueError(f"{variable} {text}")
    known_time, path = time, np.append(0.0, np.cumsum(np.abs(np.diff(turns))))
    time, turns, values, speed = (x[present] for x in (time, turns, values, speed))
    signs = np.sign(np.diff(turns)) * (speed[1:] * speed[:-1] >= 0.0)
    angles = np.abs(np.diff(turns))
    ratios = _steps_over_usual(np.diff(time), angles)
    regular = angles[ratios <= _IRREGULAR_STEP]
    if not regular.max(initial=0.0) > 0.0:
        raise ValueError("speed = 0 is not allowed at all samples: the shaft must turn")
    max_order = 1.0 / (_MIN_SAMPLES_PER_WAVE * float(regular.max()))
    allowed = f"at most {max_order:.4g}, orders with {_MIN_SAMPLES_PER_WAVE:g} samples a wave at "
    allowed += "the highest speed"
    checks.require(highest is None or highest <= max_order, "highest", highest, allowed)
    wave = 1.0 / (max_order if highest is None else highest)
    longest = (1.0 + _REVOLUTION_TOLERANCE) * wave / _MIN_SAMPLES_PER_WAVE
    is_gap = (ratios > _GAP) | (angles > longest)
    stretches, breaks = _stretches(time, np.where(is_gap, 0.0, signs), is_gap)
    ends = (known_time[0], time[0]), (time[-1], known_time[-1])
    breaks += [(a, b, "gap") for a, b in ends if b > a]
    units = data[variable].attrs.get("units", "1")
    attrs["parameters"] = {"pulses_per_revolution": per_turn, "teeth": teeth}
    motion = time, turns, values, stretches, breaks, known_time, path
    return RigSignal(*motion, max_order, units, float(teeth), attrs, notes)


def _samples(data: xr.Dataset, variable: str) -> tuple:
    """Return (time, values) of a signal, NaN where missing; raise ValueError if they are wrong."""
    if variable not in data.variables or data[variable].shape != data["time"].shape:
        raise checks.refusal("variable", variable, "a variable of the dataset over time")
    time = np.asarray(data["time"].values, float)
    values = np.asarray(data[variable].values, float)
    if time.ndim != 1 or time.size < 4:
        raise ValueError(f"{variable} is not allowed: it must have at least four samples over time")
    _require_no_infinity(variable, values)
    _require_no_infinity("time", time)
    known = np.flatnonzero(np.isfinite(time))
    wrong = known[1:][np.diff(time[known]) <= 0.0]
    if wrong.size:
        i = int(wrong[0])
        raise checks.refusal(f"time[{i}]", float(time[i]), "later than the sample before")
    return time, values


def _require_no_infinity(name: str, values: np.ndarray) -> None:
    """Raise ValueError if a value is infinite; a sample that is missing is NaN."""
    for i in np.flatnonzero(np.isinf(values))[:1].tolist():
        raise checks.refusal(f"{name}[{i}]", float(values[i]), "finite, or NaN where it is missing")


def _steps_over_usual(steps: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the steps between samples over the usual ones, in time or angle, the smaller ratio.

    Steps are equal in time on most rigs, and in angle with a trigger on the shaft.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        in_time, in_angle = (x / median_filter(x, _NEIGHBOURS) for x in (steps, angles))
    ratios = np.fmin(in_time, in_angle)  # NaN in angle at standstill
    return ratios / max(1.0, float(np.quantile(ratios, _USUAL_SHARE)))


def _stretches(time: np.ndarray, directions: np.ndarray, is_gap: np.ndarray) -> tuple:
    """Return (stretches, breaks) of a `RigSignal` from the directions of all steps, 0 for none."""
    turning = "the speed is 0 or changes sign"
    stretches: list = []
    breaks: list = []
    for run in np.split(np.arange(directions.size), np.flatnonzero(np.diff(directions)) + 1):
        first, last, direction = int(run[0]), int(run[-1]) + 1, int(directions[run[0]])
        if direction:
            if stretches and stretches[-1][1] == first:
                breaks.append((time[first], time[first], turning))
            stretches.append((first, last, direction))
            continue
        gaps, others = run[is_gap[run]], run[~is_gap[run]]
        breaks.extend((time[i], time[i + 1], "gap") for i in gaps)
        if others.size:
            breaks.append((time[others[0]], time[others[-1] + 1], turning))
    return stretches, breaks


def _pulse_times(tacho: ArrayLike) -> np.ndarray:
    """Return the times of tacho pulses as an array; raise ValueError if they do not increase."""
    pulses = np.array(tacho)
    checks.require(pulses.size > 3, "tacho", pulses.tolist(), "at least four increasing times, s")
    for i in (np.flatnonzero(np.diff(pulses) <= 0.0)[:1] + 1).tolist():
        raise checks.refusal(f"tacho[{i}]", float(pulses[i]), "later than the pulse before, s")
    return pulses


def _counted_pulses(pulses: np.ndarray, per_turn: int) -> tuple:
    """Return (times, counts, attributes, sentences) of tacho pulses without their irregular ones.

    The count goes on by two where a single pulse is missing, and a double pulse is removed. Pulses
    at the ends that have no rhythm, such as those around standstill, are left out. Other irregular
    pulses raise ValueError.
    """
    first, last = 0, pulses.size
    while True:
        times = pulses[first:last]
        faults = _irregular(times, np.arange(times.size))
        missing, double = [], []
        for a, b in faults:
            repair = _repair(times, a, b)
            if repair is None:
                break
            (missing if repair[0] else double).append(repair[1])
        else:
            break
        # The pulses on both sides of such an interval may be wrong.
        cut = (first + b + 2, last) if a == 0 else (first, first + a)
        is_at_end = a == 0 or b == times.size - 2
        is_short = max(cut[0], pulses.size - cut[1]) <= max(_MAX_LEFT_OUT, per_turn)
        if not (is_at_end and is_short and cut[1] - cut[0] > 3):
            raise _irregular_pulse(times, np.arange(times.size), first, a, b)
        first, last = cut
    counts = np.arange(times.size)
    for i in missing:
        counts[i + 1 :] += 1
    for j in double:
        counts[j:] -= 1
    kept = np.delete(np.arange(times.size), double)
    attrs, notes = {}, []
    for number, place in (
        (first, f"before {times[0]:.6g}"),
        (pulses.size - last, f"after {times[-1]:.6g}"),
    ):
        if number:
            notes.append(f"Tacho pulses are left out {place} s: they are irregular.")
    if missing:
        attrs["missing_pulses"] = times[[[i, i + 1] for i in missing]].tolist()
        places = [f"{start:.6g} to {end:.6g} s" for start, end in attrs["missing_pulses"]]
        notes.append(f"A tacho pulse is missing and counted: {_listed(places)}.")
    if double:
        attrs["double_pulses"] = times[double].tolist()
        places = [f"{time:.6g} s" for time in attrs["double_pulses"]]
        notes.append(f"A double tacho pulse is left out: {_listed(places)}.")
    times, counts = times[kept], counts[kept]
    checks.require(times.size >= 4, "tacho", pulses.tolist(), "at least four regular pulses")
    for a, b in _irregular(times, counts):
        raise _irregular_pulse(times, counts, first, a, b)
    return times, counts, attrs, notes


def _deviations(times: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return how many pulses more the speed of its neighbours gives each interval between pulses.

    Through the speeds in a neighbour on each side goes a line over time, exact if the acceleration
    is constant; the median of such lines is not moved by one wrong neighbour.
    """
    middles, steps = 0.5 * (times[1:] + times[:-1]), np.diff(times)
    rates = np.diff(counts) / steps
    size = rates.size
    speeds = np.full((_PULSE_NEIGHBOURS, size), np.nan)

    def line(i, j, k):
        """Return the speed in the middle of interval i on a line through intervals j and k."""
        slope = (rates[k] - rates[j]) / (middles[k] - middles[j])
        return rates[j] + slope * (middles[i] - middles[j])

    for k in range(1, min(_PULSE_NEIGHBOURS, (size - 1) // 2) + 1):
        i = np.arange(k, size - k)
        speeds[k - 1, i] = line(i, i - k, i + k)
    speeds[0, 0], speeds[0, -1] = line(0, 1, 2), line(-1, -2, -3)
    return np.nanmedian(speeds, axis=0) * steps - np.diff(counts)


def _irregular(times: np.ndarray, counts: np.ndarray) -> list:
    """Return the (first, last) interval of each group of irregular intervals between pulses."""
    limits = np.full(times.size - 1, _PULSE_TOLERANCE)
    limits[[0, -1]] = _END_TOLERANCE
    found = np.flatnonzero(np.abs(_deviations(times, counts)) > limits)
    groups = np.split(found, np.flatnonzero(np.diff(found) > 2) + 1)
    return [(int(group[0]), int(group[-1])) for group in groups if group.size]


def _irregular_pulse(times, counts, offset: int, first: int, last: int) -> ValueError:
    """Return the error for the worst of the intervals from `first` to `last` between pulses."""
    deviations = _deviations(times, counts)
    i = first + int(np.abs(deviations[first : last + 1]).argmax())
    return ValueError(
        f"tacho = {times[i + 1]:.6g} s (pulse {offset + i + 1}) is not allowed: after the pulse "
        f"before, its neighbours have time for {deviations[i] + counts[i + 1] - counts[i]:.2g} "
        "pulses, and it must be 1, or a single missing or double pulse among regular ones"
    )


def _repair(times: np.ndarray, first: int, last: int) -> tuple | None:
    """Return the only repair of the irregular intervals from `first` to `last` between pulses.

    It is (True, interval) where a pulse is missing, (False, pulse) for a double pulse, and None if
    none, or more than one, makes all intervals regular.
    """
    size = times.size
    if last - first > 2 * _PULSE_NEIGHBOURS:
        return None
    low = max(first - 1 - _PULSE_NEIGHBOURS, 0)
    window = times[low : last + 3 + _PULSE_NEIGHBOURS]
    begin, end = times[max(first - 1, 0)], times[min(last + 2, size - 1)]
    is_at_end = first == 0 or last == size - 2
    tolerance = _END_REPAIR_TOLERANCE if is_at_end else _PULSE_TOLERANCE
    accepted = []
    candidates = [(True, i) for i in range(max(first, 1), min(last + 1, size - 2))]
    candidates += [(False, j) for j in range(max(first, 1), min(last + 2, size - 1))]
    for is_missing, at in candidates:
        counts, kept = np.arange(window.size), window
        if is_missing:
            counts = counts + (counts > at - low)
        else:
            counts, kept = counts[:-1], np.delete(window, at - low)
        if kept.size < 4:
            continue
        near = (kept[:-1] >= begin) & (kept[1:] <= end)
        deviations = np.abs(_deviations(kept, counts)[near])
        if deviations.max() <= tolerance:
            accepted.append(((deviations**2).sum(), is_missing, at))
    accepted.sort()
    if len(accepted) > 1 and accepted[1][0] < _DECISIVE * accepted[0][0]:
        (_, *one), (_, *other) = accepted[:2]
        distance = abs(times[one[1]] - times[other[1]])
        if one[0] or other[0] or distance > _BOUNCE * np.median(np.diff(window)):
            return None
        return False, max(one[1], other[1])
    return accepted[0][1:] if accepted else None

"""Measured signals over the shaft angle: gaps, standstill, both directions, tacho pulses.

Blocks of whole revolutions lie on one grid of shaft angles. Blocks with a gap, a standstill or a
change of direction are left out, so that the other blocks are the same as in a complete signal.
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
#: The usual step is the median of this number of neighbouring steps, times a factor >= 1 so that
#: this share of all steps does not exceed it. The factor is 1 without jitter.
_NEIGHBOURS, _USUAL_SHARE = 31, 0.98
#: Ratios of a step to the usual step above which it does not count for the highest order, and above
#: which it is a gap.
_IRREGULAR_STEP, _GAP = 1.5, 3.0
#: Largest deviation of an interval between tacho pulses from its neighbours, in pulses.
_PULSE_TOLERANCE = 0.4
#: Number of neighbours on each side with which an interval is compared.
_PULSE_NEIGHBOURS = 3
#: The same tolerance for the first and the last interval, which have neighbours on one side only,
#: and for the intervals after a repair close to an end.
_END_TOLERANCE, _END_REPAIR_TOLERANCE = 0.2, 0.1
#: A repair is unambiguous if any other one gives larger squares of deviations by this factor.
_DECISIVE = 4.0
#: Of two pulses closer than this share of an interval, the later one is a double pulse, a bounce.
_BOUNCE = 0.01
#: Most pulses that are left out at either end; the pulses of one revolution if these are more.
_MAX_LEFT_OUT = 8
#: Largest number of places that a comment lists.
_MAX_LISTED = 10


@dataclass
class RigSignal:
    """Samples of a signal over the shaft angle, in stretches of one direction without gaps."""

    time: np.ndarray  #: s, shape (k,)
    revolutions: np.ndarray  #: shaft angle, decreasing where the speed is negative, shape (k,)
    values: np.ndarray  #: shape (k,)
    stretches: list  #: (first sample, last sample, direction 1 or -1) of each stretch
    breaks: list  #: (start in s, end in s, reason) of each interval that is in no stretch
    known_time: np.ndarray  #: times with a known shaft angle, s
    path: np.ndarray  #: revolutions turned in either direction by these times
    max_order: float  #: highest order with four samples a wave at the highest speed
    units: str
    teeth: float  #: mesh periods per revolution
    attrs: dict  #: attributes of the order map, with the times of missing and double pulses
    notes: list  #: sentences on the faults of the tacho
    coords: dict = field(default_factory=dict)  #: dimensions of the values other than the sample

    @property
    def travel(self) -> float:
        """Number of revolutions turned in either direction."""
        return float(self.path[-1])

    def blocks(self, length: int, highest: float) -> Iterator[tuple]:
        """Yield (samples at equal angles, start in s, end in s, direction) of each complete block.

        A block has `length` revolutions of the shaft, and lies in a stretch of one direction
        without gaps. Its samples, at both ends and between, suffice for orders (waves per
        revolution) up to `highest`. The direction is 1, or -1 for backward rotation.
        """
        for first, last, direction in self.stretches:
            stretch = slice(first, last + 1)
            time, turns = self.time[stretch], self.revolutions[stretch]
            values = self.values[stretch]
            # The spline needs an increasing angle.
            if direction < 0:
                time, turns, values = time[::-1], turns[::-1], values[::-1]
            # Block k extends from k * length to (k + 1) * length revolutions.
            first_block = math.ceil(turns[0] / length - _REVOLUTION_TOLERANCE)
            stop_block = math.floor(turns[-1] / length + _REVOLUTION_TOLERANCE)
            if stop_block <= first_block:
                continue
            # Samples in the same small cell of the shaft angle are averaged.
            cells = np.floor(turns * _MAX_SAMPLES_PER_REVOLUTION)
            cell_starts = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1.0))
            counts = np.diff(cell_starts, append=cells.size)
            angles = np.add.reduceat(turns, cell_starts) / counts
            spline = CubicSpline(angles, np.add.reduceat(values, cell_starts) / counts)
            for k in range(first_block, stop_block):
                ends = length * np.array([k, k + 1.0])
                i, j = np.searchsorted(angles, ends)
                shortest_step = np.diff(angles[max(i - 1, 0) : j + 1]).min()
                # Resample at least as densely as the signal, with an even number of steps, at least
                # four per wave of the highest order.
                half_count = min(math.ceil(0.5 / shortest_step), _MAX_SAMPLES_PER_REVOLUTION // 2)
                sample_count = 2 * max(half_count, 2 * math.ceil(highest)) * length
                samples = spline(length * (k + np.arange(sample_count + 1.0) / sample_count))
                start_time, end_time = sorted(np.interp(ends, turns, time))
                yield samples, start_time, end_time, direction

    def left_out(self, start_times: np.ndarray, end_times: np.ndarray, length: int) -> dict:
        """Return attributes of the order map that describe the intervals without a block.

        The complete blocks have `length` revolutions each, and start and end at the sorted
        `start_times` and `end_times` in s. The attributes are "left_out", a list of (start, end) of
        the intervals between them in s, and "comment", sentences with the reasons. An interval
        shorter than a block at the start or the end of the signal is not mentioned.
        """
        first, last = self.known_time[[0, -1]]
        intervals = np.column_stack([[first, *end_times], [*start_times, last]])
        # Revolutions turned in each interval, in either direction.
        turns = np.diff(np.interp(intervals, self.known_time, self.path))[:, 0]
        # Signals start and end within a block.
        is_negligible = turns < length - _REVOLUTION_TOLERANCE
        is_negligible[1:-1] = False
        intervals = intervals[~is_negligible]
        # Successive blocks have no interval between them, apart from rounding errors.
        shortest = 1e-6 * float((end_times - start_times).min())
        intervals = intervals[intervals[:, 1] - intervals[:, 0] > shortest]
        places = []
        for start, end in intervals.tolist():
            reasons = [
                reason
                for break_start, break_end, reason in self.breaks
                if break_start <= end and break_end >= start
            ]
            places.append(f"{start:.6g} to {end:.6g} s ({', '.join(dict.fromkeys(reasons))})")
        attrs, notes = {}, list(self.notes)
        if places:
            attrs["left_out"] = intervals.tolist()
            notes.append(f"Revolutions are left out: {_listed(places)}.")
        if notes:
            attrs["comment"] = " ".join(notes)
        return attrs


def _listed(places: list) -> str:
    """Join descriptions of times or intervals to one string with semicolons.

    After the first `_MAX_LISTED` (10) of them, only the number of the others is given.
    """
    text = "; ".join(places[:_MAX_LISTED])
    other_count = len(places) - _MAX_LISTED
    if other_count > 0:
        text += f"; and {other_count} more"
    return text


def rig_signal(
    data: xr.Dataset,
    variable: str,
    highest: float | None,
    tacho: ArrayLike | None,
    pulses_per_revolution: int,
    teeth: int,
) -> RigSignal:
    """Return a measured variable of a dataset over the shaft angle as a `RigSignal`.

    The angle is the integral of the variable "speed" (rpm) from the first sample. If `tacho` has
    the times of tacho pulses in s, `pulses_per_revolution` of them in each revolution, the angle is
    interpolated between these pulses instead. The signal is split into stretches of one direction
    without gaps. `highest` is the highest order (waves per revolution) that the samples must
    resolve, or None, and `teeth` the number of mesh periods per revolution.
    """
    time, values = _samples(data, variable)
    attrs, notes = {}, []
    if tacho is None:
        allowed = "1 without tacho"
        is_one = pulses_per_revolution == 1
        checks.require(is_one, "pulses_per_revolution", pulses_per_revolution, allowed)
        time, values, speed, turns = _turns_by_speed(data, time, values)
    else:
        pulse_times, counts, attrs, notes = _counted_pulses(
            _pulse_times(tacho), pulses_per_revolution
        )
        turns_at_pulses = counts / pulses_per_revolution
        time, values, turns = _turns_by_tacho(time, values, pulse_times, turns_at_pulses)
        speed = np.ones(time.size)  # a tacho does not show the direction
    is_present = np.isfinite(values)
    if is_present.sum() < 4:
        text = "is not allowed: it must have at least four samples with time and speed"
        raise ValueError(f"{variable} {text}")
    known_time = time
    path = np.append(0.0, np.cumsum(np.abs(np.diff(turns))))
    time, turns = time[is_present], turns[is_present]
    values, speed = values[is_present], speed[is_present]
    directions = np.sign(np.diff(turns)) * (speed[1:] * speed[:-1] >= 0.0)
    angles = np.abs(np.diff(turns))
    ratios = _steps_over_usual(np.diff(time), angles)
    regular_angles = angles[ratios <= _IRREGULAR_STEP]
    if not regular_angles.max(initial=0.0) > 0.0:
        raise ValueError("speed = 0 is not allowed at all samples: the shaft must turn")
    max_order = 1.0 / (_MIN_SAMPLES_PER_WAVE * float(regular_angles.max()))
    allowed = f"at most {max_order:.4g}, orders with {_MIN_SAMPLES_PER_WAVE:g} samples a wave at "
    allowed += "the highest speed"
    checks.require(highest is None or highest <= max_order, "highest", highest, allowed)
    wavelength = 1.0 / (max_order if highest is None else highest)  # revolutions
    longest_step = (1.0 + _REVOLUTION_TOLERANCE) * wavelength / _MIN_SAMPLES_PER_WAVE
    is_gap = (ratios > _GAP) | (angles > longest_step)
    stretches, breaks = _stretches(time, np.where(is_gap, 0.0, directions), is_gap)
    # Samples may be missing at both ends.
    for start, end in ((known_time[0], time[0]), (time[-1], known_time[-1])):
        if end > start:
            breaks.append((start, end, "gap"))
    attrs["parameters"] = {"pulses_per_revolution": pulses_per_revolution, "teeth": teeth}
    return RigSignal(
        time=time,
        revolutions=turns,
        values=values,
        stretches=stretches,
        breaks=breaks,
        known_time=known_time,
        path=path,
        max_order=max_order,
        units=data[variable].attrs.get("units", "1"),
        teeth=float(teeth),
        attrs=attrs,
        notes=notes,
    )


def _turns_by_speed(data: xr.Dataset, time: np.ndarray, values: np.ndarray) -> tuple:
    """Return (time, values, speed, turns) of the samples whose time and speed are known.

    `time` in s and `values` are all samples of the signal, NaN where missing. The speed in rpm is a
    variable of the dataset `data`. Turns are the revolutions of the shaft since the first of these
    samples, the integral of the speed.
    """
    if "speed" not in data.variables or data["speed"].shape != data["time"].shape:
        raise ValueError("tacho = None is not allowed for a dataset without speed")
    speed = np.asarray(data["speed"].values, float)
    _require_no_infinity("speed", speed)
    is_known = np.isfinite(time) & np.isfinite(speed)
    time, values, speed = time[is_known], values[is_known], speed[is_known]
    turns = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    return time, values, speed, turns


def _turns_by_tacho(
    time: np.ndarray, values: np.ndarray, pulse_times: np.ndarray, turns_at_pulses: np.ndarray
) -> tuple:
    """Return (time, values, turns) of the samples between the first and the last tacho pulse.

    `time` in s and `values` are all samples of the signal, NaN where missing. `turns_at_pulses` are
    the revolutions of the shaft at the `pulse_times` in s. Turns are the revolutions at the
    samples, interpolated between the pulses by a cubic spline.
    """
    is_known = np.isfinite(time)
    time, values = time[is_known], values[is_known]
    # A sample on either side surrounds the first and the last pulse.
    first, stop = np.searchsorted(time, pulse_times[[0, -1]])
    first, stop = max(first - 1, 0), stop + 1
    time, values = time[first:stop], values[first:stop]
    if time.size < 4:
        raise ValueError(
            f"tacho = {pulse_times[0]:.6g} to {pulse_times[-1]:.6g} s is not allowed: it must have "
            "at least four samples between pulses"
        )
    return time, values, CubicSpline(pulse_times, turns_at_pulses)(time)


def _samples(data: xr.Dataset, variable: str) -> tuple:
    """Return (times in s, values) of a variable of a dataset, arrays of shape (k,).

    Missing times and values are NaN. Raise ValueError if the dataset lacks the variable over
    "time", if there are fewer than four samples, if one is infinite, or if times do not increase.
    """
    if variable not in data.variables or data[variable].shape != data["time"].shape:
        raise checks.InputError("variable", variable, "a variable of the dataset over time")
    time = np.asarray(data["time"].values, float)
    values = np.asarray(data[variable].values, float)
    if time.ndim != 1 or time.size < 4:
        raise ValueError(f"{variable} is not allowed: it must have at least four samples over time")
    _require_no_infinity(variable, values)
    _require_no_infinity("time", time)
    known = np.flatnonzero(np.isfinite(time))
    not_increasing = known[1:][np.diff(time[known]) <= 0.0]
    if not_increasing.size:
        i = int(not_increasing[0])
        raise checks.InputError(f"time[{i}]", float(time[i]), "later than the sample before")
    return time, values


def _require_no_infinity(name: str, values: np.ndarray) -> None:
    """Raise ValueError if a value of the variable `name` is infinite.

    NaN, a missing sample, is allowed. The message gives the index of the first infinite value.
    """
    infinite = np.flatnonzero(np.isinf(values))
    if infinite.size:
        i = int(infinite[0])
        raise checks.InputError(
            f"{name}[{i}]", float(values[i]), "finite, or NaN where it is missing"
        )


def _steps_over_usual(steps: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the ratio of each step between samples to the usual step of its neighbours.

    `steps` are in s, and `angles` are the same steps in revolutions of the shaft. The usual step is
    the median of 31 neighbouring steps. The smaller of the ratios in time and in angle counts,
    because samples are equidistant in time on most rigs, but in angle with a trigger on the shaft.
    All ratios are then reduced by a common factor, so that jitter of the sampling is not a gap.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        time_ratios = steps / median_filter(steps, _NEIGHBOURS)
        angle_ratios = angles / median_filter(angles, _NEIGHBOURS)  # NaN at standstill
    ratios = np.fmin(time_ratios, angle_ratios)
    return ratios / max(1.0, float(np.quantile(ratios, _USUAL_SHARE)))


def _stretches(time: np.ndarray, directions: np.ndarray, is_gap: np.ndarray) -> tuple:
    """Split a signal into stretches of one direction of rotation; return (stretches, breaks).

    `time`, shape (k,), is in s. `directions`, shape (k - 1,), has the direction 1 or -1 of each
    step between samples, or 0 at a standstill or a gap; `is_gap` marks the gaps. A stretch is
    (index of the first sample, index of the last sample, direction). A break is an interval without
    a stretch, or the time of a reversal: (start in s, end in s, reason).
    """
    reversal = "the speed is 0 or changes sign"
    stretches: list = []
    breaks: list = []
    changes = np.flatnonzero(np.diff(directions)) + 1
    # Each group has the indices of successive steps with the same direction code.
    for steps in np.split(np.arange(directions.size), changes):
        direction = int(directions[steps[0]])
        if direction:
            first, last = int(steps[0]), int(steps[-1]) + 1
            # A reversal without standstill: the previous stretch ends with this sample.
            if stretches and stretches[-1][1] == first:
                breaks.append((time[first], time[first], reversal))
            stretches.append((first, last, direction))
            continue
        gaps, standstills = steps[is_gap[steps]], steps[~is_gap[steps]]
        breaks.extend((time[i], time[i + 1], "gap") for i in gaps)
        if standstills.size:
            breaks.append((time[standstills[0]], time[standstills[-1] + 1], reversal))
    return stretches, breaks


def _pulse_times(tacho: ArrayLike) -> np.ndarray:
    """Return the times of tacho pulses in s as an array, shape (k,).

    Raise ValueError if there are fewer than four, or if they do not increase.
    """
    times = np.array(tacho)
    checks.require(times.size > 3, "tacho", times.tolist(), "at least four increasing times, s")
    not_increasing = np.flatnonzero(np.diff(times) <= 0.0) + 1
    if not_increasing.size:
        i = int(not_increasing[0])
        raise checks.InputError(f"tacho[{i}]", float(times[i]), "later than the pulse before, s")
    return times


def _counted_pulses(pulses: np.ndarray, pulses_per_revolution: int) -> tuple:
    """Count tacho pulses at the times `pulses` in s, and repair or leave out the irregular ones.

    Return (times, counts, attributes, sentences): the times in s and numbers of the pulses that are
    kept, the times of missing and double pulses by name, and a description of the repairs. A single
    missing pulse is counted, and a single double pulse is left out. A few irregular pulses at the
    ends, as around standstill, are left out. Any other irregular pulse raises ValueError.
    """
    first, stop = 0, pulses.size
    while True:
        times = pulses[first:stop]
        missing, double, unrepaired = _repairs(times)
        if unrepaired is None:
            break
        first_interval, last_interval = unrepaired
        # The pulses at both ends of an irregular interval may be wrong, so both are left out.
        if first_interval == 0:
            new_first, new_stop = first + last_interval + 2, stop
        else:
            new_first, new_stop = first, first + first_interval
        is_at_end = first_interval == 0 or last_interval == times.size - 2
        left_out_count = max(new_first, pulses.size - new_stop)
        are_few = left_out_count <= max(_MAX_LEFT_OUT, pulses_per_revolution)
        if not (is_at_end and are_few and new_stop - new_first > 3):
            counts = np.arange(times.size)
            raise _irregular_pulse(times, counts, first, first_interval, last_interval)
        first, stop = new_first, new_stop
    counts = np.arange(times.size)
    for interval in missing:
        counts[interval + 1 :] += 1
    for pulse in double:
        counts[pulse:] -= 1
    kept = np.delete(np.arange(times.size), double)
    attrs, notes = {}, []
    if first:
        notes.append(f"Tacho pulses are left out before {times[0]:.6g} s: they are irregular.")
    if stop < pulses.size:
        notes.append(f"Tacho pulses are left out after {times[-1]:.6g} s: they are irregular.")
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
    groups = _irregular_groups(times, counts)
    if groups:
        raise _irregular_pulse(times, counts, first, *groups[0])
    return times, counts, attrs, notes


def _repairs(times: np.ndarray) -> tuple:
    """Find the repairs of irregular tacho pulses at the given times in s.

    Return (indices of the intervals in which a pulse is missing, indices of the double pulses,
    unrepaired group). An interval has the index of the pulse at its start. The unrepaired group
    is (first, last) interval of the first group of irregular intervals without an unambiguous
    repair, at which the search stops, or None.
    """
    missing, double = [], []
    for first, last in _irregular_groups(times, np.arange(times.size)):
        repair = _repair(times, first, last)
        if repair is None:
            return missing, double, (first, last)
        is_missing, index = repair
        if is_missing:
            missing.append(index)
        else:
            double.append(index)
    return missing, double, None


def _deviations(times: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the expected minus the counted number of pulses in each interval between tacho pulses.

    `times` in s and `counts`, shape (k,), are the times of the pulses and their numbers. The
    expected number is the duration of the interval times the pulse rate in its middle. This rate
    lies on a straight line between the rates of a neighbouring interval on each side, which is
    exact for constant acceleration. The median over three pairs of neighbours is robust against a
    single wrong neighbour.
    """
    middles, durations = 0.5 * (times[1:] + times[:-1]), np.diff(times)
    rates = np.diff(counts) / durations
    interval_count = rates.size
    expected_rates = np.full((_PULSE_NEIGHBOURS, interval_count), np.nan)

    def rate_on_line(i, j, k):
        """Return the rate in the middle of interval i on a line through intervals j and k."""
        slope = (rates[k] - rates[j]) / (middles[k] - middles[j])
        return rates[j] + slope * (middles[i] - middles[j])

    for k in range(1, min(_PULSE_NEIGHBOURS, (interval_count - 1) // 2) + 1):
        i = np.arange(k, interval_count - k)
        expected_rates[k - 1, i] = rate_on_line(i, i - k, i + k)
    # The first and the last interval have neighbours on one side only; extrapolate their rates.
    expected_rates[0, 0] = rate_on_line(0, 1, 2)
    expected_rates[0, -1] = rate_on_line(-1, -2, -3)
    return np.nanmedian(expected_rates, axis=0) * durations - np.diff(counts)


def _irregular_groups(times: np.ndarray, counts: np.ndarray) -> list:
    """Return (first, last) interval of each group of irregular intervals between tacho pulses.

    `times` in s and `counts` are the times and numbers of the pulses. An interval is irregular if
    the number of pulses expected from its neighbours deviates by more than 0.4 (0.2 for the first
    and the last interval). A group has at most one regular interval between two irregular ones.
    """
    tolerances = np.full(times.size - 1, _PULSE_TOLERANCE)
    tolerances[[0, -1]] = _END_TOLERANCE
    irregular = np.flatnonzero(np.abs(_deviations(times, counts)) > tolerances)
    groups = np.split(irregular, np.flatnonzero(np.diff(irregular) > 2) + 1)
    return [(int(group[0]), int(group[-1])) for group in groups if group.size]


def _irregular_pulse(
    times: np.ndarray, counts: np.ndarray, offset: int, first: int, last: int
) -> ValueError:
    """Return the ValueError that names the worst of the intervals `first` to `last` between pulses.

    `times` in s and `counts` are the times and numbers of the tacho pulses. `offset` is the number
    of pulses that were left out before them, to give the index in the argument of the user.
    """
    deviations = _deviations(times, counts)
    i = first + int(np.abs(deviations[first : last + 1]).argmax())
    expected_count = deviations[i] + counts[i + 1] - counts[i]
    return ValueError(
        f"tacho = {times[i + 1]:.6g} s (pulse {offset + i + 1}) is not allowed: after the pulse "
        f"before, its neighbours have time for {expected_count:.2g} "
        "pulses, and it must be 1, or a single missing or double pulse among regular ones"
    )


def _repair(times: np.ndarray, first: int, last: int) -> tuple | None:
    """Return the unambiguous repair of the irregular intervals `first` to `last` of tacho pulses.

    `times` are the times of all pulses in s; interval i lies between the pulses i and i + 1. The
    repair is (True, index of the interval in which a pulse is missing), or (False, index of a
    double pulse to be deleted). It is None if no such change makes all intervals regular, or if
    two different ones do so about equally well.
    """
    pulse_count = times.size
    if last - first > 2 * _PULSE_NEIGHBOURS:
        return None
    # Repairs are tried on the pulses around the group only.
    window_start = max(first - 1 - _PULSE_NEIGHBOURS, 0)
    window = times[window_start : last + 3 + _PULSE_NEIGHBOURS]
    # The intervals between these times must be regular after the repair.
    start_time, end_time = times[max(first - 1, 0)], times[min(last + 2, pulse_count - 1)]
    is_at_end = first == 0 or last == pulse_count - 2
    tolerance = _END_REPAIR_TOLERANCE if is_at_end else _PULSE_TOLERANCE
    accepted = []  # (sum of squared deviations, whether a pulse is missing, index)
    candidates = [(True, i) for i in range(max(first, 1), min(last + 1, pulse_count - 2))]
    candidates += [(False, j) for j in range(max(first, 1), min(last + 2, pulse_count - 1))]
    for is_missing, index in candidates:
        counts, kept_times = np.arange(window.size), window
        if is_missing:
            counts = counts + (counts > index - window_start)
        else:
            counts, kept_times = counts[:-1], np.delete(window, index - window_start)
        if kept_times.size < 4:
            continue
        is_near = (kept_times[:-1] >= start_time) & (kept_times[1:] <= end_time)
        deviations = np.abs(_deviations(kept_times, counts)[is_near])
        if deviations.max() <= tolerance:
            accepted.append(((deviations**2).sum(), is_missing, index))
    if not accepted:
        return None
    accepted.sort()
    best_sum, is_missing, index = accepted[0]
    if len(accepted) > 1 and accepted[1][0] < _DECISIVE * best_sum:
        # Two candidates are equivalent only if they remove either of two pulses of a bounce.
        _, other_is_missing, other_index = accepted[1]
        distance = abs(times[index] - times[other_index])
        is_bounce = distance <= _BOUNCE * np.median(np.diff(window))
        if is_missing or other_is_missing or not is_bounce:
            return None
        return False, max(index, other_index)
    return is_missing, index

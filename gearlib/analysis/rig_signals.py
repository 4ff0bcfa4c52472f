"""Measured signals over the shaft angle, with gaps, standstill, reversals and tacho pulses.

Blocks of whole revolutions lie on a fixed grid of shaft angles. Blocks with a gap, a standstill or
a reversal are omitted, and all other blocks are the same as in a complete signal.
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

#: Numbers of revolutions that differ by less than this are equal.
_REVOLUTION_TOLERANCE = 1e-9
#: Smallest number of samples per wave of a signal. Interpolation by a cubic spline multiplies the
#: amplitude by 3 sinc(f)^4 / (2 + cos(2 pi f)), f = 1 / (samples per wave), i.e. reduces it by 1.5
#: % with four samples and by 0.02 % with ten.
_MIN_SAMPLES_PER_WAVE = 4.0
#: Largest number of samples per revolution; at low speeds, where there are more, they are averaged.
_MAX_SAMPLES_PER_REVOLUTION = 2**16
#: The usual step is the median of this number of neighbouring steps. It is increased, if necessary,
#: until this fraction of all steps does not exceed it, to allow for jitter.
_MEDIAN_WINDOW, _STEP_QUANTILE = 31, 0.98
#: Ratio of a step to the usual step above which it is irregular, and above which it is a gap.
_IRREGULAR_RATIO, _GAP_RATIO = 1.5, 3.0
#: Largest deviation of an interval between tacho pulses from its neighbours, in pulses.
_PULSE_TOLERANCE = 0.4
#: Number of neighbours on each side with which an interval is compared.
_PULSE_NEIGHBOURS = 3
#: The same tolerance for the first and the last interval, which have neighbours on one side only,
#: and for the intervals after a repair close to an end.
_END_TOLERANCE, _END_REPAIR_TOLERANCE = 0.2, 0.1
#: A repair is unambiguous if the sum of squared errors of any other repair is larger by this
#: factor.
_MIN_ERROR_RATIO = 4.0
#: If two pulses are closer than this fraction of an interval, the later one is a bounce.
_MAX_BOUNCE_RATIO = 0.01
#: Largest number of pulses that are dropped at either end, or one revolution if that has more.
_MAX_DROPPED_PULSES = 8
#: Largest number of times or intervals that a comment lists.
_MAX_LISTED = 10


@dataclass
class RigSignal:
    """Samples of a signal over the shaft angle, split into segments of constant direction."""

    time: np.ndarray  #: s, shape (k,)
    revolutions: np.ndarray  #: shaft angle, decreasing where the speed is negative, shape (k,)
    values: np.ndarray  #: shape (k,)
    segments: list  #: (first sample, last sample, direction 1 or -1) of each segment without gaps
    interruptions: list  #: (start in s, end in s, reason) of each interval between segments
    valid_time: np.ndarray  #: times at which the shaft angle is known, s
    travelled_revolutions: np.ndarray  #: revolutions in either direction up to these times
    max_order: float  #: highest order with four samples per wave at the highest speed
    units: str
    teeth: float  #: mesh periods per revolution
    attrs: dict  #: attributes of the order map, with the times of missing and double pulses
    notes: list  #: sentences that describe faults of the tacho
    coords: dict = field(default_factory=dict)  #: dimensions of the values other than the sample

    @property
    def total_revolutions(self) -> float:
        """Total number of revolutions in either direction."""
        return float(self.travelled_revolutions[-1])

    def blocks(self, length: int, highest: float) -> Iterator[tuple]:
        """Yield (samples at equal angles, start in s, end in s, direction) of each complete block.

        A block has `length` revolutions of the shaft and lies within one segment. Its samples,
        which include both ends, resolve orders (waves per revolution) up to `highest`. The
        direction is 1 for forward and -1 for backward rotation.
        """
        for first, last, direction in self.segments:
            segment = slice(first, last + 1)
            time, revolutions = self.time[segment], self.revolutions[segment]
            values = self.values[segment]
            # The spline requires increasing angles.
            if direction < 0:
                time, revolutions, values = time[::-1], revolutions[::-1], values[::-1]
            # Block k extends from k * length to (k + 1) * length revolutions.
            first_block = math.ceil(revolutions[0] / length - _REVOLUTION_TOLERANCE)
            stop_block = math.floor(revolutions[-1] / length + _REVOLUTION_TOLERANCE)
            if stop_block <= first_block:
                continue
            # At low speed, samples in the same small cell of the shaft angle are averaged.
            cells = np.floor(revolutions * _MAX_SAMPLES_PER_REVOLUTION)
            cell_starts = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1.0))
            counts = np.diff(cell_starts, append=cells.size)
            angles = np.add.reduceat(revolutions, cell_starts) / counts
            spline = CubicSpline(angles, np.add.reduceat(values, cell_starts) / counts)
            for k in range(first_block, stop_block):
                ends = length * np.array([k, k + 1.0])
                i, j = np.searchsorted(angles, ends)
                shortest_step = np.diff(angles[max(i - 1, 0) : j + 1]).min()
                # The block is resampled at least as densely as the signal, with an even number of
                # steps and at least four steps per wave of the highest order.
                half_count = min(math.ceil(0.5 / shortest_step), _MAX_SAMPLES_PER_REVOLUTION // 2)
                sample_count = 2 * max(half_count, 2 * math.ceil(highest)) * length
                samples = spline(length * (k + np.arange(sample_count + 1.0) / sample_count))
                start_time, end_time = sorted(np.interp(ends, revolutions, time))
                yield samples, start_time, end_time, direction

    def describe_omissions(
        self, start_times: np.ndarray, end_times: np.ndarray, length: int
    ) -> dict:
        """Return the attributes of the order map that describe the intervals without a block.

        The complete blocks have `length` revolutions each and extend from the sorted `start_times`
        to `end_times` in s. The attribute "left_out" lists (start, end) of the intervals between
        blocks in s, and "comment" states the reasons. An interval shorter than a block at the start
        or the end of the signal is not listed.
        """
        first, last = self.valid_time[[0, -1]]
        intervals = np.column_stack([[first, *end_times], [*start_times, last]])
        # Number of revolutions in each interval, in either direction.
        revolutions = np.diff(np.interp(intervals, self.valid_time, self.travelled_revolutions))[
            :, 0
        ]
        # A signal normally starts and ends within a block.
        is_negligible = revolutions < length - _REVOLUTION_TOLERANCE
        is_negligible[1:-1] = False
        intervals = intervals[~is_negligible]
        # Consecutive blocks are adjacent up to rounding errors.
        shortest = 1e-6 * float((end_times - start_times).min())
        intervals = intervals[intervals[:, 1] - intervals[:, 0] > shortest]
        interval_texts = []
        for start, end in intervals.tolist():
            reasons = [
                reason
                for break_start, break_end, reason in self.interruptions
                if break_start <= end and break_end >= start
            ]
            interval_texts.append(
                f"{start:.6g} to {end:.6g} s ({', '.join(dict.fromkeys(reasons))})"
            )
        attrs, notes = {}, list(self.notes)
        if interval_texts:
            attrs["left_out"] = intervals.tolist()
            notes.append(f"Revolutions are omitted: {_join_texts(interval_texts)}.")
        if notes:
            attrs["comment"] = " ".join(notes)
        return attrs


def _join_texts(texts: list) -> str:
    """Join descriptions of times or intervals with semicolons.

    Only the first `_MAX_LISTED` (10) descriptions are included, and the others are counted.
    """
    text = "; ".join(texts[:_MAX_LISTED])
    other_count = len(texts) - _MAX_LISTED
    if other_count > 0:
        text += f"; and {other_count} more"
    return text


def create_rig_signal(
    data: xr.Dataset,
    variable: str,
    highest: float | None,
    tacho: ArrayLike | None,
    pulses_per_revolution: int,
    teeth: int,
) -> RigSignal:
    """Return a measured variable of a dataset over the shaft angle as a `RigSignal`.

    The angle is the integral of the variable "speed" (rpm) from the first sample. If `tacho`
    contains the times of tacho pulses in s, with `pulses_per_revolution`, the angle is interpolated
    between these pulses instead. The signal is split at gaps and reversals. `highest` is the
    highest order (waves per revolution) that the samples must resolve, or None, and `teeth` is the
    number of mesh periods per revolution.
    """
    time, values = _read_samples(data, variable)
    attrs, notes = {}, []
    if tacho is None:
        allowed = "1 without tacho"
        is_one = pulses_per_revolution == 1
        checks.require(is_one, "pulses_per_revolution", pulses_per_revolution, allowed)
        time, values, speed, revolutions = _integrate_speed(data, time, values)
    else:
        pulse_times, counts, attrs, notes = _count_pulses(
            _check_pulse_times(tacho), pulses_per_revolution
        )
        pulse_revolutions = counts / pulses_per_revolution
        time, values, revolutions = _interpolate_tacho(time, values, pulse_times, pulse_revolutions)
        speed = np.ones(time.size)  # a tacho does not detect the direction
    is_present = np.isfinite(values)
    if is_present.sum() < 4:
        raise ValueError(f"{variable} must have at least four samples with time and speed")
    valid_time = time
    travelled_revolutions = np.append(0.0, np.cumsum(np.abs(np.diff(revolutions))))
    time, revolutions = time[is_present], revolutions[is_present]
    values, speed = values[is_present], speed[is_present]
    directions = np.sign(np.diff(revolutions)) * (speed[1:] * speed[:-1] >= 0.0)
    angles = np.abs(np.diff(revolutions))
    ratios = _relative_steps(np.diff(time), angles)
    regular_angles = angles[ratios <= _IRREGULAR_RATIO]
    if not regular_angles.max(initial=0.0) > 0.0:
        raise ValueError("speed is 0 at all samples: the shaft must rotate")
    max_order = 1.0 / (_MIN_SAMPLES_PER_WAVE * float(regular_angles.max()))
    allowed = f"at most {max_order:.4g}, so that there are {_MIN_SAMPLES_PER_WAVE:g} samples per "
    allowed += "wave at the highest speed"
    checks.require(highest is None or highest <= max_order, "highest", highest, allowed)
    wavelength = 1.0 / (max_order if highest is None else highest)  # revolutions
    longest_step = (1.0 + _REVOLUTION_TOLERANCE) * wavelength / _MIN_SAMPLES_PER_WAVE
    is_gap = (ratios > _GAP_RATIO) | (angles > longest_step)
    segments, interruptions = _split_into_segments(time, np.where(is_gap, 0.0, directions), is_gap)
    # Samples may be missing at the start and at the end.
    for start, end in ((valid_time[0], time[0]), (time[-1], valid_time[-1])):
        if end > start:
            interruptions.append((start, end, "gap"))
    attrs["parameters"] = {"pulses_per_revolution": pulses_per_revolution, "teeth": teeth}
    return RigSignal(
        time=time,
        revolutions=revolutions,
        values=values,
        segments=segments,
        interruptions=interruptions,
        valid_time=valid_time,
        travelled_revolutions=travelled_revolutions,
        max_order=max_order,
        units=data[variable].attrs.get("units", "1"),
        teeth=float(teeth),
        attrs=attrs,
        notes=notes,
    )


def _integrate_speed(data: xr.Dataset, time: np.ndarray, values: np.ndarray) -> tuple:
    """Return (time, values, speed, revolutions) of the samples with valid time and speed.

    `time` in s and `values` are all samples of the signal, NaN where missing. The speed in rpm is a
    variable of the dataset `data`; its integral is the number of revolutions since the first valid
    sample.
    """
    if "speed" not in data.variables or data["speed"].shape != data["time"].shape:
        raise ValueError("tacho is missing: it is required for a dataset without speed over time")
    speed = np.asarray(data["speed"].values, float)
    _require_no_infinity("speed", speed)
    is_valid = np.isfinite(time) & np.isfinite(speed)
    time, values, speed = time[is_valid], values[is_valid], speed[is_valid]
    revolutions = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    return time, values, speed, revolutions


def _interpolate_tacho(
    time: np.ndarray, values: np.ndarray, pulse_times: np.ndarray, pulse_revolutions: np.ndarray
) -> tuple:
    """Return (time, values, revolutions) of the samples between the first and the last tacho pulse.

    `time` in s and `values` are all samples of the signal, NaN where missing. `pulse_revolutions`
    are the numbers of shaft revolutions at the `pulse_times` in s, which are interpolated to the
    samples by a cubic spline.
    """
    is_valid = np.isfinite(time)
    time, values = time[is_valid], values[is_valid]
    # Keep one sample before the first pulse and one after the last pulse.
    first, stop = np.searchsorted(time, pulse_times[[0, -1]])
    first, stop = max(first - 1, 0), stop + 1
    time, values = time[first:stop], values[first:stop]
    if time.size < 4:
        raise ValueError(
            f"there are fewer than four samples between the first and the last tacho pulse, "
            f"{pulse_times[0]:.6g} s and {pulse_times[-1]:.6g} s: there must be at least four"
        )
    return time, values, CubicSpline(pulse_times, pulse_revolutions)(time)


def _read_samples(data: xr.Dataset, variable: str) -> tuple:
    """Return (times in s, values) of a variable of a dataset, arrays of shape (k,).

    Missing times and values are NaN. Raise ValueError if the dataset does not have the variable
    over "time", if there are fewer than four samples, if a sample is infinite, or if the times do
    not increase.
    """
    if variable not in data.variables or data[variable].shape != data["time"].shape:
        raise checks.InputError("variable", variable, "a variable of the dataset over time")
    time = np.asarray(data["time"].values, float)
    values = np.asarray(data[variable].values, float)
    if time.ndim != 1 or time.size < 4:
        raise ValueError(f"{variable} must have at least four samples over time")
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

    NaN is allowed and marks a missing sample. The message states the first infinite value.
    """
    infinite = np.flatnonzero(np.isinf(values))
    if infinite.size:
        i = int(infinite[0])
        raise checks.InputError(
            f"{name}[{i}]", float(values[i]), "finite, or NaN where it is missing"
        )


def _relative_steps(steps: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the ratio of each step between samples to the median of its neighbouring steps.

    `steps` are in s, and `angles` are the same steps in revolutions. The smaller of the ratios in
    time and in angle is returned, because samples are equidistant in time on most rigs, but in
    angle if the shaft triggers the sampling. All ratios are then divided by a common factor, so
    that sampling jitter does not count as a gap.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        time_ratios = steps / median_filter(steps, _MEDIAN_WINDOW)
        angle_ratios = angles / median_filter(angles, _MEDIAN_WINDOW)  # NaN at standstill
    ratios = np.fmin(time_ratios, angle_ratios)
    return ratios / max(1.0, float(np.quantile(ratios, _STEP_QUANTILE)))


def _split_into_segments(time: np.ndarray, directions: np.ndarray, is_gap: np.ndarray) -> tuple:
    """Split a signal into segments of constant direction; return (segments, interruptions).

    `time`, shape (k,), is in s. `directions`, shape (k - 1,), contains the direction 1 or -1 of
    each step between samples, or 0 at a standstill or a gap; `is_gap` marks the gaps. A segment is
    (index of the first sample, index of the last sample, direction). A break is an interval without
    a segment, or the time of a reversal: (start in s, end in s, reason).
    """
    reversal = "the speed is 0 or changes sign"
    segments: list = []
    interruptions: list = []
    changes = np.flatnonzero(np.diff(directions)) + 1
    # Each group contains the indices of consecutive steps with the same direction.
    for steps in np.split(np.arange(directions.size), changes):
        direction = int(directions[steps[0]])
        if direction:
            first, last = int(steps[0]), int(steps[-1]) + 1
            # At a reversal without standstill, the previous segment ends with this sample.
            if segments and segments[-1][1] == first:
                interruptions.append((time[first], time[first], reversal))
            segments.append((first, last, direction))
            continue
        gaps, standstills = steps[is_gap[steps]], steps[~is_gap[steps]]
        interruptions.extend((time[i], time[i + 1], "gap") for i in gaps)
        if standstills.size:
            interruptions.append((time[standstills[0]], time[standstills[-1] + 1], reversal))
    return segments, interruptions


def _check_pulse_times(tacho: ArrayLike) -> np.ndarray:
    """Return the times of tacho pulses in s as an array, shape (k,).

    Raise ValueError if there are fewer than four pulses or if the times do not increase.
    """
    times = np.array(tacho)
    checks.require(times.size > 3, "tacho", times.tolist(), "at least four increasing times, s")
    not_increasing = np.flatnonzero(np.diff(times) <= 0.0) + 1
    if not_increasing.size:
        i = int(not_increasing[0])
        raise checks.InputError(f"tacho[{i}]", float(times[i]), "later than the pulse before, s")
    return times


def _count_pulses(pulses: np.ndarray, pulses_per_revolution: int) -> tuple:
    """Count tacho pulses at the times `pulses` in s, and repair or drop irregular pulses.

    Return (times, counts, attributes, notes): times in s and numbers of the pulses that are kept,
    times of missing and double pulses by attribute name, and sentences that describe the repairs. A
    single missing pulse is counted, and a single double pulse is dropped. A few irregular pulses at
    the ends, as around standstill, are dropped. Any other irregular pulse raises ValueError.
    """
    first, stop = 0, pulses.size
    while True:
        times = pulses[first:stop]
        missing, double, unrepaired = _find_repairs(times)
        if unrepaired is None:
            break
        first_interval, last_interval = unrepaired
        # Either pulse of an irregular interval may be wrong, so both are dropped.
        if first_interval == 0:
            new_first, new_stop = first + last_interval + 2, stop
        else:
            new_first, new_stop = first, first + first_interval
        is_at_end = first_interval == 0 or last_interval == times.size - 2
        dropped_count = max(new_first, pulses.size - new_stop)
        are_few = dropped_count <= max(_MAX_DROPPED_PULSES, pulses_per_revolution)
        if not (is_at_end and are_few and new_stop - new_first > 3):
            counts = np.arange(times.size)
            raise _irregular_pulse_error(times, counts, first, first_interval, last_interval)
        first, stop = new_first, new_stop
    counts = np.arange(times.size)
    for interval in missing:
        counts[interval + 1 :] += 1
    for pulse in double:
        counts[pulse:] -= 1
    kept = np.delete(np.arange(times.size), double)
    attrs, notes = {}, []
    if first:
        notes.append(f"Irregular tacho pulses before {times[0]:.6g} s are dropped.")
    if stop < pulses.size:
        notes.append(f"Irregular tacho pulses after {times[-1]:.6g} s are dropped.")
    if missing:
        attrs["missing_pulses"] = times[[[i, i + 1] for i in missing]].tolist()
        interval_texts = [f"{start:.6g} to {end:.6g} s" for start, end in attrs["missing_pulses"]]
        notes.append(f"Missing tacho pulses are counted: {_join_texts(interval_texts)}.")
    if double:
        attrs["double_pulses"] = times[double].tolist()
        interval_texts = [f"{time:.6g} s" for time in attrs["double_pulses"]]
        notes.append(f"Double tacho pulses are dropped: {_join_texts(interval_texts)}.")
    times, counts = times[kept], counts[kept]
    checks.require(times.size >= 4, "tacho", pulses.tolist(), "at least four regular pulses")
    groups = _irregular_groups(times, counts)
    if groups:
        raise _irregular_pulse_error(times, counts, first, *groups[0])
    return times, counts, attrs, notes


def _find_repairs(times: np.ndarray) -> tuple:
    """Find repairs of irregular tacho pulses at the given times in s.

    Return (indices of the intervals in which a pulse is missing, indices of the double pulses,
    unrepaired group). An interval has the index of its first pulse. The search stops at the first
    group of irregular intervals without an unambiguous repair, the unrepaired group (first, last
    interval), which is None if there is no such group.
    """
    missing, double = [], []
    for first, last in _irregular_groups(times, np.arange(times.size)):
        repair = _find_repair(times, first, last)
        if repair is None:
            return missing, double, (first, last)
        is_missing, index = repair
        if is_missing:
            missing.append(index)
        else:
            double.append(index)
    return missing, double, None


def _pulse_count_errors(times: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the expected minus the counted number of pulses in each interval between tacho pulses.

    `times` in s and `counts`, shape (k,), are the times and numbers of the pulses. The expected
    number is the duration of the interval times the pulse rate at its midpoint. This rate is
    interpolated linearly between a neighbouring interval on each side, which is exact for constant
    acceleration. The median over three pairs of neighbours is robust against a single outlier.
    """
    midpoints, durations = 0.5 * (times[1:] + times[:-1]), np.diff(times)
    rates = np.diff(counts) / durations
    interval_count = rates.size
    expected_rates = np.full((_PULSE_NEIGHBOURS, interval_count), np.nan)

    def rate_by_line(i, j, k):
        """Return the pulse rate at the midpoint of interval i on a line through intervals j, k."""
        slope = (rates[k] - rates[j]) / (midpoints[k] - midpoints[j])
        return rates[j] + slope * (midpoints[i] - midpoints[j])

    for k in range(1, min(_PULSE_NEIGHBOURS, (interval_count - 1) // 2) + 1):
        i = np.arange(k, interval_count - k)
        expected_rates[k - 1, i] = rate_by_line(i, i - k, i + k)
    # The rates of the first and the last interval are extrapolated.
    expected_rates[0, 0] = rate_by_line(0, 1, 2)
    expected_rates[0, -1] = rate_by_line(-1, -2, -3)
    return np.nanmedian(expected_rates, axis=0) * durations - np.diff(counts)


def _irregular_groups(times: np.ndarray, counts: np.ndarray) -> list:
    """Return (first, last interval) of each group of irregular intervals between tacho pulses.

    `times` in s and `counts` are the times and numbers of the pulses. An interval is irregular if
    the number of pulses expected from its neighbours differs from the counted number by more than
    0.4 (0.2 for the first and the last interval). Irregular intervals belong to the same group if
    there is at most one regular interval between them.
    """
    tolerances = np.full(times.size - 1, _PULSE_TOLERANCE)
    tolerances[[0, -1]] = _END_TOLERANCE
    irregular = np.flatnonzero(np.abs(_pulse_count_errors(times, counts)) > tolerances)
    groups = np.split(irregular, np.flatnonzero(np.diff(irregular) > 2) + 1)
    return [(int(group[0]), int(group[-1])) for group in groups if group.size]


def _irregular_pulse_error(
    times: np.ndarray, counts: np.ndarray, offset: int, first: int, last: int
) -> ValueError:
    """Return a ValueError for the most irregular of the intervals `first` to `last` between pulses.

    `times` in s and `counts` are the times and numbers of the tacho pulses. `offset` is the number
    of pulses dropped before them, which the index in the message includes.
    """
    count_errors = _pulse_count_errors(times, counts)
    i = first + int(np.abs(count_errors[first : last + 1]).argmax())
    expected_count = count_errors[i] + counts[i + 1] - counts[i]
    return ValueError(
        f"tacho = {times[i + 1]:.6g} s (pulse {offset + i + 1}) is irregular: neighbouring "
        f"intervals suggest {expected_count:.2g} pulses since the previous one; there must be 1, "
        "except for a single missing or double pulse among regular ones"
    )


def _find_repair(times: np.ndarray, first: int, last: int) -> tuple | None:
    """Find an unambiguous repair of the irregular intervals `first` to `last` between tacho pulses.

    `times` are the times of all pulses in s; interval i lies between pulses i and i + 1. Return
    (True, index of the interval in which a pulse is missing), (False, index of the double pulse),
    or None if no such repair makes all intervals regular or two repairs fit about equally well.
    """
    pulse_count = times.size
    if last - first > 2 * _PULSE_NEIGHBOURS:
        return None
    # Only the pulses around the group are needed to test a repair.
    window_start = max(first - 1 - _PULSE_NEIGHBOURS, 0)
    window = times[window_start : last + 3 + _PULSE_NEIGHBOURS]
    # The intervals between these times must be regular after the repair.
    start_time, end_time = times[max(first - 1, 0)], times[min(last + 2, pulse_count - 1)]
    is_at_end = first == 0 or last == pulse_count - 2
    tolerance = _END_REPAIR_TOLERANCE if is_at_end else _PULSE_TOLERANCE
    accepted = []  # (sum of squared errors, whether a pulse is missing, index)
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
        count_errors = np.abs(_pulse_count_errors(kept_times, counts)[is_near])
        if count_errors.max() <= tolerance:
            accepted.append(((count_errors**2).sum(), is_missing, index))
    if not accepted:
        return None
    accepted.sort()
    best_sum, is_missing, index = accepted[0]
    if len(accepted) > 1 and accepted[1][0] < _MIN_ERROR_RATIO * best_sum:
        # The repair is still unambiguous if both candidates remove one of two bouncing pulses.
        _, other_is_missing, other_index = accepted[1]
        distance = abs(times[index] - times[other_index])
        is_bounce = distance <= _MAX_BOUNCE_RATIO * np.median(np.diff(window))
        if is_missing or other_is_missing or not is_bounce:
            return None
        return False, max(index, other_index)
    return is_missing, index

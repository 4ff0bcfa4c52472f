"""Derivatives of what a run of Taylor steps records: samples, events, extrema, times."""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels.closed_form.sensitivity import (
    CLOSEST,
    FORCE_MAX,
    SLOWEST,
    X_MAX,
    event_times,
)
from gearlib.kernels.codes import BACKLASH
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.polynomial import horner
from gearlib.kernels.taylor.series import ORDER, PUSH, X
from gearlib.kernels.taylor.taylor_tangents import STIFF, columns_at

#: Places of a step between which a curve is looked at for a turning point.
_PLACES = 8
_HALVINGS = 60


class Record(NamedTuple):
    """What is filled, for k directions, as of `closed_form.sensitivity.differentiate`."""

    samples: np.ndarray
    events: np.ndarray
    extrema: np.ndarray
    times: np.ndarray
    best: np.ndarray  #: values of the extrema so far, shape (4,)
    row: np.ndarray  #: shape (k,)
    force: np.ndarray  #: shape (k,)
    along: np.ndarray  #: shape (k,)


@kernel
def new_record(samples, events, extrema, times):
    """Return an empty `Record` in the arrays given."""
    k = times.shape[1]
    times[:] = 0.0
    best = np.array([-math.inf, math.inf, -math.inf, math.inf])
    return Record(samples, events, extrema, times, best, np.empty(k), np.empty(k), np.empty(k))


@kernel
def _consider(most, value, slope, record):
    """Compare a value that changes by `slope`, shape (k,), with an extremum and its opposite."""
    best, extrema = record.best, record.extrema
    for place in (most, most + 1):
        if value > best[place] if place == most else value < best[place]:
            best[place] = value
            for j in range(slope.shape[0]):
                extrema[place, j] = slope[j]


@inlined
def _force_at(series, columns, tuning, rates, t, record):
    """Return the mesh force, and fill `record.force` with what it changes by at this phase."""
    columns_at(columns.push, t, record.force)
    shape = record.force.shape[0]
    stiff, force = 0.0, 0.0
    for k in range(ORDER, -1, -1):
        stiff = stiff * t + columns.base[STIFF, k]
        force = force * t + series[PUSH, k]
    unit = tuning * tuning
    columns_at(columns.a[2:], t, record.along)
    for j in range(shape):
        record.force[j] = unit * (record.force[j] + stiff * record.along[j])
        record.force[j] += 2.0 * tuning * rates[j] * force
    return unit * force


@inlined
def _turning(curve, low, high):
    """Return where the derivative of a polynomial passes zero between two places."""
    _, below = horner(curve, low)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        _, slope = horner(curve, middle)
        if (slope < 0.0) == (below < 0.0):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@kernel
def consider_end(series, columns, tuning, rates, t, late, touches, record):
    """Compare an end of a step, whose phase moves by `late`, shape (k,), with the extrema."""
    row, count = record.row, record.row.shape[0]
    x, v = horner(series[X], t)
    columns_at(columns.a[2:], t, row)
    for j in range(count):
        row[j] += v * late[j]
    _consider(X_MAX, x, row, record)
    if touches:
        force = _force_at(series, columns, tuning, rates, t, record)
        _, slope = horner(series[PUSH], t)
        for j in range(count):
            record.force[j] += tuning * tuning * slope * late[j]
        _consider(FORCE_MAX, force, record.force, record)


@kernel
def consider_none(record):
    """Compare a mesh force that is zero and stays so with the extrema."""
    record.force[:] = 0.0
    _consider(FORCE_MAX, 0.0, record.force, record)


@kernel
def turning_points(series, columns, tuning, rates, h, touches, upper, lower, record):
    """Compare the turning points inside a step with the extrema; return whether one grazes."""
    grazing = False
    for curve in (X, PUSH):
        if curve == PUSH and not touches:
            continue
        _, before = horner(series[curve], 0.0)
        for i in range(_PLACES):
            _, after = horner(series[curve], h * (i + 1) / _PLACES)
            if (before < 0.0) != (after < 0.0):
                t = _turning(series[curve], h * i / _PLACES, h * (i + 1) / _PLACES)
                if curve == X:
                    x, _ = horner(series[X], t)
                    columns_at(columns.a[2:], t, record.row)
                    _consider(X_MAX, x, record.row, record)
                    grazing = grazing or min(abs(x - upper), abs(x - lower)) <= CLOSEST
                else:
                    force = _force_at(series, columns, tuning, rates, t, record)
                    _consider(FORCE_MAX, force, record.force, record)
            before = after
    return grazing


@kernel
def samples_of(series, columns, tuning, rates, phase, h, touches, seen, taken, record):
    """Fill the rows of `seen`, one period, that lie before phase + h; return how many are."""
    count = record.row.shape[0]
    while taken < seen.shape[0]:
        t = 2.0 * math.pi * taken / seen.shape[0] - phase
        if t >= h:
            break
        row = seen[taken]
        row[:] = 0.0
        for j in range(count):
            x, v, a = 0.0, 0.0, 0.0
            for k in range(ORDER, -1, -1):
                a = a * t + v
                x, v = x * t + columns.a[2 + j, k], v * t + columns.b[2 + j, k]
            row[0, j], row[1, j], row[2, j] = x, v, a
        if touches:
            _force_at(series, columns, tuning, rates, t, record)
            for j in range(count):
                seen[taken, 3, j] = record.force[j]
        taken += 1
    return taken


@kernel
def note_event(before, after, low, tuning, v, acceleration, w, moved, lines, found, record):
    """Fill the row of an event whose phase moves by `moved`; return (events so far, grazing).

    `w`: the columns before it; `lines`, shape (2, k): by what the lines move on which the flank is
    left and met, which are two only where there is no way between the flanks.
    """
    count = moved.shape[0]
    if found < record.events.shape[0]:
        for j in range(count):
            record.events[found, 0, j] = moved[j]
            record.events[found, 1, j] = w[1, 2 + j] + acceleration * moved[j]
    left = before
    if before != BACKLASH and after != BACKLASH:
        event_times(low, before, BACKLASH, moved, record.times)
        for j in range(count):
            moved[j] += (lines[1, j] - lines[0, j]) / v
        left = BACKLASH
    event_times(low, left, after, moved, record.times)
    consider_none(record)
    return found + 1, not abs(v) * tuning > SLOWEST

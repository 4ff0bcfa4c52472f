"""Records of an orbit: extrema, contact times, samples, events and period."""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BACKLASH, NORMAL
from gearlib.engines.copies import copy, enlarged
from gearlib.engines.jit import kernel, uncounted
from gearlib.engines.polynomial import highest

# Columns of the summary of an orbit. The TIME columns hold phase, BOUNCES a count.
(
    X_MAX,
    X_MIN,
    FORCE_MAX,
    FORCE_MIN,
    TIME_NORMAL,
    TIME_BACKLASH,
    TIME_INVERSE,
    TIME_LOW,
    BOUNCES,
) = range(9)
SUMMARY_COLUMNS = 9

# Columns of the sample table and of the event table.
SAMPLE_X, SAMPLE_V, SAMPLE_A, SAMPLE_CONTACT, SAMPLE_STIFFNESS, SAMPLE_FORCE = range(6)
SAMPLE_COLUMNS = 6
#: Column of the phase, since the start of the mesh period, of a sample that is not filled yet.
SAMPLE_PHASE = SAMPLE_X
EVENT_PERIOD, EVENT_PHASE, EVENT_FROM, EVENT_TO, EVENT_VELOCITY = range(5)
EVENT_COLUMNS = 5

#: Longest period of an orbit, in mesh periods, or in repeats of a run-out.
MAX_PERIOD = 16
#: Number of last mesh periods whose states are recorded, enough for two periods of the longest
#: orbit; `strobe_periods` with run-out.
STROBE_PERIODS = 2 * MAX_PERIOD - 1
#: Largest distance of stroboscopic states that count as equal, over the height of the orbit or the
#: static deflection if that is larger: far above rounding, far below a visible difference.
SAME_STATE_TOLERANCE = 1e-6


class Span(NamedTuple):
    """The length of a run."""

    periods: int  #: number of mesh periods
    recorded: int  #: number of the last mesh periods, which are recorded
    max_events: int  #: largest number of events in one mesh period


class Record(NamedTuple):
    """The end of a run and the tables of its recorded periods, with the columns of this module."""

    state: np.ndarray  #: z, shape (size,)
    final: np.ndarray  #: displacement and velocity, or all of z of a train
    period: int  #: mesh periods after which the motion repeats, 0: it does not
    samples: np.ndarray  #: shape (recorded * samples_per_period, 6 or more)
    events: np.ndarray  #: shape (k, 5 or 6)
    summary: np.ndarray  #: shape (9,), or (m, 10) of m meshes
    status: int
    evaluations: int = 0  #: number of evaluations of the right-hand side


class Rows(NamedTuple):
    """The rows that a sweep fills, one for each tuning."""

    bound: float  #: largest displacement of a bounded motion
    summaries: np.ndarray  #: summaries of `Record`
    ends: np.ndarray  #: final states
    codes: np.ndarray  #: period and status, shape (n, 2)


@kernel
def clear_summary(summary):
    """Set a summary, shape (9,), to that of an empty record."""
    summary[:] = 0.0
    summary[X_MAX] = -math.inf
    summary[X_MIN] = math.inf
    summary[FORCE_MAX] = -math.inf
    summary[FORCE_MIN] = math.inf


@uncounted
def unresolved(summary):
    """Return whether an extremum of the summary is NaN: it could not be isolated."""
    for k in range(FORCE_MIN + 1):
        if math.isnan(summary[k]):
            return True
    return False


@uncounted
def equal_steps(samples, column, length):
    """Fill a column of the samples with equal steps of phase over a period of a `length`."""
    for k in range(samples.shape[0]):
        samples[k, column] = length * k / samples.shape[0]


@kernel
def add_curve(curve, to_bernstein, work, summary, max_column, min_column):
    """Add the extrema of a polynomial on [0, 1] to two columns of the summary.

    `curve` has its power coefficients, which change sign; `to_bernstein` and `work` are as in
    `polynomial.highest`.
    """
    summary[max_column] = highest(curve, to_bernstein, work, summary[max_column])
    for k in range(curve.shape[0]):
        curve[k] = -curve[k]
    summary[min_column] = -highest(curve, to_bernstein, work, -summary[min_column])


@uncounted
def add_time(contact, length, low, summary):
    """Add a time with one contact code to the summary; `low`: at the lower mesh stiffness."""
    if contact == BACKLASH:
        summary[TIME_BACKLASH] += length
        summary[FORCE_MAX] = max(summary[FORCE_MAX], 0.0)
        summary[FORCE_MIN] = min(summary[FORCE_MIN], 0.0)
        return
    summary[TIME_NORMAL if contact == NORMAL else TIME_INVERSE] += length
    if low:
        summary[TIME_LOW] += length


@kernel
def count_event(events, rows, period, phase, contact_before, contact_after, velocity, summary):
    """Count a change of contact in the summary; append it to the event table unless that is empty.

    Returns (events, rows in use).
    """
    if contact_before == NORMAL:
        summary[BOUNCES] += 1.0
    if events.shape[0] > 0:
        events, rows = add_event(
            events, rows, period, phase, contact_before, contact_after, velocity
        )
    return events, rows


@kernel
def add_event(events, rows, period, phase, contact_before, contact_after, velocity):
    """Append an event to the table, enlarged as needed; return (events, rows in use)."""
    if rows == events.shape[0]:
        events = enlarged(events, 2 * rows + 16)
    events[rows, EVENT_PERIOD] = period
    events[rows, EVENT_PHASE] = phase
    events[rows, EVENT_FROM] = contact_before
    events[rows, EVENT_TO] = contact_after
    events[rows, EVENT_VELOCITY] = velocity
    return events, rows + 1


@kernel
def repeat_record(samples, events, rows, recorded, periods):
    """Repeat the samples and events of the first `recorded` mesh periods up to `periods`.

    Returns (events, rows in use), as `add_event`.
    """
    sample_count, event_count = samples.shape[0] // periods * recorded, rows
    for k in range(sample_count, samples.shape[0]):
        copy(samples[k - sample_count], samples[k])
    for n in range(recorded, periods, recorded):
        for i in range(event_count):
            phase, velocity = events[i, EVENT_PHASE], events[i, EVENT_VELOCITY]
            contact_before, contact_after = int(events[i, EVENT_FROM]), int(events[i, EVENT_TO])
            period = int(events[i, EVENT_PERIOD]) + n
            events, rows = add_event(
                events, rows, period, phase, contact_before, contact_after, velocity
            )
    return events, rows


@kernel
def strobe_periods(repeats):
    """Return the number of last mesh periods whose states `orbit_period` compares."""
    return 2 * MAX_PERIOD * repeats - 1


@kernel
def orbit_period(strobes, tuning, height, repeats=1):
    """Return the smallest number n of mesh periods after which the motion repeats, or 0.

    `strobes`, shape (k + 1, 2), has displacement and dx/dtau before the last k periods and at the
    end of each; `height` of the orbit is the scale. n is at most 16, or a multiple up to 16 of the
    `repeats` mesh periods of a run-out. Other n have to hold over a whole repeat, since a slow
    run-out changes little from one period to the next.
    """
    last = strobes.shape[0] - 1
    tolerance = SAME_STATE_TOLERANCE * max(1.0, height)
    for i in range(2 * MAX_PERIOD):
        n = i + 1 if i < MAX_PERIOD else (i + 1 - MAX_PERIOD) * repeats
        span = max(n, repeats)
        if last < n + span - 1:
            return 0
        same = True
        for j in range(span):
            dx = abs(strobes[last - j % n, 0] - strobes[last - j - n, 0])
            dv = abs(strobes[last - j % n, 1] - strobes[last - j - n, 1])
            if not (dx <= tolerance and tuning * dv <= tolerance):
                same = False
                break
        if same:
            return n
    return 0

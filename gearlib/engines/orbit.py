"""Records of an orbit: extrema, contact times, samples, events and period."""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import DRIVE, NO_CONTACT
from gearlib.engines.jit import inlined_without_refcounts, kernel, kernel_without_refcounts
from gearlib.engines.matrices import copy, enlarge_table
from gearlib.engines.polynomial import polynomial_maximum
from gearlib.engines.summary_columns import COLUMNS, COUNT, LARGEST, LEAST, SUM

# Columns of the summary of an orbit, declared in `summary_columns`.
SUMMARY_COLUMNS = len(COLUMNS)
(
    X_MAX,
    X_MIN,
    FORCE_MAX,
    FORCE_MIN,
    TIME_DRIVE,
    TIME_NO_CONTACT,
    TIME_COAST,
    TIME_LOW,
    BOUNCES,
    FORCE_SUM,
) = range(SUMMARY_COLUMNS)
#: Indices of the extrema, and of the columns that add up over time.
_EXTREMA = tuple(k for k in range(SUMMARY_COLUMNS) if COLUMNS[k].kind in (LARGEST, LEAST))
SUMS = tuple(k for k in range(SUMMARY_COLUMNS) if COLUMNS[k].kind in (SUM, COUNT))
#: Summary of an empty record.
_EMPTY_VALUES = {LARGEST: -math.inf, LEAST: math.inf, SUM: 0.0, COUNT: 0.0}
_EMPTY_SUMMARY = np.array([_EMPTY_VALUES[column.kind] for column in COLUMNS])

# Columns of the sample table and of the event table.
SAMPLE_X, SAMPLE_V, SAMPLE_A, SAMPLE_CONTACT, SAMPLE_STIFFNESS, SAMPLE_FORCE = range(6)
SAMPLE_COLUMNS = 6
#: A sample that is not filled yet holds its phase, since the start of the mesh period, here.
SAMPLE_PHASE = SAMPLE_X
EVENT_PERIOD, EVENT_PHASE, EVENT_FROM, EVENT_TO, EVENT_VELOCITY = range(5)
EVENT_COLUMNS = 5

#: Longest period of an orbit, in mesh periods, or in repeats of an excitation with run-out.
MAX_PERIOD = 16
#: Number of last mesh periods with recorded start states. Two periods of the longest orbit fit.
#: With run-out `strobe_periods` returns the number.
STROBE_PERIODS = 2 * MAX_PERIOD - 1
#: Largest distance of stroboscopic states that count as equal, as a fraction of the displacement
#: range or of the static deflection, if that is larger. It is far above rounding and not visible.
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
    summary: np.ndarray  #: shape (SUMMARY_COLUMNS,), of m meshes (m, SUMMARY_COLUMNS)
    status: int
    evaluations: int = 0  #: number of evaluations of the right-hand side


class Rows(NamedTuple):
    """Tables of a sweep with a row for each tuning, which the engines fill."""

    bound: float  #: largest displacement of a bounded motion
    summaries: np.ndarray  #: summaries of `Record`
    ends: np.ndarray  #: final states
    codes: np.ndarray  #: period and status, shape (n, 2)


@kernel
def is_within_range(x, v):
    """Return whether displacement x and velocity v are finite and small enough to be squared."""
    return math.fabs(x) < 1e150 and math.fabs(v) < 1e150


@kernel
def clear_summary(summary: np.ndarray) -> None:
    """Set the summary of a motion, shape (SUMMARY_COLUMNS,), to that of an empty record."""
    for k in range(SUMMARY_COLUMNS):
        summary[k] = _EMPTY_SUMMARY[k]


@kernel_without_refcounts
def has_unresolved_extremum(summary: np.ndarray) -> bool:
    """Return whether an extremum in the summary of a motion is NaN because it was not isolated."""
    for k in _EXTREMA:
        if math.isnan(summary[k]):
            return True
    return False


@kernel_without_refcounts
def fill_sample_phases(samples: np.ndarray, column: int, duration: float) -> None:
    """Fill a column of the k samples with equally spaced phases from 0 to below `duration`."""
    for k in range(samples.shape[0]):
        samples[k, column] = duration * k / samples.shape[0]


@kernel
def add_polynomial_extrema(coefficients, to_bernstein, work, summary, max_column, min_column):
    """Update the maximum and minimum columns of a summary by a polynomial on [0, 1].

    `coefficients` are its power coefficients, constant first; they change sign. `to_bernstein` is
    the matrix from power to Bernstein coefficients, `work` is storage, shape (WORK_ROWS, n + 2).
    """
    highest, lowest = summary[max_column], summary[min_column]
    summary[max_column] = polynomial_maximum(coefficients, to_bernstein, work, highest)
    for k in range(coefficients.shape[0]):
        coefficients[k] = -coefficients[k]
    summary[min_column] = -polynomial_maximum(coefficients, to_bernstein, work, -lowest)


@kernel_without_refcounts
def add_contact_time(contact_code, duration, below_mean, summary) -> None:
    """Add a duration with one contact code, and stiffness below its mean or not, to a summary."""
    if contact_code == NO_CONTACT:
        summary[TIME_NO_CONTACT] += duration
        summary[FORCE_MAX] = max(summary[FORCE_MAX], 0.0)
        summary[FORCE_MIN] = min(summary[FORCE_MIN], 0.0)
        return
    summary[TIME_DRIVE if contact_code == DRIVE else TIME_COAST] += duration
    if below_mean:
        summary[TIME_LOW] += duration


@kernel_without_refcounts
def count_event(code_before, code_after, velocity, summary) -> None:
    """Count a change of contact, from one code to another at the velocity dx/dtau, in a summary."""
    if code_before == DRIVE:
        summary[BOUNCES] += 1.0


@kernel
def record_event(events, event_count, period, phase, code_before, code_after, velocity, summary):
    """Count a change of contact in the summary; append it to the event table unless that is empty.

    Arguments and result are those of `add_event`.
    """
    count_event(code_before, code_after, velocity, summary)
    if events.shape[0] > 0:
        events, event_count = add_event(
            events, event_count, period, phase, code_before, code_after, velocity
        )
    return events, event_count


@kernel
def add_event(events, event_count, period, phase, code_before, code_after, velocity):
    """Append a change of contact to the event table, enlarged if full; return (table, event count).

    Contact codes change from `code_before` to `code_after` at the velocity dx/dtau, at a phase
    since the start of the mesh period with the number `period`.
    """
    if event_count == events.shape[0]:
        events = enlarge_table(events, 2 * event_count + 16)
    fill_event(events[event_count], period, phase, code_before, code_after, velocity)
    return events, event_count + 1


@inlined_without_refcounts
def fill_event(event, period, phase, code_before, code_after, velocity) -> None:
    """Fill the row `event` of an event table; arguments are those of `add_event`."""
    event[EVENT_PERIOD] = period
    event[EVENT_PHASE] = phase
    event[EVENT_FROM] = code_before
    event[EVENT_TO] = code_after
    event[EVENT_VELOCITY] = velocity


@kernel
def repeat_record(samples, events, event_count, recorded_periods, periods):
    """Repeat the samples and events of the first recorded mesh periods until all periods are full.

    The sample table covers all periods; the event table is enlarged if needed. Returns (event
    table, event count).
    """
    sample_count = samples.shape[0] // periods * recorded_periods
    recorded_events = event_count
    for k in range(sample_count, samples.shape[0]):
        copy(samples[k - sample_count], samples[k])
    for passed_periods in range(recorded_periods, periods, recorded_periods):
        for i in range(recorded_events):
            phase, velocity = events[i, EVENT_PHASE], events[i, EVENT_VELOCITY]
            code_before, code_after = int(events[i, EVENT_FROM]), int(events[i, EVENT_TO])
            period = int(events[i, EVENT_PERIOD]) + passed_periods
            events, event_count = add_event(
                events, event_count, period, phase, code_before, code_after, velocity
            )
    return events, event_count


@kernel
def strobe_periods(repeats: int) -> int:
    """Return the number of last mesh periods whose start states `orbit_period` compares.

    The excitation repeats after `repeats` mesh periods.
    """
    return 2 * MAX_PERIOD * repeats - 1


@kernel
def orbit_period(strobes, tuning, displacement_range, repeats=1):
    """Return the smallest number n of mesh periods after which the motion repeats, or 0.

    `strobes`, shape (k + 1, 2), has displacement and dx/dtau at the bounds of the last k periods;
    the largest minus the smallest displacement, `displacement_range`, scales the tolerance. n is at
    most 16, or 16 times the mesh periods after which the excitation `repeats`. The motion has to
    repeat over at least these, since a slow run-out changes little from one period to the next.
    """
    last = strobes.shape[0] - 1
    tolerance = SAME_STATE_TOLERANCE * max(1.0, displacement_range)
    for i in range(2 * MAX_PERIOD):
        n = i + 1 if i < MAX_PERIOD else (i + 1 - MAX_PERIOD) * repeats
        span = max(n, repeats)
        if last < n + span - 1:
            return 0
        is_equal = True
        for j in range(span):
            dx = abs(strobes[last - j % n, 0] - strobes[last - j - n, 0])
            dv = abs(strobes[last - j % n, 1] - strobes[last - j - n, 1])
            if not (dx <= tolerance and tuning * dv <= tolerance):
                is_equal = False
                break
        if is_equal:
            return n
    return 0

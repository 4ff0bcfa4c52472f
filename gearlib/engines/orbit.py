"""Record of an orbit: extrema, contact times, samples, events and period."""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.matrices import enlarge_table
from gearlib.engines.polynomial import polynomial_maximum
from gearlib.engines.summary_columns import COLUMNS, COUNT, LARGEST, LEAST, SUM

# Columns of the summary of an orbit, which `summary_columns` declares.
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
#: Indices of the columns with extrema, and of the columns with sums over time.
_EXTREMA = tuple(k for k in range(SUMMARY_COLUMNS) if COLUMNS[k].kind in (LARGEST, LEAST))
SUMS = tuple(k for k in range(SUMMARY_COLUMNS) if COLUMNS[k].kind in (SUM, COUNT))
#: Initial values of all columns.
_EMPTY_VALUES = {LARGEST: -math.inf, LEAST: math.inf, SUM: 0.0, COUNT: 0.0}
_EMPTY_SUMMARY = np.array([_EMPTY_VALUES[column.kind] for column in COLUMNS])

# Columns of the sample table and of the event table.
SAMPLE_X, SAMPLE_V, SAMPLE_A, SAMPLE_CONTACT, SAMPLE_STIFFNESS, SAMPLE_FORCE = range(6)
SAMPLE_COLUMNS = 6
#: Until a sample is filled, this column holds its phase since the start of the mesh period.
SAMPLE_PHASE = SAMPLE_X
EVENT_PERIOD, EVENT_PHASE, EVENT_FROM, EVENT_TO, EVENT_VELOCITY = range(5)
EVENT_COLUMNS = 5

#: Longest period of an orbit, in mesh periods, or in repeats of an excitation with run-out.
MAX_PERIOD = 16
#: Number of mesh periods at the end of a run whose initial states are stored: two periods of the
#: longest orbit, less one. With run-out, `stored_state_count` returns the number.
STROBE_PERIODS = 2 * MAX_PERIOD - 1
#: Largest distance between stroboscopic states that count as equal, relative to the displacement
#: range or the static deflection, if that is larger. It is far above rounding and not visible.
SAME_STATE_TOLERANCE = 1e-6


class Span(NamedTuple):
    """The length of a run."""

    periods: int  #: number of mesh periods
    recorded: int  #: number of recorded mesh periods, at the end of the run
    max_events: int  #: largest number of events per mesh period


class Record(NamedTuple):
    """End of a run and tables of its recorded periods, with the columns of this module."""

    state: np.ndarray  #: z, shape (size,)
    final: np.ndarray  #: final displacement and velocity, or the whole state z of a train
    period: int  #: mesh periods after which the motion repeats, or 0
    samples: np.ndarray  #: shape (recorded * samples_per_period, 6 or more)
    events: np.ndarray  #: shape (k, 5 or 6)
    summary: np.ndarray  #: shape (SUMMARY_COLUMNS,), or (m, SUMMARY_COLUMNS) for a train
    status: int  #: status of the run, see `codes`
    evaluations: int = 0  #: number of evaluations of the right-hand side


class SweepTables(NamedTuple):
    """Result tables of a sweep with one row for each of n tunings."""

    max_displacement: float  #: largest displacement that counts as bounded, in static deflections
    summaries: np.ndarray  #: `Record.summary` of each run
    final_states: np.ndarray  #: `Record.final` of each run
    outcomes: np.ndarray  #: int, period and status of each run, shape (n, 2)


@kernel_part
def is_within_range(x, v):
    """Return whether displacement x and velocity v are finite and small enough to be squared."""
    return math.fabs(x) < 1e150 and math.fabs(v) < 1e150


@kernel_part
def clear_summary(summary: np.ndarray) -> None:
    """Reset the summary of a motion, shape (SUMMARY_COLUMNS,), to its initial values.

    Maxima become -inf, minima inf, times and counts 0.
    """
    for k in range(SUMMARY_COLUMNS):
        summary[k] = _EMPTY_SUMMARY[k]


@kernel_part(refcounts=False)
def has_unresolved_extremum(summary: np.ndarray) -> bool:
    """Return whether a maximum or minimum in the summary of a motion is NaN.

    NaN means that the search for this extremum needed too many intervals.
    """
    for k in _EXTREMA:
        if math.isnan(summary[k]):
            return True
    return False


@kernel_part(refcounts=False)
def fill_sample_phases(samples: np.ndarray, column: int, duration: float) -> None:
    """Fill a column of the sample table with equally spaced phases in [0, duration)."""
    for k in range(samples.shape[0]):
        samples[k, column] = duration * k / samples.shape[0]


@kernel_part
def add_polynomial_extrema(coefficients, to_bernstein, workspace, summary, max_column, min_column):
    """Update a maximum and a minimum of a summary with the extrema of a polynomial on [0, 1].

    `coefficients` are its n + 1 power coefficients, constant first; they are negated in place.
    `max_column` and `min_column` are columns of the summary. `to_bernstein` is the
    `bernstein_matrix` of degree n, which converts power to Bernstein coefficients, and `workspace`,
    shape (WORKSPACE_ROWS, n + 2), is overwritten.
    """
    old_max, old_min = summary[max_column], summary[min_column]
    summary[max_column] = polynomial_maximum(coefficients, to_bernstein, workspace, old_max)
    # A minimum is minus the maximum of the polynomial with the opposite sign.
    for k in range(coefficients.shape[0]):
        coefficients[k] = -coefficients[k]
    summary[min_column] = -polynomial_maximum(coefficients, to_bernstein, workspace, -old_min)


@kernel_part(refcounts=False)
def add_contact_time(contact_state, duration, below_mean, summary) -> None:
    """Add the duration of an arc, the motion between two contact changes, to a summary.

    `contact_state` is DRIVE, NO_CONTACT or COAST; `duration` is the length of the arc in mesh
    phase; `below_mean` tells whether the stiffness is below its mean. Without contact the mesh
    force is zero, which also updates the extrema of the force.
    """
    if contact_state == NO_CONTACT:
        summary[TIME_NO_CONTACT] += duration
        summary[FORCE_MAX] = max(summary[FORCE_MAX], 0.0)
        summary[FORCE_MIN] = min(summary[FORCE_MIN], 0.0)
        return
    summary[TIME_DRIVE if contact_state == DRIVE else TIME_COAST] += duration
    if below_mean:
        summary[TIME_LOW] += duration


@kernel_part(refcounts=False)
def count_event(contact_before, contact_after, velocity, summary) -> None:
    """Count a change of contact in a summary if it is a loss of drive-side contact.

    The contact state changes from `contact_before` to `contact_after` (DRIVE, NO_CONTACT or COAST)
    at the velocity dx/dtau. Only `contact_before` has an effect.
    """
    if contact_before == DRIVE:
        summary[BOUNCES] += 1.0


@kernel_part
def record_event(
    events, event_count, period, phase, contact_before, contact_after, velocity, summary
):
    """Count a change of contact in the summary and append it to the event table.

    Returns (event table, event count). The contact state changes from `contact_before` to
    `contact_after` at the velocity dx/dtau and at a `phase` of the mesh period number `period`. The
    first `event_count` rows of `events` are in use; a table without rows stays empty.
    """
    count_event(contact_before, contact_after, velocity, summary)
    if events.shape[0] > 0:
        events, event_count = add_event(
            events, event_count, period, phase, contact_before, contact_after, velocity
        )
    return events, event_count


@kernel_part
def add_event(events, event_count, period, phase, contact_before, contact_after, velocity):
    """Append a change of contact to an event table; return (event table, event count).

    The first `event_count` rows of the table `events` are in use; a full table is enlarged. The
    contact state changes from `contact_before` to `contact_after` (DRIVE, NO_CONTACT or COAST) at
    the velocity dx/dtau, in the mesh period number `period`, at a `phase` since the start of this
    period.
    """
    if event_count == events.shape[0]:
        events = enlarge_table(events, 2 * event_count + 16)
    fill_event(events[event_count], period, phase, contact_before, contact_after, velocity)
    return events, event_count + 1


@kernel_part(refcounts=False, inlined=True)
def fill_event(event, period, phase, contact_before, contact_after, velocity) -> None:
    """Fill `event`, a row of an event table, with a change of contact.

    The contact state changes from `contact_before` to `contact_after` at the velocity dx/dtau, in
    the mesh period number `period`, at a `phase` since its start.
    """
    event[EVENT_PERIOD] = period
    event[EVENT_PHASE] = phase
    event[EVENT_FROM] = contact_before
    event[EVENT_TO] = contact_after
    event[EVENT_VELOCITY] = velocity


def repeat_record(samples, events, recorded_periods, periods):
    """Repeat the record of the first `recorded_periods` up to `periods` mesh periods.

    The motion must be known to repeat, and `periods` is a multiple of `recorded_periods`. `samples`
    has rows for all periods, of which the later ones are filled; `events` has the events of the
    recorded periods. Returns the event table of all periods.
    """
    repeats = periods // recorded_periods
    repeated_samples = samples.reshape(repeats, len(samples) // repeats, samples.shape[1])
    repeated_samples[1:] = repeated_samples[0]
    all_events = np.tile(events, (repeats, 1))
    all_events[:, EVENT_PERIOD] += np.repeat(np.arange(repeats) * recorded_periods, len(events))
    return all_events


@kernel_part
def stored_state_count(excitation_period: int) -> int:
    """Return the number of mesh periods at the end of a run whose initial states are stored.

    `orbit_period` compares these states to find the period of the motion. The excitation repeats
    after `excitation_period` mesh periods.
    """
    return 2 * MAX_PERIOD * excitation_period - 1


@kernel
def orbit_period(strobe_states, tuning, displacement_range, excitation_period=1):
    """Return the smallest number n of mesh periods after which the motion repeats, or 0.

    `strobe_states`, shape (k + 1, 2), has displacement and dx/dtau at the bounds of the last k
    periods. States count as equal within a tolerance, which `displacement_range`, the largest minus
    the smallest displacement, scales; `tuning` scales dx/dtau. The excitation repeats after
    `excitation_period` mesh periods; n is at most 16, or a multiple of `excitation_period` up to 16
    times as large. The states have to repeat over at least `excitation_period` mesh periods,
    because a slow run-out changes little from one mesh period to the next.
    """
    last_row = strobe_states.shape[0] - 1
    tolerance = SAME_STATE_TOLERANCE * max(1.0, displacement_range)
    for i in range(2 * MAX_PERIOD):
        # Try 1 to 16 mesh periods first, then 1 to 16 excitation periods.
        n = i + 1 if i < MAX_PERIOD else (i + 1 - MAX_PERIOD) * excitation_period
        span = max(n, excitation_period)
        # The number of stored states is too small.
        if last_row < n + span - 1:
            return 0
        is_equal = True
        for j in range(span):
            dx = abs(strobe_states[last_row - j % n, 0] - strobe_states[last_row - j - n, 0])
            dv = abs(strobe_states[last_row - j % n, 1] - strobe_states[last_row - j - n, 1])
            if not (dx <= tolerance and tuning * dv <= tolerance):
                is_equal = False
                break
        if is_equal:
            return n
    return 0

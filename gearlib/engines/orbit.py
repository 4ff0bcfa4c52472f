"""What is recorded of an orbit: extrema, fractions, samples, events, period."""

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
#: Where it stands, from the begin of the mesh period on, at which phase a sample is wanted.
SAMPLE_AT = SAMPLE_X
EVENT_PERIOD, EVENT_PHASE, EVENT_FROM, EVENT_TO, EVENT_VELOCITY = range(5)
EVENT_COLUMNS = 5

#: Longest orbit that is looked for, in mesh periods; with run-out also in repeats of it.
MAX_PERIOD = 16
#: Mesh periods before the end whose states are kept, to compare two spans of the longest orbit;
#: with run-out `strobe_periods`.
STROBE_PERIODS = 2 * MAX_PERIOD - 1
#: Stroboscopic states this close, in units of the orbit's height (or of the static deflection if
#: that is larger), are the same: far above the rounding of a run, far below a visible difference.
SAME_STATE = 1e-6


class Span(NamedTuple):
    """The length of a run."""

    periods: int  #: mesh periods
    recorded: int  #: the last ones of them
    max_events: int  #: in one of them


class Record(NamedTuple):
    """The end of a run and the tables of its recorded periods, with the columns of this module."""

    state: np.ndarray  #: z, shape (size,)
    final: np.ndarray  #: displacement and velocity, or all of z of a train
    period: int  #: mesh periods after which the recorded motion repeats; 0: it does not
    samples: np.ndarray  #: shape (recorded * samples_per_period, 6 or more)
    events: np.ndarray  #: shape (k, 5 or 6)
    summary: np.ndarray  #: shape (9,), or (m, 10) of m meshes
    status: int
    evaluations: int = 0  #: of the right-hand side


class Rows(NamedTuple):
    """The rows that a sweep fills, one for each tuning."""

    bound: float  #: displacement beyond which a motion grows without bound
    summaries: np.ndarray  #: those of `Record`
    ends: np.ndarray  #: final states
    codes: np.ndarray  #: period and status, shape (n, 2)


@kernel
def clear_summary(summary):
    """Prepare a summary, shape (9,), for `add_arcs`."""
    summary[:] = 0.0
    summary[X_MAX] = -math.inf
    summary[X_MIN] = math.inf
    summary[FORCE_MAX] = -math.inf
    summary[FORCE_MIN] = math.inf


@uncounted
def unresolved(summary):
    """Return whether an extremum could not be found."""
    for k in range(FORCE_MIN + 1):
        if math.isnan(summary[k]):
            return True
    return False


@uncounted
def equal_steps(samples, column, whole):
    """Fill a column of samples with the phases of equal steps of a period of length `whole`."""
    for k in range(samples.shape[0]):
        samples[k, column] = whole * k / samples.shape[0]


@kernel
def add_curve(curve, to_bernstein, work, summary, most, least):
    """Add the extrema of a polynomial on [0, 1] to two columns of the summary.

    Arguments as of `gearlib.engines.polynomial.highest`; `curve` is negated.
    """
    summary[most] = highest(curve, to_bernstein, work, summary[most])
    for k in range(curve.shape[0]):
        curve[k] = -curve[k]
    summary[least] = -highest(curve, to_bernstein, work, -summary[least])


@uncounted
def add_time(contact, length, low, summary):
    """Add a stretch of one contact code to the summary, `low`: at the lower stiffness."""
    if contact == BACKLASH:
        summary[TIME_BACKLASH] += length
        summary[FORCE_MAX] = max(summary[FORCE_MAX], 0.0)
        summary[FORCE_MIN] = min(summary[FORCE_MIN], 0.0)
        return
    summary[TIME_NORMAL if contact == NORMAL else TIME_INVERSE] += length
    if low:
        summary[TIME_LOW] += length


@kernel
def note(events, found, period, phase, before, after, velocity, summary):
    """Count a change of contact and append it to the event table, if one is wanted."""
    if before == NORMAL:
        summary[BOUNCES] += 1.0
    if events.shape[0] > 0:
        events, found = add_event(events, found, period, phase, before, after, velocity)
    return events, found


@kernel
def add_event(events, found, period, phase, before, after, velocity):
    """Append one event to the table, enlarged as needed; return (events, rows in use)."""
    if found == events.shape[0]:
        events = enlarged(events, 2 * found + 16)
    events[found, EVENT_PERIOD] = period
    events[found, EVENT_PHASE] = phase
    events[found, EVENT_FROM] = before
    events[found, EVENT_TO] = after
    events[found, EVENT_VELOCITY] = velocity
    return events, found + 1


@kernel
def repeat_record(samples, events, found, seen, periods):
    """Repeat the samples and events of the first `seen` of so many periods up to their end.

    Returns (events, found) as `add_event`.
    """
    rows, first = samples.shape[0] // periods * seen, found
    for k in range(rows, samples.shape[0]):
        copy(samples[k - rows], samples[k])
    for n in range(seen, periods, seen):
        for i in range(first):
            phase, velocity = events[i, EVENT_PHASE], events[i, EVENT_VELOCITY]
            before, after = int(events[i, EVENT_FROM]), int(events[i, EVENT_TO])
            period = int(events[i, EVENT_PERIOD]) + n
            events, found = add_event(events, found, period, phase, before, after, velocity)
    return events, found


@kernel
def strobe_periods(repeats):
    """Return how many periods before the end `orbit_period` looks at."""
    return 2 * MAX_PERIOD * repeats - 1


@kernel
def orbit_period(strobes, tuning, height, repeats=1):
    """Return the least n such that the last n stroboscopic states repeat after n periods, or 0.

    n is at most 16 mesh periods, or a multiple, up to the 16th, of the `repeats` mesh periods after
    which a run-out repeats. An n that is none has to hold all through a repeat, since a slow run-
    out moves little from a period to the next. `strobes`, shape (k + 1, 2): displacement and
    dx/dtau at the end of each of the last k periods, and before them; `height` of the orbit is the
    scale.
    """
    last = strobes.shape[0] - 1
    tolerance = SAME_STATE * max(1.0, height)
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

"""A whole run: its periods gone through fast, those at its end recorded."""

import numpy as np

from gearlib.core import orbit
from gearlib.core.jit import kernel
from gearlib.core.march import ARC_COLUMNS, march, march_period, within_range
from gearlib.core.mesh import contact_of
from gearlib.core.transit import transit

OK, EVENT_LIMIT, OVERFLOW, NOT_CONVERGED, STALLED, JAMMED, UNRESOLVED = range(7)

_FIRST_ARCS = 32


@kernel
def skipped(periods, record_periods):
    """Return how many periods of a run come before those whose states are kept."""
    return max(0, periods - max(record_periods, orbit.STROBE_PERIODS))


@kernel
def skip(m, contact, x, v, periods, limit, no_arcs):
    """Go through `periods` > 0 mesh periods from the middle of a C_max stretch, unrecorded."""
    contact, x, v, count = march(m, 1, 0.0, m.half_high, contact, x, v, no_arcs, 0, limit)
    if count > limit:
        return contact, x, v, EVENT_LIMIT
    stretches = 2 * periods - 1
    contact, x, v, done, count, _, _ = transit(m, contact, x, v, stretches, limit, no_arcs)
    if count > limit:
        return contact, x, v, EVENT_LIMIT
    if done < stretches:
        return contact, x, v, OVERFLOW
    contact, x, v, count = march(m, 1, 0.0, m.half_high, contact, x, v, no_arcs, 0, limit)
    return contact, x, v, (EVENT_LIMIT if count > limit else OK)


@kernel
def run(m, x, v, periods, record_periods, samples, events, limit, summary):
    """Run one mesh from the state (x, v) at tau = 0.

    Parameters
    ----------
    m : Mesh
    x, v : float
        Displacement in static deflections and dx/dtau at tau = 0.
    periods, record_periods : int
        Mesh periods of the run; of its end that is recorded.
    samples : ndarray, shape (record_periods * n, 6)
        Filled with n equal steps per recorded period; n = 0 for none.
    events : ndarray, shape (k, 5)
        Buffer of the event table, enlarged as needed; k = 0 for no table.
    limit : int
        Most arcs in one mesh period.
    summary : ndarray, shape (9,)
        Filled with the summary of the recorded periods.

    Returns
    -------
    x, v : float
        State at the end.
    period : int
        Period of the orbit in mesh periods, 0 if none was found.
    events : ndarray
        The table, perhaps enlarged.
    found : int
        Rows of it in use.
    status : int
        OK, EVENT_LIMIT or OVERFLOW.
    """
    contact = contact_of(m.gap, x, v)
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW
    unrecorded = skipped(periods, record_periods)
    if unrecorded > 0:
        no_arcs = np.empty((0, ARC_COLUMNS))
        contact, x, v, status = skip(m, contact, x, v, unrecorded, limit, no_arcs)
        if status != OK:
            return x, v, 0, events, 0, status
    return record(m, contact, x, v, periods, record_periods, samples, events, limit, summary)


@kernel
def record(m, contact, x, v, periods, record_periods, samples, events, limit, summary):
    """Go through the periods that `skipped` leaves of a run; arguments and returns as of `run`."""
    orbit.clear_summary(summary)
    strobe_periods = periods - skipped(periods, record_periods)
    kept = min(strobe_periods, orbit.STROBE_PERIODS)
    strobes = np.empty((kept + 1, 2))
    want_events = events.shape[0] > 0
    per_period = samples.shape[0] // record_periods
    found = 0
    arcs = np.empty((_FIRST_ARCS, ARC_COLUMNS))
    no_arcs = arcs[:0]
    previous = contact
    for i in range(strobe_periods):
        n = periods - strobe_periods + i
        row = i - (strobe_periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        recorded = n - (periods - record_periods)
        before = contact, x, v
        buffer = arcs if recorded >= 0 else no_arcs
        contact, x, v, count = march_period(m, contact, x, v, buffer, limit)
        if count > limit:
            return x, v, 0, events, 0, EVENT_LIMIT
        if not within_range(x, v):
            return x, v, 0, events, 0, OVERFLOW
        if recorded < 0:
            previous = contact
            continue
        if count > arcs.shape[0]:
            arcs = np.empty((2 * count, ARC_COLUMNS))
            contact, x, v = before
            contact, x, v, count = march_period(m, contact, x, v, arcs, limit)
        orbit.add_arcs(m, arcs, count, summary)
        bounces, last = orbit.count_bounces(arcs, count, previous)
        summary[orbit.BOUNCES] += bounces
        if want_events:
            events, found, _ = orbit.add_events(arcs, count, previous, n, events, found)
        if per_period > 0:
            orbit.sample_arcs(
                m, arcs, count, samples[recorded * per_period : (recorded + 1) * per_period]
            )
        previous = last
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return x, v, orbit.orbit_period(strobes, m.tuning, height), events, found, OK

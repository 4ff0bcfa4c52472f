"""Runs over many tunings and initial states; states of many orbits at a phase of every period."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW
from gearlib.engines.jit import kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair import recorded_arcs
from gearlib.engines.pair.events import ARC_COLUMNS, START
from gearlib.engines.pair.motion import contact_of, mesh
from gearlib.engines.pair.pair_run import outcome, run_at, skip, whole_period
from gearlib.engines.pair.whole_periods import new_work, set_mesh, set_start


@kernel
def run_many(
    ratios,
    tunings,
    order,
    state,
    carry,
    periods,
    record_periods,
    limit,
    bound,
    summaries,
    ends,
    codes,
):
    """Run the tunings ``tunings[order]``; arguments otherwise as of `run` and `mesh`.

    Each starts from `state`, shape (2,), or with `carry` from the end of the one before it (after a
    failed one: from `state`). A displacement beyond `bound` is an OVERFLOW. Fills for every tuning
    `summaries`, shape (n, 9), the final states `ends`, shape (n, 2), period and status in `codes`,
    shape (n, 2).
    """
    samples = np.empty((0, orbit.SAMPLE_COLUMNS))
    events = np.empty((0, orbit.EVENT_COLUMNS))
    work = new_work()
    x, v = state[0], state[1]
    for i in order:
        m = mesh(ratios, tunings[i])
        set_mesh(work, m)
        x, v, period, _, _, status = run_at(
            m, work, x, v, periods, record_periods, samples, events, limit, summaries[i]
        )
        if status == OK and max(summaries[i, orbit.X_MAX], -summaries[i, orbit.X_MIN]) > bound:
            status = OVERFLOW
        if status != OK:
            summaries[i, :] = math.nan
            ends[i, :] = math.nan
        else:
            ends[i, 0], ends[i, 1] = x, v
        if status != OK or not carry:
            x, v = state[0], state[1]
        codes[i, 0], codes[i, 1] = period, status


@kernel
def skip_many(m, states, periods, limit, ends, statuses):
    """Take `states`, shape (k, 2), through `periods` mesh periods from tau = 0, unrecorded.

    Fills `ends`, shape (k, 2), and `statuses`, shape (k,); a period has `limit` arcs at most.
    """
    work = new_work()
    set_mesh(work, m)
    for i in range(states.shape[0]):
        x, v = states[i, 0], states[i, 1]
        status = OVERFLOW
        if within_range(x, v):
            set_start(work, x, v)
            _, x, v, status, _, _ = skip(m, work, contact_of(m.gap, x, v), x, v, periods, limit)
        ends[i, 0], ends[i, 1], statuses[i] = x, v, status


@kernel
def section(m, states, settle, phase, limit, table, ends, statuses):
    """Fill `table`, shape (n, periods, 2), with states of n orbits at a phase of every period.

    The orbits start in `states`, shape (n, 2), at tau = 0 and run `settle` periods before; `phase`
    is in [0, 2 pi). Fills the states after all periods, `ends`, shape (n, 2), and `statuses`, shape
    (n,); what a run that could not go on has not reached stays as it was.
    """
    work = new_work()
    set_mesh(work, m)
    for j in range(states.shape[0]):
        ends[j, 0], ends[j, 1], statuses[j] = _section_of(
            m, work, states[j, 0], states[j, 1], settle, phase, limit, table[j]
        )


@kernel
def _section_of(m, work, x, v, settle, phase, limit, table):
    if not within_range(x, v):
        return x, v, OVERFLOW
    set_start(work, x, v)
    contact = contact_of(m.gap, x, v)
    contact, x, v, status, _, _ = skip(m, work, contact, x, v, settle, limit)
    arcs = np.empty((16, ARC_COLUMNS))
    for row in range(table.shape[0]):
        if status != OK:
            break
        contact, x, v, count, arcs = whole_period(m, work, settle + row, contact, x, v, limit, arcs)
        status = outcome(x, v, count, limit)
        if status == EVENT_LIMIT:
            break
        i = 0
        while i + 1 < count and arcs[i + 1, START] <= phase:
            i += 1
        table[row, 0], table[row, 1], _, _ = recorded_arcs.in_arc(m, arcs[i], phase)
    return x, v, status

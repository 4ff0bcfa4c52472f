"""Runs over many tunings, and over many initial states."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import OK, OVERFLOW
from gearlib.engines.jit import kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.motion import contact_of, mesh
from gearlib.engines.pair.pair_run import run_at, skip
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

"""Sections: the states of many orbits at one mesh phase of every period."""

import numpy as np

from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW
from gearlib.engines.jit import kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair import recorded_arcs
from gearlib.engines.pair.events import ARC_COLUMNS, START
from gearlib.engines.pair.motion import contact_of
from gearlib.engines.pair.pair_run import outcome, skip, whole_period
from gearlib.engines.pair.whole_periods import new_work, set_mesh, set_start


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
        ends[j, 0], ends[j, 1], statuses[j] = _one(
            m, work, states[j, 0], states[j, 1], settle, phase, limit, table[j]
        )


@kernel
def _one(m, work, x, v, settle, phase, limit, table):
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

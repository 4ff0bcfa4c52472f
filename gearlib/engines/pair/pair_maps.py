"""Growth of small deviations over mesh periods, by the maps of phases and crossings."""

import numpy as np

from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW
from gearlib.engines.jit import kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.deviation import follow_arcs
from gearlib.engines.pair.event_by_event import ARC_COLUMNS, march_period
from gearlib.engines.pair.mesh_constants import contact_of


@kernel
def vary(m, x, v, periods, limit, matrices):
    """Go through mesh periods from (x, v) at tau = 0; return (x, v, status).

    Fills `matrices`, shape (periods, 2, 2), with the derivative of the state at the end of each
    period by that at its start.
    """
    arcs = np.empty((64, ARC_COLUMNS))
    contact = contact_of(m.gap, x, v)
    previous = contact
    for i in range(periods):
        before = contact, x, v
        contact, x, v, count = march_period(m, contact, x, v, arcs, limit)
        if count > limit:
            return x, v, EVENT_LIMIT
        if count > arcs.shape[0]:
            arcs = np.empty((2 * count, ARC_COLUMNS))
            contact, x, v = before
            contact, x, v, count = march_period(m, contact, x, v, arcs, limit)
        if not within_range(x, v):
            return x, v, OVERFLOW
        matrices[i, 0, 0] = matrices[i, 1, 1] = 1.0
        matrices[i, 0, 1] = matrices[i, 1, 0] = 0.0
        previous = follow_arcs(m, arcs, count, previous, matrices[i])
    return x, v, OK

"""Sections: the states of many orbits at one mesh phase of every period."""

import numpy as np

from gearlib.core.jit import kernel
from gearlib.core.march import ARC_COLUMNS, march, within_range
from gearlib.core.mesh import contact_of
from gearlib.core.run import EVENT_LIMIT, OK, OVERFLOW, skip


@kernel
def section(m, states, settle, phase, limit, table, ends, statuses):
    """Fill the section of every orbit.

    Parameters
    ----------
    m : Mesh
    states : ndarray, shape (n, 2)
        Displacement and velocity at tau = 0.
    settle : int
        Mesh periods before the section begins.
    phase : float
        Mesh phase of the section, 0 <= phase < 2 pi.
    limit : int
        Most arcs in one stretch.
    table : ndarray, shape (n, periods, 2)
        Filled with the states; what a run that could not go on has not reached stays as it was.
    ends : ndarray, shape (n, 2)
        States after all periods.
    statuses : ndarray of int, shape (n,)
    """
    for j in range(states.shape[0]):
        ends[j, 0], ends[j, 1], statuses[j] = _one(
            m, states[j, 0], states[j, 1], settle, phase, limit, table[j]
        )


@kernel
def _one(m, x, v, settle, phase, limit, table):
    no_arcs = np.empty((0, ARC_COLUMNS))
    contact = contact_of(m.gap, x, v)
    if not within_range(x, v):
        return x, v, OVERFLOW
    if settle > 0:
        contact, x, v, status = skip(m, contact, x, v, settle, limit, no_arcs)
        if status != OK:
            return x, v, status
    for row in range(table.shape[0]):
        start = 0.0
        for stretch in range(3):
            which = 0 if stretch == 1 else 1
            length = m.whole_low if stretch == 1 else m.half_high
            # The last stretch takes what rounding of the phase leaves behind its end.
            inside = phase < start + length or stretch == 2
            cut = phase - start if start <= phase and inside else length
            contact, x, v, count = march(
                m, which, 0.0, min(cut, length), contact, x, v, no_arcs, 0, limit
            )
            if count > limit:
                return x, v, EVENT_LIMIT
            if start <= phase and inside:
                table[row, 0], table[row, 1] = x, v
                contact, x, v, count = march(
                    m, which, 0.0, length - cut, contact, x, v, no_arcs, 0, limit
                )
                if count > limit:
                    return x, v, EVENT_LIMIT
            start += length
        if not within_range(x, v):
            return x, v, OVERFLOW
    return x, v, OK

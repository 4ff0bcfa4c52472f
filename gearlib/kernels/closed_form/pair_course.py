"""A run through segments of any length, as a speed that changes makes them: all of it recorded."""

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.closed_form import recorded_arcs
from gearlib.kernels.closed_form.event_by_event import (
    ARC_COLUMNS,
    CONTACT,
    DISPLACEMENT,
    DURATION,
    LEVEL,
    VELOCITY,
    march,
)
from gearlib.kernels.closed_form.mesh_constants import contact_of
from gearlib.kernels.closed_form.pair_run import FIRST_ARCS, outcome
from gearlib.kernels.codes import BACKLASH, OK, OVERFLOW
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.overflow import within_range


@inlined
def _integral(m, arcs, count, x, v):
    """Return the integral of the elastic force over arcs that end in (x, v).

    In contact it is that of 1 / nu^2 - x'' - 2 a x'.
    """
    total = 0.0
    for i in range(count):
        if arcs[i, CONTACT] == BACKLASH:
            continue
        end, speed = x, v
        if i + 1 < count:
            end, speed = arcs[i + 1, DISPLACEMENT], arcs[i + 1, VELOCITY]
        a = m.high.a if arcs[i, LEVEL] == 1.0 else m.low.a
        total += m.pull * arcs[i, DURATION]
        total -= speed - arcs[i, VELOCITY] + 2.0 * a * (end - arcs[i, DISPLACEMENT])
    return total


@kernel
def run_course(m, begin, length, level, first, block, taken, x, v, samples, events, limit, summary):
    """Run one mesh from the state (x, v) through k intervals.

    Parameters
    ----------
    m : Mesh
    begin, length : ndarray, shape (p,)
        Of the segments: from the begin of their interval on.
    level : ndarray of int, shape (p,)
        Of their stiffness, 0 C_min, 1 C_max.
    first, block : ndarray of int, shapes (k + 1,), (k,)
        Segments with which intervals begin; rows of the summary.
    taken : ndarray of int, shape (k + 1,)
        Samples with which intervals begin.
    x, v : float
    samples : ndarray, shape (j, 6)
        As of `recorded_arcs.sample_arcs`.
    events : ndarray, shape (j, 5)
        Enlarged as needed.
    limit : int
        Most arcs in an interval.
    summary : ndarray, shape (b, 10)
        As of `orbit`, and the integral of the force.

    Returns
    -------
    (x, v, events, found, status) as of `pair_run.run`.
    """
    for row in range(summary.shape[0]):
        orbit.clear_summary(summary[row])
    count, found = block.shape[0], 0
    if not within_range(x, v):
        return x, v, events, found, OVERFLOW
    contact = contact_of(m.gap, x, v)
    previous = contact
    arcs = np.empty((FIRST_ARCS, ARC_COLUMNS))
    for n in range(count):
        before, used = (contact, x, v), limit + 1
        while True:
            contact, x, v = before
            used = 0
            for p in range(first[n], first[n + 1]):
                contact, x, v, used = march(
                    m, level[p], begin[p], length[p], contact, x, v, arcs, used, limit
                )
                if used > limit:
                    break
            if not arcs.shape[0] < used <= limit:
                break
            arcs = np.empty((2 * used, ARC_COLUMNS))
        status = outcome(x, v, used, limit)
        if status != OK:
            return x, v, events, found, status
        own = summary[block[n]]
        recorded_arcs.add_arcs(m, arcs, used, own)
        own[orbit.SUMMARY_COLUMNS] += _integral(m, arcs, used, x, v)
        bounces, last = recorded_arcs.count_bounces(arcs, used, previous)
        own[orbit.BOUNCES] += bounces
        events, found, _ = recorded_arcs.add_events(arcs, used, previous, n, events, found)
        recorded_arcs.sample_arcs(m, arcs, used, samples[taken[n] : taken[n + 1]])
        previous = last
    return x, v, events, found, OK

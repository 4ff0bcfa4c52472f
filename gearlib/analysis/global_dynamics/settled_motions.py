"""Which motions of a bifurcation diagram rounding has no part in."""

import numpy as np

from gearlib.analysis import lyapunov
from gearlib.runs.sweeping import CARRIED

#: Strobes of one orbit agree to this share of its height: far more than what is left of settling.
_ONE_ORBIT = 1e-3


def settled(model, diagrams, directions, starts):
    """Return where motions are periodic, and not on orbits that rounding has chosen.

    Bool, shape (diagram, tuning). `diagrams` are of `gearlib.bifurcation_diagram` over the same
    tunings, `directions` and `starts` the way and initial state of each. Behind chaos a carried
    motion is where rounding has led it, until all others have come to one orbit, and it too.
    """
    each = zip(diagrams, directions, starts, strict=True)
    lost = np.array([_lost(model, *one) for one in each])
    periods = np.array([diagram.period.values for diagram in diagrams])
    known = (periods > 0) & ~lost
    carried = np.isin(directions, CARRIED)
    one = known[~carried].all(axis=0) & (~carried).any()
    strobes = np.array([diagram.displacement.values for diagram in diagrams])
    for k in np.flatnonzero(carried):
        behind = False
        for i in _order(diagrams[k], directions[k]):
            sets = np.sort(strobes[~carried | (np.arange(len(lost)) == k), i], axis=1)
            together = np.ptp(sets, axis=0).max() <= _ONE_ORBIT * max(1.0, np.ptp(sets))
            behind = (behind or lost[k, i]) and not (one[i] and together)
            known[k, i] = periods[k, i] > 0 and not behind
    return known


def _order(diagram, direction):
    """Return the numbers of the tunings in the order in which a diagram goes through them."""
    order = np.argsort(diagram.tuning.values)
    return order[::-1] if direction == "down" else order


def _lost(model, diagram, direction, start):
    """Return where rounding may have led the motion of a diagram to another orbit, over tuning."""
    order, tunings = _order(diagram, direction), diagram.tuning.values
    periods = int(diagram.strobe.values[-1]) + 1
    if direction not in CARRIED:
        return np.array([lyapunov.lost(model, float(nu), start, periods) for nu in tunings])
    lost, ends = np.zeros(len(order), bool), diagram.final_state.values[order]
    lost[order] = lyapunov.lost_in_sweep(model, tunings[order], ends, start, periods)
    return lost

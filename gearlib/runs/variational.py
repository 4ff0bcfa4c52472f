"""Maps of small deviations over mesh periods, from the variational equations and the events.

The derivative of the state at the end of a mesh period by that at its start: along the phases of
contact that of the motion itself, at flank crossings the saltation matrix; see
`gearlib.kernels.closed_form.variation`. No finite differences.
"""

import numpy as np


def full_state(pair, tuning, state):
    """Return the state whose variations are followed, shape (n,), for (x, dx/dtau) at tau = 0.

    For one degree of freedom the two numbers themselves; else all coordinates and their rates, in
    static deflections and mesh phase. n is the ``size`` of the model.
    """
    return pair.propagator(tuning).start(state)


def period_maps(pair, tuning, state, periods, limit, first=0):
    """Go through mesh periods from a state at the start of one; return the map of each.

    Parameters
    ----------
    pair : Model
    tuning : float
    state : ndarray, shape (n,)
        As of `full_state`.
    periods : int
    limit : int
        Most events in one mesh period.
    first : int, default 0
        Mesh period of the run-out in which they begin.

    Returns
    -------
    end : ndarray, shape (n,)
    maps : ndarray, shape (periods, n, n)
        Derivative of the state at the end of each period by that at its start.
    code : int
        `gearlib.data.status`; if not OK, the maps are NaN.
    """
    return pair.propagator(tuning).maps(state, periods, limit, first)


def rotation_free(pair):
    """Return the matrices (reduce, lift) between the state and the one without free rotation.

    Only the sum of the two rotations enters the mesh; their difference turns freely and would add
    two multipliers 1. Shapes (n - 2, n), (n, n - 2); identities where nothing turns freely.
    """
    n = pair.size
    if not pair.free_rotation:
        return np.eye(n), np.eye(n)
    # Rows u3 + u2, bearings, and their rates; lifted back with all of the sum in u3.
    lift = np.delete(np.eye(n), [1, n // 2 + 1], axis=1)
    reduce = lift.T.copy()
    reduce[0, 1] = reduce[n // 2 - 1, n // 2 + 1] = 1.0
    return reduce, lift


def without_rotation(pair, maps):
    """Return the maps without the free rotation, shape as of `rotation_free`."""
    reduce, lift = rotation_free(pair)
    return reduce @ maps @ lift


def record(pair, tuning, state, periods, limit, samples_per_period=0):
    """Run from a full state and record it.

    Returns (events, summary, samples) as of `gearlib.kernels.closed_form.run`; `samples` of shape
    (periods * samples_per_period, 6 or more).
    """
    return pair.propagator(tuning).record(state, periods, limit, samples_per_period)

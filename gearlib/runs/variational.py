"""Maps of small deviations over mesh periods, from the variational equations and the events.

The derivative of the state at the end of a mesh period by that at its start: along the phases of
contact that of the motion itself, at flank crossings the saltation matrix; see
`gearlib.kernels.closed_form.variation`. No finite differences.
"""

import numpy as np

from gearlib.data import status
from gearlib.kernels import orbit
from gearlib.kernels.closed_form import run as core_run
from gearlib.kernels.closed_form.mesh import mesh
from gearlib.kernels.closed_form.variation import vary, vary_nonlinear
from gearlib.kernels.piecewise_linear.run import run_linear
from gearlib.kernels.piecewise_linear.system import ORDER
from gearlib.kernels.piecewise_linear.variation import vary_linear
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.taylor.run import run_nonlinear
from gearlib.methods import exact
from gearlib.models.oscillator import OneDegree
from gearlib.models.pair import GearPair

_TO_BERNSTEIN = bernstein_matrix(ORDER)
_TOLERANCE = 1e-16


def moving_components(pair):
    """Return the size of the state that varies: 2, or 4 and two for each flexible bearing."""
    return 2 if isinstance(pair, (GearPair, OneDegree)) else 4 + 2 * len(pair.flexible())


def full_state(pair, tuning, state):
    """Return the state whose variations are followed, shape (n,), for (x, dx/dtau) at tau = 0.

    For one degree of freedom the two numbers themselves; else all coordinates and their rates, in
    static deflections and mesh phase.
    """
    if moving_components(pair) == 2:
        return np.array(state, float)
    system, _ = pair.system(tuning)
    return pair.initial(system, state)[: moving_components(pair)]


def period_maps(pair, tuning, state, periods, limit, first=0):
    """Go through mesh periods from a state at the start of one; return the map of each.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
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
    n = moving_components(pair)
    maps = np.empty((periods, n, n))
    if isinstance(pair, GearPair):
        x, v, code = vary(mesh(exact.ratios(pair), tuning), *state, periods, limit, maps)
        end = np.array([x, v])
    elif isinstance(pair, OneDegree):
        law = pair.law(tuning, _TOLERANCE)
        x, v, code = vary_nonlinear(law, _TO_BERNSTEIN, *state, periods, limit, maps)
        end = np.array([x, v])
    else:
        system, _ = pair.system(tuning)
        z = np.zeros(system.near.size)
        z[:n] = state
        code = vary_linear(system._replace(first=first), _TO_BERNSTEIN, z, n, periods, limit, maps)
        end = z[:n].copy()
    if code != status.OK:
        maps[:] = np.nan
    return end, maps, code


def rotation_free(pair):
    """Return the matrices (reduce, lift) between the state and the one without free rotation.

    Only the sum of the two rotations enters the mesh; their difference turns freely and would add
    two multipliers 1. Shapes (n - 2, n), (n, n - 2); identities for one degree of freedom.
    """
    n = moving_components(pair)
    if n == 2:
        return np.eye(2), np.eye(2)
    # Rows u3 + u2, bearings, and their rates; lifted back with all of the sum in u3.
    lift = np.delete(np.eye(n), [1, n // 2 + 1], axis=1)
    reduce = lift.T.copy()
    reduce[0, 1] = reduce[n // 2 - 1, n // 2 + 1] = 1.0
    return reduce, lift


def without_rotation(pair, maps):
    """Return the maps without the free rotation, shape (periods, n - 2, n - 2)."""
    reduce, lift = rotation_free(pair)
    return reduce @ maps @ lift


def record(pair, tuning, state, periods, limit, samples_per_period=0):
    """Run from a full state and record it.

    Returns (events, summary, samples) as of `gearlib.kernels.closed_form.run`; `samples` of shape
    (periods * samples_per_period, 6 or more).
    """
    columns = orbit.SAMPLE_COLUMNS + len(getattr(pair, "extra_samples", ()))
    samples = np.empty((periods * samples_per_period, columns))
    events, summary = np.empty((16, orbit.EVENT_COLUMNS)), np.empty(orbit.SUMMARY_COLUMNS)
    rest = periods, periods, samples, events, limit, summary
    if isinstance(pair, GearPair):
        done = core_run.run(mesh(exact.ratios(pair), tuning), *state, *rest)
    elif isinstance(pair, OneDegree):
        done = run_nonlinear(pair.law(tuning, _TOLERANCE), _TO_BERNSTEIN, *state, *rest)
    else:
        system, outputs = pair.system(tuning)
        z = np.zeros(system.near.size)
        z[: state.size] = state
        done = run_linear(system, pair.part(system), outputs, _TO_BERNSTEIN, z, *rest)
    return done[3][: done[4]], summary, samples

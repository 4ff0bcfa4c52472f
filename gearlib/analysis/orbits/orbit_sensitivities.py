"""Derivatives of periodic orbits, of their multipliers and of folds by parameters.

With P the map of all mesh periods of an orbit, M its derivative by the state and P_p that by a
parameter, an orbit z = P(z; p) obeys (I - M) dz/dp = P_p. Along dz/dp the map itself changes by
dM/dp, and a multiplier mu with the eigenvectors l, r by l dM/dp r / (l r). At a fold I - M is
singular: with w (I - M) = 0 the fold itself moves by dq/dp = -(w P_p) / (w P_q) in the parameter q
of the branch.
"""

from typing import Any

import numpy as np

from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.continuation import restored
from gearlib.analysis.orbits.followed_parameters import attributes, known
from gearlib.analysis.orbits.shooting import NoOrbit, check_orbit
from gearlib.data import status
from gearlib.data.result import result
from gearlib.data.variables import describe
from gearlib.runs import sensitivities as runs
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.simulation import simulate

#: A multiplier this close to 1 is that of a fold; multipliers this close to each other are double:
#: rounding of the map goes into them by the root.
_FOLD = _DOUBLE = 1e-7
#: Eigenvectors of a condition beyond this are one. Equal multipliers whose rates differ by less
#: than this share of the largest stay together.
_ONE_VECTOR, _TOGETHER = 1e12, 1e-7
#: Events this close to a switch of the stiffness coincide with it, rad.
_AT_ONCE = 1e-9


def orbit_sensitivities(orbit, sensitivities, *, samples_per_period=256, max_events=MAX_EVENTS):
    """Differentiate a periodic orbit and its multipliers by parameters.

    Parameters
    ----------
    orbit : Orbit
        As of `gearlib.periodic_orbit`.
    sensitivities : sequence of str
        As of `gearlib.simulate`, without those of the start.
    samples_per_period, max_events : int
        As of `gearlib.simulate`.

    Returns
    -------
    xarray.Dataset
        That of `gearlib.simulate` over one repeat of the orbit with the derivatives of the orbit:
        its start moves so that it stays one. Also state, multiplier_real, multiplier_imaginary and
        their derivatives. sensitivity_status: 1 at a grazing, where those of the multipliers are
        NaN; 2 where an event meets a switch of the stiffness; 3 at a fold; 4 where two multipliers
        coincide.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    check_orbit(orbit)
    pair: Any = orbit.pair
    tuning, period = orbit.tuning, orbit.period
    names = runs.check(pair, sensitivities, also_start=False)
    run = simulate(
        pair,
        tuning,
        periods=period,
        record_periods=period,
        samples_per_period=samples_per_period,
        initial_state=tuple(orbit.state),
        max_events=max_events,
    )
    propagator, along = pair.propagator(tuning), runs.directions(pair, names)
    reduce, lift = pair.reduction()
    matrix, ahead = _derivatives(propagator, orbit.state, along, period, max_events)
    matrix = reduce @ matrix @ lift
    values, right = np.linalg.eig(matrix)
    order = np.argsort(-np.abs(values), kind="stable")
    values, right = values[order], right[:, order]
    code = 0
    if np.abs(values - 1.0).min() < _FOLD:
        code, tangents = runs.FOLD, np.full_like(ahead, np.nan)
    else:
        tangents = lift @ np.linalg.solve(np.eye(len(matrix)) - matrix, reduce @ ahead)
    sizes = run.sizes["phase"], run.sizes["event"]
    variables = runs.variables(
        propagator, names, along, orbit.state, tangents, sizes, period, period, max_events
    )
    _, rates, _ = propagator.map_rates(orbit.state, along, tangents.copy(), period, max_events)
    slopes = _multiplier_slopes(values, right, reduce @ rates @ lift)
    touching = int(variables["sensitivity_status"][1])
    if touching == runs.GRAZING:
        # Beyond it they change like a root.
        slopes[:] = np.nan
    elif np.isnan(slopes).any():
        code = code or runs.DOUBLE
    code = code or touching
    if not code and _coincide(propagator, run):
        code = runs.ONE_SIDED
    parts = np.array([slopes.real, slopes.imag])
    parameters, described = {name: pair.derivatives[name] for name in names}, runs.described(pair)
    variables |= {
        **runs.derivatives(("state",), ("coordinate",), tangents[None], parameters, described),
        **runs.derivatives(
            ("multiplier_real", "multiplier_imaginary"),
            ("multiplier",),
            parts,
            parameters,
            described,
        ),
        "sensitivity_status": runs.flag(code),
        "state": ("coordinate", orbit.state),
        "multiplier_real": ("multiplier", values.real),
        "multiplier_imaginary": ("multiplier", values.imag),
    }
    return describe(run.assign(variables), pair)


def _derivatives(propagator, state, along, period, max_events):
    """Return (M, P_p) of shapes (n, n) and (n, k)."""
    matrix, ahead, code = propagator.map_slopes(state, along, period, max_events)
    if code != status.OK:
        raise NoOrbit(f"the motion could not go on: {status.MESSAGES[code]}")
    return matrix, ahead


def _multiplier_slopes(values, right, rates):
    """Return the derivatives of multipliers, (n, k), from those of their map, (k, n, n).

    Of equal ones those of their mean, if they stay together; else NaN.
    """
    slopes = np.full((values.size, len(rates)), np.nan + 0j)
    if np.linalg.cond(right) < _ONE_VECTOR:
        turned = np.linalg.inv(right) @ rates @ right
        for i, value in enumerate(values):
            own = np.flatnonzero(np.abs(values - value) <= _DOUBLE)
            blocks = turned[:, own[:, None], own]
            mean = np.trace(blocks, axis1=1, axis2=2) / own.size
            apart = np.abs(blocks - mean[:, None, None] * np.eye(own.size)).max(axis=(1, 2))
            together = apart <= _TOGETHER * np.abs(turned).max(axis=(1, 2))
            slopes[i] = np.where(together, mean, np.nan)
    return slopes


def _coincide(propagator, run):
    """Return whether an event meets a switch of its mesh, or the start of a period."""
    phases = run.event_phase.values
    meshes = run.event_mesh.values if "event_mesh" in run else np.zeros(phases.size, int)
    for j in np.unique(meshes):
        marks = propagator.switches(j)
        apart = np.abs(phases[meshes == j][:, None] % marks[-1] - marks)
        if (apart < _AT_ONCE).any():
            return True
    return False


def fold_sensitivities(pair, branch, point, sensitivities, *, max_events=MAX_EVENTS):
    """Differentiate the place of a fold by parameters.

    Parameters
    ----------
    pair : Model
        The model whose orbit was continued.
    branch : xarray.Dataset
        As of `gearlib.continue_orbit`.
    point : int
        Number of a point labelled "fold".
    sensitivities : sequence of str
        As of `gearlib.orbit_sensitivities`, without what the branch goes over.
    max_events : int
        As of `gearlib.simulate`.

    Returns
    -------
    xarray.Dataset
        The parameter of the branch at the fold, and its derivatives.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    problem, chosen = restored(pair, branch, point, max_events)
    over = branch.attrs["parameter"]
    names = runs.check(pair, sensitivities, also_start=False)
    if over in names:
        raise ValueError(
            f"sensitivities = {names!r} is not allowed: {over} must not be among them, over which "
            "the branch goes"
        )
    if int(branch.label[point]) != special.FOLD:
        raise ValueError(f"point = {point!r} is not allowed: it must be labelled fold")
    pair, tuning, state = problem.model(chosen.y)
    propagator = pair.propagator(tuning)
    branch_along = propagator.along_branch(pair, [over])
    if branch_along is None:
        raise ValueError(
            f"sensitivities = {names!r} is not allowed on a branch over {over}: there are no "
            "derivatives by it"
        )
    along = [*branch_along, *runs.directions(pair, names)]
    matrix, ahead = _derivatives(propagator, state, along, problem.period, max_events)
    reduce, lift = pair.reduction()
    matrix = reduce @ matrix @ lift
    null = np.linalg.svd(matrix - np.eye(len(matrix)))[0][:, -1]
    moved = null @ reduce @ ahead
    slopes = -moved[1:] / moved[0]
    parameters = {name: pair.derivatives[name] for name in names}
    data = runs.derivatives((over,), (), slopes[None], parameters, known(pair))
    data[over] = (), chosen.value, attributes(pair, over)
    if over != "tuning":
        data["tuning"] = tuning
    title = "Derivatives of a fold of a gear mesh"
    return result(title, pair, data, method="shooting", tuning=tuning)

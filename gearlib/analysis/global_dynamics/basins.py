"""`basins`: to which attractor initial states come; `basin_stability`: shares over the tuning."""

import math

import numpy as np
import xarray as xr
from scipy.optimize import linear_sum_assignment

from gearlib import checks, notebook
from gearlib.analysis.global_dynamics import grids
from gearlib.analysis.global_dynamics.attractors import KINDS, PERIODIC
from gearlib.analysis.global_dynamics.classification import check_model, classify
from gearlib.analysis.global_dynamics.stroboscope import Stroboscope
from gearlib.data.result import result, stacked
from gearlib.data.status import flags_of
from gearlib.runs.run_arguments import MAX_EVENTS, check_tuning

#: Numbers of an attractor that a dataset has under their names.
_NUMBERS = ("displacement_max", "displacement_min", "exponent", "uncertainty")
#: CF flags of the kind of an attractor.
KIND_FLAGS = flags_of(KINDS)
#: Orbits of neighbouring tunings are one family when their extrema differ by less than this share
#: of their height (or of a static deflection if that is larger).
_RELATED = 0.25


def basins(
    pair,
    tuning,
    grid,
    *,
    periods=500,
    stop_early=True,
    seed=0,
    max_events=MAX_EVENTS,
    threads=None,
):
    """Find the attractors of a damped mesh and the basin of each on a grid of initial states.

    States are compared n cycles apart for n = 1, 2, ... (a cycle is one mesh period, with run-out
    as many as it repeats after), a candidate is refined by `gearlib.periodic_orbit`, and all n
    points of a period-n orbit are one attractor, whatever the phase in which a motion comes.
    Each point lies in a trapping ellipse that no sampled motion leaves (32 directions, or 128 with
    more than two coordinates; no proof for those between): a run ends when it is in one of them.
    See `gearlib.analysis.global_dynamics.attractors`.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
        With damping. Grids of a `GearPair` are fast; of the others take thousands of states, not
        millions; a `DeadZoneOscillator` has its own unit of length instead of the static
        deflection. Of six degrees the grid is the plane of states in which the bearings are in
        their initial deflection, as of `gearlib.simulate`.
    tuning : float
    grid : tuple
        Initial displacements in static deflections, and dx/dtau, at tau = 0: each a tuple (first,
        last, count) or an array of different values.
    periods : int, default 500
        Mesh periods of a run, rounded up to cycles; a motion that has no attractor by then gets
        as many again.
    stop_early : bool, default True
        Whether a run ends in a trapping ellipse. False runs all periods, as a check of these.
    seed : int, default 0
        Of the choice of states that are looked at first for attractors.
    max_events, threads
        As of `gearlib.sweep`.

    Returns
    -------
    xarray.Dataset
        basin (displacement, velocity), the number of the attractor. Over ``attractor``, sorted by
        kind, period and height: attractor_kind (CF flags: periodic, chaotic, unbounded, undecided;
        the last three are classes, not single attractors), period (mesh periods, 0 if none), share
        of the grid and share_error, the standard error of a share of as many random states;
        displacement_max and displacement_min (of other than periodic motions those of a few over
        256 periods); exponent, uncertainty (largest Lyapunov exponent per mesh period, of a
        periodic orbit from its multipliers); state (attractor, point, coordinate), the points of
        the orbit in its order, tau = 0 in every cycle; multiplier_real, multiplier_imaginary;
        contact_pattern, the contact codes in the order met; grazing; trap_radius, the smallest of
        its trapping ellipses in static deflections. NaN where there is none.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range; without any damping there are no
        attractors.
    RuntimeError
        If a run met more than `max_events` events in a mesh period.

    References
    ----------
    Menck, Heitzig, Marwan, Kurths: Nature Physics 9 (2013) 89-92, for the shares.
    """
    strobe = Stroboscope(pair, tuning, max_events=max_events, threads=threads)
    check_model(pair)
    periods = checks.integer("periods", periods, 1)
    seed = checks.integer("seed", seed, 0)
    checks.one_of("stop_early", stop_early, (False, True))
    x, v = grids.initial_states(grid)
    cycles = -(-periods // strobe.cycle)
    attractors, labels = classify(
        strobe, grids.mesh_states(x, v), cycles, stop_early=stop_early, seed=seed
    )
    share = np.bincount(labels, minlength=len(attractors)) / labels.size
    data = {
        "basin": (("displacement", "velocity"), labels.reshape(x.size, v.size).astype(np.int16)),
        **attractor_variables(attractors),
        "share": ("attractor", share),
        "share_error": ("attractor", np.sqrt(share * (1.0 - share) / labels.size)),
        **pair.scales(),
        "tuning": strobe.tuning,
    }
    dataset = xr.Dataset(data, {"displacement": x, "velocity": v})
    numbers = ("attractor", "point", "coordinate", "multiplier")
    dataset = result(
        "Basins of attraction of a gear mesh",
        pair,
        dataset.assign_coords({n: np.arange(dataset.sizes[n]) for n in numbers}),
        method=strobe.propagator.words,
        tuning=strobe.tuning,
        periods=cycles * strobe.cycle,
        stop_early=bool(stop_early),
        seed=seed,
    )
    dataset["attractor_kind"].attrs |= KIND_FLAGS
    return dataset


def attractor_variables(attractors):
    """Return name -> (dims, values) of what is known of attractors."""
    count = len(attractors)
    orbits = [attractor.orbit for attractor in attractors]
    points = max((len(attractor.points) for attractor in attractors if attractor.orbit), default=1)
    size = max((orbit.state.size for orbit in orbits if orbit), default=2)
    multipliers = max((orbit.multipliers.size for orbit in orbits if orbit), default=2)
    states = np.full((count, points, size), math.nan)
    real, imaginary = np.full((2, count, multipliers), math.nan)
    for i, (attractor, orbit) in enumerate(zip(attractors, orbits, strict=True)):
        if orbit:
            states[i, : len(attractor.points)] = attractor.points
            real[i], imaginary[i] = orbit.multipliers.real, orbit.multipliers.imag

    def facts(attractor):
        orbit = attractor.orbit
        return {
            "attractor_kind": np.int8(attractor.kind),
            "period": np.int32(attractor.period),
            **{name: float(getattr(attractor, name)) for name in _NUMBERS},
            "contact_pattern": " ".join(map(str, orbit.pattern)) if orbit else "",
            "grazing": np.int8(bool(orbit and orbit.grazing)),
            "trap_radius": attractor.ellipses.radii.min() if attractor.ellipses else math.nan,
        }

    return stacked({"attractor": attractors}, facts) | {
        "state": (("attractor", "point", "coordinate"), states),
        "multiplier_real": (("attractor", "multiplier"), real),
        "multiplier_imaginary": (("attractor", "multiplier"), imaginary),
    }


def basin_stability(
    pair,
    tunings,
    region,
    *,
    samples=400,
    periods=500,
    seed=0,
    max_events=MAX_EVENTS,
    threads=None,
):
    """Return what share of a region of initial states comes to each attractor, over the tuning.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
        With damping.
    tunings : array_like of float, shape (n,)
        All different.
    region : tuple
        ((lowest, highest displacement), (lowest, highest dx/dtau)) of the initial states.
    samples : int, default 400
        Initial states at each tuning, rounded up to a square: one at random in each of as many
        equal cells, so that shares err less than with states that are all random.
    periods, max_events, threads
        As of `gearlib.basins`.
    seed : int, default 0

    Returns
    -------
    xarray.Dataset
        share, share_error (the binomial standard error, an upper bound here), displacement_max,
        displacement_min, exponent (tuning, attractor_family): share 0 and else NaN where a family
        is not met. A family holds the attractors of one kind and period whose extrema change
        little from a tuning to the next; over attractor_family: attractor_kind, period.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    values = grids.values("tunings", tunings)
    values = np.array([check_tuning(f"tunings[{i}]", v) for i, v in enumerate(values.tolist())])
    Stroboscope(pair, values[0])
    check_model(pair)
    low, high = grids.region(region).T
    cells = int(np.ceil(np.sqrt(checks.integer("samples", samples, 1, grids.MAX_STATES))))
    periods, seed = checks.integer("periods", periods, 1), checks.integer("seed", seed, 0)
    rows = []
    for i, nu in notebook.counted("tunings", enumerate(values), values.size):
        strobe = Stroboscope(pair, nu, max_events=max_events, threads=threads)
        rng = np.random.default_rng([seed, i])
        corners = grids.mesh_states(np.arange(cells), np.arange(cells))
        shares = (corners + rng.random(corners.shape)) / cells
        cycles = -(-periods // strobe.cycle)
        attractors, labels = classify(strobe, low + shares * (high - low), cycles, seed=seed)
        rows.append((attractors, np.bincount(labels, minlength=len(attractors)) / labels.size))
    dataset = result(
        "Basin stability of a gear mesh",
        pair,
        *_families(values, rows, cells * cells),
        method="stratified initial states",
        region=grids.region(region).tolist(),
        samples=cells * cells,
        periods=periods,
        seed=seed,
    )
    dataset["attractor_kind"].attrs |= KIND_FLAGS
    return dataset


def _families(tunings, results, samples):
    """Return (data, coordinates) of families, following attractors from tuning to tuning."""
    families = []  # latest attractor of each
    places = [None] * len(tunings)
    for i in np.argsort(tunings):
        attractors = results[i][0]
        cost = np.array([[_distance(a, b) for b in families] for a in attractors])
        cost = cost.reshape(len(attractors), len(families))
        rows, columns = linear_sum_assignment(np.minimum(cost, 1e9))
        chosen = np.full(len(attractors), -1)
        for row, column in zip(rows, columns, strict=True):
            if cost[row, column] < _RELATED:
                chosen[row] = column
        for row, attractor in enumerate(attractors):
            if chosen[row] < 0:
                chosen[row] = len(families)
                families.append(attractor)
            families[chosen[row]] = attractor
        places[i] = chosen
    shape = len(tunings), len(families)
    share = np.zeros(shape)
    columns = {
        name: np.full(shape, np.nan)
        for name in ("displacement_max", "displacement_min", "exponent")
    }
    for i, (attractors, shares) in enumerate(results):
        share[i, places[i]] = shares
        for name, table in columns.items():
            table[i, places[i]] = [getattr(attractor, name) for attractor in attractors]
    kinds, periods = np.array([(last.kind, last.period) for last in families]).reshape(-1, 2).T
    dims = ("tuning", "attractor_family")
    data = {
        "share": (dims, share),
        "share_error": (dims, np.sqrt(share * (1.0 - share) / samples)),
        **{name: (dims, table) for name, table in columns.items()},
        "attractor_kind": ("attractor_family", kinds.astype(np.int8)),
        "period": ("attractor_family", periods.astype(np.int32)),
    }
    return data, {"tuning": tunings, "attractor_family": np.arange(len(families))}


def _distance(first, second):
    """Return how much two attractors differ, in shares of their height."""
    if (first.kind, first.period) != (second.kind, second.period):
        return np.inf
    if first.kind != PERIODIC:
        return 0.0
    size = max(1.0, first.displacement_max - first.displacement_min)
    high = abs(first.displacement_max - second.displacement_max)
    return max(high, abs(first.displacement_min - second.displacement_min)) / size

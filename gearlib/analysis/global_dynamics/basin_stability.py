"""`basin_stability`: shares of the attractors among random initial states, over the tuning."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from gearlib import checks, notebook
from gearlib.analysis.global_dynamics import grids
from gearlib.analysis.global_dynamics.attractors import PERIODIC
from gearlib.analysis.global_dynamics.basins import KIND_FLAGS
from gearlib.analysis.global_dynamics.classification import classify, refuse_undamped
from gearlib.analysis.global_dynamics.stroboscope import Stroboscope
from gearlib.data.result import result
from gearlib.runs.run_arguments import MAX_EVENTS, check_tuning

#: Orbits of neighbouring tunings are one family when their extrema differ by less than this share
#: of their height (or of a static deflection if that is larger).
_RELATED = 0.25


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
    refuse_undamped(pair)
    low, high = grids.region(region).T
    cells = int(np.ceil(np.sqrt(checks.integer("samples", samples, 1, grids.MAX_STATES))))
    periods, seed = checks.integer("periods", periods, 1), checks.integer("seed", seed, 0)
    found = []
    for i, nu in notebook.counted("tunings", enumerate(values), values.size):
        strobe = Stroboscope(pair, nu, max_events=max_events, threads=threads)
        rng = np.random.default_rng([seed, i])
        corners = grids.mesh_states(np.arange(cells), np.arange(cells))
        shares = (corners + rng.random(corners.shape)) / cells
        cycles = -(-periods // strobe.cycle)
        attractors, labels = classify(strobe, low + shares * (high - low), cycles, seed=seed)
        found.append((attractors, np.bincount(labels, minlength=len(attractors)) / labels.size))
    dataset = result(
        "Basin stability of a gear mesh",
        pair,
        *_families(values, found, cells * cells),
        method="stratified initial states",
        region=grids.region(region).tolist(),
        samples=cells * cells,
        periods=periods,
        seed=seed,
    )
    dataset["attractor_kind"].attrs |= KIND_FLAGS
    return dataset


def _families(tunings, found, samples):
    """Return (data, coordinates) of families, following attractors from tuning to tuning."""
    families = []  # latest attractor of each
    places = [None] * len(tunings)
    for i in np.argsort(tunings):
        attractors = found[i][0]
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
    for i, (attractors, shares) in enumerate(found):
        share[i, places[i]] = shares
        for name, table in columns.items():
            table[i, places[i]] = [getattr(one, name) for one in attractors]
    dims = ("tuning", "attractor_family")
    data = {
        "share": (dims, share),
        "share_error": (dims, np.sqrt(share * (1.0 - share) / samples)),
        **{name: (dims, table) for name, table in columns.items()},
        "attractor_kind": ("attractor_family", np.array([one.kind for one in families], np.int8)),
        "period": ("attractor_family", np.array([one.period for one in families], np.int32)),
    }
    return data, {"tuning": tunings, "attractor_family": np.arange(len(families))}


def _distance(one, other):
    """Return how much two attractors differ, in shares of their height."""
    if (one.kind, one.period) != (other.kind, other.period):
        return np.inf
    if one.kind != PERIODIC:
        return 0.0
    size = max(1.0, one.displacement_max - one.displacement_min)
    high = abs(one.displacement_max - other.displacement_max)
    return max(high, abs(one.displacement_min - other.displacement_min)) / size

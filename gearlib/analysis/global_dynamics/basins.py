"""`basins`: attractors of a grid of initial states; `basin_stability`: basin sizes over tuning."""

import math
from typing import Annotated

import numpy as np
import xarray as xr
from annotated_types import Ge, Le
from scipy.optimize import linear_sum_assignment

from gearlib import checks
from gearlib.analysis.global_dynamics.attractors import KINDS, PERIODIC, UNDECIDED, Attractor
from gearlib.analysis.global_dynamics.classification import classify, require_damped_model
from gearlib.analysis.global_dynamics.stroboscope import (
    MAX_STATES,
    Stroboscope,
    check_distinct_values,
    check_grid,
    grid_states,
)
from gearlib.data.result import evaluate_on_grid, make_result
from gearlib.data.status import flag_attributes
from gearlib.parameters import INTEGER, Boolean, Count, Limits, Values, WholeNumber, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MAX_EVENTS, MaxSeconds, Threads, Tuning, check_tuning

#: Attributes of `Attractor` that are dataset variables of the same name.
_ATTRACTOR_VARIABLES = ("displacement_max", "displacement_min", "exponent", "uncertainty")
#: CF flag attributes of the variable attractor_kind.
KIND_FLAGS = flag_attributes(KINDS)
#: Attractors at successive tunings belong to the same family if their extrema differ by less than
#: this, relative to the displacement range or one static deflection, whichever is larger.
_FAMILY_TOLERANCE = 0.25


@checked
def basins(
    model,
    tuning: Tuning,
    grid,
    *,
    periods: Count = 500,
    stop_early: Boolean = True,
    seed: WholeNumber = 0,
    max_events: Count = MAX_EVENTS,
    threads: Threads = None,
    max_seconds: MaxSeconds = None,
):
    """Find the attractors of a damped mesh and their basins on a grid of initial states.

    States are compared n cycles apart for n = 1, 2, ... (a cycle is one mesh period, or the period
    of the run-out), and candidates are refined by `gearlib.periodic_orbit`. All n points of a
    period-n orbit are one attractor. Each point lies in a trapping ellipse that no sampled motion
    leaves, and a run stops when it enters one of the ellipses. Motions are sampled in 32
    directions, or 128 with more than two coordinates; for other directions nothing is proved. See
    `gearlib.analysis.global_dynamics.attractors`.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
        A model with damping. A `GearPair` is fast enough for millions of states, the others for
        thousands; a `DeadZoneOscillator` has its own unit of length instead of the static
        deflection. With six degrees of freedom the bearings start with the same deflection as in
        `gearlib.simulate`.
    tuning : float
        Ratio of mesh frequency to mean eigenfrequency, nu.
    grid : tuple
        Initial displacements in units of the static deflection, and dx/dtau, at tau = 0: each a
        tuple (first, last, count) or an array of distinct values.
    periods : int, default 500
        Number of mesh periods of a run, rounded up to whole cycles. If a motion has not reached an
        attractor by then, it is continued over the same number of periods.
    stop_early : bool, default True
        Whether a run stops in a trapping ellipse. If False, all periods are simulated, as a check.
    seed : int, default 0
        Seed of the random choice of the states that are examined first.
    max_events : int
        Largest number of contact events in one mesh period.
    threads : int, optional
        Number of threads; by default one per processor.
    max_seconds : float, optional
        Time limit in seconds, after which the states without an attractor are undecided, see
        `gearlib.progress`; the attribute `missing` is then ["undecided"].

    Returns
    -------
    xarray.Dataset
        basin (displacement, velocity), the index of the attractor. Over ``attractor``, sorted by
        kind, period and displacement range: attractor_kind (CF flags: periodic, chaotic, unbounded,
        undecided; the last three are classes, not single attractors), period (mesh periods, 0 if
        none), share of the grid and share_error, the standard error for as many random states;
        displacement_max and displacement_min (for aperiodic motions the extrema of a few samples
        over 256 periods); exponent, uncertainty (largest Lyapunov exponent per mesh period, for a
        periodic orbit from its multipliers); state (attractor, point, coordinate), the states of
        the orbit at the start of each cycle; multiplier_real, multiplier_imaginary;
        contact_pattern, the sequence of contact states; grazing; trap_radius, the smallest radius
        of its trapping ellipses in static deflections. Missing values are NaN.

    Raises
    ------
    ValueError
        If an argument is invalid, or if the model has no damping and therefore no attractors.
    RuntimeError
        If a run has more than `max_events` contact events in a mesh period.

    References
    ----------
    Menck, Heitzig, Marwan, Kurths: Nature Physics 9 (2013) 89-92 (basin stability).
    """
    stroboscope = Stroboscope(model, tuning, max_events=max_events, threads=threads)
    require_damped_model(model)
    x, v = check_grid(grid)
    cycles = -(-periods // stroboscope.mesh_periods_per_cycle)
    states = grid_states(x, v)
    time_limit = TimeLimit(max_seconds)
    attractors, labels = classify(stroboscope, states, cycles, time_limit, stop_early, seed)
    is_undecided = any(attractor.kind == UNDECIDED for attractor in attractors)
    missing = [KINDS[UNDECIDED]] if is_undecided and not time_limit.complete else []
    share = np.bincount(labels, minlength=len(attractors)) / labels.size
    data = {
        "basin": (("displacement", "velocity"), labels.reshape(x.size, v.size).astype(np.int16)),
        **_attractor_variables(attractors),
        "share": ("attractor", share),
        "share_error": ("attractor", np.sqrt(share * (1.0 - share) / labels.size)),
        **model.scales(),
        "tuning": stroboscope.tuning,
    }
    dataset = xr.Dataset(data, {"displacement": x, "velocity": v})
    index_dims = ("attractor", "point", "coordinate", "multiplier")
    dataset = make_result(
        "Basins of attraction of a gear mesh",
        model,
        dataset.assign_coords({dim: np.arange(dataset.sizes[dim]) for dim in index_dims}),
        method=stroboscope.propagator.description,
        tuning=stroboscope.tuning,
        periods=cycles * stroboscope.mesh_periods_per_cycle,
        stop_early=bool(stop_early),
        seed=seed,
    )
    dataset["attractor_kind"].attrs |= KIND_FLAGS
    return time_limit.record_missing(dataset, missing)


def _attractor_variables(attractors: list[Attractor]) -> dict:
    """Return the properties of attractors as dataset variables {name: (dims, values)}.

    They are kind, period, displacement extrema, Lyapunov exponent, contact pattern, states of the
    orbit one cycle apart, and Floquet multipliers. States and multipliers are padded with NaN,
    because their numbers differ between attractors.
    """
    count = len(attractors)
    periodic = [attractor for attractor in attractors if attractor.orbit]
    orbits = [attractor.orbit for attractor in attractors if attractor.orbit]
    point_count = max((len(attractor.points) for attractor in periodic), default=1)
    state_size = max((orbit.state.size for orbit in orbits), default=2)
    multiplier_count = max((orbit.multipliers.size for orbit in orbits), default=2)
    states = np.full((count, point_count, state_size), math.nan)
    real, imaginary = np.full((2, count, multiplier_count), math.nan)
    for i, attractor in enumerate(attractors):
        if orbit := attractor.orbit:
            states[i, : len(attractor.points)] = attractor.points
            real[i], imaginary[i] = orbit.multipliers.real, orbit.multipliers.imag

    def scalar_variables(attractor: Attractor) -> dict:
        """Return the scalar variables of an attractor as {name: value}.

        Aperiodic attractors have no contact pattern, grazing or trapping ellipses.
        """
        orbit = attractor.orbit
        return {
            "attractor_kind": np.int8(attractor.kind),
            "period": np.int32(attractor.period),
            **{name: float(getattr(attractor, name)) for name in _ATTRACTOR_VARIABLES},
            "contact_pattern": " ".join(map(str, orbit.pattern)) if orbit else "",
            "grazing": np.int8(bool(orbit and orbit.grazing)),
            "trap_radius": attractor.ellipses.radii.min() if attractor.ellipses else math.nan,
        }

    return evaluate_on_grid({"attractor": attractors}, scalar_variables) | {
        "state": (("attractor", "point", "coordinate"), states),
        "multiplier_real": (("attractor", "multiplier"), real),
        "multiplier_imaginary": (("attractor", "multiplier"), imaginary),
    }


@checked
def basin_stability(
    model,
    tunings,
    region: Annotated[tuple[Limits, ...], Values(2)],
    *,
    samples: Annotated[int, Ge(1), Le(MAX_STATES), INTEGER] = 400,
    periods: Count = 500,
    seed: WholeNumber = 0,
    max_events: Count = MAX_EVENTS,
    threads: Threads = None,
    max_seconds: MaxSeconds = None,
):
    """Compute the fraction of initial states that lead to each attractor, over the tuning.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
        A model with damping.
    tunings : array_like of float, shape (n,)
        Tunings nu, all distinct.
    region : tuple
        ((lowest, highest displacement), (lowest, highest dx/dtau)) of the initial states.
    samples : int, default 400
        Number of initial states at each tuning, rounded up to a square number. The region is
        divided into this number of equal cells, each with one random state (stratified sampling),
        which makes the shares more accurate.
    periods, max_events, threads
        As in `gearlib.basins`.
    seed : int, default 0
        Seed of the random initial states.
    max_seconds : float, optional
        Time limit in seconds, after which the tunings computed so far are returned, see
        `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        share, share_error (the binomial standard error, an upper bound here), displacement_max,
        displacement_min, exponent (tuning, attractor_family): where a family does not exist, its
        share is 0 and the others are NaN. A family is a sequence of attractors of the same kind and
        period whose extrema change little between tunings. Over attractor_family: attractor_kind,
        period.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.
    """
    values = check_distinct_values("tunings", tunings)
    values = np.array([check_tuning(f"tunings[{i}]", v) for i, v in enumerate(values.tolist())])
    # The constructor raises ValueError if no method supports the model.
    Stroboscope(model, values[0])
    require_damped_model(model)
    lower_limits, upper_limits = np.transpose(region)
    is_increasing = (lower_limits < upper_limits).all()
    checks.require(is_increasing, "region", region, "pairs of increasing limits")
    cells_per_axis = int(np.ceil(np.sqrt(samples)))
    state_count = cells_per_axis * cells_per_axis
    attractors_and_shares = []
    time_limit = TimeLimit(max_seconds)
    for i, tuning in time_limit.iterate(
        with_progress_bar("tunings", enumerate(values), values.size)
    ):
        stroboscope = Stroboscope(model, tuning, max_events=max_events, threads=threads)
        rng = np.random.default_rng([seed, i])
        cell_corners = grid_states(np.arange(cells_per_axis), np.arange(cells_per_axis))
        states = lower_limits + (cell_corners + rng.random(cell_corners.shape)) / cells_per_axis * (
            upper_limits - lower_limits
        )
        cycles = -(-periods // stroboscope.mesh_periods_per_cycle)
        attractors, labels = classify(stroboscope, states, cycles, TimeLimit(None), seed=seed)
        shares = np.bincount(labels, minlength=len(attractors)) / labels.size
        attractors_and_shares.append((attractors, shares))
    count_done = len(attractors_and_shares)
    data, coords = _family_variables(values[:count_done], attractors_and_shares, state_count)
    dataset = make_result(
        "Basin stability of a gear mesh",
        model,
        data,
        coords,
        method="stratified initial states",
        region=[list(limits) for limits in region],
        samples=state_count,
        periods=periods,
        seed=seed,
    )
    dataset["attractor_kind"].attrs |= KIND_FLAGS
    return time_limit.record_missing(dataset, values[count_done:].tolist())


def _assign_families(attractors_by_tuning: list, order: np.ndarray) -> tuple[list, list]:
    """Group the attractors at several tunings into families that change little with the tuning.

    `attractors_by_tuning` contains a list of attractors for each tuning (mesh frequency / natural
    frequency), and `order` contains the indices of these lists by increasing tuning. Attractors at
    successive tunings are matched by their displacement extrema. Return (latest members, family
    numbers): the attractor of each family at the highest tuning at which it exists, and for each
    tuning an array with the family number of each attractor.
    """
    latest_members: list[Attractor] = []
    family_numbers = [np.zeros(0, int)] * len(attractors_by_tuning)
    for i in order:
        attractors = attractors_by_tuning[i]
        distances = np.empty((len(attractors), len(latest_members)))
        for k, attractor in enumerate(attractors):
            distances[k] = [_attractor_distance(attractor, member) for member in latest_members]
        # Minimise the sum of the distances, which must be finite.
        matched_attractors, matched_families = linear_sum_assignment(np.minimum(distances, 1e9))
        numbers = np.full(len(attractors), -1)
        for k, family in zip(matched_attractors, matched_families, strict=True):
            if distances[k, family] < _FAMILY_TOLERANCE:
                numbers[k] = family
        # Each unmatched attractor starts a new family.
        for k, attractor in enumerate(attractors):
            if numbers[k] < 0:
                numbers[k] = len(latest_members)
                latest_members.append(attractor)
            latest_members[numbers[k]] = attractor
        family_numbers[i] = numbers
    return latest_members, family_numbers


def _family_variables(tunings: np.ndarray, attractors_and_shares: list, samples: int) -> tuple:
    """Return (variables, coordinates) of a dataset of families of attractors over the tuning.

    A family is a sequence of attractors that change little from tuning to tuning.
    `attractors_and_shares` contains (attractors, their shares of the initial states) for each of
    the `tunings` (mesh frequency / natural frequency), shape (t,). `samples` is the number of
    initial states at each tuning, from which the standard errors of the shares are computed.
    """
    attractors_by_tuning = [attractors for attractors, _ in attractors_and_shares]
    families, numbers = _assign_families(attractors_by_tuning, np.argsort(tunings))
    shape = len(tunings), len(families)
    share = np.zeros(shape)
    names = ("displacement_max", "displacement_min", "exponent")
    tables = {name: np.full(shape, np.nan) for name in names}
    for i, (attractors, shares) in enumerate(attractors_and_shares):
        share[i, numbers[i]] = shares
        for name, table in tables.items():
            table[i, numbers[i]] = [getattr(attractor, name) for attractor in attractors]
    family_kinds = np.array([family.kind for family in families], np.int8)
    periods = np.array([family.period for family in families], np.int32)
    dims = ("tuning", "attractor_family")
    data = {
        "share": (dims, share),
        "share_error": (dims, np.sqrt(share * (1.0 - share) / samples)),
        **{name: (dims, table) for name, table in tables.items()},
        "attractor_kind": ("attractor_family", family_kinds),
        "period": ("attractor_family", periods),
    }
    return data, {"tuning": tunings, "attractor_family": np.arange(len(families))}


def _attractor_distance(attractor: Attractor, other_attractor: Attractor) -> float:
    """Return the relative difference between the displacement extrema of two attractors.

    The larger of the two differences is divided by the displacement range of the first attractor,
    or by one static deflection if that is larger. The result is infinite if kinds (periodic,
    chaotic, ...) or periods differ, and 0 for two aperiodic attractors of the same kind.
    """
    if (attractor.kind, attractor.period) != (other_attractor.kind, other_attractor.period):
        return np.inf
    if attractor.kind != PERIODIC:
        return 0.0
    displacement_range = max(1.0, attractor.displacement_max - attractor.displacement_min)
    difference = max(
        abs(attractor.displacement_max - other_attractor.displacement_max),
        abs(attractor.displacement_min - other_attractor.displacement_min),
    )
    return difference / displacement_range

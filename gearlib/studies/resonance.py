"""Compute resonance curves, the underlying branches of periodic orbits, and their loci.

Branches of period-one orbits are followed from both ends of the range of tunings, and branches of
period-two orbits from the period doublings on these branches. Isolated branches are not found.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.continuation import continue_orbit, switch_branch
from gearlib.analysis.orbits.loci import locus
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.orbits.special_points import DOUBLING, FOLD, GRAZING
from gearlib.data.variables import add_metadata
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep, sweep_down
from gearlib.tunings import grid

#: If the tuning changes by less at the start of a doubled branch, its direction is unknown.
_MIN_TUNING_CHANGE = 1e-9


def sweep_window(
    model: Any,
    pair: GearPair,
    window: tuple,
    step: float,
    run: dict,
    damping,
    direction,
    threads,
    lowest=None,
) -> xr.Dataset:
    """Compute a sweep over a window of tunings.

    The tunings have the range `window` = (first, last) and the `step`; they are mesh frequencies
    over the natural frequency of `pair`, and `model` runs at the same speeds. `run` has arguments
    of `gearlib.sweep`. `direction` is "cold" (all runs start from the same state), "up" or "down".
    A sweep "down" that has not jumped is extended to the tuning `lowest`, unless this is None.
    `damping` is the name of the damping combination, a coordinate of the result.
    """
    first_tuning, last_tuning = window
    tunings = model.tuning_from(pair, np.array(grid(first_tuning, last_tuning, step)))
    if direction == "down" and lowest is not None:
        lowest_tuning = model.tuning_from(pair, lowest)
        curve, _ = sweep_down(model, tunings, lowest_tuning, threads=threads, **run)
    else:
        curve = sweep(model, tunings, direction=direction, threads=threads, **run)
    return add_metadata(curve.assign_coords(damping=damping, direction=direction))


def compute_branches(pair: GearPair, settings: dict, damping: str) -> xr.Dataset:
    """Compute the branches of periodic orbits of a gear pair over tuning.

    `settings` has the arguments of `follow_branches`: start and stop (tunings, mesh frequency over
    natural frequency), step, max_height and max_points. `damping` is the name of the damping
    combination, a coordinate of the result.
    """
    return add_metadata(follow_branches(pair, **settings).assign_coords(damping=damping))


def follow_branches(model: Any, start: float, stop: float, **settings: Any) -> xr.Dataset:
    """Follow the branches of periodic orbits between two tunings, concatenated along ``point``.

    The tunings `start` and `stop` are mesh frequencies over the natural frequency. Branches of
    period-one orbits start at both tunings, and branches of period-two orbits at period doublings.
    `settings` are the arguments step, max_height and max_points of `gearlib.continue_orbit`. Raise
    NoOrbit if there is no period-one orbit at either tuning.
    """
    branches: list[xr.Dataset] = []
    for begin, end in ((start, stop), (stop, start)):
        # The branch from `start` may already have reached `stop`.
        if not branches or float(branches[0].tuning[-1]) != begin:
            orbit = _find_orbit(model, begin)
            if orbit is not None:
                branches.append(continue_orbit(orbit, to=end, **settings))
    if not branches:
        raise NoOrbit(
            f"no orbit of one mesh period was found at the tunings {start!r} and {stop!r}"
        )
    for branch in list(branches):
        for point in np.flatnonzero(branch.label == DOUBLING):
            try:
                branches.append(
                    _follow_doubled_branch(model, branch, int(point), start, stop, settings)
                )
            except NoOrbit:
                continue
    numbered = []
    for number, branch in enumerate(branches):
        numbers = np.full(branch.sizes["point"], number, np.int32)
        periods = np.full(branch.sizes["point"], int(branch.period), np.int32)
        numbered.append(branch.assign(branch=("point", numbers), period=("point", periods)))
    return _join_branches(numbered, branches[0].attrs, "Branches of periodic orbits of a gear mesh")


def _find_orbit(model: Any, tuning: float) -> Any:
    """Find a period-one orbit at a tuning (mesh frequency over natural frequency), or None.

    Newton's method starts from rest at the static deflection. If it fails, it starts from the
    default guess of `periodic_orbit`.
    """
    at_static_deflection = (1.0, 0.0)
    for guess in (at_static_deflection, None):
        try:
            return periodic_orbit(model, tuning, guess=guess)
        except NoOrbit:
            continue
    return None


def _follow_doubled_branch(
    model: Any, branch: xr.Dataset, point: int, start: float, stop: float, settings: dict
) -> xr.Dataset:
    """Follow the branch of doubled period that starts at a period doubling on another branch.

    `point` is the index of the period doubling on `branch`. The doubled branch is followed to the
    tuning `start` or `stop` (mesh frequency over natural frequency), depending on its initial
    direction. `settings` has further arguments of `gearlib.continue_orbit`.
    """
    orbit = switch_branch(model, branch, point)
    change = orbit.tuning - float(branch.tuning[point])
    if abs(change) > _MIN_TUNING_CHANGE:
        target_tuning = stop if change > 0.0 else start
        return continue_orbit(orbit, to=target_tuning, **settings)
    # The direction is unknown, so both are tried and the longer branch is kept.
    limits = (start, stop)
    candidates = [continue_orbit(orbit, to=tuning, limits=limits, **settings) for tuning in limits]
    return max(candidates, key=lambda candidate: candidate.sizes["point"])


def _join_branches(datasets: Sequence[xr.Dataset], attrs: dict, title: str) -> xr.Dataset:
    """Concatenate branches along ``point``; Floquet multipliers of grazing orbits become NaN.

    A grazing orbit touches the contact boundary with zero velocity. Near grazing, multipliers
    change with the square root of the distance, so half of their digits are rounding errors.
    `attrs` and `title` become attributes of the result.
    """
    dataset = xr.concat(datasets, "point", data_vars="minimal", combine_attrs="override")
    for name in ("multiplier_real", "multiplier_imaginary"):
        regular = dataset[name].where(dataset.label != GRAZING)
        dataset[name] = regular.assign_attrs(dataset[name].attrs)
    dataset.attrs = attrs | {"title": title}
    return dataset


def compute_loci(
    pair: GearPair, branches: xr.Dataset, start: float, stop: float, lowest: float, highest: float
) -> xr.Dataset:
    """Compute loci of period-one bifurcations in the plane of tuning and damping ratio.

    The loci are curves of folds, period doublings and grazing orbits (which touch the contact
    boundary). They start from the special points on `branches`, the branches of orbits of `pair`,
    and are limited to the tunings (mesh frequency over natural frequency) from `start` to `stop`
    and the damping ratios from `lowest` to `highest`. In the dataset, locus is the index of the
    branch point from which a locus starts, and own_damping the damping ratio of `pair`.
    """
    labels = branches.label.values
    tunings = start, stop
    damping_ratio = pair.damping_ratio
    names = ["state", "multiplier_real", "multiplier_imaginary", "residual", "tuning", "label"]
    # The empty dataset ensures that the result has all variables even if there is no locus.
    empty = branches.isel(point=slice(0))[names].reset_coords(drop=True).drop_encoding()
    datasets = [empty.assign(damping_ratio=("point", []), locus=("point", np.empty(0, np.int32)))]
    is_special = np.isin(labels, (FOLD, DOUBLING, GRAZING)) & (branches.period.values == 1)
    for point in np.flatnonzero(is_special):
        for limit in (lowest, highest):
            if limit == damping_ratio:  # the locus would end where it starts
                continue
            try:
                curve = locus(pair, branches, int(point), "damping", to=limit, limits=tunings)
            except NoOrbit:
                continue
            count = curve.sizes["point"]
            label = "point", np.full(count, labels[point], np.int8)
            start_point = "point", np.full(count, point, np.int32)
            curve = curve.rename(damping="damping_ratio")
            datasets.append(curve.assign(label=label, locus=start_point))
    dataset = _join_branches(
        datasets, branches.attrs, "Loci of special points over tuning and damping"
    )
    return add_metadata(dataset.assign(own_damping=damping_ratio))

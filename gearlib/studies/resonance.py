"""Compute resonance characteristics, the branches of periodic orbits behind them, and their loci.

Orbits of one mesh period are followed from both ends of the range of tunings, orbits of two mesh
periods from the period doublings on these branches. Isolated branches are not found.
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

#: A doubled branch that starts with a smaller change of tuning is perpendicular to the tuning axis.
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
    """Compute a sweep over a window of tunings, labelled with damping and direction.

    `window` is (first, last) and `step` the step of tunings, mesh frequencies over the natural
    frequency of `pair`; `model` runs at the same speeds. `run` has arguments of `gearlib.sweep`,
    `damping` is the name of the damping combination, `direction` is "cold" (every run from the same
    initial state), "up" or "down", and `threads` the number of threads. A downward sweep that has
    not jumped continues below the window, down to the tuning `lowest`, unless this is None.
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
    """Compute the branches of periodic orbits of a gear pair, labelled with its damping.

    A branch is a curve of orbits over tuning, mesh frequency over natural frequency. `settings` are
    start and stop (tunings), step, max_height and max_points, the arguments of `follow_branches`;
    `damping` is the name of the damping combination.
    """
    return add_metadata(follow_branches(pair, **settings).assign_coords(damping=damping))


def follow_branches(model: Any, start: float, stop: float, **settings: Any) -> xr.Dataset:
    """Compute the branches of periodic orbits between two tunings, joined along ``point``.

    The tunings `start` and `stop` are mesh frequencies over the natural frequency. Branches of one
    mesh period start at both, branches of two mesh periods at period doublings. `settings` are the
    arguments step, max_height and max_points of `gearlib.continue_orbit`. Raise NoOrbit if there is
    no orbit of one mesh period at either tuning.
    """
    branches: list[xr.Dataset] = []
    for begin, end in ((start, stop), (stop, start)):
        # The branch from `start` may already have reached `stop`.
        if not branches or float(branches[0].tuning[-1]) != begin:
            orbit = _find_orbit(model, begin)
            if orbit is not None:
                branches.append(continue_orbit(orbit, to=end, **settings))
    if not branches:
        raise NoOrbit(f"no orbit of one mesh period was found at tuning = {start!r} or {stop!r}")
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
    """Return an orbit of one mesh period at a tuning, or None if none is found.

    The tuning is mesh frequency over natural frequency. The search by Newton's method starts from
    the static deflection at rest, then from the default state of `periodic_orbit`.
    """
    for guess in ((1.0, 0.0), None):
        try:
            return periodic_orbit(model, tuning, guess=guess)
        except NoOrbit:
            continue
    return None


def _follow_doubled_branch(
    model: Any, branch: xr.Dataset, point: int, start: float, stop: float, settings: dict
) -> xr.Dataset:
    """Follow the branch of doubled period that starts at a point of a branch, and return it.

    `point` is the index of a period doubling on `branch`. The doubled branch is followed to the
    tuning `start` or `stop` (mesh frequency over natural frequency), depending on the direction in
    which it starts; `settings` are further arguments of `gearlib.continue_orbit`.
    """
    orbit = switch_branch(model, branch, point)
    change = orbit.tuning - float(branch.tuning[point])
    if abs(change) > _MIN_TUNING_CHANGE:
        target_tuning = stop if change > 0.0 else start
        return continue_orbit(orbit, to=target_tuning, **settings)
    # The direction is not known, so both are tried and the longer branch is kept.
    limits = (start, stop)
    candidates = [continue_orbit(orbit, to=tuning, limits=limits, **settings) for tuning in limits]
    return max(candidates, key=lambda candidate: candidate.sizes["point"])


def _join_branches(datasets: Sequence[xr.Dataset], attrs: dict, title: str) -> xr.Dataset:
    """Join branches along ``point``, with NaN for the Floquet multipliers of grazing orbits.

    A grazing orbit touches the boundary of contact at zero velocity. Near it, the multipliers
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
    """Compute the curves (loci) of special orbits of one mesh period over tuning and damping ratio.

    Special orbits are folds, period doublings and grazings, orbits that touch the boundary of
    contact. `branches` are the branches of orbits of `pair`. The loci lie between the tunings
    (dimensionless mesh frequencies) `start` and `stop` and between the damping ratios `lowest` and
    `highest`. In the dataset, ``locus`` is the index of the point of the branches from which a
    locus starts, and ``own_damping`` the damping ratio of `pair`, with which the branches were
    computed.
    """
    labels = branches.label.values
    tunings = start, stop
    damping_ratio = pair.damping_ratio
    names = ["state", "multiplier_real", "multiplier_imaginary", "residual", "tuning", "label"]
    # An empty dataset ensures that the result has its variables even without any locus.
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

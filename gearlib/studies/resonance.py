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
from gearlib.data.variables import describe
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
    """Return a sweep over a window of tunings (first, last), labelled with damping and direction.

    The tunings are those of `pair`; `model` runs at the same speeds. `run` has arguments of
    `gearlib.sweep`, `step` is that of the tuning, `damping` the name of the damping, `direction`
    "cold" (every run from the same initial state), "up" or "down", and `threads` the number of
    threads. A downward sweep that has not jumped continues below the window, down to the tuning
    `lowest`.
    """
    first, last = window
    tunings = model.tuning_from(pair, np.array(grid(first, last, step)))
    if direction == "down" and lowest is not None:
        curve, _ = sweep_down(
            model, tunings, model.tuning_from(pair, lowest), threads=threads, **run
        )
    else:
        curve = sweep(model, tunings, direction=direction, threads=threads, **run)
    return describe(curve.assign_coords(damping=damping, direction=direction))


def branches(pair: GearPair, settings: dict, damping: str) -> xr.Dataset:
    """Return the branches of a gear pair, labelled with the name of its damping.

    `settings` are arguments of `branches_of`.
    """
    return describe(branches_of(pair, **settings).assign_coords(damping=damping))


def branches_of(model: Any, start: float, stop: float, **settings: Any) -> xr.Dataset:
    """Return the branches of periodic orbits between two tunings, joined along ``point``.

    `settings` have step, max_height and max_points of `gearlib.continue_orbit`. Raise NoOrbit if
    there is no orbit of one mesh period at either tuning.
    """
    branches: list[xr.Dataset] = []
    for first, last in ((start, stop), (stop, start)):
        if not branches or float(branches[0].tuning[-1]) != first:
            orbit = _orbit_at(model, first)
            if orbit is not None:
                branches.append(continue_orbit(orbit, to=last, **settings))
    if not branches:
        raise NoOrbit(f"no orbit of one mesh period was found at tuning = {start!r} or {stop!r}")
    for branch in list(branches):
        for point in np.flatnonzero(branch.label == DOUBLING):
            try:
                branches.append(_doubled_branch(model, branch, int(point), start, stop, settings))
            except NoOrbit:
                continue
    numbered = [
        branch.assign(
            branch=("point", np.full(branch.sizes["point"], number, np.int32)),
            period=("point", np.full(branch.sizes["point"], int(branch.period), np.int32)),
        )
        for number, branch in enumerate(branches)
    ]
    return _joined(numbered, branches[0].attrs, "Branches of periodic orbits of a gear mesh")


def _orbit_at(model: Any, tuning: float) -> Any:
    """Return an orbit of one mesh period, None if none is found from two starts."""
    for guess in ((1.0, 0.0), None):
        try:
            return periodic_orbit(model, tuning, guess=guess)
        except NoOrbit:
            continue
    return None


def _doubled_branch(
    model: Any, branch: xr.Dataset, point: int, start: float, stop: float, settings: dict
) -> xr.Dataset:
    """Return the branch of doubled period that starts at a point of a branch.

    It is followed to the tuning `start` or `stop`, depending on the direction in which it starts.
    """
    orbit = switch_branch(model, branch, point)
    change = orbit.tuning - float(branch.tuning[point])
    if abs(change) > _MIN_TUNING_CHANGE:
        return continue_orbit(orbit, to=stop if change > 0.0 else start, **settings)
    limits = (start, stop)
    directions = [continue_orbit(orbit, to=tuning, limits=limits, **settings) for tuning in limits]
    return max(directions, key=lambda branch: branch.sizes["point"])


def _joined(datasets: Sequence[xr.Dataset], attrs: dict, title: str) -> xr.Dataset:
    """Return datasets joined along ``point``, with NaN for the multipliers of grazing orbits.

    These multipliers change with the square root of the distance from the grazing orbit, so half of
    their digits are rounding errors.
    """
    dataset = xr.concat(datasets, "point", data_vars="minimal", combine_attrs="override")
    for name in ("multiplier_real", "multiplier_imaginary"):
        regular = dataset[name].where(dataset.label != GRAZING)
        dataset[name] = regular.assign_attrs(dataset[name].attrs)
    dataset.attrs = attrs | {"title": title}
    return dataset


def loci(
    pair: GearPair, branches: xr.Dataset, start: float, stop: float, lowest: float, highest: float
) -> xr.Dataset:
    """Return the loci of folds, doublings and grazings of period one over tuning and damping.

    `branches` are those of the gear pair. The loci lie between the
    tunings `start` and `stop` and between the damping ratios `lowest` and `highest`. ``locus`` is
    the index of the special point of the branches from which a locus starts, ``own_damping`` the
    damping ratio with which the branches were computed, that of `pair`.
    """
    labels, tunings = branches.label.values, (start, stop)
    damping_ratio = pair.damping_ratio
    names = ["state", "multiplier_real", "multiplier_imaginary", "residual", "tuning", "label"]
    # An empty dataset ensures that the result has its variables even without any locus.
    empty = branches.isel(point=slice(0))[names].reset_coords(drop=True).drop_encoding()
    datasets = [empty.assign(damping_ratio=("point", []), locus=("point", np.empty(0, np.int32)))]
    is_special = np.isin(labels, (FOLD, DOUBLING, GRAZING)) & (branches.period.values == 1)
    for point in np.flatnonzero(is_special):
        for limit in (lowest, highest):
            if limit == damping_ratio:
                continue
            try:
                curve = locus(pair, branches, int(point), "damping", to=limit, limits=tunings)
            except NoOrbit:
                continue
            size, curve = curve.sizes["point"], curve.rename(damping="damping_ratio")
            label = "point", np.full(size, labels[point], np.int8)
            number = "point", np.full(size, point, np.int32)
            datasets.append(curve.assign(label=label, locus=number))
    dataset = _joined(datasets, branches.attrs, "Loci of special points over tuning and damping")
    return describe(dataset.assign(own_damping=damping_ratio))

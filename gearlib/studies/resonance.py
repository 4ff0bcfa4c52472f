"""The resonance characteristics of Fig. 3, the branches of periodic orbits behind them, and loci.

Orbits of one mesh period are followed from both ends of the range of tunings, those of two from the
period doublings met on the way. Orbits that do not hang together with the ends are not found.
"""

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.continuation import continue_orbit, switch_branch
from gearlib.analysis.orbits.followed_parameters import value_of
from gearlib.analysis.orbits.loci import locus
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.orbits.special_points import DOUBLING, FOLD, GRAZING
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep, sweep_down
from gearlib.tunings import grid

#: Difference of tuning below which a doubled orbit stands across the tuning at its doubling.
_ACROSS = 1e-9


def window(pair, window, step, run, damping, direction, threads, lowest=None):
    """Return the summaries of a sweep over a window (first, last tuning), with its names.

    A downward sweep goes on to the tuning `lowest` unless that is None, until it has jumped.
    """
    tunings, model = np.array(grid(window[0], window[1], step)), GearPair(**pair)
    if direction == "down" and lowest is not None:
        summaries, _ = sweep_down(model, tunings, lowest, threads=threads, **run)
    else:
        summaries = sweep(model, tunings, direction=direction, threads=threads, **run)
    return describe(summaries.assign_coords(damping=damping, direction=direction))


def branches(pair, settings, damping):
    """Return the branches of the pair with these parameters, labelled with a name."""
    return describe(branches_of(GearPair(**pair), **settings).assign_coords(damping=damping))


def branches_of(model, start, stop, **settings):
    """Return the branches of a model between two tunings, one after the other over ``point``.

    `settings` are step, max_height and max_points of `gearlib.continue_orbit`. NoOrbit if neither
    end has an orbit of one mesh period.
    """
    followed = []
    for here, there in ((start, stop), (stop, start)):
        if not followed or float(followed[0].tuning[-1]) != here:
            orbit = _orbit_at(model, here)
            followed += [continue_orbit(orbit, to=there, **settings)] if orbit else []
    if not followed:
        raise NoOrbit(f"no orbit of one mesh period was found at tuning = {start!r} or {stop!r}")
    for branch in list(followed):
        for point in np.flatnonzero(branch.label == DOUBLING):
            try:
                followed.append(_doubled(model, branch, int(point), start, stop, settings))
            except NoOrbit:
                continue
    parts = [
        branch.assign(
            branch=("point", np.full(branch.sizes["point"], number, np.int32)),
            period=("point", np.full(branch.sizes["point"], int(branch.period), np.int32)),
        )
        for number, branch in enumerate(followed)
    ]
    return _together(parts, followed[0].attrs, "Branches of periodic orbits of a gear mesh")


def _orbit_at(model, tuning):
    """Return an orbit near the static deflection or from rest, None if there is none."""
    for guess in ((1.0, 0.0), None):
        try:
            return periodic_orbit(model, tuning, guess=guess)
        except NoOrbit:
            continue
    return None


def _doubled(model, branch, point, start, stop, settings):
    """Return the branch of twice the period that begins at a doubling."""
    orbit = switch_branch(model, branch, point)
    away = orbit.tuning - float(branch.tuning[point])
    if abs(away) > _ACROSS:
        return continue_orbit(orbit, to=stop if away > 0.0 else start, **settings)
    limits = (start, stop)
    both = [continue_orbit(orbit, to=to, limits=limits, **settings) for to in limits]
    return max(both, key=lambda branch: branch.sizes["point"])


def _together(parts, attrs, title):
    """Return parts over ``point`` as one, with NaN for multipliers of grazing orbits.

    They change like the root of the distance from the grazing: half of its digits are rounding.
    """
    dataset = xr.concat(parts, "point", data_vars="minimal", combine_attrs="override")
    for name in ("multiplier_real", "multiplier_imaginary"):
        regular = dataset[name].where(dataset.label != GRAZING)
        dataset[name] = regular.assign_attrs(dataset[name].attrs)
    dataset.attrs = attrs | {"title": title}
    return dataset


def loci(pair, branches, start, stop, lowest, highest):
    """Return the loci of folds, doublings and grazings of period one over tuning and damping.

    `branches` are those of the pair with these parameters; the loci lie between the tunings start
    and stop and the damping ratios lowest and highest. ``locus`` numbers their special points.
    """
    model = GearPair(**pair)
    own_damping, labels = value_of(model, 1.0, "damping"), branches.label.values
    names = ["state", "multiplier_real", "multiplier_imaginary", "residual", "tuning", "label"]
    nothing = branches.isel(point=slice(0))[names].reset_coords(drop=True).drop_encoding()
    parts = [nothing.assign(damping_ratio=("point", []), locus=("point", np.empty(0, np.int32)))]
    special = np.isin(labels, (FOLD, DOUBLING, GRAZING)) & (branches.period.values == 1)
    for point in np.flatnonzero(special):
        for to in (lowest, highest):
            if to == own_damping:
                continue
            try:
                curve = locus(model, branches, int(point), "damping", to=to, limits=(start, stop))
            except NoOrbit:
                continue
            size = curve.sizes["point"]
            parts.append(
                curve.rename(damping="damping_ratio").assign(
                    label=("point", np.full(size, labels[point], np.int8)),
                    locus=("point", np.full(size, point, np.int32)),
                )
            )
    title = "Loci of special points over tuning and damping"
    together = _together(parts, branches.attrs, title)
    return describe(together.assign(own_damping=own_damping))

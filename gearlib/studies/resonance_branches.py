"""The branches of periodic orbits behind Fig. 3, and the loci of their special points.

Orbits of one mesh period are followed from both ends of the range of tunings, those of two from
the period doublings met on the way. Undamped mesh has orbits of its own far from any other; only
what hangs together with the ends of the range is found.
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

#: States from which orbits are looked for at the ends: near the static deflection, then from rest.
_GUESSES = ((1.0, 0.0), None)
#: A doubled orbit this close to its doubling, in tuning, stands across the tuning.
_ACROSS = 1e-9


def of_damping(pair, settings, damping):
    """Return the branches of the pair of these parameters, labelled with a name."""
    return describe(compute(GearPair(**pair), **settings).assign_coords(damping=damping))


def loci_of(pair, branches, start, stop, lowest, highest):
    """Return the loci of the pair of these parameters; others as in `compute_loci`."""
    return compute_loci(GearPair(**pair), branches, start, stop, lowest, highest)


def compute(pair, start, stop, **settings):
    """Return the branches of one pair over the tuning.

    start, stop: tunings; **settings: step, max_height, max_points of `gearlib.continue_orbit`.

    As of `gearlib.continue_orbit`, one branch after the other over ``point``: their numbers in
    branch, their periods in period. Multipliers are NaN at grazings.

    NoOrbit if neither end has an orbit of one mesh period.
    """
    found = []
    for here, there in ((start, stop), (stop, start)):
        if found and float(found[0].tuning[-1]) == here:
            # The first branch came here already.
            continue
        orbit = _at_end(pair, here)
        if orbit is not None:
            found.append(continue_orbit(orbit, to=there, **settings))
    if not found:
        raise NoOrbit(f"no orbit of one mesh period was found at tuning = {start!r} or {stop!r}")
    found += [
        branch for single in found for branch in _doubled(pair, single, start, stop, settings)
    ]
    parts = [
        branch.assign(
            branch=("point", np.full(branch.sizes["point"], number, np.int32)),
            period=("point", np.full(branch.sizes["point"], int(branch.period), np.int32)),
        )
        for number, branch in enumerate(found)
    ]
    dataset = xr.concat(parts, "point", data_vars="minimal", combine_attrs="override")
    dataset.attrs["title"] = "Branches of periodic orbits of a gear mesh"
    return describe(_without_multipliers_at_grazings(dataset))


def _without_multipliers_at_grazings(dataset):
    """Return the dataset with NaN for multipliers of grazing orbits.

    They change like the root of the distance from the grazing: half of the digits of the place, and
    of what rounding leaves of it, are no digits of theirs.
    """
    away = dataset.label != GRAZING
    names = ("multiplier_real", "multiplier_imaginary")
    return dataset.assign(
        {name: dataset[name].where(away).assign_attrs(dataset[name].attrs) for name in names}
    )


def _at_end(pair, tuning):
    for guess in _GUESSES:
        try:
            return periodic_orbit(pair, tuning, guess=guess)
        except NoOrbit:
            continue
    return None


def _doubled(pair, branch, start, stop, settings):
    """Yield the branches of twice the period that begin at the doublings of a branch."""
    for point in np.flatnonzero(branch.label == DOUBLING):
        try:
            orbit = switch_branch(pair, branch, int(point))
            away = orbit.tuning - float(branch.tuning[point])
            if abs(away) > _ACROSS:
                yield continue_orbit(orbit, to=stop if away > 0.0 else start, **settings)
                continue
            both = [
                continue_orbit(orbit, to=to, limits=(start, stop), **settings)
                for to in (start, stop)
            ]
        except NoOrbit:
            continue
        yield max(both, key=lambda one: one.sizes["point"])


def compute_loci(pair, branches, start, stop, lowest, highest):
    """Return the loci of folds, doublings and grazings of period one over tuning and damping.

    pair: the pair of the branches; branches: as in `compute`; start, stop: tunings between which
    the loci are followed; lowest, highest: damping ratios in contact between which they are.

    As of `gearlib.locus`, with the number of the special point from which each was followed.
    """
    parts = []
    given = value_of(pair, 1.0, "damping")
    labels = branches.label.values
    wanted = np.isin(labels, (FOLD, DOUBLING, GRAZING)) & (branches.period.values == 1)
    for point in np.flatnonzero(wanted):
        for to in (lowest, highest):
            if to == given:
                continue
            try:
                curve = locus(pair, branches, int(point), "damping", to=to, limits=(start, stop))
            except NoOrbit:
                continue
            size = curve.sizes["point"]
            parts.append(
                curve.rename(damping="damping_ratio").assign(
                    label=("point", np.full(size, labels[point], np.int8)),
                    locus=("point", np.full(size, point, np.int32)),
                )
            )
    if not parts:
        # A branch without special points has no loci.
        parts = [
            branches.isel(point=slice(0))[
                ["state", "multiplier_real", "multiplier_imaginary", "residual", "tuning", "label"]
            ].assign(damping_ratio=("point", np.empty(0)), locus=("point", np.empty(0, np.int32)))
        ]
    dataset = xr.concat(parts, "point", data_vars="minimal", combine_attrs="override")
    dataset = dataset.assign(own_damping=given)
    dataset["label"].attrs |= branches.label.attrs
    dataset.attrs = branches.attrs | {"title": "Loci of special points over tuning and damping"}
    return describe(_without_multipliers_at_grazings(dataset))

"""All meshes of the paper's reducer, its Fig. 1 a, over speed: branches alike, and with errors.

The paper prints no number of the machine beyond those of one mesh; what is chosen stands in the
section `reducer` of the configuration and in `gearlib.models.trains.ready_made`. The tuning is
that of the pair alone, mesh frequency of the first stage over the mean eigenfrequency of its
`GearPair`. Every motion has many starts, see `gearlib.studies.trains.motions`.
"""

import numpy as np
import xarray as xr

from gearlib.data.motions import ROUNDING, lost_share
from gearlib.data.result import result
from gearlib.models.pair import GearPair
from gearlib.models.trains.ready_made import split_power_reducer
from gearlib.runs.sweeping import DIRECTIONS
from gearlib.studies.trains import motions

BRANCHES = 3

#: What is kept of every motion: median and range over its starts.
_KEPT = ("dynamic_factor", "load_sharing", "fraction_normal")
#: What the shares of the starts are told of, for each branch.
_ALONE = ("lost_alone_share", "struck_alone_share")


def train_of(pair, settings, **changes):
    """Return the reducer, `GearTrain`, counted in tunings of the pair alone.

    settings: teeth, modules (m), shaft_stiffness (N m/rad), support_stiffness (N/m), damping_ratio
    (of supports and shafts, at the mean eigenfrequency of the pair); **changes: other arguments of
    `gearlib.split_power_reducer`.
    """
    frequency = pair.mesh_frequency(1.0)
    arguments = {
        "branches": BRANCHES,
        "teeth": settings["teeth"],
        "modules": settings["modules"],
        "shaft_stiffness": settings["shaft_stiffness"],
        "support_stiffness": settings["support_stiffness"],
        "structural_damping": 2.0 * settings["damping_ratio"] / frequency,
        "reference_frequency": frequency / (2.0 * np.pi),
    }
    return split_power_reducer(pair, **arguments | changes)


def displaced(settings):
    """Return `pin_errors` with the axis of the first satellite displaced, radial, tangential, m."""
    return [tuple(settings["pin_error"])] + [(0.0, 0.0)] * (BRANCHES - 1)


def cases(pair, settings):
    """Return name -> train: branches alike, one axis displaced, unequal backlash."""
    gaps = [(backlash, backlash) for backlash in settings["backlashes"]]
    return {
        "alike": train_of(pair, settings),
        "pin_error": train_of(pair, settings, pin_errors=displaced(settings)),
        "unequal_backlash": train_of(pair, settings, backlashes=gaps),
    }


def alone(happens, branch):
    """Return the only branch in which something happens, 0 where there is none or several.

    happens: shape (..., m), by mesh; branch: shape (m,), branch of each mesh, from 1.

    Shape (...).
    """
    numbers = np.unique(branch)
    there = np.stack([happens[..., branch == n].any(axis=-1) for n in numbers], axis=-1)
    return np.where(there.sum(axis=-1) == 1, there @ numbers, 0).astype(np.int32)


def compute(pair, tunings, settings):
    """Return the resonance characteristics of all meshes, from static equilibrium, up and down.

    pair (keyword arguments of `GearPair`: every mesh); tunings: shape (t,); settings: as of
    `train_of`, and pin_error (m, radial and tangential), backlashes (m, by branch), and those of
    `gearlib.studies.trains.motions`.

    As of `motions.over_directions`, over case too; largest factors are those of settled motions.
    Where the gears lie, of `GearTrain.layout`, is that of branches alike.
    """
    pair, tunings = GearPair(**pair), np.asarray(tunings, float)
    trains = cases(pair, settings)
    names = trains["alike"].mesh_names
    branch = np.array([int(name.split()[1]) for name in names])
    stage = [1 if name.startswith("first") else 2 for name in names]
    parts = []
    for train in trains.values():
        own, every = motions.over_directions(train, tunings, settings, _KEPT, DIRECTIONS)
        share = {name: [] for name in _ALONE}
        for one in every:
            lost = lost_share(one.fraction_normal.values) > 0.0
            struck = one.fraction_inverse.values > ROUNDING
            for name, happens in zip(_ALONE, (lost, struck), strict=True):
                only = alone(happens, branch)
                share[name].append((only[..., None] == np.unique(branch)).mean(axis=0))
        over = ("direction", "tuning", "branch")
        settled = own.dynamic_factor.where(own.settled == 1)
        there = settled.notnull().any("tuning")
        top = settled.fillna(-np.inf).argmax("tuning")
        parts.append(
            own.assign({name: (over, np.array(values)) for name, values in share.items()}).assign(
                largest_factor=settled.max("tuning"),
                factor_tuning=xr.DataArray(tunings, dims="tuning").isel(tuning=top).where(there),
            )
        )
    whole = xr.concat(
        parts, xr.DataArray(list(trains), dims="case", name="case"), combine_attrs="override"
    )
    dataset = whole.assign(
        mesh_branch=("mesh", branch.astype(np.int32)),
        mesh_stage=("mesh", np.array(stage, np.int32)),
        speed=("tuning", trains["alike"].speed(tunings)),
    ).assign_coords(tuning=tunings, mesh=list(names), branch=np.unique(branch).astype(np.int32))
    dataset = dataset.merge(trains["alike"].layout())
    title = "All meshes of a reducer with three double satellites"
    said = {name: settings[name] for name in ("pin_error", "backlashes", *motions.SETTINGS)}
    return result(title, trains["alike"], dataset, method="exact", initial_state="static", **said)


def rows(characteristics):
    """Yield what all starts share as a table, a row for each case, direction and mesh."""
    data = characteristics
    factors = ["largest_dynamic_factor", "at_tuning", "at_speed_rpm"]
    only = ["contact_lost_in_its_branch_only_at", "far_flank_struck_in_its_branch_only_at"]
    yield ["case", "direction", "mesh", *factors, *only, "not_settled_at"]
    per_tuning = float(data.speed[0] / data.tuning[0])
    for case in data.case.values:
        for direction in data.direction.values:
            shown = data.sel(case=case, direction=direction)
            settled = shown.settled.values == 1
            for j, mesh in enumerate(data.mesh.values):
                nu = float(shown.factor_tuning[j])
                numbers = [f"{float(shown.largest_factor[j]):.4g}", f"{nu:g}"]
                own = shown.sel(branch=int(data.mesh_branch[j]))
                places = [settled & (own[name].values == 1.0) for name in _ALONE]
                listed = [_listed(data.tuning.values[at]) for at in (*places, ~settled)]
                speed = f"{per_tuning * nu:.0f}"
                yield [case, direction, mesh, *numbers, speed, *listed]


def _listed(tunings):
    return " ".join(f"{nu:g}" for nu in tunings)

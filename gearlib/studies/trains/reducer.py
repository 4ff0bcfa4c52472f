"""All meshes of the paper's reducer, its Fig. 1 a, over speed: branches alike, and with errors.

The paper prints no number of the machine beyond those of one mesh; what is chosen stands in the
section `reducer` of the configuration and in `gearlib.models.trains.reducer`. The tuning is that of
the pair alone, mesh frequency of the first stage over the mean eigenfrequency of its `GearPair`.
"""

import numpy as np
import xarray as xr

from gearlib.data import files, provenance
from gearlib.data.contact_loss import ROUNDING, lost_share
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.models.trains.reducer import split_power_reducer
from gearlib.runs.sweeping import DIRECTIONS, sweep

BRANCHES = 3

#: What is kept of every sweep.
_KEPT = (
    "dynamic_factor",
    "load_sharing",
    "fraction_normal",
    "fraction_inverse",
    "bounces",
    "period",
    "status",
)


def train_of(pair, settings, **changes):
    """Return the reducer, `GearTrain`, counted in tunings of the pair alone.

    Parameters
    ----------
    pair : GearPair
    settings : dict
        teeth, modules (m), shaft_stiffness (N m/rad), support_stiffness (N/m), damping_ratio (of
        supports and shafts, at the mean eigenfrequency of the pair).
    **changes
        Other arguments of `gearlib.split_power_reducer`.
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

    Parameters
    ----------
    happens : ndarray of bool, shape (..., m)
        By mesh.
    branch : ndarray of int, shape (m,)
        Branch of each mesh, from 1.

    Returns
    -------
    ndarray of int, shape (...)
    """
    numbers = np.unique(branch)
    there = np.stack([happens[..., branch == n].any(axis=-1) for n in numbers], axis=-1)
    return np.where(there.sum(axis=-1) == 1, there @ numbers, 0).astype(np.int32)


def compute(pair, tunings, settings):
    """Return the resonance characteristics of all meshes, from static equilibrium, up and down.

    Parameters
    ----------
    pair : dict
        Keyword arguments of `GearPair`: every mesh.
    tunings : sequence of float, shape (t,)
    settings : dict
        As of `train_of`, and pin_error (m, radial and tangential), backlashes (m, by branch),
        periods, record_periods.

    Returns
    -------
    xarray.Dataset
        Over (case, direction, tuning, mesh): dynamic_factor, load_sharing, fraction_normal,
        fraction_inverse, bounces; over (case, direction, tuning): period, status, lost_alone and
        struck_alone, the only branch that loses contact, that strikes its far flanks (0: none or
        several); over (case, direction, mesh): largest_factor and factor_tuning; over mesh:
        mesh_branch, mesh_stage.
    """
    pair = GearPair(**pair)
    trains = cases(pair, settings)
    run = {name: settings[name] for name in ("periods", "record_periods")}
    sweeps = [
        [
            sweep(train, tunings, direction=direction, initial_state="static", **run)
            for direction in DIRECTIONS
        ]
        for train in trains.values()
    ]
    first = sweeps[0][0]
    names = first.mesh.values
    branch = np.array([int(name.split()[1]) for name in names])
    over = ("case", "direction")
    data = {
        name: (
            (*over, *first[name].dims),
            np.array([[one[name].values for one in row] for row in sweeps]),
        )
        for name in _KEPT
    }
    lost = lost_share(data["fraction_normal"][1]) > 0.0
    struck = data["fraction_inverse"][1] > ROUNDING
    data["lost_alone"] = ((*over, "tuning"), alone(lost, branch))
    data["struck_alone"] = ((*over, "tuning"), alone(struck, branch))
    factor = data["dynamic_factor"][1]
    data["largest_factor"] = ((*over, "mesh"), factor.max(axis=2))
    data["factor_tuning"] = ((*over, "mesh"), first.tuning.values[factor.argmax(axis=2)])
    data["mesh_branch"] = ("mesh", branch.astype(np.int32))
    stage = [1 if name.startswith("first") else 2 for name in names]
    data["mesh_stage"] = ("mesh", np.array(stage, np.int32))
    data["speed"] = ("tuning", first.speed.values)
    dataset = xr.Dataset(
        data,
        {
            "case": list(trains),
            "direction": list(DIRECTIONS),
            "tuning": first.tuning.values,
            "mesh": list(names),
        },
    )
    dataset.attrs = provenance.attributes(
        "All meshes of a reducer with three double satellites",
        trains["alike"],
        method="exact",
        initial_state="static",
        pin_error=settings["pin_error"],
        backlashes=settings["backlashes"],
        **run,
    )
    return describe(dataset)


def write_csv(characteristics, path):
    """Write what is found as a table, a row for each case, direction and mesh.

    Parameters
    ----------
    characteristics : xarray.Dataset
        Of `compute`.
    path : str or os.PathLike
    """
    data = characteristics
    with files.table(path) as writer:
        factors = ["largest_dynamic_factor", "at_tuning", "at_speed_rpm"]
        only = ["contact_lost_in_its_branch_only_at", "far_flank_struck_in_its_branch_only_at"]
        writer.writerow(["case", "direction", "mesh", *factors, *only])
        per_tuning = float(data.speed[0] / data.tuning[0])
        for case in data.case.values:
            for direction in data.direction.values:
                shown = data.sel(case=case, direction=direction)
                for j, mesh in enumerate(data.mesh.values):
                    nu = float(shown.factor_tuning[j])
                    numbers = [f"{float(shown.largest_factor[j]):.4g}", f"{nu:g}"]
                    branch = int(data.mesh_branch[j])
                    alone = [
                        " ".join(f"{x:g}" for x in data.tuning.values[shown[name] == branch])
                        for name in ("lost_alone", "struck_alone")
                    ]
                    speed = f"{per_tuning * nu:.0f}"
                    writer.writerow([case, direction, mesh, *numbers, speed, *alone])

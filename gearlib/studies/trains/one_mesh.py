"""Whether one mesh stands for the machine: models of the reducer, from one pair to all of it.

The paper names a reducer with three double satellites and studies one mesh of one branch. Here the
models of that reducer run side by side: in phase and started exactly alike, as small models take
it; the same started a little beside; with branches out of phase, one axis displaced, soft supports.
For every case the smallest model is named whose answers are those of the whole train, within a
tolerance.
"""

import dataclasses
import math

import numpy as np
import xarray as xr

from gearlib.data import files, provenance
from gearlib.data.contact_loss import lost_share
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.models.trains.parts import gear_masses
from gearlib.runs.sweeping import sweep
from gearlib.studies.trains.reducer import BRANCHES, displaced, train_of

#: From the smallest to the whole. ``pair_in_train``: the pair with its share of the central gear.
MODELS = ("pair", "pair_in_train", "two_meshes", "torsional", "whole")
CASES = ("in_phase", "disturbed", "out_of_phase", "pin_error", "soft_supports")
#: Of the first stage, which the pair stands for; the last is the mean distance, over all tunings,
#: of the largest dynamic factor from that of the whole train.
OBSERVABLES = (
    "peak_tuning",
    "peak_factor",
    "jump_tuning",
    "contact_loss",
    "load_sharing",
    "characteristic",
)

#: Change of the dynamic factor from tuning to tuning that counts as a jump.
JUMP = 0.5


def in_phase(train, branches=BRANCHES):
    """Return the train of equal branches in phase as one branch, the reduced train of two meshes.

    In the motion in which all branches move alike the central gears do not leave their axes, and
    each branch moves its share of them.

    Parameters
    ----------
    train : GearTrain
        As of `gearlib.split_power_reducer`.
    branches : int

    Returns
    -------
    GearTrain
        The first branch, with input and output on rigid axes, of an N-th of their inertia and
        torque.
    """
    central = {
        name: dataclasses.replace(
            train.by_name[name],
            inertia=train.by_name[name].inertia / branches,
            torque=train.by_name[name].torque / branches,
            support_stiffness=math.inf,
            support_damping=0.0,
        )
        for name in ("input", "output")
    }
    own = ("satellite 1 a", "satellite 1 b")
    return dataclasses.replace(
        train,
        bodies=[*central.values(), *(train.by_name[name] for name in own)],
        meshes=[mesh for mesh in train.meshes if mesh.name in ("first 1", "second 1")],
        shafts=[shaft for shaft in train.shafts if shaft.bodies == own],
    )


def models(pair, settings, case, changes):
    """Return name -> model of one case, the names of `MODELS`.

    Parameters
    ----------
    pair : GearPair
    settings : dict
        Of the reducer, as of `gearlib.studies.trains.reducer.train_of`, and pin_error.
    case : str
        One of `CASES`.
    changes : dict
        other_teeth, of which the branches are out of phase; soft_support, N/m.
    """
    errors = {}
    if case == "out_of_phase":
        settings = settings | {"teeth": changes["other_teeth"]}
    if case == "soft_supports":
        settings = settings | {"support_stiffness": changes["soft_support"]}
    if case == "pin_error":
        errors = {"pin_errors": displaced(settings)}
    driving, driven = gear_masses(pair, *settings["teeth"][:2])
    share = 1.0 / (BRANCHES / driving + 1.0 / driven)
    return {
        "pair": pair,
        "pair_in_train": pair.replace(reduced_mass=share),
        "two_meshes": in_phase(train_of(pair, settings)),
        "torsional": train_of(pair, settings, support_stiffness=math.inf, **errors),
        "whole": train_of(pair, settings, **errors),
    }


def characteristic(model, pair, tunings, disturbance, run):
    """Return what a model says of the first stage, from static equilibrium.

    Parameters
    ----------
    model : GearPair or GearTrain
    pair : GearPair
        Whose mean eigenfrequency the tunings are counted in.
    tunings : sequence of float, shape (t,)
    disturbance : float
        Of the first mode of a train at the start, static deflections.
    run : dict
        periods, record_periods.

    Returns
    -------
    tuple of ndarray, shape (t,)
        Largest dynamic factor, largest share of time without drive-side contact, and largest load
        sharing, of all meshes of the stage.
    """
    if not model.mesh_names:
        unit = model.mesh_frequency(1.0) / pair.mesh_frequency(1.0)
        start = (pair.mean_stiffness / pair.max_stiffness, 0.0)
        found = sweep(model, np.asarray(tunings) / unit, initial_state=start, **run)
        ones = np.ones(found.tuning.size)
        return found.dynamic_force_max.values, lost_share(found.fraction_normal).values, ones
    start = model.disturbed("static", disturbance)
    found = sweep(model, tunings, initial_state=start, **run)
    found = found.isel(mesh=[name.startswith("first") for name in found.mesh.values])
    kept = found.dynamic_factor, lost_share(found.fraction_normal), found.load_sharing
    return tuple(one.max("mesh").values for one in kept)


def observe(tunings, factor, loss, sharing):
    """Return the numbers of `OBSERVABLES` but the last; NaN for a jump that is not there."""
    tunings = np.asarray(tunings)
    steps = np.abs(np.diff(factor))
    i, top = int(np.argmax(steps)), int(np.argmax(factor))
    jump = (tunings[i] + tunings[i + 1]) / 2.0 if steps[i] > JUMP else math.nan
    return [tunings[top], factor[top], jump, loss.mean(), sharing.max()]


def relative_changes(values):
    """Return by how much answers differ from those of the last model, over these.

    Parameters
    ----------
    values : ndarray, shape (..., models, observables)

    Returns
    -------
    ndarray, of the same shape
        Infinity where only one of both has a jump, or loses contact.
    """
    whole = np.broadcast_to(values[..., -1:, :], values.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(values - whole) / np.abs(whole)
    one_missing = np.isnan(values) != np.isnan(whole)
    return np.where(one_missing, math.inf, np.where(np.isnan(change), 0.0, change))


def compute(pair, tunings, settings, changes):
    """Return all models in all cases, and the smallest that suffices in each.

    Parameters
    ----------
    pair : dict
        Keyword arguments of `GearPair`: every mesh.
    tunings : sequence of float, shape (t,)
    settings : dict
        Of the reducer, as of `models`, and periods, record_periods.
    changes : dict
        As of `models`, and disturbance, tolerance.

    Returns
    -------
    xarray.Dataset
        dynamic_factor over (case, model, tuning), the largest of the first stage; answer and
        answer_change over (case, model, observable); sufficient over case; tolerance.
    """
    pair = GearPair(**pair)
    run = {name: settings[name] for name in ("periods", "record_periods")}
    factors = np.empty((len(CASES), len(MODELS), len(tunings)))
    values = np.empty((len(CASES), len(MODELS), len(OBSERVABLES)))
    known = {}
    for i, case in enumerate(CASES):
        for j, (name, model) in enumerate(models(pair, settings, case, changes).items()):
            # Only several branches can part; the small models are the same in several cases.
            parts = case != "in_phase" and name in ("torsional", "whole")
            beside = changes["disturbance"] if parts else 0.0
            if (model, beside) not in known:
                known[model, beside] = characteristic(model, pair, tunings, beside, run)
            factors[i, j] = known[model, beside][0]
            values[i, j, :-1] = observe(tunings, *known[model, beside])
    whole = factors[:, -1:]
    values[..., -1] = (np.abs(factors - whole) / whole).mean(axis=-1)
    change = relative_changes(values)
    change[..., -1] = values[..., -1]
    within = (change <= changes["tolerance"]).all(axis=-1)
    dataset = xr.Dataset(
        {
            "dynamic_factor": (("case", "model", "tuning"), factors),
            "answer": (("case", "model", "observable"), values),
            "answer_change": (("case", "model", "observable"), change),
            "sufficient": ("case", [MODELS[int(row.argmax())] for row in within]),
            "tolerance": float(changes["tolerance"]),
            "static_deflection": pair.static_deflection,
        },
        {
            "case": list(CASES),
            "model": list(MODELS),
            "tuning": np.asarray(tunings, float),
            "observable": list(OBSERVABLES),
        },
    )
    dataset.attrs = provenance.attributes(
        "Models of a reducer, from one mesh to the whole train",
        train_of(pair, settings),
        method="exact",
        initial_state="static",
        **run,
    )
    return describe(dataset)


def write_csv(comparison, path):
    """Write the answers as a table, a row for each case and model.

    Parameters
    ----------
    comparison : xarray.Dataset
        Of `compute`.
    path : str or os.PathLike
    """
    names = [str(name) for name in comparison.observable.values]
    with files.table(path) as writer:
        changes = [f"change_of_{name}" for name in names[:-1]]
        writer.writerow(["case", "model", *names, *changes, "smallest_that_suffices"])
        for case in comparison.case.values:
            for model in comparison.model.values:
                one = comparison.sel(case=case, model=model)
                values = [*one.answer.values, *one.answer_change.values[:-1]]
                chosen = "yes" if model == one.sufficient.item() else "no"
                writer.writerow([case, model, *(f"{x:.4g}" for x in values), chosen])

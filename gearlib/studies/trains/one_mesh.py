"""Whether one mesh stands for the machine: models of the reducer, from one pair to all of it.

The paper names a reducer with three double satellites and studies one mesh of one branch. Here the
models of that reducer run side by side: in phase and held alike, as small models take it; the same
from starts beside; with branches out of phase, one axis displaced, soft supports. For every case
the smallest model is named whose answers are those of the whole train, within a tolerance, from
all starts.
"""

import dataclasses
import math

import numpy as np
import xarray as xr

from gearlib.data.lost_contact import lost_share
from gearlib.data.result import result
from gearlib.data.status import settled_flags
from gearlib.models.pair import GearPair
from gearlib.models.trains.parts import gear_masses
from gearlib.studies import many_starts
from gearlib.studies.trains import motions
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

#: Answers from two starts that are this close, relatively, are one.
_SAME = 1e-9
#: In place of a number that is another one from start to start.
_DIFFERS = "differs"
#: Change of the dynamic factor from tuning to tuning that counts as a jump.
JUMP = 0.5


def in_phase(train, branches=BRANCHES):
    """Return the train of equal branches in phase as one branch, the reduced train of two meshes.

    In the motion in which all branches move alike the central gears do not leave their axes, and
    each branch moves its share of them.

    train: as of `gearlib.split_power_reducer`.

    The first branch, with input and output on rigid axes, of an N-th of their inertia and torque.
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

    settings: of the reducer, as of `gearlib.studies.trains.reducer.train_of`, and pin_error; case:
    one of `CASES`; changes (other_teeth, of which the branches are out of phase; soft_support,
    N/m).
    """
    errors = {}
    if case == "out_of_phase":
        settings = settings | {"teeth": changes["other_teeth"]}
    if case == "soft_supports":
        settings = settings | {"support_stiffness": changes["soft_support"]}
    if case == "pin_error":
        errors = {"pin_errors": displaced(settings)}
    torsional, whole = (
        train_of(pair, settings, **errors, **rigid)
        for rigid in ({"support_stiffness": math.inf}, {})
    )
    if case == "in_phase":
        # Their motion with all branches alike.
        torsional, whole = in_phase(torsional), in_phase(whole)
    driving, driven = gear_masses(pair, *settings["teeth"][:2])
    share = 1.0 / (BRANCHES / driving + 1.0 / driven)
    return {
        "pair": pair,
        "pair_in_train": pair.replace(reduced_mass=share),
        "two_meshes": in_phase(train_of(pair, settings)),
        "torsional": torsional,
        "whole": whole,
    }


def characteristic(model, pair, tunings, settings):
    """Return what a model says of the first stage, from starts beside static equilibrium.

    pair: whose mean eigenfrequency the tunings are counted in; tunings: shape (t,); settings: as of
    `gearlib.studies.trains.motions`.

    Largest dynamic factor, largest share of time without drive-side contact, and largest load
    sharing, of all meshes of the stage, shape (starts, t); whether all starts settle on one orbit
    and rounding decides none of them, and whether it decides none, shape (t,).
    """
    if not model.mesh_names:
        tunings = np.asarray(tunings) * pair.mesh_frequency(1.0) / model.mesh_frequency(1.0)
        state = (pair.mean_stiffness / pair.max_stiffness, 0.0)
        found = motions.from_rest(model, tunings, settings, state)
        names = ("dynamic_force_max", "fraction_normal")
        one = motions.summarise(model, found, settings, names)
        factor, loss = one.dynamic_force_max.values, lost_share(one.fraction_normal.values)
        kept = motions.kept(model, tunings, found, settings, state)
        return factor, loss, np.ones_like(factor), one.settled.values * kept, kept
    found = motions.from_rest(model, tunings, settings)
    names = ("dynamic_factor", "fraction_normal", "load_sharing")
    one = motions.summarise(model, found, settings, names)
    one = one.isel(mesh=[name.startswith("first") for name in model.mesh_names])
    every = one.dynamic_factor, lost_share(one.fraction_normal), one.load_sharing
    kept = motions.kept(model, tunings, found, settings)
    return *(values.max("mesh").values for values in every), one.settled.values * kept, kept


def observe(tunings, factor, loss, sharing):
    """Return the numbers of `OBSERVABLES` but the last; NaN for a jump that is not there."""
    tunings = np.asarray(tunings)
    steps = np.abs(np.diff(factor))
    i, top = int(np.argmax(steps)), int(np.argmax(factor))
    jump = (tunings[i] + tunings[i + 1]) / 2.0 if steps[i] > JUMP else math.nan
    return [tunings[top], factor[top], jump, loss.mean(), sharing.max()]


def certain(factor, sharing, firm):
    """Return which numbers of `observe` hang on no motion that rounding decides.

    Such a motion is known by its range over all starts, here with as much again on both sides. What
    is largest is certain if it is so wherever in these ranges the others lie.

    factor, sharing: shape (starts, t), as of `characteristic`; firm: shape (t,), where rounding
    decides no motion.

    Shape (starts, 5).
    """
    low, high = _bounds(factor, firm)
    top, peak = _largest(low, high)
    least = np.maximum(0.0, np.maximum(low[:, 1:] - high[:, :-1], low[:, :-1] - high[:, 1:]))
    most = np.maximum(high[:, 1:] - low[:, :-1], high[:, :-1] - low[:, 1:])
    step, jump = _largest(least, most)
    at_step = np.take_along_axis(least, step[:, None], axis=1)[:, 0]
    jump = (jump & (at_step > JUMP)) | (most.max(axis=1) <= JUMP)
    shared, most_shared = _largest(*_bounds(sharing, firm))
    loss = np.full(len(factor), firm.all())
    return np.stack([peak, peak & firm[top], jump, loss, most_shared & firm[shared]], axis=1)


def _bounds(values, firm):
    low, high = values.min(axis=0), values.max(axis=0)
    wide = high - low
    return np.where(firm, values, low - wide), np.where(firm, values, high + wide)


def _largest(low, high):
    """Return which has the largest lower bound, and whether no other can be larger."""
    top = low.argmax(axis=1)
    others = np.where(np.arange(low.shape[1]) == top[:, None], -np.inf, high)
    return top, np.take_along_axis(low, top[:, None], axis=1)[:, 0] >= others.max(axis=1)


def relative_changes(values):
    """Return by how much answers differ from those of the last model, over these.

    values: shape (..., models, observables).

    Infinity where only one of both has a jump, or loses contact.
    """
    whole = np.broadcast_to(values[..., -1:, :], values.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(values - whole) / np.abs(whole)
    one_missing = np.isnan(values) != np.isnan(whole)
    return np.where(one_missing, math.inf, np.where(np.isnan(change), 0.0, change))


def _free_changes(firm):
    """Return where rounding decides neither an answer nor that of the whole train."""
    both = firm & firm[..., -1:, :]
    # The whole train differs from itself by nothing, whatever it does.
    both[..., -1, :] = True
    return both


def compute(pair, tunings, settings, changes):
    """Return all models in all cases, and the smallest that suffices in each.

    pair (keyword arguments of `GearPair`: every mesh); tunings: shape (t,); settings: of the
    reducer, as of `models`, and periods, record_periods; changes: as of `models`, and tolerance,
    and the starts of `gearlib.studies.trains.motions`.

    Medians over the starts, with their ranges; shared is an answer that is the same from all
    starts and hangs, as that of the whole train, on no motion that rounding decides.
    """
    pair = GearPair(**pair)
    settings = settings | {name: changes[name] for name in motions.SETTINGS if name in changes}
    count = settings["starts"]
    factors = np.empty((len(CASES), len(MODELS), count, len(tunings)))
    values = np.empty((len(CASES), count, len(MODELS), len(OBSERVABLES)))
    settled = np.empty((len(CASES), len(MODELS), len(tunings)), np.int8)
    firm = np.empty((len(CASES), len(MODELS), len(OBSERVABLES)), bool)
    known = {}
    for i, case in enumerate(CASES):
        for j, model in enumerate(models(pair, settings, case, changes).values()):
            # The small models are the same in several cases.
            if model not in known:
                known[model] = characteristic(model, pair, tunings, settings)
            *found, settled[i, j], kept = known[model]
            factors[i, j] = found[0]
            values[i, :, j, :-1] = [observe(tunings, *one) for one in zip(*found, strict=True)]
            firm[i, j, :-1] = certain(found[0], found[2], kept).all(axis=0)
            firm[i, j, -1] = kept.all()
    whole = factors[:, -1:]
    away = (np.abs(factors - whole) / whole).mean(axis=-1)
    values[..., -1] = away.swapaxes(1, 2)
    change = relative_changes(values)
    change[..., -1] = values[..., -1]
    firm[..., -1] &= firm[:, -1:, -1]
    both = _free_changes(firm)
    least, most = change.min(axis=1), change.max(axis=1)
    with np.errstate(invalid="ignore"):
        most = np.where(both, most, 2.0 * most - least)
    within = (most <= changes["tolerance"]).all(axis=-1)
    shared = [np.isclose(one, one[:, :1], rtol=_SAME, equal_nan=True) for one in (values, change)]
    over, answers = ("case", "model", "tuning"), ("case", "model", "observable")
    data = {
        "settled": (over, settled, motions.SETTLED_FLAGS),
        "answer_free_of_rounding": (
            answers,
            firm.astype(np.int8),
            settled_flags("free_of_rounding"),
        ),
        "answer_shared": (
            answers,
            (np.logical_and(*shared).all(axis=1) & firm & both).astype(np.int8),
            settled_flags("shared"),
        ),
        "sufficient": ("case", [MODELS[int(row.argmax())] for row in within]),
        "tolerance": float(changes["tolerance"]),
        "static_deflection": pair.static_deflection,
    }
    every = xr.Dataset(
        {
            "dynamic_factor": (("case", "model", "start", "tuning"), factors),
            "answer": (("case", "start", "model", "observable"), values),
            "answer_change": (("case", "start", "model", "observable"), change),
        }
    )
    data |= many_starts.over_starts(every, list(every))
    coords = {
        "case": list(CASES),
        "model": list(MODELS),
        "tuning": np.asarray(tunings, float),
        "observable": list(OBSERVABLES),
    }
    said = {name: settings[name] for name in motions.SETTINGS} | {"initial_state": "static"}
    title = "Models of a reducer, from one mesh to the whole train"
    whole_train = train_of(pair, settings)
    dataset = xr.Dataset(data, coords).merge(whole_train.layout())
    return result(title, whole_train, dataset, method="exact", **said)


def rows(comparison):
    """Yield the digits of the answers that all starts share, a row for each case and model.

    Answers that hang on motions which rounding decides have none.
    """
    names = [str(name) for name in comparison.observable.values]
    firm = comparison.answer_free_of_rounding == 1
    settled = {"answer": firm, "answer_change": firm.copy(data=_free_changes(firm.values))}
    changes = [f"change_of_{name}" for name in names[:-1]]
    yield ["case", "model", *names, *changes, "smallest_that_suffices"]
    for case in comparison.case.values:
        for model in comparison.model.values:
            one = comparison.sel(case=case, model=model)
            texts = [
                _shared_digits(low, high) if sure else _DIFFERS
                for name, few in (("answer", None), ("answer_change", -1))
                for low, high, sure in zip(
                    one[f"{name}_low"].values[:few],
                    one[f"{name}_high"].values[:few],
                    settled[name].sel(case=case, model=model).values[:few],
                    strict=True,
                )
            ]
            chosen = "yes" if model == one.sufficient.item() else "no"
            yield [case, model, *texts, chosen]


def _shared_digits(low, high):
    """Return the digits, four at most, that all numbers of a range have, wider by itself."""
    if low == high or math.isnan(low):
        return f"{low:.4g}"
    for digits in (4, 3, 2):
        first, last = (f"{x:#.{digits}g}" for x in (2.0 * low - high, 2.0 * high - low))
        if first == last:
            return first
    return _DIFFERS

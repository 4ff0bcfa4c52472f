"""Scenes: time courses of a few runs side by side, by the smallest model that carries them.

A scene states its observables and a tolerance. Every model runs its cases; the change of a model
is the largest difference of an observable from any larger model, in units of

* the height of the larger model's orbit, or of its force, for extrema of displacement or force;
* one, for fractions of time and bounces per mesh period.

The smallest model whose change is within the tolerance carries the scene. A truncated stiffness is
no smaller than the rectangle, whose phases have closed forms; its row shows what the cut changes.
Where rounding decides a run, seeded starts take its place, and the change has to be within the
tolerance from all of them.
"""

import math

import numpy as np
import xarray as xr

from gearlib.data.status import flags_of
from gearlib.data.variables import describe
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.models.six_degrees import SixDegreePair
from gearlib.runs.simulation import simulate
from gearlib.studies import many_starts

#: Models, from the smallest to the largest, and the smallest with a truncated stiffness.
LADDER = ("one_degree", "six_degrees_plain", "six_degrees")
TRUNCATED = "one_degree_harmonics"

#: Entry of the table in place of a number that differs from start to start.
DIFFERS = "differs"
#: Changes that are smaller are differences of rounding.
_MIN_CHANGE = 1e-9
#: Change of an extremum by a tiny change of the start from which on rounding decides a motion.
_ROUNDING_CHANGE = 1e-3
_DISPLACEMENTS = ("displacement_max", "displacement_min")
_FORCES = ("dynamic_force_max", "dynamic_force_min")
_FLAGS = flags_of(("unsettled", "free_of_rounding"))


def build(name, pair, six_degrees, harmonics=None):
    """Return the model with one of the names above.

    `pair` are arguments of `GearPair`, `six_degrees` those of `SixDegreePair` beside the pair,
    `harmonics` is the number of those of the truncated stiffness.
    """
    pair = GearPair(**pair)
    if name == "one_degree":
        return pair
    if name == TRUNCATED:
        return OneDegreePair(pair=pair, profile=Fourier(harmonics))
    if name == "six_degrees_plain":
        six_degrees = six_degrees | {"friction": (0.0, 0.0), "eccentricities": (0.0, 0.0)}
    return SixDegreePair(pair=pair, **six_degrees)


def runs(model, tuning, run, settings):
    """Return the run from the start asked for, and the runs that stand for the motion.

    They are that run itself where rounding does not decide it, else those from seeded starts. `run`
    has arguments of `gearlib.simulate`, `settings` those of `many_starts.seeded_states`.
    """
    run = {"initial_state": (0.0, 0.0)} | run

    def from_state(state, **other):
        state = tuple(map(float, state))
        return simulate(model, tuning, **run | other | {"initial_state": state})

    state = np.asarray(run["initial_state"], float)
    first = from_state(state, until_settled=True)
    near = from_state(many_starts.neighbouring_state(state), samples_per_period=1)
    extrema = (*_DISPLACEMENTS, *_FORCES)
    if max(abs(float(first[name] - near[name])) for name in extrema) < _ROUNDING_CHANGE:
        return first, [first]
    starts = many_starts.seeded_states(model, state, settings)
    return first, [from_state(start, samples_per_period=1) for start in starts]


def of_comparison(comparison, cases, six_degrees, run, starts):
    """Return the scene by the model that its comparison chose; arguments as in `scene`."""
    return scene(cases, comparison.chosen.item(), six_degrees, run, starts)


def scene(cases, model, six_degrees, run, starts):
    """Return the time courses and orbit summaries of cases by the model of a name.

    A case has title, tuning and pair, arguments of `GearPair`; `run` and `starts` as in `runs`.
    Over (case, phase) from the start of the record, and (case): also free_of_rounding, and
    losing_share, that of the starts from which contact is lost.
    """
    courses = []
    for case in cases:
        built = build(model, case["pair"], six_degrees)
        first, standing = runs(built, case["tuning"], run, starts)
        course = first.drop_dims("event")
        course["free_of_rounding"] = (), np.int8(standing[0] is first), _FLAGS
        course["losing_share"] = (), np.mean([float(record.bounces) > 0.0 for record in standing])
        phase = (course.phase - course.phase[0]).assign_attrs(course.phase.attrs)
        courses.append(describe(course.assign_coords(phase=phase), built))
    together = {"data_vars": "all", "coords": "minimal", "compat": "equals", "join": "exact"}
    titles = xr.IndexVariable("case", [case["title"] for case in cases])
    whole = xr.concat(courses, titles, combine_attrs="drop_conflicts", **together)
    return describe(whole.assign(model=model))


def compare(cases, question, six_degrees, harmonics, run, starts):
    """Return the values, changes and costs of all models in a scene, and the model chosen for it.

    `cases`, `run` and `starts` as in `scene`; `question` has observables, tolerance, and the
    candidates, models that may carry the scene, the smallest first. The change of the largest model
    is NaN; that of the truncated stiffness is from the rectangle. Where rounding decides, values,
    changes and costs are medians over the starts, with ranges.
    """
    names, observables = [*LADDER, TRUNCATED], question["observables"]
    values = np.empty((starts["starts"], len(names), len(cases), len(observables)))
    units, costs = np.ones_like(values), np.empty(values.shape[:-1])
    alone = np.empty(costs.shape[1:], bool)
    for i, j in np.ndindex(alone.shape):
        pair, tuning = cases[j]["pair"], cases[j]["tuning"]
        model = build(names[i], pair, six_degrees, harmonics)
        first, standing = runs(model, tuning, run, starts)
        alone[i, j] = standing[0] is first
        # A run that is free of rounding stands for all starts.
        values[:, i, j] = [[float(record[name]) for name in observables] for record in standing]
        units[:, i, j] = [[_unit(record, name) for name in observables] for record in standing]
        costs[:, i, j] = [_cost(model, tuning, record, run) for record in standing]
    change, free = _changes(values, units, alone)
    lowest, highest = change.min(axis=0), change.max(axis=0)
    # A range from some starts is widened by itself: all of it has to be within the tolerance.
    with np.errstate(invalid="ignore"):
        highest = np.where(free, highest, 2.0 * highest - lowest)
    candidates, tolerance = question["candidates"], question["tolerance"]
    carrying = [name for name in candidates[:-1] if highest[names.index(name)] <= tolerance]
    every = xr.Dataset(
        {
            "value": (("start", "model", "case", "observable"), values),
            "change": (("start", "model"), change),
            "cost": (("start", "model"), costs.mean(axis=2)),
        }
    )
    data = many_starts.ranges_over_starts(every, [*every]) | {
        "free_of_rounding": (("model", "case"), alone.astype(np.int8), _FLAGS),
        "change_free_of_rounding": ("model", free.astype(np.int8), _FLAGS),
        "chosen": (carrying or candidates[-1:])[0],
        "tolerance": float(tolerance),
        "harmonics": harmonics,
    }
    titles = [case["title"] for case in cases]
    coords = {"model": names, "case": titles, "observable": list(observables)}
    attrs = {k: v for k, v in first.attrs.items() if k not in ("gear_pair", "parameters")}
    return describe(
        xr.Dataset(data, coords, attrs | {"title": "Comparison of models for one scene"})
    )


def _changes(values, units, alone):
    """Return the changes over (start, model), and for which models no run is decided by rounding.

    Values and their units are over (start, model, case, observable), `alone` over (model, case).
    """
    change, free = np.full(values.shape[:2], np.nan), alone.all(axis=1)
    last = len(LADDER)
    # The truncated stiffness, behind the others, is compared with the smallest model.
    larger = {i: [*range(i + 1, last)] for i in range(last - 1)} | {last: [0]}
    for i, others in larger.items():
        apart = np.abs(values[:, [i]] - values[:, others]) / units[:, others]
        # From a start that could not go on nothing is within a tolerance.
        change[:, i] = np.where(np.isnan(apart), math.inf, apart).max(axis=(1, 2, 3))
        free[i] &= alone[others].all()
    change[change < _MIN_CHANGE] = 0.0
    return change, free


def _unit(run, observable):
    """Return the unit of a change of an observable, by the larger model's run."""
    if observable in _DISPLACEMENTS:
        return float(run.displacement_max - run.displacement_min)
    if observable in _FORCES:
        return float(run.dynamic_force_max - run.dynamic_force_min)
    return 1.0


def _cost(model, tuning, record, run):
    """Return the components of the state times the pieces of a mesh period that a run advances.

    Pieces are phases of contact for closed forms and modes, coefficients for Taylor steps, whose
    number depends on rounding: there the cost is 1, 2 or 5 times a power of ten.
    """
    propagator, evaluations = model.propagator(tuning), int(record.evaluations)
    if not evaluations:
        # Three segments of stiffness, and what the contact events add.
        phases = record.event.size / run["record_periods"] + 3
        return propagator.components * (propagator.pieces + phases)
    work = propagator.components * evaluations / run["periods"]
    power = 10.0 ** math.floor(math.log10(work))
    return min((digit * power for digit in (1, 2, 5, 10)), key=lambda x: abs(math.log(x / work)))


def rows(comparisons, scenes):
    """Yield the table of comparisons: a head and a row for each scene and model."""
    yield ["scene", "model", "change", "tolerance", "cost", "chosen"]
    for name_of_scene, data in zip(scenes, comparisons, strict=True):
        for i, name in enumerate(data.model.values):
            free = bool(data.change_free_of_rounding[i])
            change, work = (
                f"{value:.4g}" if free or math.isnan(value) else DIFFERS
                for value in (float(data.change[i]), float(data.cost[i]))
            )
            chosen = "yes" if name == data.chosen.item() else "no"
            yield [name_of_scene, name, change, f"{float(data.tolerance):g}", work, chosen]

"""No more model than a scene needs: what larger models would change, against what they cost.

A scene states its observables and a tolerance. Every model runs its cases; the change of a model
is the largest difference of an observable from any larger model, in units of

* the height of the larger model's orbit, or of its force, for extrema of displacement or force;
* one, for fractions of time and bounces per mesh period.

The smallest model whose change is within the tolerance carries the scene. A truncated stiffness is
no smaller than the rectangle, whose phases have closed forms; its row shows what the cut changes.
Of runs that rounding decides seeded starts are asked, and the change has to be within the tolerance
from all of them.
"""

import math

import numpy as np
import xarray as xr

from gearlib.data.variables import describe
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.models.six_degrees import SixDegreePair
from gearlib.studies import many_starts, runs_beside

#: name -> words; from the smallest to the largest, the truncated stiffness apart.
LADDER = {
    "one_degree": "1 degree of freedom",
    "six_degrees_plain": "6 degrees of freedom, no run-out, no friction",
    "six_degrees": "6 degrees of freedom, run-out and friction",
}
TRUNCATED = "one_degree_harmonics"

#: In the table, in place of a number that is another one from start to start.
DIFFERS = "differs"
#: Changes that are smaller are differences of rounding.
_NOTHING = 1e-9

_DISPLACEMENTS = ("displacement_max", "displacement_min")
_FORCES = ("dynamic_force_max", "dynamic_force_min")


def build(name, pair, six_degrees, harmonics=None):
    """Return the model of a name in `LADDER`, or the truncated one.

    pair: keyword arguments of `GearPair`; six_degrees: what `SixDegreePair` needs beyond the pair;
    harmonics: of the truncated stiffness.
    """
    pair = GearPair(**pair)
    if name == "one_degree":
        return pair
    if name == TRUNCATED:
        return OneDegreePair(pair=pair, profile=Fourier(harmonics))
    if name == "six_degrees_plain":
        without = {"friction": (0.0, 0.0), "eccentricities": (0.0, 0.0)}
        return SixDegreePair(pair=pair, **six_degrees | without)
    return SixDegreePair(pair=pair, **six_degrees)


def cost(model, tuning, result, run):
    """Return the deterministic cost of a run: components advanced per mesh period.

    Components of the state times the pieces of a period: phases of contact for closed forms and
    modes, series coefficients for Taylor steps, whose number hangs on the last digits, so that it
    is told as 1, 2 or 5 times a power of ten.
    """
    # Three segments of stiffness, and what the contact events add.
    phases = result.event.size / run["record_periods"] + 3
    propagator, evaluations = model.propagator(tuning), int(result.evaluations)
    if not evaluations:
        return propagator.components * (propagator.pieces + phases)
    work = propagator.components * evaluations / run["periods"]
    power = 10.0 ** math.floor(math.log10(work))
    return min((digit * power for digit in (1, 2, 5, 10)), key=lambda x: abs(math.log(x / work)))


def compute(cases, question, six_degrees, harmonics, run, starts):
    """Return the comparison of models for one scene.

    cases: each with title, tuning and pair (keyword arguments of `GearPair`); question
    (observables: variables of `gearlib.sweep`; tolerance; candidates: the models in `LADDER` that
    may carry the scene, the smallest first); six_degrees: what `SixDegreePair` needs beyond the
    pair; harmonics: of the truncated stiffness; run: arguments of `gearlib.simulate`; starts
    (starts, seed, spread: as in `gearlib.studies.runs_beside.runs`).

    value over (model, case, observable); change over (model,): the largest change that any larger
    model makes, NaN for the largest; for the truncated stiffness that from the rectangle; cost over
    (model,); each the median over the starts where rounding decides a run, with its range;
    free_of_rounding over (model, case), whether it does not, and change_free_of_rounding over
    (model,), whether in none of the runs of change and cost; chosen: the name of the model;
    tolerance.
    """
    names, observables = [*LADDER, TRUNCATED], question["observables"]
    tolerance, candidates = question["tolerance"], question["candidates"]
    values = np.empty((starts["starts"], len(names), len(cases), len(observables)))
    units = np.ones_like(values)
    costs = np.empty(values.shape[:-1])
    alone = np.empty(costs.shape[1:], bool)
    for i, name in enumerate(names):
        for j, case in enumerate(cases):
            model, tuning = build(name, case["pair"], six_degrees, harmonics), case["tuning"]
            result, told = runs_beside.runs(model, tuning, run, starts)
            alone[i, j] = told[0] is result
            # One that is free of rounding stands for all starts.
            values[:, i, j] = [[float(one[key]) for key in observables] for one in told]
            units[:, i, j] = [[_unit(one, key) for key in observables] for one in told]
            costs[:, i, j] = [cost(model, tuning, one, run) for one in told]
    change = np.full(values.shape[:2], np.nan)
    free: np.ndarray = alone.all(axis=1)
    # The truncated stiffness is compared with the first, the largest model with none.
    larger = {i: [*range(i + 1, len(LADDER))] for i in range(len(LADDER) - 1)} | {len(LADDER): [0]}
    for i, others in larger.items():
        apart = np.abs(values[:, [i]] - values[:, others]) / units[:, others]
        # From a start that could not go on nothing is within a tolerance.
        change[:, i] = np.where(np.isnan(apart), math.inf, apart).max(axis=(1, 2, 3))
        free[i] &= alone[others].all()
    change[change < _NOTHING] = 0.0
    least, most = change.min(axis=0), change.max(axis=0)
    # A range from some starts is widened by itself: all of it has to be within the tolerance.
    with np.errstate(invalid="ignore"):
        most = np.where(free, most, 2.0 * most - least)
    carried = [name for name in candidates[:-1] if most[names.index(name)] <= tolerance]
    every = xr.Dataset(
        {
            "value": (("start", "model", "case", "observable"), values),
            "change": (("start", "model"), change),
            "cost": (("start", "model"), costs.mean(axis=2)),
        }
    )
    dataset = xr.Dataset(
        many_starts.over_starts(every, list(every))
        | {
            "free_of_rounding": (("model", "case"), alone.astype(np.int8), runs_beside.FLAGS),
            "change_free_of_rounding": ("model", free.astype(np.int8), runs_beside.FLAGS),
            "chosen": (carried or candidates[-1:])[0],
            "tolerance": float(tolerance),
            "harmonics": harmonics,
        },
        {
            "model": names,
            "case": [case["title"] for case in cases],
            "observable": list(observables),
        },
    )
    dataset.attrs = result.attrs | {"title": "Comparison of models for one scene"}
    for name in ("gear_pair", "parameters"):
        dataset.attrs.pop(name, None)
    return describe(dataset)


def _unit(run, observable):
    """Return the unit in which a change of an observable is measured, from the larger model."""
    if observable in _DISPLACEMENTS:
        return float(run.displacement_max - run.displacement_min)
    if observable in _FORCES:
        return float(run.dynamic_force_max - run.dynamic_force_min)
    return 1.0


def rows(comparisons, scenes):
    """Yield the comparisons of all scenes as one table, replacing the file in one step.

    What rounding decides has no number there."""
    yield ["scene", "model", "change", "tolerance", "cost", "chosen"]
    for scene, data in zip(scenes, comparisons, strict=True):
        for i, name in enumerate(data.model.values):
            free = bool(data.change_free_of_rounding[i])
            change, work = (
                f"{value:.4g}" if free or math.isnan(value) else DIFFERS
                for value in (float(data[key][i]) for key in ("change", "cost"))
            )
            chosen = "yes" if name == data.chosen.item() else "no"
            yield [scene, name, change, f"{float(data.tolerance):g}", work, chosen]

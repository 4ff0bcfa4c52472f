"""No more model than a scene needs: what larger models would change, against what they cost.

A scene states its observables and a tolerance. Every model runs its cases; the change of a model
is the largest difference of an observable from any larger model, in units of

* the height of the larger model's orbit, or of its force, for extrema of displacement or force;
* one, for fractions of time and bounces per mesh period.

The smallest model whose change is within the tolerance carries the scene. A truncated stiffness is
no smaller than the rectangle, whose phases have closed forms; its row shows what the cut changes.
"""

import numpy as np
import xarray as xr

from gearlib.data import files
from gearlib.data.variables import describe
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.models.six_degrees import SixDegreePair
from gearlib.runs.simulation import simulate

#: name -> words; from the smallest to the largest, the truncated stiffness apart.
LADDER = {
    "one_degree": "1 degree of freedom",
    "six_degrees_plain": "6 degrees of freedom, no run-out, no friction",
    "six_degrees": "6 degrees of freedom, run-out and friction",
}
TRUNCATED = "one_degree_harmonics"

_DISPLACEMENTS = ("displacement_max", "displacement_min")
_FORCES = ("dynamic_force_max", "dynamic_force_min")


def build(name, pair, six_degrees, harmonics=None):
    """Return the model of a name in `LADDER`, or the truncated one.

    Parameters
    ----------
    name : str
    pair : dict
        Keyword arguments of `GearPair`.
    six_degrees : dict
        What `SixDegreePair` needs beyond the pair.
    harmonics : int, optional
        Of the truncated stiffness.
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

    Components of the state times the pieces of a period: phases of contact for closed forms,
    series coefficients for Taylor steps, substeps and phases for matrix exponentials.
    """
    # Three segments of stiffness, and what the contact events add.
    phases = result.event.size / run["record_periods"] + 3
    propagator, evaluations = model.propagator(tuning), int(result.evaluations)
    pieces = evaluations / run["periods"] if evaluations else propagator.pieces + phases
    return propagator.components * pieces


def compute(cases, six_degrees, harmonics, observables, tolerance, candidates, run):
    """Return the comparison of models for one scene.

    Parameters
    ----------
    cases : list of dict
        Each with title, tuning and pair (keyword arguments of `GearPair`).
    six_degrees : dict
        What `SixDegreePair` needs beyond the pair.
    harmonics : int
        Of the truncated stiffness.
    observables : list of str
        Variables of `gearlib.sweep`.
    tolerance : float
    candidates : list of str
        The models in `LADDER` that may carry the scene, the smallest first.
    run : dict
        Arguments of `gearlib.simulate`.

    Returns
    -------
    xarray.Dataset
        value over (model, case, observable); change over (model,): the largest change that any
        larger model makes, NaN for the largest; for the truncated stiffness that from the
        rectangle; cost over (model,); chosen: the name of the model; tolerance.
    """
    names = [*LADDER, TRUNCATED]
    values = np.empty((len(names), len(cases), len(observables)))
    units = np.ones_like(values)
    costs = np.empty((len(names), len(cases)))
    for i, name in enumerate(names):
        for j, case in enumerate(cases):
            model = build(name, case["pair"], six_degrees, harmonics)
            result = simulate(model, case["tuning"], **run)
            values[i, j] = [float(result[key]) for key in observables]
            units[i, j] = [_unit(result, key) for key in observables]
            costs[i, j] = cost(model, case["tuning"], result, run)
    change = np.full(len(names), np.nan)
    for i in range(len(LADDER) - 1):
        larger = slice(i + 1, len(LADDER))
        change[i] = np.max(np.abs(values[i] - values[larger]) / units[larger])
    change[-1] = np.max(np.abs(values[-1] - values[0]) / units[0])
    carried = [name for name in candidates[:-1] if change[names.index(name)] <= tolerance]
    dataset = xr.Dataset(
        {
            "value": (("model", "case", "observable"), values),
            "change": ("model", change),
            "cost": ("model", costs.mean(axis=1)),
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


def write_csv(comparisons, scenes, path):
    """Write the comparisons of all scenes as one table, replacing the file in one step.

    Parameters
    ----------
    comparisons : list of xarray.Dataset
        Results of `compute`.
    scenes : list of str
        The names of their scenes.
    path : str or os.PathLike
    """
    with files.table(path) as writer:
        writer.writerow(["scene", "model", "change", "tolerance", "cost", "chosen"])
        for scene, data in zip(scenes, comparisons, strict=True):
            for name, change, work in zip(
                data.model.values, data.change.values, data.cost.values, strict=True
            ):
                chosen = "yes" if name == data.chosen.item() else "no"
                writer.writerow(
                    [
                        scene,
                        name,
                        f"{change:.4g}",
                        f"{float(data.tolerance):g}",
                        f"{work:.4g}",
                        chosen,
                    ]
                )

"""`tongues`: parametric resonance, where the motion without loss of contact is unstable."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.tongues import hill_tongues, meissner
from gearlib.data.result import result
from gearlib.models.model import is_model
from gearlib.models.profiles import Rectangular, Tabulated
from gearlib.runs.run_arguments import check_tuning

#: Parameters that may vary beside the tuning.
PARAMETERS = ("stiffness_ratio", "contact_ratio", "damping")
#: Smallest tuning: below it there are hundreds of tongues, and growth over a period overflows.
MIN_TUNING = 0.02
#: Variables of the dataset -> (field of `Tongue`, value where there is none).
_COLUMNS = {
    "tuning_from": ("start", math.nan),
    "tuning_to": ("stop", math.nan),
    "edge_multiplier": ("multiplier", 0),
    "growth": ("growth", math.nan),
    "growth_tuning": ("peak", math.nan),
}


def tongues(pair, *, start=0.3, stop=3.0, parameter=None, values=None, step=0.002):
    """Find the tongues of parametric resonance: tunings at which contact without loss is unstable.

    Small deviations from the motion without loss of contact obey Hill's equation, for the
    rectangular stiffness that of Meissner. A tongue of order n, near nu = 2 / n, is an interval of
    tunings in which they grow from mesh period to mesh period; on its edges a Floquet multiplier is
    (-1)^n. Damping narrows and then closes it.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or GearTrain
        Its backlash plays no part. Closed forms for the rectangular stiffness of one degree of
        freedom; else numerical monodromy, see `gearlib.analysis.tongues.hill_tongues`.
    start, stop : float
        Tongues that meet this range of tunings are given, with both their edges; with six degrees
        they are cut off at it. 0.02 <= start < stop.
    parameter : {"stiffness_ratio", "contact_ratio", "damping"}, optional
        A second parameter: kappa, epsilon, or the damping ratio beta of the contact. The first two
        keep the damping ratio; a table and six degrees of freedom only have the last one. Of a
        `GearTrain` stiffness_ratio, contact_ratio or material_damping of all its meshes.
    values : sequence of float, shape (v,), optional
        Values of the second parameter.
    step : float, default 0.002
        With six degrees: distance of the tunings of the scan.

    Returns
    -------
    xarray.Dataset
        Over order (six degrees: tongue, not numbered), and over the parameter before it if there
        is one: tuning_from and tuning_to, the edges, equal where a tongue is a point, NaN where it
        is closed or out of range; edge_multiplier, 0 for a complex pair; growth, the largest
        logarithm of the largest multiplier in the tongue, below 0 if it is closed, and
        growth_tuning, where that is. Without `parameter` also closing_damping, the damping ratio
        of the contact from which the tongue stays closed (six degrees: is closed; NaN: never).

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range; also for nonlinear damping or
        stiffness, with which the stability depends on the motion: see `gearlib.periodic_orbit`.

    Notes
    -----
    Edges of closed form are those of the exact equation to about 1e-15, less next to the damping
    that closes a tongue, where they meet. Equations: `gearlib.analysis.tongues.meissner`.
    """
    start = checks.number("start", start, f">= {MIN_TUNING}", lambda nu: MIN_TUNING <= nu < 1e6)
    stop = check_tuning("stop", stop)
    if stop <= start:
        raise ValueError(f"stop = {stop!r} is not allowed: it must be > start = {start!r}")
    pair, step = linear_model(pair), check_tuning("step", step)
    if parameter is None:
        checks.require(values is None, "values", values, "left out where parameter is None")
        tongue_lists = [find(pair, start, stop, step)]
    else:
        checks.one_of("parameter", parameter, PARAMETERS if pair.mesh else (*pair.parameters,)[1:])
        values = _checked_values(values)
        models = [varied(pair, parameter, value) for value in values]
        tongue_lists = [find(model, start, stop, step) for model in models]
    dimension = "tongue" if pair.size > 2 else "order"
    data, coords = _variables(tongue_lists, parameter, values, dimension)
    if parameter is None and pair.mesh:
        closings = [closing_damping(pair, tongue) for tongue in tongue_lists[0]]
        data["closing_damping"] = dimension, np.array(closings, float)
    return result(
        "Tongues of parametric resonance",
        pair,
        data,
        coords,
        method="closed form" if pair.mesh is pair else "monodromy",
        start=start,
        stop=stop,
    )


def linear_model(pair: Any) -> Any:
    """Return the smallest model with the stability of a linear model without contact loss.

    Raise ValueError if its damping or stiffness is nonlinear.
    """
    has_gears = is_model(pair) and (pair.mesh or pair.mesh_names)
    if not has_gears or (pair.size == 2 and pair.equation is None):
        raise checks.refusal("pair", pair, "a GearPair, OneDegreePair, SixDegreePair or GearTrain")
    for name in pair.nonlinear:
        if getattr(pair, name):
            raise ValueError(
                f"{name} = {getattr(pair, name)!r} is not allowed: it must be 0, or the stability "
                "depends on the motion: see gearlib.periodic_orbit"
            )
    return pair.mesh if isinstance(pair.profile, Rectangular) else pair


def find(pair: Any, start: float, stop: float, step: float = 0.002) -> list:
    """Return the `Tongue`s of a linear model that meet the tunings from `start` to `stop`.

    With several degrees of freedom, tunings are scanned with the distance `step`.
    """
    if pair.mesh is pair:
        equation = meissner.equation_of(pair)
        return [meissner.tongue(equation, n) for n in meissner.orders(equation, start, stop)]
    if pair.size > 2:
        return hill_tongues.tongues_of_several_degrees(pair, start, stop, step)
    return hill_tongues.tongues_of_one_degree(pair, start, stop)


def closing_damping(pair: Any, tongue: meissner.Tongue) -> float:
    """Return the damping ratio of the contact above which a tongue of a model is closed."""
    if pair.mesh is pair:
        return meissner.closing_damping(pair.contact_ratio, pair.stiffness_ratio, tongue.order)
    if pair.size > 2:
        return hill_tongues.closing_damping_of_six_degrees(pair, tongue)
    return hill_tongues.closing_damping(pair, tongue)


def varied(pair: Any, parameter: str, value: float) -> Any:
    """Return a model with another value of a parameter.

    The parameter is "stiffness_ratio", "contact_ratio" or "damping", the damping ratio. The first
    two keep the damping ratio. A `GearTrain` has its own parameters.
    """
    if pair.mesh_names:
        return pair.with_parameter(parameter, value)
    damping = pair.damping_ratio
    if parameter == "damping":
        damping = checks.finite_nonnegative("damping", value)
    elif pair.size > 2 or isinstance(pair.profile, Tabulated):
        raise checks.refusal(
            "parameter", parameter, "'damping' for a table of the stiffness and for six degrees"
        )
    else:
        pair = pair.replace(**{parameter: value})
    return hill_tongues.with_damping(pair, damping)


def _checked_values(values: Any) -> list:
    """Return the argument `values` of `tongues`, checked to be a sequence of finite numbers."""
    if not isinstance(values, Iterable) or isinstance(values, str) or not len(values):
        raise ValueError(f"values = {values!r} is not allowed: it must be a sequence of numbers")
    return checks.finite("values", values)


def _variables(tongue_lists: list, parameter: str | None, values: Any, dimension: str) -> tuple:
    """Return (variables, coordinates) of a dataset of tongues.

    `tongue_lists` holds a list of `Tongue`s for each value of the parameter, one list without a
    parameter. `dimension` is "order", or "tongue" if tongues have no order.
    """
    if dimension == "order":
        by_number = [{tongue.order: tongue for tongue in tongues} for tongues in tongue_lists]
    else:
        by_number = [dict(enumerate(tongues, 1)) for tongues in tongue_lists]
    numbers = sorted(set().union(*by_number))
    data: dict = {}
    for name, (field, missing) in _COLUMNS.items():
        table = [
            [getattr(tongues.get(n), field, missing) for n in numbers] for tongues in by_number
        ]
        dtype = np.int8 if name == "edge_multiplier" else float
        array = np.array(table, dtype).reshape(len(by_number), -1)
        data[name] = ((parameter, dimension), array)
    coordinates = {dimension: np.array(numbers, np.int32)}
    if parameter is None:
        data = {name: (dimension, table[0]) for name, (_, table) in data.items()}
    else:
        coordinates[parameter] = np.array(values)
    return data, coordinates

"""`tongues`: intervals of tunings with parametric resonance, where steady contact is unstable."""

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge

from gearlib import checks, parameters
from gearlib.analysis.tongues import hill_tongues, meissner
from gearlib.data.result import make_result
from gearlib.models.model import is_model
from gearlib.models.profiles import Rectangular, Tabulated
from gearlib.parameters import NonNegative, Numbers, Unit, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MaxSeconds, Tuning

#: Parameters that can be varied.
PARAMETERS = ("stiffness_ratio", "contact_ratio", "damping")
#: Smallest tuning; at lower tunings there are hundreds of tongues, and the growth overflows.
MIN_TUNING = 0.02
#: Name of a dataset variable -> (field of `Tongue`, value if there is no tongue).
_COLUMNS = {
    "tuning_from": ("start", math.nan),
    "tuning_to": ("stop", math.nan),
    "edge_multiplier": ("multiplier", 0),
    "growth": ("growth", math.nan),
    "growth_tuning": ("peak", math.nan),
}


@checked
def tongues(
    model,
    *,
    start: Annotated[float, Ge(MIN_TUNING), Unit("1")] = 0.3,
    stop: Tuning = 3.0,
    parameter=None,
    values: Numbers | None = None,
    step: Tuning = 0.002,
    max_seconds: MaxSeconds = None,
):
    """Find the tongues of parametric resonance: intervals of tunings with unstable steady contact.

    Small perturbations of the motion without loss of contact obey Hill's equation or, if the
    stiffness is rectangular, Meissner's equation. A tongue of order n, near nu = 2 / n, is an
    interval of tunings in which perturbations grow from mesh period to mesh period. At its edges a
    Floquet multiplier is (-1)^n. Damping narrows and finally closes the tongue.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or GearTrain
        The backlash is ignored. Models with one degree of freedom and rectangular stiffness have
        closed-form solutions; for all others a numerical monodromy matrix is computed, see
        `gearlib.analysis.tongues.hill_tongues`.
    start, stop : float
        Range of tunings, 0.02 <= start < stop. Tongues that overlap the range are returned with
        both edges; with six degrees of freedom they are truncated.
    parameter : {"stiffness_ratio", "contact_ratio", "damping"}, optional
        Parameter that is varied: kappa, epsilon, or the damping ratio beta in contact. The first
        two leave the damping ratio unchanged. Tabulated stiffness and six degrees of freedom allow
        only "damping"; a `GearTrain` allows stiffness_ratio, contact_ratio or material_damping,
        each for all its meshes.
    values : sequence of float, shape (v,), optional
        Values of this parameter.
    step : float, default 0.002
        Step of the scan over tunings for models with more than one degree of freedom.
    max_seconds : float, optional
        Time limit in seconds, after which the tongues at the parameter values completed so far are
        returned, see `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Over (parameter, order), or (parameter, tongue) with six degrees of freedom; without
        `parameter`, over order or tongue only: tuning_from and tuning_to, the edges, equal if a
        tongue is a point, NaN if it is closed or out of range; edge_multiplier, 0 for a complex
        pair; growth, the largest logarithm of a multiplier in the tongue, negative if it is closed,
        and growth_tuning, the tuning of this maximum. Without `parameter` also closing_damping, the
        damping ratio in contact above which the tongue is closed (NaN if there is none).

    Raises
    ------
    ValueError
        If an argument is invalid, or if damping or stiffness is nonlinear, because the stability
        then depends on the motion; see `gearlib.periodic_orbit`.

    Notes
    -----
    Closed-form edges are accurate to about 1e-15, and less accurate near the damping at which both
    edges of a tongue meet. For the equations see `gearlib.analysis.tongues.meissner`.
    """
    checks.require(stop > start, "stop", stop, f"> start = {start!r}")
    model = linear_contact_model(model)
    time_limit = TimeLimit(max_seconds)
    missing = []
    if parameter is None:
        checks.require(values is None, "values", values, "omitted if parameter is None")
        tongue_lists = [find_tongues(model, start, stop, step)]
    else:
        allowed = PARAMETERS if model.pair else (*model.parameters,)[1:]
        checks.check_choice("parameter", parameter, allowed)
        if values is None:
            raise checks.InputError("values", None, "given if parameter is given")
        models = [replace_parameter(model, parameter, value) for value in values]
        tongue_lists = [
            find_tongues(changed, start, stop, step)
            for changed in time_limit.iterate(with_progress_bar("values", models, len(models)))
        ]
        count = len(tongue_lists)
        values, missing = values[:count], values[count:]
    dimension = "tongue" if model.size > 2 else "order"
    data, coords = _variables(tongue_lists, parameter, values, dimension)
    if parameter is None and model.pair:
        dampings = [closing_damping(model, tongue) for tongue in tongue_lists[0]]
        data["closing_damping"] = dimension, np.array(dampings, float)
    dataset = make_result(
        "Tongues of parametric resonance",
        model,
        data,
        coords,
        method="closed form" if model.pair is model else "monodromy",
        start=start,
        stop=stop,
    )
    return time_limit.record_missing(dataset, missing)


def linear_contact_model(model: Any) -> Any:
    """Check that a model is linear in contact, and return the model whose stability is analysed.

    If the stiffness is rectangular (with two levels), return the `GearPair` of the model, which has
    the same stability and a closed-form solution; otherwise return the model itself. Raise
    ValueError if the model is nonlinear in contact or has no gears.
    """
    # Gear pairs have a `pair`, trains `mesh_names`; one degree of freedom needs an `equation`.
    has_gears = is_model(model) and (model.pair or model.mesh_names)
    if not has_gears or (model.size == 2 and model.equation is None):
        raise checks.InputError(
            "model", model, "a GearPair, OneDegreePair, SixDegreePair or GearTrain"
        )
    for name in model.nonlinear:
        allowed = "0, or the stability depends on the motion: see gearlib.periodic_orbit"
        checks.require(not getattr(model, name), name, getattr(model, name), allowed)
    return model.pair if isinstance(model.profile, Rectangular) else model


def find_tongues(model: Any, start: float, stop: float, step: float = 0.002) -> list:
    """Find the `Tongue`s of a linear model that overlap the tunings from `start` to `stop`.

    A tongue is an interval of tunings (mesh frequency / natural frequency) in which steady contact
    is unstable. `step` is the step of the scan over tunings for models with several degrees of
    freedom.
    """
    if model.pair is model:  # a `GearPair`
        equation = meissner.equation_of_pair(model)
        return [
            meissner.find_tongue(equation, n)
            for n in meissner.orders_in_range(equation, start, stop)
        ]
    if model.size > 2:
        return hill_tongues.find_tongues_of_several_degrees(model, start, stop, step)
    return hill_tongues.find_tongues_of_one_degree(model, start, stop)


def closing_damping(model: Any, tongue: meissner.Tongue) -> float:
    """Return the damping ratio in contact above which a tongue of a model is closed.

    A tongue is an interval of tunings in which steady contact is unstable; above this damping ratio
    there is no such interval. The result is 0 if the tongue has no width even without damping, and
    NaN if no damping ratio below 1 closes it.
    """
    if model.pair is model:  # a `GearPair`
        return meissner.closing_damping(model.contact_ratio, model.stiffness_ratio, tongue.order)
    if model.size > 2:
        return hill_tongues.closing_damping_of_six_degrees(model, tongue)
    return hill_tongues.closing_damping(model, tongue)


def replace_parameter(model: Any, parameter: str, value: float) -> Any:
    """Return a copy of a model with another value of a parameter.

    For a `GearTrain`, any of its parameters is allowed. For other models, `parameter` is "damping"
    (the damping ratio in contact), "stiffness_ratio" or "contact_ratio"; the last two leave the
    damping ratio unchanged. Raise ValueError if the model does not have the parameter.
    """
    if model.mesh_names:
        return model.with_parameter(parameter, value)
    damping = model.damping_ratio
    if parameter == "damping":
        damping = parameters.check("damping", value, NonNegative)
    elif model.size > 2 or isinstance(model.profile, Tabulated):
        raise checks.InputError(
            "parameter", parameter, "'damping' for tabulated stiffness or six degrees of freedom"
        )
    else:
        model = model.replace(**{parameter: value})
    return hill_tongues.replace_damping(model, damping)


def _variables(tongue_lists: list, parameter: str | None, values: Any, dimension: str) -> tuple:
    """Return (variables, coordinates) of a dataset of tongues.

    `tongue_lists` contains a list of `Tongue`s (intervals of tunings with unstable steady contact)
    for each of the `values` of the parameter, or a single list if `parameter` is None. `dimension`
    is "order", or "tongue" if tongues have no order and are counted from 1. Where a tongue does not
    exist, the multiplier is 0, and the other variables are NaN.
    """
    # For each parameter value, a mapping from the order or the number of a tongue to the tongue.
    if dimension == "order":
        numbered = [{tongue.order: tongue for tongue in tongues} for tongues in tongue_lists]
    else:
        numbered = [dict(enumerate(tongues, 1)) for tongues in tongue_lists]
    numbers = sorted(set().union(*numbered))
    data: dict = {}
    for name, (field, missing) in _COLUMNS.items():
        table = [[getattr(tongues.get(n), field, missing) for n in numbers] for tongues in numbered]
        dtype = np.int8 if name == "edge_multiplier" else float
        array = np.array(table, dtype).reshape(len(numbered), -1)
        data[name] = ((parameter, dimension), array)
    coordinates = {dimension: np.array(numbers, np.int32)}
    if parameter is None:
        data = {name: (dimension, table[0]) for name, (_, table) in data.items()}
    else:
        coordinates[parameter] = np.array(values)
    return data, coordinates

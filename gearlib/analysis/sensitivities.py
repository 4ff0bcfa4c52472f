"""`sensitivities`: derivatives of results with respect to parameters, from exact runs."""

import math
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data.motions import as_float_array
from gearlib.data.result import collect_contact_counts
from gearlib.data.variables import DESCRIPTIONS
from gearlib.models.model import is_model, natural_scale
from gearlib.parameters import Finite, check, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MaxSeconds

#: Ratio of successive steps of the difference quotients.
STEP_RATIO = 3.0
#: Decreasing steps of the difference quotients, relative to the scale of the parameter.
STEPS = 3e-3 / STEP_RATIO ** np.arange(9)
MAX_RICHARDSON_ORDER = 3
MIN_DIFFERENCES = 4
#: Ratio of the error estimate to the last change of the extrapolated value.
ERROR_FACTOR = 5.0
#: Changes of an array below this, relative to its largest entry, are rounding errors.
ROUNDING_TOLERANCE = 1e-13
#: Relative error of the derivative above which a warning is given.
MAX_ERROR = 1e-6


def richardson_derivative(function: Callable, value: float, scale: float) -> tuple:
    """Differentiate an array-valued function at `value` by Richardson extrapolation.

    Return (derivative, error estimate), arrays of the shape of the result of `function`. Central
    difference quotients with the steps `scale` * `STEPS` (decreasing from 3e-3 by factors of 3) are
    extrapolated to step 0, up to the third order (Ridders, Advances in Engineering Software 4
    (1982) 75-76). A step is skipped if the function returns None; with fewer than four quotients
    the result is NaN. One step and one order are chosen for the whole array, those with the
    smallest change, because the values of a single entry may agree by chance.
    """
    centre = np.asarray(function(value), float)
    steps, quotients = [], []
    for step in scale * STEPS:
        quotient = _difference_quotient(function, value, step, centre)
        if quotient is not None:
            steps.append(step)
            quotients.append(quotient)
    if len(steps) < MIN_DIFFERENCES:
        return np.full(centre.shape, math.nan), np.full(centre.shape, math.nan)
    table = np.array(quotients)
    # The table has one row per step. Each order combines neighbouring rows into one row less.
    best_score, derivative, error = math.inf, table[0], math.inf
    max_entry = np.abs(centre).max(initial=0.0)
    for order in range(1, min(MAX_RICHARDSON_ORDER, len(steps) - 2) + 1):
        # The error of a central difference is a power series in the square of the step.
        factor = (STEP_RATIO**2) ** order
        table = (factor * table[1:] - table[:-1]) / (factor - 1.0)
        changes = np.abs(np.diff(table, axis=0)).reshape(len(table) - 1, -1).max(1, initial=0.0)
        # Rounding errors grow as the steps decrease, so changes at small steps get larger weights.
        weights = STEP_RATIO ** (order + np.arange(len(changes)))
        scores = np.nan_to_num(changes * weights, nan=np.inf)
        i = int(scores.argmin())
        if scores[i] < best_score:
            best_score, derivative = scores[i], table[i]
            # The error estimate is the larger of the changes to the next two smaller steps, plus
            # the rounding error of one quotient. The second change is reduced by the step ratio,
            # because its rounding error is larger by this ratio.
            next_change = changes[i + 1] if i + 1 < len(changes) else 0.0
            error = ERROR_FACTOR * np.maximum(changes[i], next_change / STEP_RATIO)
            error += np.spacing(max_entry) / steps[i + order + 1]
    is_constant = 2.0 * steps[0] * np.abs(quotients[0]) <= ROUNDING_TOLERANCE * max_entry
    if is_constant.all():
        error = 0.0
    return np.where(is_constant, 0.0, derivative), np.full(centre.shape, error)


def _difference_quotient(function: Callable, value: float, step: float, centre: np.ndarray) -> Any:
    """Return a second-order accurate difference quotient of a function at `value`.

    The quotient is central with the given `step`, or one-sided if `function` raises ValueError on
    one side of `value`, e.g. at the end of the allowed range. `centre` is function(value). Return
    None if the function returns None at one of the points.
    """
    try:
        neighbour = function(value + step)
    except ValueError:
        # Parameters above `value` are not allowed, so step downwards.
        step = -step
        neighbour = function(value + step)
    # The weights multiply the neighbour, the other point and the centre.
    try:
        other_point, weights = function(value - step), (1.0, -1.0, 0.0)
    except ValueError:
        other_point, weights = function(value + 2.0 * step), (4.0, -1.0, -3.0)
    if neighbour is None or other_point is None:
        return None
    return (weights[0] * neighbour + weights[1] * other_point + weights[2] * centre) / (2.0 * step)


@checked
def sensitivities(
    call: Callable, model: Any, parameters: Any, *, max_seconds: MaxSeconds = None, **arguments: Any
) -> xr.Dataset:
    """Differentiate the results of a function with respect to parameters of a model or arguments.

    Warn if the number of contact events changes at every step size, or if the relative error
    exceeds 1e-6.

    Parameters
    ----------
    call : callable
        Function whose result is differentiated: ``call(model, **arguments)`` returns a number, an
        array, a DataArray or a Dataset.
    model : Model
        Model at whose parameter values the derivatives are computed.
    parameters : str or sequence of str
        Names of parameters in ``model.settable``, or of numerical `arguments` such as tuning or
        speed.
    max_seconds : float, optional
        Time limit in seconds, after which the results computed so far are returned; see
        `gearlib.progress`.
    **arguments
        Keyword arguments of `call`.

    Returns
    -------
    xarray.Dataset
        For each variable and parameter, the derivative ``d_<variable>_d_<parameter>`` and its error
        estimate ``d_<variable>_d_<parameter>_error``. A result without a name is called ``value``.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its name, its value and what is allowed.
    """
    checks.require(callable(call), "call", call, "a function of a model")
    checks.require(is_model(model), "model", model, "a model such as GearPair")
    allowed = "a name or a sequence of names"
    names = [parameters] if isinstance(parameters, str) else parameters
    names = checks.check_sequence("parameters", names, allowed=allowed)
    checks.require(names, "parameters", parameters, allowed)
    descriptions = dict(model.settable)  # name -> (units, long name)
    for name in arguments:
        units, long_name = DESCRIPTIONS.get(name, ("1", name))
        descriptions[name] = units, model.long_names.get(name, long_name)
    data: dict = {}
    limit = TimeLimit(max_seconds)
    remaining = list(names)
    for name in limit.iterate(with_progress_bar("parameters", names, len(names))):
        remaining.remove(name)
        parameter_units, parameter = descriptions[
            checks.check_choice("parameters", name, descriptions)
        ]
        value = arguments[name] if name in arguments else model.value(name)
        check(name, value, Finite)
        run = _cached_call(call, model, name, arguments)
        is_dimensionless = parameter_units == "1"
        # If the parameter is 0, its scale follows from its units.
        scale = abs(value)
        if scale == 0.0:
            scale = 1.0 if is_dimensionless else natural_scale(model, parameter_units)
        for variable, array in run(value)[0].items():
            long_name = array.attrs.get("long_name", variable)
            title = f"derivative of the {long_name} with respect to {parameter}"
            divisor = "" if is_dimensionless else f"/({parameter_units})"
            units = array.attrs.get("units", "1") + divisor
            derivative, error = _differentiate_variable(run, variable, title, value, scale)
            label = f"d_{variable}_d_{name}"
            data[label] = array.copy(data=derivative).assign_attrs(units=units, long_name=title)
            data[f"{label}_error"] = array.copy(data=error).assign_attrs(
                units=units, long_name=f"error of the {title}"
            )
    return limit.record_missing(xr.Dataset(data), remaining)


def _cached_call(call: Callable, model: Any, name: str, arguments: dict) -> Callable:
    """Return a cached function that evaluates `call` for a value of the parameter `name`.

    `call(model, **arguments)` is the function of the user. The parameter is one of its keyword
    `arguments`, or else a parameter of the model. The returned function is cached, because several
    variables are differentiated at the same parameter values.
    """

    @cache
    def run(value: float) -> tuple:
        """Return ({variable name: DataArray}, contact counts) for a parameter value.

        Only floating-point variables are returned. The contact counts list the numbers of contact
        events and bounces in all simulations of the call.
        """
        with collect_contact_counts() as contacts:
            if name in arguments:
                result = call(model, **arguments | {name: value})
            else:
                result = call(model.with_values({name: value}), **arguments)
        if not isinstance(result, xr.Dataset):
            if not isinstance(result, xr.DataArray):
                result = xr.DataArray(as_float_array(result))
            result = result.to_dataset(name=result.name or "value")
        arrays = result.data_vars.items()
        variables = {key: array for key, array in arrays if array.dtype.kind == "f"}
        is_numeric = any(array.size for array in variables.values())
        checks.require(is_numeric, "call", call, "a function that returns numbers or a dataset")
        return variables, contacts

    return run


def _differentiate_variable(
    run: Callable, variable: Any, title: str, value: float, scale: float
) -> tuple:
    """Return (derivative, error estimate) of a variable at a parameter value; warn if unreliable.

    `run` is a function of the parameter value that returns ({variable name: DataArray}, contact
    counts). `variable` is the name of one of these variables, and `title` describes the derivative
    in warnings. The steps of the difference quotients are relative to `scale`. Warn if the number
    of contact events changes at every step size, or if the relative error exceeds 1e-6.
    """
    variables_at_value, contacts = run(value)
    shape = variables_at_value[variable].shape

    def array_at(parameter: float, same_contacts: bool = True) -> Any:
        """Return the array at a parameter value, or None if it cannot be compared with `value`.

        It cannot be compared if its shape differs or, with `same_contacts`, if the numbers of
        contact events differ, because the result may then jump.
        """
        variables, new_contacts = run(parameter)
        array = variables[variable].values
        if same_contacts and contacts and new_contacts and new_contacts != contacts:
            return None
        return array if array.shape == shape else None

    derivative, error = richardson_derivative(array_at, value, scale)
    # The error is NaN if too few steps remain. Quotients across a change of the number of contact
    # events are then used, because they are better than none.
    if np.isnan(error).any():
        message = f"contact events appear or vanish at all step sizes: {title}"
        warnings.warn(message, stacklevel=3)
        derivative, error = richardson_derivative(
            lambda parameter: array_at(parameter, same_contacts=False), value, scale
        )
    if not error.max(initial=0.0) <= MAX_ERROR * np.abs(derivative).max(initial=0.0):
        message = f"the relative error of the {title} exceeds {MAX_ERROR:g}"
        warnings.warn(message, stacklevel=3)
    return derivative, error

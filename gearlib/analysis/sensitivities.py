"""`sensitivities`: derivatives of results with respect to parameters, from exact runs."""

import math
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data.motions import float_array
from gearlib.data.result import counting_contacts
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
    """Differentiate an array-valued function by Richardson extrapolation.

    Return (derivative, error estimate) at a parameter `value`, arrays of the shape of the result of
    `function`. Central difference quotients with the steps `scale` * `STEPS` (3e-3 and smaller, by
    factors of 3) are extrapolated to step 0, up to the third order (Ridders, Advances in
    Engineering Software 4 (1982) 75-76). A step is left out if the function returns None there;
    with fewer than four quotients the result is NaN. The step and order with the smallest change
    are chosen for all entries of the array together, because single entries may agree by chance.
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
    # One row per step. Each order combines neighbouring rows, so that the table loses a row.
    best_score, derivative, error = math.inf, table[0], math.inf
    max_entry = np.abs(centre).max(initial=0.0)
    for order in range(1, min(MAX_RICHARDSON_ORDER, len(steps) - 2) + 1):
        # The error of a central difference is a series of even powers of the step.
        factor = (STEP_RATIO**2) ** order
        table = (factor * table[1:] - table[:-1]) / (factor - 1.0)
        changes = np.abs(np.diff(table, axis=0)).reshape(len(table) - 1, -1).max(1, initial=0.0)
        # Rounding errors grow with the ratio of the steps, so changes of small steps weigh more.
        weights = STEP_RATIO ** (order + np.arange(len(changes)))
        scores = np.nan_to_num(changes * weights, nan=np.inf)
        i = int(scores.argmin())
        if scores[i] < best_score:
            best_score, derivative = scores[i], table[i]
            # The error estimate is the larger of the change to the next smaller step, and the
            # change to the step after it without its larger rounding error, plus the rounding error
            # of one quotient.
            next_change = changes[i + 1] if i + 1 < len(changes) else 0.0
            error = ERROR_FACTOR * np.maximum(changes[i], next_change / STEP_RATIO)
            error += np.spacing(max_entry) / steps[i + order + 1]
    is_constant = 2.0 * steps[0] * np.abs(quotients[0]) <= ROUNDING_TOLERANCE * max_entry
    if is_constant.all():
        error = 0.0
    return np.where(is_constant, 0.0, derivative), np.full(centre.shape, error)


def _difference_quotient(function: Callable, value: float, step: float, centre: np.ndarray) -> Any:
    """Return a difference quotient of second order accuracy of a function at `value`.

    The quotient is central, with points at a distance `step`; it is one-sided if `function` raises
    ValueError on one side of `value`, for example at the end of the allowed range. `centre` is
    function(value). Return None if the function returns None at one of the points.
    """
    try:
        neighbour = function(value + step)
    except ValueError:
        # Parameters above the value are not allowed.
        step = -step
        neighbour = function(value + step)
    # Weights of the neighbour, the other point and the centre.
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
    """Differentiate the results of a function with respect to model parameters or its arguments.

    Warn if contact events change with every step, or if the relative error exceeds 1e-6.

    Parameters
    ----------
    call : callable
        Function whose result is differentiated: ``call(model, **arguments)`` returns a number, an
        array, a DataArray or a Dataset.
    model : Model
        Model at whose parameter values the derivatives are computed.
    parameters : str or sequence of str
        Names of parameters in ``model.settable``, or of numbers among the `arguments`, such as
        tuning or speed.
    max_seconds : float, optional
        Time limit in seconds, after which the results computed so far are returned; see
        `gearlib.progress`.
    **arguments
        Keyword arguments of `call`.

    Returns
    -------
    xarray.Dataset
        For each variable and parameter the derivative ``d_<variable>_d_<parameter>`` and its error
        estimate ``d_<variable>_d_<parameter>_error``. A result without a name is the variable
        ``value``.

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
        # A parameter that is 0 has no scale of its own.
        scale = abs(value)
        if scale == 0.0:
            scale = 1.0 if is_dimensionless else natural_scale(model, parameter_units)
        for variable, array in run(value)[0].items():
            long_name = array.attrs.get("long_name", variable)
            title = f"derivative of the {long_name} by {parameter}"
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
    """Return a cached function of one parameter value, which evaluates `call` with this value.

    `call(model, **arguments)` is the function of the user. The parameter `name` is one of its
    keyword `arguments`, or else a parameter of the model. The function returns (variables by name,
    contact counts) and is cached, because several variables are differentiated at the same values.
    """

    @cache
    def run(value: float) -> tuple:
        """Return ({variable name: DataArray}, contact counts) of the call for a parameter value.

        Only variables of floats are returned. The contact counts are a list of the numbers of
        contact events and bounces in the simulations that the call has made.
        """
        with counting_contacts() as contacts:
            if name in arguments:
                result = call(model, **arguments | {name: value})
            else:
                result = call(model.with_values({name: value}), **arguments)
        if not isinstance(result, xr.Dataset):
            if not isinstance(result, xr.DataArray):
                result = xr.DataArray(float_array(result))
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
    """Return (derivative, error estimate) of a result at a parameter value; warn if unreliable.

    `run` is a function of the parameter value that returns ({variable name: DataArray}, contact
    counts). `variable` is the name of one of these results, `title` a description of the derivative
    for warnings, and `scale` the scale of the parameter, to which the steps of the difference
    quotients are relative. A warning is given if contact events change with every step, or if the
    relative error exceeds 1e-6.
    """
    variables_at_value, contacts = run(value)
    shape = variables_at_value[variable].shape

    def array_at(parameter: float, same_contacts: bool = True) -> Any:
        """Return the array at a parameter value, or None if a difference would be meaningless.

        This is so if the shape of the array changes, or, with `same_contacts`, if the numbers of
        contact events differ from those at `value`, because the result may then jump.
        """
        variables, new_contacts = run(parameter)
        array = variables[variable].values
        if same_contacts and contacts and new_contacts and new_contacts != contacts:
            return None
        return array if array.shape == shape else None

    derivative, error = richardson_derivative(array_at, value, scale)
    # The error is NaN if too few steps are left. Differences across a change of contact events are
    # better than none.
    if np.isnan(error).any():
        message = f"contact events appear or vanish for all step sizes: {title}"
        warnings.warn(message, stacklevel=3)
        derivative, error = richardson_derivative(
            lambda parameter: array_at(parameter, same_contacts=False), value, scale
        )
    if not error.max(initial=0.0) <= MAX_ERROR * np.abs(derivative).max(initial=0.0):
        warnings.warn(f"the error is larger than {MAX_ERROR:g} of the {title}", stacklevel=3)
    return derivative, error

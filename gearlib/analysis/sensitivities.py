"""`sensitivities`: derivatives of the results of a call, by differences of exact runs."""

import math
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data.result import counting_contacts
from gearlib.data.variables import DESCRIPTIONS
from gearlib.models.model import is_model, natural_scale

#: Half widths of the differences, as shares of a parameter's scale.
WIDTHS = 3e-3 / 3.0 ** np.arange(9)
MAX_RICHARDSON_STEPS = 3
MIN_DIFFERENCES = 4
#: Factor on the last change of the Richardson value that gives the error estimate.
ERROR_FACTOR = 5.0
#: Changes of an array below this share of its largest number are rounding.
ROUNDING = 1e-13
#: Error, as a share of the derivative, above which a warning is given.
MAX_ERROR = 1e-6


def richardson(function: Callable, value: float, scale: float) -> tuple:
    """Return (derivative, estimate of its error) of an array that depends on a number.

    `function(value)` returns the array. Differences of several widths, shares of `scale`, are
    extrapolated by up to three Richardson steps (Ridders, Advances in Engineering Software 4 (1982)
    75-76). The width and the step with the smallest change are chosen for all numbers of the array
    together, because single differences may agree by chance. Differences are one-sided where the
    function raises ValueError, left out where it returns None; with fewer than four the result is
    NaN.
    """
    middle = np.asarray(function(value), float)
    widths, quotients = [], []
    for width in scale * WIDTHS:
        quotient = _difference(function, value, width, middle)
        if quotient is not None:
            widths.append(width)
            quotients.append(quotient)
    if len(widths) < MIN_DIFFERENCES:
        return np.full(middle.shape, math.nan), np.full(middle.shape, math.nan)
    differences = table = np.array(quotients)
    best_score, best, error = math.inf, table[0], math.inf
    size = np.abs(middle).max(initial=0.0)
    for step in range(1, min(MAX_RICHARDSON_STEPS, len(widths) - 2) + 1):
        table = (9.0**step * table[1:] - table[:-1]) / (9.0**step - 1.0)
        changes = np.abs(np.diff(table, axis=0)).reshape(len(table) - 1, -1).max(1, initial=0.0)
        # Rounding grows by 3 from width to width, so small widths need smaller changes to win.
        scores = np.nan_to_num(changes * 3.0 ** (step + np.arange(len(changes))), nan=np.inf)
        i = int(scores.argmin())
        if scores[i] < best_score:
            best_score, best = scores[i], table[i]
            error = ERROR_FACTOR * (np.append(changes, 0.0)[i : i + 2] / (1.0, 3.0)).max()
            error += np.spacing(size) / widths[i + step + 1]
    is_constant = 2.0 * widths[0] * np.abs(differences[0]) <= ROUNDING * size
    error = 0.0 if is_constant.all() else error
    return np.where(is_constant, 0.0, best), np.full(middle.shape, error)


def _difference(function: Callable, value: float, width: float, middle: np.ndarray) -> Any:
    """Return the central difference quotient of `function` at a value, None without a result.

    It is one-sided if the function raises ValueError on one side; `middle` is its array there.
    """
    try:
        ahead = function(value + width)
    except ValueError:
        width = -width
        ahead = function(value + width)
    try:
        behind, weights = function(value - width), (1.0, -1.0, 0.0)
    except ValueError:
        behind, weights = function(value + 2.0 * width), (4.0, -1.0, -3.0)
    if ahead is None or behind is None:
        return None
    return (weights[0] * ahead + weights[1] * behind + weights[2] * middle) / (2.0 * width)


def sensitivities(call: Callable, model: Any, parameters: Any, **arguments: Any) -> xr.Dataset:
    """Differentiate the results of a call by parameters of a model and by its other arguments.

    It warns if contacts change at all widths, and of errors above 1e-6 of the derivative.

    Parameters
    ----------
    call : callable
        ``call(model, **arguments)`` returns a number, an array, a DataArray or a Dataset.
    model : Model
    parameters : str or sequence of str
        Names in ``model.settable``, or of `arguments` that are numbers, like tuning and speed.
    **arguments
        Other arguments of the call.

    Returns
    -------
    xarray.Dataset
        ``d_<variable>_d_<parameter>`` and its error, ``..._error``; the variable of a result
        without a name is ``value``.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    checks.require(is_model(model), "model", model, "a model such as GearPair")
    described = {name: DESCRIPTIONS.get(name, ("1", name)) for name in arguments}
    known = model.settable | {
        name: (units, model.long_names.get(name, long_name))
        for name, (units, long_name) in described.items()
    }
    data: dict = {}
    for name in (parameters,) if isinstance(parameters, str) else parameters:
        parameter_units, parameter = known[checks.one_of("parameters", name, known)]
        value = arguments[name] if name in arguments else model.value(name)
        checks.number(name, value, "a finite number", math.isfinite)
        run = _run_function(call, model, name, arguments)
        is_ratio = parameter_units == "1"
        scale = abs(value) or (1.0 if is_ratio else natural_scale(model, parameter_units))
        for variable, array in run(value)[0].items():
            long_name = array.attrs.get("long_name", variable)
            title = f"derivative of the {long_name} by {parameter}"
            units = array.attrs.get("units", "1") + ("" if is_ratio else f"/({parameter_units})")
            derivative, error = _derivative(run, variable, title, value, scale)
            label, attrs = f"d_{variable}_d_{name}", {"units": units, "long_name": title}
            data[label] = array.copy(data=derivative).assign_attrs(attrs)
            attrs["long_name"] = f"error of the {title}"
            data[f"{label}_error"] = array.copy(data=error).assign_attrs(attrs)
    return xr.Dataset(data)


def _run_function(call: Callable, model: Any, name: str, arguments: dict) -> Callable:
    """Return a function from a value of the parameter `name` to (result, contact events).

    The parameter is an argument of `call(model, **arguments)`, or one of the model. The result is
    a dictionary of the variables of the call.
    """

    @cache
    def run(value: float) -> tuple:
        """Return (variables of the call with a value of the parameter, its contact events)."""
        with counting_contacts() as contacts:
            if name in arguments:
                result = call(model, **arguments | {name: value})
            else:
                result = call(model.with_values({name: value}), **arguments)
        if not isinstance(result, xr.Dataset):
            result = xr.DataArray(result).to_dataset(name=getattr(result, "name", None) or "value")
        variables = {name: x for name, x in result.data_vars.items() if x.dtype.kind == "f"}
        return variables, contacts

    return run


def _derivative(run: Callable, variable: Any, title: str, value: float, scale: float) -> tuple:
    """Return (derivative, its error) of a variable, and warn if they are not reliable.

    `run` is a result of `_run_function`, `value` that of the parameter, `scale` its natural size;
    `title` names the derivative in warnings.
    """
    variables_at_value, contacts = run(value)
    shape = variables_at_value[variable].shape

    def array_at(parameter: float, same_contacts: bool = True) -> Any:
        """Return the variable at a value of the parameter, None if its contacts are others."""
        variables, new_contacts = run(parameter)
        array = variables[variable].values
        if same_contacts and contacts and new_contacts and new_contacts != contacts:
            return None
        return array if array.shape == shape else None

    derivative, error = richardson(array_at, value, scale)
    # Differences across a change of contacts are better than none.
    if np.isnan(error).any():
        warnings.warn(f"contact events appear or vanish at all widths: {title}", stacklevel=3)
        derivative, error = richardson(lambda x: array_at(x, False), value, scale)
    if not error.max(initial=0.0) <= MAX_ERROR * np.abs(derivative).max(initial=0.0):
        warnings.warn(f"the error is larger than {MAX_ERROR:g} of the {title}", stacklevel=3)
    return derivative, error

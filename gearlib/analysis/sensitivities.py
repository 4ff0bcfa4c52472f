"""`sensitivities`: derivatives of anything that a call returns, by differences of exact runs."""

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

WIDTHS = 3e-3 / 3.0 ** np.arange(9)  #: half widths of the differences, as shares of a scale
SAFETY = 5.0  #: factor on the last change of the Richardson value, for the error
ROUNDING = 1e-13  #: share of an array's largest number below which its change is rounding
MAX_ERROR = 1e-6  #: share of the derivative above which its error is worth a warning


def richardson(function: Callable, value: float, scale: float) -> tuple:
    """Differentiate an array by a number: return the derivative and an estimate of its error.

    Of all widths, shares of `scale`, and up to three Richardson steps (Ridders, Advances in
    Engineering Software 4 (1982) 75-76) those whose result changes least serve the whole array:
    chosen number by number, lucky differences would win. Differences are one-sided where the
    function raises ValueError, left out where it returns None; NaN with fewer than four.
    """
    middle = np.asarray(function(value), float)
    pairs = [(width, _difference(function, value, width, middle)) for width in scale * WIDTHS]
    pairs = [pair for pair in pairs if pair[1] is not None]
    if len(pairs) < 4:
        return np.full(middle.shape, math.nan), np.full(middle.shape, math.nan)
    plain = table = np.array([difference for _, difference in pairs])
    least, best, error = math.inf, table[0], math.inf
    size = np.abs(middle).max(initial=0.0)
    for step in range(1, min(3, len(pairs) - 2) + 1):
        table = (9.0**step * table[1:] - table[:-1]) / (9.0**step - 1.0)
        changes = np.abs(np.diff(table, axis=0)).reshape(len(table) - 1, -1).max(1, initial=0.0)
        # Rounding grows by 3 from width to width: a small change at a small width may be luck.
        scores = np.nan_to_num(changes * 3.0 ** (step + np.arange(len(changes))), nan=np.inf)
        i = int(scores.argmin())
        if scores[i] < least:
            least, best = scores[i], table[i]
            error = SAFETY * (np.append(changes, 0.0)[i : i + 2] / (1.0, 3.0)).max()
            error += np.spacing(size) / pairs[i + step + 1][0]
    same = 2.0 * pairs[0][0] * np.abs(plain[0]) <= ROUNDING * size
    return np.where(same, 0.0, best), np.full(middle.shape, 0.0 if same.all() else error)


def _difference(function: Callable, value: float, width: float, middle: np.ndarray) -> Any:
    """Return a central difference, at the end of a range a one-sided one, or None."""
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
    """Differentiate what a call returns by parameters of a model and by its other arguments.

    It warns where contacts change at all widths, and of errors above 1e-6 of the derivative.

    Parameters
    ----------
    call : callable
        ``call(model, **arguments)`` returns a number, an array, a DataArray or a Dataset.
    model : Model
    parameters : str or sequence of str
        Names in ``model.settable``, or of `arguments` that are numbers, as the tuning or the speed.
    **arguments
        Other arguments of the call.

    Returns
    -------
    xarray.Dataset
        ``d_<variable>_d_<parameter>`` and its error, ``..._error``; without a name, ``d_value_d_``.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    checks.require(is_model(model), "model", model, "a model such as GearPair")
    given = {name: DESCRIPTIONS.get(name, ("1", name)) for name in arguments}
    known = model.settable | {n: (u, model.long_names.get(n, w)) for n, (u, w) in given.items()}
    data: dict = {}
    for name in (parameters,) if isinstance(parameters, str) else parameters:
        below, parameter = known[checks.one_of("parameters", name, known)]
        value = arguments[name] if name in arguments else model.value(name)
        checks.number(name, value, "a finite number", math.isfinite)
        run = _runs(call, model, name, arguments)
        scale = abs(value) or (1.0 if below == "1" else natural_scale(model, below))
        for variable, array in run(value)[0].items():
            words = f"derivative of the {array.attrs.get('long_name', variable)} by {parameter}"
            units = array.attrs.get("units", "1") + ("" if below == "1" else f"/({below})")
            derivative, error = _derivative(run, variable, words, value, scale)
            label, about = f"d_{variable}_d_{name}", {"units": units, "long_name": words}
            data[label] = array.copy(data=derivative).assign_attrs(about)
            about["long_name"] = f"error of the {words}"
            data[f"{label}_error"] = array.copy(data=error).assign_attrs(about)
    return xr.Dataset(data)


def _runs(call: Callable, model: Any, name: str, arguments: dict) -> Callable:
    """Return the function of one parameter that gives a call's variables and contact events."""

    @cache
    def run(value: float) -> tuple:
        with counting_contacts() as contacts:
            if name in arguments:
                result = call(model, **arguments | {name: value})
            else:
                result = call(model.with_values({name: value}), **arguments)
        if not isinstance(result, xr.Dataset):
            result = xr.DataArray(result).to_dataset(name=getattr(result, "name", None) or "value")
        return {key: x for key, x in result.data_vars.items() if x.dtype.kind == "f"}, contacts

    return run


def _derivative(run: Callable, variable: Any, words: str, value: float, scale: float) -> tuple:
    """Return derivative and error of one variable, and warn where they are not reliable."""
    shape, contacts = run(value)[0][variable].shape, run(value)[1]

    def numbers(x: float, alike: bool = True) -> Any:
        array, there = run(x)[0][variable].values, run(x)[1]
        fits = not alike or there == contacts or [] in (there, contacts)
        return array if fits and array.shape == shape else None

    derivative, error = richardson(numbers, value, scale)
    if np.isnan(error).any():
        warnings.warn(f"contact events appear or vanish at all widths: {words}", stacklevel=3)
        derivative, error = richardson(lambda x: numbers(x, False), value, scale)
    if not error.max(initial=0.0) <= MAX_ERROR * np.abs(derivative).max(initial=0.0):
        warnings.warn(f"the error is larger than {MAX_ERROR:g} of the {words}", stacklevel=3)
    return derivative, error

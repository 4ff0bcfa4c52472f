"""Derivatives of what `simulate` returns, by parameters, tuning and start; their names and units.

``d_<variable>_d_<parameter>`` is the derivative of a variable of the dataset by an argument of the
call, all other arguments kept: what a difference of two calls would tend to. The parameters of a
`GearPair` are in SI units, the variables as they are: in static deflections and mesh phase.
"""

import math
import re
from functools import cache

import numpy as np

from gearlib.data.variables import DESCRIPTIONS
from gearlib.kernels import orbit
from gearlib.kernels.codes import OK

GRAZING, ONE_SIDED, FOLD, DOUBLE, EDGE = 1, 2, 3, 4, 5
MESSAGES = {
    0: "the derivatives hold on both sides",
    GRAZING: (
        "the motion touches a flank line: there phases and velocities of events, and multipliers, "
        "change like a square root, their derivatives are NaN; those of states, samples and "
        "extrema hold on both sides"
    ),
    ONE_SIDED: (
        "an event coincides with the start, or that of an orbit with a switch of the stiffness: "
        "derivatives that differ on its two sides are those of one"
    ),
    FOLD: "the orbit is at a fold, where it has no derivatives by parameters: all are NaN",
    DOUBLE: "two multipliers coincide, whose derivatives are NaN: they part like a square root",
    EDGE: (
        "a contact ratio is 1 or 2, where a segment of the other stiffness appears or vanishes: "
        "there the extrema of forces jump, and their derivatives by it are NaN"
    ),
}
_FLAGS = {
    "flag_values": np.array(list(MESSAGES), dtype=np.int8),
    "flag_meanings": "ok grazing one_sided fold double_multiplier edge",
}
#: With which the names of parameters of the start begin.
_START = "initial_"
_SAMPLES = ("displacement", "velocity", "acceleration", "dynamic_force")
_EVENTS = ("event_phase", "event_velocity")
_EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")
_FRACTIONS = (
    "fraction_normal",
    "fraction_backlash",
    "fraction_inverse",
    "fraction_min_stiffness",
)


def check(pair, names, method=None, also_start=True):
    """Return the names of parameters as a tuple; those of the start may be left out.

    Raises
    ------
    ValueError
        If one is unknown or repeated, or the model and its method have no derivatives.
    """
    names = listed(names)
    own = next(iter(pair.propagators))
    method = method or own
    if names and method != own:
        raise ValueError(
            f"sensitivities = {names!r} is not allowed for this {type(pair).__name__} by method "
            f"{method!r}: derivatives are those of method {own!r}"
        )
    if names and pair.kind().differentiate is None:
        raise ValueError(
            f"sensitivities = {names!r} is not allowed for this {type(pair).__name__}: motions "
            "whose pairs of teeth touch one by one have no derivatives yet"
        )
    known = [name for name in pair.derivatives if also_start or not name.startswith(_START)]
    return check_names(names, known)


def listed(names):
    """Return names of parameters, or one of them, as a tuple."""
    try:
        return (names,) if isinstance(names, str) else tuple(names)
    except TypeError:
        raise ValueError(
            f"sensitivities = {names!r} is not allowed: it must be a sequence of names"
        ) from None


def check_names(names, known):
    """Return names, if all are known and none is repeated."""
    for name in names:
        if name not in known:
            raise ValueError(
                f"sensitivities = {name!r} is not allowed: it must be one of {_in_words(known)}"
            )
    if len(set(names)) < len(names):
        raise ValueError(f"sensitivities = {names!r} is not allowed: names must be all different")
    return names


def _in_words(known):
    """Return names in words: of trains, those of one element of each kind."""
    shown, seen = [], set()
    for name in known:
        field, _, element = name.partition(" of ")
        key = field, element.split(" ")[0] if field != "initial_state" else ""
        if not element or key not in seen and not element.endswith((", x", ", y")):
            shown.append(repr(name))
            seen.add(key)
    more = " or the same of another element" if seen else ""
    return ", ".join(shown) + more


def directions(pair, names):
    """Return directions of some names, see `gearlib.models.propagators.base.Base.differentiate`."""
    return pair.kind().directions(pair, names)


@cache
def _attributes(about, by):
    """Return (units, long_name) of the derivative of a variable by a parameter."""
    (units, long_name), (below, words) = about, by
    return quotient(units, below), f"derivative of the {long_name} by {words}"


def quotient(units, below):
    """Return the CF units of a quotient."""
    powers: dict = {}
    for text, sign in ((units, 1), (below, -1)):
        for unit, power in re.findall(r"([A-Za-z]+)(-?\d+)?", text):
            powers[unit] = powers.get(unit, 0) + sign * int(power or 1)
    ordered = sorted(powers.items(), key=lambda item: item[1] < 0)
    parts = [f"{unit}{power if power != 1 else ''}" for unit, power in ordered if power]
    return " ".join(parts) or "1"


def described(pair):
    """Return name of a variable -> (CF units, long_name), in the words of a model."""
    return {
        name: (units, pair.long_names.get(name, long_name))
        for name, (units, long_name) in DESCRIPTIONS.items()
    }


def derivatives(variables, dims, values, parameters, known):
    """Return name -> (dims, values, attributes) of derivatives.

    `values`, shape (len(variables), ..., len(parameters)), are those of some variables over `dims`,
    whose units and descriptions are in `known`; `parameters` has those of the parameters.
    """
    found = {}
    for row, variable in enumerate(variables):
        for column, (name, by) in enumerate(parameters.items()):
            units, long_name = _attributes(known[variable], by)
            attributes = {"units": units, "long_name": long_name}
            found[f"d_{variable}_d_{name}"] = dims, values[row, ..., column], attributes
    return found


def flag(code):
    """Return the variable ``sensitivity_status``."""
    attributes = {"units": "1", "long_name": "what the derivatives hold for"}
    return (), np.int8(code), attributes | _FLAGS | {"message": MESSAGES[code]}


def variables(propagator, names, along, z, tangents, sizes, periods, recorded, max_events, ok=True):
    """Return the derivatives of what a run records, and of its final state.

    Parameters
    ----------
    propagator : gearlib.models.propagators.base.Base
    names : tuple of str
    along : sequence
        Their `directions`.
    z : ndarray, shape (s,)
        State at the start, as of `Propagator.start`.
    tangents : ndarray, shape (s, k)
        What it changes by.
    sizes : tuple of int
        Samples and events of the record.
    periods, recorded, max_events : int
        As of the run; `recorded` are its record_periods.
    ok : bool
        Whether the run is complete; else all derivatives are NaN.

    Returns
    -------
    dict
        name -> (dims, values, attributes), with ``sensitivity_status``.
    """
    pair, k, (rows, count) = propagator.model, len(names), sizes
    m = max(len(pair.mesh_names), 1)
    every = pair.derivatives
    parameters = {name: every[name] for name in names}
    columns = pair.empty_record()[0].shape[1] - m * (orbit.SAMPLE_COLUMNS - len(_SAMPLES))
    samples, events = np.empty((rows, columns, k)), np.empty((count, 2, k))
    extrema, times = np.empty((2, 4 * m, k))
    ends, code = np.full((len(pair.components), k), math.nan), 0
    if ok:
        found, done, grazing, one_sided, ends = propagator.differentiate(
            z,
            along,
            tangents.copy(),
            (periods, recorded, max_events),
            (samples, events, extrema, times),
        )
        if done != OK or found != count:
            # Rounding decides whether there is an event at all.
            events[:], times[:], grazing = math.nan, math.nan, True
        edge = not np.isfinite(extrema).all()
        code = GRAZING if grazing else EDGE if edge else ONE_SIDED if one_sided else 0
    else:
        for array in (samples, events, extrema, times):
            array[:] = math.nan
    dims, known = ("mesh",) if pair.mesh_names else (), described(pair)

    def by_mesh(values):
        # Quantities one after the other, of all meshes.
        values = values.reshape(*values.shape[:-2], 4, m, k) if dims else values
        return np.moveaxis(values, -3, 0) if dims else np.moveaxis(values, -2, 0)

    data = {
        "sensitivity_status": flag(code),
    }
    for which, where, values in (
        (_SAMPLES, ("phase", *dims), by_mesh(samples[:, : 4 * m])),
        (_EVENTS, ("event",), np.swapaxes(events, 0, 1)),
        (_EXTREMA, dims, by_mesh(extrema)),
        (_FRACTIONS, dims, by_mesh(times) / (2.0 * math.pi * recorded)),
        (("final_state",), ("component",), ends[None]),
    ):
        data |= derivatives(which, where, values, parameters, known)
    for column, (name, by) in enumerate(parameters.items()):
        more = pair.more_samples(samples[..., column])
        for variable, (where, values) in more.items():
            data |= derivatives((variable,), where, values[None, ..., None], {name: by}, known)
    return data

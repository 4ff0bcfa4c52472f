"""Derivatives of what `simulate` returns, by parameters, tuning and start; their names and units.

``d_<variable>_d_<parameter>`` is the derivative of a variable of the dataset by an argument of the
call, all other arguments kept: what a difference of two calls would tend to. The parameters of a
`GearPair` are in SI units, the variables as they are: in static deflections and mesh phase.
"""

import math
import re
from functools import cache

import numpy as np

from gearlib import checks
from gearlib.data.variables import DESCRIPTIONS
from gearlib.kernels.codes import OK

#: name -> (CF units, words): fields of the pair, its ratios, arguments of the run.
PARAMETERS = {
    "max_stiffness": ("N m-1", "maximum mesh stiffness"),
    "stiffness_ratio": ("1", "stiffness ratio kappa"),
    "contact_ratio": ("1", "contact ratio epsilon"),
    "reduced_mass": ("kg", "reduced mass"),
    "load": ("N", "load"),
    "backlash": ("m", "backlash"),
    "material_damping": ("N s m-1", "damping of the material in contact"),
    "backlash_damping": ("N s m-1", "damping of the oil in the backlash"),
    "damping_ratio": ("1", "damping ratio beta"),
    "backlash_damping_ratio": ("1", "damping ratio beta_m of the backlash"),
    "backlash_ratio": ("1", "backlash in static deflections"),
    "tuning": ("1", "tuning nu"),
    "initial_displacement": ("1", "displacement at the start"),
    "initial_velocity": ("1", "dx/dtau at the start"),
}
#: Of `PARAMETERS`: those of the start.
START = ("initial_displacement", "initial_velocity")

GRAZING, ONE_SIDED, FOLD, DOUBLE = 1, 2, 3, 4
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
}
_FLAGS = {
    "flag_values": np.array(list(MESSAGES), dtype=np.int8),
    "flag_meanings": "ok grazing one_sided fold double_multiplier",
}
_SAMPLES = ("displacement", "velocity", "acceleration", "dynamic_force")
_EVENTS = ("event_phase", "event_velocity")
_EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")
_FRACTIONS = (
    "fraction_normal",
    "fraction_backlash",
    "fraction_inverse",
    "fraction_min_stiffness",
)


def check(pair, names, method="exact", known=tuple(PARAMETERS)):
    """Return the names of parameters as a tuple.

    Raises
    ------
    ValueError
        If one is unknown or repeated, or the model and its method have no derivatives.
    """
    try:
        names = (names,) if isinstance(names, str) else tuple(names)
    except TypeError:
        raise ValueError(
            f"sensitivities = {names!r} is not allowed: it must be a sequence of names"
        ) from None
    for name in names:
        checks.one_of("sensitivities", name, known)
    if len(set(names)) < len(names):
        raise ValueError(f"sensitivities = {names!r} is not allowed: names must be all different")
    kind = pair.kind(method) if method in pair.mathematics else None
    if names and (kind is None or kind.differentiate is None):
        raise ValueError(
            f"sensitivities = {names!r} is not allowed for this {type(pair).__name__} by method "
            f"{method!r}: derivatives are those of a GearPair of stiffness ratio >= 1e-4 by method "
            "'exact'"
        )
    return names


def directions(pair, names):
    """Return (what the ratios and the tuning change by, what the start changes by).

    Of shapes (k, 6) and (2, k), see `gearlib.models.propagators.base.Base.differentiate`.
    """
    along, start = np.zeros((len(names), 6)), np.zeros((2, len(names)))
    for row, name in enumerate(names):
        if name in START:
            start[START.index(name), row] = 1.0
        elif name == "tuning":
            along[row, 5] = 1.0
        else:
            along[row, :5] = pair.ratio_slopes(name)
    return along, start


@cache
def _attributes(about, name):
    """Return (units, long_name) of the derivative of a variable by a parameter."""
    (units, long_name), (below, words) = about, PARAMETERS[name]
    return _quotient(units, below), f"derivative of the {long_name} by {words}"


def _quotient(units, below):
    """Return the CF units of a quotient."""
    powers: dict = {}
    for text, sign in ((units, 1), (below, -1)):
        for unit, power in re.findall(r"([A-Za-z]+)(-?\d+)?", text):
            powers[unit] = powers.get(unit, 0) + sign * int(power or 1)
    ordered = sorted(powers.items(), key=lambda item: item[1] < 0)
    parts = [f"{unit}{power if power != 1 else ''}" for unit, power in ordered if power]
    return " ".join(parts) or "1"


def derivatives(variables, dims, values, names, known=DESCRIPTIONS):
    """Return name -> (dims, values, attributes) of derivatives.

    `values`, shape (len(variables), ..., len(names)), are those of some variables over `dims`,
    whose units and descriptions are in `known`.
    """
    found = {}
    for row, variable in enumerate(variables):
        for column, name in enumerate(names):
            units, long_name = _attributes(known[variable], name)
            attributes = {"units": units, "long_name": long_name}
            found[f"d_{variable}_d_{name}"] = dims, values[row, ..., column], attributes
    return found


def flag(code):
    """Return the variable ``sensitivity_status``."""
    attributes = {"units": "1", "long_name": "what the derivatives hold for"}
    return (), np.int8(code), attributes | _FLAGS | {"message": MESSAGES[code]}


def variables(pair, tuning, names, state, tangents, sizes, periods, recorded, max_events, ok=True):
    """Return the derivatives of what a run records, and of its final state.

    Parameters
    ----------
    pair : GearPair
    tuning : float
    names : tuple of str
    state : array_like, shape (2,)
    tangents : ndarray, shape (2, k)
        What the start changes by.
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
    k, (rows, count) = len(names), sizes
    along = directions(pair, names)[0]
    samples, events = np.empty((rows, len(_SAMPLES), k)), np.empty((count, 2, k))
    extrema, times = np.empty((2, 4, k))
    ends, code = np.array(tangents), 0
    if _one_sided(pair, state, along, tangents):
        code = ONE_SIDED
    if ok:
        found, done, grazing = pair.propagator(tuning).differentiate(
            np.asarray(state, float),
            along,
            ends,
            periods,
            recorded,
            max_events,
            samples,
            events,
            extrema,
            times,
        )
        if done != OK or found != count:
            # Rounding decides whether there is an event at all.
            events[:], times[:], grazing = math.nan, math.nan, True
        code = GRAZING if grazing else code
        if pair.contact_ratio in (1.0, 2.0):
            # A segment of the other stiffness appears, on which the force jumps.
            extrema[2:, along[:, 0] != 0.0] = math.nan
    else:
        for array in (ends, samples, events, extrema, times):
            array[:] = math.nan
    return {
        **derivatives(_SAMPLES, ("phase",), np.swapaxes(samples, 0, 1), names),
        **derivatives(_EVENTS, ("event",), np.swapaxes(events, 0, 1), names),
        **derivatives(_EXTREMA, (), extrema, names),
        **derivatives(_FRACTIONS, (), times / (2.0 * math.pi * recorded), names),
        **derivatives(("final_state",), ("component",), ends[None], names),
        "sensitivity_status": flag(code),
    }


def _one_sided(pair, state, along, tangents):
    """Return whether a run starts on a flank line from which start or line moves off."""
    if pair.damping_ratio == pair.backlash_damping_ratio or state[0] not in pair.flank_lines:
        return False
    moves = tangents[0] + (along[:, 4] if state[0] else 0.0)
    return bool(moves.any())

"""By what models are differentiated: names and units, and copies a little off the real axis.

The matrices of a piecewise-linear model are algebra in its parameters. With p + i h in place of p
they become A + i h dA/dp - O(h^2), and for h = 1e-30 the square is nothing beside 1: imaginary
parts are derivatives to rounding, without a difference of two values (Squire, Trapp: SIAM Review
40 (1998) 110-112).
"""

import dataclasses
import math

from gearlib import parameters
from gearlib.models.pair_parameters import PairParameters

#: h.
STEP = 1e-30

#: name -> (CF units, words): fields of a pair, its ratios, arguments of the run.
PARAMETERS = parameters.named(PairParameters) | {
    "damping_ratio": ("1", "damping ratio beta"),
    "backlash_damping_ratio": ("1", "damping ratio beta_m of the backlash"),
    "backlash_ratio": ("1", "backlash in static deflections"),
    "tuning": ("1", "tuning nu"),
    "initial_displacement": ("1", "displacement at the start"),
    "initial_velocity": ("1", "dx/dtau at the start"),
}
#: Of `PARAMETERS`: those of the start.
START = ("initial_displacement", "initial_velocity")
_OF_GEARS = (
    ("inertias", "kg m2", "inertia of gear", 2),
    ("masses", "kg", "mass of gear", 2),
    ("bearing_stiffness", "N m-1", "stiffness of bearing", 4),
    ("bearing_damping", "N s m-1", "damping of bearing", 4),
)
_PLACES = {2: ("3", "2"), 4: ("y3", "z3", "y2", "z2")}
#: Of every model with one degree of freedom.
OF_ALL = {name: PARAMETERS[name] for name in ("tuning", *START)}


def complex_step(element, slopes):
    """Return an unchecked copy of a frozen dataclass with some fields off the real axis.

    Slopes are name of a field, or (name, index) -> what it changes by.
    """
    values = {one.name: getattr(element, one.name) for one in dataclasses.fields(element)}
    for key, slope in slopes.items():
        name, *index = key if isinstance(key, tuple) else (key,)
        if index:
            entries = list(values[name])
            entries[index[0]] += 1j * STEP * slope
            values[name] = tuple(entries)
        else:
            values[name] += 1j * STEP * slope
    return unchecked(type(element), **values)


def settable(model):
    """Return the names of derivatives that are fields, or entries of fields as ``masses[0]``."""
    known = {one.name for each in (model, model.mesh) if each for one in dataclasses.fields(each)}
    return tuple(name for name in model.derivatives if name.partition("[")[0] in known)


def value(model, name):
    """Return the value of one of `settable`."""
    field, _, index = name.rstrip("]").partition("[")
    found = getattr(model, field)
    return found[int(index)] if index else found


def with_values(model, changes):
    """Return the model with some of `settable` changed and checked."""
    fields: dict = {}
    for name, new in changes.items():
        field, _, index = name.rstrip("]").partition("[")
        if index:
            entries = list(fields.get(field, getattr(model, field)))
            entries[int(index)] = new
            new = tuple(entries)
        fields[field] = new
    return model.replace(**fields)


def unchecked(kind, **values):
    """Return a frozen dataclass of numbers that its checks do not know."""
    made = object.__new__(kind)
    for one in dataclasses.fields(kind):
        object.__setattr__(made, one.name, values.get(one.name, one.default))
    return made


def of_pair(pair, name):
    """Return what the fields of a `GearPair` change by with one of `PARAMETERS`, a dict.

    A field changes with all other fields kept, a ratio that is no field with all other ratios kept.
    """
    damping = 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
    return {
        "damping_ratio": {"material_damping": damping},
        "backlash_damping_ratio": {"backlash_damping": damping},
        "backlash_ratio": {"backlash": pair.static_deflection},
    }.get(name, {name: 1.0})


def about_the_mean(mesh, name):
    """Return the same for a contact or stiffness ratio about a mean stiffness that stays."""
    contact, kappa = mesh.contact_ratio, mesh.stiffness_ratio
    slope = {"contact_ratio": 1.0 - kappa, "stiffness_ratio": 2.0 - contact}[name]
    share = slope * mesh.max_stiffness / mesh.mean_stiffness
    return {name: 1.0, "max_stiffness": -share * mesh.max_stiffness}


def along_branch(pair, name):
    """Return the same for a ratio of a `GearPair`, of `followed_parameters.RATIOS`."""
    own = {"damping": "damping_ratio", "backlash_damping": "backlash_damping_ratio"}
    if name in ("contact_ratio", "stiffness_ratio"):
        return about_the_mean(pair, name)
    return of_pair(pair, {**own, "backlash": "backlash_ratio"}.get(name, name))


def check_edges(words, mesh, slopes):
    """Refuse to move a switch of the stiffness that is not there.

    `words` name the parameter, `mesh` is a `GearPair` or a mesh of a train.
    """
    if slopes.get("contact_ratio") and mesh.contact_ratio in (1.0, 2.0):
        raise ValueError(
            f"sensitivities = {words!r} is not allowed at contact_ratio = {mesh.contact_ratio!r}: "
            "it must be > 1 and < 2, where the stiffness has switches"
        )


def of_gears(gears):
    """Return name -> (CF units, words) of the parameters of a `SixDegreePair`."""
    found = dict(PARAMETERS)
    for name, units, words, count in _OF_GEARS:
        for i in range(count):
            if math.isfinite(getattr(gears, name)[i]):
                found[f"{name}[{i}]"] = units, f"{words} {_PLACES[count][i]}"
    return found


def along_gears(gears, name):
    """Return what the fields of a `SixDegreePair` and of its pair change by with a parameter."""
    if "[" in name:
        field, index = name[:-1].split("[")
        return {(field, int(index)): 1.0}
    slopes = gears.pair.direction(name)
    if name == "load" and gears.torques == gears.by_default["torques"](gears):
        # Those of the load go with it.
        slopes |= {("torques", i): radius for i, radius in enumerate(gears.base_radii)}
    return slopes

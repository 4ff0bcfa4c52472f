"""Parameters over which motions of a train are followed: one value for all its meshes.

A stiffness ratio or contact ratio changes the levels about the mean stiffness, so that natural
frequencies, static deflection and the unit of the tuning stay.
"""

import dataclasses
import math

from gearlib import checks

#: Of the static deflection where the reference mesh carries no load, m.
FALLBACK = 1e-6
#: name -> (CF units, long_name)
PARAMETERS = {
    "tuning": ("1", "tuning nu, reference mesh frequency over reference frequency"),
    "stiffness_ratio": ("1", "stiffness ratio kappa = C_min / C_max of all meshes"),
    "contact_ratio": ("1", "contact ratio epsilon of all meshes"),
    "backlash": ("1", "backlash of all meshes in static deflections"),
    "material_damping": ("N s m-1", "damping in contact of all meshes"),
}


def value_of(train, name):
    """Return the value of a parameter that all meshes share, else raise ValueError."""
    values = {getattr(mesh, name) for mesh in train.meshes}
    if len(values) > 1:
        raise ValueError(
            f"parameter = {name!r} is not allowed for this train: its meshes must share one value, "
            f"not {', '.join(map(repr, sorted(values)))}"
        )
    value = values.pop()
    return value / train.static_deflection if name == "backlash" else value


def with_value(train, name, value):
    """Return the train with a parameter of all meshes set; a wrong value is refused."""
    if name == "backlash":
        value = checks.number(name, value, "a number >= 0, inf included", lambda v: v >= 0.0)
        value *= train.static_deflection

    def changed(mesh):
        new = dataclasses.replace(mesh, **{name: value})
        share = mesh.mean_stiffness / new.mean_stiffness
        return (
            new
            if math.isclose(share, 1.0)
            else dataclasses.replace(new, max_stiffness=new.max_stiffness * share)
        )

    return dataclasses.replace(train, meshes=tuple(map(changed, train.meshes)))

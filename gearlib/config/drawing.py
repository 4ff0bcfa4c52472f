"""From the sections of drawn gears to `gearlib.geometry`; what it refuses is named by its key.

The geometry is loaded where a configuration has such sections.
"""

import dataclasses
import re
from contextlib import contextmanager

#: What is derived keeps so many digits: the same drawing in other units, whose rounding differs,
#: reruns nothing.
_DIGITS = 12
#: What the second gear of a mesh takes over from the first where it leaves it out.
_COMMON = ("module", "width", "pressure_angle", "helix_angle", "material")
#: Key of a section -> field of a `Rack`.
_OF_RACK = {"addendum": "addendum", "dedendum": "dedendum", "fillet_radius": "tip_radius"}
#: How messages of the geometry name a part of a gear or a mesh.
_PART = re.compile(r"(\w+) of (?:the|a) (pinion|wheel|ring gear|rack|web|material)")


def gear_of(key, section, like=None, internal=False):
    """Return the `SpurGear` of a section.

    Parameters
    ----------
    key : str
        Full key of the section, for messages.
    section : gearlib.config.gears.GearSection
    like : GearSection, optional
        The gear whose module, width, angles, rack and material this one has where it leaves them
        out.
    internal : bool, default False

    Raises
    ------
    ValueError
        If there cannot be such a gear; the message names the key.
    """
    from gearlib.models.geometry.blank import RACKS, Material, Web
    from gearlib.models.geometry.gear import SpurGear

    given = section.model_dump()
    if like is not None:
        other, names = like.model_dump(), list(_COMMON)
        if not given.keys() & {"rack", *_OF_RACK}:
            names += ["rack", *_OF_RACK]
        given = {name: other[name] for name in names if name in other} | given
    rack = {field: given.pop(name) for name, field in _OF_RACK.items() if name in given}
    places = {"rack": key, "web": f"{key}.web", "material": f"{key}.material"}
    with naming(key, places):
        if rack:
            given["rack"] = dataclasses.replace(RACKS[given.get("rack", "A")], **rack)
        for name, make in (("material", Material), ("web", Web)):
            if name in given:
                given[name] = make(**given[name])
        return SpurGear(**({"internal": internal} | given))


def mesh_of(key, section, pinion, wheel, keys):
    """Return the `gearlib.geometry.Mesh` of two gears; `keys` are the full ones of both."""
    from gearlib.models.geometry.mesh import Mesh

    with naming(key, _places(keys)):
        return Mesh(pinion, wheel, section.centre_distance, section.backlash)


def derived(key, section, keys, derive, **options):
    """Return what `derive` makes of the stiffness options of a section and others, rounded."""
    if "torque" in section.stiffness_options:
        raise ValueError(f"{key}.stiffness_options.torque is not allowed: it must be {key}.torque")
    places = _places(keys) | {
        name: f"{key}.stiffness_options" for name in section.stiffness_options
    }
    with naming(key, places):
        found = derive(stiffness=section.stiffness, options=section.stiffness_options, **options)
    return {name: rounded(value) for name, value in found.items()}


def coefficient(name, value, stiffness, mass):
    """Return the damping coefficient, N s/m, of a ratio or decrement, rounded.

    Parameters
    ----------
    name : str
        Its key in a damping.
    value : float
    stiffness, mass : float
        C_s in N/m and m_red in kg.
    """
    from gearlib.models.geometry.parameters import coefficient

    return rounded(coefficient(value, stiffness, mass, name == "logarithmic_decrement"))


def _places(keys):
    pinion, wheel = keys
    return {
        "pinion": pinion,
        "wheel": wheel,
        "ring gear": wheel,
        "outer_diameter": wheel,
        "sum": f"{pinion}.shift and {wheel}.shift",
    }


@contextmanager
def naming(key, places):
    """Name keys in full where the geometry refuses; `places`: name of a part -> its full key."""
    try:
        yield
    except ValueError as error:
        text = str(error)
        part, first = _PART.match(text), re.match(r"\w+", text)[0]
        if part and part[2] in places:
            name = {"tip_radius of a rack": "fillet_radius"}.get(part[0], part[1])
            text = f"{places[part[2]]}.{name}{text[part.end() :]}"
        elif text.startswith("sum of the shifts"):
            text = text.replace("the shifts", places["sum"], 1)
        elif first == "contact_ratio":
            text = text.replace(first, f"{first} of {key}", 1)
        else:
            text = f"{places.get(first, key)}.{text}"
        raise ValueError(text) from None


def rounded(value):
    """Return a number with 12 digits, an integer as it is."""
    return value if isinstance(value, int) else float(f"{value:.{_DIGITS}g}")

"""From plain values, as a configuration has them, to drawn gears; refusals by other names."""

import dataclasses
import re
from contextlib import contextmanager

from gearlib.models.geometry.blank import RACKS, Material, Web
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.geometry.relief import TipRelief

#: What the second gear of a mesh takes over from the first where it leaves it out.
_COMMON = ("module", "width", "pressure_angle", "helix_angle", "material")
#: Key -> field of a `Rack`, each in place of that of the letter.
OF_RACK = {"addendum": "addendum", "dedendum": "dedendum", "fillet_radius": "tip_radius"}
#: How messages name a part.
_PARTS = "pinion|wheel|ring gear|sun mesh|ring mesh|sun|planet|ring|rack|web|material|tip relief"
_PART = re.compile(rf"(\w+(?: of the tip relief(?= of))?) of (?:the|a) ({_PARTS})\b")


def gear(values, like=None, **more):
    """Return the `SpurGear` of plain values, with `more` arguments.

    Material, web and tip relief are dicts, `rack` a letter with the keys of `OF_RACK` beside it.
    `like` are values of the gear whose module, width, angles, rack and material it has where it
    leaves them out.
    """
    given = dict(values)
    if like is not None:
        names = list(_COMMON)
        if not given.keys() & {"rack", *OF_RACK}:
            names += ["rack", *OF_RACK]
        given = {name: like[name] for name in names if name in like} | given
    rack = {field: given.pop(name) for name, field in OF_RACK.items() if name in given}
    if rack:
        given["rack"] = dataclasses.replace(RACKS[given.get("rack", "A")], **rack)
    for name, make in (("material", Material), ("web", Web), ("tip_relief", TipRelief)):
        if name in given:
            given[name] = make(**given[name])
    return SpurGear(**(more | given))


def mesh(values):
    """Return the `Mesh` of plain values: pinion and wheel as of `gear`, centre_distance, backlash.

    What the wheel shares with the pinion it may leave out; other keys do not count.
    """
    pinion, wheel = gear(values["pinion"]), gear(values["wheel"], values["pinion"])
    return Mesh(pinion, wheel, values.get("centre_distance"), values.get("backlash"))


@contextmanager
def renaming(rename):
    """Name what the geometry refuses in another way.

    `rename` gets the name of a parameter and that of its part, or None, and returns what stands
    for both.
    """
    try:
        yield
    except ValueError as error:
        text = str(error)
        match = _PART.match(text) or re.match(r"(sum) of the (shifts)|(\w+)", text)
        name, part = match[1] or match[3], match[2]
        raise ValueError(f"{rename(name, part)}{text[match.end() :]}") from None

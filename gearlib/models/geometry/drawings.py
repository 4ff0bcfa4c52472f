"""Drawn gears and meshes from plain values; planetary sets; refusals by other names."""

import dataclasses
import math
import re
from contextlib import contextmanager
from typing import NamedTuple

from gearlib import checks
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.geometry.parts import RACKS, Material, TipRelief, Web

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


#: Of a tooth pitch, by which positions may miss: angles are often given with few digits.
_CLOSE = 1e-6
#: Teeth by which the ring of a set may differ from z_s + 2 z_p where profile shifts make up for it.
_SHIFTED = 2


class Planets(NamedTuple):
    """Both meshes of a planetary set, and where its planets are."""

    sun_mesh: Mesh
    ring_mesh: Mesh
    positions: tuple  #: angles, rad


def planets_of(
    sun, planet, ring, *, planets=3, positions=None, centre_distance=None, backlashes=None
):
    """Return the `Planets` of drawn gears; arguments and refusals as of `planetary_set`."""
    gaps = (None, None) if backlashes is None else checks.many("backlashes", backlashes, 2)
    if not getattr(ring, "internal", False):
        raise ValueError(
            "internal of the ring = False is not allowed: it must be True, of a ring gear"
        )
    try:
        with renaming(_in({"pinion": "sun", "wheel": "planet"}, "sun")):
            of_sun = Mesh(sun, planet, centre_distance, gaps[0])
        with renaming(_in({"pinion": "planet", "wheel": "ring", "ring gear": "ring"}, "ring")):
            of_ring = Mesh(planet, ring, of_sun.centre_distance, gaps[1])
    except ValueError:
        _check_sum(sun, planet, ring, centre_distance)
        raise
    count = checks.integer("planets", planets, 1)
    total = sun.teeth + ring.teeth
    positions = equal_positions(sun.teeth, ring.teeth, count) if positions is None else positions
    places = checks.finite("positions", checks.many("positions", positions, count))
    for i, angle in enumerate(places):
        pitches = total * (angle - places[0]) / math.tau
        if abs(pitches - round(pitches)) > _CLOSE:
            raise ValueError(
                f"positions[{i}] = {angle!r} is not allowed: the planet can be assembled only a "
                f"whole multiple of 2 pi / (z_s + z_r) = {math.tau / total:.6g} rad from the first"
            )
    _check_neighbours(of_sun, count, places)
    return Planets(of_sun, of_ring, places)


def equal_positions(sun, ring, count):
    """Return the angles of equally spaced planets between gears of so many teeth."""
    if (sun + ring) % count:
        raise ValueError(
            f"planets = {count} is not allowed: (z_s + z_r) / N = ({sun} + {ring}) / {count} must "
            "be an integer for equal spacing"
        )
    return [2.0 * math.pi * i / count for i in range(count)]


def _check_sum(sun, planet, ring, centre_distance):
    """Refuse teeth that do not add up where the meshes cannot be; for a few shifts may make up."""
    if not all(isinstance(gear, SpurGear) for gear in (sun, planet, ring)):
        return
    sizes = {(gear.module, gear.pressure_angle, gear.helix_angle) for gear in (sun, planet, ring)}
    wanted = sun.teeth + 2 * planet.teeth
    placed = centre_distance is not None or any(gear.shift for gear in (sun, planet, ring))
    if len(sizes) == 1 and abs(ring.teeth - wanted) > (_SHIFTED if placed else 0):
        raise ValueError(
            f"teeth of the ring = {ring.teeth} is not allowed: it must be z_s + 2 z_p = "
            f"{sun.teeth} + 2 * {planet.teeth} = {wanted}, or so near that profile shifts make up "
            "for the rest"
        ) from None


def _check_neighbours(mesh, count, places):
    turned = sorted(angle % math.tau for angle in places)
    steps = [b - a for a, b in zip(turned, [*turned[1:], turned[0] + math.tau], strict=True)]
    apart = 2.0 * mesh.centre_distance * math.sin(min(*steps, math.pi) / 2.0)
    if count > 1 and apart <= mesh.wheel.tip_diameter:
        raise ValueError(
            f"planets = {count} is not allowed: the tip circles of neighbours, "
            f"{mesh.wheel.tip_diameter:.6g} m in diameter, must keep clear of each other, and "
            f"their axes are {apart:.6g} m apart"
        )


def _in(names, mesh):
    def rename(name, part):
        return f"{name} of the {names.get(part, f'{mesh} mesh')}"

    return rename

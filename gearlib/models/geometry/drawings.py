"""Drawn gears and meshes from plain values; planetary sets; refusals by other names."""

import dataclasses
import math
import re
from contextlib import contextmanager
from typing import NamedTuple

from gearlib import checks
from gearlib.models.geometry.gear import RACKS, Material, SpurGear, TipRelief, Web
from gearlib.models.geometry.mesh import Mesh

#: Fields that the second gear of a mesh takes from the first where they are left out.
_COMMON_FIELDS = ("module", "width", "pressure_angle", "helix_angle", "material")
#: Key of a gear -> field of its `Rack`, which replaces that of the rack of its letter.
RACK_FIELDS = {"addendum": "addendum", "dedendum": "dedendum", "fillet_radius": "tip_radius"}
#: Names of parts in messages.
_PARTS = "pinion|wheel|ring gear|sun mesh|ring mesh|sun|planet|ring|rack|web|material|tip relief"
_PART = re.compile(rf"(\w+(?: of the tip relief(?= of))?) of (?:the|a) ({_PARTS})\b")


def gear(values, like=None, **more):
    """Return the `SpurGear` of plain values, with `more` arguments.

    Material, web and tip relief are dicts, `rack` is a letter with the keys of `RACK_FIELDS` beside
    it. `like` has the values of another gear: module, width, angles, rack and material are taken
    from there where they are left out.
    """
    fields = dict(values)
    if like is not None:
        names = list(_COMMON_FIELDS)
        if not fields.keys() & {"rack", *RACK_FIELDS}:
            names += ["rack", *RACK_FIELDS]
        fields = {name: like[name] for name in names if name in like} | fields
    rack = {field: fields.pop(name) for name, field in RACK_FIELDS.items() if name in fields}
    if rack:
        fields["rack"] = dataclasses.replace(RACKS[fields.get("rack", "A")], **rack)
    for name, part in (("material", Material), ("web", Web), ("tip_relief", TipRelief)):
        if name in fields:
            fields[name] = part(**fields[name])
    return SpurGear(**(more | fields))


def mesh(values):
    """Return the `Mesh` of plain values with the keys pinion, wheel, centre_distance, backlash.

    The wheel takes values that it leaves out from the pinion, see `gear`; other keys are ignored.
    """
    pinion, wheel = gear(values["pinion"]), gear(values["wheel"], values["pinion"])
    return Mesh(pinion, wheel, values.get("centre_distance"), values.get("backlash"))


@contextmanager
def renaming(rename):
    """Rename the parameters in the messages of ValueErrors that the geometry raises.

    `rename` takes the name of a parameter and that of its part, or None, and returns the new name.
    """
    try:
        yield
    except ValueError as error:
        text = str(error)
        match = _PART.match(text) or re.match(r"(sum) of the (shifts)|(\w+)", text)
        name, part = match[1] or match[3], match[2]
        raise ValueError(f"{rename(name, part)}{text[match.end() :]}") from None


#: Largest error of a planet's position in tooth pitches: angles often have few digits.
_POSITION_TOLERANCE = 1e-6
#: Largest difference of teeth of the ring from z_s + 2 z_p that profile shifts make up for.
_MAX_SHIFTED_TEETH = 2


class Planets(NamedTuple):
    """Both meshes of a planetary set, and the angles of its planets."""

    sun_mesh: Mesh
    ring_mesh: Mesh
    positions: tuple  #: angles, rad


def planets_of(
    sun, planet, ring, *, planets=3, positions=None, centre_distance=None, backlashes=None
):
    """Return the `Planets` of drawn gears; `planetary_set` documents arguments and errors."""
    backlash = (None, None) if backlashes is None else checks.many("backlashes", backlashes, 2)
    internal = getattr(ring, "internal", False)
    checks.require(internal, "internal of the ring", False, "True, of a ring gear")
    try:
        with _renaming_gears("sun mesh", pinion="sun", wheel="planet"):
            sun_mesh = Mesh(sun, planet, centre_distance, backlash[0])
        with _renaming_gears("ring mesh", **{"ring gear": "ring"}, pinion="planet", wheel="ring"):
            ring_mesh = Mesh(planet, ring, sun_mesh.centre_distance, backlash[1])
    except ValueError:
        _check_sum(sun, planet, ring, centre_distance)
        raise
    count = checks.integer("planets", planets, 1)
    total = sun.teeth + ring.teeth
    positions = equal_positions(sun.teeth, ring.teeth, count) if positions is None else positions
    places = checks.finite("positions", checks.many("positions", positions, count))
    for i, angle in enumerate(places):
        pitches = total * (angle - places[0]) / math.tau
        if abs(pitches - round(pitches)) > _POSITION_TOLERANCE:
            raise ValueError(
                f"positions[{i}] = {angle!r} is not allowed: the planet can be assembled only a "
                f"whole multiple of 2 pi / (z_s + z_r) = {math.tau / total:.6g} rad from the first"
            )
    _check_neighbours(sun_mesh, count, places)
    return Planets(sun_mesh, ring_mesh, places)


def equal_positions(sun, ring, count):
    """Return the angles of equally spaced planets between gears of so many teeth."""
    if (sun + ring) % count:
        raise ValueError(
            f"planets = {count} is not allowed: (z_s + z_r) / N = ({sun} + {ring}) / {count} must "
            "be an integer for equal spacing"
        )
    return [2.0 * math.pi * i / count for i in range(count)]


def _check_sum(sun, planet, ring, centre_distance):
    """Refuse teeth of the ring that differ too much from z_s + 2 z_p."""
    if not all(isinstance(gear, SpurGear) for gear in (sun, planet, ring)):
        return
    sizes = {(gear.module, gear.pressure_angle, gear.helix_angle) for gear in (sun, planet, ring)}
    wanted = sun.teeth + 2 * planet.teeth
    placed = centre_distance is not None or any(gear.shift for gear in (sun, planet, ring))
    if len(sizes) == 1 and abs(ring.teeth - wanted) > (_MAX_SHIFTED_TEETH if placed else 0):
        raise ValueError(
            f"teeth of the ring = {ring.teeth} is not allowed: it must be z_s + 2 z_p = "
            f"{sun.teeth} + 2 * {planet.teeth} = {wanted}, or so near that profile shifts make up "
            "for the rest"
        ) from None


def _check_neighbours(mesh: Mesh, count: int, places: tuple) -> None:
    """Refuse planets whose tip circles touch."""
    turned = sorted(angle % math.tau for angle in places)
    steps = [b - a for a, b in zip(turned, [*turned[1:], turned[0] + math.tau], strict=True)]
    apart = 2.0 * mesh.centre_distance * math.sin(min(*steps, math.pi) / 2.0)
    if count > 1 and apart <= mesh.wheel.tip_diameter:
        raise ValueError(
            f"planets = {count} is not allowed: the tip circles of neighbours, "
            f"{mesh.wheel.tip_diameter:.6g} m in diameter, must keep clear of each other, and "
            f"their axes are {apart:.6g} m apart"
        )


def _renaming_gears(mesh: str, **names: str):
    """Rename the gears of a mesh of a planetary set, by `renaming`."""
    return renaming(lambda name, part: f"{name} of the {names.get(part, mesh)}")

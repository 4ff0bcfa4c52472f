"""Drawn gears, meshes and planetary sets from plain values."""

import dataclasses
import math
import re
from contextlib import contextmanager
from typing import NamedTuple

from gearlib import checks
from gearlib.models.geometry.gear import RACKS, Material, SpurGear, TipRelief, Web
from gearlib.models.geometry.mesh import Mesh

#: Fields that the second gear of a mesh takes from the first by default.
_COMMON_FIELDS = ("module", "width", "pressure_angle", "helix_angle", "material")
#: Key of a gear -> field of its `Rack` that it replaces.
RACK_FIELDS = {"addendum": "addendum", "dedendum": "dedendum", "fillet_radius": "tip_radius"}
#: Names of gears and their parts in error messages.
_PARTS = "pinion|wheel|ring gear|sun mesh|ring mesh|sun|planet|ring|rack|web|material|tip relief"
_PART = re.compile(rf"(\w+(?: of the tip relief(?= of))?) of (?:the|a) ({_PARTS})\b")


def gear(values, mate_values=None, **default_fields):
    """Return the `SpurGear` of a dict of plain values.

    Material, web and tip relief are dicts; `rack` is a letter, and the keys of `RACK_FIELDS` change
    that rack. `mate_values` are those of a gear from which missing module, width, angles, rack and
    material are taken.
    """
    fields = dict(values)
    if mate_values is not None:
        names = list(_COMMON_FIELDS)
        if not fields.keys() & {"rack", *RACK_FIELDS}:
            names += ["rack", *RACK_FIELDS]
        fields = {name: mate_values[name] for name in names if name in mate_values} | fields
    rack = {field: fields.pop(name) for name, field in RACK_FIELDS.items() if name in fields}
    if rack:
        fields["rack"] = dataclasses.replace(RACKS[fields.get("rack", "A")], **rack)
    for name, part_class in (("material", Material), ("web", Web), ("tip_relief", TipRelief)):
        if name in fields:
            fields[name] = part_class(**fields[name])
    return SpurGear(**(default_fields | fields))


def mesh(values):
    """Return the `Mesh` of a dict with the keys pinion, wheel, centre_distance and backlash.

    The wheel takes missing values from the pinion, as in `gear`; other keys are ignored.
    """
    pinion, wheel = gear(values["pinion"]), gear(values["wheel"], values["pinion"])
    return Mesh(pinion, wheel, values.get("centre_distance"), values.get("backlash"))


@contextmanager
def renaming(rename):
    """Replace the names of parameters in ValueErrors that are raised in this context.

    `rename` is a function from the name of a parameter and of its part, or None, to the new name.
    """
    try:
        yield
    except ValueError as error:
        text = str(error)
        match = _PART.match(text) or re.match(r"(sum) of the (shifts)|(\w+)", text)
        name, part = match[1] or match[3], match[2]
        raise ValueError(f"{rename(name, part)}{text[match.end() :]}") from None


#: Largest position error of a planet in tooth pitches: angles are often rounded.
_POSITION_TOLERANCE = 1e-6
#: Largest difference of the teeth of the ring from z_s + 2 z_p with profile shifts.
_MAX_SHIFTED_TEETH = 2


class Planets(NamedTuple):
    """The meshes of sun and ring of a planetary set, and the angles of its planets."""

    sun_mesh: Mesh
    ring_mesh: Mesh
    positions: tuple  #: angles, rad


def planets_of(
    sun, planet, ring, *, planets=3, positions=None, centre_distance=None, backlashes=None
):
    """Return the checked meshes and planet angles of a drawn planetary set.

    The arguments and errors are those of `gearlib.planetary_set`.
    """
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
    angles = checks.finite("positions", checks.many("positions", positions, count))
    for i, angle in enumerate(angles):
        pitches = total * (angle - angles[0]) / math.tau
        if abs(pitches - round(pitches)) > _POSITION_TOLERANCE:
            raise ValueError(
                f"positions[{i}] = {angle!r} is not allowed: the planet can be assembled only a "
                f"whole multiple of 2 pi / (z_s + z_r) = {math.tau / total:.6g} rad from the first"
            )
    _check_neighbours(sun_mesh, count, angles)
    return Planets(sun_mesh, ring_mesh, angles)


def equal_positions(sun, ring, count):
    """Return the angles of equally spaced planets from the tooth numbers of sun and ring."""
    if (sun + ring) % count:
        raise ValueError(
            f"planets = {count} is not allowed: (z_s + z_r) / N = ({sun} + {ring}) / {count} must "
            "be an integer for equal spacing"
        )
    return [2.0 * math.pi * i / count for i in range(count)]


def _check_sum(sun, planet, ring, centre_distance):
    """Raise ValueError if the teeth of the ring differ too much from z_s + 2 z_p."""
    if not all(isinstance(gear, SpurGear) for gear in (sun, planet, ring)):
        return
    sizes = {(gear.module, gear.pressure_angle, gear.helix_angle) for gear in (sun, planet, ring)}
    ring_teeth = sun.teeth + 2 * planet.teeth
    shifted = centre_distance is not None or any(gear.shift for gear in (sun, planet, ring))
    tolerance = _MAX_SHIFTED_TEETH if shifted else 0
    if len(sizes) == 1 and abs(ring.teeth - ring_teeth) > tolerance:
        raise ValueError(
            f"teeth of the ring = {ring.teeth} is not allowed: it must be z_s + 2 z_p = "
            f"{sun.teeth} + 2 * {planet.teeth} = {ring_teeth}, or so near that profile shifts make "
            "up for the rest"
        ) from None


def _check_neighbours(mesh: Mesh, count: int, positions: tuple) -> None:
    """Raise ValueError if the tip circles of neighbouring planets overlap."""
    angles = sorted(angle % math.tau for angle in positions)
    steps = [b - a for a, b in zip(angles, [*angles[1:], angles[0] + math.tau], strict=True)]
    distance = 2.0 * mesh.centre_distance * math.sin(min(*steps, math.pi) / 2.0)
    if count > 1 and distance <= mesh.wheel.tip_diameter:
        raise ValueError(
            f"planets = {count} is not allowed: the tip circles of neighbours, "
            f"{mesh.wheel.tip_diameter:.6g} m in diameter, must keep clear of each other, and "
            f"their axes are {distance:.6g} m apart"
        )


def _renaming_gears(mesh: str, **names: str):
    """Return a context that names gears of a planetary set in errors, old name -> new name."""
    return renaming(lambda name, part: f"{name} of the {names.get(part, mesh)}")

"""Geometry of gears, meshes and planetary sets from plain values."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from gearlib import checks
from gearlib.models.geometry.gear import RACKS, Material, SpurGear, TipRelief, Web
from gearlib.models.geometry.gear_stage import GearStage

#: Fields that the second gear of a mesh takes from the first by default.
_COMMON_FIELDS = ("module", "width", "pressure_angle", "helix_angle", "material")
#: Key of a gear -> field of its `Rack` that it replaces.
RACK_FIELDS = {"addendum": "addendum", "dedendum": "dedendum", "fillet_radius": "tip_radius"}


def gear(values: dict, mate_values: dict | None = None, **default_fields: Any) -> SpurGear:
    """Build and return a `SpurGear` from a dict of its fields in SI units.

    Material, web and tip relief are dicts of their fields; `rack` is a letter of ISO 53, and the
    keys addendum, dedendum and fillet_radius change this rack. A missing module, width, angle, rack
    or material is taken from `mate_values`, the dict of the mating gear, and any other missing
    field from `default_fields`.
    """
    fields = dict(values)
    if mate_values is not None:
        names = list(_COMMON_FIELDS)
        if not fields.keys() & {"rack", *RACK_FIELDS}:
            names += ["rack", *RACK_FIELDS]
        fields = {name: mate_values[name] for name in names if name in mate_values} | fields
    rack = {field: fields.pop(name) for name, field in RACK_FIELDS.items() if name in fields}
    if rack:
        with checks.below("", **{field: name for name, field in RACK_FIELDS.items()}):
            fields["rack"] = dataclasses.replace(RACKS[fields.get("rack", "A")], **rack)
    for name, field_class in (("material", Material), ("web", Web), ("tip_relief", TipRelief)):
        if name in fields:
            with checks.below(name):
                fields[name] = field_class(**fields[name])
    with checks.below("", **{"rack.dedendum": "dedendum"}):
        return SpurGear(**(default_fields | fields))


def stage(values: dict) -> GearStage:
    """Build and return a `GearStage` from a dict with pinion, wheel, centre_distance and backlash.

    Pinion and wheel are dicts of gears; the wheel takes missing values from the pinion. Lengths are
    in m, and other keys are ignored.
    """
    with checks.below("pinion"):
        pinion = gear(values["pinion"])
    with checks.below("wheel"):
        wheel = gear(values["wheel"], mate_values=values["pinion"])
    return GearStage(pinion, wheel, values.get("centre_distance"), values.get("backlash"))


#: Largest position error of a planet in tooth pitches, since angles are often rounded.
_POSITION_TOLERANCE = 1e-6
#: Largest difference of the teeth of the ring from z_s + 2 z_p that profile shifts allow.
_MAX_SHIFTED_TEETH = 2


class PlanetaryMeshes(NamedTuple):
    """Meshes of the planets with sun and ring of a planetary set, and angles of the planets."""

    sun_mesh: GearStage
    ring_mesh: GearStage
    positions: tuple  #: angles, rad


def planetary_meshes(
    sun, planet, ring, *, planets=3, positions=None, centre_distance=None, backlashes=None
) -> PlanetaryMeshes:
    """Check a planetary set of three `SpurGear`, and return its meshes and angles of planets.

    `planets` is the number of planets, `positions` their angles in rad, by default equally spaced.
    `centre_distance` of sun and planet is in m; `backlashes` are the normal backlashes of the sun
    mesh and the ring mesh in m. By default both follow from the geometry of the gears.
    """
    backlash = backlashes or (None, None)
    internal = getattr(ring, "internal", False)
    checks.require(internal, "ring.internal", False, "True, of a ring gear")
    try:
        with checks.below("", owner="the sun mesh", pinion="sun", wheel="planet"):
            sun_mesh = GearStage(sun, planet, centre_distance, backlash[0])
        with checks.below("", owner="the ring mesh", pinion="planet", wheel="ring"):
            ring_mesh = GearStage(planet, ring, sun_mesh.centre_distance, backlash[1])
    except ValueError:
        _check_ring_teeth(sun, planet, ring, centre_distance)
        raise
    tooth_sum = sun.teeth + ring.teeth
    positions = equal_positions(sun.teeth, ring.teeth, planets) if positions is None else positions
    angles = tuple(checks.sequence("positions", positions, planets))
    for i, angle in enumerate(angles):
        pitches = tooth_sum * (angle - angles[0]) / math.tau
        if abs(pitches - round(pitches)) > _POSITION_TOLERANCE:
            allowed = (
                f"a whole multiple of 2 pi / (z_s + z_r) = {math.tau / tooth_sum:.6g} rad from the "
                "first, or the planet cannot be assembled"
            )
            raise checks.refusal(f"positions[{i}]", angle, allowed)
    _check_planet_spacing(sun_mesh, planets, angles)
    return PlanetaryMeshes(sun_mesh, ring_mesh, angles)


def equal_positions(sun_teeth: int, ring_teeth: int, count: int) -> list[float]:
    """Return the angles in rad of `count` equally spaced planets; ValueError if they do not fit."""
    allowed = (
        f"such that (z_s + z_r) / N = ({sun_teeth} + {ring_teeth}) / {count} is an integer, "
        "for equal spacing"
    )
    checks.require((sun_teeth + ring_teeth) % count == 0, "planets", count, allowed)
    return [2.0 * math.pi * i / count for i in range(count)]


def _check_ring_teeth(sun, planet, ring, centre_distance) -> None:
    """Raise ValueError if the number of teeth of the ring differs too much from z_s + 2 z_p."""
    gears = (sun, planet, ring)
    if not all(isinstance(gear, SpurGear) for gear in gears):
        return
    tooth_sizes = {(gear.module, gear.pressure_angle, abs(gear.helix_angle)) for gear in gears}
    ring_teeth = sun.teeth + 2 * planet.teeth
    shifted = centre_distance is not None or any(gear.shift for gear in gears)
    tolerance = _MAX_SHIFTED_TEETH if shifted else 0
    if len(tooth_sizes) == 1 and abs(ring.teeth - ring_teeth) > tolerance:
        allowed = (
            f"z_s + 2 z_p = {sun.teeth} + 2 * {planet.teeth} = {ring_teeth}, or so near that "
            "profile shifts make up for the difference"
        )
        raise checks.refusal("ring.teeth", ring.teeth, allowed) from None


def _check_planet_spacing(sun_mesh: GearStage, count: int, angles: Sequence[float]) -> None:
    """Raise ValueError if the tip circles of `count` planets at angles in rad overlap."""
    sorted_angles = sorted(angle % math.tau for angle in angles)
    next_angles = [*sorted_angles[1:], sorted_angles[0] + math.tau]
    spacings = [
        following - angle for angle, following in zip(sorted_angles, next_angles, strict=True)
    ]
    distance = 2.0 * sun_mesh.centre_distance * math.sin(min(*spacings, math.pi) / 2.0)
    tip_diameter = sun_mesh.wheel.tip_diameter
    allowed = (
        f"such that the tip circles of neighbours, {tip_diameter:.6g} m in diameter, keep "
        f"clear of each other; their axes are {distance:.6g} m apart"
    )
    checks.require(count <= 1 or distance > tip_diameter, "planets", count, allowed)

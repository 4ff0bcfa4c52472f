"""Build gears, gear stages and planetary sets from plain values."""

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from gearlib import checks
from gearlib.models.geometry.gear import RACKS, Material, SpurGear, TipRelief, Web
from gearlib.models.geometry.gear_stage import GearStage

#: Fields that a gear takes from its mate by default.
_COMMON_FIELDS = ("module", "width", "pressure_angle", "helix_angle", "material")
#: Key in the dict of a gear -> field of its `Rack`.
RACK_FIELDS = {"addendum": "addendum", "dedendum": "dedendum", "fillet_radius": "tip_radius"}


def build_gear(values: dict, mate_values: dict | None = None, **default_fields: Any) -> SpurGear:
    """Build a `SpurGear` from a dict of its fields in SI units.

    Material, web and tip relief are dicts of their fields; `rack` is a letter of ISO 53, "A" to
    "D", and the keys addendum, dedendum and fillet_radius override fields of this rack. Missing
    module, width, pressure angle, helix angle, rack and material are taken from `mate_values`, the
    dict of the mating gear. `default_fields` are defaults of other fields.
    """
    fields = dict(values)
    if mate_values is not None:
        common_fields = list(_COMMON_FIELDS)
        # The rack of the mate is used only if no key of a rack is given.
        if not fields.keys() & {"rack", *RACK_FIELDS}:
            common_fields += ["rack", *RACK_FIELDS]
        mate_fields = {name: mate_values[name] for name in common_fields if name in mate_values}
        fields = mate_fields | fields
    rack_keys = [key for key in RACK_FIELDS if key in fields]
    rack_changes = {RACK_FIELDS[key]: fields.pop(key) for key in rack_keys}
    if rack_changes:
        # Error messages name the keys of the gear instead of the fields of its rack.
        with checks.prefix_error_paths(
            "", **{rack_field: key for key, rack_field in RACK_FIELDS.items()}
        ):
            fields["rack"] = dataclasses.replace(RACKS[fields.get("rack", "A")], **rack_changes)
    for name, field_class in (("material", Material), ("web", Web), ("tip_relief", TipRelief)):
        if name in fields:
            with checks.prefix_error_paths(name):
                fields[name] = field_class(**fields[name])
    with checks.prefix_error_paths("", **{"rack.dedendum": "dedendum"}):
        return SpurGear(**(default_fields | fields))


def build_stage(values: dict) -> GearStage:
    """Build a `GearStage`, i.e. two gears in mesh, from a dict.

    Its keys `pinion` and `wheel` are dicts of gear fields; missing common values of the wheel, such
    as the module, are taken from the pinion. The keys `centre_distance` and `backlash`, in m, are
    optional. Other keys are ignored.
    """
    with checks.prefix_error_paths("pinion"):
        pinion = build_gear(values["pinion"])
    with checks.prefix_error_paths("wheel"):
        wheel = build_gear(values["wheel"], mate_values=values["pinion"])
    return GearStage(pinion, wheel, values.get("centre_distance"), values.get("backlash"))


#: Largest position error of a planet, in tooth pitches, to allow for rounded angles.
_POSITION_TOLERANCE = 1e-6
#: Largest difference of the number of ring teeth from z_s + 2 z_p that profile shifts allow.
_MAX_SHIFTED_TEETH = 2


class PlanetaryMeshes(NamedTuple):
    """The two meshes of each planet in a planetary set, and the angles of the planets."""

    sun_mesh: GearStage
    ring_mesh: GearStage
    positions: tuple  #: angles of the planets, rad


def build_planetary_meshes(
    sun, planet, ring, *, planets=3, positions=None, centre_distance=None, backlashes=None
) -> PlanetaryMeshes:
    """Build the two meshes of a planetary set and check the positions of its planets.

    `sun`, `planet` and `ring` are `SpurGear`; `planets` is the number of planets, and `positions`
    are their angles in rad, by default equally spaced. `centre_distance` of sun and planet and the
    normal `backlashes` of (sun mesh, ring mesh) are in m; by default they follow from the gears.
    Raise ValueError if the gears do not fit together or the planets cannot be assembled.
    """
    sun_backlash, ring_backlash = backlashes or (None, None)
    internal = getattr(ring, "internal", False)  # False also if `ring` is not a gear
    checks.require(internal, "ring.internal", False, "True, of a ring gear")
    try:
        with checks.prefix_error_paths("", owner="the sun mesh", pinion="sun", wheel="planet"):
            sun_mesh = GearStage(sun, planet, centre_distance, sun_backlash)
        with checks.prefix_error_paths("", owner="the ring mesh", pinion="planet", wheel="ring"):
            ring_mesh = GearStage(planet, ring, sun_mesh.centre_distance, ring_backlash)
    except ValueError:
        # A wrong number of ring teeth is reported instead of its consequence.
        _check_ring_teeth(sun, planet, ring, centre_distance)
        raise
    tooth_sum = sun.teeth + ring.teeth
    if positions is None:
        positions = equally_spaced_positions(sun.teeth, ring.teeth, planets)
    angles = tuple(checks.check_sequence("positions", positions, planets))
    for i, angle in enumerate(angles):
        # The planet can be assembled at an integer number of pitches from the first planet.
        pitches = tooth_sum * (angle - angles[0]) / math.tau
        if abs(pitches - round(pitches)) > _POSITION_TOLERANCE:
            allowed = (
                f"an integer multiple of 2 pi / (z_s + z_r) = {math.tau / tooth_sum:.6g} rad from "
                "the first, or the planet cannot be assembled"
            )
            raise checks.InputError(f"positions[{i}]", angle, allowed)
    _check_planet_spacing(sun_mesh, planets, angles)
    return PlanetaryMeshes(sun_mesh, ring_mesh, angles)


def equally_spaced_positions(sun_teeth: int, ring_teeth: int, count: int) -> list[float]:
    """Return the angles in rad of `count` equally spaced planets, starting from 0.

    Raise an `InputError` if they cannot be assembled, i.e. unless `count` divides the sum of the
    tooth numbers of sun and ring.
    """
    allowed = (
        f"such that (z_s + z_r) / N = ({sun_teeth} + {ring_teeth}) / {count} is an integer, "
        "for equal spacing"
    )
    checks.require((sun_teeth + ring_teeth) % count == 0, "planets", count, allowed)
    return [2.0 * math.pi * i / count for i in range(count)]


def _check_ring_teeth(sun, planet, ring, centre_distance) -> None:
    """Raise an `InputError` if the number of ring teeth differs too much from z_s + 2 z_p.

    z_s and z_p are the tooth numbers of sun and planet. A small difference is allowed if a gear has
    a profile shift or the `centre_distance` is given. The check is skipped unless the gears are
    `SpurGear` objects with equal module, pressure angle and helix angle.
    """
    gears = (sun, planet, ring)
    if not all(isinstance(gear, SpurGear) for gear in gears):
        return
    # The formula for the ring teeth holds for gears that can mesh, i.e. with one tooth size.
    tooth_sizes = {(gear.module, gear.pressure_angle, abs(gear.helix_angle)) for gear in gears}
    ideal_ring_teeth = sun.teeth + 2 * planet.teeth
    shifted = centre_distance is not None or any(gear.shift for gear in gears)
    tolerance = _MAX_SHIFTED_TEETH if shifted else 0
    if len(tooth_sizes) == 1 and abs(ring.teeth - ideal_ring_teeth) > tolerance:
        allowed = (
            f"z_s + 2 z_p = {sun.teeth} + 2 * {planet.teeth} = {ideal_ring_teeth}, or so near that "
            "profile shifts make up for the difference"
        )
        raise checks.InputError("ring.teeth", ring.teeth, allowed) from None


def _check_planet_spacing(sun_mesh: GearStage, count: int, angles: Sequence[float]) -> None:
    """Raise an `InputError` if the tip circles of adjacent planets overlap.

    `count` is the number of planets, and `angles` in rad are their positions around the sun.
    """
    sorted_angles = sorted(angle % math.tau for angle in angles)
    adjacent_angles = pairwise([*sorted_angles, sorted_angles[0] + math.tau])
    spacings = [next_angle - angle for angle, next_angle in adjacent_angles]
    # The distance of adjacent planet axes is a chord of their circle around the sun.
    distance = 2.0 * sun_mesh.centre_distance * math.sin(min(*spacings, math.pi) / 2.0)
    tip_diameter = sun_mesh.wheel.tip_diameter
    allowed = (
        f"such that the tip circles of neighbours, {tip_diameter:.6g} m in diameter, keep "
        f"clear of each other; their axes are {distance:.6g} m apart"
    )
    checks.require(count <= 1 or distance > tip_diameter, "planets", count, allowed)

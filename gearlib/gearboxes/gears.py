"""Geometry of a gearbox stage from the attributes of its gears and their loaded flanks."""

import math
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from gearlib import checks
from gearlib.checks import InputError
from gearlib.gearboxes.rexs import Component
from gearlib.models.geometry.gear import RACKS, SpurGear, TipRelief, inv
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.models.geometry.iso import MIN_ROOT_RATIO

if TYPE_CHECKING:
    from gearlib.gearboxes.gearbox import Gearbox

#: Field of a gear geometry -> attribute of a component in REXS.
_ATTRIBUTES = {
    "teeth": "number_of_teeth",
    "module": "normal_module",
    "width": "face_width",
    "shift": "addendum_modification_coefficient",
    "pressure_angle": "normal_pressure_angle",
    "helix_angle": "helix_angle_reference_diameter",
    "tip_diameter": "tip_diameter",
    "addendum": "addendum_coefficient_basic_profile",
    "amount": "tip_relief_depth",
    "length": "tip_relief_datum_length",
    "centre_distance": "center_distance",
}


class Stage(NamedTuple):
    """Two gears in mesh."""

    name: str
    part: Component  #: component of the stage itself
    pinion: Component
    wheel: Component  #: the gear with more teeth, or the ring gear
    carrier: str | None  #: id of the carrier that carries one of the gears, if any

    @property
    def internal(self) -> bool:
        """Whether the wheel is a ring gear."""
        return self.wheel.type == "ring_gear"

    @property
    def signed_teeth(self) -> tuple[int, int]:
        """Numbers of teeth of pinion and wheel, negative for a ring gear."""
        wheel_teeth = teeth(self.wheel)
        return teeth(self.pinion), -wheel_teeth if self.internal else wheel_teeth


def teeth(gear: Component) -> int:
    """Return the number of teeth of a gear, a positive integer.

    Some programs write a negative number for a ring gear.
    """
    number = gear.number("number_of_teeth", "1", "of every gear in a stage")
    checks.require(number == round(number), "number_of_teeth", number, "an integer", str(gear))
    return abs(round(number))


@contextmanager
def _translating_errors(*owners: tuple[str, Component]):
    """Translate errors about a geometry into errors that name component and attribute in REXS.

    `owners` are pairs (prefix, component), such as ("pinion", gear), where the prefix is the start
    of the path that an error names. The prefix "" stands for all errors without another prefix. An
    error that names its component already is not changed.
    """
    try:
        yield
    except InputError as error:
        if error.owner:  # The error names its component already.
            raise
        parts = dict(owners)
        prefix, _, path = error.path.partition(".")
        if prefix not in parts:
            prefix, path = "", error.path
        attribute = _ATTRIBUTES.get(path, path)
        owner = str(parts[prefix])
        raise InputError(attribute, error.value, error.requirement, error.problem, owner) from None


def geometry(box: "Gearbox", stage: Stage, sides: list[str], distance: float) -> GearStage:
    """Return the geometry of a stage with the given loaded flanks.

    `sides` of pinion and wheel are "left" or "right", and `distance` is the centre distance in m.
    Each value that the file does not state is added to the defaults of the gearbox `box`.
    """
    gears = stage.pinion, stage.wheel
    flanks = [_flank(box, gear, side) for gear, side in zip(gears, sides, strict=True)]
    angles = [
        _module_and_angles(box, gear, flank) for gear, flank in zip(gears, flanks, strict=True)
    ]
    shifts = _profile_shifts(box, stage, flanks, angles[0], distance)
    geometries = []
    for gear, flank, values, shift in zip(gears, flanks, angles, shifts, strict=True):
        with _translating_errors(("", gear)):
            geometries.append(_gear(box, gear, flank, values | {"shift": shift}))
    lowest = stage.part.number("minimum_normal_backlash", "m")
    highest = stage.part.number("maximum_normal_backlash", "m")
    stated = [backlash for backlash in (lowest, highest) if backlash is not None]
    backlash = sum(stated) / len(stated) if stated else None
    owners = ("pinion", stage.pinion), ("wheel", stage.wheel), ("", stage.part)
    with _translating_errors(*owners):
        gear_stage = GearStage(geometries[0], geometries[1], distance, backlash)
    if backlash is None and gear_stage.has_recommended_backlash:
        millimetres = 1e3 * gear_stage.backlash
        box.default(f"normal backlash {millimetres:.4g} mm, as recommended", stage.part)
    return gear_stage


def _flank(box: "Gearbox", gear: Component, side: str) -> Component:
    """Return the component of a flank of a gear, or the gear itself if the file has no flanks.

    `side` is "left" or "right". If the file states only the other flank, that one is returned.
    """
    for roles in box.model.related("flank", gear=gear):
        if roles.get(side):
            return roles[side]
        return next((part for role, part in roles.items() if role != "gear"), gear)
    return gear


def _number(components: tuple, field: str, unit: str) -> float | None:
    """Return a number from the first of several components that states it, or None.

    `field` is the name of the number in the geometry, a key of `_ATTRIBUTES`, and `unit` is the
    unit of the result.
    """
    for component in components:
        number = component.number(_ATTRIBUTES[field], unit)
        if number is not None:
            return number
    return None


def _module_and_angles(box: "Gearbox", gear: Component, flank: Component) -> dict[str, Any]:
    """Return the normal module (m), pressure angle and helix angle (rad) of a gear by name.

    An attribute of the `flank` has priority over the same attribute of the `gear`. Missing angles
    are 20 degrees and 0, and the gearbox `box` notes these defaults.
    """
    values = {"module": gear.number("normal_module", "m", "for the geometry of the stage")}
    for field, default, text in (
        ("pressure_angle", math.radians(20.0), "20 degrees"),
        ("helix_angle", 0.0, "0"),
    ):
        values[field] = _number((flank, gear), field, "rad")
        if values[field] is None:
            values[field] = default
            box.default(f"{_ATTRIBUTES[field]} {text}", gear)
    return values


def _profile_shifts(box, stage: Stage, flanks: list, angles: dict, distance: float) -> list:
    """Return the profile shift coefficients of pinion and wheel.

    If the file states only one of them, the other follows from the centre `distance` in m, such
    that there is no backlash. `flanks` are the components of both flanks, and `angles` is the dict
    of module and angles of the pinion.
    """
    name, gears = _ATTRIBUTES["shift"], (stage.pinion, stage.wheel)
    shifts = [_number(pair, "shift", "1") for pair in zip(flanks, gears, strict=True)]
    if None not in shifts:
        return shifts
    if shifts == [None, None]:
        problem = f"is missing: it must be given for this gear or {stage.wheel}"
        raise InputError(name, problem=problem, owner=str(stage.pinion))
    alpha, beta = angles["pressure_angle"], angles["helix_angle"]
    transverse_angle = math.atan(math.tan(alpha) / math.cos(beta))
    teeth_sum = sum(stage.signed_teeth)
    # Centre distance at which the base circles touch.
    base_distance = abs(teeth_sum) * angles["module"] / math.cos(beta)
    base_distance = base_distance * math.cos(transverse_angle) / 2.0
    allowed = f"above {base_distance:.6g} m, where the base circles would have no line of action"
    checks.require(distance > base_distance, "center_distance", distance, allowed, str(stage.part))
    # The sum of the shifts by ISO 21771, with the working angle of the centre distance; the
    # rounding removes errors of stated decimals.
    difference = inv(math.acos(base_distance / distance)) - inv(transverse_angle)
    shift_sum = round(difference * teeth_sum / (2.0 * math.tan(alpha)), 9)
    i = shifts.index(None)
    shifts[i] = shift_sum - shifts[1 - i]
    box.default(f"{name} {shifts[i] + 0.0:.6g}, by the centre distance", gears[i])
    return shifts


def _gear(box: "Gearbox", gear: Component, flank: Component, values: dict) -> SpurGear:
    """Return the geometry of a gear.

    `flank` is the component of its loaded flank. `values` are the fields of the geometry that are
    known already: module, pressure angle, helix angle and profile shift. Default values are added
    to those of the gearbox `box`.
    """
    is_ring = gear.type == "ring_gear"
    addendum = _number((flank, gear), "addendum", "1") or 1.0
    values |= {
        "teeth": teeth(gear),
        "width": gear.number("face_width", "m", "for the contact ratios and the stiffness"),
        "internal": is_ring,
        "material": box.material(gear)[0],
    }
    tip_diameter = gear.number("tip_diameter", "m")
    if tip_diameter is None:
        box.default(f"tip_diameter d + 2 m_n ({addendum:g} + x), not shortened", gear)
    else:
        values["tip_diameter"] = abs(tip_diameter)
    quality = gear.number("tolerance_class_according_to_iso_1328_2013", "1")
    if quality is not None and 1.0 <= quality <= 11.0:
        values["quality"] = round(quality)
    spur_gear = _with_rack(box, gear, values, addendum)
    inner_diameter, outer_diameter = box.shaft_diameters(gear)
    if is_ring:
        # The shaft of a ring gear is a hollow cylinder around its rim.
        rim_diameter = inner_diameter
        if rim_diameter <= spur_gear.root_diameter:
            rim_diameter = spur_gear.root_diameter + 7.0 * spur_gear.module
            box.default("rim 3.5 modules above the root", gear)
        spur_gear = replace(spur_gear, outer_diameter=rim_diameter)
    # A shaft that is nearly as thick as the root leaves no rim, so that both are one piece.
    elif outer_diameter and outer_diameter < spur_gear.root_diameter / MIN_ROOT_RATIO:
        spur_gear = replace(spur_gear, bore=outer_diameter)
    elif outer_diameter:
        box.default("no bore, one piece with the shaft", gear)
    tip_relief = _tip_relief(box, flank, spur_gear)
    return replace(spur_gear, tip_relief=tip_relief) if tip_relief else spur_gear


def _with_rack(box: "Gearbox", gear: Component, values: dict, addendum: float) -> SpurGear:
    """Return a gear with the rack of its tool, or with rack A of ISO 53 if the tool undercuts it.

    A rack is the profile of the straight teeth that generate the gear. `values` are all other
    fields of the geometry, and `addendum` is the addendum of the rack in modules.
    """
    rack = replace(RACKS["A"], addendum=addendum)
    for tool in box.model.linked(gear, "rack_shaped_tool"):
        # The addendum of the tool cuts the dedendum of the gear.
        dedendum = tool.number("addendum_coefficient_reference_profile", "1")
        tip_radius = tool.number("tip_radius_factor", "1")
        try:
            tool_rack = replace(
                rack,
                dedendum=rack.dedendum if dedendum is None else dedendum,
                tip_radius=rack.tip_radius if tip_radius is None else tip_radius,
            )
            return SpurGear(**values, rack=tool_rack)
        except InputError:
            box.default("rack A of ISO 53, since the tool would undercut the teeth", gear)
    return SpurGear(**values, rack=rack)


def _tip_relief(box: "Gearbox", flank: Component, gear: SpurGear) -> TipRelief | None:
    """Return the tip relief of a flank, or None if the file states none.

    The length of the relief is measured along the line of action. If the file states the diameter
    at which the relief starts instead, the length follows from the involute of `gear`, the geometry
    of the gear.
    """
    part = next(iter(box.model.linked(flank, "tip_relief")), None)
    amount = None if part is None else part.number("tip_relief_depth", "m")
    if part is None or not amount:
        return None
    length = part.number("tip_relief_datum_length", "m")
    start_diameter = part.number("tip_relief_datum_diameter", "m")
    if start_diameter is not None:
        base = gear.base_diameter
        lowest, highest = sorted([max(base, gear.root_diameter), float(gear.tip_diameter)])
        valid = lowest <= start_diameter <= highest
        allowed = f"between {lowest:.6g} and {highest:.6g} m, on the flank"
        checks.require(valid, "tip_relief_datum_diameter", start_diameter, allowed, str(part))
        length = abs(gear.tip_roll_length - math.sqrt(start_diameter**2 - base**2) / 2.0)
    elif length is None:
        problem = "is missing: it must be given for the tip relief"
        raise InputError("tip_relief_datum_diameter", problem=problem, owner=str(part))
    shape = part.value("shape_of_relief") or "linear"
    shapes = {"linear": "linear", "parabolic": "parabolic", "circular": "parabolic"}
    allowed = "linear, parabolic or circular"
    checks.require(shape in shapes, "shape_of_relief", shape, allowed, str(part))
    with _translating_errors(("", part)):
        return TipRelief(amount=amount, length=length, shape=shapes[shape])

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

#: Field of the gear geometry -> attribute of a REXS component.
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
        wheel_teeth = tooth_count(self.wheel)
        return tooth_count(self.pinion), -wheel_teeth if self.internal else wheel_teeth


def tooth_count(gear: Component) -> int:
    """Return the number of teeth of a gear as a positive integer.

    Some programs write a negative number for ring gears.
    """
    number = gear.get_number("number_of_teeth", "1", "of every gear in a stage")
    checks.require(number == round(number), "number_of_teeth", number, "an integer", str(gear))
    return abs(round(number))


@contextmanager
def _translate_errors(*owners: tuple[str, Component]):
    """Make each `InputError` of the block name the component and attribute of the REXS file.

    `owners` are pairs (prefix, component), such as ("pinion", gear): the component is chosen by the
    first name of the error's path, or by the prefix "" if no other matches. Errors that already
    have an owner are not changed.
    """
    try:
        yield
    except InputError as error:
        if error.owner:
            raise
        parts = dict(owners)
        prefix, _, path = error.path.partition(".")
        if prefix not in parts:
            prefix, path = "", error.path
        attribute = _ATTRIBUTES.get(path, path)
        owner = str(parts[prefix])
        raise InputError(attribute, error.value, error.requirement, error.problem, owner) from None


def build_gear_stage(
    gearbox: "Gearbox", stage: Stage, sides: list[str], distance: float
) -> GearStage:
    """Build the geometry of a stage for the given loaded flanks.

    `sides` are the loaded flanks of pinion and wheel, "left" or "right"; `distance` is the centre
    distance in m. Values that the file does not state are recorded by `gearbox.default`.
    """
    gears = stage.pinion, stage.wheel
    flanks = [_find_flank(gearbox, gear, side) for gear, side in zip(gears, sides, strict=True)]
    angles = [
        _read_module_and_angles(gearbox, gear, flank)
        for gear, flank in zip(gears, flanks, strict=True)
    ]
    shifts = _read_profile_shifts(gearbox, stage, flanks, angles[0], distance)
    geometries = []
    for gear, flank, values, shift in zip(gears, flanks, angles, shifts, strict=True):
        with _translate_errors(("", gear)):
            geometries.append(_build_gear(gearbox, gear, flank, values | {"shift": shift}))
    min_backlash = stage.part.get_number("minimum_normal_backlash", "m")
    max_backlash = stage.part.get_number("maximum_normal_backlash", "m")
    stated_values = [value for value in (min_backlash, max_backlash) if value is not None]
    backlash = sum(stated_values) / len(stated_values) if stated_values else None
    owners = ("pinion", stage.pinion), ("wheel", stage.wheel), ("", stage.part)
    with _translate_errors(*owners):
        gear_stage = GearStage(geometries[0], geometries[1], distance, backlash)
    if backlash is None and gear_stage.has_recommended_backlash:
        millimetres = 1e3 * gear_stage.backlash
        gearbox.default(f"normal backlash {millimetres:.4g} mm, as recommended", stage.part)
    return gear_stage


def _find_flank(gearbox: "Gearbox", gear: Component, side: str) -> Component:
    """Return the component of a gear's flank; `side` is "left" or "right".

    If the file has only the other flank, return that one; if it has none, return the gear.
    """
    for roles in gearbox.model.find_relations("flank", gear=gear):
        if roles.get(side):
            return roles[side]
        return next((part for role, part in roles.items() if role != "gear"), gear)
    return gear


def _read_first_number(components: tuple, field: str, unit: str) -> float | None:
    """Return a number from the first component that states it, or None.

    `field` is a key of `_ATTRIBUTES`; `unit` is the unit of the result.
    """
    for component in components:
        number = component.get_number(_ATTRIBUTES[field], unit)
        if number is not None:
            return number
    return None


def _read_module_and_angles(
    gearbox: "Gearbox", gear: Component, flank: Component
) -> dict[str, Any]:
    """Return the normal module (m), pressure angle and helix angle (rad) of a gear as a dict.

    Angles stated for the `flank` take precedence. Defaults are 20 degrees and 0;
    `gearbox.default` records them.
    """
    values = {"module": gear.get_number("normal_module", "m", "for the geometry of the stage")}
    for field, default, default_text in (
        ("pressure_angle", math.radians(20.0), "20 degrees"),
        ("helix_angle", 0.0, "0"),
    ):
        values[field] = _read_first_number((flank, gear), field, "rad")
        if values[field] is None:
            values[field] = default
            gearbox.default(f"{_ATTRIBUTES[field]} {default_text}", gear)
    return values


def _read_profile_shifts(
    gearbox, stage: Stage, flanks: list, angles: dict, distance: float
) -> list:
    """Return the profile shift coefficients of pinion and wheel as a list.

    If only one is stated, the other one makes the backlash zero at the centre `distance` in m.
    `flanks` are the components of both flanks, and `angles` is the dict of module and angles of the
    pinion.
    """
    name, gears = _ATTRIBUTES["shift"], (stage.pinion, stage.wheel)
    shifts = [_read_first_number(pair, "shift", "1") for pair in zip(flanks, gears, strict=True)]
    if None not in shifts:
        return shifts
    if shifts == [None, None]:
        problem = f"is missing: it must be given for this gear or {stage.wheel}"
        raise InputError(name, problem=problem, owner=str(stage.pinion))
    alpha, beta = angles["pressure_angle"], angles["helix_angle"]
    transverse_angle = math.atan(math.tan(alpha) / math.cos(beta))
    teeth_sum = sum(stage.signed_teeth)
    # At this centre distance, the working pressure angle is zero.
    base_distance = abs(teeth_sum) * angles["module"] / math.cos(beta)
    base_distance = base_distance * math.cos(transverse_angle) / 2.0
    allowed = f"above {base_distance:.6g} m, where the base circles would have no line of action"
    checks.require(distance > base_distance, "center_distance", distance, allowed, str(stage.part))
    # Sum of the profile shifts by ISO 21771. Rounding it removes the effect of the limited number
    # of decimals in the file.
    involute_difference = inv(math.acos(base_distance / distance)) - inv(transverse_angle)
    shift_sum = round(involute_difference * teeth_sum / (2.0 * math.tan(alpha)), 9)
    i = shifts.index(None)
    shifts[i] = shift_sum - shifts[1 - i]
    gearbox.default(f"{name} {shifts[i] + 0.0:.6g}, by the centre distance", gears[i])
    return shifts


def _build_gear(gearbox: "Gearbox", gear: Component, flank: Component, values: dict) -> SpurGear:
    """Build the geometry of a gear with its tool, rim or bore, and tip relief.

    `flank` is the component of the loaded flank. `values` are fields of the geometry: module,
    pressure angle, helix angle and profile shift. Default values are recorded by `gearbox.default`.
    """
    is_ring = gear.type == "ring_gear"
    addendum = _read_first_number((flank, gear), "addendum", "1") or 1.0
    values |= {
        "teeth": tooth_count(gear),
        "width": gear.get_number("face_width", "m", "for the contact ratios and the stiffness"),
        "internal": is_ring,
        "material": gearbox.material(gear)[0],
    }
    tip_diameter = gear.get_number("tip_diameter", "m")
    if tip_diameter is None:
        gearbox.default(f"tip_diameter d + 2 m_n ({addendum:g} + x), not shortened", gear)
    else:
        values["tip_diameter"] = abs(tip_diameter)
    quality = gear.get_number("tolerance_class_according_to_iso_1328_2013", "1")
    if quality is not None and 1.0 <= quality <= 11.0:
        values["quality"] = round(quality)
    spur_gear = _build_gear_with_rack(gearbox, gear, values, addendum)
    inner_diameter, outer_diameter = gearbox.shaft_diameters(gear)
    if is_ring:
        # The shaft of a ring gear is a hollow cylinder around the rim.
        rim_diameter = inner_diameter
        if rim_diameter <= spur_gear.root_diameter:
            rim_diameter = spur_gear.root_diameter + 7.0 * spur_gear.module
            gearbox.default("rim 3.5 modules above the root", gear)
        spur_gear = replace(spur_gear, outer_diameter=rim_diameter)
    # A gear with a thin rim is treated as one piece with its shaft, i.e. without a bore.
    elif outer_diameter and outer_diameter < spur_gear.root_diameter / MIN_ROOT_RATIO:
        spur_gear = replace(spur_gear, bore=outer_diameter)
    elif outer_diameter:
        gearbox.default("no bore, one piece with the shaft", gear)
    tip_relief = _read_tip_relief(gearbox, flank, spur_gear)
    return replace(spur_gear, tip_relief=tip_relief) if tip_relief else spur_gear


def _build_gear_with_rack(
    gearbox: "Gearbox", gear: Component, values: dict, addendum: float
) -> SpurGear:
    """Build a gear with the basic rack of its tool, or rack A of ISO 53 if the tool undercuts it.

    `values` are all other fields of the geometry; `addendum` is the addendum of the rack in
    modules.
    """
    rack = replace(RACKS["A"], addendum=addendum)
    for tool in gearbox.model.find_linked(gear, "rack_shaped_tool"):
        # The addendum of the tool cuts the dedendum of the gear.
        dedendum = tool.get_number("addendum_coefficient_reference_profile", "1")
        tip_radius = tool.get_number("tip_radius_factor", "1")
        try:
            tool_rack = replace(
                rack,
                dedendum=rack.dedendum if dedendum is None else dedendum,
                tip_radius=rack.tip_radius if tip_radius is None else tip_radius,
            )
            return SpurGear(**values, rack=tool_rack)
        except InputError:
            gearbox.default("rack A of ISO 53, since the tool would undercut the teeth", gear)
    return SpurGear(**values, rack=rack)


def _read_tip_relief(gearbox: "Gearbox", flank: Component, gear: SpurGear) -> TipRelief | None:
    """Return the tip relief of a flank, or None if the file states none.

    Its length is measured along the line of action. If the file states the start diameter of the
    relief instead, the length follows from the involute of `gear`, the geometry of the gear.
    """
    part = next(iter(gearbox.model.find_linked(flank, "tip_relief")), None)
    amount = None if part is None else part.get_number("tip_relief_depth", "m")
    if part is None or not amount:
        return None
    length = part.get_number("tip_relief_datum_length", "m")
    start_diameter = part.get_number("tip_relief_datum_diameter", "m")
    if start_diameter is not None:
        base_diameter = gear.base_diameter
        lower, upper = sorted([max(base_diameter, gear.root_diameter), float(gear.tip_diameter)])
        is_on_flank = lower <= start_diameter <= upper
        allowed = f"between {lower:.6g} and {upper:.6g} m, on the flank"
        checks.require(is_on_flank, "tip_relief_datum_diameter", start_diameter, allowed, str(part))
        roll_length = math.sqrt(start_diameter**2 - base_diameter**2) / 2.0
        length = abs(gear.tip_roll_length - roll_length)
    elif length is None:
        problem = "is missing: it must be given for the tip relief"
        raise InputError("tip_relief_datum_diameter", problem=problem, owner=str(part))
    shape = part.get_value("shape_of_relief") or "linear"
    shapes = {"linear": "linear", "parabolic": "parabolic", "circular": "parabolic"}
    allowed = "linear, parabolic or circular"
    checks.require(shape in shapes, "shape_of_relief", shape, allowed, str(part))
    with _translate_errors(("", part)):
        return TipRelief(amount=amount, length=length, shape=shapes[shape])

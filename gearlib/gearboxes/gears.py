"""Geometry of a stage of a gearbox from the attributes of its gears and their loaded flanks."""

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

#: Field of a gear -> attribute of its component.
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
    part: Component
    pinion: Component
    wheel: Component  #: the one with more teeth, or the ring gear
    carrier: str | None  #: id of the carrier of one of the gears

    @property
    def internal(self) -> bool:
        """Whether the wheel is a ring gear."""
        return self.wheel.type == "ring_gear"

    @property
    def signed_teeth(self) -> tuple[int, int]:
        """Numbers of teeth of pinion and wheel, negative for a ring gear."""
        return teeth(self.pinion), -teeth(self.wheel) if self.internal else teeth(self.wheel)


def teeth(gear: Component) -> int:
    """Return the number of teeth of a gear, which some programs write with a sign."""
    number = gear.number("number_of_teeth", "1", "of every gear in a stage")
    checks.require(number == round(number), "number_of_teeth", number, "an integer", str(gear))
    return abs(round(number))


@contextmanager
def _named(*owners: tuple[str, Component]):
    """Name component and attribute in errors about "pinion", "wheel" or, without them, a stage."""
    try:
        yield
    except InputError as error:
        if error.owner:
            raise
        first, _, rest = error.path.partition(".")
        prefixes = {name: part for name, part in owners}
        part, path = (prefixes[first], rest) if first in prefixes else (prefixes[""], error.path)
        path = _ATTRIBUTES.get(path, path)
        raise InputError(path, error.value, error.requirement, error.problem, str(part)) from None


def geometry(box: "Gearbox", stage: Stage, sides: list[str], distance: float) -> GearStage:
    """Return the geometry of a stage, whose pinion and wheel have a "left" or "right" flank each.

    What the file does not state is added to the defaults of the box.
    """
    gears = stage.pinion, stage.wheel
    flanks = [_flank(box, gear, side) for gear, side in zip(gears, sides, strict=True)]
    angles = [_angles(box, gear, flank) for gear, flank in zip(gears, flanks, strict=True)]
    shifts = _shifts(box, stage, flanks, angles[0], distance)
    made = []
    for gear, flank, angle, shift in zip(gears, flanks, angles, shifts, strict=True):
        with _named(("", gear)):
            made.append(_gear(box, gear, flank, angle | {"shift": shift}))
    limits = [stage.part.number(f"{x}_normal_backlash", "m") for x in ("minimum", "maximum")]
    given = [x for x in limits if x is not None]
    backlash = sum(given) / len(given) if given else None
    owners = ("pinion", stage.pinion), ("wheel", stage.wheel), ("", stage.part)
    with _named(*owners):
        result = GearStage(made[0], made[1], distance, backlash)
    if backlash is None and result.has_recommended_backlash:
        value = 1e3 * result.backlash
        box.default(f"normal backlash {value:.4g} mm, as recommended", stage.part)
    return result


def _flank(box: "Gearbox", gear: Component, side: str) -> Component:
    """Return a flank of a gear, or the gear itself if the file has no flanks."""
    for sides in box.model.related("flank", gear=gear):
        return sides.get(side) or next((x for key, x in sides.items() if key != "gear"), gear)
    return gear


def _number(parts_of_gear: tuple, field: str, unit: str) -> float | None:
    """Return the number of a field from the first component that has it."""
    numbers = (part.number(_ATTRIBUTES[field], unit) for part in parts_of_gear)
    return next((x for x in numbers if x is not None), None)


def _angles(box: "Gearbox", gear: Component, flank: Component) -> dict[str, Any]:
    """Return module, pressure angle and helix angle of a gear."""
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


def _shifts(box, stage: Stage, flanks: list, angles: dict, distance: float) -> list:
    """Return the profile shifts of pinion and wheel; one may follow from the centre distance."""
    name, gears = _ATTRIBUTES["shift"], (stage.pinion, stage.wheel)
    shifts = [_number(pair, "shift", "1") for pair in zip(flanks, gears, strict=True)]
    if None not in shifts:
        return shifts
    if shifts == [None, None]:
        problem = f"is missing: it must be given for this gear or {stage.wheel}"
        raise InputError(name, problem=problem, owner=str(stage.pinion))
    alpha, beta = angles["pressure_angle"], angles["helix_angle"]
    transverse, count = math.atan(math.tan(alpha) / math.cos(beta)), sum(stage.signed_teeth)
    base = abs(count) * angles["module"] / math.cos(beta) * math.cos(transverse) / 2.0
    allowed = f"above {base:.6g} m, where the base circles would have no line of action"
    checks.require(distance > base, "center_distance", distance, allowed, str(stage.part))
    involute = inv(math.acos(base / distance)) - inv(transverse)
    total = round(involute * count / (2.0 * math.tan(alpha)), 9)
    i = shifts.index(None)
    shifts[i] = total - shifts[1 - i]
    box.default(f"{name} {shifts[i] + 0.0:.6g}, by the centre distance", gears[i])
    return shifts


def _gear(box: "Gearbox", gear: Component, flank: Component, values: dict) -> SpurGear:
    """Return the geometry of a gear with the values that are known already."""
    internal = gear.type == "ring_gear"
    addendum = _number((flank, gear), "addendum", "1")
    values |= {
        "teeth": teeth(gear),
        "width": gear.number("face_width", "m", "for the contact ratios and the stiffness"),
        "internal": internal,
        "material": box.material(gear)[0],
    }
    tip = gear.number("tip_diameter", "m")
    if tip is None:
        box.default(f"tip_diameter d + 2 m_n ({addendum or 1.0:g} + x), not shortened", gear)
    else:
        values["tip_diameter"] = abs(tip)
    quality = gear.number("tolerance_class_according_to_iso_1328_2013", "1")
    if quality is not None and 1.0 <= quality <= 11.0:
        values["quality"] = round(quality)
    made = _with_rack(box, gear, values, addendum or 1.0)
    inside, outside = box.shaft_diameters(gear)
    if internal:
        if inside <= made.root_diameter:
            inside = made.root_diameter + 7.0 * made.module
            box.default("rim 3.5 modules above the root", gear)
        made = replace(made, outer_diameter=inside)
    elif outside and outside < made.root_diameter / MIN_ROOT_RATIO:
        made = replace(made, bore=outside)
    elif outside:
        box.default("no bore, one piece with the shaft", gear)
    relief = _relief(box, flank, made)
    return replace(made, tip_relief=relief) if relief else made


def _with_rack(box: "Gearbox", gear: Component, values: dict, addendum: float) -> SpurGear:
    """Return a gear with the rack of its tool, or with rack A of ISO 53 if that undercuts it."""
    rack = replace(RACKS["A"], addendum=addendum)
    for tool in box.model.linked(gear, "rack_shaped_tool"):
        # The addendum of the tool cuts the dedendum of the gear.
        dedendum = tool.number("addendum_coefficient_reference_profile", "1")
        radius = tool.number("tip_radius_factor", "1")
        try:
            made = replace(
                rack,
                dedendum=rack.dedendum if dedendum is None else dedendum,
                tip_radius=rack.tip_radius if radius is None else radius,
            )
            return SpurGear(**values, rack=made)
        except InputError:
            box.default("rack A of ISO 53, since the tool would undercut the teeth", gear)
    return SpurGear(**values, rack=rack)


def _relief(box: "Gearbox", flank: Component, gear: SpurGear) -> TipRelief | None:
    """Return the tip relief of a flank, or None."""
    part = next(iter(box.model.linked(flank, "tip_relief")), None)
    if part is None or not (amount := part.number("tip_relief_depth", "m")):
        return None
    length, start = (part.number(f"tip_relief_datum_{x}", "m") for x in ("length", "diameter"))
    if start is not None:
        base = gear.base_diameter
        lowest, highest = sorted([max(base, gear.root_diameter), float(gear.tip_diameter)])
        allowed = f"between {lowest:.6g} and {highest:.6g} m, on the flank"
        checks.require(
            lowest <= start <= highest, "tip_relief_datum_diameter", start, allowed, str(part)
        )
        length = abs(gear.tip_roll_length - math.sqrt(start**2 - base**2) / 2.0)
    elif length is None:
        problem = "is missing: it must be given for the tip relief"
        raise InputError("tip_relief_datum_diameter", problem=problem, owner=str(part))
    shape = part.value("shape_of_relief") or "linear"
    shapes = {"linear": "linear", "parabolic": "parabolic", "circular": "parabolic"}
    allowed = "linear, parabolic or circular"
    checks.require(shape in shapes, "shape_of_relief", shape, allowed, str(part))
    with _named(("", part)):
        return TipRelief(amount=amount, length=length, shape=shapes[shape])

"""Tabulate tolerances by quality classes: tooth thickness, centre distance, profile form.

Sources: DIN 3967 (1978), allowances E_sns and tolerances T_sn of the tooth thickness, tables 1 and
2; DIN 3964 (1980), centre distance js 5 to js 11, half of the IT grades of ISO 286-1; ISO
1328-1:2013 for the form of the profile, by `SpurGear.form_deviation`. Tolerances of other tables
are passed to `gearlib.scatter` as limits.
"""

import re
from typing import Annotated, Any

from annotated_types import Ge, Gt, Le

from gearlib import checks, parameters
from gearlib.parameters import Unit, checked

_MICROMETRE = 1e-6
#: Largest reference diameter of each row of the tables, m.
_MAX_DIAMETERS = (0.01, 0.05, 0.125, 0.28, 0.56, 1.0, 1.6, 2.5)
_ALLOWANCE_SERIES = ("a", "ab", "b", "bc", "c", "cd", "d", "e", "f", "g", "h")
#: -E_sns in um, DIN 3967, table 1.
_ALLOWANCES = (
    (100, 85, 70, 58, 48, 40, 33, 22, 10, 5, 0),
    (135, 110, 95, 75, 65, 54, 44, 30, 14, 7, 0),
    (180, 150, 125, 105, 85, 70, 60, 40, 19, 9, 0),
    (250, 200, 170, 140, 115, 95, 80, 56, 26, 12, 0),
    (330, 280, 230, 190, 155, 130, 110, 75, 35, 17, 0),
    (450, 370, 310, 260, 210, 175, 145, 100, 48, 22, 0),
    (600, 500, 420, 340, 290, 240, 200, 135, 64, 30, 0),
    (820, 680, 560, 460, 390, 320, 270, 180, 85, 41, 0),
)
#: T_sn in um, DIN 3967, table 2: the tolerances of each row are a section of one of two series.
_SERIES_1 = (3, 5, 8, 12, 20, 30, 50, 80, 130, 200, 300, 500, 800, 1300)
_SERIES_2 = (6, 10, 16, 25, 40, 60, 100, 160, 250, 400, 600, 1000)
#: For each row of diameters, the series of tolerances and the index of tolerance 21 in it.
_TOLERANCE_SERIES = (_SERIES_1, *(_SERIES_1, _SERIES_2) * 3, _SERIES_1)
_FIRST_TOLERANCE_INDICES = (0, 1, 0, 2, 1, 3, 2, 4)
#: First and last number of the tolerances in DIN 3967.
_FIRST_NUMBER, _LAST_NUMBER = 21, 30
#: Largest centre distance of a row in m -> IT 5 to IT 11 in um, ISO 286-1.
_IT_GRADES = {
    0.018: (8, 11, 18, 27, 43, 70, 110),
    0.03: (9, 13, 21, 33, 52, 84, 130),
    0.05: (11, 16, 25, 39, 62, 100, 160),
    0.08: (13, 19, 30, 46, 74, 120, 190),
    0.12: (15, 22, 35, 54, 87, 140, 220),
    0.18: (18, 25, 40, 63, 100, 160, 250),
    0.25: (20, 29, 46, 72, 115, 185, 290),
    0.315: (23, 32, 52, 81, 130, 210, 320),
    0.4: (25, 36, 57, 89, 140, 230, 360),
    0.5: (27, 40, 63, 97, 155, 250, 400),
}
_FIRST_GRADE = 5
_Distance = Annotated[float, Ge(0.01), Le(0.5), Unit("m")]
ReferenceDiameter = Annotated[float, Gt(0), Le(_MAX_DIAMETERS[-1]), Unit("m")]
_DESIGNATION_PATTERN = re.compile(r"(\d\d)\s*(ab|bc|cd|[a-h])|(ab|bc|cd|[a-h])\s*(\d\d)")


@checked
def thickness_limits(diameter: ReferenceDiameter, designation: Any) -> tuple[float, float]:
    """Return the lower and upper allowance of the normal tooth thickness according to DIN 3967, m.

    `diameter` is the reference diameter in m, up to 2.5. A designation such as "27cd" consists of
    the number of the tolerance, 21 to 30, and the letters of the series of allowances, a to h.
    """
    text = designation.strip() if isinstance(designation, str) else ""
    match = _DESIGNATION_PATTERN.fullmatch(text)
    number, letters = 0, ""
    if match:  # the number may precede the letters or follow them
        number = int(match[1] or match[4])
        letters = match[2] or match[3]
    allowed = (
        f"a number from {_FIRST_NUMBER} to {_LAST_NUMBER} and a series from a to h of DIN 3967, "
        "such as '27cd'"
    )
    checks.require(_FIRST_NUMBER <= number <= _LAST_NUMBER, "thickness", designation, allowed)
    row = next(i for i, max_diameter in enumerate(_MAX_DIAMETERS) if diameter <= max_diameter)
    # The tables are in micrometres; the upper allowance is negative, and the tolerance extends
    # below it.
    upper = -_ALLOWANCES[row][_ALLOWANCE_SERIES.index(letters)]
    tolerance = _TOLERANCE_SERIES[row][_FIRST_TOLERANCE_INDICES[row] + number - _FIRST_NUMBER]
    return _MICROMETRE * (upper - tolerance), _MICROMETRE * upper


def distance_limits(distance: float, designation: Any) -> tuple[float, float]:
    """Return the lower and upper deviation of a centre distance according to DIN 3964, m.

    `distance` is from 0.01 to 0.5 m; the designation is a class from "js5" to "js11", whose limits
    are symmetric. Raise ValueError if one of them is invalid.
    """
    distance = parameters.check("centre_distance", distance, _Distance)
    designations = [f"js{_FIRST_GRADE + i}" for i in range(len(_IT_GRADES[0.5]))]
    checks.check_choice("centre_distance", designation, designations)
    max_distance = next(limit for limit in _IT_GRADES if distance <= limit)
    tolerance = _IT_GRADES[max_distance][designations.index(designation)]
    half_width = _MICROMETRE * tolerance / 2.0
    return -half_width, half_width


def by_class(
    mesh: Any, *, thickness: Any = None, centre_distance: str | None = None, form: bool = False
) -> dict:
    """Return the tolerances of a gear stage by quality classes, for a `StageDesign` in `scatter`.

    `mesh` is a `gearlib.geometry.GearStage`. `thickness` is a class of DIN 3967 such as "27cd", or
    a pair of classes for pinion and wheel; the backlash follows if the `StageDesign` has
    ``keep_backlash=False``. `centre_distance` is a class of DIN 3964 such as "js7". With `form`,
    profiles vary within the tolerance of profile form for the `quality` of the gears. The standard
    does not prescribe the shape of the deviation; here it is a first mesh harmonic whose cosine and
    sine coefficients are at most half of the larger tolerance.
    """
    mesh = checks.check_gear_stage(mesh)
    tolerances: dict = {}
    if thickness is not None:
        designations = (thickness,) * 2 if isinstance(thickness, str) else thickness
        designations = checks.check_sequence("thickness", designations, 2)
        for gear, designation in zip(("pinion", "wheel"), designations, strict=True):
            lower, upper = thickness_limits(getattr(mesh, gear).reference_diameter, designation)
            tolerances[f"{gear}.thickness_allowance"] = {"min": lower, "max": upper}
    if centre_distance is not None:
        lower, upper = distance_limits(mesh.centre_distance, centre_distance)
        limits = {"nominal": mesh.centre_distance, "upper": upper, "lower": lower}
        tolerances["centre_distance"] = limits
    if form:
        max_deviation = max(gear.form_deviation for gear in (mesh.pinion, mesh.wheel)) / 2.0
        for name in ("deviation_cosine", "deviation_sine"):
            tolerances[name] = {"min": -max_deviation, "max": max_deviation}
    return tolerances

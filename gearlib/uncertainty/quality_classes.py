"""Tolerances by the classes that a drawing names: thickness, centre distance, form of the flanks.

Sources: DIN 3967 (1978), allowances E_sns and tolerances T_sn of the tooth thickness, tables 1 and
2; DIN 3964 (1980), centre distance js 5 to js 11, half of the degrees IT of ISO 286-1; ISO
1328-1:2013 for the form of the profile, by `SpurGear.form_deviation`. Numbers of no table here are
given as limits, see `gearlib.scatter`.
"""

import re
from typing import Any

from gearlib import checks

_UM = 1e-6
#: Reference diameters up to which a row goes, m.
_DIAMETERS = (0.01, 0.05, 0.125, 0.28, 0.56, 1.0, 1.6, 2.5)
_SERIES = ("a", "ab", "b", "bc", "c", "cd", "d", "e", "f", "g", "h")
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
#: T_sn in um of the rows 21 to 30, DIN 3967, table 2: each row two steps on in one series.
_STEPS = (3, 5, 8, 12, 20, 30, 50, 80, 130, 200, 300, 500, 800, 1300)
_FINER = (6, 10, 16, 25, 40, 60, 100, 160, 250, 400, 600, 1000)
#: Series and first number of each row of diameters.
_ROWS = (*zip((_STEPS, *(_STEPS, _FINER) * 3, _STEPS), (0, 1, 0, 2, 1, 3, 2, 4), strict=True),)
_FIRST, _LAST = 21, 30
#: Distances up to which a row goes, m, and IT 5 to IT 11 in um, ISO 286-1.
_DISTANCES = {
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
_LEAST_DISTANCE, _FIRST_DEGREE = 0.01, 5
_THICKNESS = re.compile(r"(\d\d)\s*(ab|bc|cd|[a-h])|(ab|bc|cd|[a-h])\s*(\d\d)")


def thickness_limits(diameter: float, designation: Any) -> tuple[float, float]:
    """Return least and largest allowance of the normal tooth thickness, m, by DIN 3967.

    `diameter` is that of the reference circle, m, up to 2.5; a designation is such as "27cd".
    """
    largest = _DIAMETERS[-1]
    allowed = f"> 0 and <= {largest} m"
    diameter = checks.number("diameter", diameter, allowed, lambda d: 0 < d <= largest)
    match = _THICKNESS.fullmatch(designation.strip()) if isinstance(designation, str) else None
    number, series = (match[1] or match[4], match[2] or match[3]) if match else (0, "")
    number = int(number)
    words = (
        f"a number from {_FIRST} to {_LAST} and a series from a to h of DIN 3967, such as '27cd'"
    )
    checks.require(_FIRST <= number <= _LAST, "thickness", designation, words)
    row = next(i for i, end in enumerate(_DIAMETERS) if diameter <= end)
    upper = -_ALLOWANCES[row][_SERIES.index(series)]
    steps, begin = _ROWS[row]
    return _UM * (upper - steps[begin + number - _FIRST]), _UM * upper


def distance_limits(distance: float, designation: Any) -> tuple[float, float]:
    """Return lower and upper deviation of a centre distance of 0.01 to 0.5 m by DIN 3964, m."""
    ends = tuple(_DISTANCES)
    low, high = _LEAST_DISTANCE, ends[-1]
    words = f"from {low} to {high} m"
    distance = checks.number("centre_distance", distance, words, lambda a: low <= a <= high)
    degrees = [f"js{_FIRST_DEGREE + i}" for i in range(len(_DISTANCES[ends[0]]))]
    checks.one_of("centre_distance", designation, degrees)
    row = _DISTANCES[next(end for end in ends if distance <= end)]
    half = _UM * row[degrees.index(designation)] / 2.0
    return -half, half


def by_class(
    mesh: Any, *, thickness: Any = None, centre_distance: str | None = None, form: bool = False
) -> dict:
    """Return tolerances by the classes of a drawing, for `gearlib.scatter` and a `DrawnPair`.

    `thickness` is by DIN 3967, "27cd", of both gears or a pair of pinion and wheel; the backlash
    follows from it where the `DrawnPair` has ``backlash=None``. `centre_distance` is by DIN 3964,
    "js7". With `form` the profile deviates by the `quality` of the gears. That tolerance limits the
    height of a wave and says nothing of its shape: here the first mesh harmonic of the flanks takes
    all of it, cosine and sine within half of the larger tolerance.
    """
    mesh = checks.drawn_mesh(mesh)
    tolerances: dict = {}
    if thickness is not None:
        pair = (thickness,) * 2 if isinstance(thickness, str) else thickness
        pair = checks.many("thickness", pair, 2)
        for part, designation in zip(("pinion", "wheel"), pair, strict=True):
            low, high = thickness_limits(getattr(mesh, part).reference_diameter, designation)
            tolerances[f"{part}.thickness_allowance"] = {"min": low, "max": high}
    if centre_distance is not None:
        lower, upper = distance_limits(mesh.centre_distance, centre_distance)
        limits = {"nominal": mesh.centre_distance, "upper": upper, "lower": lower}
        tolerances["centre_distance"] = limits
    if form:
        half = max(gear.form_deviation for gear in (mesh.pinion, mesh.wheel)) / 2.0
        for name in ("deviation_cosine", "deviation_sine"):
            tolerances[name] = {"min": -half, "max": half}
    return tolerances

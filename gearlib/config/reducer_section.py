"""Sections of the paper's reducer and of its Campbell diagram."""

from pydantic import model_validator

from gearlib.config.types import (
    Backlash,
    DampingName,
    OwnStart,
    OwnStep,
    OwnStop,
    Periods,
    Recorded,
    RecordPeriods,
    Section,
    Share,
    Started,
    Stiffness,
    entry,
    numbers,
    quantity,
    type_of,
    whole,
)
from gearlib.parameters import MODULE

Teeth = whole(3, 1000)
#: A pin may lie off its place in both directions.
Offset = quantity("m", "10 um")
#: Pitch radii that differ by more are no rounding.
_ONE_CENTRE = 1e-9


class Reducer(Started, Recorded):
    """Fig. 1 a: three double satellites between central gears, the gear pair as every mesh."""

    start: OwnStart = 0.74
    stop: OwnStop = 1.84
    step: OwnStep = 0.02
    damping: DampingName
    teeth: numbers(Teeth, 4, "Of input, satellites a, satellites b, output.") = [24, 36, 24, 36]
    modules: numbers(
        type_of(MODULE), 2, "Of both stages, m; the centre distances must be equal."
    ) = [
        0.004,
        0.004,
    ]
    shaft_stiffness: quantity("N m/rad", "1e6 N m/rad", gt=0) = entry(
        "Of a satellite's shaft against torsion, N m/rad.", 1e6
    )
    support_stiffness: Stiffness = entry("Of all axes, N/m. Default: 2.5 max_stiffness.")
    damping_ratio: Share = entry(
        "Of supports and shafts, at the mean eigenfrequency of the pair.", 0.03
    )
    pin_error: numbers(
        Offset,
        2,
        "Displacement of the first satellite's axis in one case, radial and tangential, m. "
        "Default: a static deflection outwards.",
    )
    backlashes: numbers(
        Backlash,
        3,
        "Of the branches in one case, m. Default: a quarter of backlash in the first.",
    )
    periods: Periods = 210
    record_periods: RecordPeriods = 42

    @model_validator(mode="after")
    def _check(self):
        first, second = (
            module * (self.teeth[2 * i] + self.teeth[2 * i + 1]) / 2.0
            for i, module in enumerate(self.modules)
        )
        if abs(first - second) > _ONE_CENTRE * first:
            raise ValueError(
                f"reducer.teeth = {self.teeth!r} is not allowed: with reducer.modules = "
                f"{self.modules!r} both stages must have one centre distance, and it is "
                f"{first:.6g} m in the first, {second:.6g} m in the second"
            )
        return self


class Campbell(Section):
    """Campbell diagram of the reducer whose branches are alike."""

    orders: whole(1, 20) = entry("Highest order of each mesh frequency.", 3)

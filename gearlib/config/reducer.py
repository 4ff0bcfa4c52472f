"""Sections of gear trains: the paper's reducer, and what stands for it."""

from typing import ClassVar

from pydantic import Field, model_validator

from gearlib.config.types import (
    Backlash,
    DampingName,
    Length,
    OwnStart,
    OwnStep,
    OwnStop,
    Section,
    Started,
    Stiffness,
    check_record,
    integer_within,
    number_within,
    numbers,
    quantity,
)

Teeth = integer_within(ge=3, le=1000)
#: A pin may lie off its place in both directions.
Offset = quantity("m", "10 um")
#: Pitch radii that differ by more are no rounding.
_ONE_CENTRE = 1e-9


class Reducer(Started):
    """Fig. 1 a: three double satellites between central gears, the gear pair as every mesh."""

    key: ClassVar = "reducer"

    start: OwnStart = 0.74
    stop: OwnStop = 1.84
    step: OwnStep = 0.02
    damping: DampingName
    teeth: numbers(Teeth, 4, "Of input, satellites a, satellites b, output.") = [24, 36, 24, 36]
    modules: numbers(Length, 2, "Of both stages, m; the centre distances must be equal.") = [
        0.004,
        0.004,
    ]
    shaft_stiffness: quantity("N m/rad", "1e6 N m/rad", gt=0) = Field(
        default=1e6, description="Of a satellite's shaft against torsion, N m/rad."
    )
    support_stiffness: Stiffness = Field(
        description="Of all axes, N/m. Default: 2.5 max_stiffness."
    )
    damping_ratio: number_within(ge=0, le=1) = Field(
        default=0.03,
        description="Of supports and shafts, at the mean eigenfrequency of the pair.",
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
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=210, description="Mesh periods of a run, rounded up to whole repeats."
    )
    record_periods: integer_within(ge=1) = Field(
        default=42, description="The last ones, which are evaluated; at most `periods`."
    )

    @model_validator(mode="after")
    def _check(self):
        check_centres("reducer.teeth", self.teeth, self.modules)
        check_record("reducer", self)
        return self


class OneMesh(Started):
    """Models of the reducer, from one pair to the whole train, in cases that tell them apart."""

    key: ClassVar = "one_mesh"

    start: OwnStart = 0.75
    stop: OwnStop = 1.8
    step: OwnStep = 0.025
    starts: integer_within(ge=1, le=1000) = Field(
        default=8, description="Seeded starts of every motion."
    )
    other_teeth: numbers(
        Teeth, 4, "Of input, satellites a, satellites b, output: branches out of phase."
    ) = [25, 35, 25, 35]
    soft_support: Stiffness = Field(
        description="Of all axes where they are soft, N/m. Default: a quarter of max_stiffness."
    )
    tolerance: number_within(gt=0, le=10) = Field(
        default=0.1, description="Largest change of an answer that counts as none."
    )


class Campbell(Section):
    """Campbell diagram of the reducer whose branches are alike."""

    orders: integer_within(ge=1, le=20) = Field(
        default=3, description="Highest order of each mesh frequency."
    )


def check_centres(key, teeth, modules):
    """Refuse gears whose two stages have different centre distances."""
    first, second = (modules[i] * (teeth[2 * i] + teeth[2 * i + 1]) / 2.0 for i in (0, 1))
    if abs(first - second) > _ONE_CENTRE * first:
        raise ValueError(
            f"{key} = {teeth!r} is not allowed: with reducer.modules = {modules!r} both stages "
            f"must have one centre distance, and it is {first:.6g} m in the first, {second:.6g} m "
            "in the second"
        )

"""Sections of tip relief: Harris maps of drawn gears, and the motion by two models."""

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from gearlib.config.gears import FZG_C, DrawnPair
from gearlib.config.types import (
    Grid,
    NonNegative,
    OwnStart,
    OwnStep,
    OwnStop,
    Positive,
    Section,
    check_record,
    integer_within,
    listing,
    number_within,
)

_DampingRatio = number_within(ge=0, le=1)


class HarrisMap(Section):
    """The static transmission error of spur gears at several loads, with reliefs that are found."""

    gears: DrawnPair = Field(
        default=DrawnPair(**FZG_C | {"backlash": 160e-6}),
        description="The pair at its design load, without tip relief; by default FZG type C.",
    )
    stiffness: Literal["energy", "iso"] = Field(
        default="energy", description="How the stiffness of a pair of teeth is found."
    )
    loads: listing(NonNegative, "Over the design load.") = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    phases: integer_within(ge=8, le=10_000) = Field(
        default=256, description="Phases of a mesh period."
    )

    @model_validator(mode="after")
    def _check(self):
        for name in ("pinion", "wheel"):
            gear = getattr(self.gears, name)
            for key in ("helix_angle", "tip_relief"):
                if getattr(gear, key):
                    raise ValueError(
                        f"harris_map.gears.{name}.{key} is not allowed: it must be left out, the "
                        "map is that of spur gears, which get their reliefs by it"
                    )
        self.gears.check("harris_map.gears", self.stiffness)
        return self


class ReliefDynamics(Grid):
    """These gears in motion, with the long relief: stiffness at the load beside pairs of teeth."""

    key: ClassVar = "relief_dynamics"

    start: OwnStart = 0.2
    stop: OwnStop = 2.0
    step: OwnStep = 0.04
    loads: listing(Positive, "Over the design load.") = [0.25, 0.5, 1.0, 1.5]
    damping_ratio: _DampingRatio = Field(default=0.06, description="In contact, at the mean.")
    backlash_damping_ratio: _DampingRatio = Field(default=0.0, description="In the backlash.")
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=120, description="Mesh periods of a run."
    )
    record_periods: integer_within(ge=1) = Field(
        default=20, description="The last ones, which are evaluated; at most `periods`."
    )
    tolerance: number_within(gt=0, le=10) = Field(
        default=0.05, description="Largest relative difference of the dynamic force that is none."
    )

    @model_validator(mode="after")
    def _check(self):
        check_record("relief_dynamics", self)
        return self

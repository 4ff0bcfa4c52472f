"""Sections of tip relief: Harris maps of drawn gears, and the motion by two models."""

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from gearlib.config.types import (
    Finite,
    Grid,
    Length,
    NonNegative,
    Positive,
    RunOut,
    Section,
    Start,
    Step,
    Stop,
    integer_within,
    listing,
    number_within,
    numbers,
    quantity,
)

_Teeth = integer_within(ge=3, le=1000)
_Torque = quantity("N m", "302 N m", gt=0)
_DampingRatio = number_within(ge=0, le=1)


class HarrisMap(Section):
    """Spur gears by their drawing, pinion and wheel: FZG type C; the error at several loads."""

    teeth: numbers(_Teeth, 2, "Numbers of teeth.") = [16, 24]
    module: Length = Field(default=4.5e-3, description="m.")
    width: Length = Field(default=14e-3, description="Face width, m.")
    shifts: numbers(Finite, 2, "Profile shift coefficients.") = [0.1817, 0.1715]
    tip_diameters: numbers(Length, 2, "m.") = [82.46e-3, 118.36e-3]
    bores: numbers(RunOut, 2, "Diameters, m; 0: none.") = [30e-3, 30e-3]
    centre_distance: Length = Field(default=91.5e-3, description="m.")
    backlash: RunOut = Field(default=160e-6, description="Normal backlash, m.")
    torque: _Torque = Field(default=302.0, description="Design load of the pinion, N m.")
    stiffness: Literal["energy", "iso"] = Field(
        default="energy", description="How the stiffness of a pair of teeth is found."
    )
    loads: listing(NonNegative, "Over the design load.") = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    phases: integer_within(ge=8, le=10_000) = Field(
        default=256, description="Phases of a mesh period."
    )

    def gears(self):
        """Return what `gearlib.studies.tip_relief.drawn` takes."""
        return self.model_dump(exclude={"torque", "stiffness", "loads", "phases"})


class ReliefDynamics(Grid):
    """These gears in motion, with the long relief: stiffness at the load beside pairs of teeth."""

    key: ClassVar = "relief_dynamics"

    start: Start = 0.2
    stop: Stop = 2.0
    step: Step = 0.04
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
        if self.record_periods > self.periods:
            raise ValueError(
                f"relief_dynamics.record_periods = {self.record_periods} is not allowed: it must "
                f"be an integer from 1 to relief_dynamics.periods = {self.periods}"
            )
        return self

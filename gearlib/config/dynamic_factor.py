"""Section of the dynamic factor: two drawn gears, their load, and the speeds."""

from typing import ClassVar

from pydantic import Field, model_validator

from gearlib.config.types import (
    Grid,
    Length,
    OwnStart,
    OwnStep,
    OwnStop,
    RunOut,
    Section,
    check_record,
    integer_within,
    number_within,
    quantity,
)


class DrawnGear(Section):
    """What is its own of a drawn gear."""

    teeth: integer_within(ge=3, le=10_000) = Field(description="Teeth.")
    shift: number_within(ge=-3, le=3) = Field(description="Profile shift coefficient x.")
    tip_diameter: Length = Field(description="d_a, m.")


class DynamicFactor(Grid):
    """Dynamic factor over speed: exact sweeps beside ISO 6336-1. The gears are FZG type C.

    Tunings are those of the standard, N: speed over resonance speed.
    """

    key: ClassVar = "dynamic_factor"

    start: OwnStart = 0.1
    stop: OwnStop = 2.0
    step: OwnStep = 0.01
    pinion: DrawnGear = DrawnGear(teeth=16, shift=0.1817, tip_diameter=82.46e-3)
    wheel: DrawnGear = DrawnGear(teeth=24, shift=0.1715, tip_diameter=118.36e-3)
    module: Length = Field(default=4.5e-3, description="Normal module m_n, m.")
    width: Length = Field(default=14e-3, description="Face width b, m.")
    bore: RunOut = Field(default=30e-3, description="Of both gears, m.")
    centre_distance: Length = Field(default=91.5e-3, description="a, m.")
    backlash: RunOut = Field(default=160.5e-6, description="Normal backlash j_bn, m.")
    quality: integer_within(ge=1, le=11) = Field(
        default=5, description="Flank tolerance class of both gears, ISO 1328-1:2013."
    )
    torque: quantity("N m", "302 N m", gt=0) = Field(
        default=302.0, description="Of the pinion, N m."
    )
    damping_ratio: number_within(ge=0, le=1) = Field(
        default=0.06, description="Damping in contact, beta."
    )
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=300, description="Mesh periods at each speed."
    )
    record_periods: integer_within(ge=1) = Field(
        default=12, description="The last ones, which are evaluated; at most `periods`."
    )

    @model_validator(mode="after")
    def _check(self):
        check_record("dynamic_factor", self)
        return self

    @property
    def drawing(self):
        """The drawing, as of `gearlib.studies.dynamic_factor.mesh_of`."""
        names = ("pinion", "wheel", "module", "width", "bore", "centre_distance", "backlash")
        return self.model_dump(include={*names, "quality"})

    @property
    def run(self):
        """Load, damping and length of the runs."""
        return self.model_dump(include={"torque", "damping_ratio", "periods", "record_periods"})

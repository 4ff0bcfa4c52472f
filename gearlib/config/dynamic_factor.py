"""Section of the dynamic factor: a drawn pair, its accuracy, and the speeds."""

from typing import ClassVar

from pydantic import Field, model_validator

from gearlib.config.gears import FZG_C, DrawnPair
from gearlib.config.types import (
    Grid,
    OwnStart,
    OwnStep,
    OwnStop,
    check_record,
    integer_within,
    number_within,
)


class DynamicFactor(Grid):
    """Dynamic factor over speed: exact sweeps beside ISO 6336-1.

    Tunings are those of the standard, N: speed over resonance speed.
    """

    key: ClassVar = "dynamic_factor"

    start: OwnStart = 0.1
    stop: OwnStop = 2.0
    step: OwnStep = 0.01
    pair: DrawnPair = Field(
        default=DrawnPair(**FZG_C | {"backlash": 160.5e-6}),
        description="The pair, both gears with their quality; by default FZG type C.",
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
        for name in ("pinion", "wheel"):
            if getattr(self.pair, name).quality is None:
                raise ValueError(
                    f"dynamic_factor.pair.{name}.quality is missing: it must be an integer from 1 "
                    "to 11"
                )
        self.pair.check("dynamic_factor.pair", "iso", "energy")
        return self

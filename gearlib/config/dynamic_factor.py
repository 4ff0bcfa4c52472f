"""Section of the dynamic factor: a drawn pair, its accuracy, and the speeds."""

from typing import ClassVar

from pydantic import Field, model_validator

from gearlib.config.stiffness import PAIRS, DrawnPair
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
        default=DrawnPair(**PAIRS["FZG-C"] | {"backlash": 160.5e-6}),
        description="The pair; by default FZG type C.",
    )
    quality: integer_within(ge=1, le=11) = Field(
        default=5, description="Flank tolerance class of both gears, ISO 1328-1:2013."
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

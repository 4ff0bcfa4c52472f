"""Sections of the mesh stiffness of drawn pairs: every method, and what its rectangle costs."""

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from gearlib.config.types import (
    Finite,
    Given,
    Grid,
    Length,
    Name,
    OwnStart,
    OwnStep,
    OwnStop,
    Positive,
    Section,
    Stiffness,
    check_record,
    integer_within,
    number_within,
    numbers,
    quantity,
)

Play = quantity("m", "50 um", ge=0)


class DrawnPair(Given):
    """Two external spur gears by their drawing; 20 degrees, basic rack A of ISO 53."""

    teeth: numbers(integer_within(ge=3, le=1000), 2, "Of pinion and wheel.")
    module: Length = Field(description="m.")
    width: Length = Field(description="Face width, m.")
    shifts: numbers(Finite, 2, "Profile shift coefficients.") = [0.0, 0.0]
    tip_diameters: numbers(Length, 2, "m. Default: full addenda.") = None
    bores: numbers(quantity("m", "30 mm", ge=0), 2, "Diameters, m; 0: none.") = [0.0, 0.0]
    centre_distance: Length = Field(default=None, description="m. Default: without backlash.")
    backlash: Play = Field(default=0.0, description="Normal backlash, m.")
    young: quantity("Pa", "206 GPa", gt=0) = Field(
        default=206e9, description="Modulus of elasticity, Pa."
    )
    torque: quantity("N m", "500 N m", gt=0) = Field(description="Of the pinion, N m.")
    published: dict[Name, Stiffness] = Field(
        default={}, description="Mean mesh stiffness in the literature by source, N/m."
    )


#: z 20/20 of the literature on backlash, and FZG type C.
PAIRS = {
    "z20-20": {
        "teeth": [20, 20],
        "module": 0.01,
        "width": 0.03,
        "backlash": 50e-6,
        "young": 200e9,
        "torque": 500.0,
        "published": {"ISO": 4.9e8, "thumb": 5.2e8},
    },
    "FZG-C": {
        "teeth": [16, 24],
        "module": 4.5e-3,
        "width": 0.014,
        "shifts": [0.1817, 0.1715],
        "tip_diameters": [0.08246, 0.11836],
        "bores": [0.03, 0.03],
        "centre_distance": 0.0915,
        "backlash": 50e-6,
        "torque": 302.0,
    },
}


class MeshStiffness(Section):
    """The mesh stiffness of drawn pairs by every method, with its uncertainty."""

    pairs: Annotated[dict[Name, DrawnPair], Field(min_length=1, max_length=6)] = Field(
        default={name: DrawnPair(**pair) for name, pair in PAIRS.items()},
        description="Drawn pairs by name.",
    )
    samples: integer_within(ge=8, le=4096) = Field(
        default=64, description="Phases of a course over the mesh period."
    )


class Rectangle(Grid):
    """What the rectangular stiffness of the drawn pairs costs in their motion."""

    key: ClassVar = "rectangle"

    start: OwnStart = 0.5
    stop: OwnStop = 1.3
    step: OwnStep = 0.005
    damping_ratio: number_within(ge=0, le=1) = Field(
        default=0.03, description="In contact, by the energy method; the coefficient is kept."
    )
    tolerance: Positive = Field(
        default=0.05, description="Largest difference of an observable that counts as none."
    )
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=160, description="Mesh periods of a run."
    )
    record_periods: integer_within(ge=1) = Field(
        default=16, description="The last ones, which are evaluated; at most `periods`."
    )

    @model_validator(mode="after")
    def _check(self):
        check_record("rectangle", self)
        return self

"""Sections of the mesh stiffness of drawn pairs: every method, and what its rectangle costs."""

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from gearlib.config.gears import FZG_C, TWENTY, DrawnPair
from gearlib.config.types import (
    Grid,
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
)


class PublishedPair(DrawnPair):
    """A pair of gears by their drawing, with what others find for it."""

    published: dict[Name, Stiffness] = Field(
        default={}, description="Mean mesh stiffness in the literature by source, N/m."
    )


class MeshStiffness(Section):
    """The mesh stiffness of drawn pairs by every method, with its uncertainty."""

    pairs: Annotated[dict[Name, PublishedPair], Field(min_length=1, max_length=6)] = Field(
        default={
            "z20-20": PublishedPair(**TWENTY, published={"ISO": 4.9e8, "thumb": 5.2e8}),
            "FZG-C": PublishedPair(**FZG_C),
        },
        description="Drawn pairs by name.",
    )
    samples: integer_within(ge=8, le=4096) = Field(
        default=64, description="Phases of a course over the mesh period."
    )

    @model_validator(mode="after")
    def _check(self):
        for name, pair in self.pairs.items():
            pair.check(f"mesh_stiffness.pairs.{name}", "iso", "energy")
        return self


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

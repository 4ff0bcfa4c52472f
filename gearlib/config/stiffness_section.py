"""Sections of the mesh stiffness of drawn pairs: every method, and what its rectangle costs."""

from typing import Annotated

from pydantic import Field, model_validator

from gearlib.config.gears_section import FZG_C, TWENTY, DrawnPair
from gearlib.config.types import Name, Section, Stiffness, entry, whole


class PublishedPair(DrawnPair):
    """A pair of gears by their drawing, with what others find for it."""

    published: dict[Name, Stiffness] = entry(
        "Mean mesh stiffness in the literature by source, N/m.", {}
    )


class MeshStiffness(Section):
    """The mesh stiffness of drawn pairs by every method, with its uncertainty."""

    pairs: Annotated[dict[Name, PublishedPair], Field(min_length=1, max_length=6)] = Field(
        default={
            "z20-20": PublishedPair.unchecked(**TWENTY, published={"ISO": 4.9e8, "thumb": 5.2e8}),
            "FZG-C": PublishedPair.unchecked(**FZG_C),
        },
        description="Drawn pairs by name.",
    )
    samples: whole(8, 4096) = entry("Phases of a course over the mesh period.", 64)

    @model_validator(mode="after")
    def _check(self):
        for name, pair in self.pairs.items():
            self.check_gears(f"mesh_stiffness.pairs.{name}", pair)
        return self

    def check_gears(self, place, pair):
        """Refuse a `DrawnPair`, named by `place`, whose stiffness not all methods give."""
        pair.check(place, "iso", "energy")

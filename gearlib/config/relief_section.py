"""Section of tip relief: Harris maps of drawn gears."""

from typing import Literal

from pydantic import model_validator

from gearlib.config.gears_section import FZG_C, DrawnPair
from gearlib.config.types import (
    NonNegative,
    Section,
    entry,
    listing,
    whole,
)


class HarrisMap(Section):
    """The static transmission error of spur gears at several loads, with reliefs that are found."""

    gears: DrawnPair = entry(
        "The pair at its design load, without tip relief; by default FZG type C.",
        DrawnPair.unchecked(**FZG_C | {"backlash": 160e-6}),
    )
    stiffness: Literal["energy", "iso"] = entry(
        "How the stiffness of a pair of teeth is found.", "energy"
    )
    loads: listing(NonNegative, "Over the design load.") = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    phases: whole(8, 10_000) = entry("Phases of a mesh period.", 256)

    @model_validator(mode="after")
    def _check(self):
        self.check_gears("harris_map.gears", self.gears)
        return self

    def check_gears(self, place, gears):
        """Refuse a `DrawnPair`, named by `place`, that has no Harris map."""
        for name in ("pinion", "wheel"):
            gear = getattr(gears, name)
            for key in ("helix_angle", "tip_relief", "pitch_errors"):
                if getattr(gear, key):
                    raise ValueError(
                        f"{place}.{name}.{key} is not allowed: it must be left out, the "
                        "map is that of spur gears without errors, which get their reliefs by it"
                    )
        gears.check(place, self.stiffness)

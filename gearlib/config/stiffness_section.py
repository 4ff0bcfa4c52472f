"""Sections of drawn pairs: their mesh stiffness by every method, and Harris maps."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gearlib.config.gears_section import FZG_C, TWENTY, DrawnPair
from gearlib.config.types import Name, NonNegative, Section, Stiffness, entry, listing, whole


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


#: Section -> its key of drawn gears.
_KEYS = {"mesh_stiffness": "pairs", "harris_map": "gears"}


def takes_configured_gears(c, section):
    """Return whether a section names no gears, so that it is about those of the configuration."""
    return c.gears is not None and _KEYS[section] not in getattr(c, section).model_fields_set


def drawn_pairs(c, section):
    """Return name -> `PublishedPair` of a section: its gears, else those of the configuration."""
    if not takes_configured_gears(c, section):
        pairs = getattr(getattr(c, section), _KEYS[section])
        return pairs if section == "mesh_stiffness" else {section: pairs}
    gears = {"pinion": c.gears.pinion, "wheel": c.gears.wheel}
    name = f"z{gears['pinion'].teeth}-{gears['wheel'].teeth}"
    if section == "harris_map":
        # The map is that of the reliefs it finds.
        gears = {key: gear.model_copy(update={"tip_relief": None}) for key, gear in gears.items()}
    more = {key: getattr(c.gears, key) for key in ("centre_distance", "backlash")}
    return {name: PublishedPair.unchecked(**gears, **more, torque=c.gears.driving_torque())}


def refusal(c, section):
    """Return why a section cannot take the gears of the configuration, or ""."""
    if takes_configured_gears(c, section):
        try:
            (pair,) = drawn_pairs(c, section).values()
            getattr(c, section).check_gears("gears", pair)
        except ValueError as error:
            return str(error)
    return ""

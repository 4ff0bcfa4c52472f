"""What a gear is made of and cut with: material, basic rack, web."""

from dataclasses import dataclass
from typing import Annotated

from gearlib import checks
from gearlib.parameters import DIAMETER, NONNEGATIVE, WIDTH, Number, check, documented


@documented
@dataclass(frozen=True, kw_only=True)
class Material:
    """An elastic material; steel of ISO 6336-1 by default."""

    young: Annotated[float, Number("Pa", "206 GPa", above=0), "Modulus of elasticity"] = 206e9
    poisson: Annotated[float, Number("1", least=0, below=0.5), "Poisson's ratio"] = 0.3
    density: Annotated[float, Number("kg/m^3", "7.85 g/cm^3", above=0), "Density"] = 7850.0

    def __post_init__(self):
        check(self, " of a material")


@documented
@dataclass(frozen=True, kw_only=True)
class Rack:
    """The basic rack that generates the teeth, in modules."""

    addendum: Annotated[float, Number("1", above=0, most=3), "Of the rack,", "h_aP"] = 1.0
    dedendum: Annotated[float, Number("1", above=0, most=3), "Of the rack,", "h_fP"] = 1.25
    tip_radius: Annotated[
        float,
        NONNEGATIVE,
        "Of its tip, which cuts the fillet, rho_fP, below the dedendum; where it would not fit "
        "between the flanks, the largest that does",
    ] = 0.38

    def __post_init__(self):
        check(self, " of a rack")
        fits = self.tip_radius < self.dedendum
        words = f">= 0 and below the dedendum, {self.dedendum}"
        checks.require(fits, "tip_radius of a rack", self.tip_radius, words)


#: The four basic racks of ISO 53.
RACKS = {
    "A": Rack(dedendum=1.25, tip_radius=0.38),
    "B": Rack(dedendum=1.25, tip_radius=0.30),
    "C": Rack(dedendum=1.25, tip_radius=0.25),
    "D": Rack(dedendum=1.40, tip_radius=0.39),
}


@documented
@dataclass(frozen=True, kw_only=True)
class Web:
    """A web between rim and hub, thinner than the face width."""

    thickness: Annotated[float, WIDTH, "Of the web,", "b_s"]
    rim_diameter: Annotated[float, DIAMETER, "Inside of the rim"]
    hub_diameter: Annotated[float, DIAMETER, "Outside of the hub, smaller than that of the rim"]

    def __post_init__(self):
        check(self, " of a web")
        fits = self.rim_diameter > self.hub_diameter
        words = f"above hub_diameter, {self.hub_diameter!r}"
        checks.require(fits, "rim_diameter of a web", self.rim_diameter, words)

"""Parts of a drawn gear: material, basic rack, web, tip relief; a table over the path of contact.

A gap is measured along the line of action, in m: by so much later than its involutes a pair of
teeth touches. Positions are those of `gearlib.models.geometry.mesh`.
"""

from dataclasses import dataclass
from typing import Annotated

from gearlib import checks
from gearlib.parameters import (
    DIAMETER,
    NONNEGATIVE,
    RELIEF,
    RELIEF_LENGTH,
    WIDTH,
    Number,
    OneOf,
    check,
    documented,
)


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


#: Exponent of the relief over its length.
SHAPES = {"linear": 1, "parabolic": 2}


@documented
@dataclass(frozen=True, kw_only=True)
class TipRelief:
    """Tip relief of a gear, as on its drawing; immutable.

    Its length is the difference of the radii of curvature between the tip and its start.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    amount: Annotated[float, RELIEF, "C_a, by how much the tip lies back, normal to the flank"]
    length: Annotated[float, RELIEF_LENGTH, "L_Ca, of the relieved part along the path of contact"]
    shape: Annotated[str, OneOf(tuple(SHAPES)), "Over that length"] = "linear"

    def __post_init__(self):
        check(self, " of a tip relief")

    def gap(self, from_tip):
        """Return the gap at distances from the tip along the path of contact, m."""
        # Here and below: a start of the workflow checks drawings without the numerical stack.
        import numpy as np

        inside = np.maximum(1.0 - np.asarray(from_tip) / self.length, 0.0)
        return self.amount * inside ** SHAPES[self.shape]


@dataclass(frozen=True)
class PathTable:
    """A table over the path of contact, linear between its points and constant beyond.

    Parameters
    ----------
    position : sequence of float
        Radii of curvature of the pinion's flank, m, strictly rising; ``mesh.path`` bounds them.
    value : sequence of float
        What is tabulated: a deviation of the flanks in m, or the stiffness of a pair of teeth in
        N/m; finite.

    Raises
    ------
    ValueError
        Naming the entry that is wrong.
    """

    position: tuple
    value: tuple

    def __post_init__(self):
        for name in ("position", "value"):
            object.__setattr__(self, name, checks.finite(name, getattr(self, name)))
        if len(self.position) != len(self.value) or not self.position:
            raise ValueError(
                f"a table of {len(self.position)} positions and {len(self.value)} values is not "
                "allowed: it must have equally many, at least 1"
            )
        if any(a >= b for a, b in zip(self.position, self.position[1:], strict=False)):
            raise ValueError(f"position = {self.position!r} is not allowed: it must rise strictly")

    def at(self, position):
        """Return the values at positions of the path."""
        import numpy as np

        return np.interp(position, self.position, self.value)

"""What a gear is made of and cut with: material, basic rack, web."""

from dataclasses import dataclass

from gearlib import checks


@dataclass(frozen=True, kw_only=True)
class Material:
    """An elastic material; steel of ISO 6336-1 by default.

    Parameters
    ----------
    young : float, default 206e9
        Modulus of elasticity, Pa; finite, > 0.
    poisson : float, default 0.3
        From 0 to below 0.5.
    density : float, default 7850
        kg/m^3; finite, > 0.
    """

    young: float = 206e9
    poisson: float = 0.3
    density: float = 7850.0

    def __post_init__(self):
        for name in ("young", "density"):
            checks.finite_positive(f"{name} of a material", getattr(self, name))
        checks.number(
            "poisson of a material", self.poisson, ">= 0 and < 0.5", lambda v: 0.0 <= v < 0.5
        )


@dataclass(frozen=True, kw_only=True)
class Rack:
    """The basic rack that generates the teeth, in modules.

    Parameters
    ----------
    addendum, dedendum : float
        h_aP and h_fP over the normal module; > 0, at most 3.
    tip_radius : float
        Of its tip, which cuts the fillet, rho_fP over the module; >= 0, below the dedendum. Where
        it would not fit between the flanks, the largest that does.
    """

    addendum: float = 1.0
    dedendum: float = 1.25
    tip_radius: float = 0.38

    def __post_init__(self):
        for name in ("addendum", "dedendum"):
            checks.number(
                f"{name} of a rack", getattr(self, name), "> 0 and <= 3", lambda v: 0.0 < v <= 3.0
            )
        checks.number(
            "tip_radius of a rack",
            self.tip_radius,
            f">= 0 and below the dedendum, {self.dedendum}",
            lambda v: 0.0 <= v < self.dedendum,
        )


#: The four basic racks of ISO 53.
RACKS = {
    "A": Rack(dedendum=1.25, tip_radius=0.38),
    "B": Rack(dedendum=1.25, tip_radius=0.30),
    "C": Rack(dedendum=1.25, tip_radius=0.25),
    "D": Rack(dedendum=1.40, tip_radius=0.39),
}


@dataclass(frozen=True, kw_only=True)
class Web:
    """A web between rim and hub, thinner than the face width.

    Parameters
    ----------
    thickness : float
        b_s, m; finite, > 0.
    rim_diameter, hub_diameter : float
        Of the rim inside and of the hub outside, m; finite, > 0, the rim's larger.
    """

    thickness: float
    rim_diameter: float
    hub_diameter: float

    def __post_init__(self):
        for name in ("thickness", "rim_diameter", "hub_diameter"):
            checks.finite_positive(f"{name} of a web", getattr(self, name))
        checks.number(
            "rim_diameter of a web",
            self.rim_diameter,
            f"above hub_diameter, {self.hub_diameter!r}",
            lambda v: v > self.hub_diameter,
        )

"""A gear by its drawing, and its parts: material, basic rack, web, tip relief (ISO 21771, ISO 53).

Formulas are those of ISO 21771, with a negative number of teeth for a ring gear there and
``sign = -1`` here; all diameters are positive. A positive profile shift moves the teeth towards
their tips, of a ring gear towards its axis. A gap is measured along the line of action, in m: by so
much later than its involutes a pair of teeth touches. Positions on the path of contact are those of
`gearlib.models.geometry.mesh`.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

from gearlib import checks
from gearlib.parameters import (
    BORE,
    DIAMETER,
    ERROR,
    MODULE,
    NONNEGATIVE,
    RELIEF,
    RELIEF_LENGTH,
    TRUTH,
    WIDTH,
    Instance,
    Integer,
    Many,
    Number,
    OneOf,
    check,
    documented,
)

#: By so much the shift may lie below the limit of undercut: 17 teeth without shift, the limit of
#: the textbooks, lie 0.006 below; the rack takes away less than a thousandth of a module.
_UNDERCUT = 0.02


def inv(angle):
    """Return the involute function tan(angle) - angle; ISO 21771."""
    return math.tan(angle) - angle


def angle_of(value):
    """Return the angle in [0, pi / 2) whose involute is `value` >= 0, by Newton's method."""
    # inv is convex: from the right of the root, Newton's steps fall towards it.
    tangent = value + math.pi / 2.0
    for _ in range(100):
        # In t = tan(angle): t - arctan(t) = value, whose derivative is t^2 / (1 + t^2).
        step = (tangent - math.atan(tangent) - value) * (1.0 + tangent**2) / tangent**2
        tangent -= step
        if tangent <= 0.0:
            return 0.0
        if abs(step) <= 1e-15 * tangent:
            break
    return math.atan(tangent)


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
        words = f">= 0 and below the dedendum, {self.dedendum}"
        fits = self.tip_radius < self.dedendum
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
            table = f"a table of {len(self.position)} positions and {len(self.value)} values"
            raise ValueError(f"{table} is not allowed: it must have equally many, at least 1")
        if any(a >= b for a, b in pairwise(self.position)):
            raise ValueError(f"position = {self.position!r} is not allowed: it must rise strictly")

    def at(self, position):
        """Return the values at positions of the path."""
        import numpy as np

        return np.interp(position, self.position, self.value)


class _RackKind(OneOf):
    """A basic rack, or its letter."""

    def check(self, name, value):
        return value if isinstance(value, Rack) else RACKS[super().check(name, value)]


@documented
@dataclass(frozen=True, kw_only=True)
class SpurGear:
    """A cylindrical gear, external or internal, spur or helical; immutable, in SI units.

    Raises
    ------
    ValueError
        If a value is impossible, the rack undercuts the teeth or their tips are pointed; the
        message names parameter, value and range.
    """

    teeth: Annotated[int, Integer(3, limit=10_000), "Number of teeth", "z"]
    module: Annotated[float, MODULE, "Normal module", "m_n"]
    width: Annotated[float, WIDTH, "Face width", "b"]
    shift: Annotated[float, Number("1", least=-3, most=3), "Profile shift coefficient", "x"] = 0.0
    pressure_angle: Annotated[
        float,
        Number("rad", "20 deg", above=0, below=math.pi / 4),
        "Pressure angle of the basic rack alpha_n; 20 degrees by default",
    ] = math.radians(20.0)
    helix_angle: Annotated[
        float,
        Number("rad", "15.8 deg", least=0, below=math.pi / 3),
        "Helix angle at the reference circle beta; 0 by default",
    ] = 0.0
    internal: Annotated[bool, TRUTH, "Whether it is a ring gear"] = False
    tip_diameter: Annotated[
        float | None,
        DIAMETER,
        "d_a; by default d + 2 m_n (x + h_aP), of a ring gear with -",
    ] = None
    rack: Annotated[
        Rack | str, _RackKind(tuple(RACKS)), "Basic rack, by its letter in ISO 53; A by default"
    ] = "A"
    thickness_allowance: Annotated[
        float,
        Number("m", "-50 um", most=0),
        "Upper allowance of the normal tooth thickness E_sns; DIN 3967",
    ] = 0.0
    bore: Annotated[float, BORE, "Diameter; below that of the root"] = 0.0
    outer_diameter: Annotated[
        float | None, DIAMETER, "Of the rim of a ring gear; its mass and inertia need it"
    ] = None
    web: Annotated[Web | None, Instance((Web,)), "Between rim and hub"] = None
    material: Annotated[Material, Instance((Material,)), "Steel by default"] = Material()
    quality: Annotated[
        int | None,
        Integer(1, 11),
        "Flank tolerance class of ISO 1328-1:2013; `pitch_deviation` and `form_deviation` need it",
    ] = None
    tip_relief: Annotated[TipRelief | None, Instance((TipRelief,)), "None by default"] = None
    pitch_errors: Annotated[
        tuple,
        Many(ERROR),
        "By how much each flank lies back from its place along the line of action, tooth after "
        "tooth as they come into mesh; as many as teeth, or none",
    ] = ()

    def __post_init__(self):
        check(self)
        self._check_teeth()
        self._check_blank()

    def _set_within(self, name, allowed, accept):
        """Set a field to its value as a float, else refuse it."""
        value = checks.number(name, getattr(self, name), allowed, accept)
        object.__setattr__(self, name, value)

    def _check_teeth(self):
        """Refuse teeth that the rack undercuts, pointed tips, relief that leaves no tip."""
        rack, root, base = self.rack, self.root_diameter, self.base_diameter
        most = math.pi / 4.0 / math.tan(self.pressure_angle)
        words = f"<= {most:.4g} at this pressure angle, where its own tips are pointed"
        checks.require(rack.dedendum <= most, "dedendum of a rack", rack.dedendum, words)
        if not self.internal:
            radius = self.teeth / (2.0 * math.cos(self.helix_angle))
            height = self.rack_form_height / self.module
            limit = height - radius * math.sin(self.transverse_pressure_angle) ** 2
            words = f">= {limit:.4f} for {self.teeth} teeth, or the rack undercuts them"
            checks.require(self.shift >= limit - _UNDERCUT, "shift", self.shift, words)
        if self.tip_diameter is None:
            add = 2.0 * self.module * (self.shift + rack.addendum)
            object.__setattr__(self, "tip_diameter", self.reference_diameter + self.sign * add)
            fits = not self.internal or self.tip_diameter > base
            words = "larger, or a tip_diameter be given outside of its base circle"
            checks.require(fits, "teeth of the ring gear", self.teeth, words)
        low, high = (base, root) if self.internal else (max(root, base), math.inf)
        allowed = f"from {low:.6g} to {high:.6g} m" if self.internal else f"above {low:.6g} m"
        allowed += ", by its base and root circles"
        self._set_within("tip_diameter", allowed, lambda v: low < v < high)
        thickness = self.thickness_at(self.tip_diameter)
        words = (
            f"such that the tooth is not pointed (its tip would be {thickness:.3g} m thick; > 0 "
        )
        words += "is allowed)"
        checks.require(thickness > 0.0, "tip_diameter", self.tip_diameter, words)
        words = f"{self.teeth} numbers, one for each tooth"
        fits = len(self.pitch_errors) in (0, self.teeth)
        checks.require(fits, "pitch_errors", self.pitch_errors, words)
        if self.tip_relief is not None:
            amount = self.tip_relief.amount
            words = f"below half of the thickness of the tip, {thickness / 2.0:.4g} m"
            checks.require(amount < thickness / 2.0, "amount of a tip relief", amount, words)

    def _check_blank(self):
        """Refuse bore, rim and web that do not fit the root circle."""
        root, ring, web = self.root_diameter, self.internal, self.web
        words = "0 for a ring gear" if ring else f">= 0 and < {root:.6g} m"
        self._set_within("bore", words, lambda v: v == 0.0 if ring else 0.0 <= v < root)
        if self.outer_diameter is not None:
            words = f"above the root circle of a ring gear, {root:.6g} m"
            words = words if ring else "left out: only a ring gear has one"
            self._set_within("outer_diameter", words, lambda v: ring and root < v < math.inf)
        if web is None:
            return
        checks.require(not ring, "web", web, "left out of a ring gear")
        thick, rim, hub = web.thickness, web.rim_diameter, web.hub_diameter
        for name, value, fits, words in (
            ("thickness", thick, thick <= self.width, f"at most the face width, {self.width!r} m"),
            ("rim_diameter", rim, rim < root, f"below the root circle, {root:.6g} m"),
            ("hub_diameter", hub, hub >= self.bore, f"at least the bore, {self.bore!r} m"),
        ):
            checks.require(fits, f"{name} of the web", value, words)

    @property
    def sign(self):
        """1, of a ring gear -1: the sign of its number of teeth in ISO 21771."""
        return -1 if self.internal else 1

    @property
    def transverse_module(self):
        """m_t = m_n / cos(beta), m."""
        return self.module / math.cos(self.helix_angle)

    @property
    def transverse_pressure_angle(self):
        """alpha_t, tan(alpha_t) = tan(alpha_n) / cos(beta), rad."""
        return math.atan(math.tan(self.pressure_angle) / math.cos(self.helix_angle))

    @property
    def base_helix_angle(self):
        """beta_b, sin(beta_b) = sin(beta) cos(alpha_n), rad."""
        return math.asin(math.sin(self.helix_angle) * math.cos(self.pressure_angle))

    @property
    def virtual_teeth(self):
        """z_n = z / (cos^2(beta_b) cos(beta)), of the spur gear in the normal section."""
        return self.teeth / (math.cos(self.base_helix_angle) ** 2 * math.cos(self.helix_angle))

    @property
    def reference_diameter(self):
        """d = z m_t, m."""
        return self.teeth * self.transverse_module

    @property
    def base_diameter(self):
        """d_b = d cos(alpha_t), m."""
        return self.reference_diameter * math.cos(self.transverse_pressure_angle)

    @property
    def root_diameter(self):
        """d_f = d + 2 m_n (x - h_fP), of a ring gear d - 2 m_n (x - h_fP), m."""
        depth = 2.0 * self.module * (self.shift - self.rack.dedendum)
        return self.reference_diameter + self.sign * depth

    @property
    def fillet_radius(self):
        """Radius of the rack's tip in the normal section rho_fP, at most the full round, m."""
        angle = self.pressure_angle
        # Half the gap of the rack at its tip line, in which the round has to fit.
        half = (math.pi / 4.0 - self.rack.dedendum * math.tan(angle)) * self.module
        full = max(half, 0.0) * math.cos(angle) / (1.0 - math.sin(angle))
        return min(self.rack.tip_radius * self.module, full)

    @property
    def rack_form_height(self):
        """Height of the straight flank of the rack below its datum line h_FfP, m; ISO 21771."""
        round_off = self.fillet_radius * (1.0 - math.sin(self.pressure_angle))
        return self.rack.dedendum * self.module - round_off

    @property
    def form_roll_length(self):
        """Radius of curvature at which the involute begins above the fillet, m; >= 0.

        External gears, cut by the rack: r_b tan(alpha_t) - (h_FfP - x m_n) / sin(alpha_t), ISO
        21771. A ring gear's flank is taken to reach its root circle.
        """
        base = self.base_diameter / 2.0
        if self.internal:
            return math.sqrt((self.root_diameter / 2.0) ** 2 - base**2)
        angle = self.transverse_pressure_angle
        below = (self.rack_form_height - self.shift * self.module) / math.sin(angle)
        return max(base * math.tan(angle) - below, 0.0)

    @property
    def tip_roll_length(self):
        """Radius of curvature of the flank at the tip, sqrt(r_a^2 - r_b^2), m."""
        return math.sqrt(self.tip_diameter**2 - self.base_diameter**2) / 2.0

    @property
    def tooth_thickness(self):
        """Transverse, on the reference circle, allowance included: s_t, m."""
        nominal = math.pi / 2.0 + 2.0 * self.shift * math.tan(self.pressure_angle)
        return (self.module * nominal + self.thickness_allowance) / math.cos(self.helix_angle)

    def thickness_at(self, diameter):
        """Return the transverse tooth thickness at a diameter >= d_b, m; ISO 21771."""
        angle = math.acos(min(self.base_diameter / diameter, 1.0))
        narrowing = inv(self.transverse_pressure_angle) - inv(angle)
        return diameter * (self.tooth_thickness / self.reference_diameter + self.sign * narrowing)

    @property
    def pitch_deviation(self):
        """Tolerance of a single pitch f_ptT of its quality, not rounded, m; ISO 1328-1:2013."""
        return self._tolerance(1e-6 * self.reference_diameter + 4e-4 * self.module + 5e-6)

    @property
    def form_deviation(self):
        """Tolerance of the profile's form f_falphaT of its quality, not rounded, m; the same."""
        return self._tolerance(5.5e-4 * self.module + 5e-6)

    def _tolerance(self, of_class_5):
        """Return the tolerance of the quality from that of class 5."""
        words = "an integer from 1 to 11, or the deviations must be given"
        checks.require(self.quality is not None, "quality", None, words)
        return of_class_5 * math.sqrt(2.0) ** (self.quality - 5)

    @property
    def mean_diameter(self):
        """(d_a + d_f) / 2, where ISO 6336-1 ends the disc that stands for the gear, m."""
        return (self.tip_diameter + self.root_diameter) / 2.0

    @property
    def mass(self):
        """Of disc, disc with bore, with web, or of the rim of a ring gear, kg."""
        return self._moment(2, math.pi / 4.0)

    @property
    def inertia(self):
        """About the axis, of the same bodies, kg m^2; ISO 6336-1."""
        return self._moment(4, math.pi / 32.0)

    def _moment(self, power, factor):
        """Return `factor` times the density times the volume with a power of the diameters."""
        outer, inner = self.mean_diameter, self.bore
        if self.internal:
            words = f"given for the inertia of a ring gear, above {self.root_diameter:.6g} m"
            checks.require(self.outer_diameter is not None, "outer_diameter", None, words)
            outer, inner = self.outer_diameter, self.mean_diameter
        volume = self.width * (outer**power - inner**power)
        if self.web is not None:
            gap = self.web.rim_diameter**power - self.web.hub_diameter**power
            volume -= (self.width - self.web.thickness) * gap
        return factor * volume * self.material.density

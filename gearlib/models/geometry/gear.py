"""Geometry of a gear and its parts: material, basic rack, web and tip relief (ISO 21771, ISO 53).

The formulas follow ISO 21771, in which a ring gear has a negative number of teeth; here it has
``sign = -1``, and all diameters are positive. A positive profile shift moves the teeth towards
their tips, i.e. in a ring gear towards the axis. A gap is the distance between two flanks
along the line of action, in m. `gearlib.models.geometry.gear_stage` defines positions on the path
of contact.
"""

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt

from gearlib import checks, parameters
from gearlib.parameters import (
    CHOICE,
    Boolean,
    Bore,
    Diameter,
    Error,
    Finite,
    Length,
    Module,
    NonNegative,
    Relief,
    ReliefLength,
    Unit,
    Values,
    Width,
    checked,
    declared,
    described,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

#: Allowed undershoot of the profile shift below the undercut limit. At the textbook limit, 17 teeth
#: without profile shift, it is 0.006, and the undercut is less than a thousandth of a module.
_UNDERCUT_TOLERANCE = 0.02


def inv(angle: float) -> float:
    """Return the involute function, tan(angle) - angle, of an angle in rad; ISO 21771."""
    return math.tan(angle) - angle


def inverse_involute(involute: float) -> float:
    """Return the angle in [0, pi / 2) whose involute function, tan(angle) - angle, is `involute`.

    `involute` must be >= 0.
    """
    # Newton's method converges from above, because the involute function is convex.
    tangent = involute + math.pi / 2.0
    for _ in range(100):
        # With t = tan(angle), t - arctan(t) = involute has the derivative t^2 / (1 + t^2).
        step = (tangent - math.atan(tangent) - involute) * (1.0 + tangent**2) / tangent**2
        tangent -= step
        if tangent <= 0.0:
            return 0.0  # For tiny angles, rounding errors can lead to negative iterates.
        if abs(step) <= 1e-15 * tangent:
            break
    return math.atan(tangent)


@declared()
class Material:
    """An elastic material; steel of ISO 6336-1 by default."""

    young: Annotated[float, Gt(0), Unit("Pa", "206 GPa"), described("Modulus of elasticity")] = (
        206e9
    )
    poisson: Annotated[float, Ge(0), Lt(0.5), Unit("1"), described("Poisson's ratio")] = 0.3
    density: Annotated[float, Gt(0), Unit("kg/m^3", "7.85 g/cm^3"), described("Density")] = 7850.0


@declared()
class Rack:
    """The basic rack that generates the teeth, in modules."""

    addendum: Annotated[float, Gt(0), Le(3), Unit("1"), described("Of the rack,", "h_aP")] = 1.0
    dedendum: Annotated[float, Gt(0), Le(3), Unit("1"), described("Of the rack,", "h_fP")] = 1.25
    tip_radius: Annotated[
        NonNegative,
        described(
            "Of its tip, which cuts the fillet, rho_fP, below the dedendum; where it would not fit "
            "between the flanks, the largest that does"
        ),
    ] = 0.38

    def __post_init__(self) -> None:
        """Raise an `InputError` unless the tip radius is smaller than the dedendum."""
        allowed = f">= 0 and below the dedendum, {self.dedendum}"
        valid = self.tip_radius < self.dedendum
        checks.require(valid, "tip_radius", self.tip_radius, allowed)


#: The four basic racks of ISO 53.
RACKS = {
    "A": Rack(dedendum=1.25, tip_radius=0.38),
    "B": Rack(dedendum=1.25, tip_radius=0.30),
    "C": Rack(dedendum=1.25, tip_radius=0.25),
    "D": Rack(dedendum=1.40, tip_radius=0.39),
}


@declared()
class Web:
    """A web between rim and hub, thinner than the face width."""

    thickness: Annotated[Width, described("Of the web,", "b_s")]
    rim_diameter: Annotated[Diameter, described("Inside of the rim")]
    hub_diameter: Annotated[Diameter, described("Outside of the hub, smaller than rim_diameter")]

    def __post_init__(self) -> None:
        """Raise an `InputError` unless the rim has a larger diameter than the hub."""
        valid = self.rim_diameter > self.hub_diameter
        allowed = f"above hub_diameter, {self.hub_diameter!r}"
        checks.require(valid, "rim_diameter", self.rim_diameter, allowed)


#: Shape of a tip relief -> exponent of the gap over the length.
SHAPES = {"linear": 1, "parabolic": 2}
Shape = Annotated[Literal["linear", "parabolic"], CHOICE]


def tip_relief_gap(tip_distance, amount, length, shape: str) -> "np.ndarray":
    """Return the gap in m between the flanks due to a tip relief, material removed at the tip.

    `tip_distance` is the distance along the path of contact from its end at the tip, `amount` is
    the gap at the tip, and `length` is the length of the relief; all are in m and are broadcast.
    `shape` is "linear" or "parabolic".
    """
    import numpy as np  # not needed for the checks of the geometry

    fraction = np.maximum(1.0 - np.asarray(tip_distance) / length, 0.0)
    return amount * fraction ** SHAPES[shape]


@declared()
class TipRelief:
    """Tip relief of a gear; immutable.

    Its length is the difference of the radii of curvature between the tip and its start.
    """

    amount: Annotated[Relief, described("C_a, by how much the tip lies back, normal to the flank")]
    length: Annotated[
        ReliefLength, described("L_Ca, of the relieved part along the path of contact")
    ]
    shape: Annotated[Shape, described("Over that length")] = "linear"

    def gap(self, tip_distance: "ArrayLike") -> "np.ndarray":
        """Return the gap between the flanks in m at distances from the tip in m.

        The relief removes material from the flank near the tip. Distances are measured along the
        path of contact, from its end at the tip of this gear.
        """
        return tip_relief_gap(tip_distance, self.amount, self.length, self.shape)


@declared(kw_only=False)
class PathTable:
    """A table over the path of contact, linear between its points and constant beyond."""

    position: Annotated[
        tuple[Error, ...],
        Values(),
        described(
            "Radii of curvature of the pinion's flank, strictly increasing, within ``mesh.path``"
        ),
    ]
    value: Annotated[
        tuple[Finite, ...],
        Values(),
        described("Deviations of the flanks in m, or stiffnesses of a pair of teeth in N/m"),
    ]

    def __post_init__(self) -> None:
        """Raise ValueError unless positions strictly increase and there is one value for each.

        The table must have at least one point.
        """
        if len(self.position) != len(self.value) or not self.position:
            table = f"a table of {len(self.position)} positions and {len(self.value)} values"
            raise ValueError(f"{table} is not allowed: it must have equally many, at least 1")
        if any(position >= next_position for position, next_position in pairwise(self.position)):
            raise checks.InputError("position", self.position, "strictly increasing")

    def at(self, position: "ArrayLike") -> "np.ndarray":
        """Return the values at positions on the path of contact in m, interpolated linearly.

        Outside the table, the value of its first or last point is returned.
        """
        import numpy as np

        return np.interp(position, self.position, self.value)


@declared()
class SpurGear:
    """A cylindrical gear, external or internal, spur or helical; immutable, in SI units.

    Raises
    ------
    ValueError
        If a value is impossible, the rack undercuts the teeth or their tips are pointed; the
        message names parameter, value and range.
    """

    teeth: Annotated[int, Ge(3), Le(10_000), parameters.INTEGER, described("Number of teeth", "z")]
    module: Annotated[Module, described("Normal module", "m_n")]
    width: Annotated[Width, described("Face width", "b")]
    shift: Annotated[
        float, Ge(-3), Le(3), Unit("1"), described("Profile shift coefficient", "x")
    ] = 0.0
    pressure_angle: Annotated[
        float,
        Gt(0),
        Lt(math.pi / 4),
        Unit("rad", "20 deg"),
        described("Pressure angle of the basic rack alpha_n; 20 degrees by default"),
    ] = math.radians(20.0)
    helix_angle: Annotated[
        float,
        Gt(-math.pi / 3),
        Lt(math.pi / 3),
        Unit("rad", "15.8 deg"),
        described(
            "Helix angle at the reference circle beta, > 0 for a right-hand helix, < 0 for a left-"
            "hand one; 0 by default"
        ),
    ] = 0.0
    internal: Annotated[Boolean, described("Whether it is a ring gear")] = False
    tip_diameter: Annotated[
        Diameter | None, described("d_a; by default d + 2 m_n (x + h_aP), of a ring gear with -")
    ] = None
    rack: Annotated[
        Rack | Literal["A", "B", "C", "D"],
        described("Basic rack, by its letter in ISO 53; A by default"),
    ] = "A"
    thickness_allowance: Annotated[
        float,
        Le(0),
        Unit("m", "-50 um"),
        described("Upper allowance of the normal tooth thickness E_sns; DIN 3967"),
    ] = 0.0
    bore: Annotated[Bore, described("Diameter; below the root diameter")] = 0.0
    outer_diameter: Annotated[
        Diameter | None, described("Of the rim of a ring gear; its mass and inertia need it")
    ] = None
    web: Annotated[Web | None, described("Between rim and hub")] = None
    material: Annotated[Material, described("Steel by default")] = Material()
    quality: Annotated[
        Annotated[int, Ge(1), Le(11), parameters.INTEGER] | None,
        described(
            "Flank tolerance class of ISO 1328-1:2013; `pitch_deviation` and `form_deviation` need"
            " it"
        ),
    ] = None
    tip_relief: Annotated[TipRelief | None, described("None by default")] = None
    pitch_errors: Annotated[
        tuple[Error, ...],
        Values(),
        described(
            "By how much each flank lies back from its place along the line of action, tooth after "
            "tooth as they come into mesh; as many as teeth, or none"
        ),
    ] = ()

    def __post_init__(self) -> None:
        """Set the rack and the default tip diameter; check the teeth and the gear blank.

        If `rack` is a letter, it is replaced by the corresponding `Rack` of ISO 53.
        """
        if isinstance(self.rack, str):
            object.__setattr__(self, "rack", RACKS[self.rack])
        self._set_tip_and_check_teeth()
        self._check_blank()

    def _set_tip_and_check_teeth(self) -> None:
        """Set the default tip diameter; raise an `InputError` if the teeth are impossible.

        The basic rack must not have pointed tips and must not undercut the teeth. The tip circle
        must be outside the base circle, and the teeth must not be pointed. If there are pitch
        errors, there must be one per tooth. A tip relief must be thinner than half of the tip.
        """
        rack, root_diameter, base_diameter = self.rack, self.root_diameter, self.base_diameter
        max_dedendum = math.pi / 4.0 / math.tan(self.pressure_angle)
        allowed = f"<= {max_dedendum:.4g} at this pressure angle, where its own tips are pointed"
        checks.require(rack.dedendum <= max_dedendum, "rack.dedendum", rack.dedendum, allowed)
        if not self.internal:
            # The end of the straight flank of the rack must not cut below the point of tangency
            # with the base circle. This limits the profile shift, which is in modules.
            reference_radius = self.teeth / (2.0 * math.cos(self.helix_angle))  # in modules
            form_height = self.rack_form_height / self.module
            depth = reference_radius * math.sin(self.transverse_pressure_angle) ** 2
            min_shift = form_height - depth
            allowed = f">= {min_shift:.4f} for {self.teeth} teeth, or the rack undercuts them"
            valid = self.shift >= min_shift - _UNDERCUT_TOLERANCE
            checks.require(valid, "shift", self.shift, allowed)
        if self.tip_diameter is None:
            addenda = 2.0 * self.module * (self.shift + rack.addendum)
            object.__setattr__(self, "tip_diameter", self.reference_diameter + self.sign * addenda)
            valid = not self.internal or self.tip_diameter > base_diameter
            allowed = "larger, or a tip_diameter be given outside of its base circle"
            checks.require(valid, "teeth", self.teeth, allowed)
        # The tip circle of a ring gear is inside its root circle.
        if self.internal:
            min_diameter, max_diameter = base_diameter, root_diameter
            allowed = f"from {min_diameter:.6g} to {max_diameter:.6g} m"
        else:
            min_diameter, max_diameter = max(root_diameter, base_diameter), math.inf
            allowed = f"above {min_diameter:.6g} m"
        allowed += ", by its base and root circles"
        valid = min_diameter < self.tip_diameter < max_diameter
        checks.require(valid, "tip_diameter", self.tip_diameter, allowed)
        tip_thickness = self.thickness_at(self.tip_diameter)
        allowed = (
            "such that the tooth is not pointed "
            f"(its tip would be {tip_thickness:.3g} m thick; > 0 is allowed)"
        )
        checks.require(tip_thickness > 0.0, "tip_diameter", self.tip_diameter, allowed)
        allowed = f"{self.teeth} numbers, one for each tooth"
        valid = len(self.pitch_errors) in (0, self.teeth)
        checks.require(valid, "pitch_errors", self.pitch_errors, allowed)
        if self.tip_relief is not None:
            amount = self.tip_relief.amount
            allowed = f"below half of the thickness of the tip, {tip_thickness / 2.0:.4g} m"
            checks.require(amount < tip_thickness / 2.0, "tip_relief.amount", amount, allowed)

    def _check_blank(self) -> None:
        """Raise an `InputError` if bore, outer diameter or web do not fit the root circle.

        A ring gear has no bore and no web, and only a ring gear has an outer diameter.
        """
        root_diameter, internal, web = self.root_diameter, self.internal, self.web
        if internal:
            checks.require(self.bore == 0.0, "bore", self.bore, "0 for a ring gear")
        else:
            allowed = f">= 0 and < {root_diameter:.6g} m"
            checks.require(self.bore < root_diameter, "bore", self.bore, allowed)
        if self.outer_diameter is not None:
            allowed = "left out: only a ring gear has one"
            if internal:
                allowed = f"above the root circle of a ring gear, {root_diameter:.6g} m"
            valid = internal and self.outer_diameter > root_diameter
            checks.require(valid, "outer_diameter", self.outer_diameter, allowed)
        if web is None:
            return
        checks.require(not internal, "web", web, "left out of a ring gear")
        allowed = f"at most the face width, {self.width!r} m"
        checks.require(web.thickness <= self.width, "web.thickness", web.thickness, allowed)
        allowed = f"below the root circle, {root_diameter:.6g} m"
        valid = web.rim_diameter < root_diameter
        checks.require(valid, "web.rim_diameter", web.rim_diameter, allowed)
        allowed = f"at least the bore, {self.bore!r} m"
        valid = web.hub_diameter >= self.bore
        checks.require(valid, "web.hub_diameter", web.hub_diameter, allowed)

    @property
    def sign(self) -> int:
        """Sign of the number of teeth in ISO 21771: 1 for an external gear, -1 for a ring gear."""
        return -1 if self.internal else 1

    @property
    def transverse_module(self) -> float:
        """Transverse module m_t = m_n / cos(beta), m."""
        return self.module / math.cos(self.helix_angle)

    @property
    def transverse_pressure_angle(self) -> float:
        """Transverse pressure angle alpha_t with tan(alpha_t) = tan(alpha_n) / cos(beta), rad."""
        return math.atan(math.tan(self.pressure_angle) / math.cos(self.helix_angle))

    @property
    def base_helix_angle(self) -> float:
        """Base helix angle beta_b with sin(beta_b) = sin(beta) cos(alpha_n), rad."""
        return math.asin(math.sin(self.helix_angle) * math.cos(self.pressure_angle))

    @property
    def virtual_teeth(self) -> float:
        """Number of teeth of the virtual spur gear, z_n = z / (cos^2(beta_b) cos(beta))."""
        return self.teeth / (math.cos(self.base_helix_angle) ** 2 * math.cos(self.helix_angle))

    @property
    def reference_diameter(self) -> float:
        """Reference diameter d = z m_t, m."""
        return self.teeth * self.transverse_module

    @property
    def base_diameter(self) -> float:
        """Base diameter d_b = d cos(alpha_t), m."""
        return self.reference_diameter * math.cos(self.transverse_pressure_angle)

    @property
    def root_diameter(self) -> float:
        """Root diameter d_f = d + 2 m_n (x - h_fP), for a ring gear d - 2 m_n (x - h_fP), m."""
        height = 2.0 * self.module * (self.shift - self.rack.dedendum)
        return self.reference_diameter + self.sign * height

    @property
    def fillet_radius(self) -> float:
        """Tip radius rho_fP of the basic rack in the normal section, which cuts the fillet, m.

        It is at most the radius of a fully rounded tip.
        """
        angle = self.pressure_angle
        # Half the distance between both flanks of the rack at its tip line.
        half_width = (math.pi / 4.0 - self.rack.dedendum * math.tan(angle)) * self.module
        max_radius = max(half_width, 0.0) * math.cos(angle) / (1.0 - math.sin(angle))
        return min(self.rack.tip_radius * self.module, max_radius)

    @property
    def rack_form_height(self) -> float:
        """Height h_FfP of the straight flank of the rack below its datum line, m; ISO 21771."""
        rounded_height = self.fillet_radius * (1.0 - math.sin(self.pressure_angle))
        return self.rack.dedendum * self.module - rounded_height

    @property
    def form_roll_length(self) -> float:
        """Radius of curvature of the involute at its start above the fillet, m; >= 0.

        For external gears it is r_b tan(alpha_t) - (h_FfP - x m_n) / sin(alpha_t), ISO 21771, with
        the height h_FfP of the straight flank of the rack and the profile shift x m_n. The involute
        of a ring gear is assumed to end at the root circle.
        """
        base_radius = self.base_diameter / 2.0
        if self.internal:
            return math.sqrt((self.root_diameter / 2.0) ** 2 - base_radius**2)
        angle = self.transverse_pressure_angle
        # Length of the line of action between the start of the involute and the pitch point.
        length = (self.rack_form_height - self.shift * self.module) / math.sin(angle)
        return max(base_radius * math.tan(angle) - length, 0.0)

    @property
    def tip_roll_length(self) -> float:
        """Radius of curvature of the flank at the tip, sqrt(r_a^2 - r_b^2), m."""
        return math.sqrt(self.tip_diameter**2 - self.base_diameter**2) / 2.0

    @property
    def tooth_thickness(self) -> float:
        """Transverse tooth thickness s_t on the reference circle, including the allowance, m."""
        nominal = math.pi / 2.0 + 2.0 * self.shift * math.tan(self.pressure_angle)
        return (self.module * nominal + self.thickness_allowance) / math.cos(self.helix_angle)

    @checked
    def thickness_at(self, diameter: Length) -> float:
        """Return the transverse tooth thickness on a circle of a diameter >= d_b, m; ISO 21771."""
        # Pressure angle on this circle; rounding errors may give a cosine above 1.
        angle = math.acos(min(self.base_diameter / diameter, 1.0))
        involute_difference = inv(self.transverse_pressure_angle) - inv(angle)
        return diameter * (
            self.tooth_thickness / self.reference_diameter + self.sign * involute_difference
        )

    @property
    def pitch_deviation(self) -> float:
        """Tolerance f_ptT of a single pitch, not rounded, m; ISO 1328-1:2013."""
        return self._tolerance(1e-6 * self.reference_diameter + 4e-4 * self.module + 5e-6)

    @property
    def form_deviation(self) -> float:
        """Tolerance f_falphaT of the profile form, not rounded, m; ISO 1328-1:2013."""
        return self._tolerance(5.5e-4 * self.module + 5e-6)

    def _tolerance(self, class_5_tolerance: float) -> float:
        """Return the tolerance in m for the `quality`, i.e. tolerance class, of the gear.

        It increases by a factor sqrt(2) per class from the tolerance in class 5, ISO 1328-1. Raise
        an `InputError` if the gear has no quality.
        """
        allowed = "an integer from 1 to 11, or the deviations must be given"
        checks.require(self.quality is not None, "quality", None, allowed)
        return class_5_tolerance * math.sqrt(2.0) ** (self.quality - 5)

    @property
    def mean_diameter(self) -> float:
        """Diameter (d_a + d_f) / 2 of the disc that replaces the gear in ISO 6336-1, m."""
        return (self.tip_diameter + self.root_diameter) / 2.0

    @property
    def mass(self) -> float:
        """Mass of the gear as a disc with bore and web, or of the rim of a ring gear, kg."""
        return self._mass_or_inertia(power=2, factor=math.pi / 4.0)

    @property
    def inertia(self) -> float:
        """Moment of inertia about the axis, of the same body as `mass`, kg m^2; ISO 6336-1."""
        return self._mass_or_inertia(power=4, factor=math.pi / 32.0)

    def _mass_or_inertia(self, power: int, factor: float) -> float:
        """Return factor * density * width * (outer^power - inner^power) for the gear as a ring.

        Power 2 with factor pi / 4 gives the mass in kg, power 4 with pi / 32 the moment of inertia
        in kg m^2. `outer` and `inner` are diameters in m; the toothed one is the mean of tip and
        root diameter (ISO 6336-1). The recesses beside a web are subtracted.
        """
        outer, inner = self.mean_diameter, self.bore
        if self.internal:
            allowed = f"given for the inertia of a ring gear, above {self.root_diameter:.6g} m"
            checks.require(self.outer_diameter is not None, "outer_diameter", None, allowed)
            outer, inner = self.outer_diameter, self.mean_diameter
        moment = self.width * (outer**power - inner**power)
        if self.web is not None:
            recess = self.web.rim_diameter**power - self.web.hub_diameter**power
            moment -= (self.width - self.web.thickness) * recess
        return factor * moment * self.material.density

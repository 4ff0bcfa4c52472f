"""Mesh stiffness of gears according to ISO 6336 or by the energy method.

In the first segment of a mesh period, floor(eps_alpha) + 1 tooth pairs are in contact; its length
in base pitches is eps_alpha - floor(eps_alpha). In the second segment, there is one pair fewer. If
the contact of the last pair began u base pitches ago, the mesh phase is 2 pi (u - half of the first
segment). The slices of a helical face mesh one after another, so that the stiffness is a moving
average over eps_beta base pitches. The average of a rectangle is an exact trapezoid.

In the energy method, pair i has the compliance q_i of both teeth and of their contact. The body of
a gear deflects under the loads of all pairs: a unit force on pair i moves the contact point of this
pair by f_i and those of all other pairs by g < f_i. Thus x = Q F with the matrix

    Q_ii = q_i + sum of f_i over both gears,    Q_ij = sum of g over both gears,

and C = 1^T Q^-1 1. According to finite elements (plane stress, Poisson's ratio 0.3, bores of a
fifth to two thirds of the root diameter), g is constant along the path of contact within 5 %. It
consists of the twist of the body about its bore, the deflection of a half plane, and a fitted term,
see `Tooth.shared_compliance`. The option `coupling` replaces g by coupling sqrt(f_i f_j), as in
papers: with coupling 0 the pairs do not share a body; with coupling 1 they share all of its
compliance, which halves the step of the transmission error. The default, None, means g.

Sources: Weber & Banaschek (1953), Yang & Lin, J. Mech. Transm. Autom. Des. 109 (1987) 189-196, for
the energies; Sainsot, Velex & Duverger, J. Mech. Des. 126 (2004) 748-752, for a body clamped at its
bore. Hertz contact by Yang & Sun, J. Mech. Transm. Autom. Des. 107 (1985) 529-535 (constant), or
Weber & Banaschek (1953) (logarithmic in the load).
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.geometry.gear import inv
from gearlib.models.geometry.iso import MIN_ROOT_RATIO, iso_rectangle, pair_stiffness
from gearlib.models.profiles import Rectangular, Tabulated
from gearlib.parameters import CHOICE, DrivingTorque, Fraction, Phases, checked

if TYPE_CHECKING:
    from gearlib.models.geometry.gear import SpurGear
    from gearlib.models.geometry.gear_stage import GearStage

#: Length, in base pitches, of the ramp that replaces a step of the stiffness in tables.
_RAMP_LENGTH = 1e-7

SOURCES = {
    "iso": "ISO 6336-1, method B",
    "energy": "energy method, body after Sainsot, Velex & Duverger (2004)",
    "table": "a table of one's own",
}
#: Relative uncertainty of the methods. "iso": quoted bounds of c' are +5 % and -8 %. "energy": for
#: seven gear pairs, logarithmic Hertz contact changes the mean by -8 to -21 %, and the tooth
#: stiffness from finite elements by +3 to +6 %; the beam is too compliant by 0.4 / (E b) per gear.
UNCERTAINTY = {"iso": 0.08, "energy": 0.2, "table": math.nan}
#: Number of iterations for the pair loads with logarithmic contact; each gives two digits.
_LOAD_ITERATIONS = 8
#: Gauss-Legendre quadrature; integrals over fillet and flank have 10 correct digits.
_GAUSS_NODES, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(32)

#: Coefficients of Sainsot et al.: rows L, M, P, Q; columns A ... F of the polynomial
#: A/theta^2 + B h^2 + C h/theta + D/theta + E h + F.
_BODY_COEFFICIENTS = np.array(
    [
        [-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045],
        [60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086],
        [-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236],
        [-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904],
    ]
)
#: Shared compliance of adjacent teeth of a gear without a bore, times E and face width.
_SHARED_WITHOUT_BORE = 1.0
#: Number of positions on the path at which the minimum body compliance is searched.
_BODY_POSITIONS = 33
#: Largest ratio h = r_root / r_bore of these coefficients; larger ratios are replaced by it.
MAX_ROOT_RATIO = 7.0


class Tooth:
    """Outline of a tooth of a `SpurGear`, and compliances of the tooth and of the gear body.

    In the transverse section, y is the distance from the axis of the gear along the centre line of
    the tooth, and x is half of the tooth thickness. The force at a point of the flank is tangent to
    the base circle, at an angle b to the normal of the centre line. Let phi be the tangent of the
    pressure angle at the point, which is the radius of curvature over the base radius r_b, and psi
    half the angle that the tooth subtends at the base circle. Then b = phi - psi and

        x = r_b (phi cos b - sin b),    y = r_b (cos b + phi sin b).

    For a ring gear, b = phi + psi, the sign of x is reversed, and the root is at larger y. Its
    flank is assumed to reach the root circle, and its rim to be rigid.

    The body's term in h^2 is, within 10 %, the twist of a disc between bore and root,
    (1 + nu) (h^2 - 1) / (2 pi), which does not exist without a bore. The body of a gear without a
    bore is the half plane of Cornell, J. Mech. Des. 103 (1981) 447-459, in plane stress. If `twist`
    is False, the twist is omitted, for models in which hub or shaft already include it.
    """

    def __init__(self, gear: "SpurGear", width: float, twist: bool = True) -> None:
        """Prepare the outline of a tooth of `gear` for a common face `width` in m.

        `twist` is whether the body compliance includes the twist of the body about its bore.
        """
        self.gear, self.width, self.sign, self.twist = gear, width, gear.sign, twist
        self.base_radius = gear.base_diameter / 2.0
        self.root_radius = gear.root_diameter / 2.0
        angle = inv(gear.transverse_pressure_angle)
        # Half the angle that the tooth subtends at the base circle, ISO 21771.
        self.base_half_angle = gear.tooth_thickness / gear.reference_diameter + self.sign * angle
        # Radius of curvature over base radius at the start of the involute.
        self.form_phi = gear.form_roll_length / self.base_radius
        #: x, y and quadrature weights for integrals over y, in m; None for a ring gear.
        self._fillet: Any = None
        if not gear.internal:
            # The angle gamma of the fillet ranges from the pressure angle to pi / 2.
            start = gear.transverse_pressure_angle
            half_range = (math.pi / 2.0 - start) / 2.0
            x, y, y_slope = self.fillet(start + half_range * (1.0 + _GAUSS_NODES))
            self._fillet = x, y, np.abs(y_slope) * half_range * _GAUSS_WEIGHTS

    def flank(self, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x, y in m and the angle b of the force in rad at points of the flank.

        The points are given by `phi`, the radius of curvature of the involute over the base radius.
        y is the distance from the gear axis along the centre line of the tooth, x is half of the
        tooth thickness, and b is the angle between the force and the normal of the centre line.
        """
        b = phi - self.sign * self.base_half_angle
        x = self.sign * self.base_radius * (phi * np.cos(b) - np.sin(b))
        return x, self.base_radius * (np.cos(b) + phi * np.sin(b)), b

    def fillet(self, gamma: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x, y and dy / dgamma of the fillet, in m, at points with the normal angle gamma.

        The angle gamma ranges from the pressure angle, at the flank, to pi / 2, at the root circle.
        The fillet is cut by the rounded tip of the rack, which is a circle in the normal section;
        in the transverse section it is an ellipse, stretched by 1 / cos(beta) along the rack. Its
        centre is `depth` below the rolling line and at the distance `side` from the centre line of
        the tooth.
        """
        rolling_radius = self.gear.reference_diameter / 2.0
        helix_cosine = math.cos(self.gear.helix_angle)
        gear, tip_radius, angle = self.gear, self.gear.fillet_radius, self.gear.pressure_angle
        datum_depth = gear.rack.dedendum * gear.module - tip_radius  # below the datum line
        depth = datum_depth - gear.shift * gear.module
        normal_side = math.pi / 4.0 * gear.module  # in the normal section
        normal_side = normal_side + datum_depth * math.tan(angle) + tip_radius / math.cos(angle)
        side = (normal_side + gear.thickness_allowance / 2.0) / helix_cosine
        sine, cosine = np.sin(gamma), np.cos(gamma)
        norm = np.hypot(cosine / helix_cosine, sine)  # 1 for spur gears
        # Distance from the contact to the pitch point along the normal.
        distance = (depth + tip_radius * sine / norm) / sine
        curvature_radius = tip_radius / (helix_cosine**2 * norm**3)
        contact = distance * cosine - tip_radius * cosine / (helix_cosine**2 * norm)
        rotation = (contact + side) / rolling_radius
        x = rolling_radius * np.sin(rotation) - distance * np.cos(gamma - rotation)
        y = rolling_radius * np.cos(rotation) - distance * np.sin(gamma - rotation)
        # Slopes are derivatives with respect to gamma.
        rotation_slope = (curvature_radius - distance) / (rolling_radius * sine)
        distance_slope = (curvature_radius - distance) * cosine / sine
        y_slope = -rolling_radius * np.sin(rotation) * rotation_slope
        y_slope = y_slope - distance_slope * np.sin(gamma - rotation)
        y_slope -= distance * np.cos(gamma - rotation) * (1.0 - rotation_slope)
        return x, y, y_slope

    def compliance(self, phi: ArrayLike) -> np.ndarray:
        """Return the compliance of the tooth in bending, shear and compression, m/N.

        The force acts at points of the flank given by `phi`, the radius of curvature over the base
        radius. The energy method integrates (cos b (y_F - y) - x_F sin b)^2 / (E I)
        + 1.2 cos^2 b / (G A) + sin^2 b / (E A), with A = 2 x w and I = 2/3 x^3 w, over the height y
        of fillet and flank below the force. The force acts at (x_F, y_F) at the angle b, w is the
        face width, and E and G are the moduli of elasticity and of shear.
        """
        phi = np.asarray(phi, float)
        force_x, force_y, b = (coordinate[..., None] for coordinate in self.flank(phi))
        # Gauss-Legendre points of the flank between the start of the involute and the force.
        half_range = (phi - self.form_phi)[..., None] / 2.0
        flank_phi = self.form_phi + half_range * (1.0 + _GAUSS_NODES)
        x, y, angle = self.flank(flank_phi)
        weights = np.abs(self.base_radius * flank_phi * np.cos(angle) * half_range) * _GAUSS_WEIGHTS
        if self._fillet is not None:
            fillet_x, fillet_y, fillet_weights = (
                np.broadcast_to(values, x.shape) for values in self._fillet
            )
            x, y = np.append(x, fillet_x, axis=-1), np.append(y, fillet_y, axis=-1)
            weights = np.append(weights, fillet_weights, axis=-1)
        material = self.gear.material
        bending = (np.cos(b) * self.sign * (force_y - y) - force_x * np.sin(b)) ** 2 * 1.5 / x**3
        shear = 2.4 * (1.0 + material.poisson) * np.cos(b) ** 2 / (2.0 * x)
        axial = np.sin(b) ** 2 / (2.0 * x)
        integral = ((bending + shear + axial) * weights).sum(axis=-1)
        return integral / (material.young * self.width)

    def body_compliance(self, phi: ArrayLike) -> np.ndarray:
        """Return the compliance of the gear body for forces on the flank, m/N; 0 for a ring gear.

        The force acts at points given by `phi`, the radius of curvature over the base radius. L, M,
        P, Q and u are the symbols of Sainsot et al. (2004) for bodies with a bore, and of Cornell
        (1981) for bodies without a bore.
        """
        phi = np.asarray(phi, float)
        if self._fillet is None:
            return np.zeros(phi.shape)
        b = phi - self.base_half_angle
        x, y, _ = self.fillet(math.pi / 2.0)
        theta = float(np.arctan2(x, y))  # half the angle of the tooth at the root
        if not self.gear.bore:
            # Half plane of Cornell in plane stress.
            poisson = self.gear.material.poisson
            L, M, P = 16.67 / math.pi, 2.0 * (1.0 - poisson), 1.534
            Q = 1.0 / (2.4 * (1.0 + poisson))
        else:
            # Polynomials in theta and h, fitted by Sainsot et al.
            h = self.root_radius / self._bore_radius
            powers = np.array([theta**-2, h**2, h / theta, 1.0 / theta, h, 1.0])
            L, M, P, Q = _BODY_COEFFICIENTS @ powers
        # u is the height above the root circle at which the force intersects the centre line, over
        # the tooth thickness at the root.
        u = (self.base_radius / np.cos(b) - self.root_radius) / (2.0 * self.root_radius * theta)
        shape_factor = L * u**2 + M * u + P * (1.0 + Q * np.tan(b) ** 2)
        compliance = np.cos(b) ** 2 * shape_factor
        if self.gear.bore and not self.twist:
            compliance = compliance - self._twist_compliance
        return compliance / (self.gear.material.young * self.width)

    @property
    def _bore_radius(self) -> float:
        """Radius of the bore in m, at least the smallest one covered by the body coefficients."""
        return max(self.gear.bore / 2.0, self.root_radius / MAX_ROOT_RATIO)

    @property
    def _twist_compliance(self) -> float:
        """Compliance due to the twist of the gear body about its bore, dimensionless.

        It is the arc length on the base circle per unit force on a tooth, times the modulus of
        elasticity E and the face width.
        """
        # Torsion of a disc between bore and root circle in plane stress.
        difference = 1.0 / self._bore_radius**2 - 1.0 / self.root_radius**2
        return (1.0 + self.gear.material.poisson) / math.tau * self.base_radius**2 * difference

    def shared_compliance(self, distance: int) -> float:
        """Return the deflection of a tooth's contact point per unit force on another tooth, m/N.

        Both teeth share the gear body and are `distance` teeth apart. The formula is a fit to
        finite elements for bores of at least a fifth of the root diameter, and an extrapolation for
        gears without a bore. The result is 0 for a ring gear, whose rim is assumed to be rigid.
        """
        if self._fillet is None:
            return 0.0
        if not self.gear.bore:
            # The logarithm is the deflection of a half plane.
            compliance = _SHARED_WITHOUT_BORE - 2.0 / math.pi * math.log(distance)
        else:
            root_pitch = math.tau * self.root_radius / self.gear.teeth
            ring_width = self.root_radius - self._bore_radius
            compliance = 2.0 / math.pi * math.log(ring_width / (distance * root_pitch))
            compliance += 0.78 - 0.61 * self._bore_radius / self.root_radius
            if self.twist:
                compliance += self._twist_compliance
        return compliance / (self.gear.material.young * self.width)


#: Dependence of the compliance of Hertz contact on the load.
Hertz = Annotated[Literal["constant", "logarithmic"], CHOICE]


class PairCompliance:
    """Compliances of a tooth pair along the path of contact by the energy method, m/N.

    Raises an `InputError` if a bore is too large for the method.
    """

    def __init__(self, stage: "GearStage", hertz: str = "constant", twist: Any = True) -> None:
        """Prepare the `Tooth` of both gears of a stage and check the bores.

        `hertz` is the dependence of the contact compliance on the load, "constant" or
        "logarithmic". `twist` is whether gear bodies twist about their bores, a bool or a pair of
        bools for (pinion, wheel).
        """
        self.stage, self.hertz = stage, hertz
        twists = tuple(twist) if isinstance(twist, (tuple, list)) else (twist, twist)
        if len(twists) != 2 or not all(isinstance(value, bool) for value in twists):
            raise checks.InputError("twist", twist, "one of False, True, or two of them")
        gears = zip((stage.pinion, stage.wheel), twists, strict=True)
        self._teeth = [Tooth(gear, stage.width, gear_twist) for gear, gear_twist in gears]
        for tooth, name in zip(self._teeth, ("pinion", "wheel"), strict=True):
            max_bore = tooth.gear.root_diameter / MIN_ROOT_RATIO
            allowed = f"at most {max_bore:.6g} m, root over {MIN_ROOT_RATIO}, for the energy method"
            checks.require(tooth.gear.bore <= max_bore, f"{name}.bore", tooth.gear.bore, allowed)

    def teeth_with_phi(self, position: np.ndarray) -> list[tuple[Tooth, np.ndarray]]:
        """Return [(tooth, phi), (tooth, phi)] for pinion and wheel at positions in m.

        `tooth` is a `Tooth`; phi is the radius of curvature of its flank at the contact point over
        the base radius.
        """
        curvature_radii = (position, self.stage.wheel_roll_length(position))
        teeth_with_radii = zip(self._teeth, curvature_radii, strict=True)
        return [(tooth, radius / tooth.base_radius) for tooth, radius in teeth_with_radii]

    def body_compliances(self, position: np.ndarray) -> np.ndarray:
        """Return the compliances of the bodies of (pinion, wheel) in m/N, shape (2, ...).

        `position`, shape (...), is the position of the force on the path of contact in m.
        """
        return np.array(
            [tooth.body_compliance(phi) for tooth, phi in self.teeth_with_phi(position)]
        )

    def shared_compliances(self, count: int) -> np.ndarray:
        """Return shared compliances of tooth pairs 1, 2, ..., count - 1 base pitches apart, m/N.

        A shared compliance is the deflection of one pair per unit force on another, due to the gear
        bodies that they share. It is a sum over both gears, each limited to the minimum body
        compliance on the path of contact.
        """
        positions = np.linspace(*self.stage.path, _BODY_POSITIONS)
        max_compliances = self.body_compliances(positions).min(axis=1)
        shared = np.array(
            [[tooth.shared_compliance(n) for n in range(1, count)] for tooth in self._teeth]
        )
        return np.minimum(shared.reshape(2, -1), max_compliances[:, None]).sum(axis=0)

    def contact_compliance(self, position: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the secant compliance of the Hertz contact, i.e. deflection over force, m/N.

        `position` on the path of contact in m and `force` in N have the same shape. The compliance
        does not depend on them if `self.hertz` is "constant"; else it is logarithmic in the force.
        """
        width = self.stage.width
        materials = [tooth.gear.material for tooth in self._teeth]
        compliances = [(1.0 - material.poisson**2) / material.young for material in materials]
        if self.hertz == "constant":
            return np.full(np.shape(position), 2.0 * sum(compliances) / (math.pi * width))
        teeth_with_phi = self.teeth_with_phi(position)
        pinion_radius, wheel_radius = [phi * tooth.base_radius for tooth, phi in teeth_with_phi]
        # The flank of a ring gear is concave, with sign -1.
        curvature = 1.0 / pinion_radius + self.stage.wheel.sign / wheel_radius
        half_width = np.sqrt(4.0 * force * sum(compliances) / (math.pi * width * curvature))
        contact_compliance = np.zeros(np.shape(position))
        for (tooth, phi), compliance in zip(teeth_with_phi, compliances, strict=True):
            x, _, b = tooth.flank(phi)
            poisson = tooth.gear.material.poisson
            # The force intersects the centre line of the tooth at the depth x / cos(b).
            depth_ratio = 2.0 * x / np.cos(b) / half_width
            factor = np.log(depth_ratio) - poisson / (2.0 * (1.0 - poisson))
            contact_compliance = contact_compliance + 2.0 * compliance / (math.pi * width) * factor
        return contact_compliance


def compliance_matrices(pair, positions, forces, coupling=None) -> np.ndarray:
    """Return the compliance matrices Q of k tooth pairs at n phases in m/N, shape (n, k, k).

    `pair` is a `PairCompliance`. `positions` on the path of contact in m and `forces` in N have the
    shape (n, k). Off-diagonal entries are the shared compliances of two pairs: a fit to finite
    elements if `coupling` is None, else coupling sqrt(f_i f_j), where f_i is the body compliance of
    a gear under pair i and `coupling` is from 0 to 1.
    """
    (pinion_tooth, pinion_phi), (wheel_tooth, wheel_phi) = pair.teeth_with_phi(positions)
    pair_compliance = pinion_tooth.compliance(pinion_phi) + wheel_tooth.compliance(wheel_phi)
    pair_compliance = pair_compliance + pair.contact_compliance(positions, forces)
    body_compliances = pair.body_compliances(positions)
    diagonal = pair_compliance + body_compliances.sum(axis=0)
    count = positions.shape[1]
    if coupling is None:
        # Index n of `shared` belongs to pairs that are n base pitches apart.
        shared = np.append(0.0, pair.shared_compliances(count))
        pair_indices = np.arange(count)
        distances = np.abs(pair_indices[:, None] - pair_indices)
        matrix = np.tile(shared[distances], (len(diagonal), 1, 1))
    else:
        roots = np.sqrt(body_compliances)
        matrix = coupling * np.einsum("gnk,gnl->nkl", roots, roots)  # sum over gears g
    np.einsum("nkk->nk", matrix)[:] = diagonal
    return matrix


@checked
def energy_stiffness(
    stage,
    pitches,
    count,
    *,
    coupling: Fraction | None = None,
    hertz: Hertz = "constant",
    torque: DrivingTorque | None = None,
    twist=True,
):
    """Return the mesh stiffness of `count` tooth pairs by the energy method, N/m, shape (n,).

    `pitches`, shape (n,), are base pitches since the start of contact of the last pair; the pairs
    are one base pitch apart. `coupling` is the fraction of the body compliance that all pairs
    share, by default a fit to finite elements. `hertz` is the dependence of the contact compliance
    on the load: "constant", or "logarithmic", which needs the pinion `torque` in N m. `twist` is
    whether gear bodies twist about their bores, a bool or one for each gear.
    """
    pair = PairCompliance(stage, hertz, twist)
    allowed = "a finite number > 0 where hertz is 'logarithmic'"
    checks.require(torque or hertz == "constant", "torque", torque, allowed)
    # Positions on the path of contact in m, and forces, which are initially equal.
    positions = stage.path[0] + (pitches[:, None] + np.arange(count)) * stage.base_pitch
    load = stage.load(torque or 1.0)
    forces = np.full(positions.shape, load / count)
    # Only logarithmic contact depends on the load sharing.
    iterations = _LOAD_ITERATIONS if hertz == "logarithmic" else 1
    for _ in range(iterations):
        compliance = compliance_matrices(pair, positions, forces, coupling)
        pair_stiffness = np.linalg.solve(compliance, np.ones((*positions.shape, 1)))[..., 0]
        mesh_stiffness = pair_stiffness.sum(axis=1)
        # Logarithmic contact needs positive forces.
        forces = np.maximum(pair_stiffness / mesh_stiffness[:, None], 1e-6) * load
    return mesh_stiffness


@dataclass(frozen=True)
class MeshStiffness:
    """Mesh stiffness as a rectangle, for `GearPair`, and as a profile, for `OneDegreePair`."""

    method: str  #: "iso", "energy" or "table"
    max_stiffness: float  #: C_max, N/m
    stiffness_ratio: float  #: kappa
    contact_ratio: float  #: epsilon of the rectangle, from 1 to 2
    profile: Rectangular | Tabulated  #: stiffness over the mesh phase

    @property
    def source(self):
        """Source of the method."""
        return SOURCES[self.method]

    @property
    def uncertainty(self):
        """Relative uncertainty of the method, NaN if unknown."""
        return UNCERTAINTY[self.method]

    @property
    def mean_stiffness(self):
        """Mean mesh stiffness C_s, N/m, Eq. (2)."""
        return self.max_stiffness * mean_over_max(self.contact_ratio, self.stiffness_ratio)

    def ratios(self) -> dict[str, float]:
        """Return max_stiffness, stiffness_ratio and contact_ratio as arguments of a `GearPair`."""
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio")
        return {name: getattr(self, name) for name in names}


@checked
def mesh_stiffness(
    stage: "GearStage", method: str | Tabulated = "iso", *, samples: Phases = 64, **options: Any
) -> MeshStiffness:
    """Compute the mesh stiffness and its equivalent rectangle.

    Parameters
    ----------
    stage : GearStage
        Geometry of both gears.
    method : {"iso", "energy"} or Tabulated, default "iso"
        "iso": the first tooth pair has the stiffness c' of ISO 6336-1, each further pair 0.75 c',
        so that the mean is c_gamma_alpha. "energy": energy method; the levels of the rectangle are
        the means of both segments. The rectangle of a table has its extrema and its mean.
    samples : int, default 64
        Number of phases for the energy method, >= 8.
    torque : float, optional
        Torque of the pinion, N m; needed by "iso" at low load and by the logarithmic contact.
    application_factor : float, default 1
        Application factor K_A for "iso".
    coupling : float, optional
        For "energy", the fraction of the gear bodies' compliance that all tooth pairs share, from 0
        to 1; by default a compliance that is fitted to finite elements.
    twist : bool or pair of bool, default True
        Whether "energy" includes the twist of gear bodies about their bores, for both gears or for
        (pinion, wheel). The twist is a spring in series: it increases kappa, but does not change
        load sharing and the step of the transmission error. ISO 6336 does not include it.
    hertz : {"constant", "logarithmic"}, default "constant"
        Dependence of the contact compliance on the load for "energy".

    Returns
    -------
    MeshStiffness
        Profile of the stiffness and its rectangle.

    Raises
    ------
    ValueError
        If the method or an option is not allowed.
    """
    checks.check_gear_stage(stage)
    if isinstance(method, Tabulated):
        checks.check_parameter_names("table", options, ("torque",))
        return _make_table_stiffness("table", method)
    if not checks.is_one_of(method, ("iso", "energy")):
        raise checks.InputError("stiffness", method, "'iso', 'energy' or a Tabulated")
    fewer_pairs = math.floor(stage.contact_ratio)
    segment = stage.contact_ratio - fewer_pairs  # fraction of the period with one more pair
    if method == "iso":
        max_stiffness, kappa, epsilon = iso_rectangle(stage, **options)
        if stage.overlap_ratio == 0.0:
            return MeshStiffness(method, max_stiffness, kappa, epsilon, Rectangular())
        single = pair_stiffness(stage, **options)
        levels = [single * (0.25 + 0.75 * count) for count in (fewer_pairs + 1, fewer_pairs)]
        curve = _StiffnessCurve([0.0, segment, segment, 1.0], np.repeat(levels, 2))
        table = curve.face_average(stage.overlap_ratio).to_table(segment)
        return MeshStiffness(method, max_stiffness, kappa, epsilon, table)
    checks.check_parameter_names(
        "stiffness 'energy'", options, ("torque", "coupling", "hertz", "twist")
    )
    curve, means = _compute_energy_curve(stage, fewer_pairs, segment, samples, options)
    if stage.overlap_ratio > 0.0:
        table = curve.face_average(stage.overlap_ratio).to_table(segment)
        return _make_table_stiffness(method, table)
    profile = curve.to_table(segment)
    return MeshStiffness(method, means[0], means[1] / means[0], 1.0 + segment, profile)


def _compute_energy_curve(stage, fewer_pairs, segment, samples, options):
    """Compute the mesh stiffness by the energy method; return (curve, means of both segments).

    The curve is a `_StiffnessCurve` over one base pitch with about `samples` points; the means are
    in N/m. In the first segment, from 0 to `segment` base pitches, `fewer_pairs` + 1 tooth pairs
    are in contact; in the second segment, up to 1, `fewer_pairs`. `options` is a dict of options of
    `energy_stiffness`, such as the torque.
    """
    pitches, stiffnesses, means = [], [], []
    for start, end, count in ((0.0, segment, fewer_pairs + 1), (segment, 1.0, fewer_pairs)):
        # For a short segment, five points give an accurate mean.
        point_count = max(5, round(samples * (end - start)))
        pitches.append(np.linspace(start, end, point_count))
        # If the contact ratio is below 1, there are phases without contact in a slice.
        stiffness = energy_stiffness(stage, pitches[-1], count, **options) if count else 0.0
        stiffnesses.append(np.broadcast_to(stiffness, point_count))
        means.append(float(np.trapezoid(stiffnesses[-1], np.linspace(0.0, 1.0, point_count))))
    return _StiffnessCurve(np.concatenate(pitches), np.concatenate(stiffnesses)), means


def _make_table_stiffness(method: str, table: Tabulated) -> MeshStiffness:
    """Make the `MeshStiffness` of a table; its rectangle has the extrema and the mean of the table.

    `method` is the name of the method that computed the table, or "table".
    """
    max_stiffness, kappa, epsilon = table.ratios()
    if 1.0 - kappa < 1e-12:
        # For an integer overlap ratio, the stiffness is constant; epsilon is then arbitrary.
        kappa, epsilon = 1.0, 1.5
    return MeshStiffness(method, max_stiffness, kappa, epsilon, table)


class _StiffnessCurve:
    """Mesh stiffness over one base pitch, linear between points; two equal positions are a step."""

    def __init__(self, pitches: ArrayLike, stiffness: ArrayLike) -> None:
        """Store ascending positions from 0 to 1 base pitch and the stiffness there in N/m."""
        self.pitches, self.stiffness = np.asarray(pitches, float), np.asarray(stiffness, float)
        # Integrals up to each position, exact for a piecewise linear curve.
        areas = np.diff(self.pitches) * (self.stiffness[1:] + self.stiffness[:-1]) / 2.0
        self._cumulative_areas = np.append(0.0, np.cumsum(areas))

    def integrate(self, end: np.ndarray) -> np.ndarray:
        """Integrate the stiffness from position 0 to `end`, in N/m times base pitches.

        `end`, in base pitches, may be outside [0, 1], because the stiffness is periodic.
        """
        periods = np.floor(end)
        position = end - periods
        # Index of the interval that contains the position; at a step its length is 0.
        i = np.searchsorted(self.pitches, position, side="right") - 1
        i = np.clip(i, 0, self.pitches.size - 2)
        length = self.pitches[i + 1] - self.pitches[i]
        slope = (self.stiffness[i + 1] - self.stiffness[i]) / np.where(length > 0.0, length, 1.0)
        distance = position - self.pitches[i]
        area = distance * (self.stiffness[i] + slope * distance / 2.0)
        return periods * self._cumulative_areas[-1] + (self._cumulative_areas[i] + area)

    def face_average(self, overlap_ratio: float) -> "_StiffnessCurve":
        """Return the moving average over `overlap_ratio` base pitches, i.e. over a helical face.

        The result is again linear between points; it is exact if the stiffness is rectangular.
        """
        half_window = overlap_ratio / 2.0
        # The average has kinks where the averaging window begins or ends at a step.
        step_positions = self.pitches[1:][np.diff(self.pitches) == 0.0]
        is_step = np.isin(self.pitches, [0.0, 1.0, *step_positions])
        steps = self.pitches[is_step]
        positions = [self.pitches[~is_step], steps - half_window, steps + half_window]
        positions = np.sort(np.concatenate(positions) % 1.0)
        # Merge positions that differ only by rounding errors.
        positions = positions[np.diff(positions, append=positions[0] + 1.0) > 1e-12]
        areas = self.integrate(positions + half_window) - self.integrate(positions - half_window)
        return _StiffnessCurve(positions, areas / overlap_ratio)

    def to_table(self, segment: float) -> Tabulated:
        """Convert the curve to a `Tabulated` over the mesh phase; steps become short ramps.

        The mesh phase is 0 in the middle of the first segment, which ends at `segment` base pitches
        and has more tooth pairs in contact.
        """
        # The phases of a table must be distinct, so the second of two equal positions is moved.
        pitches = self.pitches.copy()
        if pitches[-1] == 1.0:
            pitches[-1] -= _RAMP_LENGTH
        steps = np.nonzero(np.diff(pitches) == 0.0)[0] + 1
        pitches[steps] += _RAMP_LENGTH
        distinct = np.concatenate([[True], np.diff(pitches) > 0.0])
        phase = math.tau * ((pitches[distinct] - segment / 2.0) % 1.0)
        # A phase slightly below 0 may be rounded to 2 pi, i.e. phase 0 of the next period.
        phase, order = np.unique(np.where(phase < math.tau, phase, 0.0), return_index=True)
        return Tabulated(phase, self.stiffness[distinct][order])

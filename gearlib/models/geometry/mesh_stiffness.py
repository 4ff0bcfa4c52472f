"""Mesh stiffness of drawn gears by ISO 6336 or by the energy method.

In a mesh period, floor(eps_alpha) + 1 pairs of teeth touch in a segment of the length eps_alpha -
floor(eps_alpha), and one pair less in the other segment. A position u in base pitches after the
start of contact of the last pair has the mesh phase 2 pi (u - half of the first segment). The
slices of the face of a helical gear mesh one after another, so that its stiffness is an average
over the overlap ratio eps_beta. The average of a rectangle is an exact trapezoid.

In the energy method, pair i has the compliance q_i of both teeth and of their contact. The body of
a gear deflects under the loads of all pairs: the force F_j of another pair moves the contact point
of pair i by coupling sqrt(f_i f_j) F_j, with the compliances f of the body alone. So x = Q F with

    Q = diag(q) + sum over both gears of diag(f) (1 - coupling) + coupling sqrt(f) sqrt(f)^T,

and C = 1^T Q^-1 1. Coupling 1, the default, counts the body once. Coupling 0 gives each pair a
separate body, as many papers do, which counts the body twice in double contact.

Sources: Weber & Banaschek (1953), Yang & Lin, J. Mech. Transm. Autom. Des. 109 (1987) 189-196, for
the energies; Sainsot, Velex & Duverger, J. Mech. Des. 126 (2004) 748-752, for a body clamped at its
bore. Hertz contact by Yang & Sun, J. Mech. Transm. Autom. Des. 107 (1985) 529-535 (constant), or
Weber & Banaschek (1953) (logarithmic in the load).
"""

import math
from dataclasses import dataclass

import numpy as np

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.geometry.gear import inv
from gearlib.models.geometry.iso import iso_rectangle, pair_stiffness
from gearlib.models.profiles import Rectangular, Tabulated

#: Length, in base pitches, of the ramp that replaces a step of the stiffness in a table.
_RAMP_LENGTH = 1e-7

SOURCES = {
    "iso": "ISO 6336-1, method B",
    "energy": "energy method, body after Sainsot, Velex & Duverger (2004)",
    "table": "a table of one's own",
}
#: Relative uncertainty of the methods. "iso": quoted bounds of c' are +5 % and -8 %. "energy": the
#: models of contact and body differ; for four drawn pairs a logarithmic contact changes the mean by
#: -12 to -20 %, a separate body for each pair by +23 to +30 %.
UNCERTAINTY = {"iso": 0.08, "energy": 0.25, "table": math.nan}
#: Iterations of the loads of pairs with logarithmic contact; each adds two digits.
_LOAD_ITERATIONS = 8
#: Gauss-Legendre quadrature, with 10 digits in integrals over fillet and flank.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)

#: Coefficients of Sainsot et al.: rows L, M, P, Q and columns A ... F of the polynomial
#: A/theta^2 + B h^2 + C h/theta + D/theta + E h + F.
_BODY_COEFFICIENTS = np.array(
    [
        [-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045],
        [60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086],
        [-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236],
        [-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904],
    ]
)
#: Range of the ratio h = r_root / r_bore of these coefficients; larger ratios count as the largest.
MIN_ROOT_RATIO, MAX_ROOT_RATIO = 1.4, 7.0


class Tooth:
    """Outline of a tooth of a `SpurGear`, and compliances of the tooth and of the gear body.

    In the transverse section, y is the distance from the axis of the gear along the centre line of
    the tooth, and x is half of the tooth thickness. The force at a point of the flank is tangent to
    the base circle, at an angle b to the normal of the centre line. With phi = tan(pressure angle
    at the point), which is the radius of curvature over r_b, and half the angle psi of the tooth at
    the base circle, b = phi - psi and

        x = r_b (phi cos b - sin b),    y = r_b (cos b + phi sin b).

    A tooth of a ring gear has b = phi + psi, the opposite x, and its root at larger y; its flank is
    assumed to reach the root circle, and its rim to be rigid.

    The term in h^2 of the body is, within 10 %, the torsion of a disc between bore and root,
    (1 + nu) (h^2 - 1) / (2 pi), which makes no sense without a bore. The body of a gear without a
    bore is the half plane of Cornell, J. Mech. Des. 103 (1981) 447-459, in plane stress.
    """

    def __init__(self, gear, width):
        """Prepare the outline of a tooth of a `SpurGear` with a face width in m."""
        self.gear, self.width, self.sign = gear, width, gear.sign
        self.base = gear.base_diameter / 2.0
        self.root = gear.root_diameter / 2.0
        angle = inv(gear.transverse_pressure_angle)
        # Half the angle of the tooth at the base circle, ISO 21771.
        self.psi = gear.tooth_thickness / gear.reference_diameter + self.sign * angle
        self.foot = gear.form_roll_length / self.base
        self._fillet = self._trochoid() if not gear.internal else None

    def flank(self, phi):
        """Return x, y and the angle b of the force at phi = radius of curvature / r_b."""
        b = phi - self.sign * self.psi
        x = self.sign * self.base * (phi * np.cos(b) - np.sin(b))
        return x, self.base * (np.cos(b) + phi * np.sin(b)), b

    def fillet(self, gamma):
        """Return x, y and dy / dgamma of the fillet where the normal has an angle gamma.

        The tip of the rack cuts the fillet. The centre of its round lies `depth` below the rolling
        line and `side` from the centre line of the tooth. The round is a circle in the normal
        section, and for helical gears an ellipse in the transverse section, longer by 1 / cos(beta)
        along the rack. The angle gamma goes from the pressure angle, at the flank, to pi / 2.
        """
        rolling, helix = self.gear.reference_diameter / 2.0, math.cos(self.gear.helix_angle)
        depth, side, tip_radius = self._rack_tip
        sine, cosine = np.sin(gamma), np.cos(gamma)
        norm = np.hypot(cosine / helix, sine)
        # Distance from the contact along the normal to the pitch point, and radius of curvature.
        distance = (depth + tip_radius * sine / norm) / sine
        curvature_radius = tip_radius / (helix**2 * norm**3)
        contact = distance * cosine - tip_radius * cosine / (helix**2 * norm)
        rotation = (contact + side) / rolling
        x = rolling * np.sin(rotation) - distance * np.cos(gamma - rotation)
        y = rolling * np.cos(rotation) - distance * np.sin(gamma - rotation)
        rotation_slope = (curvature_radius - distance) / (rolling * sine)
        distance_slope = (curvature_radius - distance) * cosine / sine
        slope = -rolling * np.sin(rotation) * rotation_slope
        slope = slope - distance_slope * np.sin(gamma - rotation)
        slope -= distance * np.cos(gamma - rotation) * (1.0 - rotation_slope)
        return x, y, slope

    @property
    def _rack_tip(self):
        """Depth and side of the centre of the tip round of the rack, and its radius, m."""
        gear, helix = self.gear, math.cos(self.gear.helix_angle)
        radius, angle = gear.fillet_radius, gear.pressure_angle
        depth = gear.rack.dedendum * gear.module - radius  # below the datum line of the rack
        side = math.pi / 4.0 * gear.module + depth * math.tan(angle) + radius / math.cos(angle)
        side += gear.thickness_allowance / 2.0
        return depth - gear.shift * gear.module, side / helix, radius

    def _trochoid(self):
        """Return x, y and the integration weights over y at points of the fillet."""
        start, end = self.gear.transverse_pressure_angle, math.pi / 2.0
        half = (end - start) / 2.0
        x, y, slope = self.fillet(start + half * (1.0 + _NODES))
        return x, y, np.abs(slope) * half * _WEIGHTS

    def compliance(self, phi):
        """Return the compliance of the tooth in bending, shear and compression at phi, m/N.

        The energy method integrates (cos b (y_F - y) - x_F sin b)^2 / (E I) + 1.2 cos^2 b / (G A) +
        sin^2 b / (E A), with A = 2 x w and I = 2/3 x^3 w, over the height of fillet and flank below
        the force at (x_F, y_F).
        """
        phi = np.asarray(phi, float)
        force_x, force_y, b = (value[..., None] for value in self.flank(phi))
        half = (phi - self.foot)[..., None] / 2.0
        nodes = self.foot + half * (1.0 + _NODES)
        x, y, angle = self.flank(nodes)
        weights = np.abs(self.base * nodes * np.cos(angle) * half) * _WEIGHTS
        if self._fillet is not None:
            both = zip((x, y, weights), self._fillet, strict=True)
            x, y, weights = (np.append(a, np.broadcast_to(c, a.shape), axis=-1) for a, c in both)
        material = self.gear.material
        bending = (np.cos(b) * self.sign * (force_y - y) - force_x * np.sin(b)) ** 2 * 1.5 / x**3
        shear = 2.4 * (1.0 + material.poisson) * np.cos(b) ** 2 / (2.0 * x)
        axial = np.sin(b) ** 2 / (2.0 * x)
        total = ((bending + shear + axial) * weights).sum(axis=-1)
        return total / (material.young * self.width)

    def body(self, phi):
        """Return the compliance of the gear body for forces at phi, m/N; 0 for a ring gear."""
        phi = np.asarray(phi, float)
        if self._fillet is None:
            return np.zeros(phi.shape)
        b = phi - self.psi
        theta, h = self.body_shape
        if h is None:
            poisson = self.gear.material.poisson
            L, M, P = 16.67 / math.pi, 2.0 * (1.0 - poisson), 1.534
            Q = 1.0 / (2.4 * (1.0 + poisson))
        else:
            powers = np.array([theta**-2, h**2, h / theta, 1.0 / theta, h, 1.0])
            L, M, P, Q = _BODY_COEFFICIENTS @ powers
        # Height above the root circle where the force meets the centre line, over the root width.
        u = (self.base / np.cos(b) - self.root) / (2.0 * self.root * theta)
        shape = L * u**2 + M * u + P * (1.0 + Q * np.tan(b) ** 2)
        return np.cos(b) ** 2 * shape / (self.gear.material.young * self.width)

    @property
    def body_shape(self):
        """Half the angle of the tooth at its root, rad, and r_root / r_bore or None."""
        x, y, _ = self.fillet(math.pi / 2.0)
        bore = self.gear.bore / 2.0
        return float(np.arctan2(x, y)), min(self.root / bore, MAX_ROOT_RATIO) if bore else None


class PairCompliance:
    """Compliances of a pair of teeth by the energy method along the path of contact, m/N.

    Raises ValueError if a bore is too large for the method.
    """

    def __init__(self, mesh, hertz="constant"):
        """Prepare both teeth of a drawn mesh and check their bores."""
        self.mesh, self.hertz = mesh, checks.one_of("hertz", hertz, ("constant", "logarithmic"))
        self._teeth = [Tooth(gear, mesh.width) for gear in (mesh.pinion, mesh.wheel)]
        for tooth, name in zip(self._teeth, ("pinion", "wheel"), strict=True):
            limit = 2.0 * tooth.root / MIN_ROOT_RATIO
            if tooth.gear.bore > limit:
                raise ValueError(
                    f"bore of the {name} = {tooth.gear.bore!r} is not allowed: the energy method "
                    f"holds for at most {limit:.6g} m, root over {MIN_ROOT_RATIO}"
                )

    def _roll_angles(self, position):
        """Return the radii of curvature over r_b of both flanks that touch at a position."""
        lengths = (position, self.mesh.wheel_roll_length(position))
        return [length / tooth.base for length, tooth in zip(lengths, self._teeth, strict=True)]

    def teeth(self, position):
        """Return the compliance of both teeth without bodies at positions on the path, m/N."""
        rolls = zip(self._teeth, self._roll_angles(position), strict=True)
        return sum(tooth.compliance(roll) for tooth, roll in rolls)

    def bodies(self, position):
        """Return the compliances of both gear bodies at positions on the path, (2, ...), m/N."""
        rolls = zip(self._teeth, self._roll_angles(position), strict=True)
        return np.array([tooth.body(roll) for tooth, roll in rolls])

    def contact(self, position, force):
        """Return the secant compliance of the Hertz contact under a force in N, m/N."""
        width = self.mesh.width
        materials = [tooth.gear.material for tooth in self._teeth]
        compliances = [(1.0 - material.poisson**2) / material.young for material in materials]
        if self.hertz == "constant":
            return np.full(np.shape(position), 2.0 * sum(compliances) / (math.pi * width))
        rolls = self._roll_angles(position)
        radii = [roll * tooth.base for roll, tooth in zip(rolls, self._teeth, strict=True)]
        # The flank of a ring gear is concave.
        curvature = 1.0 / radii[0] + self.mesh.wheel.sign / radii[1]
        half_width = np.sqrt(4.0 * force * sum(compliances) / (math.pi * width * curvature))
        total = 0.0
        for tooth, roll, compliance in zip(self._teeth, rolls, compliances, strict=True):
            x, _, b = tooth.flank(roll)
            poisson = tooth.gear.material.poisson
            depth = np.log(2.0 * x / np.cos(b) / half_width) - poisson / (2.0 * (1.0 - poisson))
            total = total + 2.0 * compliance / (math.pi * width) * depth
        return total


def compliance_matrix(pair, positions, forces, coupling):
    """Return the matrices Q, (n, k, k), m/N, of k pairs of teeth at n phases by the energy method.

    `pair` is a `PairCompliance`; positions in m and forces in N have the shape (n, k).
    """
    single = pair.teeth(positions) + pair.contact(positions, forces)
    bodies = pair.bodies(positions)
    single = single + (1.0 - coupling) * bodies.sum(axis=0)
    root = np.sqrt(bodies)
    common = np.einsum("gnk,gnl->nkl", root, root) * coupling
    return common + single[..., None] * np.eye(positions.shape[1])


def energy_stiffness(mesh, pitches, count, *, coupling=1.0, hertz="constant", torque=None):
    """Return the mesh stiffness of `count` pairs of teeth by the energy method, N/m, shape (n,).

    `pitches`, shape (n,), are base pitches since the start of contact of the last pair; the pairs
    are one base pitch apart. `hertz` is "constant" or "logarithmic", which needs the torque of the
    pinion in N m.
    """
    pair = PairCompliance(mesh, hertz)
    coupling = checks.number("coupling", coupling, "from 0 to 1", lambda v: 0.0 <= v <= 1.0)
    if hertz == "logarithmic" or torque is not None:
        torque = checks.finite_positive("torque", torque)
    positions = mesh.path[0] + (pitches[:, None] + np.arange(count)) * mesh.base_pitch
    load = mesh.load(torque or 1.0)
    forces = np.full(positions.shape, load / count)
    for _ in range(_LOAD_ITERATIONS if hertz == "logarithmic" else 1):
        compliance = compliance_matrix(pair, positions, forces, coupling)
        stiffness = np.linalg.solve(compliance, np.ones((*positions.shape, 1)))[..., 0]
        total = stiffness.sum(axis=1)
        # The logarithmic law needs a positive force, even for a pair that would pull.
        forces = np.maximum(stiffness / total[:, None], 1e-6) * load
    return total


@dataclass(frozen=True)
class MeshStiffness:
    """A mesh stiffness, for `GearPair` as a rectangle and for `OneDegreePair` as a profile."""

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

    def ratios(self):
        """Return max_stiffness, stiffness_ratio and contact_ratio as arguments of a `GearPair`."""
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio")
        return {name: getattr(self, name) for name in names}


def mesh_stiffness(mesh, method="iso", *, samples=64, **options):
    """Return the mesh stiffness of two drawn gears by a method.

    Parameters
    ----------
    mesh : Mesh
        The drawn gears.
    method : {"iso", "energy"} or Tabulated, default "iso"
        "iso": the first pair of teeth has the stiffness c' of ISO 6336-1, each further pair
        0.75 c', so that the mean is c_gamma_alpha. "energy": energy method; the rectangle has the
        mean of each segment. The rectangle of a table has its extrema and its mean.
    samples : int, default 64
        Number of phases for the energy method, >= 8.
    torque : float, optional
        Torque of the pinion, N m; needed by "iso" at low load and by the logarithmic contact.
    application_factor : float, default 1
        Application factor K_A for "iso".
    coupling : float, default 1
        Common share of the gear bodies for "energy", from 0 to 1.
    hertz : {"constant", "logarithmic"}, default "constant"
        Law of the Hertz contact for "energy".

    Returns
    -------
    MeshStiffness
        Profile of the stiffness and its rectangle.

    Raises
    ------
    ValueError
        If the method or an option is not allowed.
    """
    checks.drawn_mesh(mesh)
    if isinstance(method, Tabulated):
        checks.known("table", options, ("torque",))
        return _stiffness_of_table("table", method)
    if method not in ("iso", "energy"):
        raise checks.refusal("stiffness", method, "'iso', 'energy' or a Tabulated")
    fewer_pairs = math.floor(mesh.contact_ratio)
    segment = mesh.contact_ratio - fewer_pairs
    if method == "iso":
        high, ratio, contact = iso_rectangle(mesh, **options)
        if mesh.overlap_ratio == 0.0:
            return MeshStiffness(method, high, ratio, contact, Rectangular())
        single = pair_stiffness(mesh, **options)
        levels = [single * (0.25 + 0.75 * count) for count in (fewer_pairs + 1, fewer_pairs)]
        curve = _StiffnessCurve([0.0, segment, segment, 1.0], np.repeat(levels, 2))
        table = curve.face_average(mesh.overlap_ratio).table(segment)
        return MeshStiffness(method, high, ratio, contact, table)
    checks.known("stiffness 'energy'", options, ("torque", "coupling", "hertz"))
    curve, means = _energy_curve(mesh, fewer_pairs, segment, samples, options)
    if mesh.overlap_ratio > 0.0:
        table = curve.face_average(mesh.overlap_ratio).table(segment)
        return _stiffness_of_table(method, table)
    profile = curve.table(segment)
    return MeshStiffness(method, means[0], means[1] / means[0], 1.0 + segment, profile)


def _energy_curve(mesh, fewer_pairs, segment, samples, options):
    """Return the stiffness curve by the energy method, and its mean in both segments, N/m.

    The first segment, from 0 to `segment` base pitches, has one pair of teeth more than the other.
    """
    samples = checks.integer("samples", samples, 8, 100_000)
    pitches, values, means = [], [], []
    for start, end, count in ((0.0, segment, fewer_pairs + 1), (segment, 1.0, fewer_pairs)):
        # Five points are enough for the mean of a parabola in a short segment.
        n = max(5, round(samples * (end - start)))
        pitches.append(np.linspace(start, end, n))
        values.append(energy_stiffness(mesh, pitches[-1], count, **options))
        means.append(float(np.trapezoid(values[-1], np.linspace(0.0, 1.0, n))))
    return _StiffnessCurve(np.concatenate(pitches), np.concatenate(values)), means


def _stiffness_of_table(method, table):
    """Return the `MeshStiffness` with a table as profile and its equivalent rectangle."""
    high, ratio, contact = table.ratios()
    if 1.0 - ratio < 1e-12:  # constant up to rounding, as with a whole overlap ratio
        ratio, contact = 1.0, 1.5
    return MeshStiffness(method, high, ratio, contact, table)


class _StiffnessCurve:
    """A stiffness over one base pitch, linear between points; equal positions make a step."""

    def __init__(self, pitches, values):
        """Store positions in base pitches, from 0 to 1, and the stiffness there, N/m."""
        self.pitches, self.values = np.asarray(pitches, float), np.asarray(values, float)
        areas = np.diff(self.pitches) * (self.values[1:] + self.values[:-1]) / 2.0
        self._areas = np.append(0.0, np.cumsum(areas))

    def integral(self, end):
        """Return the integral from 0 to positions in base pitches, continued periodically."""
        whole = np.floor(end)
        fraction = end - whole
        last = self.pitches.size - 2
        i = np.clip(np.searchsorted(self.pitches, fraction, side="right") - 1, 0, last)
        length = self.pitches[i + 1] - self.pitches[i]
        slope = (self.values[i + 1] - self.values[i]) / np.where(length > 0.0, length, 1.0)
        distance = fraction - self.pitches[i]
        area = self._areas[i] + distance * (self.values[i] + slope * distance / 2.0)
        return whole * self._areas[-1] + area

    def face_average(self, overlap):
        """Return the moving average over `overlap` base pitches as a curve.

        It is exact if the stiffness is rectangular.
        """
        half = overlap / 2.0
        # The average has a corner where a window begins or ends at a step.
        step = np.isin(self.pitches, [0.0, 1.0, *self.pitches[1:][np.diff(self.pitches) == 0.0]])
        corners = self.pitches[step]
        points = np.concatenate([self.pitches[~step], corners - half, corners + half])
        points = np.sort(points % 1.0)
        # Points that coincide up to rounding count as equal.
        points = points[np.diff(points, append=points[0] + 1.0) > 1e-12]
        integrals = self.integral(points + half) - self.integral(points - half)
        return _StiffnessCurve(points, integrals / overlap)

    def table(self, segment):
        """Return the stiffness over the mesh phase as a table; a step becomes a short ramp."""
        pitches, values = self.pitches.copy(), self.values
        if pitches[-1] == 1.0:
            pitches[-1] -= _RAMP_LENGTH
        steps = np.nonzero(np.diff(pitches) == 0.0)[0] + 1
        pitches[steps] += _RAMP_LENGTH
        rising = np.concatenate([[True], np.diff(pitches) > 0.0])
        phase = math.tau * ((pitches[rising] - segment / 2.0) % 1.0)
        # A phase just below 0 rounds to 2 pi, which is 0.
        phase, order = np.unique(np.where(phase < math.tau, phase, 0.0), return_index=True)
        return Tabulated(phase, values[rising][order])

"""Mesh stiffness of drawn gears: by ISO 6336 or the energy method, and what a model takes of it.

Over a mesh period, floor(eps_alpha) + 1 pairs touch on the segment eps_alpha - floor(eps_alpha),
one pair less on the rest. A position u in base pitches after the start of contact of the last pair
has the mesh phase 2 pi (u - half of that segment). The stiffness of a helical gear is the average
of that course over the overlap ratio eps_beta, because the slices of the face are in mesh one after
another: of the rectangle an exact trapezoid.

In the energy method a pair of teeth i has the compliance q_i of both teeth and of their contact.
The body of a gear yields to the loads of all pairs: under the force F_j of another pair, the point
of pair i moves by coupling sqrt(f_i f_j) F_j, with the compliances f of the body by itself. So
x = Q F with

    Q = diag(q) + sum over both gears of diag(f) (1 - coupling) + coupling sqrt(f) sqrt(f)^T,

and C = 1^T Q^-1 1. Coupling 1, the default, counts the body once; 0 gives each pair a body of its
own, which counts it twice in double contact, as many papers do.

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

#: Phase, in base pitches, that a step of the stiffness takes in a table, where it has to be a ramp.
_RAMP = 1e-7

SOURCES = {
    "iso": "ISO 6336-1, method B",
    "energy": "energy method, body after Sainsot, Velex & Duverger (2004)",
    "table": "a table of one's own",
}
#: Relative. "iso": the bounds quoted for its c', +5 % and -8 %. "energy": what contact and body
#: leave open; of four drawn pairs a logarithmic contact moves the mean by -12 to -20 %, a body for
#: each pair by +23 to +30 %.
UNCERTAINTY = {"iso": 0.08, "energy": 0.25, "table": math.nan}
#: Repetitions that settle the loads of pairs under the logarithmic law; each wins two digits.
_LOAD_REPEATS = 8
#: Nodes of Gauss and Legendre: integrals over fillet and flank have 10 digits.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)

#: Rows L, M, P, Q and columns A ... F of X = A/th^2 + B h^2 + C h/th + D/th + E h + F, Sainsot.
_BODY = np.array(
    [
        [-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045],
        [60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086],
        [-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236],
        [-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904],
    ]
)
#: Range of h = r_root / r_bore of that table; a smaller bore is taken at its end.
LEAST_RIM, MOST_RIM = 1.4, 7.0


class Tooth:
    """A tooth of a `SpurGear`, over a width in m: outline, compliances of the tooth and its body.

    In the transverse section y goes from the axis of the gear along the centre line of the tooth,
    x is half of its thickness. The force at a point of the flank is tangent to the base circle, by
    an angle b off the normal of the centre line. In phi = tan(pressure angle at the point), the
    radius of curvature over r_b, b = phi - psi with half the angle psi of the tooth at its base:

        x = r_b (phi cos b - sin b),    y = r_b (cos b + phi sin b).

    A ring gear's tooth has b = phi + psi, the opposite x, and its root at larger y; its flank is
    taken to reach the root circle, its rim to be rigid.

    The body's term in h^2 is, to a tenth, the twist of a disc between bore and root,
    (1 + nu) (h^2 - 1) / (2 pi); it has no meaning without a bore. A gear without one is the half
    plane of Cornell, J. Mech. Des. 103 (1981) 447-459, in plane stress.
    """

    def __init__(self, gear, width):
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
        """Return x, y and dy / dgamma where the rack's tip touches under an angle gamma.

        The round of the rack's tip has its centre `depth` below the rolling line, `side` from the
        centre line of the tooth. A circle in the normal section, it is an ellipse here of helical
        gears, longer by 1 / cos(beta) along the rack; gamma is the angle of its normal, from the
        pressure angle, at the flank, to pi / 2.
        """
        rolling, helix = self.gear.reference_diameter / 2.0, math.cos(self.gear.helix_angle)
        depth, side, round_off = self._rack_tip
        sine, cosine = np.sin(gamma), np.cos(gamma)
        across = np.hypot(cosine / helix, sine)
        # From the contact along the normal to the pitch point, and the radius of curvature.
        reach = (depth + round_off * sine / across) / sine
        bend = round_off / (helix**2 * across**3)
        turn = (reach * cosine - round_off * cosine / (helix**2 * across) + side) / rolling
        x = rolling * np.sin(turn) - reach * np.cos(gamma - turn)
        y = rolling * np.cos(turn) - reach * np.sin(gamma - turn)
        turning = (bend - reach) / (rolling * sine)
        shrinking = (bend - reach) * cosine / sine
        slope = -rolling * np.sin(turn) * turning - shrinking * np.sin(gamma - turn)
        slope -= reach * np.cos(gamma - turn) * (1.0 - turning)
        return x, y, slope

    @property
    def _rack_tip(self):
        gear, helix = self.gear, math.cos(self.gear.helix_angle)
        round_off, angle = gear.fillet_radius, gear.pressure_angle
        below = gear.rack.dedendum * gear.module - round_off  # of the datum line of the rack
        side = math.pi / 4.0 * gear.module + below * math.tan(angle) + round_off / math.cos(angle)
        side += gear.thickness_allowance / 2.0
        return below - gear.shift * gear.module, side / helix, round_off

    def _trochoid(self):
        start, end = self.gear.transverse_pressure_angle, math.pi / 2.0
        half = (end - start) / 2.0
        x, y, slope = self.fillet(start + half * (1.0 + _NODES))
        return x, y, np.abs(slope) * half * _WEIGHTS

    def compliance(self, phi):
        """Return bending, shear and axial compliance of the tooth for forces at phi, m/N.

        The integrals of the energy method over fillet and flank: (cos b (y_F - y) - x_F sin b)^2 /
        (E I) + 1.2 cos^2 b / (G A) + sin^2 b / (E A), A = 2 x w, I = 2/3 x^3 w.
        """
        phi = np.asarray(phi, float)
        at_x, at_y, b = (value[..., None] for value in self.flank(phi))
        half = (phi - self.foot)[..., None] / 2.0
        nodes = self.foot + half * (1.0 + _NODES)
        x, y, angle = self.flank(nodes)
        step = np.abs(self.base * nodes * np.cos(angle) * half) * _WEIGHTS
        if self._fillet is not None:
            both = zip((x, y, step), self._fillet, strict=True)
            x, y, step = (np.append(a, np.broadcast_to(b, a.shape), axis=-1) for a, b in both)
        material = self.gear.material
        bending = (np.cos(b) * self.sign * (at_y - y) - at_x * np.sin(b)) ** 2 * 1.5 / x**3
        shear = 2.4 * (1.0 + material.poisson) * np.cos(b) ** 2 / (2.0 * x)
        axial = np.sin(b) ** 2 / (2.0 * x)
        total = ((bending + shear + axial) * step).sum(axis=-1)
        return total / (material.young * self.width)

    def body(self, phi):
        """Return the compliance of the body below the tooth for forces at phi, m/N; 0 for a rim."""
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
            L, M, P, Q = _BODY @ powers
        # Height above the root circle of the point where the force meets the centre line.
        u = (self.base / np.cos(b) - self.root) / (2.0 * self.root * theta)
        shape = L * u**2 + M * u + P * (1.0 + Q * np.tan(b) ** 2)
        return np.cos(b) ** 2 * shape / (self.gear.material.young * self.width)

    @property
    def body_shape(self):
        """Half the angle of the tooth at its root, rad, and r_root / r_bore or None."""
        x, y, _ = self.fillet(math.pi / 2.0)
        bore = self.gear.bore / 2.0
        return float(np.arctan2(x, y)), min(self.root / bore, MOST_RIM) if bore else None


class PairCompliance:
    """Compliances of one pair of teeth along the path of contact, m/N; no bore too large for it."""

    def __init__(self, mesh, hertz="constant"):
        self.mesh, self.hertz = mesh, checks.one_of("hertz", hertz, ("constant", "logarithmic"))
        self._teeth = [Tooth(gear, mesh.width) for gear in (mesh.pinion, mesh.wheel)]
        for tooth, name in zip(self._teeth, ("pinion", "wheel"), strict=True):
            most = 2.0 * tooth.root / LEAST_RIM
            if tooth.gear.bore > most:
                words = f"the energy method holds for at most {most:.6g} m, root over {LEAST_RIM}"
                bore = f"bore of the {name} = {tooth.gear.bore!r}"
                raise ValueError(f"{bore} is not allowed: {words}")

    def _rolls(self, position):
        """Return the radii of curvature over r_b of both flanks that touch at a position."""
        lengths = (position, self.mesh.wheel_roll_length(position))
        return [length / tooth.base for length, tooth in zip(lengths, self._teeth, strict=True)]

    def teeth(self, position):
        """Return the compliance of both teeth by themselves at positions of the path."""
        rolls = zip(self._teeth, self._rolls(position), strict=True)
        return sum(tooth.compliance(roll) for tooth, roll in rolls)

    def bodies(self, position):
        """Return the compliance of both bodies by themselves, shape (2, ...)."""
        rolls = zip(self._teeth, self._rolls(position), strict=True)
        return np.array([tooth.body(roll) for tooth, roll in rolls])

    def contact(self, position, force):
        """Return the compliance of the contact, secant under a force in N."""
        width = self.mesh.width
        materials = [tooth.gear.material for tooth in self._teeth]
        soft = [(1.0 - material.poisson**2) / material.young for material in materials]
        if self.hertz == "constant":
            return np.full(np.shape(position), 2.0 * sum(soft) / (math.pi * width))
        rolls = self._rolls(position)
        radii = [roll * tooth.base for roll, tooth in zip(rolls, self._teeth, strict=True)]
        # Convex against convex; a ring gear's flank is hollow.
        curvature = 1.0 / radii[0] + self.mesh.wheel.sign / radii[1]
        half_width = np.sqrt(4.0 * force * sum(soft) / (math.pi * width * curvature))
        total = 0.0
        for tooth, roll, softness in zip(self._teeth, rolls, soft, strict=True):
            x, _, b = tooth.flank(roll)
            poisson = tooth.gear.material.poisson
            depth = np.log(2.0 * x / np.cos(b) / half_width) - poisson / (2.0 * (1.0 - poisson))
            total = total + 2.0 * softness / (math.pi * width) * depth
        return total


def matrix(pair, positions, forces, coupling):
    """Return Q of the head of the module, m/N, shape (n, k, k), of k pairs at n phases each."""
    single = pair.teeth(positions) + pair.contact(positions, forces)
    bodies = pair.bodies(positions)
    single = single + (1.0 - coupling) * bodies.sum(axis=0)
    root = np.sqrt(bodies)
    joint = np.einsum("gnk,gnl->nkl", root, root) * coupling
    return joint + single[..., None] * np.eye(positions.shape[1])


def energy_stiffness(mesh, pitches, count, *, coupling=1.0, hertz="constant", torque=None):
    """Return the mesh stiffness at positions of the last pair that came into contact, N/m.

    Pitches, shape (n,), count from the start of contact; `count` pairs touch, one base pitch apart;
    `hertz` is "constant" or "logarithmic", a law that needs the torque of the pinion, N m.
    """
    pair = PairCompliance(mesh, hertz)
    coupling = checks.number("coupling", coupling, "from 0 to 1", lambda v: 0.0 <= v <= 1.0)
    if hertz == "logarithmic" or torque is not None:
        torque = checks.finite_positive("torque", torque)
    positions = mesh.path[0] + (pitches[:, None] + np.arange(count)) * mesh.base_pitch
    load = mesh.load(torque or 1.0)
    forces = np.full(positions.shape, load / count)
    for _ in range(_LOAD_REPEATS if hertz == "logarithmic" else 1):
        compliance = matrix(pair, positions, forces, coupling)
        shares = np.linalg.solve(compliance, np.ones((*positions.shape, 1)))[..., 0]
        total = shares.sum(axis=1)
        # A pair that would pull keeps a trace of load, so that its logarithm exists.
        forces = np.maximum(shares / total[:, None], 1e-6) * load
    return total


@dataclass(frozen=True)
class MeshStiffness:
    """The stiffness of a mesh and what `GearPair` and `OneDegreePair` take of it."""

    method: str  #: "iso", "energy" or "table"
    max_stiffness: float  #: C_max, N/m
    stiffness_ratio: float  #: kappa
    contact_ratio: float  #: epsilon, from 1 to 2, of the rectangle
    profile: Rectangular | Tabulated  #: its course over the mesh phase

    @property
    def source(self):
        """Where the method comes from."""
        return SOURCES[self.method]

    @property
    def uncertainty(self):
        """Relative uncertainty of the method; NaN: not known."""
        return UNCERTAINTY[self.method]

    @property
    def mean_stiffness(self):
        """C_s, N/m, Eq. (2)."""
        return self.max_stiffness * mean_over_max(self.contact_ratio, self.stiffness_ratio)

    def ratios(self):
        """Return max_stiffness, stiffness_ratio and contact_ratio as arguments of a `GearPair`."""
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio")
        return {name: getattr(self, name) for name in names}


def mesh_stiffness(mesh, method="iso", *, samples=64, **options):
    """Return the `MeshStiffness` of a mesh.

    Parameters
    ----------
    mesh : Mesh
    method : {"iso", "energy"} or Tabulated, default "iso"
        "iso": c' of ISO 6336-1 for one pair of teeth, and for each more 0.75 c', so that the mean
        is c_gamma_alpha. "energy": the course by the energy method; its rectangle has the mean of
        each segment. A table stands for itself; its rectangle has its extrema and mean.
    samples : int, default 64
        Phases of the course by the energy method, >= 8.
    torque : float, optional
        Of the pinion, N m; matters to "iso" at low load, and to the logarithmic contact.
    application_factor : float, default 1
        K_A, of "iso".
    coupling, hertz
        Of "energy", see `energy_stiffness`.

    Raises
    ------
    ValueError
        If the method or an option is not allowed.
    """
    checks.drawn_mesh(mesh)
    if isinstance(method, Tabulated):
        checks.known("table", options, ("torque",))
        return _of_table("table", method)
    if method not in ("iso", "energy"):
        raise checks.refusal("stiffness", method, "'iso', 'energy' or a Tabulated")
    less = math.floor(mesh.contact_ratio)
    segment = mesh.contact_ratio - less
    if method == "iso":
        high, ratio, contact = iso_rectangle(mesh, **options)
        if mesh.overlap_ratio == 0.0:
            return MeshStiffness(method, high, ratio, contact, Rectangular())
        single = pair_stiffness(mesh, **options)
        levels = [single * (0.25 + 0.75 * count) for count in (less + 1, less)]
        course = _Course([0.0, segment, segment, 1.0], np.repeat(levels, 2))
        table = course.over_face(mesh.overlap_ratio).table(segment)
        return MeshStiffness(method, high, ratio, contact, table)
    checks.known("stiffness 'energy'", options, ("torque", "coupling", "hertz"))
    course, means = _energy_course(mesh, less, segment, samples, options)
    if mesh.overlap_ratio > 0.0:
        return _of_table(method, course.over_face(mesh.overlap_ratio).table(segment))
    profile = course.table(segment)
    return MeshStiffness(method, means[0], means[1] / means[0], 1.0 + segment, profile)


def _energy_course(mesh, less, segment, samples, options):
    """Return the course by the energy method, and its means on both segments."""
    samples = checks.integer("samples", samples, 8, 100_000)
    u, values, means = [], [], []
    for start, end, count in ((0.0, segment, less + 1), (segment, 1.0, less)):
        # Each segment gets its share of the phases, and enough for the mean of a parabola.
        n = max(5, round(samples * (end - start)))
        at = np.linspace(start, end, n)
        u.append(at)
        values.append(energy_stiffness(mesh, at, count, **options))
        means.append(float(np.trapezoid(values[-1], np.linspace(0.0, 1.0, n))))
    return _Course(np.concatenate(u), np.concatenate(values)), means


def _of_table(method, table):
    high, ratio, contact = table.ratios()
    if 1.0 - ratio < 1e-12:  # constant up to rounding, as with a whole overlap ratio
        ratio, contact = 1.0, 1.5
    return MeshStiffness(method, high, ratio, contact, table)


class _Course:
    """A stiffness over one base pitch: straight lines between points, which repeat at a step."""

    def __init__(self, u, values):
        self.u, self.values = np.asarray(u, float), np.asarray(values, float)
        areas = np.diff(self.u) * (self.values[1:] + self.values[:-1]) / 2.0
        self._areas = np.append(0.0, np.cumsum(areas))

    def integral(self, u):
        """Return the integral from 0 to `u`, which may lie outside of the base pitch."""
        whole = np.floor(u)
        fraction = u - whole
        i = np.clip(np.searchsorted(self.u, fraction, side="right") - 1, 0, self.u.size - 2)
        length = self.u[i + 1] - self.u[i]
        slope = (self.values[i + 1] - self.values[i]) / np.where(length > 0.0, length, 1.0)
        beyond = fraction - self.u[i]
        inner = self._areas[i] + beyond * (self.values[i] + slope * beyond / 2.0)
        return whole * self._areas[-1] + inner

    def over_face(self, overlap):
        """Return the average over `overlap` base pitches; exact where the course is rectangular."""
        half = overlap / 2.0
        # The average has its corners where a window begins or ends at a step.
        step = np.isin(self.u, [0.0, 1.0, *self.u[1:][np.diff(self.u) == 0.0]])
        at = [self.u[~step], self.u[step] - half, self.u[step] + half]
        at = np.sort(np.concatenate(at) % 1.0)
        # Corners that coincide up to rounding are one.
        at = at[np.diff(at, append=at[0] + 1.0) > 1e-12]
        return _Course(at, (self.integral(at + half) - self.integral(at - half)) / overlap)

    def table(self, segment):
        """Return the course as `Tabulated`; a step becomes a ramp."""
        u, values = self.u.copy(), self.values
        if u[-1] == 1.0:
            u[-1] -= _RAMP
        jumps = np.nonzero(np.diff(u) == 0.0)[0] + 1
        u[jumps] += _RAMP
        kept = np.concatenate([[True], np.diff(u) > 0.0])
        phase = math.tau * ((u[kept] - segment / 2.0) % 1.0)
        # A phase just below 0 rounds to a whole turn.
        phase, order = np.unique(np.where(phase < math.tau, phase, 0.0), return_index=True)
        return Tabulated(phase, values[kept][order])

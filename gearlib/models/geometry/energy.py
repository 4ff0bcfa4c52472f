"""Mesh stiffness by the energy method: teeth, Hertz contact, and bodies counted once.

A pair of teeth i has the compliance q_i of both teeth and of their contact. The body of a gear
yields to the loads of all pairs: under the force F_j of another pair, the point of pair i moves by
coupling sqrt(f_i f_j) F_j, with the compliances f of the body by itself. So x = Q F with

    Q = diag(q) + sum over both gears of diag(f) (1 - coupling) + coupling sqrt(f) sqrt(f)^T,

and C = 1^T Q^-1 1. Coupling 1, the default, counts the body once; 0 gives each pair a body of its
own, which counts it twice in double contact, as many papers do.

Sources of `Tooth`: Weber & Banaschek (1953), Yang & Lin, J. Mech. Transm. Autom. Des. 109 (1987)
189-196, for the energies; Sainsot, Velex & Duverger, J. Mech. Des. 126 (2004) 748-752, for a body
clamped at its bore. Hertz contact by Yang & Sun, J. Mech. Transm. Autom.
Des. 107 (1985) 529-535 (constant), or Weber & Banaschek (1953) (logarithmic in the load). Of
helical gears each slice of the face is a spur gear of the transverse section.
"""

import math

import numpy as np

from gearlib import checks
from gearlib.models.geometry.gear import inv

#: Repetitions that settle the loads of pairs under the logarithmic law; each wins two digits.
_REPEATS = 8
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
            low = [np.broadcast_to(value, x.shape) for value in self._fillet]
            x, y, step = (
                np.concatenate(parts, axis=-1) for parts in zip((x, y, step), low, strict=True)
            )
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
            if 2.0 * tooth.root < LEAST_RIM * tooth.gear.bore:
                raise ValueError(
                    f"bore of the {name} = {tooth.gear.bore!r} is not allowed: the energy method "
                    f"holds for at most {2.0 * tooth.root / LEAST_RIM:.6g} m, root over {LEAST_RIM}"
                )

    def _rolls(self, position):
        """Return the radii of curvature over r_b of both flanks that touch at a position."""
        lengths = (position, self.mesh.wheel_roll_length(position))
        return [length / tooth.base for length, tooth in zip(lengths, self._teeth, strict=True)]

    def teeth(self, position):
        """Return the compliance of both teeth by themselves at positions of the path."""
        rolls = self._rolls(position)
        return sum(t.compliance(roll) for t, roll in zip(self._teeth, rolls, strict=True))

    def bodies(self, position):
        """Return the compliance of both bodies by themselves, shape (2, ...)."""
        rolls = self._rolls(position)
        return np.array([t.body(roll) for t, roll in zip(self._teeth, rolls, strict=True)])

    def contact(self, position, force):
        """Return the compliance of the contact, secant under a force in N."""
        width = self.mesh.width
        soft = [
            (1.0 - tooth.gear.material.poisson**2) / tooth.gear.material.young
            for tooth in self._teeth
        ]
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

    Positions are in base pitches after the start of contact, shape (n,); so many pairs are in
    contact, one base pitch apart. Coupling is from 0 to 1, see the head of the module; `hertz`
    is "constant" or "logarithmic", a law that needs the torque of the pinion, N m.
    """
    pair = PairCompliance(mesh, hertz)
    coupling = checks.number("coupling", coupling, "from 0 to 1", lambda v: 0.0 <= v <= 1.0)
    if hertz == "logarithmic" or torque is not None:
        torque = checks.finite_positive("torque", torque)
    positions = mesh.path[0] + (pitches[:, None] + np.arange(count)) * mesh.base_pitch
    load = mesh.load(torque or 1.0)
    forces = np.full(positions.shape, load / count)
    for _ in range(_REPEATS if hertz == "logarithmic" else 1):
        shares = np.linalg.solve(
            matrix(pair, positions, forces, coupling), np.ones((*positions.shape, 1))
        )[..., 0]
        total = shares.sum(axis=1)
        # A pair that would pull keeps a trace of load, so that its logarithm exists.
        forces = np.maximum(shares / total[:, None], 1e-6) * load
    return total

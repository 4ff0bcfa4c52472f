"""Mesh stiffness by the energy method: teeth, Hertz contact, and bodies counted once.

A pair of teeth i has the compliance q_i of both teeth and of their contact. The body of a gear
yields to the loads of all pairs: under the force F_j of another pair, the point of pair i moves by
coupling sqrt(f_i f_j) F_j, with the compliances f of the body by itself. So x = Q F with

    Q = diag(q) + sum over both gears of diag(f) (1 - coupling) + coupling sqrt(f) sqrt(f)^T,

and C = 1^T Q^-1 1. Coupling 1, the default, counts the body once; 0 gives each pair a body of its
own, which counts it twice in double contact, as many papers do.

Sources: see `gearlib.models.geometry.tooth`; Hertz contact by Yang & Sun, J. Mech. Transm. Autom.
Des. 107 (1985) 529-535 (constant), or Weber & Banaschek (1953) (logarithmic in the load). Of
helical gears each slice of the face is a spur gear of the transverse section.
"""

import math

import numpy as np

from gearlib import checks
from gearlib.models.geometry.tooth import LEAST_RIM, Tooth

#: Repetitions that settle the loads of pairs under the logarithmic law; each wins two digits.
_REPEATS = 8


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
        for tooth, roll, one in zip(self._teeth, rolls, soft, strict=True):
            x, _, b = tooth.flank(roll)
            poisson = tooth.gear.material.poisson
            depth = np.log(2.0 * x / np.cos(b) / half_width) - poisson / (2.0 * (1.0 - poisson))
            total = total + 2.0 * one / (math.pi * width) * depth
        return total


def matrix(pair, positions, forces, coupling):
    """Return Q of the head of the module, m/N, shape (n, k, k), of k pairs at n phases each."""
    own = pair.teeth(positions) + pair.contact(positions, forces)
    bodies = pair.bodies(positions)
    own = own + (1.0 - coupling) * bodies.sum(axis=0)
    root = np.sqrt(bodies)
    joint = np.einsum("gnk,gnl->nkl", root, root) * coupling
    return joint + own[..., None] * np.eye(positions.shape[1])


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

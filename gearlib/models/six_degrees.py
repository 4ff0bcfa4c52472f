"""Six degrees of freedom: rotations and bearing motions of both gears, Eq. (3), (4).

    (J3 / Rb3^2) u3'' = M3 / Rb3 - P - Q     m3 y3'' = -P - b Q - C3y y3 - k3y y3'
    (J2 / Rb2^2) u2'' = M2 / Rb2 - P - Q     m2 y2'' = +P + b Q - C2y y2 - k2y y2'
                                             m3 z3'' = -F_T - C3z z3 - k3z z3'
                                             m2 z2'' = +F_T - C2z z2 - k2z z2'

with the rotations as arc lengths u_j = Rb_j phi_j, y along the line of action, z across it, the
relative mesh displacement and the backlash line of Eq. (4)

    y(tau) = u3 + u2 + y3 - y2 + e3 sin phi3 - e2 sin(Delta - phi2) + f(tau)
    s(tau) = -s_k + y3 - y2 + e3 sin phi3 - e2 sin(Delta - phi2) + f(tau) - f_far(tau)

and the forces between the normal flanks, over y, and between the far ones, over y - s,

    P = k_m y' + H1 (C(tau) y + (k - k_m) y'),        Q = H2 (C(tau) (y - s) + (k - k_m) (y - s)').

H1 is 1 in normal mesh, H2 in inverse mesh, else 0. A force acts on a coordinate by the derivative
of its own distance, by virtual work: b = d(y - s)/dy3, 0 for the s above, 1 if the backlash does
not move. At a flank that is just touched no force jumps; why in this way, and where k_m > k makes
dampers drive: `docs/theory/model.md`. Friction F_T = mu sigma(tau) C g acts across the line of
action, with g = y in normal mesh, y - s in inverse mesh, 0 in the backlash; its direction sigma
reverses at the pitch point and half a mesh period later. It opposes the sliding with z a quarter
turn from y the way gear 3 turns.

In the run-out the rotations are those of the steady speed, phi_j = tau / teeth_j: the vibration
of an angle, 1e-5 rad, moves the run-out by 1e-5 of itself. So the system is linear between events.
Its matrices are those of a train of two gears, `gearlib.models.trains.two_gears`.

The paper prints none of the values beyond those of the pair; whoever sets them chooses.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from gearlib.models.geometry.mesh import bodies
from gearlib.models.harmonics import Harmonics
from gearlib.models.model import Model
from gearlib.models.one_mesh_system import contact_map
from gearlib.models.pair import GearPair, WithPair
from gearlib.parameters import (
    ANGLE,
    DAMPING,
    INERTIA,
    LENGTH,
    MASS,
    NONNEGATIVE,
    RUN_OUT,
    TORQUE,
    TRUTH,
    Instance,
    Integer,
    Many,
    Number,
    documented,
    named,
)

_BEARING = Number("N/m", "1 kN/um", above=0, infinite="infinity: rigid")
_BEARINGS = ("y3", "z3", "y2", "z2")
#: How the bearing coordinates enter y; z does not.
_IN_Y = {"y3": 1.0, "y2": -1.0, "z3": 0.0, "z2": 0.0}

#: Names of the recorded functionals, after the columns of `gearlib.engines.orbit`.
OUTPUTS = (
    *("rotation_3", "rotation_2", *(f"bearing_{name}" for name in _BEARINGS)),
    *("backlash", "friction_force", *(f"bearing_force_{name}" for name in _BEARINGS)),
)


@documented
@dataclass(frozen=True, kw_only=True)
class SixDegreePair(WithPair):
    """A pair of gears on elastic bearings, in SI units; immutable.

    Pairs of values are of gear 3 and gear 2, four of the bearings y3, z3, y2, z2. The reduced mass
    of `pair` is only the reference of the tuning: the inertias decide the motion.
    `reduced_mass_torsional` and `reduced_mass_free` give the two readings of the paper.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    force_note = property(lambda model: model.pair.force_note, doc="`GearPair.force_note`.")
    pair: Annotated[GearPair, Instance((GearPair,)), "Stiffness, load, backlash, damping"]
    base_radii: Annotated[tuple, Many(LENGTH, 2), "Base radii", "Rb3, Rb2"]
    inertias: Annotated[tuple, Many(INERTIA, 2), "Moments of inertia", "J3, J2"]
    masses: Annotated[tuple, Many(MASS, 2), "Masses", "m3, m2"]
    bearing_stiffness: Annotated[
        tuple, Many(_BEARING, 4), "Stiffness of the bearings", "C3y, C3z, C2y, C2z"
    ]
    bearing_damping: Annotated[
        tuple, Many(DAMPING, 4), "Damping of the bearings", "k3y, k3z, k2y, k2z"
    ] = (0.0, 0.0, 0.0, 0.0)
    eccentricities: Annotated[tuple, Many(RUN_OUT, 2), "Run-out of the pitch circles", "e3, e2"] = (
        0.0,
        0.0,
    )
    run_out_phase: Annotated[float, ANGLE, "Relative phase of the run-outs", "Delta"] = 0.0
    teeth: Annotated[
        tuple | None, Many(Integer(1), 2), "Teeth of both gears; by default those of the pair"
    ] = None
    torques: Annotated[
        tuple | None, Many(TORQUE, 2), "Torques M3, M2; by default those of the load, F Rb"
    ] = None
    deviation: Annotated[Harmonics, Instance((Harmonics,)), "Of the normal flanks, m", "f(tau)"] = (
        Harmonics()
    )
    inverse_deviation: Annotated[
        Harmonics | None, Instance((Harmonics,)), "Of the far flanks, m; by default the same"
    ] = None
    friction: Annotated[
        tuple, Many(NONNEGATIVE, 2), "Coefficients mu in normal and inverse mesh"
    ] = (0.0, 0.0)
    pitch_phase: Annotated[float, ANGLE, "Mesh phase at which the friction turns; from -1 to 1"] = (
        0.0
    )
    moving_backlash: Annotated[
        bool,
        TRUTH,
        "Whether s(tau) moves as Eq. (4) has it, by which the bearings do not close the backlash; "
        "if not, the far flank stays s_k behind y = 0",
    ] = True
    preload: Annotated[
        bool,
        TRUTH,
        "Whether the bearings start in their deflection under the load; if not, undeflected",
    ] = True

    extra_samples = OUTPUTS
    propagators = {"exact": "linear.one_mesh"}
    moving_flank = True
    defaults = {
        "inverse_deviation": lambda model: model.deviation,
        "teeth": lambda model: (model.pair.teeth, model.pair.teeth),
        "torques": lambda model: tuple(model.pair.load * radius for radius in model.base_radii),
    }

    @classmethod
    def from_geometry(cls, mesh, *, bearing_stiffness, **more):
        """Return the pair of two drawn gears, the pinion as gear 3, on bearings.

        Radii, masses, inertias, teeth and pitch phase are those of the drawing. Friction and
        run-out are 0 unless given.

        Parameters
        ----------
        mesh : gearlib.geometry.Mesh
        bearing_stiffness : sequence of float
            C3y, C3z, C2y, C2z along and across the line of action, N/m; > 0 or infinite.
        **more
            Other parameters of the class, also in place of those of the drawing, and arguments of
            `GearPair.from_geometry` such as torque and damping_ratio.
        """
        fields = {name: more.pop(name) for name in cls.__dataclass_fields__ if name in more}
        pair = GearPair.from_geometry(mesh, **more)
        return cls(pair=pair, bearing_stiffness=bearing_stiffness, **(bodies(mesh) | fields))

    parameters = property(lambda model: named(type(model)), doc="Phases of run-out and friction.")
    contact_map = contact_map
    as_dict = Model.as_dict

    @property
    def reduced_mass_torsional(self):
        """1 / (Rb3^2 / J3 + Rb2^2 / J2), kg: rigid bearings."""
        return 1.0 / sum(r * r / j for r, j in zip(self.base_radii, self.inertias, strict=True))

    @property
    def reduced_mass_free(self):
        """The same with 1 / m3 + 1 / m2 added, kg: bearings far softer than the mesh."""
        return 1.0 / (1.0 / self.reduced_mass_torsional + sum(1.0 / m for m in self.masses))

    @property
    def repeats(self):
        """Mesh periods after which the excitation repeats: 1, or those of the run-out."""
        return self.train.repeats

    def speed(self, tuning):
        """Return the speed of gear 3 in rpm at a tuning (float or array)."""
        return self.mesh_frequency(tuning) * 60.0 / (2.0 * math.pi * self.teeth[0])

    def scales(self):
        """Return the scalar variables of datasets that depend on the model alone."""
        return self.pair.scales() | {"torque": self.torques[0]}

    @property
    def size(self):
        """Components that vary: 4, and two for each flexible bearing."""
        return 4 + 2 * len(self.flexible())

    def reduction(self):
        """Return (reduce, lift), see `Model.reduction`: shapes (n - 2, n), (n, n - 2)."""
        n = self.size
        # Only the sum of the two rotations enters the mesh; their difference turns freely.
        # Rows u3 + u2, bearings, and their rates; lifted back with all of the sum in u3.
        lift = np.delete(np.eye(n), [1, n // 2 + 1], axis=1)
        reduce = lift.T.copy()
        reduce[0, 1] = reduce[n // 2 - 1, n // 2 + 1] = 1.0
        return reduce, lift

    def damped(self):
        """Return whether any phase of the motion is damped."""
        return self.pair.damped() or any(self.bearing_damping)

    def flexible(self):
        """Return the indices of the bearing coordinates that can move."""
        return [i for i, c in enumerate(self.bearing_stiffness) if math.isfinite(c)]

    @cached_property
    def train(self):
        """The `TwoGears` of which the matrices are made."""
        from gearlib.models.trains.two_gears import TwoGears

        return TwoGears(gears=self)

    def outputs(self, system):
        """Return the functionals of OUTPUTS of states by phase, shape (12, 3, p, n)."""
        pair, moving = self.pair, self.flexible()
        m, shape = 2 + len(moving), (*system.effect.shape[:2], len(system.free))
        rows = np.zeros((len(OUTPUTS), *shape), system.free.dtype)
        rows[0, ..., 0] = rows[1, ..., 1] = 1.0
        # s = y - (y - s)
        rows[OUTPUTS.index("backlash")] = system.near[0] - system.far[0]
        if math.isinf(pair.backlash):
            rows[OUTPUTS.index("backlash"), ..., 2 * m] = -pair.backlash_ratio
        rows[OUTPUTS.index("friction_force")] = system.grip[0, system.effect[:, :, 0], 1]
        rate = pair.mean_eigenfrequency * system.tuning / pair.mean_stiffness
        for k, i in enumerate(moving, 2):
            rows[2 + i, ..., k] = 1.0
            rows[8 + i, ..., k] = self.bearing_stiffness[i] / pair.mean_stiffness
            rows[8 + i, ..., m + k] = self.bearing_damping[i] * rate
        return rows

    def initial(self, system, state):
        """Return the full state z at tau = 0 for a relative displacement and velocity, by phase."""
        z = np.zeros(len(system.free), system.free.dtype)
        moving, near = self.flexible(), system.near[0]
        m = 2 + len(moving)
        if self.preload:
            for k, i in enumerate(moving):
                share = self.pair.mean_stiffness / self.bearing_stiffness[i]
                z[2 + k] = -_IN_Y[_BEARINGS[i]] * share
        # The gears share a motion of the mesh so that their free rotation is not set off.
        shares = np.array([r * r / j for r, j in zip(self.base_radii, self.inertias, strict=True)])
        shares /= shares.sum()
        z[2 * m] = 1.0
        z[2 * m + 1 :: 2] = 1.0
        z[:2] = shares * (state[0] - near @ z)
        z[m : m + 2] = shares * (state[1] - near @ (system.free @ z) / system.tuning)
        # The shares round, and the displacement is to be met exactly.
        z[0] += state[0] - near @ z
        return z

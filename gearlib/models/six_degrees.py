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

======================  =================  =======================================================
name                    symbol             unit
======================  =================  =======================================================
pair                    --                 `GearPair`: C_max, kappa, epsilon, load, s_k, k, k_m
base_radii              Rb3, Rb2           m
inertias                J3, J2             kg m^2
masses                  m3, m2             kg
bearing_stiffness       C3y C3z C2y C2z    N/m, infinite: rigid
bearing_damping         k3y k3z k2y k2z    N s/m
eccentricities          e3, e2             m, run-out of the pitch circles
run_out_phase           Delta              rad
teeth                   --                 of gear 3 and gear 2
torques                 M3, M2             N m; by default those of the load, F Rb_j
deviation               f(tau)             m, `Harmonics`, of the normal flanks
inverse_deviation       f(tau)             m, `Harmonics`, of the far flanks; by default the same
friction                mu (normal, inverse)  1
pitch_phase             --                 rad, where sigma turns from -1 to 1
moving_backlash         --                 whether s(tau) moves as Eq. (4) has it, by which the
                                           bearings do not close the backlash; if not, the far
                                           flank stays s_k behind y = 0
preload                 --                 whether the bearings start in their deflection under
                                           the load (else in their free position)
======================  =================  =======================================================

The paper prints none of the values beyond those of the pair; whoever sets them chooses.
"""

import math
from dataclasses import dataclass, field, fields

import numpy as np

from gearlib import checks
from gearlib.kernels.piecewise_linear.system import Part, System, may_close
from gearlib.models import derivatives, excitation, piecewise_linear
from gearlib.models.harmonics import Harmonics
from gearlib.models.pair import GearPair
from gearlib.models.with_pair import WithPair

_BEARINGS = ("y3", "z3", "y2", "z2")
#: How the bearing coordinates enter y; z does not.
_IN_Y = {"y3": 1.0, "y2": -1.0, "z3": 0.0, "z2": 0.0}

#: Names of the recorded functionals, after the columns of `gearlib.kernels.orbit`.
OUTPUTS = (
    "rotation_3",
    "rotation_2",
    "bearing_y3",
    "bearing_z3",
    "bearing_y2",
    "bearing_z2",
    "backlash",
    "friction_force",
    "bearing_force_y3",
    "bearing_force_z3",
    "bearing_force_y2",
    "bearing_force_z2",
)


@dataclass(frozen=True, kw_only=True)
class SixDegreePair(WithPair):
    """A pair of gears on elastic bearings, in SI units; immutable.

    Parameters and units: see the table of the module; pairs are (gear 3, gear 2), bearings
    (y3, z3, y2, z2).

    The reduced mass of `pair` is only the reference of the tuning: the inertias decide the motion.
    `reduced_mass_torsional` and `reduced_mass_free` give the two readings of the paper.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    pair: GearPair
    base_radii: tuple
    inertias: tuple
    masses: tuple
    bearing_stiffness: tuple
    bearing_damping: tuple = (0.0, 0.0, 0.0, 0.0)
    eccentricities: tuple = (0.0, 0.0)
    run_out_phase: float = 0.0
    teeth: tuple | None = None
    torques: tuple | None = None
    deviation: Harmonics = field(default_factory=Harmonics)
    inverse_deviation: Harmonics | None = None
    friction: tuple = (0.0, 0.0)
    pitch_phase: float = 0.0
    moving_backlash: bool = True
    preload: bool = True

    extra_samples = OUTPUTS
    mathematics = {"exact": "piecewise_linear"}
    moving_flank = True
    parameters = {
        "run_out_phase": ("rad", "relative phase of the run-outs"),
        "pitch_phase": ("rad", "mesh phase at which the friction turns"),
    }
    by_default = {
        "inverse_deviation": lambda model: model.deviation,
        "teeth": lambda model: (model.pair.teeth, model.pair.teeth),
        "torques": lambda model: tuple(model.pair.load * radius for radius in model.base_radii),
    }

    def __post_init__(self):
        if not isinstance(self.pair, GearPair):
            raise ValueError(f"pair = {self.pair!r} is not allowed: it must be a GearPair")
        self._fill("inverse_deviation")
        for name in ("deviation", "inverse_deviation"):
            value = getattr(self, name)
            if not isinstance(value, Harmonics):
                raise ValueError(f"{name} = {value!r} is not allowed: it must be Harmonics")

        def put(name, count, check):
            values = getattr(self, name)
            if not isinstance(values, (tuple, list)) or len(values) != count:
                raise ValueError(f"{name} = {values!r} is not allowed: it must be {count} numbers")
            checked = tuple(check(f"{name}[{i}]", value) for i, value in enumerate(values))
            object.__setattr__(self, name, checked)

        for name in ("base_radii", "inertias", "masses"):
            put(name, 2, checks.finite_positive)
        put("bearing_stiffness", 4, _stiffness)
        put("bearing_damping", 4, checks.finite_nonnegative)
        put("eccentricities", 2, checks.finite_nonnegative)
        put("friction", 2, checks.finite_nonnegative)
        self._fill("teeth")
        put("teeth", 2, lambda name, value: checks.integer(name, value, 1))
        self._fill("torques")
        put("torques", 2, lambda name, value: checks.number(name, value, "finite", math.isfinite))
        for name in ("run_out_phase", "pitch_phase"):
            value = checks.number(name, getattr(self, name), "finite", math.isfinite)
            object.__setattr__(self, name, value)
        for name in ("moving_backlash", "preload"):
            checks.one_of(name, getattr(self, name), (False, True))

    @property
    def derivatives(self):
        """As of `Model.derivatives`."""
        return derivatives.of_gears(self)

    def direction(self, name):
        """As of `Model.direction`."""
        return derivatives.along_gears(self, name)

    def _fill(self, name):
        if getattr(self, name) is None:
            object.__setattr__(self, name, self.by_default[name](self))

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
        pairs = zip(self.teeth, self.eccentricities, strict=True)
        return math.lcm(*(teeth for teeth, e in pairs if e > 0.0))

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
        """Return (reduce, lift), see `Model.reduction`: shapes (n - 2, n), (n, n - 2).

        Only the sum of the two rotations enters the mesh; their difference turns freely.
        """
        n = self.size
        # Rows u3 + u2, bearings, and their rates; lifted back with all of the sum in u3.
        lift = np.delete(np.eye(n), [1, n // 2 + 1], axis=1)
        reduce = lift.T.copy()
        reduce[0, 1] = reduce[n // 2 - 1, n // 2 + 1] = 1.0
        return reduce, lift

    def contact_map(self, tuning):
        """Return the map of deviations over one mesh period in normal mesh; see `reduction`."""
        system, _ = self.system(tuning)
        # Of the three contact codes -1, 0, 1 the last.
        lengths = np.diff(system.starts) / system.substeps
        return piecewise_linear.contact_map(
            self, zip(system.a[2], lengths, system.substeps, strict=True)
        )

    def damped(self):
        """Return whether there is any damping on the way of the motion."""
        return self.pair.damped() or any(self.bearing_damping)

    def flexible(self):
        """Return the indices of the bearing coordinates that can move."""
        return [i for i, c in enumerate(self.bearing_stiffness) if math.isfinite(c.real)]

    def system(self, tuning):
        """Return (`System`, outputs) at one tuning; outputs of shape (12, 3, p, n)."""
        pair, unit = self.pair, 1.0 / tuning**2
        moving = self.flexible()
        m = 2 + len(moving)
        frequencies, amplitudes = excitation.waves_of(self)
        n = 2 * m + 1 + 2 * frequencies.size
        one, waves = 2 * m, 2 * m + 1
        pulse = np.zeros((3, n), np.result_type(unit))
        pulse[:, waves:] = amplitudes
        near, far = np.zeros((2, n), pulse.dtype)
        near[:2] = far[:2] = 1.0
        endless = math.isinf(pair.backlash.real)
        far[one] = 0.0 if endless else pair.backlash_ratio
        for k, i in enumerate(moving):
            near[2 + k] = _IN_Y[_BEARINGS[i]]
        if not self.moving_backlash:
            far[2:m] = near[2:m]
            far += pulse[0]
        near += pulse[0] + pulse[1]
        far += pulse[2]

        free = piecewise_linear.waves(n, waves, frequencies).astype(pulse.dtype)
        free[:m, m : 2 * m] = np.eye(m)
        inertia = [
            j / r**2 / pair.reduced_mass
            for j, r in zip(self.inertias, self.base_radii, strict=True)
        ]
        mass = [self.masses[0 if _BEARINGS[i].endswith("3") else 1] for i in moving]
        inertia = np.array(inertia + [value / pair.reduced_mass for value in mass])
        for j in range(2):
            free[m + j, one] = self.torques[j] / self.base_radii[j] / pair.load * unit / inertia[j]
        for k, i in enumerate(moving):
            row = m + 2 + k
            share = unit / inertia[2 + k] / pair.mean_stiffness
            free[row, 2 + k] -= self.bearing_stiffness[i] * share
            speed = pair.mean_eigenfrequency * tuning
            free[row, m + 2 + k] -= self.bearing_damping[i] * speed * share
        across = np.zeros(m, free.dtype)
        for k, i in enumerate(moving):
            if _BEARINGS[i] in ("z3", "z2"):
                across[2 + k] = (-1.0 if _BEARINGS[i] == "z3" else 1.0) * unit / inertia[2 + k]
        starts, stiffness, low, sense = excitation.segments_of(self)
        p = stiffness.size
        outputs = np.zeros((len(OUTPUTS), 3, p, n), free.dtype)
        # line @ free is the rate of a distance: the accelerations have no part in it.
        oil = 2.0 * pair.backlash_damping_ratio * tuning * (near @ free)
        more = 2.0 * (pair.damping_ratio - pair.backlash_damping_ratio) * tuning
        a = np.tile(free, (3, p, 1, 1))
        a[:, :, m : 2 * m] += np.outer(-near[:m] * unit / inertia, oil)
        grips = self.friction[1], 0.0, self.friction[0]
        for code, line in enumerate((far, np.zeros(n), near)):
            for q in range(p):
                elastic = stiffness[q] * line
                total = elastic + more * (line @ free)
                a[code, q, m : 2 * m] += np.outer(-line[:m] * unit / inertia, total)
                friction = grips[code] * sense[q] * elastic
                a[code, q, m : 2 * m] += np.outer(across, friction)
                self._outputs(outputs[:, code, q], moving, near - far, friction, m, tuning)
        outputs[OUTPUTS.index("backlash"), :, :, one] = -pair.backlash_ratio
        system = System(
            a,
            starts,
            # In 1 / nu of phase the mesh turns by a radian: velocities weigh like displacements.
            piecewise_linear.substeps(a, starts, m, one, 1.0 / tuning),
            low,
            np.tile(stiffness, (3, 1)),
            near,
            piecewise_linear.never(n, one) if endless else far,
            near,
            0,
            frequencies,
            tuning,
            self.repeats,
            closing=not endless and bool(may_close(near, far, one)),
        )
        return system, outputs

    def part(self, system):
        """Return the `Part` that decides the events: without the free rotation of the pair.

        Only u3 + u2 enters the mesh, and (J3 / Rb3^2) u3 - (J2 / Rb2^2) u2 feels no mesh force;
        motions across the line of action belong to the part only under friction.
        """
        n, m = system.near.size, 2 + len(self.flexible())
        share_3, share_2 = self._shares()
        units = np.eye(n)
        across = [2 + k for k, i in enumerate(self.flexible()) if not _IN_Y[_BEARINGS[i]]]
        apart = [] if any(self.friction) else across
        bearings = [j for j in range(2, m) if j not in apart]
        into, back, rest_into, rest_back = [], [], [], []
        for first in (0, m):
            u3, u2 = units[first], units[first + 1]
            into += [u3 + u2, *units[[first + j for j in bearings]]]
            back += [share_3 * u3 + share_2 * u2, *units[[first + j for j in bearings]]]
            rest_into += [share_2 * u3 - share_3 * u2, *units[[first + j for j in apart]]]
            rest_back += [u3 - u2, *units[[first + j for j in apart]]]
        into, back = np.array([*into, *units[2 * m :]]), np.stack([*back, *units[2 * m :]], axis=1)
        # The constant drives the rest, and comes back with the part.
        rest_into = np.array([*rest_into, units[2 * m]])
        rest = rest_into @ system.a[1, 0] @ np.stack([*rest_back, units[2 * m]], axis=1)
        rest_back = np.stack([*rest_back, np.zeros(n)], axis=1)
        near, far = system.near @ back, system.far @ back
        reduced = system._replace(a=into @ system.a @ back, near=near, far=far, position=near)
        return Part(reduced, into, back, rest, rest_into, rest_back)

    def _shares(self):
        """Return what the gears take of a motion of the mesh without free rotation, sum 1."""
        shares = np.array([r * r / j for r, j in zip(self.base_radii, self.inertias, strict=True)])
        return shares / shares.sum()

    def _outputs(self, rows, moving, line, friction, m, tuning):
        """Fill the functionals of OUTPUTS for one contact code and segment, shape (12, n)."""
        pair = self.pair
        rows[0, 0] = rows[1, 1] = 1.0
        # s = y - (y - s)
        rows[6] = line
        rows[7] = friction
        for k, i in enumerate(moving):
            rows[2 + i, 2 + k] = 1.0
            rows[8 + i, 2 + k] = self.bearing_stiffness[i] / pair.mean_stiffness
            speed = pair.mean_eigenfrequency * tuning
            rows[8 + i, m + 2 + k] = self.bearing_damping[i] * speed / pair.mean_stiffness

    def initial(self, system, state):
        """Return the full state z at tau = 0 for a relative displacement and velocity.

        Bearings at rest, deflected by the load or free; the rotations share the motion as their
        inertias do, so that the free rotation of the pair is not set off.
        """
        z = np.zeros(system.near.size, system.near.dtype)
        moving = self.flexible()
        m = 2 + len(moving)
        if self.preload:
            for k, i in enumerate(moving):
                share = self.pair.mean_stiffness / self.bearing_stiffness[i]
                z[2 + k] = -_IN_Y[_BEARINGS[i]] * share
        shares = self._shares()
        z[2 * m] = 1.0
        z[2 * m + 1 :: 2] = 1.0
        z[:2] = shares * (state[0] - system.near @ z)
        z[m : m + 2] = shares * (state[1] - system.near @ (system.a[1, 0] @ z))
        # The shares round; the line is to be met exactly.
        z[0] += state[0] - system.near @ z
        return z

    def as_dict(self):
        """Return the parameters as plain values, in the order of the fields."""
        values = {one.name: getattr(self, one.name) for one in fields(self)[1:]}
        for name in ("deviation", "inverse_deviation"):
            values[name] = {"cosines": values[name].cosines, "sines": values[name].sines}
        return {"pair": self.pair.as_dict(), **values}


def _stiffness(name, value):
    return checks.number(name, value, "> 0 (infinity: rigid)", lambda c: c > 0.0)

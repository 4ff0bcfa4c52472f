"""Gear pair with six degrees of freedom, rotations and bearing motions of both gears, Eq. (3), (4).

    (J3 / Rb3^2) u3'' = M3 / Rb3 - P - Q     m3 y3'' = -P - b Q - C3y y3 - k3y y3'
    (J2 / Rb2^2) u2'' = M2 / Rb2 - P - Q     m2 y2'' = +P + b Q - C2y y2 - k2y y2'
                                             m3 z3'' = -F_T - C3z z3 - k3z z3'
                                             m2 z2'' = +F_T - C2z z2 - k2z z2'

The rotations are arc lengths u_j = Rb_j phi_j; y is along the line of action, z across it. The
relative mesh displacement and the backlash line of Eq. (4) are

    y(tau) = u3 + u2 + y3 - y2 + e3 sin phi3 - e2 sin(Delta - phi2) + f(tau)
    s(tau) = -s_k + y3 - y2 + e3 sin phi3 - e2 sin(Delta - phi2) + f(tau) - f_far(tau)

and the forces between the drive-side flanks, over y, and the coast-side flanks, over y - s, are

    P = k_m y' + H1 (C(tau) y + (k - k_m) y'),        Q = H2 (C(tau) (y - s) + (k - k_m) (y - s)').

H1 is 1 in drive-side contact and H2 is 1 in coast-side contact; otherwise they are 0. By the
principle of virtual work, each force is multiplied by the derivative of its distance with respect
to the coordinate: b = d(y - s)/dy3 is 0 for the s above and 1 if the backlash does not move. Forces
do not jump when flanks touch; `docs/theory/model.md` gives the reasons and says where dampers with
k_m > k drive the motion. The friction force F_T = mu sigma(tau) C g acts across the line of action,
with g = y in drive-side contact, y - s in coast-side contact and 0 in free flight. It opposes the
sliding; its direction sigma reverses at the pitch point and half a mesh period later. The z axis is
the y axis rotated by 90 degrees in the direction in which gear 3 rotates.

The run-out is evaluated for the rotations at steady speed, phi_j = tau / teeth_j, because a
vibration of 1e-5 rad has a relative effect on the run-out of only 1e-5. The system is therefore
linear between events. Its matrices are assembled as for a train of two gears, `TwoGears`.

The paper gives only the parameters of the pair; the user chooses all others.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt

from gearlib import checks
from gearlib.engines.linear.train_system import TrainSystem
from gearlib.models.geometry.gear_stage import six_degree_parameters
from gearlib.models.harmonics import Harmonics
from gearlib.models.model import Model, create_unchecked, single_mesh_propagator
from gearlib.models.pair import GearPair, WithPair
from gearlib.models.single_mesh_system import contact_monodromy
from gearlib.models.trains import waves
from gearlib.models.trains.elements import Body, Mesh
from gearlib.models.trains.structure import (
    FLOAT_ARITHMETIC,
    Arithmetic,
    Structure,
    assemble_structure,
)
from gearlib.models.trains.train import GearTrain
from gearlib.parameters import (
    INTEGER,
    Angle,
    Boolean,
    Damping,
    Inertia,
    Length,
    Mass,
    NonNegative,
    RunOut,
    Torque,
    Unit,
    Values,
    declared,
    described,
    units_and_names,
)

_Bearing = Annotated[float, Gt(0), Unit("N/m", "1 kN/um", "infinity: rigid")]
BEARINGS = ("y3", "z3", "y2", "z2")
#: Derivatives of the relative displacement y by the bearing coordinates.
_Y_DERIVATIVES = {"y3": 1.0, "y2": -1.0, "z3": 0.0, "z2": 0.0}

#: Fields of a `Mesh` that are copied from the `GearPair` or from the `SixDegreePair`.
_MESH_FIELDS_OF_PAIR = (
    *("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash"),
    *("material_damping", "backlash_damping"),
)
_MESH_FIELDS_OF_GEARS = ("deviation", "coast_deviation", "friction", "pitch_phase")
_MESH_FIELDS_OF_GEARS += ("moving_backlash",)

#: Names of the additional recorded variables, after the columns of `gearlib.engines.orbit`.
EXTRA_VARIABLES = (
    *("rotation_3", "rotation_2", *(f"bearing_{name}" for name in BEARINGS)),
    *("coast_line", "friction_force", *(f"bearing_force_{name}" for name in BEARINGS)),
)


@declared()
class SixDegreePair(WithPair):
    """A pair of gears on elastic bearings, in SI units; immutable.

    Parameters with two values refer to gears 3 and 2, those with four values to the bearings y3,
    z3, y2 and z2. The reduced mass of `pair` only defines the tuning; the inertias determine the
    motion. The paper's reduced mass can be interpreted as `reduced_mass_torsional` or as
    `reduced_mass_free`.
    """

    force_note = property(lambda model: model.pair.force_note, doc="`GearPair.force_note`.")
    stiffness_model = property(
        lambda model: model.pair.stiffness_model, doc="`GearPair.stiffness_model`."
    )
    pair: Annotated[GearPair, described("Stiffness, load, backlash, damping")] = field()
    base_radii: Annotated[tuple[Length, ...], Values(2), described("Base radii", "Rb3, Rb2")]
    inertias: Annotated[tuple[Inertia, ...], Values(2), described("Moments of inertia", "J3, J2")]
    masses: Annotated[tuple[Mass, ...], Values(2), described("Masses", "m3, m2")]
    bearing_stiffness: Annotated[
        tuple[_Bearing, ...],
        Values(4),
        described("Stiffness of the bearings", "C3y, C3z, C2y, C2z"),
    ]
    bearing_damping: Annotated[
        tuple[Damping, ...], Values(4), described("Damping of the bearings", "k3y, k3z, k2y, k2z")
    ] = (0.0, 0.0, 0.0, 0.0)
    eccentricities: Annotated[
        tuple[RunOut, ...], Values(2), described("Run-out of the pitch circles", "e3, e2")
    ] = (0.0, 0.0)
    run_out_phase: Annotated[Angle, described("Relative phase of the run-outs", "Delta")] = 0.0
    teeth: Annotated[
        tuple[Annotated[int, Ge(1), INTEGER], ...] | None,
        Values(2),
        described("Teeth of both gears; by default the teeth of the pair"),
    ] = None
    torques: Annotated[
        tuple[Torque, ...] | None,
        Values(2),
        described("Torques M3, M2; by default they follow from the load, F Rb"),
    ] = None
    deviation: Annotated[
        Harmonics, described("Deviation of the drive-side flanks in m", "f(tau)")
    ] = Harmonics()
    coast_deviation: Annotated[
        Harmonics | None,
        described(
            "Deviation of the coast-side flanks in m; by default the deviation of the drive side"
        ),
    ] = None
    friction: Annotated[
        tuple[NonNegative, ...],
        Values(2),
        described("Friction coefficients mu of drive-side and coast-side contact"),
    ] = (0.0, 0.0)
    pitch_phase: Annotated[
        Angle,
        described("Mesh phase at which the friction changes its sign from negative to positive"),
    ] = 0.0
    moving_backlash: Annotated[
        Boolean,
        described(
            "Whether the backlash line s(tau) moves as in Eq. (4), so that bearings do not close "
            "the backlash; otherwise the coast-side flank stays s_k behind y = 0"
        ),
    ] = True
    preload: Annotated[
        Boolean,
        described(
            "Whether the bearings start with their deflection under the load instead of undeflected"
        ),
    ] = True

    extra_samples = EXTRA_VARIABLES
    propagators = {"exact": single_mesh_propagator}
    moving_flank = True
    defaults = {
        "coast_deviation": lambda model: model.deviation,
        "teeth": lambda model: (model.pair.teeth, model.pair.teeth),
        "torques": lambda model: tuple(model.pair.load * radius for radius in model.base_radii),
    }

    @classmethod
    def from_geometry(
        cls, stage: Any, *, bearing_stiffness: Any, **options: Any
    ) -> "SixDegreePair":
        """Return the pair of two gears on bearings.

        As in the paper, gear 3 is the pinion and gear 2 the wheel. Radii, masses, inertias, teeth
        and pitch phase follow from the geometry. Friction and run-out are 0 by default.

        Parameters
        ----------
        stage : gearlib.geometry.GearStage
            Geometry of both gears.
        bearing_stiffness : sequence of float
            Bearing stiffness C3y, C3z, C2y, C2z of gears 3 and 2, y along and z across the line of
            action, N/m; > 0 or infinite.
        **options
            Other parameters of the class, which replace values from the geometry, and arguments of
            `GearPair.from_geometry` such as torque and damping_ratio.
        """
        # The options that are no fields of this class are passed to `GearPair`.
        fields = {name: options.pop(name) for name in cls.__dataclass_fields__ if name in options}
        pair = GearPair.from_geometry(stage, **options)
        fields = six_degree_parameters(stage) | fields
        return cls(pair=pair, bearing_stiffness=bearing_stiffness, **fields)

    parameters = property(
        lambda model: units_and_names(type(model)),
        doc="Continuation parameters: the two phases, in rad.",
    )
    contact_monodromy = contact_monodromy
    as_dict = Model.as_dict

    @property
    def reduced_mass_torsional(self) -> float:
        """Reduced mass with rigid bearings, 1 / (Rb3^2 / J3 + Rb2^2 / J2), kg."""
        return 1.0 / sum(r * r / j for r, j in zip(self.base_radii, self.inertias, strict=True))

    @property
    def reduced_mass_free(self) -> float:
        """Reduced mass with very soft bearings, 1 / (Rb3^2/J3 + Rb2^2/J2 + 1/m3 + 1/m2), kg."""
        return 1.0 / (1.0 / self.reduced_mass_torsional + sum(1.0 / m for m in self.masses))

    @property
    def repeats(self) -> int:
        """Number of mesh periods after which the excitation, including the run-out, repeats."""
        return self.train.repeats

    @property
    def mean_forces(self) -> float:
        """Static mesh force relative to the load of the pair; negative on the coast side."""
        return float(self.train.mean_forces[0])

    def speed(self, tuning: Any) -> Any:
        """Return the speed of gear 3 in rpm at a tuning (float or array)."""
        return self.mesh_frequency(tuning) * 60.0 / (2.0 * math.pi * self.teeth[0])

    def scales(self) -> dict:
        """Return the scales of a dataset that do not depend on the speed, as a dict name -> value.

        They are the scales of the `GearPair` and the torque of gear 3 in N m.
        """
        return self.pair.scales() | {"torque": self.torques[0]}

    @property
    def size(self):
        """Number of state components: four, plus two for each elastic bearing."""
        return 4 + 2 * len(self.elastic_bearings())

    def reduction(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrices (reduce, lift) that remove and restore rigid-body rotation.

        `reduce`, shape (n - 2, n), removes rigid-body rotation from a state, which consists of
        n / 2 coordinates and n / 2 velocities, and `lift`, shape (n, n - 2), maps back to a full
        state.
        """
        n = self.size
        # The mesh depends only on the sum u3 + u2 of the rotations; their difference is the
        # rigid-body rotation. `lift` assigns the whole sum to u3 and removes u2.
        u2, u2_velocity = 1, n // 2 + 1  # indices in a full state
        u3_reduced, u3_velocity_reduced = 0, n // 2 - 1  # indices in a reduced state
        lift = np.delete(np.eye(n), [u2, u2_velocity], axis=1)
        reduce = lift.T.copy()
        reduce[u3_reduced, u2] = reduce[u3_velocity_reduced, u2_velocity] = 1.0
        return reduce, lift

    def has_damping(self) -> bool:
        """Return whether the mesh or a bearing is damped."""
        return self.pair.has_damping() or any(self.bearing_damping)

    def elastic_bearings(self) -> list[int]:
        """Return the indices of the bearings y3, z3, y2, z2 whose stiffness is finite."""
        return [i for i, stiffness in enumerate(self.bearing_stiffness) if math.isfinite(stiffness)]

    @cached_property
    def train(self):
        """The `TwoGears` from which the matrices of the pair are assembled."""
        return TwoGears(gears=self)

    def output_rows(self, system: TrainSystem) -> np.ndarray:
        """Return the row vectors that map states to the additional recorded variables.

        `EXTRA_VARIABLES` lists the variables: rotations, bearing motions, the displacement at which
        coast-side contact begins, the friction force and bearing forces. `system` is the
        `TrainSystem` of the model. The axes of the result are the 12 variables, 3 contact states,
        segments of constant stiffness, and components of a state.
        """
        pair, elastic_bearings = self.pair, self.elastic_bearings()
        m = 2 + len(elastic_bearings)  # number of coordinates: two rotations, then bearings
        constant = 2 * m  # index of the state component that is always 1
        shape = (*system.force_index.shape[:2], len(system.base_matrix))
        rows = np.zeros((len(EXTRA_VARIABLES), *shape), system.base_matrix.dtype)
        rows[0, ..., 0] = rows[1, ..., 1] = 1.0  # The first two variables are the rotations.
        # The backlash line s is the difference of the distances y and y - s of the flanks.
        rows[EXTRA_VARIABLES.index("coast_line")] = (
            system.drive_distance_rows[0] - system.coast_distance_rows[0]
        )
        if math.isinf(pair.backlash):
            rows[EXTRA_VARIABLES.index("coast_line"), ..., constant] = -pair.backlash_ratio
        # The forces of each contact state and segment are the normal force (index 0) and the
        # friction force (index 1).
        force_indices = system.force_index[:, :, 0]
        friction_outputs = system.force_output[0, force_indices, 1]
        rows[EXTRA_VARIABLES.index("friction_force")] = friction_outputs
        # This factor converts damping coefficients in N s/m to dimensionless coefficients.
        damping_scale = pair.mean_eigenfrequency * system.tuning / pair.mean_stiffness
        for column, i in enumerate(elastic_bearings, 2):
            motion_row = EXTRA_VARIABLES.index(f"bearing_{BEARINGS[i]}")
            force_row = EXTRA_VARIABLES.index(f"bearing_force_{BEARINGS[i]}")
            rows[motion_row, ..., column] = 1.0
            rows[force_row, ..., column] = self.bearing_stiffness[i] / pair.mean_stiffness
            rows[force_row, ..., m + column] = self.bearing_damping[i] * damping_scale
        return rows

    def full_state(self, system: TrainSystem, state: tuple[float, float]) -> np.ndarray:
        """Return the full state of a `TrainSystem` at phase tau = 0 for an initial mesh state.

        `state` is (y, dy/dtau) with the relative displacement y of the flanks. The full state
        consists of m coordinates, m velocities, the constant 1, and cosines and sines of the
        excitation. If `preload` is set, the bearings start with their static deflection.
        """
        z = np.zeros(len(system.base_matrix), system.base_matrix.dtype)
        elastic_bearings, drive_row = self.elastic_bearings(), system.drive_distance_rows[0]
        m = 2 + len(elastic_bearings)
        # The coordinates are two rotations, followed by the elastic bearings.
        if self.preload:
            for column, i in enumerate(elastic_bearings, 2):
                deflection = self.pair.mean_stiffness / self.bearing_stiffness[i]
                z[column] = -_Y_DERIVATIVES[BEARINGS[i]] * deflection
        # If the rotations are proportional to base radius squared over inertia, the gears start
        # without rigid-body rotation.
        fractions = [r * r / j for r, j in zip(self.base_radii, self.inertias, strict=True)]
        fractions = np.array(fractions) / np.sum(fractions)
        z[2 * m] = 1.0
        z[2 * m + 1 :: 2] = 1.0  # cosines
        z[:2] = fractions * (state[0] - drive_row @ z)
        velocity = drive_row @ (system.base_matrix @ z) / system.tuning
        z[m : m + 2] = fractions * (state[1] - velocity)
        # Correct the rounding error of the fractions, so that the displacement is exact.
        z[0] += state[0] - drive_row @ z
        return z


class _PairMesh(Mesh):
    """A mesh whose stiffness has two levels even if they are equal, as in a `GearPair`."""

    two_levels = True


@dataclass(frozen=True, kw_only=True)
class TwoGears(GearTrain):
    """The gear train from which the matrices of a `SixDegreePair` are assembled.

    The line of action is the x axis: the bearings y of the pair are the supports along x, and the
    bearings z are the supports along y. The scales are taken from the pair and do not depend on
    the torques.
    """

    gears: Any  #: the `SixDegreePair`
    arithmetic: Arithmetic = FLOAT_ARITHMETIC  #: arithmetic of the run-out phases
    bodies: tuple = ()
    meshes: tuple = ()

    def __post_init__(self) -> None:
        """Create the mesh and the bodies "3" (pinion) and "2" (wheel) from the `SixDegreePair`.

        The bodies and the mesh are not checked, because their values may be intervals, which the
        checks do not accept.
        """
        gears = self.gears
        half_pi = self.arithmetic.pi / 2.0  # a float, or an interval that encloses the number
        # The run-outs add e3 sin phi3 - e2 sin(Delta - phi2) to the relative displacement, where
        # Delta is the run-out phase and the rotations phi have opposite directions. The run-out of
        # a `Body` is a cosine of its rotation plus its eccentricity phase.
        eccentricity_phases = -half_pi, self.arithmetic.convert(gears.run_out_phase) - half_pi
        bodies = tuple(
            create_unchecked(
                Body,
                name=name,
                teeth=gears.teeth[i],
                base_radius=gears.base_radii[i],
                inertia=gears.inertias[i],
                mass=gears.masses[i],
                torque=gears.torques[i],
                support_stiffness=gears.bearing_stiffness[2 * i : 2 * i + 2],
                support_damping=gears.bearing_damping[2 * i : 2 * i + 2],
                eccentricity=gears.eccentricities[i],
                eccentricity_phase=eccentricity_phases[i],
            )
            for i, name in enumerate("32")
        )
        checks.require_damping(gears.pair.material_damping)
        values = {name: getattr(gears.pair, name) for name in _MESH_FIELDS_OF_PAIR}
        values |= {name: getattr(gears, name) for name in _MESH_FIELDS_OF_GEARS}
        mesh = create_unchecked(
            _PairMesh, name="mesh", pinion="3", wheel="2", line_of_action=0.0, phase=0.0, **values
        )
        object.__setattr__(self, "bodies", bodies)
        object.__setattr__(self, "meshes", (mesh,))
        object.__setattr__(self, "reference", "mesh")

    def assemble(self, arithmetic: Arithmetic = FLOAT_ARITHMETIC) -> Structure:
        """Return the `Structure` of the train, whose first coordinates are the rotations.

        `arithmetic` is floating-point arithmetic, or interval arithmetic to enclose rounding
        errors.
        """
        return assemble_structure(self.by_name, self.meshes, (), arithmetic, rotations_first=True)

    def segments_of(self, first: int, count: int) -> waves.Segments:
        """Return the segments of constant stiffness of one mesh period.

        All mesh periods have the same segments, so that the number `first` of the first period and
        the number `count` of periods are not used.
        """
        return waves.segments(self, first=0, count=1)

    @property
    def static_deflection(self):
        """Static deflection of the pair, m."""
        return self.gears.static_deflection

    @property
    def reference_angular_frequency(self):
        """Mean eigenfrequency of the pair, rad/s."""
        return self.gears.mean_eigenfrequency

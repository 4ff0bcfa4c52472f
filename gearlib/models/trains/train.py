"""Gear trains of bodies, shafts and meshes, a piecewise-linear model."""

import dataclasses
import math
from fractions import Fraction
from functools import cached_property
from typing import Annotated, Any

import numpy as np
import xarray as xr
from annotated_types import Ge, Gt, Le, MinLen

from gearlib import checks
from gearlib.data import summary
from gearlib.data.motions import as_float_array
from gearlib.engines import orbit
from gearlib.engines.linear.periods import EVENT_COLUMNS
from gearlib.engines.linear.train_system import TrainSystem
from gearlib.engines.pair.stiffness import force_note
from gearlib.models.model import Model
from gearlib.models.single_mesh_system import contact_monodromy
from gearlib.models.trains import layout, natural_modes, statics, train_values, turning, waves
from gearlib.models.trains.elastic import LinearModes, free_motions_and_modes
from gearlib.models.trains.elements import (
    Body,
    HarmonicForce,
    Mesh,
    Shaft,
    check_gears,
    check_names,
)
from gearlib.models.trains.structure import (
    AXES,
    FLOAT_ARITHMETIC,
    Arithmetic,
    Structure,
    assemble_structure,
    coast_jacobian,
)
from gearlib.models.trains.system import (
    DimensionlessMatrices,
    dimensionless_matrices,
    largest_norm,
    train_system,
)
from gearlib.parameters import (
    INTEGER,
    Allowed,
    Angle,
    BelowCritical,
    Boolean,
    Finite,
    Unit,
    Values,
    checked,
    declared,
    described,
)


def _matrix_propagator(model: Model, tuning: float, **options: Any) -> Any:
    """Create the closed-form integrator of a train at a tuning.

    `tuning` is the mesh frequency over the natural frequency; `options` are keyword arguments of
    the integrator class `gearlib.engines.linear.propagator.Propagator`.
    """
    # Imported on first use, because it takes time to load.
    from gearlib.engines.linear.propagator import Propagator

    return Propagator(model, tuning, **options)


_Frequency = Annotated[float, Gt(0), Unit("Hz")]

#: Number of orders of mesh frequencies.
Orders = Annotated[int, Ge(1), Le(1000), INTEGER]


@declared()
class GearTrain(Model):
    """Any number of gears in mesh, in SI units; immutable.

    Raises
    ------
    ValueError
        If a value is impossible, or if the train cannot be assembled, cannot rotate, or is not in
        equilibrium.
    """

    bodies: Annotated[tuple[Body, ...], Values(), MinLen(1), described("Gears and carriers")]
    meshes: Annotated[tuple[Mesh, ...], Values(), MinLen(1), described("Meshes of the gears")]
    shafts: Annotated[tuple[Shaft, ...], Values(), described("Shafts that join bodies")] = ()
    reference: Annotated[
        str | None,
        Allowed("the name of a mesh"),
        described("Name of the mesh that sets scales, mesh phase and tuning; by default the first"),
    ] = None
    reference_frequency: Annotated[
        _Frequency | None,
        described(
            "Mesh frequency at which the tuning is 1; by default the natural frequency of the "
            "elastic mode with the most strain energy in the reference mesh, with mean stiffness "
            "and all flanks in contact"
        ),
    ] = None
    carrier_ratio: Annotated[
        Finite,
        described(
            "Speed of the frame in which positions are given, over the speed of the reference "
            "pinion in this frame; not 0 if a carrier rotates"
        ),
    ] = 0.0
    gyroscopic: Annotated[
        Boolean,
        described(
            "Whether Coriolis and centrifugal forces of the rotating frame act on axes that can "
            "move; bodies without a carrier then lie on its axis"
        ),
    ] = False

    forces: Annotated[
        tuple[HarmonicForce, ...], Values(), described("Harmonic forces and torques on bodies")
    ] = ()

    modal_damping: Annotated[
        tuple[Annotated[BelowCritical, Le(0.999)], ...] | None,
        Values(),
        described(
            "Damping ratios of the elastic modes with mean stiffness, one for each or one for all, "
            "in addition to other damping"
        ),
    ] = None
    matrices: Annotated[
        Any,
        Allowed("omitted; see `GearTrain.from_matrices`"),
        described("Matrices of the structure, which replace bodies and shafts"),
    ] = None

    propagators = {"exact": _matrix_propagator}
    title_noun = "a gear train"
    references = (
        "Lin, Parker: J. Vib. Acoust. 121 (1999) 316-321; "
        "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"
    )

    @property
    def force_note(self) -> str:
        """A sentence about jumps of the mesh force; "" if all mesh stiffnesses are constant."""
        return force_note(min(mesh.stiffness_ratio for mesh in self.meshes))

    @property
    def force_ratio_name(self) -> str:
        """Name of the ratio of the largest to the static mesh force in datasets.

        It is "peak_force_ratio" if mesh forces jump with the stiffness, and "dynamic_factor"
        otherwise.
        """
        return "peak_force_ratio" if self.force_note else "dynamic_factor"

    @property
    def stiffness_model(self) -> str:
        """Description of the mesh stiffness for datasets and reports.

        "rectangles" means two levels of stiffness, between which mesh forces jump.
        """
        if self.force_note:
            return "rectangles"
        if any(mesh.transmission_error.table().any() for mesh in self.meshes):
            return "mean stiffness and transmission error of loaded teeth"
        return "mean stiffness"

    def __post_init__(self) -> None:
        """Set the default reference mesh; check the names, gears and torques of the train.

        Raises ValueError if a name is unknown, gears cannot mesh or be assembled, or torques do not
        balance.
        """
        valid = self.matrices is None or hasattr(self.matrices, "coordinates")
        allowed = "omitted; see `GearTrain.from_matrices`"
        checks.require(valid, "matrices", self.matrices, allowed)
        if self.reference is None:
            object.__setattr__(self, "reference", self.meshes[0].name)
        checks.check_choice("reference", self.reference, self.mesh_names)
        check_names(self)
        check_gears(self)
        statics.check_balance(self)

    @property
    def body_names(self):
        """Names of the bodies."""
        return tuple(body.name for body in self.bodies)

    @property
    def mesh_names(self):
        """Names of the meshes."""
        return tuple(mesh.name for mesh in self.meshes)

    @cached_property
    def by_name(self):
        """Bodies by name, a dict name -> `Body`."""
        return {body.name: body for body in self.bodies}

    @cached_property
    def structure(self):
        """Mass, stiffness and damping matrices of the train in SI units."""
        return self.assemble()

    def assemble(self, arithmetic: Arithmetic = FLOAT_ARITHMETIC) -> Structure:
        """Assemble the `Structure` of the train, its matrices in SI units.

        `arithmetic` is the number type, floats or balls (intervals that enclose rounding errors).
        """
        if self.matrices is not None:
            assembled = self.matrices.structure(self, arithmetic)
        else:
            assembled = assemble_structure(self.by_name, self.meshes, self.shafts, arithmetic)
        if self.modal_damping is None:
            return assembled
        # The additional damping gives the modes the damping ratios `modal_damping`.
        convert = np.vectorize(arithmetic.convert, otypes=[arithmetic.dtype])
        return assembled._replace(damping=assembled.damping + convert(self._modal_damping_matrix))

    @cached_property
    def _modal_damping_matrix(self) -> np.ndarray:
        """Damping matrix that gives the elastic modes the ratios `modal_damping`, N s/m, (n, n).

        It is the sum of 2 zeta omega (M phi) (M phi)^T over the mass-normalised modes phi.
        """
        # The modes do not depend on the damping. Without modal damping, `structure` does not call
        # this method.
        train = self.replace(modal_damping=None)
        squared_frequencies, shapes = train.linear_modes
        ratios, mode_count = np.array(self.modal_damping), squared_frequencies.size
        if ratios.size not in (1, mode_count):
            allowed = f"a damping ratio for all modes, or {mode_count}, one for each elastic mode"
            raise checks.InputError("modal_damping", self.modal_damping, allowed)
        momenta = train.structure.mass @ shapes
        return momenta * (2.0 * ratios * np.sqrt(squared_frequencies)) @ momenta.T

    @cached_property
    def coast_lines(self):
        """Jacobian of the coast-side flank distances, (m, n), see `structure.coast_jacobian`."""
        return coast_jacobian(self.structure, self.by_name, self.meshes)

    @cached_property
    def speeds(self):
        """`turning.Speeds` of the bodies, in radians per radian of reference mesh phase."""
        return turning.speeds(
            self.by_name, self.meshes, self.shafts, self.reference, self.carrier_ratio
        )

    def speeds_at(self, mesh: Mesh) -> dict[str, Fraction]:
        """Return the signed speeds of the bodies relative to the line of centres of a mesh."""
        return self.speeds.at(mesh, self.by_name)

    @cached_property
    def frequency_ratios(self) -> tuple[Fraction, ...]:
        """Frequency of each mesh over the frequency of the reference mesh, an exact fraction.

        A mesh frequency is the number of teeth of the pinion times its speed relative to the line
        of centres.
        """
        return tuple(
            abs(self.speeds_at(mesh)[mesh.pinion]) * self.by_name[mesh.pinion].teeth
            for mesh in self.meshes
        )

    @cached_property
    def phases(self):
        """Stiffness phases of the drive sides, a dict mesh name -> phase in mesh periods."""
        return turning.phases(self.by_name, self.meshes, self.shafts, self.reference, self.speeds)

    @cached_property
    def coast_phases(self) -> dict:
        """Stiffness phases of the coast sides, a dict mesh name -> phase in mesh periods.

        The stiffness phase is the middle of the upper stiffness level.
        """
        return {
            mesh.name: turning.coast_phase(mesh, self.speeds_at(mesh), self.phases[mesh.name])
            for mesh in self.meshes
        }

    @cached_property
    def pitch_phases(self):
        """Phases of drive-side contact at the pitch point, a dict mesh name -> phase in rad."""
        return {mesh.name: turning.pitch_phase(mesh, self.speeds_at(mesh)) for mesh in self.meshes}

    @cached_property
    def repeats(self):
        """Number of reference mesh periods after which the excitation repeats."""
        return waves.common_period(self)

    @cached_property
    def excitation(self):
        """Excitation by errors, deviations and run-out, see `waves.excitation`."""
        return waves.excitation(self)

    @cached_property
    def harmonic_forces(self) -> np.ndarray:
        """Cosine and sine amplitudes of the harmonic forces on n coordinates, N, shape (n, 2 h).

        Columns 2 i and 2 i + 1 belong to frequency i of the h frequencies of `excitation`.
        """
        frequencies = self.excitation[0]
        amplitudes = np.zeros((self.size // 2, 2 * frequencies.size))
        for frequency, forces in waves.force_harmonics(self, self.structure.motions).items():
            i = 2 * int(np.flatnonzero(frequencies == float(frequency))[0])
            amplitudes[:, i : i + 2] = forces.T
        return amplitudes

    @cached_property
    def segments(self):
        """Segments of constant stiffness over one period of the excitation."""
        return self.segments_of(0, self.repeats)

    def segments_of(self, first: int, count: int) -> waves.Segments:
        """Return the `Segments` of mesh phase with constant stiffness and sliding directions.

        They cover `count` periods of the reference mesh, starting with period number `first`, which
        is >= 0.
        """
        return waves.segments(self, first, count)

    @property
    def size(self):
        """Number of state components: coordinates and their rates."""
        return 2 * len(self.structure.coordinates)

    @cached_property
    def _natural_modes(self) -> LinearModes:
        """Rigid-body and elastic modes with all flanks in contact at mean stiffness."""
        spring_rows, spring_stiffness = self.structure.springs
        mean_stiffness = [mesh.mean_stiffness for mesh in self.meshes]
        rows = np.concatenate([spring_rows, self.structure.mesh_jacobian])
        stiffness = np.concatenate([spring_stiffness, mean_stiffness])
        modes = free_motions_and_modes((rows, stiffness), self.structure.masses)
        if self.matrices is None:
            return modes
        # The springs of given matrices are rounded, so that small entries are rounding errors.
        free_motions = modes.free_motions
        is_small = np.abs(free_motions) < 1e-12 * np.abs(free_motions).max(axis=0, initial=0.0)
        return modes._replace(free_motions=np.where(is_small, 0.0, free_motions))

    @property
    def free_motions(self):
        """Mass-normalised rigid-body modes, which no spring resists, shape (n, k)."""
        return self._natural_modes.free_motions

    @property
    def linear_modes(self):
        """Squared angular frequencies and mass-normalised shapes of the elastic modes."""
        return self._natural_modes.squared_frequencies, self._natural_modes.shapes

    @property
    def strains(self):
        """`LinearModes.strains` of the springs of the structure, followed by the meshes."""
        return self._natural_modes.strains

    def contact_modes(self, system: TrainSystem) -> tuple[np.ndarray, ...]:
        """Return the dimensionless natural modes with all flanks in contact at mean stiffness.

        The result is (natural frequencies, mode shapes, rigid-body modes, mass matrix), with one
        mode per column. `system` is a `TrainSystem`; only its tuning (mesh frequency over natural
        frequency) is used.
        """
        omega = self.reference_angular_frequency
        mass = self.dimensionless_matrices(system.tuning).mass
        squared_frequencies, shapes = self.linear_modes
        modes = np.hstack([shapes, self.free_motions]) * (math.sqrt(self.stiffness_scale) / omega)
        # A Newton step orthonormalizes the modes to machine precision.
        modes = modes @ (1.5 * np.eye(len(mass)) - 0.5 * (modes.T @ mass @ modes))
        elastic_count = squared_frequencies.size
        elastic_modes, rigid_body_modes = modes[:, :elastic_count], modes[:, elastic_count:]
        return np.sqrt(squared_frequencies) / omega, elastic_modes, rigid_body_modes, mass

    @cached_property
    def modal_mesh_displacements(self) -> np.ndarray:
        """Relative displacements of the flanks of m meshes in p elastic modes, shape (m, p).

        The modes are mass-normalised and computed with all flanks in contact at mean stiffness.
        """
        stiffness = np.array([mesh.mean_stiffness for mesh in self.meshes])
        # Strains are displacements times the square root of the stiffness, over the frequency.
        strains = self.strains[-stiffness.size :] / np.sqrt(stiffness)[:, None]
        return strains * np.sqrt(self._natural_modes.squared_frequencies)

    @cached_property
    def static_mesh_displacements(self) -> np.ndarray:
        """Relative displacements of m meshes of the linear train under its load, m, shape (m,)."""
        squared_frequencies, shapes = self.linear_modes
        modal_loads = shapes.T @ self.structure.load
        return self.modal_mesh_displacements @ (modal_loads / squared_frequencies)

    @property
    def reference_mesh(self):
        """The `Mesh` that defines scales, phase and tuning."""
        return self.meshes[self.mesh_names.index(self.reference)]

    @property
    def reference_pinion(self):
        """The pinion of the reference mesh, a `Body`."""
        return self.by_name[self.reference_mesh.pinion]

    @property
    def stiffness_scale(self):
        """Mean stiffness of the reference mesh, N/m."""
        return self.reference_mesh.mean_stiffness

    @cached_property
    def static_deflection(self) -> float:
        """Static deflection of the reference mesh, the unit of displacements, m; 1 um without load.

        It is the static mesh force over the mean stiffness in the linear train, in which all flanks
        are in contact at mean stiffness and errors are neglected.
        """
        squared_frequencies, shapes = self.linear_modes
        load = self.structure.load
        modal_displacements = self.modal_mesh_displacements[self.mesh_names.index(self.reference)]
        compliances = modal_displacements / squared_frequencies
        deflection = abs(compliances @ (shapes.T @ load))
        # A smaller deflection is a rounding error of terms that cancel.
        sum_of_terms = np.abs(compliances) @ (np.abs(shapes).T @ np.abs(load))
        if deflection > 1e-9 * sum_of_terms:
            return float(deflection)
        return train_values.UNLOADED_DEFLECTION

    @property
    def load(self):
        """Static deflection times mean stiffness of the reference mesh, N."""
        return self.static_deflection * self.stiffness_scale

    @cached_property
    def reference_angular_frequency(self) -> float:
        """Reference natural frequency, rad/s; the tuning is the mesh frequency divided by it.

        It is `reference_frequency` if given; otherwise it is the natural frequency of the elastic
        mode with the most strain energy in the reference mesh, at mean stiffness.
        """
        if self.reference_frequency is not None:
            return 2.0 * math.pi * self.reference_frequency
        squared_frequencies = self._natural_modes.squared_frequencies
        # The last rows of `strains` belong to the meshes; the squares are fractions of the strain
        # energy.
        energies = self.strains[self.mesh_names.index(self.reference) - len(self.meshes)] ** 2
        # Shapes of modes with equal frequencies are arbitrary, so that their energies are summed.
        sums = [
            energies[np.abs(squared_frequencies - value) < 1e-6 * value].sum()
            for value in squared_frequencies
        ]
        # If strain energies are equal up to rounding, the lowest frequency is used.
        i = int(np.argmax(np.array(sums) > 0.999999 * max(sums)))
        return math.sqrt(squared_frequencies[i])

    def mesh_frequency(self, tuning: Any) -> Any:
        """Return the angular frequency of the reference mesh, rad/s (float or array)."""
        return tuning * self.reference_angular_frequency

    def speed(self, tuning: Any) -> Any:
        """Return the speed of the reference pinion in rpm at a tuning (float or array)."""
        pinion_rate = abs(float(self.speeds.in_housing[self.reference_pinion.name]))
        return 60.0 / (2.0 * math.pi) * self.mesh_frequency(tuning) * pinion_rate

    def scales(self) -> dict:
        """Return the dataset variables that do not depend on the tuning.

        The result maps names to values or to (dimension, values). Most of the variables convert
        dimensionless results to SI units.
        """
        return {
            "static_deflection": self.static_deflection,
            "force_scale": self.load,
            "stiffness_scale": self.stiffness_scale,
            "torque": ("body", [body.torque for body in self.bodies]),
        }

    def has_damping(self) -> bool:
        """Return whether a mesh, support or shaft is damped."""
        in_meshes = any(mesh.material_damping or mesh.backlash_damping for mesh in self.meshes)
        return in_meshes or bool(self.structure.damping.any())

    def dimensionless_matrices(self, tuning: float) -> DimensionlessMatrices:
        """Return the dimensionless matrices without the meshes at a tuning."""
        return dimensionless_matrices(self, tuning)

    def as_dict(self) -> dict:
        """Return the parameters as a dict of plain values.

        Given matrices are represented by their hash, and elements of the train by dicts.
        """
        if self.matrices is None:
            return super().as_dict()
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        fields["matrices"] = self.matrices.digest()
        for name in ("bodies", "meshes", "shafts", "forces"):
            fields[name] = tuple(dataclasses.asdict(element) for element in fields[name])
        return fields

    def system(self, tuning: float, first: int = 0, count: int | None = None) -> TrainSystem:
        """Return the `TrainSystem` at a tuning, the state-space matrices for all phase segments.

        `tuning` is the mesh frequency over the natural frequency. The stiffness is constant in each
        segment. If `count` is given, the segments cover only `count` periods of the reference mesh,
        starting with period number `first`; otherwise they cover one period of the excitation.
        """
        if count:
            return train_system(self, tuning, self.segments_of(first, count))
        if self.gyroscopic or self.excitation[0].size:
            return train_system(self, tuning, self.segments)
        # In all other trains the matrices do not depend on the tuning and are computed only once.
        return self._system._replace(tuning=tuning)

    @cached_property
    def norm_at_rest(self):
        """Upper bound of the norms of the state matrices without gyroscopic forces.

        It limits the steps of the engines and does not depend on the tuning.
        """
        return largest_norm(self, self.dimensionless_matrices(1.0))

    @cached_property
    def _system(self):
        """The `TrainSystem` (state-space matrices) at the tuning 1.

        Without gyroscopic forces and excitation, only its field `tuning` depends on the tuning.
        """
        return train_system(self, 1.0, self.segments)

    @checked
    def static(self, phase: Angle = 0.0) -> xr.Dataset:
        """Return the static equilibrium of the train, with backlash and errors.

        Parameters
        ----------
        phase : float, default 0
            Phase of the reference mesh, rad, at which stiffness and errors are evaluated.

        Returns
        -------
        xarray.Dataset
            Over `mesh`: mesh_force (N), contact (1 drive side, 0 none, -1 coast side), load_sharing
            (force over the mean force of the meshes of the same central gear); over `body` and
            `axis`: body_displacement (m); and status: jammed if both flanks of a mesh touch, so
            that mesh_force is the sum of both forces.

        Raises
        ------
        ValueError
            If there is no equilibrium.
        """
        return statics.static(self, phase)

    def modes(self) -> xr.Dataset:
        """Return the natural modes with mean mesh stiffness and all flanks in contact.

        Returns
        -------
        xarray.Dataset
            Over `mode`: natural_frequency (Hz), mode_kind (rigid, rotational, translational,
            satellite, other), mode_shape over body and axis, strain_energy over mesh, shaft_energy
            over shaft. With damping also modal_damping_ratio, which neglects the coupling of modes
            by damping, and over `complex_mode`, the eigenvalues of the damped train: decay_rate
            (1/s), damped_frequency (Hz), mode_shape_real and mode_shape_imag over body and axis.
        """
        return natural_modes.modes(self)

    @classmethod
    def from_matrices(cls, mass, damping, stiffness, meshes, gears, **options: Any) -> "GearTrain":
        """Return a train given by mass, damping and stiffness matrices, e.g. from rotor software.

        `meshes` and `gears` connect coordinates of the matrices; `options` are keyword arguments of
        `gearlib.models.trains.matrices.from_matrices`, which describes all arguments.
        """
        from gearlib.models.trains.matrices import from_matrices

        return from_matrices(mass, damping, stiffness, meshes, gears, **options)

    def reduce(self, frequency: float) -> "GearTrain":
        """Return a train with fewer coordinates and the same dynamics up to half a frequency in Hz.

        The reduction keeps the coordinates on which meshes, loads and harmonic forces act, and the
        modes of the other coordinates below 1.5 times `frequency` (Craig and Bampton, AIAA J. 6
        (1968) 1313-1319). The attribute ``matrices.left_out`` describes the neglected coordinates.

        Raises
        ------
        ValueError
            If the train was not created by `from_matrices`, or the frequency is not > 0.
        """
        from gearlib.models.trains.matrices import reduce_train

        return reduce_train(self, frequency)

    def state_space(self, inputs=None, outputs=None) -> Any:
        """Return the linear state space about the loaded state, with all flanks at mean stiffness.

        `inputs` are names of forces, and `outputs` are names of motions or forces; see
        `gearlib.state_space`.
        """
        from gearlib.models.trains.linear_systems import state_space

        return state_space(self, inputs, outputs)

    @checked
    def phasing(self, count: Orders = 12) -> xr.Dataset:
        """Return the modal forces by which harmonics of the mesh frequencies excite the modes.

        The mesh stiffness and the transmission error of the teeth cause these forces.

        Parameters
        ----------
        count : int, default 12
            Highest order of the harmonics, relative to the reference mesh frequency.

        Returns
        -------
        xarray.Dataset
            Over `stiffness_order` and `mode`: modal_force, phase_sum (0: the meshes cancel each
            other, 1: all meshes in phase), excites.
        """
        return natural_modes.phasing(self, count)

    @checked
    def campbell(self, count: Orders = 3) -> xr.Dataset:
        """Return the critical speeds, at which mesh harmonics coincide with natural frequencies.

        The natural frequencies are computed by `modes` and do not depend on the speed.

        Parameters
        ----------
        count : int, default 3
            Highest order of each mesh frequency.

        Returns
        -------
        xarray.Dataset
            The dataset of `phasing` at these orders, and critical_speed over `stiffness_order` and
            `mode`, in rpm of the reference pinion.
        """
        return natural_modes.campbell(self, count)

    @cached_property
    def _static_state(self) -> np.ndarray:
        """State of static equilibrium at phase 0, the initial state of sweeps."""
        return self._static_state_under(1.0)

    def _static_state_under(self, load_ratio: float) -> np.ndarray:
        """Return the state of static equilibrium at phase 0, with all torques scaled."""
        q = statics.equilibrium(self, load_ratio=load_ratio).q
        return np.append(q / self.static_deflection, np.zeros(q.size))

    def static_state(self, tuning: float, load: float = 1.0) -> tuple[float, ...]:
        """Return the state of static equilibrium at mesh phase 0.

        The state consists of coordinates, in units of the static deflection, and their rates.
        `load` is a factor on all torques; `tuning` has no effect. If there is no equilibrium, the
        result is (0, 0), at which flanks just touch.
        """
        try:
            state = self._static_state if load == 1.0 else self._static_state_under(load)
            return tuple(state.tolist())
        except ValueError:  # A mesh with infinite backlash opens permanently.
            return 0.0, 0.0

    def start_state(self, initial_state: Any) -> np.ndarray:
        """Return the initial state (q, dq/dtau) as an array, shape (size,).

        tau is the mesh phase in rad, and q is in units of the static deflection. `initial_state` is
        the state itself, (0, 0) for all zeros, so that flanks without errors just touch, or
        "static" for the static equilibrium with the stiffness at tau = 0, without forces of a
        rotating frame. Raises ValueError for anything else.
        """
        if isinstance(initial_state, str):
            checks.check_choice("initial_state", initial_state, ("static",))
            return self._static_state.copy()
        state = as_float_array(initial_state)
        if state.shape == (2,) and not state.any():
            return np.zeros(self.size)
        if state.shape != (self.size,) or not np.all(np.isfinite(state)):
            raise checks.InputError(
                "initial_state", initial_state, f"(0, 0), 'static' or {self.size} finite numbers"
            )
        return state.copy()

    train = property(lambda self: self, doc="The train itself.")

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the components of the state: coordinates, then their rates over the phase."""
        names = [f"{body} {axis}".strip() for body, axis in self.structure.coordinates]
        return (*names, *(f"{name}'" for name in names))

    @property
    def flank_lines(self) -> np.ndarray:
        """Displacements at which (drive, coast) contact begins, in static deflections, (2, m)."""
        backlash = np.array([mesh.backlash for mesh in self.meshes])
        return np.stack([np.zeros(backlash.size), -backlash / self.static_deflection])

    def check_state(self, initial_state: Any) -> Any:
        """Check an initial state, and return it as "static" or as a tuple of numbers.

        The tuple contains all coordinates and rates, or is (0, 0) for zeros. Raises ValueError for
        anything else.
        """
        state = self.start_state(initial_state)
        if isinstance(initial_state, str):
            return initial_state
        return tuple(map(float, np.ravel(initial_state)[: state.size]))

    parameters, parameter = train_values.PARAMETERS, train_values.shared_value
    with_parameter = train_values.with_shared_value
    settable = property(train_values.settable, doc="See `Model.settable`.")
    value, with_values = train_values.value, train_values.with_values
    contact_monodromy = contact_monodromy

    def disturbed_state(self, state: Any, disturbance: float) -> tuple[float, ...]:
        """Return an initial state to which a multiple of the first elastic mode is added.

        `disturbance` is the largest displacement of the added mode in units of the static
        deflection.
        """
        state = self.start_state(state)
        # The columns of `lift` are states of the elastic modes whose largest entry is 1.
        _, lift = self.reduction()
        return tuple(map(float, state + disturbance * lift[:, 0]))

    def coordinates(self) -> dict[str, list]:
        """Return the dataset coordinates of the train as a dict name -> labels."""
        return {"component": list(self.components)} | self.names

    @property
    def names(self) -> dict[str, list]:
        """Labels of the dataset dimensions mesh, body and axis."""
        names = {"mesh": self.mesh_names, "body": self.body_names, "axis": AXES}
        return {dimension: list(values) for dimension, values in names.items()}

    def empty_record(self, samples: int = 0, events: int = 16) -> tuple:
        """Allocate uninitialized tables (samples, events, summary) for the record of a run.

        `samples` and `events` are the numbers of rows of the first two tables; the summary has one
        row per mesh. The columns of the samples are displacement, velocity, acceleration, contact,
        stiffness and force for each mesh, followed by the coordinates.
        """
        m = len(self.meshes)
        sample_columns = m * orbit.SAMPLE_COLUMNS + self.size // 2
        shapes = (samples, sample_columns), (events, EVENT_COLUMNS), (m, orbit.SUMMARY_COLUMNS)
        return tuple(map(np.empty, shapes))

    def extra_sample_variables(self, samples: np.ndarray) -> dict[str, tuple]:
        """Return the motions of the bodies as a dataset variable {name: (dims, values)}.

        The last columns of the table `samples`, shape (samples, columns), are the coordinates.
        """
        coordinate_count = self.size // 2
        coordinates = samples[:, samples.shape[1] - coordinate_count :]
        motion = np.einsum("ban,kn->kba", self.structure.motions, coordinates)
        return {"body_motion": (("phase", "body", "axis"), motion)}

    def extra_summary_variables(self, dims: tuple, summaries: np.ndarray, span: float) -> dict:
        """Return force ratios and load sharing of the meshes as variables name -> (dims, values).

        The force ratio is the largest force over the static force of the linear train, in absolute
        values; it is NaN for a mesh without load. `summaries`, shape (..., m, columns), are summary
        tables of runs, `dims` are the dimensions of all axes but the last, and `span` is the phase
        of the record in rad.
        """
        force_ratios = self.force_ratios(summary.largest_force(summaries))
        shares = statics.load_shares(self, summaries[..., orbit.FORCE_SUM] / span)
        return {self.force_ratio_name: (dims, force_ratios), "load_sharing": (dims, shares)}

    def layout(self) -> xr.Dataset:
        """Return the positions of the gears, without assembly errors, and their speeds.

        The origin is the axis of the first carrier or, without carriers, of the first body.

        Returns
        -------
        xarray.Dataset
            Over `body`: body_x, body_y, body_radius (m), body_turns, carried_by, shaft_line; over
            `mesh`: mesh_x, mesh_y (m) and, over `gear` too, mesh_gear, pitch_radius (m); and
            frame_turns, misfit (m). body_turns and frame_turns are the speeds of the bodies and of
            the frame of the positions in the housing, in radians per radian of reference mesh
            phase; misfit is the largest distance between positions of the same axis that follow
            from different paths of meshes and shafts.
        """
        return layout.layout(self)

    @property
    def mean_forces(self):
        """Static mesh forces of the linear train relative to the load, shape (m,).

        In the linear train, all flanks are in contact at mean stiffness and errors are neglected. A
        negative force loads the coast side.
        """
        mean_stiffness = np.array([mesh.mean_stiffness for mesh in self.meshes])
        forces = mean_stiffness * self.static_mesh_displacements / self.load
        # Smaller forces are rounding errors of meshes without load.
        return np.where(np.abs(forces) > 1e-9 * np.abs(forces).max(), forces, 0.0)

    def reduction(self) -> tuple[np.ndarray, np.ndarray]:
        """Return matrices (reduce, lift) from states to elastic mode amplitudes, and back.

        They remove and restore rigid-body rotation in coordinates and rates. Coriolis forces
        exchange angular momentum between elastic modes and rigid-body rotation; `lift` conserves
        the sum. Raises ValueError if other forces act on the rigid-body rotation.
        """
        free = self.free_motions
        _, shapes = self.linear_modes
        structure, frame_rate = self.structure, 0.0
        forces = [structure.damping]
        if self.gyroscopic:
            # This speed is per radian of mesh phase, like the rates of a state.
            frame_rate = float(self.speeds.frame)
            forces += [structure.centrifugal, structure.circulatory, free.T @ structure.coriolis]
            if any(max(mesh.friction) for mesh in self.meshes):
                forces.append(structure.sliding_jacobian)
        for matrix in forces:
            # The tolerance is relative to the magnitudes of the terms, which may cancel.
            if (np.abs(matrix @ free) > 1e-9 * (np.abs(matrix) @ np.abs(free))).any():
                raise ValueError(
                    "this train is not allowed here: neither damping nor, with gyroscopic = True, "
                    "friction or centrifugal forces must act on its rigid-body rotation"
                )
        # The largest entry of a lifted mode is 1, so that residuals are in units of the static
        # deflection.
        scale = np.abs(shapes).max(axis=0)
        reduce_coordinates = (structure.mass @ shapes * scale).T
        lift_coordinates = shapes / scale
        lift, n = np.kron(np.eye(2), lift_coordinates), len(shapes)
        momentum_change = free.T @ structure.coriolis @ lift_coordinates
        lift[n:, : scale.size] -= frame_rate * free @ momentum_change
        return np.kron(np.eye(2), reduce_coordinates), lift

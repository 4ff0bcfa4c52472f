"""Base class of all models, with the attributes that simulations and analyses use.

A new model is a frozen dataclass that derives from `Model`, with an entry in
``gearlib/__init__.py``. A model of one degree of freedom defines ``equation``; everything else has
a default. A model with more coordinates defines ``size`` and the ``train`` of its matrices, or a
piecewise-linear ``system`` with ``contact_modes``, ``full_state``, ``propagators``,
``flank_lines`` and ``has_damping``. Callers never check the class of a model.
"""

import dataclasses
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.engines.codes import COAST, DRIVE
from gearlib.models.pair_parameters import RATIO_NAMES, RATIOS, ratio_fields
from gearlib.models.profiles import Profile
from gearlib.parameters import Numbers, State, check, declared_parameters
from gearlib.units import cf_units

#: Ratio of displacement to the characteristic length of a model above which a motion is unbounded.
UNBOUNDED_FACTOR = 1e8


class Model:
    """A simulated system: its parameters, equations of motion, engines and names of variables."""

    # State and equations of motion.
    size: Any = 2  #: number of state components: coordinates, then their derivatives by the phase
    repeats: Any = 1  #: periods of phase after which the excitation repeats
    pair: Any = None  #: the `GearPair` that defines tuning and scales, or None
    equation: Any = None  #: the `Equation` of a model with one degree of freedom
    train: Any = None  #: the `GearTrain` with the matrices of a model with several coordinates
    gyroscopic: Any = False  #: whether the forces of a rotating frame of reference act
    profile: Any = None  #: the `Profile` of the mesh stiffness, where it can be chosen
    #: Functions of the tuning: speed in rpm and mesh frequency in rad/s; None if nothing rotates.
    speed: Any = None
    mesh_frequency: Any = None
    static_deflection: Any = None  #: scale of displacements of models with rotating gears, m
    mean_forces: Any = 1.0  #: static mesh forces over the load, (m,); negative on the coast side
    #: Whether the model obeys Eq. (3) with one coordinate and equal flanks at 0 and -s, which
    #: fixed-step methods and harmonic balance require.
    has_pair_equation: bool = False
    moving_flank: bool = False  #: whether the coast-side flank moves relative to `flank_lines`

    # Parameters.
    defaults: dict = {}  #: field name -> function of the model that returns its default
    #: Continuation parameters of orbits, in addition to the ratios: name -> (CF units, long_name)
    parameters: Any = {}
    nonlinear: tuple = ()  #: parameters that make the motion in contact nonlinear

    # Results.
    mesh_names: Any = ()  #: labels of the dimension mesh, or () if results have none
    components: Any = ("displacement", "velocity")  #: names of the components of the final state
    extra_samples: tuple = ()  #: names of sampled variables that only this model has
    long_names: dict = {}  #: variable name -> long_name, if it differs from a gear mesh
    title_noun: str = "a gear mesh"  #: the model in titles of datasets
    slowest_tuning: Any = 0.0  #: tuning below which a duty point is quasi-static
    force_note: Any = ""  #: a sentence about the forces in results, or ""
    stiffness_model: Any = ""  #: description of the mesh model and its stiffness, or ""
    #: Name of the ratio of largest to static mesh force: "dynamic_factor" if teeth come into mesh
    #: under load, "peak_force_ratio" for a prescribed stiffness, which may jump.
    force_ratio_name: Any = "peak_force_ratio"
    references: str = "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"

    def __post_init__(self):
        """Set fields that are None to their default values.

        `defaults` maps field names to functions that compute the default from the model.
        """
        for name, default in self.defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, default(self))

    @property
    def piecewise_linear(self) -> bool:
        """Whether the motion between two contact events is linear and has a closed-form solution.

        A model without an `Equation` is given by matrices, which are always piecewise linear.
        """
        return self.equation is None or self.equation.is_piecewise_linear()

    @property
    def propagators(self) -> dict[str, Callable]:
        """Factories of integrators as a dict method name -> function; the first is the default.

        Each function takes the model, the tuning (mesh frequency over natural frequency) and
        options. "exact" uses closed forms, which require a piecewise-linear model, and "taylor"
        uses Taylor series.
        """
        propagators = {"taylor": taylor_propagator}
        if self.piecewise_linear:
            propagators = {"exact": single_mesh_propagator} | propagators
        return propagators

    @property
    def speed_course_propagator(self) -> Callable | None:
        """Factory of integrators for a speed that changes with time, a function of the model.

        It is None if the model is not piecewise linear.
        """
        return _speed_course_propagator if self.piecewise_linear else None

    def steps_per_period(self, tuning: float) -> float:
        """Return the minimum number of integration steps per mesh period; 1 for closed forms."""
        return 1.0

    def propagator(self, tuning: float, method: str | None = None, **options: Any) -> Any:
        """Return the integrator of the model at a tuning.

        `tuning` is the frequency of the excitation over the natural frequency. `method` is a key of
        `propagators`, e.g. "exact"; the default is the first key. `options` are keyword arguments
        of the integrator class.
        """
        propagators = self.propagators
        if not method:
            method = next(iter(propagators))
        return propagators[method](self, float(tuning), **options)

    def nonlinear_mesh(self, tuning: float, tolerance: float = 0.0) -> Any:
        """Return the constants of a model with one degree of freedom, as a `NonlinearMesh`.

        `tuning` is the mesh frequency over the natural frequency, and `tolerance` is the error
        tolerance of a step of the integration by Taylor series.
        """
        return self.equation.nonlinear_mesh(tuning, tolerance)

    def system(self, tuning: float) -> Any:
        """Return the matrices of a piecewise-linear model at a tuning as a `TrainSystem`.

        `tuning` is the mesh frequency over the natural frequency.
        """
        return (self.train or self.equation).system(tuning)

    def contact_modes(self, system: Any) -> tuple[np.ndarray, ...]:
        """Return the dimensionless natural modes with all loaded flanks in contact.

        The result is (natural frequencies, mode shapes, rigid-body modes, mass matrix), with one
        mode per column. `system` is a `TrainSystem`, the matrices of the model at a tuning. A model
        with one degree of freedom has one elastic mode and no rigid-body mode.
        """
        if self.train:
            return self.train.contact_modes(system)
        identity = np.ones((1, 1))
        return np.array([self.equation.natural_frequency]), identity, np.zeros((1, 0)), identity

    def output_rows(self, system: Any) -> np.ndarray:
        """Return the row vectors that map states to additional recorded variables, (e, 3, p, n).

        The axes are e variables, 3 contact states (coast side, none, drive side), p segments of
        constant stiffness, and n components of a state of `system`, a `TrainSystem`. The base class
        has no additional variables, e = 0.
        """
        contact_state_count, segment_count, _ = system.force_index.shape
        return np.zeros((0, contact_state_count, segment_count, len(system.base_matrix)))

    def full_state(self, system: Any, state: tuple[float, float]) -> np.ndarray:
        """Return the full state of a `TrainSystem` at phase tau = 0.

        `state` is (displacement, velocity dx/dtau). The full state has further components, such as
        the constant 1 and the harmonics of the excitation, which are set to 0 here.
        """
        full_state = np.zeros_like(system.drive_distance_rows[0])
        full_state[:2] = state
        return full_state

    def check_state(self, initial_state: Any) -> Any:
        """Check an initial state and return it: (displacement, dx/dtau), or all state components.

        `initial_state` is a sequence of numbers, or the string "static" for the static equilibrium.
        """
        if isinstance(initial_state, str) and initial_state == "static":
            return self.static_state(1.0)  # It does not depend on the tuning.
        if isinstance(initial_state, (tuple, list)) and len(initial_state) == self.size > 2:
            return check("initial_state", initial_state, Numbers)
        return check("initial_state", initial_state, State)

    def static_state(self, tuning: float, load: float = 1.0) -> tuple[float, ...]:
        """Return the static equilibrium just after phase 0, at rest, as an `initial_state`.

        Damping and inertia, including the inertia of a deviation, are neglected. The coast-side
        flanks carry a negative load: x = -backlash - deflection.

        Parameters
        ----------
        tuning : float
            Tuning at which a run starts. The forces of a rotating frame of reference are neglected,
            so that the equilibrium is the same at all tunings.
        load : float, default 1
            Factor on the load of the model, i.e. on all torques of a train.

        Returns
        -------
        tuple of float
            Displacement and velocity by phase, or all state components of models with several
            coordinates. Without a load, and under a load that no flank can carry, it is (0, 0) for
            gears, whose flanks just touch, and the undeflected position closest to 0 for other
            models.
        """
        if self.train is not None:
            return self.train.static_state(tuning, load)
        return self.equation.static_displacement(load), 0.0

    @property
    def settable(self) -> dict[str, tuple[str, str]]:
        """Finite numbers that `with_values` can change, as a dict name -> (CF units, description).

        A name is a field of the model or of its `GearPair`, an entry of a tuple such as
        ``masses[0]``, or a ratio of the pair such as ``damping_ratio`` (a key of `RATIOS`).
        """
        settable: dict = {}
        models = [self] if self.pair is None else [self, self.pair]
        for model in models:
            declarations = declared_parameters(type(model))
            for name, value in field_values(model).items():
                units, description = "1", name
                if name in declarations:
                    units = cf_units(declarations[name].unit)
                    description = declarations[name].long_name
                # An infinite value, such as an unlimited backlash, cannot be varied.
                if type(value) is float and math.isfinite(value):
                    settable.setdefault(name, (units, description))
                elif isinstance(value, tuple) and all(type(entry) is float for entry in value):
                    for i, entry in enumerate(value):
                        if math.isfinite(entry):
                            settable[f"{name}[{i}]"] = units, f"{description} [{i}]"
        if self.pair:
            settable |= {name: ("1", description) for name, description in RATIO_NAMES.items()}
        return settable

    def value(self, name: str) -> float:
        """Return a number of the model by its name.

        `name` is a key of `settable`: a field such as ``load``, or an entry of a tuple such as
        ``masses[0]``.
        """
        field, _, index = name.rstrip("]").partition("[")  # "masses[0]" -> "masses", "0"
        value = getattr(self, field)
        return value[int(index)] if index else value

    def with_values(self, new_values: dict[str, float]) -> "Model":
        """Return a copy of the model with new values of some of its numbers.

        `new_values` maps names to values. A name is a key of `settable`: a field, an entry of a
        tuple such as ``masses[0]``, or a ratio such as ``damping_ratio``. Ratios are set last, so
        that they refer to the changed fields.
        """
        fields: dict = {}
        for name, value in new_values.items():
            field, _, index = name.rstrip("]").partition("[")
            if index:
                entries = list(fields.get(field, getattr(self, field)))
                entries[int(index)] = value
                fields[field] = tuple(entries)
            elif name not in RATIOS:
                fields[name] = value
        model = self.replace(**fields)
        for name in RATIOS:
            if name in new_values:
                model = model.replace(**ratio_fields(model.pair, name, new_values[name]))
        return model

    parameter = value

    def with_parameter(self, name: str, value: float) -> Any:
        """Return a copy of the model with a new value of `name`, a key of `parameters`."""
        return dataclasses.replace(self, **{name: value})  # type: ignore[type-var]

    def disturbed_state(self, state: tuple[float, ...], disturbance: float) -> tuple:
        """Return an initial state with a disturbance added to its first displacement."""
        return state[0] + disturbance, *state[1:]

    def empty_record(self, samples: int = 0, events: int = 16) -> tuple:
        """Allocate uninitialized tables (samples, events, summary) for the record of a run.

        `samples` and `events` are the numbers of rows of the first two tables; the summary is a
        single row of extrema and sums. The table of samples has additional columns for the
        `extra_samples` of the model.
        """
        from gearlib.engines import orbit  # Imported here, so that models load without kernels.

        sample_table = np.empty((samples, orbit.SAMPLE_COLUMNS + len(self.extra_samples)))
        event_table = np.empty((events, orbit.EVENT_COLUMNS))
        return sample_table, event_table, np.empty(orbit.SUMMARY_COLUMNS)

    def extra_sample_variables(self, samples: np.ndarray) -> dict[str, tuple]:
        """Return the sampled variables that only this model has, as a dict name -> (dims, values).

        Their names are `extra_samples`, and their values are the last columns of the table
        `samples`, shape (samples, columns).
        """
        first_extra_column = samples.shape[1] - len(self.extra_samples)
        columns = samples.T[first_extra_column:]
        variables = {}
        for name, column in zip(self.extra_samples, columns, strict=True):
            variables[name] = ("phase",), column
        return variables

    def extra_summary_variables(self, dims: tuple, summaries: np.ndarray, span: float) -> dict:
        """Return the summary variables that only this model has, as a dict name -> (dims, values).

        `summaries` contains the extrema and sums of recorded runs; its last axis has the columns
        of a summary, and `dims` are the dimensions of the other axes. `span` is the phase of the
        record in rad. The base class has no such variables.
        """
        return {}

    def coordinates(self) -> dict[str, list]:
        """Return the dataset coordinates of the model as a dict name -> labels."""
        return {"component": list(self.components)}

    def reduction(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrices (reduce, lift) that remove and restore rigid-body rotation.

        `reduce` maps a full state to a state without rigid-body rotation, and `lift` maps it back.
        In the base class, which has no rigid-body rotation, both are identity matrices.
        """
        return np.eye(self.size), np.eye(self.size)

    @property
    def flank_lines(self) -> Any:
        """Displacements at which drive-side and coast-side contact begin, as a tuple."""
        return self.equation.upper, self.equation.lower

    @property
    def loaded_sides(self) -> np.ndarray:
        """Contact states under the static load: 1 drive side, -1 coast side.

        The shape is (m,) for m meshes, and () for a model with a single mesh.
        """
        return np.where(np.asarray(self.mean_forces) < 0.0, COAST, DRIVE)

    def force_ratios(self, largest_forces: Any) -> Any:
        """Return the ratio of the largest to the static mesh force of each mesh.

        `largest_forces` are absolute values relative to the load of the model; for trains the last
        axis is the mesh. The ratio is NaN for meshes without a static force.
        """
        static_forces = np.abs(self.mean_forces)
        return largest_forces / np.where(static_forces > 0.0, static_forces, math.nan)

    def clearances(self, minima: np.ndarray, maxima: np.ndarray) -> np.ndarray:
        """Return the margins by which the loaded flanks stay in contact.

        `minima` and `maxima` are the extrema of the displacement of each mesh. A drive-side flank
        loses contact if the minimum falls below the displacement at which its contact begins, and a
        coast-side flank if the maximum exceeds this displacement; the margin is then negative. All
        values are in units of the static deflection.
        """
        drive_line, coast_line = self.flank_lines
        return np.where(self.loaded_sides == COAST, coast_line - maxima, minima - drive_line)

    @property
    def extent(self) -> float:
        """Characteristic length of the model in its unit of displacement, at least 1.

        It is the maximum of the displacements at which contact begins, the deflection under the
        mean and alternating force, and the amplitude of the flank deviation.
        """
        positions = np.abs(np.ravel(self.flank_lines))
        lengths = [1.0, *positions[np.isfinite(positions)].tolist()]
        if self.equation is not None:
            equation = self.equation
            # The first column of the harmonics is the order; the others are amplitudes.
            force = abs(equation.load) + np.abs(equation.force[:, 1:]).sum()
            lengths.append(force / equation.natural_frequency**2)
            lengths.append(np.abs(equation.deviation[:, 1:]).sum())
        return float(max(lengths))

    def displacement_limit(self, tuning: float, state: Any = (0.0, 0.0)) -> float:
        """Return the displacement above which a motion is treated as unbounded.

        It is `UNBOUNDED_FACTOR` times the largest of the characteristic length of the model and
        the components of the initial `state`, which consists of n displacements and n velocities by
        mesh phase, or is a name such as "static". `tuning`, the frequency of the excitation over
        the natural frequency, converts velocities by phase to velocities by time.
        """
        lengths = [self.extent]
        if not isinstance(state, str):
            n = len(state) // 2
            displacements, velocities = state[:n], state[n:]
            lengths += [abs(x) for x in displacements] + [tuning * abs(v) for v in velocities]
        return UNBOUNDED_FACTOR * max(lengths)

    def has_damping(self) -> bool:
        """Return whether damping acts in contact or in free flight."""
        equation = self.equation
        # The rows are coast-side contact, free flight and drive-side contact.
        coast_damping, flight_damping, drive_damping = equation.damping
        has_coast_damping = math.isfinite(equation.lower) and coast_damping.any()
        return bool(has_coast_damping or flight_damping.any() or drive_damping.any())

    def scales(self) -> dict:
        """Return the dataset variables that do not depend on the tuning, a dict name -> value."""
        return {}

    def tuning_at(self, speed: Any) -> Any:
        """Return the tuning (mesh over natural frequency) at a speed of the reference gear in rpm.

        `speed` is a float or an array.
        """
        return speed / self.speed(1.0)

    def tuning_from(self, reference: Any, tuning: Any) -> Any:
        """Convert a tuning of another model to the tuning of this model at the same speed.

        A tuning is the mesh frequency over the natural frequency, which differs between models.
        `reference` is the other model, and `tuning`, a float or an array, is its tuning.
        """
        return float(reference.speed(1.0) / self.speed(1.0)) * tuning

    @property
    def periods_per_revolution(self) -> float:
        """Number of mesh periods per revolution of the reference gear, not always an integer."""
        return float(self.mesh_frequency(1.0)) * 60.0 / (math.tau * float(self.speed(1.0)))

    def speed_scales(self, tuning: Any) -> dict:
        """Return the scales of a dataset that depend on the tuning, as a dict name -> value.

        The scales convert dimensionless results to SI units; the entry "speed" is in rpm. `tuning`
        is the mesh frequency over the natural frequency, a float or an array. A model without
        rotating bodies has no such scales.
        """
        if self.speed is None:
            return {}
        frequency = self.mesh_frequency(tuning)
        return {
            "mesh_frequency": frequency,
            "velocity_scale": self.static_deflection * frequency,
            "acceleration_scale": self.static_deflection * (frequency * frequency),
            "speed": self.speed(tuning),
        }

    def as_dict(self) -> dict:
        """Return the parameters as a dict of plain values, in the order of the fields.

        A stiffness profile is represented by a dict with its kind and its parameters.
        """
        profiles = {
            name: value.as_dict()
            for name, value in field_values(self).items()
            if isinstance(value, Profile)
        }
        return dataclasses.asdict(self) | profiles

    def replace(self, **changes: Any) -> Any:
        """Return a checked copy with changed parameters of the model or of its `GearPair`.

        If both have a field of that name, the field of the model is changed. Fields that have their
        default value are recomputed from the changed fields: a new load of a `SixDegreePair` with
        default torques also changes its torques.

        Raises
        ------
        ValueError
            If a name is unknown, or the model does not allow a value.
        """
        model_fields = field_values(self)
        all_fields = model_fields | (field_values(self.pair) if self.pair else {})
        checks.check_parameter_names(type(self).__name__, changes, list(all_fields))
        # Fields that are None get their default value when the new model is created.
        recomputed = {
            name: None
            for name, default in self.defaults.items()
            if name not in changes and getattr(self, name) == default(self)
        }
        pair_changes = {name: changes.pop(name) for name in {*changes} - {*model_fields}}
        pair = changes.get("pair", self.pair)
        if pair_changes and is_model(pair):
            changes["pair"] = pair.replace(**pair_changes)
        return dataclasses.replace(self, **changes, **recomputed)  # type: ignore[type-var]


# Engines are imported on first use, because they take time to load.


def single_mesh_propagator(model: Model, tuning: float, **options: Any) -> Any:
    """Create the closed-form integrator of a piecewise-linear model at a tuning.

    `tuning` is the mesh frequency over the natural frequency; `options` are keyword arguments of
    the integrator class `SingleMeshPropagator`.
    """
    from gearlib.engines.linear.propagator import SingleMeshPropagator

    return SingleMeshPropagator(model, tuning, **options)


def taylor_propagator(model: Model, tuning: float, **options: Any) -> Any:
    """Create the Taylor-series integrator of a model with one degree of freedom at a tuning.

    `tuning` is the mesh frequency over the natural frequency; `options` are keyword arguments of
    the integrator class `Propagator`.
    """
    from gearlib.engines.taylor.propagator import Propagator

    return Propagator(model, tuning, **options)


def _speed_course_propagator(model: Model) -> Any:
    """Create the integrator of a piecewise-linear model for a speed that changes with time."""
    from gearlib.engines.linear.speed_courses import create_course_propagator

    return create_course_propagator(model)


def field_values(instance: Any) -> dict[str, Any]:
    """Return the fields of a dataclass instance as a dict, name -> value."""
    return {field.name: getattr(instance, field.name) for field in dataclasses.fields(instance)}


def natural_scale(model: Any, units: str) -> float:
    """Return the characteristic magnitude of a quantity of a model, based on its units.

    `units` is a string in CF notation such as "N s m-1". The result is a product of powers of the
    load, the static deflection and the natural frequency of the model. Other units, such as rad,
    contribute a factor of 1.
    """
    force, length = float(model.load), model.static_deflection
    frequency = model.mesh_frequency(1.0)  # natural frequency in rad/s, equal at tuning 1
    mass = force / length / frequency**2
    scales = {"N": force, "m": length, "s": 1.0 / frequency, "kg": mass}
    factors = []
    # For example, "N s m-1" consists of the units N, s, m with the exponents 1, 1, -1.
    for unit, exponent in re.findall(r"([A-Za-z]+)(-?\d+)?", units):
        factors.append(scales.get(unit, 1.0) ** int(exponent or 1))
    return math.prod(factors)


def create_unchecked(dataclass: type, **values: Any) -> Any:
    """Create an instance of a frozen dataclass without running its checks.

    `values` are the values of its fields; omitted fields get their defaults. Interval arithmetic
    needs this function, because the checks accept only floats and reject intervals.
    """
    instance = object.__new__(dataclass)
    for field in dataclasses.fields(dataclass):
        object.__setattr__(instance, field.name, values.get(field.name, field.default))
    return instance


def is_model(value: Any) -> bool:
    """Return whether a value is a model."""
    return isinstance(value, Model)

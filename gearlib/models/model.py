"""The base class of all models: every attribute that simulations and analyses use.

A new model is a frozen dataclass that derives from `Model`, with an entry in
``gearlib/__init__.py``. A model of one degree of freedom defines ``equation``; everything else has
a default. A model with more coordinates defines ``size`` and the ``train`` of its matrices, or a
piecewise-linear ``system`` with ``contact_modes``, ``full_state``, ``propagators``,
``flank_lines`` and ``has_damping``. No caller checks the class of a model.
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

#: A motion this many times larger than the lengths of its model counts as unbounded.
UNBOUNDED_FACTOR = 1e8


class Model:
    """A simulated system: its parameters, equations of motion, engines and names of variables."""

    # State and equations of motion.
    size: Any = 2  #: number of varying state components: coordinates, then their rates by phase
    repeats: Any = 1  #: periods of phase after which the excitation repeats
    pair: Any = None  #: the `GearPair` that gives tuning and scales, if there is one
    equation: Any = None  #: the `Equation` of a model with one degree of freedom
    train: Any = None  #: the `GearTrain` with the matrices of a model with several coordinates
    gyroscopic: Any = False  #: whether the forces of a rotating frame of reference act
    profile: Any = None  #: the `Profile` of the mesh stiffness, where it can be chosen
    #: Functions of the tuning: speed in rpm, mesh frequency in rad/s; None: nothing rotates.
    speed: Any = None
    mesh_frequency: Any = None
    static_deflection: Any = None  #: scale of displacements of models that rotate, m
    mean_forces: Any = 1.0  #: static mesh forces over the load, of m meshes (m,); coast side < 0
    #: Whether Eq. (3) holds with one coordinate and equal flanks at 0 and -s, as fixed-step methods
    #: and harmonic balance require.
    has_pair_equation: bool = False
    moving_flank: bool = False  #: whether the coast flank moves about its line in `flank_lines`

    # Parameters.
    defaults: dict = {}  #: field name -> function of the model that returns its default
    #: Continuation parameters of orbits beside the ratios: name -> (CF units, long_name)
    parameters: Any = {}
    nonlinear: tuple = ()  #: names of the parameters that make the motion in contact nonlinear

    # Results.
    mesh_names: Any = ()  #: labels of the dimension mesh; empty: results have no such dimension
    components: Any = ("displacement", "velocity")  #: names of the components of the final state
    extra_samples: tuple = ()  #: names of sampled variables that other models do not have
    long_names: dict = {}  #: variable name -> long_name, where it differs from a gear mesh
    title_noun: str = "a gear mesh"  #: the model in titles of datasets
    slowest_tuning: Any = 0.0  #: least tuning of a simulated duty point: below it, inertia is small
    force_note: Any = ""  #: a sentence on the forces, for results, or ""
    stiffness_model: Any = ""  #: the mesh model and its stiffness in words, or ""
    #: Name of the ratio of largest to static mesh force: "dynamic_factor" if teeth come into mesh
    #: under load, "peak_force_ratio" for a prescribed stiffness, which may jump.
    force_ratio_name: Any = "peak_force_ratio"
    references: str = "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"

    def __post_init__(self):
        """Replace fields that are None by their values from `defaults`."""
        for name, default in self.defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, default(self))

    @property
    def piecewise_linear(self) -> bool:
        """Whether the model is linear between two contact events, so that a closed form exists."""
        return self.equation is None or self.equation.is_piecewise_linear()

    @property
    def propagators(self) -> dict[str, Callable]:
        """Integrators by the name of their method, with the default method first.

        Each value is a function of the model, the tuning and options that returns the integrator.
        """
        propagators = {"taylor": taylor_propagator}
        if self.piecewise_linear:
            propagators = {"exact": single_mesh_propagator} | propagators
        return propagators

    @property
    def speed_course_propagator(self) -> Callable | None:
        """Function of the model that returns its integrator along speed courses, or None."""
        return _speed_course_propagator if self.piecewise_linear else None

    def steps_per_period(self, tuning: float) -> float:
        """Return the minimum number of integration steps per mesh period; 1 for closed forms."""
        return 1.0

    def propagator(self, tuning: float, method: str | None = None, **options: Any) -> Any:
        """Return the integrator of the model at a tuning, excitation over natural frequency.

        `method` is a key of `propagators`, by default the first key; `options` are keyword
        arguments of the integrator class.
        """
        propagators = self.propagators
        if not method:
            method = next(iter(propagators))
        return propagators[method](self, float(tuning), **options)

    def nonlinear_mesh(self, tuning: float, tolerance: float = 0.0) -> Any:
        """Return the constants of a model with one degree of freedom for steps by Taylor series.

        `tolerance` is the allowed error of a step.
        """
        return self.equation.nonlinear_mesh(tuning, tolerance)

    def system(self, tuning: float) -> Any:
        """Return the matrices of a piecewise-linear model at a tuning as a `TrainSystem`."""
        return (self.train or self.equation).system(tuning)

    def contact_modes(self, system: Any) -> tuple[np.ndarray, ...]:
        """Return the dimensionless natural modes of a `TrainSystem` in permanent contact.

        They are (natural frequencies, mode shapes, rigid-body motions, mass matrix); each column of
        the second and third matrix is a shape or a motion.
        """
        if self.train:
            return self.train.contact_modes(system)
        identity = np.ones((1, 1))
        return np.array([self.equation.natural_frequency]), identity, np.zeros((1, 0)), identity

    def output_rows(self, system: Any) -> np.ndarray:
        """Return the row vectors that map states to the extra recorded variables, (e, 3, p, n).

        There are e variables, 3 contact states, p stiffness segments and n components of a state of
        `system`, a `TrainSystem`. A model without extra variables has e = 0.
        """
        contact_state_count, segment_count, _ = system.effect.shape
        return np.zeros((0, contact_state_count, segment_count, len(system.base_matrix)))

    def full_state(self, system: Any, state: tuple[float, float]) -> np.ndarray:
        """Return the full state of a `TrainSystem` at tau = 0 from (displacement, dx/dtau)."""
        # The row vector of a flank line has as many components as a state. All but the first two
        # start at 0.
        full_state = np.zeros_like(system.drive_lines[0])
        full_state[:2] = state
        return full_state

    def check_state(self, initial_state: Any) -> Any:
        """Return a checked initial state: displacement and dx/dtau, or all components.

        `initial_state` is a sequence of numbers, or "static" for the static equilibrium, which does
        not depend on the tuning.
        """
        if isinstance(initial_state, str) and initial_state == "static":
            return self.static_state(1.0)
        if isinstance(initial_state, (tuple, list)) and len(initial_state) == self.size > 2:
            return check("initial_state", initial_state, Numbers)
        return check("initial_state", initial_state, State)

    def static_state(self, tuning: float, load: float = 1.0) -> tuple[float, ...]:
        """Return the static equilibrium just after phase 0, at rest, as an `initial_state`.

        Damping and inertia, including the inertia of a deviation, are left out. The coast-side
        flanks carry a negative load: x = -backlash - deflection.

        Parameters
        ----------
        tuning : float
            Tuning at which a run starts. The forces of a rotating frame of reference are left out,
            so that all tunings have the same equilibrium.
        load : float, default 1
            Load over the load of the model, a factor on all torques of a train.

        Returns
        -------
        tuple of float
            Displacement and velocity by phase, or all components of models with more coordinates.
            Without a load, and under a load that no flank can carry, it is (0, 0) for gears, whose
            flanks just touch, and the undeflected position closest to 0 for other models.
        """
        if self.train is not None:
            return self.train.static_state(tuning, load)
        return self.equation.static_displacement(load), 0.0

    @property
    def settable(self) -> dict[str, tuple[str, str]]:
        """Finite numbers that `with_values` can change, as a dict name -> (CF units, description).

        A name is a field of the model or its `GearPair`, an entry of a field with several values
        such as ``masses[0]``, or a ratio of the pair in `RATIOS`.
        """
        settable: dict = {}
        models = [self] if self.pair is None else [self, self.pair]
        for model in models:
            declarations = declared_parameters(type(model))
            for name, value in fields_of(model).items():
                units, description = "1", name
                if name in declarations:
                    units = cf_units(declarations[name].unit)
                    description = declarations[name].long_name
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
        """Return a number of the model by its name in `settable`, such as ``masses[0]``."""
        field, _, index = name.rstrip("]").partition("[")
        value = getattr(self, field)
        return value[int(index)] if index else value

    def with_values(self, new_values: dict[str, float]) -> "Model":
        """Return a copy of the model with `new_values`, a dict name -> value.

        The names are keys of `settable`. Ratios such as ``damping_ratio`` are set last, so that
        they hold for the changed parameters.
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
        """Return the initial `state` with a disturbance added to its first displacement."""
        return state[0] + disturbance, *state[1:]

    def empty_record(self, samples: int = 0, events: int = 16) -> tuple:
        """Return uninitialized tables (samples, events, summary) for the record of a run.

        `samples` and `events` are the numbers of rows in their tables; the summary is one row.
        """
        from gearlib.engines import orbit  # Creating a model must not load the kernels.

        sample_table = np.empty((samples, orbit.SAMPLE_COLUMNS + len(self.extra_samples)))
        event_table = np.empty((events, orbit.EVENT_COLUMNS))
        return sample_table, event_table, np.empty(orbit.SUMMARY_COLUMNS)

    def extra_sample_variables(self, samples: np.ndarray) -> dict[str, tuple]:
        """Return the `extra_samples` of a run as dataset variables, name -> (dims, values).

        They are the last columns of the table `samples`, shape (samples, columns).
        """
        columns = samples.T[samples.shape[1] - len(self.extra_samples) :]
        variables = {}
        for name, column in zip(self.extra_samples, columns, strict=True):
            variables[name] = ("phase",), column
        return variables

    def extra_summary_variables(self, dims: tuple, summaries: np.ndarray, span: float) -> dict:
        """Return the summary variables that other models do not have, name -> (dims, values).

        `summaries` has the dimensions `dims`, then the columns of a summary; `span` is the phase
        over which its sums extend, in rad.
        """
        return {}

    def coordinates(self) -> dict[str, list]:
        """Return the dataset coordinates that belong to the model: name -> labels."""
        return {"component": list(self.components)}

    def reduction(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrices (reduce, lift) between full states and states without rigid rotation.

        `reduce` removes rigid-body rotation from a state, and `lift` returns to a full state. Both
        are identity matrices for a model without rigid-body rotation.
        """
        return np.eye(self.size), np.eye(self.size)

    @property
    def flank_lines(self) -> Any:
        """Displacements at which drive-side and coast-side contact begin, as a tuple."""
        return self.equation.upper, self.equation.lower

    @property
    def loaded_sides(self) -> np.ndarray:
        """Contact codes of the flanks that carry the static load, (m,) for m meshes, () for one."""
        return np.where(np.asarray(self.mean_forces) < 0.0, COAST, DRIVE)

    def force_ratios(self, largest_forces: Any) -> Any:
        """Return the ratios of largest to static mesh force, NaN for meshes without a static force.

        `largest_forces` are absolute values over the load of the model; for trains their last axis
        is the mesh.
        """
        static_forces = np.abs(self.mean_forces)
        return largest_forces / np.where(static_forces > 0.0, static_forces, math.nan)

    def clearances(self, lowest: np.ndarray, highest: np.ndarray) -> np.ndarray:
        """Return how far the loaded flanks stay from losing contact, in static deflections.

        `lowest` and `highest` are the extrema of the displacement of each mesh. The result is
        negative for flanks that have lost contact.
        """
        drive_line, coast_line = self.flank_lines
        return np.where(self.loaded_sides == COAST, coast_line - highest, lowest - drive_line)

    @property
    def extent(self) -> float:
        """Largest length of the model in its unit of displacement, at least 1.

        It is the largest of the flank positions, the deflection under the load, and the deviation.
        """
        positions = np.abs(np.ravel(self.flank_lines))
        lengths = [1.0, *positions[np.isfinite(positions)].tolist()]
        if self.equation is not None:
            equation = self.equation
            force = abs(equation.load) + np.abs(equation.force[:, 1:]).sum()
            lengths.append(force / equation.natural_frequency**2)
            lengths.append(np.abs(equation.deviation[:, 1:]).sum())
        return float(max(lengths))

    def displacement_limit(self, tuning: float, state: Any = (0.0, 0.0)) -> float:
        """Return the displacement above which a motion counts as unbounded.

        It is `UNBOUNDED_FACTOR` times the largest length of the model and of the initial `state`,
        which holds n displacements and n velocities by mesh phase or is a name such as "static".
        `tuning`, the excitation over the natural frequency, converts velocities by phase to
        velocities by time.
        """
        lengths = [self.extent]
        if not isinstance(state, str):
            n = len(state) // 2
            lengths += [abs(x) for x in state[:n]] + [tuning * abs(v) for v in state[n:]]
        return UNBOUNDED_FACTOR * max(lengths)

    def has_damping(self) -> bool:
        """Return whether damping acts in contact or in free flight."""
        equation = self.equation
        damping = equation.damping
        if not math.isfinite(equation.lower):
            damping = damping[1:]  # Row 0 is the coast-side contact, which does not exist.
        return bool(damping.any())

    def scales(self) -> dict:
        """Return the dataset variables that do not depend on the tuning, name -> value."""
        return {}

    def tuning_at(self, speed: Any) -> Any:
        """Return the tuning nu at a speed of the reference gear in rpm (float or array)."""
        return speed / self.speed(1.0)

    def tuning_from(self, reference: Any, tuning: Any) -> Any:
        """Return the tuning of this model at the speed that a tuning of `reference` stands for.

        `reference` is another model; its `tuning` is a float or an array.
        """
        return float(reference.speed(1.0) / self.speed(1.0)) * tuning

    @property
    def periods_per_revolution(self) -> float:
        """Number of mesh periods per revolution of the reference gear, which may be fractional."""
        return float(self.mesh_frequency(1.0)) * 60.0 / (math.tau * float(self.speed(1.0)))

    def speed_scales(self, tuning: Any) -> dict:
        """Return the scales of a dataset that depend on the tuning, name -> value.

        Values are in SI units except for the speed in rpm; `tuning`, mesh over natural frequency,
        and the values are floats or arrays. A model without rotating bodies has no such scales.
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
        """Return the parameters as a dict of plain values, in the order of the fields."""
        profiles = {
            name: value.as_dict()
            for name, value in fields_of(self).items()
            if isinstance(value, Profile)
        }
        return dataclasses.asdict(self) | profiles

    def replace(self, **changes: Any) -> Any:
        """Return a checked copy with changed parameters of the model or of its `GearPair`.

        If both have a field of that name, the field of the model is changed. A field that still has
        its default value is computed again from the changed fields: a `SixDegreePair` with default
        torques gets new torques from a new load.

        Raises
        ------
        ValueError
            If a name is unknown, or the model does not allow a value.
        """
        model_fields = fields_of(self)
        all_fields = model_fields | (fields_of(self.pair) if self.pair else {})
        checks.check_known_parameters(type(self).__name__, changes, list(all_fields))
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


# Engines are imported on first use, because each of them takes time to load.


def single_mesh_propagator(model: Model, tuning: float, **options: Any) -> Any:
    """Return the integrator in closed forms for a piecewise-linear model at a tuning.

    `options` are keyword arguments of `SingleMeshPropagator`.
    """
    from gearlib.engines.linear.propagator import SingleMeshPropagator

    return SingleMeshPropagator(model, tuning, **options)


def taylor_propagator(model: Model, tuning: float, **options: Any) -> Any:
    """Return the integrator by Taylor series for a model of one degree of freedom at a tuning.

    `options` are keyword arguments of its class `Propagator`.
    """
    from gearlib.engines.taylor.propagator import Propagator

    return Propagator(model, tuning, **options)


def _speed_course_propagator(model: Model) -> Any:
    """Return the integrator of a piecewise-linear model along speed courses."""
    from gearlib.engines.linear.speed_courses import propagator_of

    return propagator_of(model)


def fields_of(instance: Any) -> dict[str, Any]:
    """Return the fields of a dataclass instance as a dict, name -> value."""
    return {field.name: getattr(instance, field.name) for field in dataclasses.fields(instance)}


def natural_scale(model: Any, units: str) -> float:
    """Return a typical magnitude of a quantity of a model, in its CF `units` such as "N s m-1".

    It is a product of powers of the load, the static deflection and the natural frequency of the
    model. Units without such a scale, such as rad, contribute a factor of 1.
    """
    force, length = float(model.load), model.static_deflection
    frequency = model.mesh_frequency(1.0)  # At tuning 1 it is the natural frequency, rad/s.
    mass = force / length / frequency**2
    scales = {"N": force, "m": length, "s": 1.0 / frequency, "kg": mass}
    scale_powers = []
    for unit, exponent in re.findall(r"([A-Za-z]+)(-?\d+)?", units):
        scale_powers.append(scales.get(unit, 1.0) ** int(exponent or 1))
    return math.prod(scale_powers)


def instance_without_checks(dataclass: type, **values: Any) -> Any:
    """Return an instance of a frozen dataclass with these field values, without its checks.

    Missing fields get their defaults. The checks accept only floats, but interval arithmetic needs
    values that are intervals.
    """
    instance = object.__new__(dataclass)
    for field in dataclasses.fields(dataclass):
        object.__setattr__(instance, field.name, values.get(field.name, field.default))
    return instance


def is_model(value: Any) -> bool:
    """Return whether a value is a model."""
    return isinstance(value, Model)

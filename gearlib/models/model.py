"""The base class of all models: every attribute that simulations and analyses use.

A new model is a frozen dataclass that derives from `Model`, with an entry in
``gearlib/__init__.py``. A model of one degree of freedom defines ``equation``; everything else has
a default. A model with more coordinates defines ``size`` and the ``train`` of its matrices, or a
piecewise-linear ``system`` with ``linear``, ``initial``, ``propagators``, ``flank_lines`` and
``damped``. No caller checks the class of a model.
"""

import dataclasses
import math
import re
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from gearlib import checks, parameters
from gearlib.models.pair_parameters import RATIO_NAMES, RATIOS, ratio_fields
from gearlib.models.profiles import Profile

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.engines.linear import one_mesh  # noqa: F401
    from gearlib.engines.pair import propagator as pair  # noqa: F401
    from gearlib.engines.taylor import propagator as taylor  # noqa: F401


#: A motion this many times larger than the lengths of its model counts as unbounded.
UNBOUNDED_FACTOR = 1e8


class Model:
    """Parameters, equations of motion, engines and names of variables of a simulated system."""

    # State and equations of motion.
    size: Any = 2  #: components of the state that varies: coordinates, then their rates by phase
    repeats: Any = 1  #: periods of phase after which the excitation repeats
    mesh: Any = None  #: the `GearPair` that gives tuning and scales, if there is one
    equation: Any = None  #: the `Equation`, of one degree of freedom with two flank lines
    train: Any = None  #: the `GearTrain` whose matrices it has, of several degrees of freedom
    gyroscopic: Any = False  #: whether the forces of a turning frame act
    profile: Any = None  #: the `Profile` of the mesh stiffness, where it can be chosen
    #: Functions of the tuning: speed in rpm, mesh frequency in rad/s; None: nothing rotates.
    speed: Any = None
    mesh_frequency: Any = None
    static_deflection: Any = None  #: scale of displacements of models that rotate, m
    #: Whether Eq. (3) with one coordinate and equal flanks at 0 and -s holds, as fixed-step methods
    #: and harmonic balance need it.
    one_mesh: bool = False
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
    long_names: dict = {}  #: variable name -> long_name, where it differs from that of a gear mesh
    title_noun: str = "a gear mesh"  #: the model in titles of datasets
    slowest_tuning: Any = 0.0  #: least tuning of a simulated duty point: below it, inertia is small
    force_note: Any = ""  #: a sentence on the forces, for results, or ""
    references: str = "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"

    def __post_init__(self):
        """Check the parameters and compute the default values of fields that are None."""
        parameters.check(self)
        for name, default in self.defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, default(self))

    @property
    def piecewise_linear(self):
        """Whether the motion between events has a closed form."""
        return self.equation is None or self.equation.is_piecewise_linear()

    @property
    def propagators(self):
        """Name of a method -> module of `gearlib.engines`; the default comes first."""
        exact = {"exact": "linear.one_mesh"} if self.piecewise_linear else {}
        return exact | {"taylor": "taylor.propagator"}

    def propagator_class(self, method=None):
        """Return the engine class of a method in `propagators`, by default of the first one."""
        name = self.propagators[method or next(iter(self.propagators))]
        return import_module(f"gearlib.engines.{name}").Propagator

    def steps_per_period(self, tuning):
        """Return the least number of integration steps in a mesh period; 1 for closed forms."""
        return 1.0

    def propagator(self, tuning, method=None, **options):
        """Return the engine that integrates the model at a tuning by a method in `propagators`."""
        return self.propagator_class(method)(self, float(tuning), **options)

    def law(self, tuning, tolerance=0.0):
        """Return the equation of one degree of freedom for Taylor steps of a tolerance."""
        return self.equation.law(tuning, tolerance)

    def system(self, tuning):
        """Return the matrices of a piecewise-linear model at a tuning, a `TrainSystem`."""
        return (self.train or self.equation).system(tuning)

    def linear(self, system):
        """Return the modes in permanent contact: (frequencies, shapes, free motions, mass)."""
        if self.train:
            return self.train.linear(system)
        unit = np.ones((1, 1))
        return np.array([self.equation.natural]), unit, np.zeros((1, 0)), unit

    def outputs(self, system):
        """Return rows that map states to extra recorded variables, shape (e, 3, p, n)."""
        return np.zeros((0, *system.effect.shape[:2], len(system.base_matrix)))

    def initial(self, system, state):
        """Return the full state vector at tau = 0 with a displacement and its rate dx/dtau."""
        full_state = 0.0 * system.drive_lines[0]
        full_state[:2] = state
        return full_state

    def check_state(self, value):
        """Return a checked initial state: displacement and dx/dtau, or all components."""
        if isinstance(value, (tuple, list)) and len(value) == self.size > 2:
            finite = "finite", math.isfinite
            return tuple(checks.number("initial_state", entry, *finite) for entry in value)
        return checks.state("initial_state", value)

    @property
    def settable(self):
        """The finite numbers that `with_values` can change: name -> (CF units, description).

        A name is a field of the model or its `GearPair`, an entry of a field with several values
        such as ``masses[0]``, or a ratio of the pair in `RATIOS`.
        """
        numbers: dict = {}
        for owner in filter(None, (self, self.mesh)):
            declarations = parameters.declared(type(owner))
            for name, value in fields_of(owner).items():
                parameter = declarations.get(name, parameters.Parameter(None, name))
                units, description = parameters.cf_units(parameter.unit), parameter.long_name
                if type(value) is float and math.isfinite(value):
                    numbers.setdefault(name, (units, description))
                elif isinstance(value, tuple) and all(type(entry) is float for entry in value):
                    indices = [f"[{i}]" for i, entry in enumerate(value) if math.isfinite(entry)]
                    numbers |= {name + i: (units, f"{description} {i}") for i in indices}
        if self.mesh:
            numbers |= {name: ("1", description) for name, description in RATIO_NAMES.items()}
        return numbers

    def value(self, name):
        """Return a number by its name in `settable`."""
        field, _, index = name.rstrip("]").partition("[")
        value = getattr(self, field)
        return value[int(index)] if index else value

    def with_values(self, changes):
        """Return a copy with the numbers name -> value of `settable` changed, ratios last."""
        fields: dict = {}
        for name, value in changes.items():
            field, _, index = name.rstrip("]").partition("[")
            if index:
                entries = list(fields.get(field, getattr(self, field)))
                entries[int(index)] = value
                fields[field] = tuple(entries)
            elif name not in RATIOS:
                fields[name] = value
        model = self.replace(**fields)
        for name in RATIOS:
            if name in changes:
                model = model.replace(**ratio_fields(model.mesh, name, changes[name]))
        return model

    parameter = value

    def with_parameter(self, name, value):
        """Return a copy of the model with a new value of one of `parameters`."""
        return dataclasses.replace(self, **{name: value})  # type: ignore[type-var]

    def disturbed(self, state, disturbance):
        """Return an initial state with a disturbance added to the displacement."""
        return state[0] + disturbance, *state[1:]

    def empty_record(self, samples=0, events=16):
        """Return empty tables (samples, events, summary) for the record of a run."""
        from gearlib.engines import orbit  # Creating a model must not load the kernels.

        columns = orbit.SAMPLE_COLUMNS + len(self.extra_samples)
        tables = (samples, columns), (events, orbit.EVENT_COLUMNS), orbit.SUMMARY_COLUMNS
        return tuple(np.empty(shape) for shape in tables)

    def extra_sample_variables(self, samples):
        """Return the `extra_samples` in a table of samples: name -> (dims, values)."""
        columns = samples.T[samples.shape[1] - len(self.extra_samples) :]
        names = zip(self.extra_samples, columns, strict=True)
        return {name: (("phase",), values) for name, values in names}

    def extra_summary_variables(self, dims, table, span):
        """Return the summaries that other models do not have: name -> (dims, values)."""
        return {}

    def coordinates(self):
        """Return the coordinates of datasets that belong to the model: name -> labels."""
        return {"component": list(self.components)}

    def reduction(self):
        """Return matrices (reduce, lift) that remove the free rotation from a state, and back."""
        return np.eye(self.size), np.eye(self.size)

    @property
    def flank_lines(self):
        """Displacements at which drive-side and coast-side contact begin."""
        return self.equation.upper, self.equation.lower

    @property
    def extent(self):
        """Largest length of the model: unit of displacement, flank positions, load deflections."""
        positions, lengths = np.abs(np.ravel(self.flank_lines)), [1.0]
        lengths += positions[np.isfinite(positions)].tolist()
        if self.equation is not None:
            equation = self.equation
            force = abs(equation.load) + np.abs(equation.force[:, 1:]).sum()
            lengths += [force / equation.natural**2, np.abs(equation.deviation[:, 1:]).sum()]
        return float(max(lengths))

    def bound(self, tuning, state=(0.0, 0.0)):
        """Return the displacement above which a motion from a state counts as unbounded."""
        n = 0 if isinstance(state, str) else len(state) // 2
        lengths = [abs(x) for x in state[:n]] + [tuning * abs(v) for v in state[n:]] if n else [0.0]
        return UNBOUNDED_FACTOR * max(self.extent, *lengths)

    def damped(self):
        """Return whether damping acts in contact or in the backlash."""
        equation = self.equation
        return bool(equation.damping[0 if math.isfinite(equation.lower) else 1 :].any())

    def scales(self):
        """Return the scalar variables of datasets that depend on the model alone."""
        return {}

    def tuning_at(self, speed):
        """Return the tuning nu at a speed of the reference gear in rpm (float or array)."""
        return speed / self.speed(1.0)

    @property
    def periods_per_revolution(self):
        """Mesh periods in a revolution of the reference gear; not always a whole number."""
        return float(self.mesh_frequency(1.0)) * 60.0 / (math.tau * float(self.speed(1.0)))

    def speed_scales(self, tuning):
        """Return the variables of datasets that depend on the tuning (float or array)."""
        if self.speed is None:
            return {}
        frequency = self.mesh_frequency(tuning)
        return {
            "mesh_frequency": frequency,
            "velocity_scale": self.static_deflection * frequency,
            "acceleration_scale": self.static_deflection * (frequency * frequency),
            "speed": self.speed(tuning),
        }

    def as_dict(self):
        """Return the parameters as a dict of plain values, in the order of the fields."""
        profiles = {x: y.as_dict() for x, y in fields_of(self).items() if isinstance(y, Profile)}
        return dataclasses.asdict(self) | profiles

    def replace(self, **changes):
        """Return a checked copy with changed parameters of the model or of its `GearPair`.

        A name that both have means the field of the model. A field that still has its default
        value is computed again from the changed fields: a `SixDegreePair` with default torques
        takes new torques from a new load.

        Raises
        ------
        ValueError
            If a name is unknown, or the model does not allow a value.
        """
        names = fields_of(self)
        known_names = names | (fields_of(self.mesh) if self.mesh else {})
        checks.known(type(self).__name__, changes, list(known_names))
        recomputed = {
            name: None
            for name, default in self.defaults.items()
            if name not in changes and getattr(self, name) == default(self)
        }
        pair_changes = {name: changes.pop(name) for name in {*changes} - {*names}}
        pair = changes.get("pair", self.mesh)
        if pair_changes and is_model(pair):
            changes["pair"] = pair.replace(**pair_changes)
        return dataclasses.replace(self, **changes, **recomputed)  # type: ignore[type-var]


def fields_of(instance):
    """Return the fields of a dataclass instance as a dict, name -> value."""
    return {field.name: getattr(instance, field.name) for field in dataclasses.fields(instance)}


def natural_scale(model, units):
    """Return a typical magnitude of a quantity with the given CF units, from the model's scales."""
    force, length, rate = float(model.load), model.static_deflection, model.mesh_frequency(1.0)
    scales = {"N": force, "m": length, "s": 1.0 / rate, "kg": force / length / rate**2}
    powers = re.findall(r"([A-Za-z]+)(-?\d+)?", units)
    return math.prod(scales.get(unit, 1.0) ** int(power or 1) for unit, power in powers)


def unchecked(dataclass, **values):
    """Create an instance of a frozen dataclass without its checks, which only accept floats."""
    instance = object.__new__(dataclass)
    for field in dataclasses.fields(dataclass):
        object.__setattr__(instance, field.name, values.get(field.name, field.default))
    return instance


def is_model(value):
    """Return whether a value is a model."""
    return isinstance(value, Model)

"""The protocol of all models: everything that runs and analyses may ask of one.

A new model is a subclass of `Model` in one file, a frozen dataclass, and its entry in
``gearlib/__init__.py``. With one degree of freedom it gives its ``equation``, and all the rest has
a default. With more coordinates it gives instead ``size``, the ``train`` of its matrices or a
piecewise-linear ``system`` with ``linear``, ``initial``, ``propagators``, ``flank_lines`` and
``damped``. No caller asks a model for its class.
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


#: A motion that is so many times as large as what made it grows without bound.
FAR = 1e8


class Model:
    """What can be simulated: parameters, equations of motion, engines, names of its variables."""

    # State and equations of motion.
    size: Any = 2  #: components of the state that varies: coordinates, then their rates by phase
    repeats: Any = 1  #: periods of phase after which the excitation repeats
    mesh: Any = None  #: the `GearPair` that gives tuning and scales, if there is one
    equation: Any = None  #: the `Equation`, of one degree of freedom with two flank lines
    train: Any = None  #: the `GearTrain` whose matrices it has, of several degrees of freedom
    gyroscopic: Any = False  #: whether the forces of a turning frame act
    profile: Any = None  #: of `gearlib.models.profiles`, where the mesh stiffness can be chosen
    #: Functions from a tuning to the speed in rpm and to rad/s of the mesh; None: nothing turns.
    speed: Any = None
    mesh_frequency: Any = None
    static_deflection: Any = None  #: the scale of displacements where something turns, m
    #: Whether it moves by Eq. (3) for one coordinate between two equal flanks at 0 and -s, for
    #: which methods with steps and the harmonics are written.
    one_mesh: bool = False
    moving_flank: bool = False  #: whether `flank_lines` has only the mean position of the far flank

    # Parameters.
    by_default: dict = {}  #: name of a field -> its value by default, from the model
    #: Its parameters over which orbits are followed, beside ratios: name -> (CF units, long_name)
    parameters: Any = {}
    nonlinear: tuple = ()  #: names of those that make the motion in normal mesh nonlinear

    # Results.
    mesh_names: Any = ()  #: a dimension of results; (): one mesh, and no such dimension
    components: Any = ("displacement", "velocity")  #: of the final state
    extra_samples: tuple = ()  #: variables beside those of every time course, over the phase
    long_names: dict = {}  #: name of a variable -> its long_name, if not that of a gear mesh
    title_noun: str = "a gear mesh"  #: the model in titles of datasets
    slowest_tuning: Any = 0.0  #: below it the duty point is that at it: inertia hardly counts
    force_note: Any = ""  #: a sentence on the forces beside results, or ""
    references: str = "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"

    def __post_init__(self):
        parameters.check(self)
        for name, default in self.by_default.items():
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

    def kind(self, method=None):
        """Return the class of propagators of a method, by default the first of `propagators`."""
        name = self.propagators[method or next(iter(self.propagators))]
        return import_module(f"gearlib.engines.{name}").Propagator

    def steps_per_period(self, tuning):
        """Return how many steps a mesh period takes at least; 1 of closed forms."""
        return 1.0

    def propagator(self, tuning, method=None, **options):
        """Return the engine of the model at one tuning by one of the methods in `propagators`."""
        return self.kind(method)(self, float(tuning), **options)

    def law(self, tuning, tolerance=0.0):
        """Return the `Law` of one degree of freedom; its tolerance is that of Taylor steps."""
        return self.equation.law(tuning, tolerance)

    def system(self, tuning):
        """Return the `TrainSystem` of a piecewise-linear model at one tuning."""
        return (self.train or self.equation).system(tuning)

    def linear(self, system):
        """Return (frequencies by theta, mode shapes, free motions, mass matrix)."""
        if self.train:
            return self.train.linear(system)
        unit = np.ones((1, 1))
        return np.array([self.equation.natural]), unit, np.zeros((1, 0)), unit

    def outputs(self, system):
        """Return functionals of states by phase that are recorded too, shape (e, 3, p, n)."""
        return np.zeros((0, *system.effect.shape[:2], len(system.free)))

    def initial(self, system, state):
        """Return the full state z at tau = 0, by phase, for a displacement and velocity."""
        z = 0.0 * system.near[0]
        z[:2] = state
        return z

    def check_state(self, value):
        """Return an initial state, checked: displacement and dx/dtau, or all components."""
        if isinstance(value, (tuple, list)) and len(value) == self.size > 2:
            finite = "finite", math.isfinite
            return tuple(checks.number("initial_state", entry, *finite) for entry in value)
        return checks.state("initial_state", value)

    @property
    def settable(self):
        """Name -> (CF units, words) of the finite numbers that `with_values` changes.

        Names are those of fields of the model and its `GearPair`, entries of fields with several
        values as ``masses[0]``, and of a pair the keys of `RATIOS`.
        """
        described: dict = {}
        for owner in filter(None, (self, self.mesh)):
            declarations = parameters.declared(type(owner))
            for name, value in fields_of(owner).items():
                parameter = declarations.get(name, parameters.Parameter(None, name))
                units, words = parameters.cf_units(parameter.unit), parameter.long_name
                if type(value) is float and math.isfinite(value):
                    described.setdefault(name, (units, words))
                elif isinstance(value, tuple) and all(type(entry) is float for entry in value):
                    finite = [f"[{i}]" for i, entry in enumerate(value) if math.isfinite(entry)]
                    described |= {name + place: (units, f"{words} {place}") for place in finite}
        if self.mesh:
            described |= {name: ("1", words) for name, words in RATIO_NAMES.items()}
        return described

    def value(self, name):
        """Return the value of one of `settable`."""
        field, _, index = name.rstrip("]").partition("[")
        value = getattr(self, field)
        return value[int(index)] if index else value

    def with_values(self, changes):
        """Return the model with some of `settable`, name -> value, changed; ratios are set last."""
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
        """Return the model with one of `parameters` set."""
        return dataclasses.replace(self, **{name: value})  # type: ignore[type-var]

    def disturbed(self, state, disturbance):
        """Return an initial state with so much added to the displacement."""
        return state[0] + disturbance, *state[1:]

    def empty_record(self, samples=0, events=16):
        """Return empty tables (samples, events, summary) with the columns of `engines.orbit`."""
        from gearlib.engines import orbit  # here, since a model without motion needs no kernels

        columns = orbit.SAMPLE_COLUMNS + len(self.extra_samples)
        tables = (samples, columns), (events, orbit.EVENT_COLUMNS), orbit.SUMMARY_COLUMNS
        return tuple(np.empty(shape) for shape in tables)

    def more_samples(self, samples):
        """Return name -> (dims, values) of the columns of samples that only some models have."""
        columns = samples.T[samples.shape[1] - len(self.extra_samples) :]
        names = zip(self.extra_samples, columns, strict=True)
        return {name: (("phase",), values) for name, values in names}

    def more_summary(self, dims, table, span):
        """Return name -> (dims, values) of summaries that only some models have."""
        return {}

    def coordinates(self):
        """Return name -> values of the dimensions of results that belong to the model."""
        return {"component": list(self.components)}

    def reduction(self):
        """Return the matrices (reduce, lift) to the state without free rotation and back."""
        return np.eye(self.size), np.eye(self.size)

    @property
    def flank_lines(self):
        """Displacements at which normal and inverse mesh begin."""
        return self.equation.upper, self.equation.lower

    @property
    def extent(self):
        """Return the largest length of the model: of a displacement unit, its flanks, its loads."""
        lines, lengths = np.abs(np.ravel(self.flank_lines)), [1.0]
        lengths += lines[np.isfinite(lines)].tolist()
        if self.equation is not None:
            equation = self.equation
            force = abs(equation.load) + np.abs(equation.force[:, 1:]).sum()
            lengths += [force / equation.natural**2, np.abs(equation.deviation[:, 1:]).sum()]
        return float(max(lengths))

    def bound(self, tuning, state=(0.0, 0.0)):
        """Return the displacement beyond which a motion from a state has grown without bound."""
        n = 0 if isinstance(state, str) else len(state) // 2
        start = [abs(x) for x in state[:n]] + [tuning * abs(v) for v in state[n:]] if n else [0.0]
        return FAR * max(self.extent, *start)

    def damped(self):
        """Return whether any phase of the motion is damped."""
        equation = self.equation
        return bool(equation.damping[0 if math.isfinite(equation.lower) else 1 :].any())

    def scales(self):
        """Return the scalar variables of datasets that depend on the model alone."""
        return {}

    def tuning_at(self, speed):
        """Return the tuning nu at a speed in rpm of the gear whose teeth count (float or array)."""
        return speed / self.speed(1.0)

    @property
    def periods_per_revolution(self):
        """Mesh periods in a revolution of the gear whose teeth count; whole, or a ratio."""
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
        """Return the parameters as plain values, in the order of the fields."""
        profiles = {x: y.as_dict() for x, y in fields_of(self).items() if isinstance(y, Profile)}
        return dataclasses.asdict(self) | profiles

    def replace(self, **changes):
        """Return a copy with some parameters changed (and checked): its own, or of its `GearPair`.

        A name that both have is that of the model. A field with the value that others give it by
        default goes on following them, unless it is changed itself: a `SixDegreePair` takes new
        torques from a new load, unless its torques are others than those of the load.

        Raises
        ------
        ValueError
            If there is no field of a name, or the model does not allow a value.
        """
        names = fields_of(self)
        known_names = names | (fields_of(self.mesh) if self.mesh else {})
        checks.known(type(self).__name__, changes, list(known_names))
        following = {
            name: None
            for name, default in self.by_default.items()
            if name not in changes and getattr(self, name) == default(self)
        }
        of_mesh = {name: changes.pop(name) for name in {*changes} - {*names}}
        pair = changes.get("pair", self.mesh)
        if of_mesh and is_model(pair):
            changes["pair"] = pair.replace(**of_mesh)
        return dataclasses.replace(self, **changes, **following)  # type: ignore[type-var]


def fields_of(instance):
    """Return name -> value of the fields of a dataclass."""
    return {field.name: getattr(instance, field.name) for field in dataclasses.fields(instance)}


def natural_scale(model, units):
    """Return the magnitude of a parameter in the model's own scales, for one that is 0."""
    force, length, rate = float(model.load), model.static_deflection, model.mesh_frequency(1.0)
    scales = {"N": force, "m": length, "s": 1.0 / rate, "kg": force / length / rate**2}
    powers = re.findall(r"([A-Za-z]+)(-?\d+)?", units)
    return math.prod(scales.get(unit, 1.0) ** int(power or 1) for unit, power in powers)


def unchecked(kind, **values):
    """Return an instance of a frozen dataclass without its checks, for numbers of any kind."""
    instance = object.__new__(kind)
    for field in dataclasses.fields(kind):
        object.__setattr__(instance, field.name, values.get(field.name, field.default))
    return instance


def is_model(value):
    """Return whether a value is a model."""
    return isinstance(value, Model)

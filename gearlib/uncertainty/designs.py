"""Sample scattering parameters, build models with them and compute quantities of these designs.

Quantities are jump speeds, the onset of contact loss, resonance peaks and values at a duty point.
"""

import dataclasses
import inspect
import math
import re
import warnings
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import qmc

from gearlib import checks, parameters
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data.summary import largest_force
from gearlib.data.variables import QUANTITIES
from gearlib.engines import orbit as columns
from gearlib.models.geometry.gear import PathTable
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.models.harmonics import Harmonics
from gearlib.models.load_sharing_pair import default_load_sharing_pair
from gearlib.models.model import is_model
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.pair_parameters import PairParameters
from gearlib.models.tolerated import (
    FLANK_PARAMETERS,
    LOAD_PARAMETERS,
    RATIOS,
    geometry_parameters,
    numeric_parameters,
)
from gearlib.runs.run_arguments import MAX_EVENTS, tuning_at_speed
from gearlib.uncertainty.distributions import read_tolerances
from gearlib.units import cf_units

#: Number of bits of the coordinates of Sobol' points, which limits the number of different points.
_SOBOL_BITS = 30
MAX_SAMPLES = 2**_SOBOL_BITS
#: Number of coordinates of a Sobol' point after the parameters: an initial displacement and
#: velocity.
_INITIAL_STATE_DIMENSIONS = 2
#: Parameters that determine the damping; a pair has exactly one of them.
_DAMPING_NAMES = {"damping_ratio", "material_damping", "logarithmic_decrement"}
_DEVIATION_TABLE_POINTS = 129
_NUMBER_PATTERN = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")


class ModelSource:
    """Create designs from a model by changing its parameters, the names in `Model.settable`.

    `value` is the method of the model that returns the nominal value of a parameter.
    """

    def __init__(self, model: Any):
        """Collect the variable parameters of a model and their descriptions.

        These are the parameters in its attribute `settable` and the numeric fields of the model and
        of its gear pair.
        """
        self.model = model
        self.value = model.value
        fields = numeric_parameters(PairParameters) if model.pair else {}
        if dataclasses.is_dataclass(model):
            fields = fields | numeric_parameters(type(model))
        names = [*model.settable]
        # The fields of a train are not numbers.
        if model.train is not model:
            names += fields
        #: Name of a parameter -> declaration of its type and range, or None.
        self.parameters = {name: fields.get(name) for name in names}
        #: Name of a parameter -> (CF unit, description).
        self.descriptions = parameters.units_and_names(type(model)) | model.settable

    def __call__(self, changes: dict) -> Any:
        """Return the model with changed parameters; `changes` maps names to values in SI units."""
        return self.model.with_values(changes)


class StageDesign:
    """Create designs from a `gearlib.geometry.GearStage` by changing geometry, load and damping.

    Parameters are ``centre_distance`` and ``backlash`` of the mesh, fields of a `SpurGear` such as
    ``pinion.thickness_allowance``, the load and the damping.
    """

    def __init__(self, mesh: Any, *, keep_backlash: bool = True, **options: Any):
        """Store a gear stage and options of `GearPair.from_geometry`, such as torque.

        `mesh` is a `gearlib.geometry.GearStage`. With `keep_backlash`, a backlash that is not
        varied keeps its value in the stage; otherwise it follows from the profile shifts, centre
        distance and allowances of each sample.
        """
        self.stage = checks.check_gear_stage(mesh)
        self.keep_backlash = keep_backlash
        self.options = options
        self.parameters = geometry_parameters()
        self.descriptions = {
            name: (cf_units(parameter.unit), _describe_parameter(name, parameter))
            for name, parameter in self.parameters.items()
        }

    def value(self, name: str) -> Any:
        """Return the nominal value of a parameter such as "load" or "pinion.shift".

        It is None if the parameter has no value, e.g. if no load or flank deviation is given.
        """
        gear, _, field = name.rpartition(".")
        if gear:
            return getattr(getattr(self.stage, gear), field)
        if name in LOAD_PARAMETERS | FLANK_PARAMETERS:
            return self.options.get(name)
        return getattr(self.stage, field)

    def __call__(self, changes: dict) -> Any:
        """Build the model of the gears with changed parameters.

        `changes` maps names of parameters to values in SI units. The model is a `GearPair`, or a
        `OneDegreePair` if the flanks have deviations.
        """
        stage, options, (cosine, sine) = self._change_stage(changes)
        # The default mesh stiffness follows ISO 6336-1.
        options["stiffness"] = options.get("stiffness") or "iso"
        pair = GearPair.from_geometry(stage, **options)
        if not cosine and not sine and not FLANK_PARAMETERS.keys() & changes.keys():
            return pair
        return OneDegreePair(pair=pair, deviation=Harmonics((cosine,), (sine,)))

    def duty_model(self, changes: dict) -> Any:
        """Build the model of the gears with changed parameters for a duty point (torque and speed).

        `changes` maps names of parameters to values in SI units. The model is a `LoadSharingPair`,
        in which each tooth pair in mesh has its own stiffness and deviation.
        """
        stage, options, (cosine, sine) = self._change_stage(changes)
        if cosine or sine:
            start, end = stage.path  # positions on the path of contact, m
            positions = np.linspace(start, end, _DEVIATION_TABLE_POINTS)
            phases = stage.phase_of(positions)
            # In the model missing material (a gap) is positive, while a deviation is excess
            # material.
            gaps = -(cosine * np.cos(phases) + sine * np.sin(phases))
            options["deviation"] = PathTable(tuple(positions), tuple(gaps))
        return default_load_sharing_pair(stage, **options)

    def _change_stage(self, changes: dict) -> tuple:
        """Return (changed `GearStage`, options of its model, flank deviation).

        `changes` maps names of parameters, such as "pinion.shift", to values in SI units. The
        options are arguments of `GearPair.from_geometry` with changed load and damping. The
        deviation is a list with the cosine and the sine coefficient of the first mesh harmonic, m.
        """
        gears: dict = {"pinion": {}, "wheel": {}}
        backlash = self.stage.backlash if self.keep_backlash else None
        fields = {"backlash": backlash, "centre_distance": self.stage.centre_distance}
        options = dict(self.options)
        # A changed damping replaces the damping in the options, which may have a different name.
        if _DAMPING_NAMES & changes.keys():
            options = {name: options[name] for name in options if name not in _DAMPING_NAMES}
        for name, value in changes.items():
            gear, _, field = name.rpartition(".")
            if name in LOAD_PARAMETERS:
                options[name] = value
            elif gear:
                gears[gear][field] = value
            elif name not in FLANK_PARAMETERS:
                fields[field] = value
        pinion = _change_gear(self.stage.pinion, gears["pinion"])
        wheel = _change_gear(self.stage.wheel, gears["wheel"])
        deviations = [changes.get(name, 0.0) for name in FLANK_PARAMETERS]
        return GearStage(pinion, wheel, **fields), options, deviations


def _change_gear(gear: Any, changes: dict) -> Any:
    """Return a copy of a `SpurGear` with changed fields.

    `changes` maps names of fields, such as "shift", to values in SI units.
    """
    # A default tip diameter depends on other fields such as the profile shift, so it is recomputed.
    if changes and "tip_diameter" not in changes:
        default = dataclasses.replace(gear, tip_diameter=None).tip_diameter
        if abs(default - gear.tip_diameter) <= 1e-12 * gear.tip_diameter:
            changes = changes | {"tip_diameter": None}
    return dataclasses.replace(gear, **changes)


def _describe_parameter(name: str, parameter: Any) -> str:
    """Return a short description of a parameter with a name such as "shift" or "pinion.shift".

    `parameter` is its declaration; the first clause of its text is used, up to a comma or
    semicolon. An example of the result is "profile shift of the pinion".
    """
    gear, _, field = name.rpartition(".")
    text = parameter.raw_description.split(";")[0].split(",")[0].strip()
    text = text[:1].lower() + text[1:] if text else field.replace("_", " ")
    return f"{text} of the {gear}" if gear else text


class FunctionSource:
    """Create designs by calling a function that takes parameters by name and returns a model."""

    def __init__(self, function: Callable):
        """Collect the arguments of a function that can be passed by name, and their descriptions.

        Raise ValueError if there are none. Only arguments declared with a type and unit have a
        description.
        """
        self.function = function
        arguments: list = []
        # Some built-in functions have no signature.
        with suppress(TypeError, ValueError):
            arguments = list(inspect.signature(function).parameters.values())
        # Positional-only and variadic arguments cannot be passed by name.
        kinds = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
        arguments = [argument for argument in arguments if argument.kind in kinds]
        checks.require(arguments, "model", function, "a function with arguments that have names")
        empty = inspect.Parameter.empty
        self.required = [argument.name for argument in arguments if argument.default is empty]
        declared: dict = {}
        with suppress(AttributeError, TypeError):
            declared = parameters.declared_parameters(function)
        self.parameters = {argument.name: declared.get(argument.name) for argument in arguments}
        self.descriptions = {
            name: (cf_units(parameter.unit), _describe_parameter(name, parameter))
            for name, parameter in self.parameters.items()
            if parameter
        }

    def value(self, name: str) -> None:
        """Return None, because a function has no nominal values."""

    def __call__(self, arguments: dict) -> Any:
        """Call the function with `arguments`, name -> value, and return the model that it returns.

        Raise ValueError if a required argument is missing or the function raises an arithmetic
        error.
        """
        missing = [name for name in self.required if name not in arguments]
        if missing:
            raise ValueError(
                f"tolerances.{missing[0]} is missing: the function has no default value for it"
            )
        try:
            return self.function(**arguments)
        except ArithmeticError as error:
            raise ValueError(f"{type(error).__name__} in the function: {error}") from error


class Designs:
    """Random designs within tolerances: points of a scrambled Sobol' sequence and their models."""

    def __init__(self, model: Any, tolerances: Any, seed: int = 0):
        """Read the tolerances of a model and build the nominal model.

        `model` is a model, a `StageDesign` or a function that returns a model; `tolerances` maps
        names of parameters to their distributions, as in `gearlib.scatter`. `seed` is the seed of
        the scrambled Sobol' sequence. Raise ValueError if an argument is invalid.
        """
        allowed = "a model such as GearPair, a StageDesign or a function that returns a model"
        checks.require(is_model(model) or callable(model), "model", model, allowed)
        self.source: Any = model
        if not isinstance(model, StageDesign):
            self.source = ModelSource(model) if is_model(model) else FunctionSource(model)
        source = self.source
        self.tolerances = read_tolerances(tolerances, source.parameters, source.value)
        self.names = self.tolerances.names
        self.seed = seed
        if is_model(model):
            # A ratio and the field that it determines must not both vary.
            for name, field in RATIOS.items():
                if {name, field} <= {*self.names}:
                    raise ValueError(
                        f"tolerances.{field} is not allowed together with tolerances.{name}: both "
                        "determine the same quantity; give one of them"
                    )
        self.nominal = self.model(self.tolerances.centres)

    def points(self, start: int, stop: int) -> np.ndarray:
        """Return the points `start` to `stop` - 1 of the scrambled Sobol' sequence, (n, k + 2).

        Sobol' points fill the unit cube evenly. Each has coordinates between 0 and 1 for the k
        parameters, followed by the displacement and velocity of an initial state.
        """
        # Initial states are always included, so that the parameters do not depend on whether they
        # are used.
        dimension = len(self.names) + _INITIAL_STATE_DIMENSIONS
        engine = qmc.Sobol(dimension, bits=_SOBOL_BITS, rng=self.seed)
        if start:
            engine.fast_forward(start)
        with warnings.catch_warnings():
            # The sequence warns if the number of points is not a power of 2.
            warnings.simplefilter("ignore", UserWarning)
            points = engine.random(stop - start)
        # Half the grid spacing is added because coordinates must not be 0.
        return points + 0.5**_SOBOL_BITS / 2.0

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the values of the k parameters, (n, k), SI units, at Sobol' points, (n, k + 2)."""
        return self.tolerances.values(points[:, : len(self.names)])

    def model(self, values: np.ndarray) -> Any:
        """Build the model with these values of the k parameters, in SI units.

        Raise ValueError if it cannot be built.
        """
        model = self.source(dict(zip(self.names, map(float, values), strict=True)))
        allowed = "a model such as GearPair"
        checks.require(is_model(model), "the value of the function", model, allowed)
        return model

    def duty_model_builder(self, values: np.ndarray) -> Callable | None:
        """Return a function without arguments that builds the model for a duty point, or None.

        A duty point is a torque and speed; `values` are the k parameters in SI units. Return None
        unless the designs are gears given by geometry, because other models serve both purposes.
        """
        if not isinstance(self.source, StageDesign):
            return None
        changes = dict(zip(self.names, map(float, values), strict=True))
        return partial(self.source.duty_model, changes)

    def units(self, name: str) -> tuple[str, str]:
        """Return the CF units and the description of a parameter."""
        return self.source.descriptions.get(name, ("1", name))


def count_error_messages(messages: Iterable[str]) -> list[tuple[int, str]]:
    """Count similar error messages; return a list of (count, example), most frequent first.

    Messages are similar if they differ only in their numbers; empty messages are ignored.
    """
    groups: dict = {}  # message with dots instead of numbers -> messages
    for message in messages:
        if message:
            groups.setdefault(_NUMBER_PATTERN.sub("...", message), []).append(message)
    counts = [(len(examples), examples[0]) for examples in groups.values()]
    return sorted(
        counts, key=lambda count_and_example: (-count_and_example[0], count_and_example[1])
    )


#: Meanings of the status codes of a quantity: 0 FOUND, 1 ABSENT (the design does not have it), 2
#: LOST (the search failed). Designs that cannot be built have the code -1, NO_DESIGN.
STATUS_MEANINGS = ("found", "there_is_none", "not_followed")
FOUND, ABSENT, LOST = range(len(STATUS_MEANINGS))
NO_DESIGN = -1
#: Quantity that is a speed of the main resonance -> attribute of `MainResonance`.
RESONANCE_NAMES = {"jump_up": "jump_up", "jump_down": "jump_down", "onset_of_contact_loss": "onset"}
_PEAK_QUANTITIES = {"peak", "resonance_force_ratio"}
_SHARING_QUANTITIES = {"load_sharing", "least_load_sharing"}
#: Quantities whose worst value is the smallest; for all others it is the largest.
_MINIMISED_QUANTITIES = {"contact_margin", "least_load_sharing"}
_FORCE_RATIOS = {"dynamic_factor", "peak_force_ratio"}
_DUTY_QUANTITIES = {"force", "transmission_error", "contact_margin"}
_DUTY_QUANTITIES |= _SHARING_QUANTITIES | _FORCE_RATIOS


class DesignQuantities:
    """Compute quantities of designs that differ little from a nominal design.

    `nominal` has the quantities of the nominal design, (q,), NaN if they do not exist.
    """

    def __init__(self, model, quantities, *, speed: float | None = None, build_duty_model=None):
        """Check the names of the quantities and compute them for the nominal design `model`.

        `quantities` are names such as "jump_up" (a speed of the main resonance) or "force" (at the
        duty point, a torque and speed). `speed` is the speed of the duty point in rpm, or None if
        no quantity needs it. `build_duty_model` is a function without arguments that returns the
        nominal model for the duty point; if it is None, `model` is used.
        """
        self.quantities = check_names("quantities", quantities, tuple(QUANTITIES))
        duty_quantities = _DUTY_QUANTITIES & set(self.quantities)
        _check_resonance_quantities(model, set(self.quantities) - duty_quantities)
        self.speed = speed
        self._nominal_orbit: Any = None
        if duty_quantities:
            duty_model = build_duty_model() if build_duty_model else model
            if speed is None:
                raise ValueError(
                    f"speed = None is not allowed: {min(duty_quantities)} is a quantity of the "
                    "duty point"
                )
            sharing_quantities = duty_quantities & _SHARING_QUANTITIES
            if sharing_quantities and not duty_model.mesh_names:
                name = min(sharing_quantities)
                raise ValueError(
                    f"quantities = {name!r} is not allowed for this model: only trains have it"
                )
            for name in duty_quantities & _FORCE_RATIOS:
                allowed = f"{duty_model.force_ratio_name!r}, which this model has"
                checks.require(name == duty_model.force_ratio_name, "quantities", name, allowed)
            equation = duty_model.equation
            if "transmission_error" in duty_quantities and equation and len(equation.deviation):
                raise ValueError(
                    "quantities = 'transmission_error' is not allowed for a model with flank "
                    "deviations: its displacement does not include them"
                )
            tuning = tuning_at_speed(duty_model, "speed", speed)
            # The orbit has the period of the excitation, in mesh periods.
            self._nominal_orbit = periodic_orbit(duty_model, tuning, period=duty_model.repeats)
        resonance_quantities = (name for name in self.quantities if name not in duty_quantities)
        self._resonance_names = [RESONANCE_NAMES.get(name, name) for name in resonance_quantities]
        self.nominal, _ = self.evaluate(model, build_duty_model)

    def evaluate(self, model: Any, build_duty_model: Callable | None = None) -> tuple:
        """Compute the q quantities of a design; return (values, status codes), each (q,).

        Values are in SI units and speeds in rpm, NaN if a quantity is not found. A status code is
        FOUND, ABSENT (the design does not have the quantity) or LOST (the search failed).
        `build_duty_model` is a function that returns the model of the design for the duty point
        (torque and speed); if it is None, `model` is used.
        """
        values = np.full(len(self.quantities), np.nan)
        status_codes = np.full(len(self.quantities), ABSENT, np.int8)
        resonance: Any = None
        if self._resonance_names:
            resonance = main_resonance(model, self._resonance_names)
        duty_model, summary = model, None
        if self._nominal_orbit:  # there are quantities of the duty point
            if build_duty_model:
                duty_model = build_duty_model()
            summary = self._duty_summary(duty_model)
        for i, name in enumerate(self.quantities):
            if name in _DUTY_QUANTITIES:
                values[i] = _duty_value(name, duty_model, summary, self._nominal_orbit.period)
            elif name == "peak":
                values[i] = resonance.peak_displacement * model.static_deflection
            elif name == "resonance_force_ratio":
                values[i] = resonance.peak_force
            else:  # a speed, which is a tuning in `resonance`
                values[i] = float(model.speed(1.0)) * getattr(resonance, RESONANCE_NAMES[name])
            if np.isfinite(values[i]):
                status_codes[i] = FOUND
            elif name in _DUTY_QUANTITIES or RESONANCE_NAMES.get(name, name) in resonance.failed:
                status_codes[i] = LOST
        return values, status_codes

    def _duty_summary(self, model: Any) -> np.ndarray | None:
        """Return the summary table of the orbit of a model at the speed of the duty point.

        The table has the extrema of displacement and force, one row per mesh. The search starts
        from the orbit of the nominal design, then from the default initial state. Return None if no
        orbit is found.
        """
        tuning = float(model.tuning_at(self.speed))
        nominal_orbit = self._nominal_orbit
        for guess in (nominal_orbit.state, None):  # None is the default initial state
            try:
                orbit = periodic_orbit(model, tuning, guess=guess, period=nominal_orbit.period)
            except (NoOrbit, ValueError):
                continue
            # An unstable orbit is accepted only if the nominal orbit is unstable, too.
            if orbit.stable or not nominal_orbit.stable:
                propagator = model.propagator(tuning)
                return propagator.record(orbit.state, nominal_orbit.period, MAX_EVENTS).summary
        return None


def _check_resonance_quantities(model: Any, quantities: set) -> None:
    """Raise ValueError unless a model has the given quantities of the main resonance.

    Speeds of jumps and of the onset of contact loss need rotating gears; resonance peaks need one
    degree of freedom.
    """
    type_name = type(model).__name__
    if model.speed is None:
        raise ValueError(f"model = {type_name} is not allowed: it has no rotational speed")
    has_one_degree_of_freedom = model.equation is not None
    # Models with several degrees of freedom have no `equation`: they have jumps but no peaks.
    has_main_resonance = has_one_degree_of_freedom and model.size == 2 and model.repeats == 1
    if quantities and has_one_degree_of_freedom and not has_main_resonance:
        raise ValueError(
            f"quantities = {min(quantities)!r} is not allowed for this {type_name}: "
            "the search needs an excitation that repeats every mesh period"
        )
    if _PEAK_QUANTITIES & quantities and not has_main_resonance:
        raise ValueError(
            f"quantities = {min(_PEAK_QUANTITIES & quantities)!r} is not allowed for this "
            f"{type_name}: peaks need a model with one degree of freedom"
        )


def _duty_value(name: str, model: Any, summary: Any, period: int) -> float:
    """Return a quantity of the orbit at the duty point (torque and speed) in SI units.

    `name` is its name, such as "force" or "contact_margin". `summary` has the extrema of
    displacement and force on the orbit, one row per mesh; if it is None, no orbit was found and the
    value is NaN. `period` is the period of the orbit in mesh periods. If there are several meshes,
    the worst value counts: the smallest margin or share, the largest force.
    """
    if summary is None:
        return math.nan
    table = np.atleast_2d(summary)
    if name in _SHARING_QUANTITIES:
        phase_span = 2.0 * math.pi * period
        # Only trains have the load sharing of each mesh over the orbit.
        variables = model.extra_summary_variables(dims=(), summaries=summary, span=phase_span)
        _, values = variables["load_sharing"]
    elif name == "contact_margin":
        clearances = model.clearances(table[:, columns.X_MIN], table[:, columns.X_MAX])
        values = clearances * model.static_deflection
    elif name == "transmission_error":
        values = (table[:, columns.X_MAX] - table[:, columns.X_MIN]) * model.static_deflection
        if model.mesh_names:  # a train
            return float(values[model.mesh_names.index(model.reference)])
    elif name == "force":
        values = largest_force(table) * model.load
    else:
        values = model.force_ratios(largest_force(table))
    # Meshes without load have no force ratio, so NaN is ignored.
    worst = np.fmin if name in _MINIMISED_QUANTITIES else np.fmax
    return float(worst.reduce(values))


def quantity_evaluator(designs: Any, quantities: Any, speed: float | None) -> DesignQuantities:
    """Return the `DesignQuantities` that computes quantities of some `Designs`.

    `quantities` are names such as "jump_up"; `speed` is the speed of the duty point in rpm, or None
    if none of the quantities needs it.
    """
    builder = designs.duty_model_builder(designs.tolerances.centres)
    return DesignQuantities(designs.nominal, quantities, speed=speed, build_duty_model=builder)


def check_names(key: str, names: Any, allowed: tuple) -> tuple:
    """Check an argument that is a sequence of names; return the names as a tuple.

    `key` is the name of the argument in messages. Raise ValueError unless each name is one of
    `allowed` and no name is repeated. A single string is not a sequence of names.
    """
    requirement = f"a sequence of {', '.join(map(repr, allowed))}"
    checks.require(not isinstance(names, str), key, names, requirement)
    checked_names = tuple(checks.check_sequence(key, names, allowed=requirement))
    for name in checked_names:
        checks.check_choice(key, name, allowed)
    checks.require(
        len(set(checked_names)) == len(checked_names), key, names, "without repeated names"
    )
    return checked_names

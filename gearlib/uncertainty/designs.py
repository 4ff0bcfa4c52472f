"""Designs: samples of scattering parameters, and the models with these parameters."""

import dataclasses
import inspect
import re
import warnings
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import qmc

from gearlib import checks, parameters
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
from gearlib.uncertainty import distributions
from gearlib.units import cf_units

#: Bits of the coordinates of Sobol' points; they limit the number of different points.
_SOBOL_BITS = 30
MAX_SAMPLES = 2**_SOBOL_BITS
#: Last coordinates of a point: displacement and velocity of a random initial state.
_START_DIMENSIONS = 2
#: Parameters that set the damping; a pair has exactly one of them.
_DAMPING_NAMES = {"damping_ratio", "material_damping", "logarithmic_decrement"}
_DEVIATION_TABLE_POINTS = 129
_NUMBER_PATTERN = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")


class ModelSource:
    """Make designs from a model by changing its parameters, names of `Model.settable`."""

    def __init__(self, model: Any):
        """Collect the parameters of a model that can vary, and their descriptions."""
        self.model, self.value = model, model.value
        fields = numeric_parameters(PairParameters) if model.pair else {}
        if dataclasses.is_dataclass(model):
            fields = fields | numeric_parameters(type(model))
        # Fields of trains are not numbers; other models may contain a train.
        names = [*model.settable, *(() if model.train is model else fields)]
        #: Name of a parameter -> declaration of its type and range, None if there is none.
        self.parameters = {name: fields.get(name) for name in names}
        #: Name of a parameter -> (CF unit, description).
        self.descriptions = parameters.units_and_names(type(model)) | model.settable

    def __call__(self, changes: dict) -> Any:
        """Return the model with changed parameters, a mapping of names to values."""
        return self.model.with_values(changes)


class StageDesign:
    """Make designs from a `gearlib.geometry.GearStage` by changing its geometry, load and damping.

    Parameters are ``centre_distance`` and ``backlash`` of the mesh, fields of a `SpurGear` such as
    ``pinion.thickness_allowance``, the load and the damping.
    """

    def __init__(self, mesh: Any, *, keep_backlash: bool = True, **options: Any):
        """Take a mesh and options of `GearPair.from_geometry`, such as torque and damping_ratio.

        A backlash that does not vary is that of the stage with `keep_backlash`; otherwise it is
        computed for each sample from profile shifts, centre distance and allowances.
        """
        self.stage = checks.gear_stage(mesh)
        self.keep_backlash = keep_backlash
        self.options = options
        self.parameters = geometry_parameters()
        self.descriptions = {
            name: (cf_units(parameter.unit), _parameter_text(name, parameter))
            for name, parameter in self.parameters.items()
        }

    def value(self, name: str) -> Any:
        """Return the nominal value of a parameter, None if there is none."""
        gear, _, field = name.rpartition(".")
        if not gear and name in LOAD_PARAMETERS | FLANK_PARAMETERS:
            return self.options.get(name)
        return getattr(getattr(self.stage, gear) if gear else self.stage, field)

    def __call__(self, changes: dict) -> Any:
        """Return the `GearPair` of the changed gears; with flank deviations a `OneDegreePair`."""
        mesh, options, (cosine, sine) = self._changed(changes)
        # The default mesh stiffness is that of ISO 6336-1.
        options["stiffness"] = options.get("stiffness") or "iso"
        pair = GearPair.from_geometry(mesh, **options)
        if not cosine and not sine and not FLANK_PARAMETERS.keys() & changes.keys():
            return pair
        return OneDegreePair(pair=pair, deviation=Harmonics((cosine,), (sine,)))

    def duty_model(self, changes: dict) -> Any:
        """Return the `LoadSharingPair` of the changed gears, the model of their duty point."""
        mesh, options, (cosine, sine) = self._changed(changes)
        if cosine or sine:
            start, end = mesh.path  # positions on the path of contact, m
            positions = np.linspace(start, end, _DEVIATION_TABLE_POINTS)
            phases = mesh.phase_of(positions)
            # The model takes missing material, a gap, as positive; a deviation is an excess.
            gaps = -(cosine * np.cos(phases) + sine * np.sin(phases))
            options["deviation"] = PathTable(tuple(positions), tuple(gaps))
        return default_load_sharing_pair(mesh, **options)

    def _changed(self, changes: dict) -> tuple:
        """Return the changed mesh, options, and cosine and sine coefficient of a deviation, m."""
        gears: dict = {"pinion": {}, "wheel": {}}
        backlash = self.stage.backlash if self.keep_backlash else None
        fields = {"backlash": backlash, "centre_distance": self.stage.centre_distance}
        options = dict(self.options)
        # A changed damping replaces that of the options, which may have another name.
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
        pinion, wheel = (_changed_gear(getattr(self.stage, name), gears[name]) for name in gears)
        deviations = [changes.get(name, 0.0) for name in FLANK_PARAMETERS]
        return GearStage(pinion, wheel, **fields), options, deviations


def _changed_gear(gear: Any, changes: dict) -> Any:
    """Return a gear with changed fields, name -> value."""
    # A default tip diameter depends on the profile shift and others, so it is computed again.
    if changes and "tip_diameter" not in changes:
        default = dataclasses.replace(gear, tip_diameter=None).tip_diameter
        if abs(default - gear.tip_diameter) <= 1e-12 * gear.tip_diameter:
            changes = changes | {"tip_diameter": None}
    return dataclasses.replace(gear, **changes)


def _parameter_text(name: str, parameter: Any) -> str:
    """Return a short text for a parameter, named as "shift" or "pinion.shift"."""
    gear, _, field = name.rpartition(".")
    text = parameter.text.split(";")[0].split(",")[0].strip()
    text = text[:1].lower() + text[1:] if text else field.replace("_", " ")
    return f"{text} of the {gear}" if gear else text


class FunctionSource:
    """Make designs by calling a function that takes parameters by name and returns a model."""

    def __init__(self, function: Callable):
        """Collect the arguments that can be passed by name, and their descriptions."""
        self.function, arguments = function, []
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
            name: (cf_units(parameter.unit), _parameter_text(name, parameter))
            for name, parameter in self.parameters.items()
            if parameter
        }

    def value(self, name: str) -> None:
        """Return None, because a function has no nominal values."""

    def __call__(self, arguments: dict) -> Any:
        """Return the model of the function for `arguments`, a mapping of names to values."""
        missing = [name for name in self.required if name not in arguments]
        if missing:
            message = "is missing: the function has no default value"
            raise ValueError(f"tolerances.{missing[0]} {message}")
        try:
            return self.function(**arguments)
        except ArithmeticError as error:
            raise ValueError(f"{type(error).__name__} in the function: {error}") from error


class Designs:
    """Random designs by tolerances: points of a scrambled Sobol' sequence and their models."""

    def __init__(self, model: Any, tolerances: Any, seed: int = 0):
        """Check these arguments of `gearlib.scatter`, and build the nominal model."""
        allowed = "a model such as GearPair, a StageDesign or a function that returns a model"
        checks.require(is_model(model) or callable(model), "model", model, allowed)
        self.source: Any = model
        if not isinstance(model, StageDesign):
            self.source = ModelSource(model) if is_model(model) else FunctionSource(model)
        self.tolerances = distributions.read(tolerances, self.source.parameters, self.source.value)
        self.names = self.tolerances.names
        self.seed = seed
        for name, field in RATIOS.items() if is_model(model) else ():
            if {name, field} <= {*self.names}:
                raise ValueError(
                    f"tolerances.{field} is not allowed beside tolerances.{name}: both set the "
                    "same quantity; give one of them"
                )
        self.nominal = self.model(self.tolerances.centres)

    def points(self, first: int, last: int) -> np.ndarray:
        """Return the points `first` to `last` - 1: k parameters, 2 initial values; (n, k + 2)."""
        # Initial states are always included, so that the parameters do not depend on their use.
        engine = qmc.Sobol(len(self.names) + _START_DIMENSIONS, bits=_SOBOL_BITS, rng=self.seed)
        if first:
            engine.fast_forward(first)
        with warnings.catch_warnings():
            # The sequence warns if the number of points is not a power of 2.
            warnings.simplefilter("ignore", UserWarning)
            points = engine.random(last - first)
        # Half the grid spacing is added because coordinates must not be 0.
        return points + 0.5**_SOBOL_BITS / 2.0

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the parameters, (n, k), of points of the unit cube, (n, k + 2)."""
        return self.tolerances.values(points[:, : len(self.names)])

    def model(self, values: np.ndarray) -> Any:
        """Return the model with parameters, (k,), or raise ValueError if it cannot be built."""
        model = self.source(dict(zip(self.names, map(float, values), strict=True)))
        allowed = "a model such as GearPair"
        checks.require(is_model(model), "the value of the function", model, allowed)
        return model

    def duty_model_builder(self, values: np.ndarray) -> Callable | None:
        """Return a function that builds the model of the gears at the duty point, else None."""
        if not isinstance(self.source, StageDesign):
            return None
        changes = dict(zip(self.names, map(float, values), strict=True))
        return partial(self.source.duty_model, changes)

    def units(self, name: str) -> tuple[str, str]:
        """Return CF units and description of a parameter."""
        return self.source.descriptions.get(name, ("1", name))


def count_error_messages(messages: Iterable[str]) -> list[tuple[int, str]]:
    """Return the count and an example of each kind of error message, the most frequent first."""
    # Messages of one kind differ only in their numbers.
    kinds: dict = {}
    for message in filter(None, messages):
        kinds.setdefault(_NUMBER_PATTERN.sub("...", message), []).append(message)
    counts = ((len(examples), examples[0]) for examples in kinds.values())
    return sorted(counts, key=lambda row: (-row[0], row[1]))

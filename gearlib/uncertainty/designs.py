"""Samples of the parameters that scatter, and the models that they make.

What scatters is a model, by the names of its `settable`; two drawn gears, see `DrawnPair`; or a
function that returns a model and takes what scatters as keyword arguments.
"""

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
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.harmonics import Harmonics
from gearlib.models.load_sharing_pair import tooth_pairs_of
from gearlib.models.model import is_model
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.pair_parameters import PairParameters
from gearlib.models.tolerated import OF_FLANKS, OF_LOAD, RATIOS, numbers
from gearlib.models.tolerated import of_drawing as names_of_drawing
from gearlib.uncertainty import distributions

#: Bits of the Sobol' numbers, and largest number of points that these can tell apart.
_BITS = 30
MAX_SAMPLES = 2**_BITS
#: Dimensions of a point beside the parameters: displacement and velocity of a start.
STARTS = 2
#: Damping in contact, of which there is one.
_DAMPINGS = {"damping_ratio", "material_damping", "logarithmic_decrement"}
#: Positions on the path of contact at which a wave of the flanks is tabulated.
_POSITIONS = 129
_NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")


class OfModel:
    """A model whose parameters scatter, by the names of `Model.settable`."""

    def __init__(self, model: Any):
        self.model, self.value = model, model.value
        declared = numbers(type(model)) if dataclasses.is_dataclass(model) else {}
        declared = (numbers(PairParameters) if model.mesh else {}) | declared
        names = [*model.settable, *({} if model.train is model else declared)]
        self.known = {name: declared.get(name) for name in names}
        self.described = parameters.named(type(model)) | model.settable

    def __call__(self, changes: dict) -> Any:
        """Return the model with parameters changed."""
        return self.model.with_values(changes)


class DrawnPair:
    """Two drawn gears, a `gearlib.geometry.Mesh`, whose drawing scatters.

    Names of what scatters are those of the mesh, ``centre_distance`` and ``backlash``, those of a
    `SpurGear`, as ``pinion.thickness_allowance``, and those of the load and damping. Without a
    backlash that scatters it is that of the mesh ("drawing"), or what shifts, centre distance and
    allowances leave in each sample (None). Options are torque, damping_ratio and so on, those of
    `GearPair.from_geometry`.
    """

    def __init__(self, mesh: Any, *, backlash: str | None = "drawing", **options: Any):
        self.mesh = checks.drawn_mesh(mesh)
        self.backlash = checks.one_of("backlash", backlash, ("drawing", None))
        self.options = options
        self.known = names_of_drawing()
        self.described = {
            name: (parameters.cf_units(parameter.kind.unit), _words(name, parameter))
            for name, parameter in self.known.items()
        }

    def value(self, name: str) -> Any:
        """Return what the drawing has of a name, None where it has nothing."""
        part, _, field = name.rpartition(".")
        if not part and name in OF_LOAD | OF_FLANKS:
            return self.options.get(name)
        return getattr(getattr(self.mesh, part) if part else self.mesh, field)

    def __call__(self, changes: dict) -> Any:
        """Return the `GearPair` of the gears with parts of the drawing changed."""
        mesh, options, (cosine, sine) = self._changed(changes)
        options["stiffness"] = options.get("stiffness") or "iso"
        pair = GearPair.from_geometry(mesh, **options)
        if not cosine and not sine and not OF_FLANKS.keys() & changes.keys():
            return pair
        return OneDegreePair(pair=pair, deviation=Harmonics((cosine,), (sine,)))

    def at_duty(self, changes: dict) -> Any:
        """Return the `LoadSharingPair` of the same gears, for their duty point."""
        mesh, options, (cosine, sine) = self._changed(changes)
        if cosine or sine:
            position = np.linspace(*mesh.path, _POSITIONS)
            phase = mesh.phase_of(position)
            gap = -(cosine * np.cos(phase) + sine * np.sin(phase))
            options["deviation"] = PathTable(tuple(position), tuple(gap))
        return tooth_pairs_of(mesh, **options)

    def _changed(self, changes: dict) -> tuple:
        """Return the mesh, the options of the load, and the wave of the flanks."""
        fields: dict = {"pinion": {}, "wheel": {}, "": {}}
        fields[""]["backlash"] = self.mesh.backlash if self.backlash == "drawing" else None
        fields[""]["centre_distance"] = self.mesh.centre_distance
        options = dict(self.options)
        if _DAMPINGS & changes.keys():
            options = {name: x for name, x in options.items() if name not in _DAMPINGS}
        for name, value in changes.items():
            part, _, field = name.rpartition(".")
            if name in OF_LOAD:
                options[name] = value
            elif name not in OF_FLANKS:
                fields[part][field] = value
        pinion, wheel = (_gear(getattr(self.mesh, x), fields[x]) for x in ("pinion", "wheel"))
        wave = [changes.get(name, 0.0) for name in OF_FLANKS]
        return Mesh(pinion, wheel, **fields[""]), options, wave


def _gear(gear: Any, changes: dict) -> Any:
    """Return a gear with fields changed; a tip that follows from the shift goes on doing so."""
    if changes and "tip_diameter" not in changes:
        free = dataclasses.replace(gear, tip_diameter=None)
        if abs(free.tip_diameter - gear.tip_diameter) <= 1e-12 * gear.tip_diameter:
            changes = changes | {"tip_diameter": None}
    return dataclasses.replace(gear, **changes)


def _words(name: str, parameter: Any) -> str:
    """Return the description of a parameter of the drawing or of a function."""
    part = name.rpartition(".")[0]
    words = parameter.words.split(";")[0].split(",")[0].strip()
    words = words[:1].lower() + words[1:] if words else name.rpartition(".")[2].replace("_", " ")
    return f"{words} of the {part}" if part else words


class OfFunction:
    """A function that returns a model, and takes what scatters as keyword arguments."""

    def __init__(self, function: Callable):
        self.function, arguments = function, []
        with suppress(TypeError, ValueError):
            arguments = list(inspect.signature(function).parameters.values())
        # What is given by position, or by any name, has no name here.
        arguments = [x for x in arguments if x.kind in (x.POSITIONAL_OR_KEYWORD, x.KEYWORD_ONLY)]
        checks.require(arguments, "model", function, "a function with arguments that have names")
        self.needed = [x.name for x in arguments if x.default is x.empty]
        declared: dict = {}
        with suppress(AttributeError, TypeError):
            declared = parameters.declared(function)
        self.known = {x.name: declared.get(x.name) for x in arguments}
        self.described = {
            name: (parameters.cf_units(x.unit), _words(name, x)) if x else ("1", name)
            for name, x in self.known.items()
        }

    def value(self, name: str) -> None:
        """Return None: a function has no values."""

    def __call__(self, changes: dict) -> Any:
        """Return the model of these arguments."""
        missing = [name for name in self.needed if name not in changes]
        if missing:
            raise ValueError(
                f"tolerances.{missing[0]} is missing: the function has no value of its own"
            )
        try:
            return self.function(**changes)
        except ArithmeticError as error:
            raise ValueError(f"{type(error).__name__} in the function: {error}") from error


class Designs:
    """Many designs: the points of a scrambled Sobol' sequence, and their models."""

    def __init__(self, model: Any, tolerances: Any, seed: int = 0):
        words = "a model such as GearPair, a DrawnPair or a function that returns a model"
        checks.require(is_model(model) or callable(model), "model", model, words)
        self.source: Any = model
        if not isinstance(model, DrawnPair):
            self.source = OfModel(model) if is_model(model) else OfFunction(model)
        self.tolerances = distributions.read(tolerances, self.source.known, self.source.value)
        self.names = self.tolerances.names
        self.seed = checks.integer("seed", seed, 0)
        for name, field in RATIOS.items() if is_model(model) else ():
            if {name, field} <= {*self.names}:
                raise ValueError(
                    f"tolerances.{field} is not allowed beside tolerances.{name}: both set the "
                    "same; give one of them"
                )
        self.nominal = self.model(self.tolerances.centres)

    def points(self, first: int, last: int) -> np.ndarray:
        """Return the points of a range of indices, shape (n, k + 2), the last two of a start."""
        # All dimensions in one sequence: parameters do not change where starts are wanted.
        engine = qmc.Sobol(len(self.names) + STARTS, bits=_BITS, rng=self.seed)
        if first:
            engine.fast_forward(first)
        with warnings.catch_warnings():
            # Any number of points is allowed, not powers of 2 alone.
            warnings.simplefilter("ignore", UserWarning)
            points = engine.random(last - first)
        # In the middle of its cell, so that none lies on the boundary.
        return points + 0.5**_BITS / 2.0

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the parameters of points, shape (n, k)."""
        return self.tolerances.values(points[:, : len(self.names)])

    def model(self, values: np.ndarray) -> Any:
        """Return the model of one row of values; ValueError if there is none."""
        model = self.source(dict(zip(self.names, map(float, values), strict=True)))
        words = "a model such as GearPair, of each sample"
        checks.require(is_model(model), "the value of the function", model, words)
        return model

    def at_duty(self, values: np.ndarray) -> Callable | None:
        """Return what makes the model of a row of values for its duty point, if it is another."""
        if not isinstance(self.source, DrawnPair):
            return None
        changes = dict(zip(self.names, map(float, values), strict=True))
        return partial(self.source.at_duty, changes)

    def units(self, name: str) -> tuple[str, str]:
        """Return CF units and description of a parameter."""
        return self.source.described.get(name, ("1", name))


def counted(refusals: Iterable[str]) -> list[tuple[int, str]]:
    """Return (number of samples, an example) of texts of refusals, the most frequent first.

    Refusals that differ in their numbers only count as equal.
    """
    kinds: dict = {}
    for text in filter(None, refusals):
        kinds.setdefault(_NUMBER.sub("...", text), []).append(text)
    return sorted(((len(texts), texts[0]) for texts in kinds.values()), key=lambda x: (-x[0], x[1]))

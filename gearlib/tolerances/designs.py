"""From points of the unit cube to parameters and models, the same for any range of points.

What scatters is a model, by the names of its `settable`; two drawn gears, see `DrawnPair`; or a
function that returns a model and takes what scatters as keyword arguments.
"""

import dataclasses
import inspect
import re
from functools import partial

import numpy as np
from scipy.stats import qmc

from gearlib import checks, parameters
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.geometry.relief import PathTable
from gearlib.models.harmonics import Harmonics
from gearlib.models.load_sharing_pair import tooth_pairs_of
from gearlib.models.model import is_model
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.pair_parameters import PairParameters
from gearlib.models.parameter_values import ratio_fields, unchecked
from gearlib.models.tolerated import OF_FLANKS, OF_LOAD, RATIOS, numbers
from gearlib.models.tolerated import of_drawing as names_of_drawing
from gearlib.tolerances import distributions

#: Most points that there are: Sobol' numbers have so many bits.
_BITS = 30
MOST = 2**_BITS
#: Points are made in blocks of so many that begin at whole multiples of it.
_BLOCK = 1024
#: Dimensions beside those of the parameters, of a start: displacement and velocity.
STARTS = 2
#: Damping in contact, of which there is one.
_DAMPINGS = {"damping_ratio", "material_damping", "logarithmic_decrement"}
#: Positions on the path of contact at which a wave of the flanks is tabulated.
_POSITIONS = 129
_NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")


class OfModel:
    """A model whose parameters scatter, by the names of `Model.settable`."""

    def __init__(self, model):
        self.model = model
        declared = numbers(type(model)) if dataclasses.is_dataclass(model) else {}
        declared = (numbers(PairParameters) if model.mesh else {}) | declared
        names = [*model.settable, *({} if model.train is model else declared)]
        self.known = {name: declared.get(name) for name in names}
        self.described = parameters.named(type(model)) | model.settable

    def own(self, name):
        """Return the value that the model has of a parameter."""
        return self.model.value(name)

    def __call__(self, changes):
        """Return the model with parameters changed."""
        return self.model.with_values(changes)


class DrawnPair:
    """Two drawn gears whose drawing scatters.

    Parameters
    ----------
    mesh : gearlib.geometry.Mesh
        Names of what scatters are its own, ``centre_distance`` and ``backlash``, those of a
        `SpurGear`, as ``pinion.thickness_allowance``, and those of the load and damping. Without a
        backlash that scatters, it is what shifts, centre distance and allowances leave where
        ``backlash`` is None.
    backlash : "drawing" or None, default "drawing"
        "drawing": that of the mesh; None: what its gears leave, sample by sample.
    **options
        torque, damping_ratio and so on, as of `GearPair.from_geometry`.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """

    def __init__(self, mesh, *, backlash="drawing", **options):
        self.mesh = checks.drawn_mesh(mesh)
        self.backlash = checks.one_of("backlash", backlash, ("drawing", None))
        self.options = options
        self.known = names_of_drawing()
        self.described = {
            name: (parameters.cf_units(one.kind.unit), _words(name, one))
            for name, one in self.known.items()
        }

    def own(self, name):
        """Return what the drawing has of a name, None where it has nothing."""
        part, _, field = name.rpartition(".")
        if not part and name in OF_LOAD | OF_FLANKS:
            return self.options.get(name)
        return getattr(getattr(self.mesh, part) if part else self.mesh, field)

    def __call__(self, changes):
        """Return the `GearPair` of the gears with parts of the drawing changed."""
        mesh, options, (cosine, sine) = self._changed(changes)
        options["stiffness"] = options.get("stiffness") or "iso"
        pair = GearPair.from_geometry(mesh, **options)
        if not cosine and not sine and not OF_FLANKS.keys() & changes.keys():
            return pair
        return OneDegreePair(pair=pair, deviation=Harmonics((cosine,), (sine,)))

    def at_duty(self, changes):
        """Return the `LoadSharingPair` of the same gears, for their duty point."""
        mesh, options, (cosine, sine) = self._changed(changes)
        if cosine or sine:
            position = np.linspace(*mesh.path, _POSITIONS)
            phase = mesh.phase_of(position)
            gap = -(cosine * np.cos(phase) + sine * np.sin(phase))
            options["deviation"] = PathTable(tuple(position), tuple(gap))
        return tooth_pairs_of(mesh, **options)

    def _changed(self, changes):
        """Return the mesh, the options of the load, and the wave of the flanks."""
        gears = {"pinion": {}, "wheel": {}}
        own: dict = {"backlash": self.mesh.backlash if self.backlash == "drawing" else None}
        own["centre_distance"] = self.mesh.centre_distance
        options = dict(self.options)
        if _DAMPINGS & {*changes}:
            options = {name: x for name, x in options.items() if name not in _DAMPINGS}
        wave = [changes.get(name, 0.0) for name in OF_FLANKS]
        changes = {name: value for name, value in changes.items() if name not in OF_FLANKS}
        for name, value in changes.items():
            part, _, field = name.rpartition(".")
            (gears[part] if part else options if name in OF_LOAD else own)[field] = value
        both = {part: _gear(getattr(self.mesh, part), new) for part, new in gears.items()}
        return Mesh(**both, **own), options, wave


def _gear(gear, changes):
    """Return a gear with fields changed; a tip that follows from the shift goes on doing so."""
    if not changes:
        return gear
    if "tip_diameter" not in changes:
        free = dataclasses.replace(gear, tip_diameter=None)
        if abs(free.tip_diameter - gear.tip_diameter) <= 1e-12 * gear.tip_diameter:
            gear = free
            changes = changes | {"tip_diameter": None}
    return dataclasses.replace(gear, **changes)


def _words(name, parameter):
    part = name.rpartition(".")[0]
    words = parameter.words.split(";")[0].split(",")[0].strip()
    words = words[:1].lower() + words[1:] if words else name.rpartition(".")[2].replace("_", " ")
    return f"{words} of the {part}" if part else words


class OfFunction:
    """A function that returns a model, and takes what scatters as keyword arguments."""

    def __init__(self, function):
        self.function = function
        try:
            asked = list(inspect.signature(function).parameters.values())
        except (TypeError, ValueError):
            asked = []
        # What is given by position, or by any name, has no name here.
        asked = [one for one in asked if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)]
        self.needed = [one.name for one in asked if one.default is one.empty]
        names = [one.name for one in asked]
        if not names:
            raise checks.refusal("model", function, "a function with arguments that have names")
        try:
            own = parameters.declared(function)
        except (AttributeError, TypeError):
            own = {}
        self.known = {name: own.get(name) for name in names}
        self.described = {
            name: (parameters.cf_units(one.unit), _words(name, one)) if one else ("1", name)
            for name, one in self.known.items()
        }

    def own(self, name):
        """Return None: a function has no values."""
        return None

    def __call__(self, changes):
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

    def __init__(self, model, tolerances, seed=0):
        if is_model(model):
            self.source = OfModel(model)
        elif isinstance(model, (OfModel, DrawnPair, OfFunction)):
            self.source = model
        elif callable(model):
            self.source = OfFunction(model)
        else:
            words = "a model such as GearPair, a DrawnPair or a function that returns a model"
            raise checks.refusal("model", model, words)
        self.tolerances = distributions.read(tolerances, self.source.known, self.source.own)
        self.names = self.tolerances.names
        self.seed = checks.integer("seed", seed, 0)
        for name, field in RATIOS.items():
            if isinstance(self.source, OfModel) and {name, field} <= {*self.names}:
                raise ValueError(
                    f"tolerances.{field} is not allowed beside tolerances.{name}: both set the "
                    "same; give one of them"
                )
        self.nominal = self.model(self.tolerances.centres)

    def points(self, first, last):
        """Return the points of a range of indices, shape (n, k + 2), the last two of a start."""
        begin = first - first % _BLOCK
        # All dimensions in one sequence: parameters do not change where starts are asked for.
        engine = qmc.Sobol(len(self.names) + STARTS, bits=_BITS, rng=self.seed)
        if begin:
            engine.fast_forward(begin)
        blocks = [engine.random(_BLOCK) for _ in range(begin, last, _BLOCK)]
        found = np.concatenate(blocks)[first - begin : last - begin]
        # In the middle of its cell, so that none lies on the boundary.
        return found + 0.5**_BITS / 2.0

    def values(self, points):
        """Return the parameters of points, shape (n, k)."""
        return self.tolerances.values(points[:, : len(self.names)])

    def model(self, values):
        """Return the model of one row of values; ValueError if there is none."""
        found = self.source(dict(zip(self.names, map(float, values), strict=True)))
        if not is_model(found):
            words = "a model such as GearPair, of each sample"
            raise checks.refusal("the value of the function", found, words)
        return found

    def at_duty(self, values):
        """Return what makes the model of a row of values for its duty point, if it is another."""
        if not isinstance(self.source, DrawnPair):
            return None
        changes = dict(zip(self.names, map(float, values), strict=True))
        return partial(self.source.at_duty, changes)

    def pairs(self, values):
        """Return (pairs, models, refusals) of rows of values.

        `pairs` are all designs that there are as one `GearPair` with arrays for numbers, where they
        are plain pairs, else None; `models` then has them all, None where there is none.
        """
        pairs = self._pairs_at_once(values)
        if pairs is not None:
            return pairs, None, [""] * len(values)
        models, refusals = self.built(values)
        there = [model for model in models if model is not None]
        if not there or not all(map(_plain, there)):
            return None, models, refusals
        columns = {
            name: np.array([getattr(model, name) for model in there])
            for name in numbers(PairParameters)
        }
        pairs = unchecked(GearPair, teeth=there[0].teeth, **columns)
        alike = all(model.teeth == pairs.teeth for model in there)
        return (pairs if alike and within_scales(pairs) else None), models, refusals

    def _pairs_at_once(self, values):
        """Return the same from columns of values, None where some of them may be refused."""
        if not isinstance(self.source, OfModel) or not _plain(self.nominal):
            return None
        fields = {
            name: np.full(len(values), float(getattr(self.source.model, name)))
            for name in numbers(PairParameters)
        }
        given = dict(zip(self.names, np.ascontiguousarray(values.T), strict=True))
        # Every range is an interval, and the rest is a matter of scales: extremes stand for all.
        for name, column in given.items():
            one = self.source.known[name]
            kind = one.kind if one else parameters.NONNEGATIVE
            if not all(kind.accepts(float(end)) for end in (column.min(), column.max())):
                return None
        fields |= {name: column for name, column in given.items() if name not in RATIOS}
        teeth = self.source.model.teeth
        for name in set(RATIOS) & set(given):
            fields |= ratio_fields(unchecked(GearPair, teeth=teeth, **fields), name, given[name])
        pairs = unchecked(GearPair, teeth=teeth, **fields)
        return pairs if within_scales(pairs) else None

    def built(self, values):
        """Return the models of rows of values, and texts: why there is none, "" where there is."""
        models, refusals = [], []
        for row in values:
            try:
                models.append(self.model(row))
                refusals.append("")
            except ValueError as error:
                models.append(None)
                refusals.append(str(error))
        return models, refusals

    def units(self, name):
        """Return (CF units, words) of a parameter."""
        return self.source.described.get(name, ("1", name))


def _plain(model):
    """Return whether a model is its own gear pair."""
    return model.mesh is model


def part_of(pairs, own):
    """Return some of many pairs, one `GearPair` with arrays for numbers, by a slice."""
    columns = {name: getattr(pairs, name)[own] for name in numbers(PairParameters)}
    return unchecked(GearPair, teeth=pairs.teeth, **columns)


def within_scales(pairs):
    """Return whether the scales of many pairs are ordinary numbers, by far within what is allowed.

    Pairs are one `GearPair` with arrays for numbers.
    """
    scales = (pairs.max_stiffness, pairs.reduced_mass, pairs.load)
    fits = all((x > 1e-20).all() and (x < 1e20).all() for x in scales)
    fits = fits and (pairs.stiffness_ratio > 1e-3).all()
    ratios = pairs.damping_ratio, pairs.backlash_damping_ratio
    return bool(fits and all((x < 1e20).all() for x in ratios))


def kind_of(refusal):
    """Return a refusal without its numbers: what many samples have in common."""
    return _NUMBER.sub("...", refusal)


def counted(refusals):
    """Return [(number of samples, an example)] of texts of refusals, the most frequent first."""
    kinds: dict = {}
    for text in refusals:
        if text:
            kinds.setdefault(kind_of(text), []).append(text)
    return sorted(((len(all_), all_[0]) for all_ in kinds.values()), key=lambda x: (-x[0], x[1]))

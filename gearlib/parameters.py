"""Parameters: unit, range, words and symbol, declared once, where something takes them.

The annotations of a constructor or function declare its parameters: kind, words, symbol. ::

    max_stiffness: Annotated[float, STIFFNESS, "Maximum mesh stiffness", "C_max"]

All else follows from them: checks and refusals (`check`, `checked`), docstrings and tables of the
docs (`documented`), sections of the configuration with their schema and the options of commands
(`gearlib.config.types.like`), ranges of sliders. This module loads no numerical stack.
"""

import functools
import inspect
import math
import re
import textwrap
from dataclasses import dataclass
from typing import Annotated, Any, get_origin

from gearlib import checks

#: Default of a parameter that has to be given.
MISSING = inspect.Parameter.empty


class Kind:
    """The values that a parameter may have, by a function of a value and in words."""

    words: Any

    def __init__(self, words, accepts):
        self.words, self.accepts = words, accepts

    def check(self, name, value):
        """Return a value as it is stored, else raise ValueError."""
        checks.require(self.accepts(value), name, value, self.words)
        return value


class Number(Kind):
    """A real number within bounds, which `above` and `below` leave out.

    Its unit is that of SI, "1" without dimension; `example` is a value in another one, as a
    configuration may have it. `infinite` says what infinity means, where it is allowed; an
    `optional` value may be None.
    """

    above = least = below = most = None  # type: float | None
    optional = False

    def __init__(self, unit, example="", infinite="", **bounds):
        self.unit, self.example, self.infinite = unit, example, infinite
        vars(self).update(bounds)

    @property
    def words(self):
        noun = "a number" if self.infinite else "a finite number"
        if self.least is not None and self.most is not None:
            bounds = f"from {_written(self.least)} to {_written(self.most)}"
        else:
            signs = {">": self.above, ">=": self.least, "<": self.below, "<=": self.most}
            texts = (f"{sign} {_written(x)}" for sign, x in signs.items() if x is not None)
            bounds = " and ".join(texts)
        note = self.infinite or (self.unit if self.unit == "rad" else "")
        return " ".join(filter(None, (noun, bounds, note and f"({note})")))

    def accepts(self, value):
        return (
            (math.isfinite(value) or (bool(self.infinite) and value > 0.0))
            and (self.above is None or value > self.above)
            and (self.least is None or value >= self.least)
            and (self.below is None or value < self.below)
            and (self.most is None or value <= self.most)
        )

    def check(self, name, value):
        if (value is None and self.optional) or (type(value) is float and self.accepts(value)):
            return value  # Hardly a value needs the words, which take time.
        hint = likely(value, self.example, self.below if self.most is None else self.most)
        return checks.number(name, value, self.words + hint, self.accepts)


class Integer(Kind):
    """An integer; a configuration allows none beyond `limit`, which is taken for a mistake."""

    def __init__(self, least, most=None, limit=None):
        self.least, self.most, self.limit = least, most, limit
        self.words = checks.integers(least, most)

    def check(self, name, value):
        return checks.integer(name, value, self.least, self.most)


class OneOf(Kind):
    """One of a few plain values."""

    def __init__(self, choices):
        super().__init__(f"one of {', '.join(map(repr, choices))}", choices.__contains__)
        self.choices = choices


class Instance(Kind):
    """An instance of a class, or of one of several."""

    def __init__(self, classes, words=""):
        words = words or " or ".join(f"a {kind.__name__}" for kind in classes)
        super().__init__(words, lambda value: isinstance(value, classes))


class Many(Kind):
    """Several values of a kind, as many as `count` says."""

    def __init__(self, item, count=None):
        self.item, self.count = item, count
        number = "several values" if count is None else f"{count} values"
        self.words = f"{number}, each {item.words}"

    def check(self, name, values):
        entries = enumerate(checks.many(name, values, self.count))
        return tuple(self.item.check(f"{name}[{i}]", value) for i, value in entries)


class Two(Kind):
    """Two values of a kind along x and y, or one for both."""

    count = 2

    def __init__(self, item):
        self.item, self.words = item, f"one or two numbers, each {item.words}"

    def check(self, name, values):
        values = values if isinstance(values, (tuple, list)) else (values, values)
        checks.require(len(values) == 2, name, values, self.words)
        axes = zip("xy", values, strict=True)
        return tuple(self.item.check(f"{name}, {axis}", value) for axis, value in axes)


@dataclass(frozen=True)
class Parameter:
    """A declared parameter of a constructor or function."""

    kind: Kind
    words: str
    symbol: str = ""
    default: Any = MISSING

    @property
    def unit(self):
        """Its unit, or that of each of its values; "" without dimension."""
        kind = self.kind
        while hasattr(kind, "item"):
            kind = kind.item
        unit = getattr(kind, "unit", "1")
        return "" if unit == "1" else unit

    @property
    def long_name(self):
        """Its words without what is added to them, in lower case."""
        head = re.split(r"[;,=]", self.words)[0].strip()
        return head[:1].lower() + head[1:]

    @property
    def description(self):
        """Its words, symbol and unit, a sentence."""
        # Symbol and unit stand before what is added to the words.
        head = re.split(r";|\. ", self.words)[0]
        added, named = self.words[len(head) :], " ".join(filter(None, (head, self.symbol)))
        return f"{', '.join(filter(None, (named, self.unit)))}{added}."


@functools.cache
def declared(thing):
    """Return name -> `Parameter` of what a dataclass or function declares, in order."""
    call = thing.__init__ if inspect.isclass(thing) else inspect.unwrap(thing)
    declarations = {}
    for name, parameter in inspect.signature(call).parameters.items():
        if get_origin(parameter.annotation) is Annotated:
            kind, words, symbol = (*parameter.annotation.__metadata__, "")[:3]
            declarations[name] = Parameter(kind, words, symbol, parameter.default)
    return declarations


def numbers(thing):
    """Return name -> `Parameter` of the real numbers that something declares."""
    return {name: x for name, x in declared(thing).items() if isinstance(x.kind, Number)}


def named(thing):
    """Return name -> (CF units, long name) of the real numbers that something declares."""
    return {name: (cf_units(x.unit), x.long_name) for name, x in numbers(thing).items()}


#: CF units that engineers write in another way.
WRITTEN_UNITS = {"1": "", "min-1": "rpm"}


def cf_units(unit):
    """Return a unit as CF has it: "N s^2/m^2" is "N s2 m-2", "" is "1"."""
    above, _, below = unit.partition("/")
    powers = [part.replace("^", "") for part in above.split() if part != "1"]
    for part in below.split():
        base, _, power = part.partition("^")
        powers.append(f"{base}-{power or 1}")
    return " ".join(powers) or "1"


def check(instance, whose=""):
    """Check what the class of a frozen dataclass declares, and set the fields to plain values.

    `whose` follows the names in messages, as in " of body sun"; None stays where it is the default.
    """
    for name, parameter in declared(type(instance)).items():
        value = getattr(instance, name)
        if value is not None or parameter.default is not None:
            object.__setattr__(instance, name, parameter.kind.check(f"{name}{whose}", value))


def checked(function):
    """Check what a function declares of its keyword arguments before it is called."""

    @functools.wraps(function)
    def call(*args, **arguments):
        for name, parameter in declared(function).items():
            if arguments.get(name, parameter.default) is not parameter.default:
                arguments[name] = parameter.kind.check(name, arguments[name])
        return function(*args, **arguments)

    return documented(call)


def documented(thing):
    """Give a class or function the table of its parameters in its docstring, and plain types."""
    lines = ["", "Parameters", "----------"]
    for name, parameter in declared(thing).items():
        default = "" if parameter.default is MISSING else f", default {parameter.default!r}"
        default = ", optional" if parameter.default is None else default
        lines.append(f"{name} : {parameter.kind.words}{default}")
        lines.append(textwrap.indent(textwrap.fill(parameter.description, 92), "    "))
    head, raises, errors = (inspect.getdoc(thing) or "").partition("\n\nRaises\n---")
    thing.__doc__ = "\n".join([head, *lines]) + raises + errors
    signature = inspect.signature(thing)
    plain_types = [
        x.replace(annotation=getattr(x.annotation, "__origin__", x.annotation))
        for x in signature.parameters.values()
    ]
    thing.__signature__ = signature.replace(parameters=plain_types)
    return thing


#: Units of drawings and what they are in SI.
_OF_DRAWINGS = {"mm": 1e-3, "um": 1e-6, "deg": math.pi / 180.0}


def likely(value, example, most):
    """Return "; did you mean 2.5 mm?" of a bare number above `most`, else "".

    The unit is that of the `example`, where the number fits with it.
    """
    unit = example.partition(" ")[2]
    try:
        fits = most is not None and float(value) > most >= float(value) * _OF_DRAWINGS[unit]
    except (TypeError, ValueError, OverflowError, KeyError):
        return ""
    return f"; did you mean {float(value):g} {unit}?" if fits else ""


def _written(value):
    """Return a bound as text; fractions of pi as such."""
    for n in (2, 3, 4):
        if value == math.pi / n:
            return f"pi / {n}"
    return f"{value:g}"


# Kinds with a dimension, and the parameters that many take.

POSITIVE = Number("1", above=0)
NONNEGATIVE = Number("1", least=0)
FINITE = Number("1")
ANGLE = Number("rad", "30 deg")
#: A pressure angle in operation.
WORKING_ANGLE = Number("rad", "20 deg", least=0, below=math.pi / 2)
LENGTH = Number("m", "100 mm", above=0)
#: Of drawings, with bounds beyond which a number was meant in another unit.
MODULE = Number("m", "2.5 mm", above=0, most=0.1)
WIDTH = Number("m", "20 mm", above=0, most=2)
DIAMETER = Number("m", "100 mm", above=0, most=20)
BORE = Number("m", "30 mm", least=0, most=20)
RELIEF = Number("m", "10 um", least=0, most=0.1)
RELIEF_LENGTH = Number("m", "4 mm", above=0, most=0.5)
BACKLASH = Number("m", "40 um", least=0, infinite="infinity included")
RUN_OUT = Number("m", "10 um", least=0)
ERROR = Number("m", "10 um")
STIFFNESS = Number("N/m", "4e5 N/mm", above=0)
#: Of a support.
SUPPORT = Number("N/m", "1 kN/um", least=0, infinite="infinity: rigid")
SHAFT_STIFFNESS = Number("N m/rad", "1 MN m/rad", above=0)
MASS = Number("kg", "3123 g", above=0)
INERTIA = Number("kg m^2", "978.52 kg cm^2", above=0)
POWER = Number("W", "30 kW", above=0)
SPEED = Number("rpm", "2000 rpm", above=0)
LOAD = Number("N", "3.3 kN", above=0)
FORCE = Number("N", "2 kN")
TORQUE = Number("N m", "200 N m")
DRIVING_TORQUE = Number("N m", "302 N m", above=0)
DAMPING = Number("N s/m", "3.95 N s/mm", least=0)
#: Of contact: None where nobody gave it, which is enough at rest; motions ask for it.
CONTACT_DAMPING = Number("N s/m", "3.95 N s/mm", least=0, optional=True)
TWIST_DAMPING = Number("N m s/rad", "10 N m s/rad", least=0)
TIME = Number("s", "1 us", least=0)
TEETH = Integer(3, limit=100_000)
STIFFNESS_RATIO = Number("1", above=0, most=1)
CONTACT_RATIO = Number("1", least=1, most=2)
TRUTH = OneOf((False, True))
#: The name of something.
TEXT = Kind("a text", lambda value: isinstance(value, str) and value != "")

MaxStiffness = Annotated[float, STIFFNESS, "Maximum mesh stiffness", "C_max"]
StiffnessRatio = Annotated[float, STIFFNESS_RATIO, "Stiffness ratio kappa", "= C_min / C_max"]
ContactRatio = Annotated[
    float, CONTACT_RATIO, "Contact ratio epsilon; both ends mean constant stiffness"
]
Backlash = Annotated[float, BACKLASH, "Backlash; infinite without a second flank", "s_k"]
MaterialDamping = Annotated[float, CONTACT_DAMPING, "Damping of the material in contact", "k_1"]
BacklashDamping = Annotated[float, DAMPING, "Damping of the oil in the backlash", "k_1m"]
PressureAngle = Annotated[float, WORKING_ANGLE, "Pressure angle in operation"]

# Damping in contact of drawn gears, one of the first three at most.
DampingRatio = Annotated[float | None, NONNEGATIVE, "Damping ratio in contact, beta"]
Decrement = Annotated[
    float | None, NONNEGATIVE, "delta = 2 pi beta / sqrt(1 - beta^2), in place of damping_ratio"
]
DrawnDamping = Annotated[float | None, DAMPING, "k_1 in contact, in place of damping_ratio"]
BacklashDampingRatio = Annotated[float, NONNEGATIVE, "Damping ratio in the backlash, beta_m"]

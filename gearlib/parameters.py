"""What a parameter is: unit, range, words and symbol, declared once, where something takes it.

The annotations of a constructor or function declare its parameters: kind, words, symbol. ::

    max_stiffness: Annotated[float, STIFFNESS, "Maximum mesh stiffness", "C_max"]

All else follows from them: checks and refusals (`check`, `checked`), docstrings and tables of the
docs (`documented`, `rows`), sections of the configuration with their schema and the options of
commands (`gearlib.config.types.like`), ranges of sliders. No numerical stack: a start of the
workflow reads this.
"""

import dataclasses
import functools
import inspect
import math
import re
import textwrap
from typing import Annotated, Any, get_origin

from gearlib import checks

#: Of a parameter that has to be given.
MISSING = dataclasses.MISSING


class Number:
    """A real number within bounds, which `above` and `below` leave out.

    Its unit is that of SI, "1" without dimension; `example` is a value in another one, as a
    configuration may have it. `infinite` says what infinity means, where it is allowed; an
    `optional` value may be None.
    """

    above: float | None = None
    least: float | None = None
    below: float | None = None
    most: float | None = None
    optional = False

    def __init__(self, unit, example="", infinite="", **bounds):
        self.unit, self.example, self.infinite = unit, example, infinite
        vars(self).update(bounds)

    @property
    def range(self):
        """The bounds in words."""
        if self.least is not None and self.most is not None:
            return f"from {_written(self.least)} to {_written(self.most)}"
        signs = {">": self.above, ">=": self.least, "<": self.below, "<=": self.most}
        return " and ".join(f"{sign} {_written(x)}" for sign, x in signs.items() if x is not None)

    @property
    def words(self):
        """What is allowed."""
        noun = "a number" if self.infinite else "a finite number"
        notes = self.infinite or (self.unit if self.unit == "rad" else "")
        more = f"({notes})" if notes else ""
        return " ".join(filter(None, (noun, self.range, more)))

    def accepts(self, value):
        """Return whether a float other than NaN is allowed."""
        return (
            (math.isfinite(value) or (bool(self.infinite) and value > 0.0))
            and (self.above is None or value > self.above)
            and (self.least is None or value >= self.least)
            and (self.below is None or value < self.below)
            and (self.most is None or value <= self.most)
        )

    def check(self, name, value):
        """Return a value as float, else raise ValueError."""
        if (value is None and self.optional) or (type(value) is float and self.accepts(value)):
            return value  # most are, and the words take time
        most = self.below if self.most is None else self.most
        hint = likely(value, self.example, most)
        return checks.number(name, value, self.words + hint, self.accepts)


class Integer:
    """An integer; beyond `limit` a configuration takes it for a slip of the pen."""

    def __init__(self, least, most=None, limit=None):
        self.least, self.most, self.limit = least, most, limit

    @property
    def words(self):
        """What is allowed."""
        low, high = self.least, self.most
        return f"an integer >= {low}" if high is None else f"an integer from {low} to {high}"

    def check(self, name, value):
        """Return a value as int, else raise ValueError."""
        return checks.integer(name, value, self.least, self.most)


class OneOf:
    """One of a few plain values."""

    def __init__(self, choices):
        self.choices = choices

    @property
    def words(self):
        """What is allowed."""
        return f"one of {', '.join(map(repr, self.choices))}"

    def check(self, name, value):
        """Return a value as it is, else raise ValueError."""
        return checks.one_of(name, value, self.choices)


class Text:
    """A text, the name of something."""

    words = "a text"

    def check(self, name, value):
        """Return a value as it is, else raise ValueError."""
        if not isinstance(value, str) or not value:
            raise ValueError(f"{name} = {value!r} is not allowed: it must be {self.words}")
        return value


class Many:
    """Several values of a kind, as many as `count` says."""

    def __init__(self, item, count=None):
        self.item, self.count = item, count

    @property
    def words(self):
        """What is allowed."""
        number = "several values" if self.count is None else f"{self.count} values"
        return f"{number}, each {self.item.words}"

    def check(self, name, values):
        """Return values as a tuple, else raise ValueError."""
        if self.count is not None:
            values = checks.many(name, values, self.count)
        found = enumerate(checks.sequence(name, values))
        return tuple(self.item.check(f"{name}[{i}]", value) for i, value in found)


class Two:
    """Two values of a kind along x and y, or one for both."""

    count = 2

    def __init__(self, item):
        self.item = item

    @property
    def words(self):
        """What is allowed."""
        return f"one or two numbers, each {self.item.words}"

    def check(self, name, values):
        """Return both as a tuple, else raise ValueError."""
        values = values if isinstance(values, (tuple, list)) else (values, values)
        if len(values) != 2:
            raise ValueError(f"{name} = {values!r} is not allowed: it must be {self.words}")
        named = zip("xy", values, strict=True)
        return tuple(self.item.check(f"{name}, {axis}", value) for axis, value in named)


class Instance:
    """An instance of a class, or of one of several."""

    def __init__(self, classes):
        self.classes = classes

    @property
    def words(self):
        """What is allowed."""
        return " or ".join(f"a {one.__name__}" for one in self.classes)

    def check(self, name, value):
        """Return a value as it is, else raise ValueError."""
        if not isinstance(value, self.classes):
            raise ValueError(f"{name} = {value!r} is not allowed: it must be {self.words}")
        return value


class Parameter:
    """A declared parameter of a constructor or function: kind, words, symbol, default."""

    def __init__(self, kind, words, symbol, default):
        self.kind, self.words, self.symbol, self.default = kind, words, symbol, default

    @property
    def unit(self):
        """Its unit, or that of each of its values; "" without dimension."""
        kind = self.kind
        while hasattr(kind, "item"):
            kind = kind.item
        unit = getattr(kind, "unit", "1")
        return "" if unit == "1" else unit

    @property
    def description(self):
        """Its words, symbol and unit, a sentence."""
        # Symbol and unit stand before what is added to the words.
        head = re.match(r".*?(?=;|\. |$)", self.words)[0]  # type: ignore[index]
        added, named = self.words[len(head) :], " ".join(filter(None, (head, self.symbol)))
        return f"{', '.join(filter(None, (named, self.unit)))}{added}."


@functools.cache
def declared(thing):
    """Return name -> `Parameter` of what a dataclass or function declares, in order."""
    thing = inspect.unwrap(thing)
    hints: dict[str, Any]
    if dataclasses.is_dataclass(thing):
        fields = dataclasses.fields(thing)
        hints = {one.name: one.type for one in fields}
        defaults = {one.name: one.default for one in fields}
    else:
        hints, defaults = thing.__annotations__, thing.__kwdefaults__ or {}
    found = {}
    for name, hint in hints.items():
        if get_origin(hint) is Annotated:
            kind, words, symbol = (*hint.__metadata__, "")[:3]
            found[name] = Parameter(kind, words, symbol, defaults.get(name, MISSING))
    return found


def named(thing):
    """Return name -> (CF units, words) of the real numbers that something declares."""
    found = {}
    for name, one in declared(thing).items():
        if isinstance(one.kind, Number):
            # The words for what it is, without what is added.
            head = re.match(r"[^;,=]*", one.words)[0].strip()  # type: ignore[index]
            found[name] = cf_units(one.unit), head[0].lower() + head[1:]
    return found


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
            # The one place where the frozen fields are set.
            object.__setattr__(instance, name, parameter.kind.check(f"{name}{whose}", value))


def checked(function):
    """Check what a function declares of its keyword arguments before it is called."""
    known = None

    @functools.wraps(function)
    def call(*args, **given):
        nonlocal known
        known = known or declared(function)
        for name, parameter in known.items():
            if given.get(name, parameter.default) is not parameter.default:
                given[name] = parameter.kind.check(name, given[name])
        return function(*args, **given)

    return documented(call)


def documented(thing):
    """Give a class or function the table of its declared parameters in its docstring."""
    text = inspect.getdoc(thing)
    made: Any = thing
    if inspect.isclass(thing):
        # When somebody asks: a start of the workflow does not.
        made.__doc__ = _OnDemand(lambda: _with_table(text, thing))
        made.__signature__ = _OnDemand(lambda: _plain(made.__init__, 1))
    else:
        made.__doc__, made.__signature__ = _with_table(text, thing), _plain(thing)
    return thing


class _OnDemand:
    """An attribute of a class that is made when it is asked for."""

    def __init__(self, make):
        self.make = make

    def __get__(self, instance, owner):
        return self.make()


def _with_table(text, thing):
    """Return a docstring with the table of the declared parameters before what is raised."""
    lines = ["Parameters", "----------"]
    for name, one in declared(thing).items():
        if one.default is MISSING:
            default = ""
        else:
            default = ", optional" if one.default is None else f", default {one.default!r}"
        words = one.description
        words = textwrap.fill(words, 92) if len(words) > 92 else words
        lines += [f"{name} : {one.kind.words}{default}", textwrap.indent(words, "    ")]
    head, mark, tail = text.partition("\n\nRaises\n---")
    return "\n".join([head, "", *lines]) + mark + tail


def _plain(function, skip=0):
    """Return a signature with plain types, which `help` shows."""
    signature = inspect.signature(function)
    plain = [
        one.replace(annotation=getattr(one.annotation, "__origin__", one.annotation))
        for one in list(signature.parameters.values())[skip:]
    ]
    return signature.replace(parameters=plain)


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
TEXT = Text()

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

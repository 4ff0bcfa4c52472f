"""Declarations of parameters: unit, allowed values, description and symbol.

Annotations of a constructor or function declare its parameters. ::

    max_stiffness: Annotated[float, STIFFNESS, "Maximum mesh stiffness", "C_max"]

All else follows from them: checks with error messages (`check`, `checked`), docstrings and tables
of the documentation (`documented`), sections of the configuration with their schema, options of the
command (`gearlib.config.types.create_section`). This module loads no numerical stack.
"""

import functools
import inspect
import math
import re
import textwrap
from dataclasses import dataclass
from typing import Annotated, Any, get_origin

from gearlib import checks

#: Default of a required parameter.
MISSING = inspect.Parameter.empty


class Kind:
    """The values that a parameter may have; `allowed` describes them, `accepts` is a predicate."""

    allowed: Any

    def __init__(self, allowed, accepts):
        self.allowed, self.accepts = allowed, accepts

    def check(self, name, value):
        """Return the value in its stored type, or raise ValueError if it is not allowed."""
        checks.require(self.accepts(value), name, value, self.allowed)
        return value


class Number(Kind):
    """A real number in a unit, with `bounds` named like those of pydantic: gt, ge, lt, le.

    The unit is that of SI, or "1". `example` is a value in another unit, as a configuration may
    have it. `infinite` is a text that says what infinity means, "" if it is not allowed. If
    `optional`, None is allowed.
    """

    gt = ge = lt = le = None  # type: float | None
    optional = False

    def __init__(self, unit, example="", infinite="", **bounds):
        self.unit, self.example, self.infinite = unit, example, infinite
        vars(self).update(bounds)

    @property
    def allowed(self):
        """Description of the allowed numbers for error messages, such as "a finite number > 0"."""
        noun = "a number" if self.infinite else "a finite number"
        if self.ge is not None and self.le is not None:
            bounds = f"from {_bound_text(self.ge)} to {_bound_text(self.le)}"
        else:
            signs = {">": self.gt, ">=": self.ge, "<": self.lt, "<=": self.le}
            texts = (f"{sign} {_bound_text(x)}" for sign, x in signs.items() if x is not None)
            bounds = " and ".join(texts)
        # In parentheses: the meaning of infinity, or the unit where degrees would be expected.
        note = f"({self.infinite})" if self.infinite else "(rad)" if self.unit == "rad" else ""
        return " ".join(filter(None, (noun, bounds, note)))

    def accepts(self, value):
        """Return whether a number is within the bounds."""
        return (
            (math.isfinite(value) or (bool(self.infinite) and value > 0.0))
            and (self.gt is None or value > self.gt)
            and (self.ge is None or value >= self.ge)
            and (self.lt is None or value < self.lt)
            and (self.le is None or value <= self.le)
        )

    def check(self, name, value):
        if (value is None and self.optional) or (type(value) is float and self.accepts(value)):
            return value  # Valid values need no description, which takes time.
        maximum = self.lt if self.le is None else self.le
        hint = unit_hint(value, self.example, maximum, self.gt if self.ge is None else self.ge)
        return checks.number(name, value, self.allowed + hint, self.accepts)


class Integer(Kind):
    """An integer; the configuration refuses numbers above `limit` as mistakes."""

    def __init__(self, minimum, maximum=None, limit=None):
        self.minimum, self.maximum, self.limit = minimum, maximum, limit
        self.allowed = checks.integers(minimum, maximum)

    def check(self, name, value):
        return checks.integer(name, value, self.minimum, self.maximum)


class OneOf(Kind):
    """One of a few numbers, strings or booleans."""

    def __init__(self, choices):
        allowed = f"one of {', '.join(map(repr, choices))}"
        super().__init__(allowed, lambda value: checks.is_one_of(value, choices))
        self.choices = choices


class Instance(Kind):
    """An instance of one of the `classes`, a tuple."""

    def __init__(self, classes, allowed=""):
        allowed = allowed or " or ".join(f"a {x.__name__}" for x in classes)
        super().__init__(allowed, lambda value: isinstance(value, classes))


class Many(Kind):
    """A sequence of values of the kind `item`, of length `count` if that is given."""

    def __init__(self, item, count=None):
        self.item, self.count = item, count
        length = "several values" if count is None else f"{count} values"
        self.allowed = f"{length}, each {item.allowed}"

    def check(self, name, values):
        items = enumerate(checks.sequence(name, values, self.count))
        return tuple(self.item.check(f"{name}[{i}]", value) for i, value in items)


class Two(Kind):
    """Two values of the kind `item` along x and y, or one for both."""

    count = 2

    def __init__(self, item):
        self.item, self.allowed = item, f"one or two numbers, each {item.allowed}"

    def check(self, name, values):
        """Return the checked values (x, y); a single number is that of both axes."""
        values = values if isinstance(values, (tuple, list)) else (values, values)
        checks.require(len(values) == 2, name, values, self.allowed)
        axes = zip("xy", values, strict=True)
        return tuple(self.item.check(f"{name}, {axis}", value) for axis, value in axes)


@dataclass(frozen=True)
class Parameter:
    """A declared parameter of a constructor or function; `text` describes it."""

    kind: Kind
    text: str
    symbol: str = ""
    default: Any = MISSING

    @property
    def unit(self):
        """Unit of the parameter or of each of its values; "" if it is dimensionless."""
        kind = self.kind
        while hasattr(kind, "item"):
            kind = kind.item
        unit = getattr(kind, "unit", "1")
        return "" if unit == "1" else unit

    @property
    def long_name(self):
        """The text up to the first comma, semicolon or equals sign, in lower case."""
        name = re.split(r"[;,=]", self.text)[0].strip()
        return name[:1].lower() + name[1:]

    @property
    def description(self):
        """A sentence with text, symbol and unit, such as "Mass m, kg; ..."."""
        name = re.split(r";|\. ", self.text)[0]
        name_and_symbol = " ".join(filter(None, (name, self.symbol)))
        return f"{', '.join(filter(None, (name_and_symbol, self.unit)))}{self.text[len(name) :]}."


@functools.cache
def declared_parameters(constructor):
    """Return name -> `Parameter` of the declared parameters of a dataclass or function."""
    is_class = inspect.isclass(constructor)
    function = constructor.__init__ if is_class else inspect.unwrap(constructor)
    declarations = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if get_origin(parameter.annotation) is Annotated:
            kind, text, symbol = (*parameter.annotation.__metadata__, "")[:3]
            declarations[name] = Parameter(kind, text, symbol, parameter.default)
    return declarations


def numeric_parameters(constructor):
    """Return name -> `Parameter` of the declared parameters that are real numbers."""
    declarations = declared_parameters(constructor)
    return {name: x for name, x in declarations.items() if isinstance(x.kind, Number)}


def units_and_names(constructor):
    """Return name -> (CF units, long name) of the declared parameters that are real numbers."""
    numeric = numeric_parameters(constructor)
    return {name: (cf_units(x.unit), x.long_name) for name, x in numeric.items()}


#: CF units -> the same units as engineers write them.
WRITTEN_UNITS = {"1": "", "min-1": "rpm"}


def cf_units(unit):
    """Convert a unit to the notation of CF: "N s^2/m^2" to "N s2 m-2", "" to "1"."""
    numerator, _, denominator = unit.partition("/")
    factors = [factor.replace("^", "") for factor in numerator.split() if factor != "1"]
    for factor in denominator.split():
        base, _, power = factor.partition("^")
        factors.append(f"{base}-{power or 1}")
    return " ".join(factors) or "1"


def check(instance, owner=""):
    """Check the declared fields of a frozen dataclass, and convert them to their stored types.

    `owner` follows names of fields in error messages, as in " of body sun". Default fields that are
    None are not checked.
    """
    for name, parameter in declared_parameters(type(instance)).items():
        value = getattr(instance, name)
        if value is not None or parameter.default is not None:
            object.__setattr__(instance, name, parameter.kind.check(f"{name}{owner}", value))


def checked(function):
    """Decorate a function so that its declared keyword arguments are checked and documented."""

    @functools.wraps(function)
    def call(*args, **arguments):
        for name, parameter in declared_parameters(function).items():
            if arguments.get(name, parameter.default) is not parameter.default:
                arguments[name] = parameter.kind.check(name, arguments[name])
        return function(*args, **arguments)

    return documented(call)


#: End of a docstring that has no such section of its own.
_RAISES = """

Raises
------
ValueError
    If a value is impossible; the message names parameter, value and range."""


def documented(constructor):
    """Decorate a class or function: put declared parameters into docstring, types in signature."""
    lines = ["", "Parameters", "----------"]
    for name, parameter in declared_parameters(constructor).items():
        default = "" if parameter.default is MISSING else f", default {parameter.default!r}"
        default = ", optional" if parameter.default is None else default
        lines.append(f"{name} : {parameter.kind.allowed}{default}")
        lines.append(textwrap.indent(textwrap.fill(parameter.description, 92), "    "))
    head, raises, errors = (inspect.getdoc(constructor) or "").partition("\n\nRaises\n---")
    constructor.__doc__ = "\n".join([head, *lines]) + (raises + errors or _RAISES)
    signature = inspect.signature(constructor)
    plain_parameters = [
        x.replace(annotation=getattr(x.annotation, "__origin__", x.annotation))
        for x in signature.parameters.values()
    ]
    constructor.__signature__ = signature.replace(parameters=plain_parameters)
    return constructor


#: Factors to SI of the units of drawings, in which numbers are often given by mistake.
_DRAWING_UNITS = {"mm": 1e-3, "um": 1e-6, "deg": math.pi / 180.0}


def unit_hint(value, example, maximum, minimum=None):
    """Return "; did you mean 3 mm?" if `value` is beyond a limit in SI, but not in mm.

    The unit is that of `example`, such as "2 mm". Return "" if there is nothing to ask.
    """
    unit = example.partition(" ")[2]
    try:
        scaled = float(value) * _DRAWING_UNITS[unit]
        fits = maximum is not None and float(value) > maximum >= scaled
        fits = fits or (minimum is not None and float(value) < minimum <= scaled)
    except (TypeError, ValueError, OverflowError, KeyError):
        return ""
    return f"; did you mean {float(value):g} {unit}?" if fits else ""


def _bound_text(value):
    """Return a bound as text, with fractions such as "pi / 2"."""
    for n in (2, 3, 4):
        if abs(value) == math.pi / n:
            return f"{'-' * (value < 0.0)}pi / {n}"
    return f"{value:g}"


# Common kinds and parameters.

POSITIVE = Number("1", gt=0)
NONNEGATIVE = Number("1", ge=0)
FINITE = Number("1")
ANGLE = Number("rad", "30 deg")
#: Working pressure angle.
WORKING_ANGLE = Number("rad", "20 deg", ge=0, lt=math.pi / 2)
LENGTH = Number("m", "100 mm", gt=0)
#: Dimensions of drawings; larger numbers must have been meant in another unit.
MODULE = Number("m", "2.5 mm", gt=0, le=0.1)
WIDTH = Number("m", "20 mm", gt=0, le=2)
DIAMETER = Number("m", "100 mm", gt=0, le=20)
BORE = Number("m", "30 mm", ge=0, le=20)
RELIEF = Number("m", "10 um", ge=0, le=0.1)
RELIEF_LENGTH = Number("m", "4 mm", gt=0, le=0.5)
BACKLASH = Number("m", "40 um", ge=0, infinite="infinity included")
RUN_OUT = Number("m", "10 um", ge=0)
ERROR = Number("m", "10 um")
STIFFNESS = Number("N/m", "4e5 N/mm", gt=0)
#: Stiffness of a support.
SUPPORT = Number("N/m", "1 kN/um", ge=0, infinite="infinity: rigid")
SHAFT_STIFFNESS = Number("N m/rad", "1 MN m/rad", gt=0)
MASS = Number("kg", "3123 g", gt=0)
INERTIA = Number("kg m^2", "978.52 kg cm^2", gt=0)
POWER = Number("W", "30 kW", gt=0)
SPEED = Number("rpm", "2000 rpm", gt=0)
LOAD = Number("N", "3.3 kN", gt=0)
FORCE = Number("N", "2 kN")
TORQUE = Number("N m", "200 N m")
DRIVING_TORQUE = Number("N m", "302 N m", gt=0)
DAMPING = Number("N s/m", "3.95 N s/mm", ge=0)
#: Damping in contact; None means unknown, which is allowed at rest.
CONTACT_DAMPING = Number("N s/m", "3.95 N s/mm", ge=0, optional=True)
TWIST_DAMPING = Number("N m s/rad", "10 N m s/rad", ge=0)
TIME = Number("s", "1 us", ge=0)
TEETH = Integer(3, limit=100_000)
STIFFNESS_RATIO = Number("1", gt=0, le=1)
CONTACT_RATIO = Number("1", ge=1, le=2)
BOOLEAN = OneOf((False, True))
#: Name of a part.
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

# Damping of drawn gears; of the first three at most one is given.
DampingRatio = Annotated[float | None, NONNEGATIVE, "Damping ratio in contact, beta"]
Decrement = Annotated[
    float | None, NONNEGATIVE, "delta = 2 pi beta / sqrt(1 - beta^2), in place of damping_ratio"
]
DrawnDamping = Annotated[float | None, DAMPING, "k_1 in contact, in place of damping_ratio"]
BacklashDampingRatio = Annotated[float, NONNEGATIVE, "Damping ratio in the backlash, beta_m"]

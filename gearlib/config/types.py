"""Types of the configuration's values, and the base classes of its sections.

YAML 1.1, which Snakemake reads, parses ``4e8`` as a string, and all values in ``--config
section={key: 0.66}`` are strings. A string that spells a number, true or false is converted. Other
strings in place of a number are refused, and so are ``true`` for 1, 2.0 for an integer, NaN and,
except for a backlash, infinity. A number with a dimension is in SI units; a string may have another
unit of that dimension: ``"4e5 N/mm"``.

The validation context holds the gear pair (``pair``), which converts speeds to tunings, and the
names of the ``dampings``. In error messages ``.stop`` stands for the key ``stop`` of the section
that is validated, and ``.`` for the key itself.
"""

import math
import re
from decimal import Decimal
from functools import cache
from typing import Annotated, Any, Literal, TypeVar

import pydantic
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from gearlib import checks, parameters, tunings
from gearlib.config import units

#: Largest number of jobs or tunings; it catches a mistyped step.
MAX_JOBS = 10_000
#: Tunings converted from speeds are rounded to this decimal, so that floats represent them.
_TUNING_RESOLUTION = Decimal("1e-12")
#: Upper bounds of speeds in rpm and of numbers of steps.
_MAX_RPM, _MAX_STEPS = 10**9, 10**9
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_INTEGER = re.compile(r"[-+]?\d+")
_BOOLEANS = {"true": True, "false": False}
#: Pattern of names, which are short enough for titles.
NAME = "^[A-Za-z0-9+_-]{1,40}$"
_T = TypeVar("_T")


def field(description, default=..., **constraints):
    """Return the pydantic field of a key: required without a default, optional if it is None."""
    validate = default not in (..., None)
    return Field(default=default, description=description, validate_default=validate, **constraints)


#: Field of a section; a missing section has the defaults of its keys.
SECTION: Any = Field(default={}, validate_default=True)


def check_unique(list_key, sections, attribute):
    """Raise ValueError if two sections of a list have the same `attribute`, such as "title"."""
    values = [getattr(section, attribute) for section in sections]
    for i, value in enumerate(values):
        allowed = f"another one: {attribute}s must be all different"
        checks.require(values.count(value) == 1, f"{list_key}[{i}].{attribute}", value, allowed)


def _read_number(value):
    return float(value) if isinstance(value, str) and _NUMBER.fullmatch(value) else value


def _read_integer(value):
    return int(value) if isinstance(value, str) and _INTEGER.fullmatch(value) else value


def _read_boolean(value):
    return _BOOLEANS.get(value.lower(), value) if isinstance(value, str) else value


def _read_choice(value):
    if isinstance(value, bool):  # true is not 1
        raise _invalid()
    return _read_integer(value)


def _read_option(value):
    """Return the option of a method as boolean, number or text, converted from its text in YAML."""
    value = _read_number(_read_integer(_read_boolean(value)))
    if not isinstance(value, str) and not (isinstance(value, int | float) and math.isfinite(value)):
        raise _invalid()
    return value


def _read_amount(value):
    return _read_choice(_read_option(value))


def _invalid():
    """Return the error whose message `gearlib.config.validation` writes from the JSON schema."""
    return PydanticCustomError("refused", "not allowed")


def _require_distinct(values):
    """Return `values`, or raise ValueError if two are equal; "." stands for their key."""
    for value in values:
        if values.count(value) > 1:
            raise ValueError(f". lists {value!r} twice: its entries must be all different")
    return values


def from_context(info, key):
    """Return the entry `key` of a pydantic validation context, None if it is missing."""
    return (info.context or {}).get(key)


def _require_known_damping(name, info):
    """Return the name of a damping, or raise ValueError for another; "." stands for its key."""
    # Invalid dampings have an error message of their own, so any name is accepted.
    names = from_context(info, "dampings") or [name]
    checks.require(name in names, ".", name, f"one of {', '.join(names)}")
    return name


def _read_tuning(value, info):
    """Return a tuning as number, converted if it is a speed such as "1500 rpm"."""
    rpm = units.rpm(value)
    if rpm is None:
        return _read_number(value)
    # `info.data` has the preceding keys of the section, such as `change` of a `MeshCase`.
    return float(rpm) * tuning_per_rpm(from_context(info, "pair"), info.data.get("change"))


def tuning_per_rpm(pair, change=None):
    """Return the tuning of a gear pair at 1 rpm; `change` holds other values of its parameters."""
    if pair is None:  # An invalid pair is reported anyway, and any number serves.
        return 1e-4
    pair = pair.model_copy(update=change.model_dump()) if change else pair
    return 2.0 * math.pi * pair.teeth / (60.0 * pair.mean_eigenfrequency)


def number(read=_read_number, **constraints):
    """Return the type of a finite float with `constraints` of pydantic; `read` converts values."""
    # Constraints come before the validator, because pydantic would omit them from the schema else.
    return Annotated[float, Field(**{"allow_inf_nan": False} | constraints), BeforeValidator(read)]


def integer(minimum, maximum=None):
    """Return the type of an integer from `minimum` to `maximum`, both included."""
    return Annotated[int, Field(ge=minimum, le=maximum), BeforeValidator(_read_integer)]


def quantity(unit, example, *, infinite=False, **constraints):
    """Return the type of a number in `unit`, or a string with a unit of the same dimension.

    `example` is such a string for error messages; `infinite` allows infinity.
    """

    def read(value):
        value = math.inf if infinite and value == ".inf" else _read_number(value)
        if not isinstance(value, str):
            return value
        try:
            return units.read(value, unit)
        except ValueError:
            raise _invalid() from None

    comment = f"{'or .inf, ' if infinite else ''}in {unit} or a text with its unit such as "
    extra = _number_or_string(units.TEXT, f"{comment}'{example}'")
    return number(read, json_schema_extra=extra, allow_inf_nan=infinite, **constraints)


def _number_or_string(pattern, comment):
    """Return the JSON schema of a number or a string that matches the compiled `pattern`."""
    return {"type": ["number", "string"], "pattern": f"^{pattern.pattern}$", "$comment": comment}


def text(comment, **constraints):
    """Return the type of a string; `comment` describes allowed values in error messages."""
    return Annotated[str, Field(json_schema_extra={"$comment": comment}, **constraints)]


def custom_type(read, json_types, comment):
    """Return the type of values that `read` converts; `comment` describes them in messages."""
    schema = WithJsonSchema({"type": json_types, "$comment": comment})
    return Annotated[Any, PlainValidator(read), schema]


def list_of(item_type, length):
    """Return the type of a list with `length` items."""
    return Annotated[list[item_type], Field(min_length=length, max_length=length)]


#: A non-empty list of different values.
Distinct = Annotated[
    list[_T],
    Field(min_length=1, json_schema_extra={"uniqueItems": True}),
    AfterValidator(_require_distinct),
]
Boolean = Annotated[
    bool, Field(json_schema_extra={"$comment": "true or false"}), BeforeValidator(_read_boolean)
]
Name = Annotated[str, Field(pattern=NAME)]
Label = text("a text of 1 to 60 characters", min_length=1, max_length=60)
DampingName = Annotated[
    text(
        "one of the dampings",
        pattern=NAME,
        description="One of the dampings. Default: the first one that damps, if one does.",
    ),
    AfterValidator(_require_known_damping),
]
#: Option of a method, which only the method can check; integers stay integers.
Option = custom_type(
    _read_option, ["boolean", "number", "string"], "a finite number, true, false or a text"
)
#: Number or text whose unit follows from another key; that checks the text.
Amount = custom_type(
    _read_amount, ["number", "string"], "or a text with its unit, or a share such as '5 %'"
)


class Section(pydantic.BaseModel):
    """Base class of all sections: immutable, without unknown keys and implicit conversions."""

    # Building the validators once, with the whole configuration, is faster.
    model_config = pydantic.ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)

    def model_dump(self, **options):
        """Return the section as a dict without keys whose value is None."""
        return super().model_dump(exclude_none=True, **options)


@cache
def type_of(kind):
    """Return the pydantic type of values of a `gearlib.parameters.Kind`."""
    if isinstance(kind, parameters.Number):
        bounds = {name: getattr(kind, name) for name in ("gt", "ge", "lt", "le")}
        bounds = {name: bound for name, bound in bounds.items() if bound is not None}
        if kind.unit == "1":
            return number(**bounds)
        return quantity(kind.unit, kind.example, infinite=bool(kind.infinite), **bounds)
    if isinstance(kind, parameters.Integer):
        # Only configurations have the `limit`; the library accepts larger integers.
        return integer(kind.minimum, kind.limit if kind.maximum is None else kind.maximum)
    if kind == parameters.TEXT:
        return Label
    if kind == parameters.BOOLEAN:
        return Boolean
    if isinstance(kind, parameters.OneOf):
        return Annotated[Literal[kind.choices], BeforeValidator(_read_choice)]
    return Annotated[
        list[type_of(kind.item)], Field(min_length=kind.count or 1, max_length=kind.count)
    ]


def create_section(
    name, doc, constructor, *keys, base=Section, exclude=(), required=(), optional=(), **extra
):
    """Return a section class with a key for each declared parameter of `constructor`.

    `constructor` is a class or function. If `keys` are given, other parameters have no key, and
    neither have those in `exclude`. Keys in `required` must be given although they have a default,
    keys in `optional` may be missing although they have none. The class is derived from `base`, has
    the docstring `doc` and the `extra` keys, each a pair (type, field).
    """
    fields = {}
    for key, parameter in parameters.declared_parameters(constructor).items():
        included = key in keys if keys else key not in {*exclude, *extra}
        if not included or isinstance(parameter.kind, parameters.Instance):
            continue
        default, options = parameter.default, {}
        is_required = key in required or (default is parameters.MISSING and key not in optional)
        values = list(default) if isinstance(default, tuple) else [default]
        if not (is_required or key in optional or {parameters.MISSING, None, math.inf} & {*values}):
            # Only the schema has the default, because the constructor itself applies it.
            default = values if isinstance(default, tuple) else default
            options = {"json_schema_extra": {"default": default}}
        definition = field(parameter.description, ... if is_required else None, **options)
        fields[key] = type_of(parameter.kind), definition
    return pydantic.create_model(name, __base__=base, __doc__=doc, **(fields | extra))


Finite, Positive = type_of(parameters.FINITE), type_of(parameters.POSITIVE)
NonNegative = type_of(parameters.NONNEGATIVE)
Stiffness, Mass, Inertia = map(type_of, (parameters.STIFFNESS, parameters.MASS, parameters.INERTIA))
Length, Error = type_of(parameters.LENGTH), type_of(parameters.ERROR)
Backlash, Angle = type_of(parameters.BACKLASH), type_of(parameters.ANGLE)
DampingCoefficient = type_of(parameters.DAMPING)
PositiveDamping = quantity("N s/m", "3.95 N s/mm", gt=0)
Torque, Power, Speed = map(type_of, (parameters.DRIVING_TORQUE, parameters.POWER, parameters.SPEED))
_OR_SPEED = {"json_schema_extra": _number_or_string(units.RPM, "or a speed such as '1500 rpm'")}
#: Tuning of the gear pair and difference of two tunings, which may be speeds.
Tuning = number(_read_tuning, gt=0, le=100, **_OR_SPEED)
Distance = number(_read_tuning, gt=0, le=10, **_OR_SPEED)
#: Tuning that must be a number, because it belongs to a train or drawing.
NumericTuning = number(gt=0, le=100)
Tolerance = number(gt=0, le=10)
Count, LargeCount = integer(1, 1000), integer(1, 1_000_000)


def with_description(value_type, description):
    """Return a type whose fields have `description`, for keys of several sections."""
    return Annotated[value_type, Field(description=description)]


_FIRST, _LAST = "First tuning.", "Last tuning; start plus a whole multiple of step."
_DISTANCE = "Distance of the tunings."
Start, NumericStart = with_description(Tuning, _FIRST), with_description(NumericTuning, _FIRST)
Stop, NumericStop = with_description(Tuning, _LAST), with_description(NumericTuning, _LAST)
Step, NumericStep = (with_description(x, _DISTANCE) for x in (Distance, number(gt=0, le=10)))
Periods = with_description(LargeCount, "Mesh periods of a run.")
RecordPeriods = with_description(integer(1), "The last mesh periods, which are evaluated.")
Starts = with_description(Count, "Seeded starts of every motion.")
Seed = with_description(integer(0, 1_000_000), "Seed of the random starts.")


class NumericGrid(Section):
    """Equidistant tunings of a train or drawing."""

    start: NumericStart
    stop: NumericStop
    step: NumericStep

    @pydantic.model_validator(mode="after")
    def _check_grid(self):
        self.check_steps("step")
        return self

    def check_steps(self, step_key, max_tunings=MAX_JOBS):
        """Raise ValueError if the step of this key is too small or does not divide the range."""
        step, tuning_range = getattr(self, step_key), self.stop - self.start
        step_count = tunings.steps(self.start, self.stop, step)
        allowed = f">= {tuning_range / max_tunings:.2g} to stay within {max_tunings:,} tunings"
        checks.require(step_count < max_tunings, f".{step_key}", step, allowed)
        allowed = f".start = {self.start!r} plus a whole multiple of .{step_key} = {step!r}"
        checks.require(step_count > 0 and step_count % 1 == 0, ".stop", self.stop, allowed)


class Grid(NumericGrid):
    """Equidistant tunings or speeds of the gear pair."""

    start: Start
    stop: Stop
    step: Step

    @pydantic.model_validator(mode="before")
    @classmethod
    def _read_speeds(cls, values, info):
        """Convert a range of speeds to one of tunings, so that it stays a multiple of its step.

        `values` is the section, `info` the validation context; all keys or none are in rpm.
        """
        keys = ("start", "stop", "step", "window", "fine_step", "share_step")
        section = dict(values) if isinstance(values, dict) else {}
        speeds = {key: units.rpm(section[key]) for key in keys if key in section}
        if {*speeds.values()} <= {None}:
            return values
        for key in (*keys[:3], *speeds):
            if speeds.get(key) is None:
                problem = f"= {section[key]!r} is not allowed" if key in section else "is missing"
                raise ValueError(f".{key} {problem}: all keys of a grid must be in rpm, or none")
        start, stop, step = (speeds[key] for key in keys[:3])
        step_count = (stop - start) / step if step else Decimal(0)
        is_valid = stop < _MAX_RPM and 0 < step_count < _MAX_STEPS and step_count % 1 == 0
        allowed = f".start = {section['start']!r} plus a whole multiple of .step = "
        checks.require(is_valid, ".stop", section["stop"], f"{allowed}{section['step']!r}")
        # The others follow from the rounded start and step, and stay whole multiples of the step.
        factor = Decimal(tuning_per_rpm(from_context(info, "pair")))
        first, distance = ((factor * x).quantize(_TUNING_RESOLUTION) for x in (start, step))
        tuning_values = {key: speed / step * distance for key, speed in speeds.items()}
        tuning_values |= {"start": first, "stop": first + step_count * distance}
        return values | {key: float(value) for key, value in tuning_values.items()}


def grid_base(start, stop, step, base=Grid):
    """Return a base class of sections: `base`, the grid of tunings, with these defaults."""
    types = (NumericStart, NumericStop, NumericStep) if base is NumericGrid else (Start, Stop, Step)
    fields = {"start": (types[0], start), "stop": (types[1], stop), "step": (types[2], step)}
    return pydantic.create_model("GridWithDefaults", __base__=base, **fields)


class RecordedPeriods(Section):
    """Base class of sections with runs whose last mesh periods are evaluated."""

    periods: Periods
    record_periods: RecordPeriods

    @pydantic.model_validator(mode="after")
    def _check_record(self):
        """Refuse more recorded than computed mesh periods."""
        recorded, allowed = self.record_periods, f"an integer from 1 to .periods = {self.periods}"
        checks.require(recorded <= self.periods, ".record_periods", recorded, allowed)
        return self


class SeededStarts(Section):
    """Base class of sections with motions from random initial states."""

    starts: Starts = 32
    seed: Seed = 1
    spread: Tolerance = field("Largest displacement at a start, static deflections.", 0.02)


class IncreasingStarts(SeededStarts):
    """Base class of sections that compute all starts only if the first ones disagree."""

    first_starts: Count = field("Starts that suffice if they end on one orbit.", 4)

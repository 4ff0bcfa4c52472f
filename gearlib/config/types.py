"""Types of the configuration's values, and the base classes of its sections.

Numbers: YAML 1.1, which Snakemake reads, takes ``4e8`` or ``4.0e8`` for a text (it wants
``4.0e+8``), and all values inside of ``--config section={key: 0.66}`` come as texts. A text that is
plainly a number, true or false is accepted as that. Every other text in place of a number is
refused, and so are ``true`` for 1, 2.0 for an integer, NaN and, except for a backlash, infinity.
Where a value has a dimension, a number is in SI units and a text may name another one of that
dimension: ``"4e5 N/mm"``.

Validators get a context with the ``pair``, a section `gear_pair`, whose speeds tunings may be, and
the names of the ``dampings``. In the message of a ValueError ``.stop`` stands for the key ``stop``
of the section that is checked, and ``.`` for the key itself.
"""

import math
import re
from decimal import Decimal
from functools import cache
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    WithJsonSchema,
    create_model,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gearlib import checks, parameters, tunings
from gearlib.config import units

#: Limit that catches a mistyped step before it makes as many jobs or tunings.
MAX_JOBS = 10_000
#: Decimals of the tunings of a grid of speeds: with those before the point, a float keeps them all.
_DECIMALS = Decimal("1e-12")
#: Speeds in rpm, and numbers of steps, beyond all that are allowed.
_MAX_RPM = 10**9
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_INTEGER = re.compile(r"[-+]?\d+")
_TRUTH = {"true": True, "false": False}
#: Pattern of names, which are short enough for titles.
NAME = "^[A-Za-z0-9+_-]{1,40}$"
_T = TypeVar("_T")


def entry(description, default=..., **bounds):
    """Return the field of a key, by its description and default; None: it may be left out."""
    checked = default not in (..., None)
    return Field(default=default, description=description, validate_default=checked, **bounds)


#: A section that is left out has the defaults of its keys.
SECTION: Any = Field(default={}, validate_default=True)


def check_different(key, entries, name):
    """Refuse two entries of a list that have the same name or title."""
    names = [getattr(section, name) for section in entries]
    for i, value in enumerate(names):
        allowed = f"another one: {name}s must be all different"
        checks.require(names.count(value) == 1, f"{key}[{i}].{name}", value, allowed)


def _read_number(value):
    return float(value) if isinstance(value, str) and _NUMBER.fullmatch(value) else value


def _read_integer(value):
    return int(value) if isinstance(value, str) and _INTEGER.fullmatch(value) else value


def _read_truth(value):
    return _TRUTH.get(value.lower(), value) if isinstance(value, str) else value


def _read_choice(value):
    return _accept(not isinstance(value, bool), _read_integer(value))  # true is not 1


def _read_option(value):
    value = _read_number(_read_integer(_read_truth(value)))
    is_plain = isinstance(value, (int, float, str))
    return _accept(is_plain and (isinstance(value, str) or math.isfinite(value)), value)


def _read_amount(value):
    value = _read_option(value)
    return _accept(not isinstance(value, bool), value)


def _accept(fits, value):
    """Return a value, or have it refused in the words of the schema."""
    if not fits:
        raise PydanticCustomError("refused", "not allowed")
    return value


def _all_different(values):
    for value in values:
        if values.count(value) > 1:
            raise ValueError(f". lists {value!r} twice: its entries must be all different")
    return values


def from_context(info, key):
    """Return an entry of the context of a validation, None where there is none."""
    return (info.context or {}).get(key)


def _known_damping(name, info):
    names = from_context(info, "dampings") or [name]
    checks.require(name in names, ".", name, f"one of {', '.join(names)}")
    return name


def _read_tuning(value, info):
    rpm = units.rpm(value)
    if rpm is None:
        return _read_number(value)
    return float(rpm) * tuning_per_rpm(from_context(info, "pair"), info.data.get("change"))


def tuning_per_rpm(pair, change=None):
    """Return the tuning of 1 rpm of a section `gear_pair`, or a stand-in while it is refused."""
    if pair is None:
        return 1e-4
    pair = pair.model_copy(update=change.model_dump()) if change else pair
    return 2.0 * math.pi * pair.teeth / (60.0 * pair.mean_eigenfrequency)


def number(read=_read_number, **bounds):
    """Return the type of a finite number within `bounds` (gt, ge, lt, le), by what reads it."""
    # Innermost first: bounds that pydantic cannot attach to the number itself would be missing
    # in the schema.
    return Annotated[float, Field(**{"allow_inf_nan": False} | bounds), BeforeValidator(read)]


def whole(least, most=None):
    """Return the type of an integer within bounds."""
    return Annotated[int, Field(ge=least, le=most), BeforeValidator(_read_integer)]


def quantity(unit, example, *, infinite=False, **bounds):
    """Return the type of a number in `unit`, or a text with a unit of the same dimension."""

    def read(value):
        value = math.inf if infinite and value == ".inf" else _read_number(value)
        if not isinstance(value, str):
            return value
        try:
            return units.read(value, unit)
        except ValueError:
            return _accept(False, value)

    comment = f"{'or .inf, ' if infinite else ''}in {unit} or a text with its unit such as "
    extra = _or_text(units.TEXT, f"{comment}'{example}'")
    return number(read, json_schema_extra=extra, allow_inf_nan=infinite or False, **bounds)


def _or_text(pattern, comment):
    """Return what the schema of a number says where a text of a pattern may stand for it."""
    return {"type": ["number", "string"], "pattern": f"^{pattern.pattern}$", "$comment": comment}


def text(comment, **bounds):
    """Return the type of a text, described by a comment."""
    return Annotated[str, Field(json_schema_extra={"$comment": comment}, **bounds)]


def anything(read, types, comment):
    """Return the type of whatever a function reads, described by a comment."""
    schema = WithJsonSchema({"type": types, "$comment": comment})
    return Annotated[Any, PlainValidator(read), schema]


def several(item, count):
    """Return the type of a list of `count` values."""
    return Annotated[list[item], Field(min_length=count, max_length=count)]


#: A non-empty list of different values.
Distinct = Annotated[
    list[_T],
    Field(min_length=1, json_schema_extra={"uniqueItems": True}),
    AfterValidator(_all_different),
]
Truth = Annotated[
    bool, Field(json_schema_extra={"$comment": "true or false"}), BeforeValidator(_read_truth)
]
Name = Annotated[str, Field(pattern=NAME)]
Label = text("a text of 1 to 60 characters", min_length=1, max_length=60)
DampingName = Annotated[
    text(
        "one of the dampings",
        pattern=NAME,
        description="One of the dampings. Default: the first one that damps, if one does.",
    ),
    AfterValidator(_known_damping),
]
#: Option of a method, which only the method can check; integers stay integers.
Option = anything(
    _read_option, ["boolean", "number", "string"], "a finite number, true, false or a text"
)
#: Number or text whose unit follows from another key; that checks the text.
Amount = anything(
    _read_amount, ["number", "string"], "or a text with its unit, or a share such as '5 %'"
)


def _plain(value):
    """Return a value with mappings in place of the sections in it."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value.model_dump() if isinstance(value, Section) else value


class Section(BaseModel):
    """Base of all sections: no unknown keys, no silent conversions, immutable."""

    # Built with the whole configuration only, not each section by itself before: that takes longer.
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)

    def model_dump(self, *, include=None, exclude=(), **_):
        """Return key -> plain value, without keys that are left out; no serializer is built."""
        skipped = {*exclude, *(key for key, x in type(self).model_fields.items() if x.exclude)}
        values = {key: value for key, value in self if value is not None and key not in skipped}
        return {key: _plain(values[key]) for key in values if include is None or key in include}


@cache
def type_of(kind):
    """Return the type of a kind of `gearlib.parameters`, as YAML has its values."""
    if isinstance(kind, parameters.Number):
        bounds = {"gt": kind.above, "ge": kind.least, "lt": kind.below, "le": kind.most}
        bounds = {name: value for name, value in bounds.items() if value is not None}
        if kind.unit == "1":
            return number(**bounds)
        return quantity(kind.unit, kind.example, infinite=bool(kind.infinite), **bounds)
    if isinstance(kind, parameters.Integer):
        return whole(kind.least, kind.limit if kind.most is None else kind.most)
    if kind == parameters.TEXT:
        return Label
    if kind == parameters.TRUTH:
        return Truth
    if isinstance(kind, parameters.OneOf):
        return Annotated[Literal[kind.choices], BeforeValidator(_read_choice)]
    return Annotated[
        list[type_of(kind.item)], Field(min_length=kind.count or 1, max_length=kind.count)
    ]


def like(
    title, words, constructor, *names, base=Section, without=(), required=(), optional=(), **more
):
    """Return a section whose keys are what a constructor or function declares, or some `names`.

    They are added to `base`. What has a default may be left out unless it is `required`, and so
    may `optional` keys; `without` are no keys. `more` keys, (type, field) each, belong to the
    section alone. `words` describe the section.
    """
    fields = {}
    for name, parameter in parameters.declared(constructor).items():
        chosen = name in names if names else name not in {*without, *more}
        if not chosen or isinstance(parameter.kind, parameters.Instance):
            continue
        default, extra = parameter.default, {}
        needed = name in required or (default is parameters.MISSING and name not in optional)
        values = default if isinstance(default, tuple) else (default,)
        if not needed and not {parameters.MISSING, None, math.inf}.intersection(values):
            # Left out, it is not dumped; the schema says what the constructor makes of it.
            plain = list(default) if isinstance(default, tuple) else default
            extra = {"json_schema_extra": {"default": plain}} if name not in optional else {}
        field = entry(parameter.description, ... if needed else None, **extra)
        fields[name] = type_of(parameter.kind), field
    return create_model(title, __base__=base, __doc__=words, **(fields | more))


Finite, Positive = type_of(parameters.FINITE), type_of(parameters.POSITIVE)
NonNegative = type_of(parameters.NONNEGATIVE)
Stiffness, Mass, Inertia = map(type_of, (parameters.STIFFNESS, parameters.MASS, parameters.INERTIA))
Length, Error = type_of(parameters.LENGTH), type_of(parameters.ERROR)
Backlash, Angle = type_of(parameters.BACKLASH), type_of(parameters.ANGLE)
DampingCoefficient = type_of(parameters.DAMPING)
PositiveDamping = quantity("N s/m", "3.95 N s/mm", gt=0)
Torque, Power, Speed = map(type_of, (parameters.DRIVING_TORQUE, parameters.POWER, parameters.SPEED))
#: Of the gear pair.
_SPEED = {"json_schema_extra": _or_text(units.RPM, "or a speed such as '1500 rpm'")}
Tuning = number(_read_tuning, gt=0, le=100, **_SPEED)
Distance = number(_read_tuning, gt=0, le=10, **_SPEED)
#: Of a train or drawing, which takes no speed.
OwnTuning = number(gt=0, le=100)
Tolerance = number(gt=0, le=10)
Count, LargeCount = whole(1, 1000), whole(1, 1_000_000)


def described(item, description):
    """Return a type with a description, for keys that many sections have."""
    return Annotated[item, Field(description=description)]


_FIRST, _LAST = "First tuning.", "Last tuning; start plus a whole multiple of step."
_DISTANCE = "Distance of the tunings."
Start, OwnStart = described(Tuning, _FIRST), described(OwnTuning, _FIRST)
Stop, OwnStop = described(Tuning, _LAST), described(OwnTuning, _LAST)
Step, OwnStep = described(Distance, _DISTANCE), described(number(gt=0, le=10), _DISTANCE)
Periods = described(LargeCount, "Mesh periods of a run.")
RecordPeriods = described(whole(1), "The last mesh periods, which are evaluated.")
Starts = described(Count, "Seeded starts of every motion.")
Seed = described(whole(0, 1_000_000), "Seed of the random starts.")


class OwnGrid(Section):
    """A range of tunings in equal steps, of a train or drawing."""

    start: OwnStart
    stop: OwnStop
    step: OwnStep

    @model_validator(mode="after")
    def _check_grid(self):
        self.check_steps("step")
        return self

    def check_steps(self, key, most=MAX_JOBS):
        """Refuse a range that is no whole multiple of a step, or has too many."""
        step, span = getattr(self, key), self.stop - self.start
        count = tunings.steps(self.start, self.stop, step)
        allowed = f">= {span / most:.2g} to stay within {most:,} tunings"
        checks.require(count < most, f".{key}", step, allowed)
        allowed = f".start = {self.start!r} plus a whole multiple of .{key} = {step!r}"
        checks.require(count > 0 and count % 1 == 0, ".stop", self.stop, allowed)


class Grid(OwnGrid):
    """A range of tunings of the gear pair in equal steps, or of speeds."""

    start: Start
    stop: Stop
    step: Step

    @model_validator(mode="before")
    @classmethod
    def _read_speeds(cls, values, info):
        """Return a grid in rpm as one of tunings; a decimal step keeps stop a whole multiple."""
        keys = ("start", "stop", "step", "window", "fine_step", "share_step")
        given = dict(values) if isinstance(values, dict) else {}
        rpm = {key: units.rpm(given[key]) for key in keys if key in given}
        if {*rpm.values()} <= {None}:
            return values
        for key in (*keys[:3], *rpm):
            if rpm.get(key) is None:
                fault = f"= {given[key]!r} is not allowed" if key in given else "is missing"
                raise ValueError(f".{key} {fault}: a grid must be in rpm throughout, or nowhere")
        count = (rpm["stop"] - rpm["start"]) / rpm["step"] if rpm["step"] else Decimal(0)
        fits = rpm["stop"] < _MAX_RPM and 0 < count < _MAX_RPM and count % 1 == 0
        allowed = f".start = {given['start']!r} plus a whole multiple of .step = {given['step']!r}"
        checks.require(fits, ".stop", given["stop"], allowed)
        unit = Decimal(tuning_per_rpm(from_context(info, "pair")))
        start, step = ((unit * rpm[key]).quantize(_DECIMALS) for key in ("start", "step"))
        lengths = {key: value / rpm["step"] * step for key, value in rpm.items()}
        lengths |= {"start": start, "stop": start + count * step}
        return values | {key: float(value) for key, value in lengths.items()}


def grid(start, stop, step, base=Grid):
    """Return the base of a section with a range of tunings, by its defaults."""
    types = (OwnStart, OwnStop, OwnStep) if base is OwnGrid else (Start, Stop, Step)
    keys = {"start": (types[0], start), "stop": (types[1], stop), "step": (types[2], step)}
    return create_model("Range", __base__=base, **keys)


class Recorded(Section):
    """Runs of which the last mesh periods are evaluated."""

    periods: Periods
    record_periods: RecordPeriods

    @model_validator(mode="after")
    def _check_record(self):
        allowed = f"an integer from 1 to .periods = {self.periods}"
        fits = self.record_periods <= self.periods
        checks.require(fits, ".record_periods", self.record_periods, allowed)
        return self


class Seeded(Section):
    """Sections whose motions have many seeded starts."""

    starts: Starts = 32
    seed: Seed = 1
    spread: Tolerance = entry("Largest displacement at a start, static deflections.", 0.02)


class Started(Seeded):
    """Sections whose motions get fewer starts where those agree."""

    first_starts: Count = entry("Starts that suffice if they end on one orbit.", 4)

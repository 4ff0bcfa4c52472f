"""Types of the configuration's values: what a number, a name, a list may be, and what must agree.

Numbers: YAML 1.1, which Snakemake reads, takes ``4e8`` or ``4.0e8`` for a text (it wants
``4.0e+8``), and all values inside of ``--config section={key: 0.66}`` come as texts. A text that is
plainly a number, true or false is accepted as that. Every other text in place of a number is
refused, and so are ``true`` for 1, 2.0 for an integer, NaN and, except for a backlash, infinity.
Where a value has a dimension, a number is in SI units and a text may name another one of that
dimension: ``"4e5 N/mm"``.
"""

import math
import re
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    WithJsonSchema,
    create_model,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gearlib import parameters, tunings
from gearlib.config import units

#: Limit that catches a mistyped step before it makes as many jobs or tunings.
MAX_JOBS = 10_000


def check_count(key, start, stop, step, most):
    """Refuse a step that cuts a range into too many."""
    if stop > start and tunings.steps(start, stop, step) + 1 > most:
        raise ValueError(
            f"{key} = {step!r} is not allowed: it must be >= {(stop - start) / most:.2g} to stay "
            f"within {most:,} tunings"
        )


def check_order(key, section, low="start", high="stop"):
    """Refuse a range whose end is not above its beginning."""
    first, last = getattr(section, low), getattr(section, high)
    if last <= first:
        raise ValueError(
            f"{key}.{high} = {last!r} is not allowed: it must be greater than {key}.{low} = "
            f"{first!r}"
        )


def check_most(key, value, most, words="the {} recorded mesh periods"):
    """Refuse more than there are; `words` say what of."""
    if value > most:
        raise ValueError(
            f"{key} = {value} is not allowed: it must be an integer from 1 to {words.format(most)}"
        )


def check_different(key, entries, name):
    """Refuse two entries of a list that have one name or title."""
    found = [getattr(one, name) for one in entries]
    for i, value in enumerate(found):
        if found.count(value) > 1:
            raise ValueError(
                f"{key}[{i}].{name} = {value!r} is not allowed: {name}s must be all different"
            )


def check_grid(key, section, step_key="step"):
    """Refuse a section whose stop is not start plus a whole multiple of step, or too fine."""
    start, stop, step = section.start, section.stop, getattr(section, step_key)
    check_count(f"{key}.{step_key}", start, stop, step, MAX_JOBS)
    if stop <= start or tunings.steps(start, stop, step) % 1:
        raise ValueError(
            f"{key}.stop = {stop!r} is not allowed: it must be {key}.start = {start!r} plus a "
            f"whole multiple of {key}.{step_key} = {step!r}"
        )


_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_INTEGER = re.compile(r"[-+]?\d+")
_TRUTH = {"true": True, "false": False}


def _read_number(value):
    return float(value) if isinstance(value, str) and _NUMBER.fullmatch(value) else value


def read_integer(value):
    """Return a text that is plainly an integer as that, anything else as it is."""
    return int(value) if isinstance(value, str) and _INTEGER.fullmatch(value) else value


def _read_choice(value):
    if isinstance(value, bool):  # pydantic would take true for 1
        raise PydanticCustomError("choice", "no choice")
    return read_integer(value)


def _read_truth(value):
    return _TRUTH.get(value.lower(), value) if isinstance(value, str) else value


def _all_different(values):
    seen = set()
    for value in values:
        if value in seen:
            raise PydanticCustomError("duplicate", "{value}", {"value": value})
        seen.add(value)
    return values


def _plain_value(value):
    value = _read_number(read_integer(_read_truth(value)))
    finite = not isinstance(value, float) or math.isfinite(value)
    if not isinstance(value, (bool, int, float, str)) or not finite:
        raise PydanticCustomError("plain_value", "no plain value")
    return value


def _amount(value):
    if isinstance(_plain_value(value), bool):
        raise PydanticCustomError("amount", "no amount")
    return _plain_value(value)


def number_within(read=_read_number, **bounds):
    """Return the type of a finite number within `bounds` (gt, ge, lt, le), by what reads it."""
    # Innermost first: bounds that pydantic cannot attach to the number itself would be missing
    # in the schema.
    return Annotated[float, Field(**{"allow_inf_nan": False} | bounds), BeforeValidator(read)]


def whole(least, most=None):
    """Return the type of an integer within bounds."""
    bounds = {"ge": least} if most is None else {"ge": least, "le": most}
    return Annotated[int, Field(**bounds), BeforeValidator(read_integer)]


def quantity(unit, example, *, infinite=False, **bounds):
    """Return the type of a number in `unit`, or a text with a unit of the same dimension."""

    def read(value):
        value = math.inf if infinite and value == ".inf" else _read_number(value)
        if not isinstance(value, str):
            return value
        try:
            return units.read(value, unit)
        except ValueError as error:
            raise PydanticCustomError("quantity", "no quantity") from error

    comment = f"in {unit} or a text with its unit such as '{example}'"
    comment = f"or .inf, {comment}" if infinite else comment
    allowed = {"allow_inf_nan": None} if infinite else {}
    extra = _or_text(units.TEXT, comment)
    return number_within(read, json_schema_extra=extra, **allowed, **bounds)


def _or_text(pattern, comment):
    """Return what the schema of a number says where a text of a pattern may stand for it."""
    return {"type": ["number", "string"], "pattern": f"^{pattern.pattern}$", "$comment": comment}


def _text(comment, **bounds):
    """Return the type of a text, in the words of its comment."""
    return Annotated[str, Field(json_schema_extra={"$comment": comment}, **bounds)]


def _anything(read, types, comment):
    """Return the type of what a function reads."""
    schema = WithJsonSchema({"type": types, "$comment": comment})
    return Annotated[Any, PlainValidator(read), schema]


Truth = Annotated[
    bool, Field(json_schema_extra={"$comment": "true or false"}), BeforeValidator(_read_truth)
]
#: Short enough for titles that name it.
_NAME = r"^[A-Za-z0-9+_-]{1,40}$"
Name = Annotated[str, Field(pattern=_NAME)]
Label = _text("a text of 1 to 60 characters", min_length=1, max_length=60)
DampingName = _text(
    "one of the dampings",
    pattern=_NAME,
    description="One of the dampings. Default: the first one that damps, if one does.",
)
#: Empty: the paper's.
ProjectName = _text(
    "a text of at most 40 letters, digits, _ and -", pattern="^[A-Za-z0-9_-]{0,40}$"
)
Colour = _text("a colour '#rrggbb', in quotes", pattern=r"^#[0-9A-Fa-f]{6}$")
#: Option of a method, which only the method can check; integers stay integers.
Option = _anything(
    _plain_value, ["boolean", "number", "string"], "a finite number, true, false or a text"
)
#: Number or text whose unit follows from another key; that checks the text.
Amount = _anything(
    _amount, ["number", "string"], "or a text with its unit, or a share such as '5 %'"
)


def entry(words, default=..., **bounds):
    """Return the field of a key, by its description and default."""
    return Field(default=default, description=words, **bounds)


def listing(item, description):
    """Return the type of a non-empty list of different items, and its description."""
    return Annotated[
        list[item],
        Field(min_length=1, description=description, json_schema_extra={"uniqueItems": True}),
        AfterValidator(_all_different),
    ]


class Section(BaseModel):
    """Base of all sections: no unknown keys, no silent conversions, immutable."""

    # Built with the whole configuration only, not each section by itself before: that takes longer.
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)

    @classmethod
    def unchecked(cls, **given):
        """Return a section that is a default; a check would build the validator of its class."""
        for key, value in given.items():
            part = cls.model_fields[key].annotation
            if isinstance(value, dict) and isinstance(part, type) and issubclass(part, Section):
                given[key] = part.unchecked(**value)
        return cls.model_construct(**given)


class Given(Section):
    """Base of sections whose keys may be left out: what is not given is not dumped either."""

    @model_serializer(mode="wrap")
    def _given(self, dump):
        if self is None:  # as the default of a section inside another
            return None
        return {key: value for key, value in dump(self).items() if value is not None}


@cache
def type_of(kind):
    """Return the type of a kind of `gearlib.parameters`, as YAML has its values."""
    if isinstance(kind, parameters.Number):
        bounds = {"gt": kind.above, "ge": kind.least, "lt": kind.below, "le": kind.most}
        bounds = {name: value for name, value in bounds.items() if value is not None}
        if kind.unit == "1":
            return number_within(**bounds)
        return quantity(kind.unit, kind.example, infinite=bool(kind.infinite), **bounds)
    if isinstance(kind, parameters.Integer):
        return whole(kind.least, kind.limit if kind.most is None else kind.most)
    if kind == parameters.TEXT:
        return Label
    if kind == parameters.TRUTH:
        return Truth
    if isinstance(kind, parameters.OneOf):
        return Annotated[Literal[kind.choices], BeforeValidator(_read_choice)]
    least, most = kind.count or 1, kind.count
    return Annotated[list[type_of(kind.item)], Field(min_length=least, max_length=most)]


def like(title, words, constructor, *names, base=None, without=(), required=(), optional=(), **own):
    """Return a section whose keys are what a constructor or function declares, or some `names`.

    They are added to `base`, by default `Given`, where what has a default may be left out.
    `without` are no keys; `required` have to be given, though there is a default; `optional` may be
    left out, though there is none, or none that counts. `own` keys, (type, field) each, belong to
    the section alone; parts such as a web are among these.
    """
    base, fields = base or Given, {}
    for name, parameter in parameters.declared(constructor).items():
        chosen = name in names if names else name not in without
        if not chosen or isinstance(parameter.kind, parameters.Instance):
            continue
        default, extra = parameter.default, {}
        if name in required or default is parameters.MISSING:
            default = ...
        elif isinstance(default, tuple):
            default = list(default)
        if name in optional:
            default = None
        elif issubclass(base, Given) and default not in (..., None):
            # Left out, it is not dumped; the schema says what the constructor makes of it.
            infinite = math.inf in (default if isinstance(default, list) else [default])
            extra = {} if infinite else {"json_schema_extra": {"default": default}}
            default = None
        fields[name] = type_of(parameter.kind), entry(parameter.description, default, **extra)
    return create_model(title, __base__=base, __doc__=words, **(fields | own))


Finite, Positive = type_of(parameters.FINITE), type_of(parameters.POSITIVE)
NonNegative = type_of(parameters.NONNEGATIVE)
Stiffness, Mass, Inertia = map(type_of, (parameters.STIFFNESS, parameters.MASS, parameters.INERTIA))
Length, Diameter = type_of(parameters.LENGTH), type_of(parameters.DIAMETER)
RunOut, Error = type_of(parameters.RUN_OUT), type_of(parameters.ERROR)
Backlash, Angle = type_of(parameters.BACKLASH), type_of(parameters.ANGLE)
Load = type_of(parameters.LOAD)
DampingCoefficient = type_of(parameters.DAMPING)
PositiveDampingCoefficient = quantity("N s/m", "3.95 N s/mm", gt=0)
CubicDamping = quantity("N s^3/m^3", "5e-6 N s^3/mm^3", gt=0)
#: Of the gear pair: `gearlib.config.speeds_section` has made numbers of texts in rpm.
_SPEED = _or_text(units.RPM, "or a speed such as '1500 rpm'")
Tuning = number_within(gt=0, le=100, json_schema_extra=_SPEED)
Distance = number_within(gt=0, le=10, json_schema_extra=_SPEED)
#: Of a train or drawing, which takes no speed.
OwnTuning = number_within(gt=0, le=100)
Harmonic = whole(1, 1000)
Share = number_within(ge=0, le=1)
Tolerance = number_within(gt=0, le=10)


def numbers(item, count, description):
    """Return the type of a list of `count` numbers, and its description."""
    return Annotated[list[item], Field(min_length=count, max_length=count, description=description)]


_START, _STEP = Field(description="First tuning."), Field(description="Distance of the tunings.")
_STOP = Field(description="Last one; start + a whole multiple of step.")
Start, Stop, Step = Annotated[Tuning, _START], Annotated[Tuning, _STOP], Annotated[Distance, _STEP]
OwnStart, OwnStop = Annotated[OwnTuning, _START], Annotated[OwnTuning, _STOP]
OwnStep = Annotated[number_within(gt=0, le=10), _STEP]


class Grid(Section):
    """A range of tunings in equal steps; base of the sections that have one."""

    start: OwnStart
    stop: OwnStop
    step: OwnStep

    @classmethod
    def key(cls):
        """Return the name of the section, for messages."""
        return re.sub("(?<!^)(?=[A-Z])", "_", cls.__name__).lower()

    @model_validator(mode="after")
    def _check_grid(self):
        check_grid(self.key(), self)
        return self


def _described(item, description):
    return Annotated[item, Field(description=description)]


Periods = _described(whole(1, 1_000_000), "Mesh periods of a run.")
RecordPeriods = _described(whole(1), "The last ones, which are evaluated; at most `periods`.")
Starts = _described(whole(1, 1000), "Seeded starts of every motion.")
Seed = _described(whole(0, 1_000_000), "Of the random displacements at the start.")
Spread = _described(
    number_within(gt=0, le=10), "Largest displacement of a body at the start, static deflections."
)


class Recorded(Grid):
    """A grid of runs of which the last mesh periods are evaluated."""

    periods: Periods
    record_periods: RecordPeriods

    @model_validator(mode="after")
    def _check_record(self):
        key = self.key()
        words = key + ".periods = {}"
        check_most(f"{key}.record_periods", self.record_periods, self.periods, words)
        return self


class Seeded(Section):
    """Base of the sections that ask seeded starts of a motion."""

    starts: Starts = 32
    seed: Seed = 1
    spread: Spread = 0.02


class Started(Seeded, Grid):
    """A grid of which every motion has many starts; see `gearlib.studies.trains.motions`."""

    first_starts: whole(1, 1000) = entry(
        "Where so many of the starts end on one stable orbit, no others are run.", 4
    )

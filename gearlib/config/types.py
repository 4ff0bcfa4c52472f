"""Types of the configuration's values, and the base classes of its sections.

YAML 1.1, which Snakemake reads, parses ``4e8`` as a string, and all values in ``--config
section={key: 0.66}`` are strings. A string that spells a number, true or false is converted. Other
strings in place of a number are refused, and so are ``true`` for 1, 2.0 for an integer, NaN and,
except for a backlash, infinity. A number with a dimension is in SI units; a string may have another
unit of that dimension: ``"4e5 N/mm"``.

The validation context holds the gear pair (``pair``), which converts speeds to tunings, and the
``dampings`` by name. The path of an `InputError` is relative to the section that raises it.
"""

import dataclasses
import inspect
import math
import re
from decimal import Decimal
from functools import cache
from typing import Annotated, Any, TypeVar

import pydantic
from annotated_types import Ge, Gt, Le, Lt
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, WithJsonSchema

from gearlib import parameters, tunings, units
from gearlib.checks import InputError, require
from gearlib.parameters import INTEGER, Allowed, Unit

#: Largest number of jobs or tunings; it catches a mistyped step.
MAX_JOBS = 10_000
#: Tunings converted from speeds are rounded to this decimal, so that floats represent them.
_TUNING_RESOLUTION = Decimal("1e-12")
#: Upper bounds of speeds in rpm and of numbers of steps.
_MAX_RPM, _MAX_STEPS = 10**9, 10**9
#: Default values that the schema does not show.
NO_VALUES = {parameters.MISSING, None, math.inf}
_BOUNDS = {"gt": Gt, "ge": Ge, "lt": Lt, "le": Le}
#: Pattern of names, which are short enough for titles.
NAME = "^[A-Za-z0-9+_-]{1,40}$"
_T = TypeVar("_T")


def field(description, default=..., **constraints):
    """Return the pydantic field of a configuration key, with its description and default.

    Without a `default` the key is required; with None it may be missing. Other defaults are
    validated like values of a file. `constraints` are further arguments of `pydantic.Field`, such
    as min_length.
    """
    validate = default not in (..., None)
    return Field(default=default, description=description, validate_default=validate, **constraints)


#: Field of a section; a missing section has the defaults of its keys.
SECTION: Any = Field(default={}, validate_default=True)


def check_unique(list_key, sections, attribute):
    """Raise an error if two sections of a list have the same value of an attribute.

    `list_key` is the key of the list in the configuration, `sections` are its entries, and
    `attribute` is a name such as "title".
    """
    values = [getattr(section, attribute) for section in sections]
    for i, value in enumerate(values):
        allowed = f"another one: {attribute}s must be all different"
        require(values.count(value) == 1, f"{list_key}[{i}].{attribute}", value, allowed)


def _read_option(value):
    """Return an option of an integration method as a boolean, a number or a string.

    `value` comes from a YAML file, where strings may spell a number, true or false; these are
    converted. Raise ValueError for other types, without a message, because pydantic makes one from
    the type of the key.
    """
    if isinstance(value, str):
        if re.fullmatch(r"[-+]?\d+", value):
            return int(value)
        if units.NUMBER_PATTERN.fullmatch(value):
            return float(value)
        return {"true": True, "false": False}.get(value.lower(), value)
    if isinstance(value, int | float) and math.isfinite(value):
        return value
    raise ValueError


def _read_amount(value):
    """Return a number or a string such as "5 %", or raise ValueError for other values.

    Strings that spell a number are converted.
    """
    value = _read_option(value)
    if isinstance(value, bool):
        raise ValueError
    return value


def _require_distinct(values):
    """Return the list `values`, or raise an error if two of its entries are equal."""
    for value in values:
        if values.count(value) > 1:
            problem = f"lists {value!r} twice: its entries must be all different"
            raise InputError("", problem=problem)
    return values


def from_context(info, key):
    """Return the entry `key` of a pydantic validation context, None if it is missing."""
    return (info.context or {}).get(key)


def _require_known_damping(name, info):
    """Return `name` if a damping combination has this name, else raise an error.

    `info` has the context of the validation with the damping combinations by name.
    """
    # If the damping combinations are not valid, an error of their own section says so. Each name is
    # accepted here, to raise no second error.
    names = from_context(info, "dampings") or [name]
    require(name in names, "", name, f"one of {', '.join(names)}")
    return name


def _read_tuning(value, info):
    """Return a speed such as "1500 rpm" as a tuning; return other values unchanged.

    A tuning is the mesh frequency over the natural frequency of the gear pair. `info` has the
    context of the validation with this pair.
    """
    rpm = units.parse_rpm(value)
    if rpm is None:
        return value
    # `info.data` has the preceding keys of the section, such as `change` of a `MeshCase`.
    return float(rpm) * tuning_per_rpm(from_context(info, "pair"), info.data.get("change"))


def tuning_per_rpm(pair, change=None):
    """Return the tuning of a gear pair at a pinion speed of 1 rpm.

    A tuning is the mesh frequency over the mean natural frequency of the pair, a `GearPairSection`.
    `change` is a section with other values for some parameters of the pair, or None.
    """
    if pair is None:
        return 1e-4  # An invalid pair has an error of its own, so that any number serves here.
    pair = pair.model_copy(update=change.model_dump()) if change else pair
    return 2.0 * math.pi * pair.teeth / (60.0 * pair.mean_eigenfrequency)


def quantity(unit, example="", infinity_text="", **bounds):
    """Return the type of a number in the SI unit `unit`, with bounds such as gt=0.

    Error messages use `example`, a value in another unit. `infinite` says what an infinite value
    means; if it is "", infinity is not allowed.
    """
    limits = [_BOUNDS[name](bound) for name, bound in bounds.items()]
    return Annotated[(float, *limits, Unit(unit, example, infinite))]


def number(**bounds):
    """Return the type of a number without a unit, with bounds such as gt=0."""
    return quantity("1", **bounds)


def integer(minimum, maximum=None):
    """Return the type of an integer from `minimum` to `maximum`, both included.

    None as `maximum` means that there is no upper limit.
    """
    limits = [Ge(minimum)]
    if maximum is not None:
        limits.append(Le(maximum))
    return Annotated[(int, *limits, INTEGER)]


def text(words, **constraints):
    """Return the type of a string for a configuration key.

    `words` describe the allowed strings in error messages, and `constraints` are arguments of
    `pydantic.Field`, such as a pattern.
    """
    return Annotated[str, Allowed(words), Field(**constraints)]


def custom_type(read, json_types, words):
    """Return the type of values that a function checks and converts.

    The function `read` returns the converted value, or raises ValueError. `json_types` are names of
    the types that the JSON schema allows, and `words` describe the allowed values in error
    messages.
    """
    return Annotated[
        Any, PlainValidator(read), Allowed(words), WithJsonSchema({"type": json_types})
    ]


def list_of(item_type, length):
    """Return the type of a list with `length` items."""
    return Annotated[list[item_type], Field(min_length=length, max_length=length)]


#: A non-empty list of different values.
Distinct = Annotated[
    list[_T],
    Field(min_length=1, json_schema_extra={"uniqueItems": True}),
    AfterValidator(_require_distinct),
]
Name = Annotated[str, Field(pattern=NAME)]
Label = Annotated[str, Field(min_length=1, max_length=60)]
DampingName = Annotated[
    text(
        "one of the dampings",
        pattern=NAME,
        description="One of the dampings. Default: the first one that damps, if one does.",
    ),
    AfterValidator(_require_known_damping),
]
#: Option of a method, which only the method itself can check; integers stay integers.
Option = custom_type(
    _read_option, ["boolean", "number", "string"], "a finite number, true, false or a text"
)
#: Number or text with a unit; a later check converts it, when the parameter and its unit are known.
Amount = custom_type(
    _read_amount,
    ["number", "string"],
    "a finite number or a text with its unit, or a share such as '5 %'",
)


class Section(pydantic.BaseModel):
    """Base class of all sections: immutable, without unknown keys and implicit conversions."""

    # It is faster to build the validators once, with the whole configuration.
    model_config = pydantic.ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)

    @classmethod
    def model_validate(cls, obj, *, context=None, **options):
        """Return the section for its content in a YAML file, where texts may stand for numbers."""
        return super().model_validate(obj, context=context or {}, **options)

    def model_dump(self, **options):
        """Return the section as a dict without keys whose value is None."""
        return super().model_dump(exclude_none=True, **options)

    def missing_key_error(self, key):
        """Return an error which says that `key` is missing, and which values are allowed."""
        annotation = parameters.resolve_location(type(self), (key,))[1]
        return InputError(key, None, parameters.describe_requirement(annotation, in_file=True))


def create_section(
    name, doc, constructor, *keys, base=Section, exclude=(), required=(), optional=(), **extra
):
    """Return a section class with a key for each declared parameter of a constructor.

    `constructor` is a class or function whose annotations have types and descriptions. If `keys`
    are given, only these parameters get a key; parameters in `exclude` get none. Keys in `required`
    must be given although they have a default, keys in `optional` may be missing although they have
    no default. The class has the name `name`, the docstring `doc`, the base class `base` and the
    `extra` keys, each a pair (type, field).
    """
    fields = {}
    for key, parameter in parameters.declared_parameters(constructor).items():
        included = key in keys if keys else key not in {*exclude, *extra}
        if not included:
            continue
        annotation = parameters.replace_dataclass(parameter.annotation, _create_part_section)
        default, options = parameter.default, {}
        is_required = key in required or (default is parameters.MISSING and key not in optional)
        values = list(default) if isinstance(default, tuple) else [default]
        # The schema cannot show a default that is a part of a model, such as a tip relief.
        has_parts = any(map(dataclasses.is_dataclass, values))
        if not (has_parts or is_required or key in optional or NO_VALUES & {*values}):
            # The constructor applies the default, so that only the schema needs to show it.
            default = values if isinstance(default, tuple) else default
            options = {"json_schema_extra": {"default": default}}
        definition = field(parameter.description, ... if is_required else None, **options)
        fields[key] = annotation, definition
    return pydantic.create_model(name, __base__=base, __doc__=doc, **(fields | extra))


@cache
def _create_part_section(part):
    """Return the section class for a class whose objects are parts of a model.

    Such a part is a `TipRelief`, for example.
    """
    return create_section(f"{part.__name__}Section", inspect.getdoc(part).partition("\n")[0], part)


PositiveDamping = quantity("N s/m", "3.95 N s/mm", gt=0)


def tuning(**bounds):
    """Return the type of a tuning of the gear pair, with bounds such as gt=0.

    A tuning is the mesh frequency over the natural frequency. A file may have a speed such as "1500
    rpm" in its place, which is converted.
    """
    words = f"{parameters.describe_requirement(number(**bounds))} or a speed such as '1500 rpm'"
    schema = {"type": ["number", "string"], "pattern": f"^{units.RPM_PATTERN.pattern}$"}
    return Annotated[
        number(**bounds),
        BeforeValidator(_read_tuning),
        Allowed(words),
        Field(json_schema_extra=schema),
    ]


#: Tuning of the gear pair and difference of two tunings, which may be speeds.
Tuning, Distance = tuning(gt=0, le=100), tuning(gt=0, le=10)
#: Tuning that must be a number, because it belongs to a train or gears given by geometry.
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
    """Equidistant tunings of a train or gears given by geometry."""

    start: NumericStart
    stop: NumericStop
    step: NumericStep

    @pydantic.model_validator(mode="after")
    def _check_grid(self):
        """Raise ValueError unless the range of tunings is a whole multiple of the step."""
        self.check_steps("step")
        return self

    def check_steps(self, step_key, max_tunings=MAX_JOBS):
        """Raise ValueError if a step is too small or does not divide the range of tunings.

        The range goes from `start` to `stop` of this section. `step_key` is the key of the step;
        more than `max_tunings` tunings are not allowed.
        """
        step, tuning_range = getattr(self, step_key), self.stop - self.start
        step_count = tunings.count_steps(self.start, self.stop, step)
        allowed = f">= {tuning_range / max_tunings:.2g} to stay within {max_tunings:,} tunings"
        require(step_count < max_tunings, step_key, step, allowed)
        allowed = f"start = {self.start:.12g} plus a whole multiple of {step_key} = {step:.12g}"
        require(step_count > 0 and step_count % 1 == 0, "stop", self.stop, allowed)


class Grid(NumericGrid):
    """Equidistant tunings or speeds of the gear pair."""

    start: Start
    stop: Stop
    step: Step

    @pydantic.model_validator(mode="before")
    @classmethod
    def _read_speeds(cls, values, info):
        """Return the content of a section with speeds in rpm converted to tunings.

        A tuning is the mesh frequency over the natural frequency. `values` is the content in the
        file, in which either all keys of the grid or none are in rpm; `info` has the context of the
        validation with the gear pair. The converted range is a whole multiple of its step, like the
        range of speeds.
        """
        keys = ("start", "stop", "step", "window", "fine_step", "share_step")
        section = dict(values) if isinstance(values, dict) else {}
        # None stands for a value that is not in rpm.
        speeds = {key: units.parse_rpm(section[key]) for key in keys if key in section}
        if {*speeds.values()} <= {None}:
            return values
        # Start, stop and step are needed in rpm as well, even where the file leaves them out.
        for key in (*keys[:3], *speeds):
            if speeds.get(key) is None:
                raise InputError(
                    key, section.get(key), "in rpm as the other keys of the grid, or none"
                )
        start, stop, step = (speeds[key] for key in keys[:3])
        step_count = (stop - start) / step if step else Decimal(0)
        is_valid = stop < _MAX_RPM and 0 < step_count < _MAX_STEPS and step_count % 1 == 0
        allowed = f"start = {section['start']!r} plus a whole multiple of step = "
        require(is_valid, "stop", section["stop"], f"{allowed}{section['step']!r}")
        # Start and step are rounded to decimals. All other values are computed from these two, so
        # that they stay whole multiples of the step.
        factor = Decimal(tuning_per_rpm(from_context(info, "pair")))
        first_tuning = (factor * start).quantize(_TUNING_RESOLUTION)
        tuning_step = (factor * step).quantize(_TUNING_RESOLUTION)
        tuning_values = {key: speed / step * tuning_step for key, speed in speeds.items()}
        tuning_values |= {"start": first_tuning, "stop": first_tuning + step_count * tuning_step}
        return values | {key: float(value) for key, value in tuning_values.items()}


def grid_with_defaults(start, stop, step, base=Grid):
    """Return a base class of sections with a grid of tunings, which has these defaults.

    `start`, `stop` and `step` define the grid. The class is derived from `base`: `Grid`, in which
    tunings may be given as speeds in rpm, or `NumericGrid`, in which they must be numbers.
    """
    types = (NumericStart, NumericStop, NumericStep) if base is NumericGrid else (Start, Stop, Step)
    fields = {"start": (types[0], start), "stop": (types[1], stop), "step": (types[2], step)}
    return pydantic.create_model("GridWithDefaults", __base__=base, **fields)


class RecordedPeriods(Section):
    """Base class of sections with runs whose last mesh periods are evaluated."""

    periods: Periods
    record_periods: RecordPeriods

    @pydantic.model_validator(mode="after")
    def _check_record(self):
        """Raise ValueError if more mesh periods are recorded than a run has.

        The recorded periods are the last ones of a run, which are evaluated.
        """
        recorded, allowed = self.record_periods, f"an integer from 1 to periods = {self.periods}"
        require(recorded <= self.periods, "record_periods", recorded, allowed)
        return self


class SeededStarts(Section):
    """Base class of sections with motions from random initial states."""

    starts: Starts = 32
    seed: Seed = 1
    spread: Tolerance = field("Largest displacement at a start, static deflections.", 0.02)


class IncreasingStarts(SeededStarts):
    """Base class of sections that compute all starts only if the first ones disagree."""

    first_starts: Count = field("Starts that suffice if they end on one orbit.", 4)

"""Types of the values in a configuration, and base classes of its sections.

YAML 1.1, which Snakemake reads, parses ``4e8`` as a string, and all values in ``--config
section={key: 0.66}`` are strings. Strings that represent a number, true or false are converted.
Other strings in place of a number are rejected. So are ``true`` for 1, 2.0 for an integer, NaN and,
except for a backlash, infinity. Numbers are in SI units; a string may contain another unit of the
same dimension, e.g. ``"4e5 N/mm"``.

The validation context contains the gear pair (``pair``), which converts speeds to tunings, and the
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

#: Largest number of jobs or tunings; the limit catches mistyped steps.
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

    Without a `default` the key is required; if it is None, the key may be omitted. Other defaults
    are validated like values in a file. `constraints` are passed to `pydantic.Field`, e.g.
    min_length.
    """
    validate = default not in (..., None)
    return Field(default=default, description=description, validate_default=validate, **constraints)


#: Field that contains a section; a missing section gets the default values of its keys.
SECTION: Any = Field(default={}, validate_default=True)


def check_unique(list_key, sections, attribute):
    """Raise an error if two sections in a list have the same value of an attribute.

    `list_key` is the configuration key of the list, `sections` are its entries, and `attribute` is
    the name of the attribute, e.g. "title".
    """
    values = [getattr(section, attribute) for section in sections]
    for i, value in enumerate(values):
        allowed = f"different from all other {attribute}s"
        require(values.count(value) == 1, f"{list_key}[{i}].{attribute}", value, allowed)


def _read_option(value):
    """Return an option of an integration method as a boolean, a number or a string.

    Strings that represent a number, true or false are converted. Raise ValueError if `value` has
    another type; pydantic generates the error message.
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
    """Return `value` if it is a number or a string such as "5 %", else raise ValueError.

    Strings that represent a number are converted.
    """
    value = _read_option(value)
    if isinstance(value, bool):
        raise ValueError
    return value


def _require_distinct(values):
    """Return the list `values`, or raise an error if any entry occurs more than once."""
    for value in values:
        if values.count(value) > 1:
            problem = f"contains {value!r} more than once: all entries must be different"
            raise InputError("", problem=problem)
    return values


def get_context_value(info, key):
    """Return the value of `key` in the pydantic validation context, or None if it is missing."""
    return (info.context or {}).get(key)


def _require_known_damping(name, info):
    """Return `name` if it is the name of a damping combination, else raise an error.

    The validation context in `info` contains the damping combinations by name.
    """
    # If the damping combinations are invalid, their own section raises an error. Any name is
    # accepted here to avoid a second error.
    names = get_context_value(info, "dampings") or [name]
    require(name in names, "", name, f"one of {', '.join(names)}")
    return name


def _read_tuning(value, info):
    """Convert a speed such as "1500 rpm" to a tuning; return other values unchanged.

    The tuning is the mesh frequency divided by the natural frequency of the gear pair, which is in
    the validation context of `info`.
    """
    rpm = units.parse_rpm(value)
    if rpm is None:
        return value
    # `info.data` contains the preceding keys of the section, e.g. `change` of a `MeshCase`.
    return float(rpm) * tuning_per_rpm(get_context_value(info, "pair"), info.data.get("change"))


def tuning_per_rpm(pair, change=None):
    """Return the tuning of a gear pair at a pinion speed of 1 rpm.

    The tuning is the mesh frequency divided by the mean natural frequency of `pair`, a
    `GearPairSection`. If `change` is given, its values replace those of the pair.
    """
    if pair is None:
        return 1e-4  # The pair is invalid and raises its own error, so any number will do.
    pair = pair.model_copy(update=change.model_dump()) if change else pair
    return 2.0 * math.pi * pair.teeth / (60.0 * pair.mean_eigenfrequency)


def quantity(unit, example="", infinity_text="", **bounds):
    """Return the type of a number in the SI unit `unit`, with bounds such as gt=0.

    `example` is a value in another unit, for error messages. `infinity_text` says what an infinite
    value means; if it is "", infinity is not allowed.
    """
    limits = [_BOUNDS[name](bound) for name, bound in bounds.items()]
    return Annotated[(float, *limits, Unit(unit, example, infinity_text))]


def number(**bounds):
    """Return the type of a number without a unit, with bounds such as gt=0."""
    return quantity("1", **bounds)


def integer(minimum, maximum=None):
    """Return the type of an integer from `minimum` to `maximum`, both included.

    If `maximum` is None, there is no upper limit.
    """
    limits = [Ge(minimum)]
    if maximum is not None:
        limits.append(Le(maximum))
    return Annotated[(int, *limits, INTEGER)]


def text(allowed, **constraints):
    """Return the type of a string in a configuration.

    `allowed` describes the allowed strings in error messages; `constraints` are passed to
    `pydantic.Field`, e.g. a pattern.
    """
    return Annotated[str, Allowed(allowed), Field(**constraints)]


def custom_type(convert, json_types, allowed):
    """Return the type of values that the function `convert` checks and converts.

    `convert` returns the converted value or raises ValueError. `json_types` lists the types allowed
    by the JSON schema, and `allowed` describes the allowed values in error messages.
    """
    return Annotated[
        Any, PlainValidator(convert), Allowed(allowed), WithJsonSchema({"type": json_types})
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
        description="One of the dampings. Default: the first one with a nonzero coefficient.",
    ),
    AfterValidator(_require_known_damping),
]
#: Option of a method, which only the method itself can check; integers stay integers.
Option = custom_type(
    _read_option, ["boolean", "number", "string"], "a finite number, true, false or a string"
)
#: Number or string with a unit, which is converted later, when the unit of the parameter is known.
Amount = custom_type(
    _read_amount,
    ["number", "string"],
    "a finite number, a string with a unit, or a percentage such as '5 %'",
)


class Section(pydantic.BaseModel):
    """Base class of all sections: immutable, no unknown keys, no implicit type conversions."""

    # It is faster to build all validators at once, together with the whole configuration.
    model_config = pydantic.ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)

    @classmethod
    def model_validate(cls, obj, *, context=None, **options):
        """Return the section for its content in a YAML file, in which numbers may be strings."""
        return super().model_validate(obj, context=context or {}, **options)

    def model_dump(self, **options):
        """Return the section as a dict, without the keys whose value is None."""
        return super().model_dump(exclude_none=True, **options)

    def missing_key_error(self, key):
        """Return the error for a missing `key`; its message states the allowed values."""
        annotation = parameters.resolve_location(type(self), (key,))[1]
        return InputError(key, None, parameters.describe_requirement(annotation, in_file=True))


def create_section(
    name, doc, constructor, *keys, base=Section, exclude=(), required=(), optional=(), **extra
):
    """Create a section class with one key per declared parameter of a constructor.

    `constructor` is a class or function whose annotations contain types and descriptions. If `keys`
    are given, only these parameters become keys; those in `exclude` do not. Keys in `required` must
    be given even if they have a default; keys in `optional` may be omitted even if they have none.
    The class gets the name `name`, the docstring `doc`, the base class `base` and the `extra` keys,
    each a pair (type, field).
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
        # The schema cannot represent a default that is a dataclass, such as a tip relief.
        has_dataclasses = any(map(dataclasses.is_dataclass, values))
        if not (has_dataclasses or is_required or key in optional or NO_VALUES & {*values}):
            # The constructor applies the default; here it is only recorded for the schema.
            default = values if isinstance(default, tuple) else default
            options = {"json_schema_extra": {"default": default}}
        definition = field(parameter.description, ... if is_required else None, **options)
        fields[key] = annotation, definition
    return pydantic.create_model(name, __base__=base, __doc__=doc, **(fields | extra))


@cache
def _create_part_section(part_class):
    """Create the section class for a class of which a model has instances, e.g. `TipRelief`."""
    doc = inspect.getdoc(part_class).partition("\n")[0]
    return create_section(f"{part_class.__name__}Section", doc, part_class)


PositiveDamping = quantity("N s/m", "3.95 N s/mm", gt=0)


def tuning(**bounds):
    """Return the type of a tuning of the gear pair, with bounds such as gt=0.

    The tuning is the mesh frequency divided by the natural frequency. A file may contain a speed
    such as "1500 rpm" instead, which is converted.
    """
    allowed = f"{parameters.describe_requirement(number(**bounds))} or a speed such as '1500 rpm'"
    schema = {"type": ["number", "string"], "pattern": f"^{units.RPM_PATTERN.pattern}$"}
    return Annotated[
        number(**bounds),
        BeforeValidator(_read_tuning),
        Allowed(allowed),
        Field(json_schema_extra=schema),
    ]


#: Tuning of the gear pair, and difference of two tunings; both may be given as speeds.
Tuning, Distance = tuning(gt=0, le=100), tuning(gt=0, le=10)
#: Tuning of a train or of gears given by geometry, which cannot be given as a speed.
NumericTuning = number(gt=0, le=100)
Tolerance = number(gt=0, le=10)
Count, LargeCount = integer(1, 1000), integer(1, 1_000_000)


def with_description(value_type, description):
    """Return `value_type` with a `description` for all fields of this type."""
    return Annotated[value_type, Field(description=description)]


_START_DOC = "First tuning."
_STOP_DOC = "Last tuning; start plus a whole multiple of step."
_STEP_DOC = "Step between tunings."
Start = with_description(Tuning, _START_DOC)
Stop = with_description(Tuning, _STOP_DOC)
Step = with_description(Distance, _STEP_DOC)
NumericStart = with_description(NumericTuning, _START_DOC)
NumericStop = with_description(NumericTuning, _STOP_DOC)
NumericStep = with_description(number(gt=0, le=10), _STEP_DOC)
Periods = with_description(LargeCount, "Mesh periods of a run.")
RecordPeriods = with_description(integer(1), "Number of last mesh periods that are evaluated.")
Starts = with_description(Count, "Number of random initial states for each motion.")
Seed = with_description(integer(0, 1_000_000), "Seed of the random initial states.")


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

        The range is from `start` to `stop` of this section. `step_key` is the key of the step, and
        `max_tunings` the largest allowed number of tunings.
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

        The tuning is the mesh frequency divided by the natural frequency of the gear pair, which is
        in the validation context of `info`. `values` is the content of the section in the file, in
        which all keys of the grid or none are in rpm. The converted range is still a whole multiple
        of the converted step.
        """
        keys = ("start", "stop", "step", "window", "fine_step", "share_step")
        section = dict(values) if isinstance(values, dict) else {}
        # Values that are not in rpm become None.
        speeds = {key: units.parse_rpm(section[key]) for key in keys if key in section}
        if {*speeds.values()} <= {None}:
            return values
        # Start, stop and step are needed in rpm, too, even if the file omits them.
        for key in (*keys[:3], *speeds):
            if speeds.get(key) is None:
                raise InputError(key, section.get(key), "in rpm, like the other keys of the grid")
        start, stop, step = (speeds[key] for key in keys[:3])
        step_count = (stop - start) / step if step else Decimal(0)
        is_valid = stop < _MAX_RPM and 0 < step_count < _MAX_STEPS and step_count % 1 == 0
        allowed = f"start = {section['start']!r} plus a whole multiple of step = "
        require(is_valid, "stop", section["stop"], f"{allowed}{section['step']!r}")
        # Only start and step are rounded. All other values are computed from these two, so that
        # the range remains a whole multiple of the step.
        factor = Decimal(tuning_per_rpm(get_context_value(info, "pair")))
        first_tuning = (factor * start).quantize(_TUNING_RESOLUTION)
        tuning_step = (factor * step).quantize(_TUNING_RESOLUTION)
        tuning_values = {key: speed / step * tuning_step for key, speed in speeds.items()}
        tuning_values |= {"start": first_tuning, "stop": first_tuning + step_count * tuning_step}
        return values | {key: float(value) for key, value in tuning_values.items()}


def grid_with_defaults(start, stop, step, base=Grid):
    """Create a base class for sections with a grid of tunings that has default values.

    The defaults are `start`, `stop` and `step`. The class is derived from `base`: `Grid`, in which
    tunings may be given as speeds in rpm, or `NumericGrid`, in which they must be numbers.
    """
    fields = {"start": (Start, start), "stop": (Stop, stop), "step": (Step, step)}
    if base is NumericGrid:
        fields = {
            "start": (NumericStart, start),
            "stop": (NumericStop, stop),
            "step": (NumericStep, step),
        }
    return pydantic.create_model("GridWithDefaults", __base__=base, **fields)


class RecordedPeriods(Section):
    """Base class of sections with runs of which the last mesh periods are evaluated."""

    periods: Periods
    record_periods: RecordPeriods

    @pydantic.model_validator(mode="after")
    def _check_record(self):
        """Raise ValueError if the number of recorded mesh periods exceeds the length of a run."""
        recorded, allowed = self.record_periods, f"an integer from 1 to periods = {self.periods}"
        require(recorded <= self.periods, "record_periods", recorded, allowed)
        return self


class SeededStarts(Section):
    """Base class of sections with motions from random initial states."""

    starts: Starts = 32
    seed: Seed = 1
    spread: Tolerance = field(
        "Largest initial displacement, in units of the static deflection.", 0.02
    )


class IncreasingStarts(SeededStarts):
    """Base class of sections that use few initial states if these lead to one orbit."""

    first_starts: Count = field(
        "Number of initial states that suffice if all lead to the same orbit.", 4
    )

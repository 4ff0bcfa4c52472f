"""Declarations of parameters: type, unit, allowed values, description and symbol in one annotation.

    max_stiffness: Annotated[Stiffness, described("Maximum mesh stiffness", "C_max")]

pydantic checks arguments against the annotations of models (`declared`) and functions (`checked`).
Docstrings, documentation tables, configuration sections and their JSON schema, command-line options
and sliders are generated from the annotations. This module does not import NumPy.
"""

import contextlib
import dataclasses
import functools
import inspect
import math
import re
import textwrap
import types
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from numbers import Integral, Real
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
)

import pydantic.dataclasses
from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
)
from pydantic_core import core_schema

from gearlib import checks, units
from gearlib.checks import InputError

_T = TypeVar("_T")

#: Largest integer in compiled code (int64).
_MAX_INTEGER = 2**63 - 1
#: Default of a required parameter.
MISSING = inspect.Parameter.empty
#: Invalid values raise an error instead of being converted; so do unknown names.
STRICT = ConfigDict(strict=True, extra="forbid", arbitrary_types_allowed=True)


def described(text: str, symbol: str = "") -> Any:
    """Return the metadata of an annotation that describe a parameter: text and symbol."""
    return Field(description=text, title=symbol or None)


# Metadata that convert values. Strings are accepted as numbers only in configuration files, for
# whose validation pydantic passes a context.


@dataclass(frozen=True)
class Unit:
    """The SI unit of a real number, or "1".

    `example` is a value with another unit, as allowed in configuration files. `infinity_text`
    explains what infinity means; it is "" if infinity is not allowed.
    """

    unit: str
    example: str = ""
    infinity_text: str = ""

    def read(self, value: Any, info: ValidationInfo | None = None) -> float:
        """Return a real number as a float; raise ValueError if `value` is not allowed.

        In a configuration file, `value` may also be a string with a unit, such as "3 kN". pydantic
        passes `info`; its `context` is None unless a configuration file is being validated.
        """
        if isinstance(value, str) and info is not None and info.context is not None:
            try:
                value = self._parse(value)
            except ValueError:
                # `Parameter.check` writes the message, based on the annotation.
                raise ValueError from None
        if isinstance(value, Real) and not isinstance(value, bool):
            with contextlib.suppress(OverflowError):
                number = float(value)
                if math.isfinite(number) or (self.infinity_text and not math.isnan(number)):
                    return number
        raise ValueError

    def _parse(self, text: str) -> float:
        """Parse a number with a unit and return it in the unit `self.unit`.

        Numbers without a unit are also accepted, because YAML reads some numbers, such as 4e8, as
        strings. For invalid text, return NaN or raise ValueError.
        """
        if self.infinity_text and text == ".inf":
            return math.inf
        if units.NUMBER_PATTERN.fullmatch(text):
            return float(text)
        return math.nan if self.unit == "1" else units.parse_quantity(text, self.unit)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return a pydantic schema that calls `read` before it checks the type `source`."""
        return core_schema.with_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict:
        """Return the JSON schema of the number, which may be a string unless the unit is "1"."""
        number_schema = handler(schema)
        if self.unit != "1":
            pattern = f"^{units.QUANTITY_PATTERN.pattern}$"
            number_schema |= {"type": ["number", "string"], "pattern": pattern}
        return number_schema


@dataclass(frozen=True)
class Allowed:
    """The allowed values as a noun phrase, if the type does not specify them."""

    phrase: str


@dataclass(frozen=True)
class Values:
    """A sequence of `count` values, or of any number of values if `count` is None.

    If `repeat` is true, a single value is also accepted and repeated `count` times.
    """

    count: int | None = None
    repeat: bool = False

    def read(self, values: Any) -> tuple | None:
        """Return `values` as a tuple; raise ValueError if their number is not `self.count`.

        A `count` of None allows any number of values. If `self.repeat` is true, a single value is
        repeated `count` times.
        """
        if values is None:
            return None  # pydantic checks afterwards whether the type allows None.
        if self.repeat and not isinstance(values, (tuple, list)):
            values = (values,) * (self.count or 1)
        try:
            return tuple(checks.check_sequence("", values, self.count))
        except InputError:
            # `Parameter.check` writes the message, based on the annotation.
            raise ValueError from None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return a pydantic schema that calls `read` before it checks the type `source`."""
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict:
        """Return the JSON schema of the sequence, with its length if this is fixed."""
        sequence_schema = handler(schema)
        if self.count is None:
            return sequence_schema
        return sequence_schema | {"minItems": self.count, "maxItems": self.count}


def _read_integer(value: Any, info: ValidationInfo) -> int:
    """Return `value` as an int; raise ValueError if it is not an integer or is too large.

    In a configuration file, a string such as "12" is also accepted. pydantic passes `info`; its
    `context` is None unless a configuration file is being validated.
    """
    if isinstance(value, str) and info.context is not None and re.fullmatch(r"[-+]?\d+", value):
        value = int(value)
    if not isinstance(value, Integral) or isinstance(value, bool) or int(value) > _MAX_INTEGER:
        raise ValueError
    return int(value)


def _read_boolean(value: Any, info: ValidationInfo) -> Any:
    """Convert the strings "true" and "false" of a configuration file to True and False.

    All other values are returned unchanged; pydantic checks them afterwards. pydantic passes
    `info`; its `context` is None unless a configuration file is being validated.
    """
    if isinstance(value, str) and info.context is not None:
        return {"true": True, "false": False}.get(value.lower(), value)
    return value


def _read_choice(value: Any, info: ValidationInfo) -> Any:
    """Convert a string such as "12" of a configuration file to an int; return others unchanged.

    pydantic then compares the value with the choices of a `Literal` type. Booleans raise
    ValueError, because True == 1 in Python. pydantic passes `info`; its `context` is None unless a
    configuration file is being validated.
    """
    if isinstance(value, bool):
        raise ValueError
    is_string_in_file = isinstance(value, str) and info.context is not None
    return int(value) if is_string_in_file and re.fullmatch(r"[-+]?\d+", value) else value


INTEGER, CHOICE = BeforeValidator(_read_integer), BeforeValidator(_read_choice)


@dataclass(frozen=True)
class Parameter:
    """A declared parameter of a constructor or function."""

    annotation: Any
    default: Any = MISSING

    @functools.cached_property
    def raw_description(self) -> str:
        """The description as in the annotation, without symbol and unit."""
        return self._field_info.description or ""

    @functools.cached_property
    def symbol(self) -> str:
        """The symbol in equations, or ""."""
        return self._field_info.title or ""

    @functools.cached_property
    def _field_info(self) -> Any:
        return pydantic.fields.FieldInfo.from_annotation(self.annotation)

    @functools.cached_property
    def numeric_unit(self) -> Unit | None:
        """The unit if the parameter is a real number; None for other types, such as lists."""
        return _get_unit(self.annotation)

    @property
    def unit(self) -> str:
        """Unit of the parameter, or of the numbers in a list; "" if it is dimensionless."""
        annotation = self.annotation
        while (item_type := _item_type(annotation)) is not None:
            annotation = item_type
        unit = _get_unit(annotation)
        return "" if unit is None or unit.unit == "1" else unit.unit

    @property
    def allowed(self) -> str:
        """The allowed values as a noun phrase, such as "a finite number > 0"."""
        return describe_requirement(self.annotation)

    @property
    def long_name(self) -> str:
        """The description up to the first comma, semicolon or =, with a lower-case first letter."""
        name = re.split(r"[;,=]", self.raw_description)[0].strip()
        return name[:1].lower() + name[1:]

    @property
    def description(self) -> str:
        """The description with symbol and unit inserted, such as "Mass m, kg; ..."."""
        name = re.split(r";|\. ", self.raw_description)[0]
        name_and_symbol = " ".join(filter(None, (name, self.symbol)))
        label = ", ".join(filter(None, (name_and_symbol, self.unit)))
        return f"{label}{self.raw_description[len(name) :]}."

    def check(self, name: str, value: Any) -> Any:
        """Return `value` converted to the type of the parameter, or raise an `InputError`.

        `name` is the parameter name in the message. If an entry of a list or dict is invalid, the
        message names that entry, such as "name[2]".
        """
        try:
            return self._adapter.validate_python(value)
        except ValidationError as error:
            path, annotation = resolve_location(self.annotation, error.errors()[0]["loc"])
            for index in path:
                value = value[index]
            allowed = describe_requirement(annotation) + unit_hint(value, annotation)
            raise InputError(f"{name}{format_path(path)}", value, allowed) from None

    @functools.cached_property
    def _adapter(self) -> TypeAdapter:
        return TypeAdapter(self.annotation, config=STRICT)


def check(name: str, value: Any, annotation: Any) -> Any:
    """Return `value` converted to the type of `annotation`, or raise an `InputError`.

    `annotation` is an `Annotated` type with bounds and unit, such as `Stiffness`; `name` is the
    parameter name in the message.
    """
    return _get_parameter(annotation).check(name, value)


_get_parameter = functools.cache(Parameter)


@functools.cache
def declared_parameters(constructor: Any) -> dict[str, Parameter]:
    """Return the parameters declared with an `Annotated` type as a dict: name -> `Parameter`.

    `constructor` is a function, or a dataclass, whose fields are its parameters.
    """
    parameters = {}
    if dataclasses.is_dataclass(constructor):
        for field in dataclasses.fields(constructor):
            has_default = field.default is not dataclasses.MISSING
            parameters[field.name] = Parameter(
                field.type, field.default if has_default else MISSING
            )
    else:
        for name, argument in inspect.signature(inspect.unwrap(constructor)).parameters.items():
            parameters[name] = Parameter(argument.annotation, argument.default)
    return {name: x for name, x in parameters.items() if _is_declared(x.annotation)}


def _is_declared(annotation: Any) -> bool:
    """Return whether an annotation is an `Annotated` type, or a union that contains one."""
    types_in_union = get_args(annotation) if is_union(annotation) else (annotation,)
    return any(get_origin(x) is Annotated for x in types_in_union)


def numeric_parameters(constructor: Any) -> dict[str, Parameter]:
    """Return the declared parameters that are real numbers as a dict: name -> `Parameter`."""
    return {name: x for name, x in declared_parameters(constructor).items() if x.numeric_unit}


def units_and_names(constructor: Any) -> dict[str, tuple[str, str]]:
    """Return a dict: name of a real parameter -> (unit in CF notation, long name).

    `constructor` is a dataclass or a function.
    """
    parameters = numeric_parameters(constructor)
    return {name: (units.cf_units(x.unit), x.long_name) for name, x in parameters.items()}


# Analysis of annotations.


def split_annotation(annotation: Any) -> tuple[Any, tuple]:
    """Split an annotation into its type without metadata and a tuple of its metadata.

    Metadata are the further arguments of `Annotated`, such as bounds and unit, including those of
    nested `Annotated` types, and the bounds inside pydantic fields. An optional type, X | None, is
    treated as X.
    """
    if get_origin(annotation) is Annotated:
        annotated_type, *metadata = get_args(annotation)
        base, inner_metadata = split_annotation(annotated_type)
        fields = [x for x in metadata if isinstance(x, pydantic.fields.FieldInfo)]
        bounds = [bound for field in fields for bound in field.metadata]
        return base, (*inner_metadata, *metadata, *bounds)
    non_none_types = [x for x in get_args(annotation) if x is not types.NoneType]
    if is_union(annotation) and len(non_none_types) == 1:
        return split_annotation(non_none_types[0])
    return annotation, ()


def is_union(annotation: Any) -> bool:
    """Return whether an annotation is a union of types."""
    return get_origin(annotation) in (Union, types.UnionType)


def _item_type(annotation: Any) -> Any:
    """Return the item type of a list or tuple annotation, None for other types."""
    base, _ = split_annotation(annotation)
    return get_args(base)[0] if get_origin(base) in (tuple, list) and get_args(base) else None


def _get_unit(annotation: Any) -> Unit | None:
    """Return the `Unit` in the metadata of an annotated float, None for other types.

    If there are several, the last one is returned, because outer metadata come last and override
    inner ones.
    """
    base, metadata = split_annotation(annotation)
    unit_entries = [x for x in metadata if isinstance(x, Unit)]
    return unit_entries[-1] if unit_entries and base is float else None


def replace_dataclass(annotation: Any, replace: Callable[[type], type]) -> Any:
    """Return the annotation with its type replaced by `replace(type)` if this is a dataclass.

    Metadata are kept. A union is first reduced to its first type that is not a dataclass.
    """
    base, metadata = split_annotation(annotation)
    if is_union(base):
        base = next(x for x in get_args(base) if not dataclasses.is_dataclass(x))
    if dataclasses.is_dataclass(base):
        base = replace(base)
    return Annotated[(base, *metadata)] if metadata else base


def resolve_location(root: Any, location: tuple) -> tuple[tuple, Any]:
    """Convert the `location` of a pydantic error to a path; return (path, annotation).

    `location` is pydantic's tuple of names and indices, starting from the type `root`. Each entry
    of the path leads one level down into a model, dict or list. Other entries of `location` are
    omitted: kinds of sections in a union are skipped, and names that pydantic adds end the path.
    The returned annotation belongs to the value at the end of the path.
    """
    path: list = []
    for name in location:
        base, _ = split_annotation(root)
        if is_union(base) and (section := _find_section(base, name)):
            root = section
            continue
        field = getattr(base, "__pydantic_fields__", {}).get(name)
        if field is not None:
            root = Annotated[(field.annotation, *field.metadata, field)]
        elif get_origin(base) is dict:
            root = get_args(base)[1]
        elif isinstance(name, int) and _item_type(base) is not None:
            root = _item_type(base)
        else:
            break
        path.append(name)
    return tuple(path), root


def _find_section(union: Any, kind: Any) -> Any:
    """Return the configuration section of a union whose key `kind` may be `kind`, or None."""
    sections = (x for x in get_args(union) if kind in get_args(kind_literal([x])))
    return next(sections, None)


def kind_literal(sections: Iterable) -> Any:
    """Return a Literal type of all values that the key `kind` may have in these sections.

    `sections` are alternative pydantic models of the configuration; `kind` selects one of them.
    """
    values: list = []
    for section in sections:
        field = getattr(section, "__pydantic_fields__", {}).get("kind")
        if field:
            values += get_args(field.annotation)
    return Literal[tuple(values)]


def format_path(path: tuple) -> str:
    """Return a path of names and indices as text, such as "scenes.fig6.cases[0]"."""
    return "".join(f"[{x}]" if isinstance(x, int) else f".{x}" for x in path).removeprefix(".")


# Descriptions of allowed values.


def describe_requirement(annotation: Any, in_file: bool = False) -> str:
    """Return a noun phrase for the values that an annotation allows: "a finite number > 0".

    If `in_file`, the phrase is for a configuration file, where numbers may be strings with units.
    """
    base, metadata = split_annotation(annotation)
    for entry in reversed(metadata):
        if isinstance(entry, Allowed):
            return entry.phrase
    origin = get_origin(base)
    if base in (float, int):
        return _describe_number(base, metadata, in_file)
    if base is bool:
        return "true or false" if in_file else "True or False"
    if origin is Literal:
        return f"one of {', '.join(map(str if in_file else repr, get_args(base)))}"
    if origin in (tuple, list):
        return _describe_list(get_args(base)[0], metadata, in_file)
    if origin is dict:
        names = "at least one name" if any(isinstance(x, MinLen) for x in metadata) else "names"
        return f"a mapping of {names} to {describe_requirement(get_args(base)[1], in_file)}"
    if is_union(base):
        alternatives = (x for x in get_args(base) if x is not types.NoneType)
        *phrases, last_phrase = (describe_requirement(x, in_file) for x in alternatives)
        return f"{', '.join(phrases)} or {last_phrase}"
    if base is str:
        return _describe_string(metadata)
    if issubclass(base, pydantic.BaseModel):
        return f"a mapping with the keys {', '.join(base.__pydantic_fields__)}"
    return f"a {base.__name__}"


def _describe_number(base: type, metadata: tuple, in_file: bool) -> str:
    """Return a noun phrase for the allowed numbers, such as "a finite number > 0".

    `base` is int or float; `metadata` are the bounds and unit of an `Annotated` type. If `in_file`,
    the phrase is for a configuration file, where numbers may be strings with units, and states the
    unit.
    """
    unit = next((x for x in reversed(metadata) if isinstance(x, Unit)), Unit("1"))
    bounds = {}
    bound_types = ((Gt, "gt", ">"), (Ge, "ge", ">="), (Lt, "lt", "<"), (Le, "le", "<="))
    for bound_type, attribute, operator in bound_types:
        for entry in metadata:
            if isinstance(entry, bound_type):
                bounds[operator] = _format_bound(getattr(entry, attribute))
    if bounds.keys() >= {">=", "<="}:
        limits = f"from {bounds['>=']} to {bounds['<=']}"
    else:
        limits = " and ".join(f"{operator} {bound}" for operator, bound in bounds.items())
    if base is int:
        noun = "an integer"
    else:
        noun = "a number" if unit.infinity_text else "a finite number"
    note = "(rad)" if unit.unit == "rad" else ""
    if unit.infinity_text:
        note = f"({unit.infinity_text})"
    if in_file and unit.unit != "1":
        infinity = "or .inf, " if unit.infinity_text else ""
        note = f"{infinity}in {unit.unit} or a text with its unit such as {unit.example!r}"
    return " ".join(filter(None, (noun, limits, note)))


def _describe_list(item_type: Any, metadata: tuple, in_file: bool) -> str:
    """Return a noun phrase such as "a list of 2 entries, each a finite number".

    `item_type` is the type of the entries; `metadata` of an `Annotated` type may limit their
    number. If `in_file`, the phrase is for a configuration file, where numbers may be strings with
    units.
    """
    values = next((x for x in metadata if isinstance(x, Values)), Values())
    min_length = next((x.min_length for x in metadata if isinstance(x, MinLen)), 0)
    max_length = next((x.max_length for x in metadata if isinstance(x, MaxLen)), None)
    length = values.count or (min_length if min_length == max_length else None)
    if length:
        entries = f"{length} entries"
    else:
        entries = "at least one entry" if min_length else "entries"
    alternative = "one value or " if values.repeat else ""
    return f"{alternative}a list of {entries}, each {describe_requirement(item_type, in_file)}"


def _describe_string(metadata: tuple) -> str:
    """Return a noun phrase for strings whose pattern or maximum length is limited by `metadata`."""
    for entry in metadata:
        if pattern := getattr(entry, "pattern", None):
            return f"a text matching {pattern}"
        if isinstance(entry, MaxLen):
            return f"a text of 1 to {entry.max_length} characters"
    return "a text"


def _format_bound(value: float) -> str:
    """Format the bound of a number; angles become fractions of pi, such as "pi / 2"."""
    if value == math.tau:
        return "2 pi"
    for n in (2, 3, 4):
        if abs(value) == math.pi / n:
            return f"{'-' * (value < 0.0)}pi / {n}"
    return f"{value:g}" if isinstance(value, float) else str(value)


# Models and functions with declared parameters.


@dataclass_transform(frozen_default=True, kw_only_default=True)
def declared(*, kw_only: bool = True) -> Callable[[type[_T]], type[_T]]:
    """Return a decorator that turns a class into an immutable dataclass with checked fields.

    An invalid value raises an `InputError`. A table of the parameters is added to the docstring of
    the class. If `kw_only`, all arguments are keyword-only.
    """

    def decorate(cls: type[_T]) -> type[_T]:
        """Return the checked dataclass that is made from `cls`."""
        dataclass_type = pydantic.dataclasses.dataclass(
            frozen=True, kw_only=kw_only, config=STRICT
        )(cls)
        initialize = dataclass_type.__init__
        names = [field.name for field in dataclasses.fields(dataclass_type)]

        def __init__(self, *args, **arguments):
            """Initialize the dataclass; convert an error of pydantic to an `InputError`."""
            try:
                initialize(self, *args, **arguments)
            except ValidationError as error:
                named_arguments = dict(zip(names, args, strict=False)) | arguments
                raise _convert_error(error, dataclass_type, named_arguments) from None

        # Documentation tools look for the source code in this module.
        __init__.__module__ = cls.__module__
        dataclass_type.__init__ = __init__
        return add_parameter_table(dataclass_type)

    return decorate


def _convert_error(error: ValidationError, cls: type, arguments: dict) -> Exception:
    """Convert the first error of pydantic to an `InputError`, or to a TypeError for a wrong name.

    `cls` is the dataclass, `arguments` maps names to its arguments. An error that `__post_init__`
    raised is returned unchanged.
    """
    details = error.errors(include_url=False)[0]
    location, cause = details["loc"], details.get("ctx", {}).get("error")
    if not location and cause is not None:
        return cause  # raised by `__post_init__`
    names, problem = list(arguments), details["type"].replace("_", " ")
    if isinstance(location[0], int) and "unexpected" not in problem:
        # pydantic gives the position of a positional argument; replace it by the name.
        location = names[location[0]], *location[1:]
    path, annotation = resolve_location(cls, location)
    if problem == "missing" or not path:
        known_names = ", ".join(field.name for field in dataclasses.fields(cls))
        message = f"{cls.__name__}: {problem} {location[0]!r}; its parameters are {known_names}"
        return TypeError(message)
    value = arguments.get(path[0])
    for index in path[1:]:
        value = value[index] if isinstance(value, tuple | list) else details["input"]
    # Parts of a gear train (bodies, meshes) have names, which identify them in the message.
    name = arguments.get("name")
    owner = f"{cls.__name__.lower()} {name}" if isinstance(name, str) else ""
    allowed = describe_requirement(annotation) + unit_hint(value, annotation)
    return InputError(format_path(path), value, allowed, owner=owner)


def checked(function: Callable) -> Callable:
    """Decorate a function so that arguments with an `Annotated` type are checked and documented.

    Defaults are not checked. Loops can call the undecorated `function.__wrapped__` to save the time
    of the checks.
    """
    parameters = declared_parameters(function)
    positional_names = inspect.getfullargspec(function).args

    def check_argument(name: str, value: Any) -> Any:
        """Return `value` converted to the declared type of the argument `name`.

        Defaults and arguments without a declared type are returned unchecked.
        """
        parameter = parameters.get(name)
        if parameter is None or value is parameter.default:
            return value
        return parameter.check(name, value)

    @functools.wraps(function)
    def call(*args, **arguments):
        """Call the function with checked arguments; excess positional arguments are unchecked."""
        checked_args = map(check_argument, positional_names, args)
        arguments = {name: check_argument(name, value) for name, value in arguments.items()}
        return function(*checked_args, *args[len(positional_names) :], **arguments)

    return add_parameter_table(call)


#: Section appended to docstrings that lack a section "Raises".
_RAISES_SECTION = """

Raises
------
ValueError
    If a value is impossible; the message names parameter, value and range."""


def add_parameter_table(constructor: Any) -> Any:
    """Add a table of declared parameters to the docstring of a class or function and return it.

    A docstring that already has a section "Parameters" is not changed. In the signature, which
    `help` shows, annotations are replaced by plain types without bounds and units.
    """
    text, parameters = inspect.getdoc(constructor) or "", declared_parameters(constructor)
    if "\nParameters\n---" not in text and any(x.raw_description for x in parameters.values()):
        lines = ["", "Parameters", "----------"]
        for name, parameter in parameters.items():
            if parameter.default is MISSING:
                default = ""
            elif parameter.default is None:
                default = ", optional"
            else:
                default = f", default {parameter.default!r}"
            lines.append(f"{name} : {parameter.allowed}{default}")
            lines.append(textwrap.indent(textwrap.fill(parameter.description, 92), "    "))
        summary, heading, errors = text.partition("\n\nRaises\n---")
        constructor.__doc__ = "\n".join([summary, *lines]) + (heading + errors or _RAISES_SECTION)
    signature = inspect.signature(constructor)
    plain_parameters = [
        x.replace(annotation=_strip_metadata(x.annotation)) for x in signature.parameters.values()
    ]
    constructor.__signature__ = signature.replace(parameters=plain_parameters)
    if inspect.isclass(constructor):
        self_parameter = inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY)
        initialize: Any = constructor.__init__
        initialize.__signature__ = signature.replace(parameters=[self_parameter, *plain_parameters])
    return constructor


def _strip_metadata(annotation: Any) -> Any:
    """Return the annotation without the metadata of `Annotated` types, also those of list items."""
    base, item_type = split_annotation(annotation)[0], _item_type(annotation)
    if item_type is None:
        return base
    return get_origin(base)[(_strip_metadata(item_type), *get_args(base)[1:])]


#: Conversion factors to SI for units in which geometry is often given by mistake.
_GEOMETRY_UNITS = {"mm": 1e-3, "um": 1e-6, "deg": math.pi / 180.0}


def unit_hint(value: Any, annotation: Any) -> str:
    """Return a hint for an invalid value, such as "; did you mean 3 mm?", or "" if there is none.

    A common mistake is a length in mm or an angle in degrees instead of SI units. The hint is given
    if the number exceeds its upper bound, but would not in the unit of the annotation's example.
    For an integer that compiled code cannot store, the hint is the largest allowed integer.
    """
    base, metadata = split_annotation(annotation)
    is_bounded = any(isinstance(x, Le) for x in metadata)
    if base is int and not is_bounded and isinstance(value, Integral) and int(value) > _MAX_INTEGER:
        return f" and <= {_MAX_INTEGER}"
    unit = next((x.example.partition(" ")[2] for x in metadata if isinstance(x, Unit)), "")
    if unit not in _GEOMETRY_UNITS or isinstance(value, bool) or not isinstance(value, Real):
        return ""
    scaled = float(value) * _GEOMETRY_UNITS[unit]
    for entry in metadata:
        if isinstance(entry, Le | Lt):
            bound: Any = entry.le if isinstance(entry, Le) else entry.lt
            if scaled <= bound < value:
                return f"; did you mean {float(value):g} {unit}?"
    return ""


# Annotated types of parameters.

Finite = Annotated[float, Unit("1")]
Positive = Annotated[float, Gt(0), Unit("1")]
NonNegative = Annotated[float, Ge(0), Unit("1")]
Angle = Annotated[float, Unit("rad", "30 deg")]
#: Working pressure angle.
WorkingAngle = Annotated[float, Ge(0), Lt(math.pi / 2), Unit("rad", "20 deg")]
Fraction = Annotated[float, Ge(0), Le(1), Unit("1")]
#: Damping ratio of gears that oscillate.
BelowCritical = Annotated[float, Ge(0), Lt(1), Unit("1")]
Length = Annotated[float, Gt(0), Unit("m", "100 mm")]
#: Dimensions of gears; larger numbers must be in another unit by mistake.
Module = Annotated[float, Gt(0), Le(0.1), Unit("m", "2.5 mm")]
Width = Annotated[float, Gt(0), Le(2), Unit("m", "20 mm")]
Diameter = Annotated[float, Gt(0), Le(20), Unit("m", "100 mm")]
Bore = Annotated[float, Ge(0), Le(20), Unit("m", "30 mm")]
Relief = Annotated[float, Ge(0), Le(0.1), Unit("m", "10 um")]
ReliefLength = Annotated[float, Gt(0), Le(0.5), Unit("m", "4 mm")]
RunOut = Annotated[float, Ge(0), Unit("m", "10 um")]
Error = Annotated[float, Unit("m", "10 um")]
Stiffness = Annotated[float, Gt(0), Unit("N/m", "4e5 N/mm")]
#: Stiffness of a support.
Support = Annotated[float, Ge(0), Unit("N/m", "1 kN/um", "infinity: rigid")]
ShaftStiffness = Annotated[float, Gt(0), Unit("N m/rad", "1 MN m/rad")]
Mass = Annotated[float, Gt(0), Unit("kg", "3123 g")]
Inertia = Annotated[float, Gt(0), Unit("kg m^2", "978.52 kg cm^2")]
Power = Annotated[float, Gt(0), Unit("W", "30 kW")]
Speed = Annotated[float, Gt(0), Unit("rpm", "2000 rpm")]
Load = Annotated[float, Gt(0), Unit("N", "3.3 kN")]
Force = Annotated[float, Unit("N", "2 kN")]
Torque = Annotated[float, Unit("N m", "200 N m")]
DrivingTorque = Annotated[float, Gt(0), Unit("N m", "302 N m")]
Damping = Annotated[float, Ge(0), Unit("N s/m", "3.95 N s/mm")]
TwistDamping = Annotated[float, Ge(0), Unit("N m s/rad", "10 N m s/rad")]
Time = Annotated[float, Ge(0), Unit("s", "1 us")]
Teeth = Annotated[int, Ge(3), Le(100_000), INTEGER]
Count = Annotated[int, Ge(1), INTEGER]
#: Number of samples of a mesh period, for gears given by geometry.
Phases = Annotated[int, Ge(8), Le(100_000), INTEGER]
WholeNumber = Annotated[int, Ge(0), INTEGER]
Boolean = Annotated[bool, BeforeValidator(_read_boolean)]
#: Name of a part.
Text = Annotated[str, MinLen(1)]
#: Limits of an interval, and numbers in a table.
Limits = Annotated[tuple[Finite, ...], Values(2)]
Numbers = Annotated[tuple[Finite, ...], Values(), MinLen(1)]
#: Initial state.
State = Annotated[
    tuple[Finite, ...],
    Values(2),
    Allowed("a list of 2 entries, each a finite number (displacement, dx/dtau)"),
]

# Parameters of several models.

MaxStiffness = Annotated[Stiffness, described("Maximum mesh stiffness", "C_max")]
StiffnessRatio = Annotated[
    float, Gt(0), Le(1), Unit("1"), described("Stiffness ratio kappa", "= C_min / C_max")
]
ContactRatio = Annotated[
    float,
    Ge(1),
    Le(2),
    Unit("1"),
    described("Contact ratio epsilon; both ends mean constant stiffness"),
]
Backlash = Annotated[
    float,
    Ge(0),
    Unit("m", "40 um", "infinity included"),
    described("Backlash; infinite without a second flank", "s_k"),
]
#: None if unknown, which is allowed as long as nothing moves.
MaterialDamping = Annotated[Damping | None, described("Damping of the material in contact", "k_1")]
BacklashDamping = Annotated[Damping, described("Damping of the oil in free flight", "k_1m")]
PressureAngle = Annotated[WorkingAngle, described("Pressure angle in operation")]

# Damping of gears given by geometry; at most one of the first three is given.
DampingRatio = Annotated[NonNegative | None, described("Damping ratio in contact, beta")]
Decrement = Annotated[
    NonNegative | None,
    described("delta = 2 pi beta / sqrt(1 - beta^2), in place of damping_ratio"),
]
ContactDamping = Annotated[Damping | None, described("k_1 in contact, in place of damping_ratio")]
BacklashDampingRatio = Annotated[NonNegative, described("Damping ratio in free flight, beta_m")]

#: Integration method -> its module in `gearlib.integrators`, imported on first use.
METHOD_MODULES = {
    "exact": "method",
    "taylor": "method",
    "rk4": "fixed_steps",
    "rk45": "embedded_pair",
    "newmark": "fixed_steps",
    "generalised_alpha": "fixed_steps",
    "scipy": "scipy_ivp",
    "smoothed": "embedded_pair",
    "heyoka": "heyoka",
}
MethodName = Literal[*METHOD_MODULES]  # type: ignore[valid-type]

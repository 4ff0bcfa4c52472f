"""Declarations of parameters: type, unit, allowed values, description and symbol in one annotation.

    max_stiffness: Annotated[Stiffness, described("Maximum mesh stiffness", "C_max")]

pydantic checks the annotations of models (`declared`) and functions (`checked`). Docstrings, tables
of the documentation, sections of the configuration with their schema, options of commands and
sliders are made from the annotations. This module loads no numerical stack.
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

#: Largest integer of compiled code.
_MAX_INTEGER = 2**63 - 1
#: Default of a required parameter.
MISSING = inspect.Parameter.empty
#: Wrong values are refused rather than converted, and so are unknown names.
STRICT = ConfigDict(strict=True, extra="forbid", arbitrary_types_allowed=True)


def described(text: str, symbol: str = "") -> Any:
    """Return the part of an annotation that describes a parameter, with its symbol."""
    return Field(description=text, title=symbol or None)


# Parts of annotations that read values. A text may stand for a number only in a configuration,
# whose validation has a context.


@dataclass(frozen=True)
class Unit:
    """The SI unit of a real number, or "1".

    `example` is a value in another unit, as a configuration may have it. `infinite` says what
    infinity means, "" if it is not allowed.
    """

    unit: str
    example: str = ""
    infinite: str = ""

    def read(self, value: Any, info: ValidationInfo | None = None) -> float:
        """Return a real number as float, or raise ValueError if `value` is not allowed.

        In a configuration file, `value` may also be a string with a unit, such as "3 kN". pydantic
        passes `info`, whose `context` is None except when a configuration file is validated.
        """
        if isinstance(value, str) and info is not None and info.context is not None:
            try:
                value = self._number_of(value)
            except ValueError:
                # The error needs no message: `Parameter.check` writes it from the annotation.
                raise ValueError from None
        if isinstance(value, Real) and not isinstance(value, bool):
            with contextlib.suppress(OverflowError):
                number = float(value)
                if math.isfinite(number) or (self.infinite and not math.isnan(number)):
                    return number
        raise ValueError

    def _number_of(self, text: str) -> float:
        """Return the number that the string `text` stands for, in the unit `self.unit`.

        Return NaN or raise ValueError if it stands for none. Numbers without a unit are also
        accepted, because YAML reads some numbers, such as 4e8, as strings.
        """
        if self.infinite and text == ".inf":
            return math.inf
        if units.NUMBER.fullmatch(text):
            return float(text)
        return math.nan if self.unit == "1" else units.read(text, self.unit)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return the pydantic schema that calls `read` before other checks of the type `source`."""
        return core_schema.with_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict:
        """Return the JSON schema of the number, which may also be a string if it has a unit."""
        node = handler(schema)
        if self.unit != "1":
            node |= {"type": ["number", "string"], "pattern": f"^{units.TEXT.pattern}$"}
        return node


@dataclass(frozen=True)
class Allowed:
    """The allowed values in words, where the type does not say them."""

    words: str


@dataclass(frozen=True)
class Values:
    """A sequence of values, whose number must be `count` if this is given.

    With `repeat` a single value stands for `count` equal values.
    """

    count: int | None = None
    repeat: bool = False

    def read(self, values: Any) -> tuple | None:
        """Return values as a tuple, or raise ValueError if they are not as many as required.

        `self.count` is the required number, None for any number. With `self.repeat`, a single value
        stands for `count` equal values.
        """
        if values is None:
            return None  # The type decides whether None is allowed.
        if self.repeat and not isinstance(values, (tuple, list)):
            values = (values,) * (self.count or 1)
        try:
            return tuple(checks.check_sequence("", values, self.count))
        except InputError:
            # The error needs no message: `Parameter.check` writes it from the annotation.
            raise ValueError from None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return the pydantic schema that calls `read` before other checks of the type `source`."""
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict:
        """Return the JSON schema of the sequence, with the number of its entries if it is fixed."""
        node = handler(schema)
        return node | ({"minItems": self.count, "maxItems": self.count} if self.count else {})


def _read_integer(value: Any, info: ValidationInfo) -> int:
    """Return an integer as int, or raise ValueError if `value` is none, or too large.

    In a configuration file, a string such as "12" also counts as an integer. pydantic passes
    `info`, whose `context` is None except when a configuration file is validated.
    """
    if isinstance(value, str) and info.context is not None and re.fullmatch(r"[-+]?\d+", value):
        value = int(value)
    if not isinstance(value, Integral) or isinstance(value, bool) or int(value) > _MAX_INTEGER:
        raise ValueError
    return int(value)


def _read_boolean(value: Any, info: ValidationInfo) -> Any:
    """Return True or False for the strings "true" and "false" of a configuration file.

    All other values are returned unchanged; pydantic then checks them. It passes `info`, whose
    `context` is None except when a configuration file is validated.
    """
    if isinstance(value, str) and info.context is not None:
        return {"true": True, "false": False}.get(value.lower(), value)
    return value


def _read_choice(value: Any, info: ValidationInfo) -> Any:
    """Return `value` in the type in which pydantic compares it with the choices of a parameter.

    In a configuration file, a string such as "12" becomes an integer. pydantic passes `info`, whose
    `context` is None except when a configuration file is validated. Booleans raise ValueError,
    because Python counts True as equal to the choice 1.
    """
    if isinstance(value, bool):
        raise ValueError
    is_text = isinstance(value, str) and info.context is not None
    return int(value) if is_text and re.fullmatch(r"[-+]?\d+", value) else value


INTEGER, CHOICE = BeforeValidator(_read_integer), BeforeValidator(_read_choice)


@dataclass(frozen=True)
class Parameter:
    """A declared parameter of a constructor or function."""

    annotation: Any
    default: Any = MISSING

    @functools.cached_property
    def text(self) -> str:
        """The description."""
        return self._field.description or ""

    @functools.cached_property
    def symbol(self) -> str:
        """The symbol, or ""."""
        return self._field.title or ""

    @functools.cached_property
    def _field(self) -> Any:
        return pydantic.fields.FieldInfo.from_annotation(self.annotation)

    @functools.cached_property
    def number(self) -> Unit | None:
        """The unit of a real number; None for a parameter of another type, such as a list."""
        return _unit_of(self.annotation)

    @property
    def unit(self) -> str:
        """Unit of the parameter, or of the numbers in a list; "" if it is dimensionless."""
        annotation = self.annotation
        while (item := _item_of(annotation)) is not None:
            annotation = item
        number = _unit_of(annotation)
        return "" if number is None or number.unit == "1" else number.unit

    @property
    def allowed(self) -> str:
        """The allowed values in words."""
        return requirement(self.annotation)

    @property
    def long_name(self) -> str:
        """Short name: the description up to a comma, semicolon or =, with a small first letter."""
        name = re.split(r"[;,=]", self.text)[0].strip()
        return name[:1].lower() + name[1:]

    @property
    def description(self) -> str:
        """Sentence with name, symbol, unit and the rest of the description: "Mass m, kg; ..."."""
        name = re.split(r";|\. ", self.text)[0]
        name_and_symbol = " ".join(filter(None, (name, self.symbol)))
        return f"{', '.join(filter(None, (name_and_symbol, self.unit)))}{self.text[len(name) :]}."

    def check(self, name: str, value: Any) -> Any:
        """Return a value converted to the type of the parameter, or raise an `InputError`.

        `name` is the place of the value in the message. If an entry of a list or dict is wrong, the
        message names the entry, such as "name[2]".
        """
        try:
            return self._adapter.validate_python(value)
        except ValidationError as error:
            path, annotation = place_of(self.annotation, error.errors()[0]["loc"])
            for index in path:
                value = value[index]
            allowed = requirement(annotation) + unit_hint(value, annotation)
            raise InputError(f"{name}{dotted(path)}", value, allowed) from None

    @functools.cached_property
    def _adapter(self) -> TypeAdapter:
        return TypeAdapter(self.annotation, config=STRICT)


def check(name: str, value: Any, annotation: Any) -> Any:
    """Return a value converted to the type of an annotation, or raise an `InputError`.

    `annotation` is an `Annotated` type with bounds and unit, such as `Stiffness`; `name` is the
    name of the value in the message.
    """
    return _parameter_of(annotation).check(name, value)


_parameter_of = functools.cache(Parameter)


@functools.cache
def declared_parameters(constructor: Any) -> dict[str, Parameter]:
    """Return a dict: name -> `Parameter` of each parameter declared with an `Annotated` type.

    `constructor` is a dataclass, whose fields are its parameters, or a function.
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
    """Return whether an annotation, or one of the types of a union, is an `Annotated` type."""
    options = get_args(annotation) if is_union(annotation) else (annotation,)
    return any(get_origin(option) is Annotated for option in options)


def numeric_parameters(constructor: Any) -> dict[str, Parameter]:
    """Return a dict: name -> `Parameter` of each declared parameter that is a real number."""
    return {name: x for name, x in declared_parameters(constructor).items() if x.number}


def units_and_names(constructor: Any) -> dict[str, tuple[str, str]]:
    """Return a dict: name -> (unit in CF notation, long name) of each declared real number.

    `constructor` is a dataclass or a function.
    """
    numeric = numeric_parameters(constructor)
    return {name: (units.cf_units(x.unit), x.long_name) for name, x in numeric.items()}


# Parts of annotations.


def parts(annotation: Any) -> tuple[Any, tuple]:
    """Split an annotation into its type without metadata, and a tuple of all its metadata.

    Metadata are the further arguments of `Annotated`, such as bounds and unit, also of nested
    `Annotated` types, and the bounds inside pydantic fields. An optional type (X or None) counts as
    X.
    """
    if get_origin(annotation) is Annotated:
        annotated_type, *metadata = get_args(annotation)
        base, inner_metadata = parts(annotated_type)
        fields = [x for x in metadata if isinstance(x, pydantic.fields.FieldInfo)]
        bounds = [bound for field in fields for bound in field.metadata]
        return base, (*inner_metadata, *metadata, *bounds)
    options = [x for x in get_args(annotation) if x is not types.NoneType]
    if is_union(annotation) and len(options) == 1:
        return parts(options[0])
    return annotation, ()


def is_union(annotation: Any) -> bool:
    """Return whether an annotation is a union of types."""
    return get_origin(annotation) in (Union, types.UnionType)


def _item_of(annotation: Any) -> Any:
    """Return the type of the items if an annotation is a list or tuple, else None."""
    base, _ = parts(annotation)
    return get_args(base)[0] if get_origin(base) in (tuple, list) and get_args(base) else None


def _unit_of(annotation: Any) -> Unit | None:
    """Return the `Unit` in the metadata of an annotated float, None for other types.

    If there are several, the last one counts, because outer metadata come last and override inner
    ones.
    """
    base, metadata = parts(annotation)
    unit_parts = [x for x in metadata if isinstance(x, Unit)]
    return unit_parts[-1] if unit_parts and base is float else None


def replace_class(annotation: Any, replace: Callable[[type], type]) -> Any:
    """Return an annotation in which the dataclass of a part has been replaced by another class.

    A part is a dataclass inside a model, such as a tip relief; `replace` maps its class to the new
    one. In a union, None is dropped, and other types are preferred to dataclasses.
    """
    base, metadata = parts(annotation)
    if is_union(base):
        base = next(x for x in get_args(base) if not dataclasses.is_dataclass(x))
    if dataclasses.is_dataclass(base):
        base = replace(base)
    return Annotated[(base, *metadata)] if metadata else base


def place_of(root: Any, location: tuple) -> tuple[tuple, Any]:
    """Convert the location of an error from pydantic to a path; return (path, annotation).

    `root` is the type in which pydantic's tuple `location` of names and indices starts. Each entry
    of the path leads one level down into a model, dict or list. Entries of `location` that are no
    keys of the user, such as the name of a type in a union, are skipped or end the path. The
    returned annotation belongs to the value at the end of the path.
    """
    path: list = []
    for name in location:
        base, _ = parts(root)
        if is_union(base) and (section := _section_of_kind(base, name)):
            root = section
            continue
        field = getattr(base, "__pydantic_fields__", {}).get(name)
        if field is not None:
            root = Annotated[(field.annotation, *field.metadata, field)]
        elif get_origin(base) is dict:
            root = get_args(base)[1]
        elif isinstance(name, int) and _item_of(base) is not None:
            root = _item_of(base)
        else:
            break
        path.append(name)
    return tuple(path), root


def _section_of_kind(union: Any, kind: Any) -> Any:
    """Return the configuration section in a union whose key `kind` allows this value, or None."""
    sections = (x for x in get_args(union) if kind in get_args(kinds([x])))
    return next(sections, None)


def kinds(sections: Iterable) -> Any:
    """Return a Literal type of all values that the key `kind` has in some configuration sections.

    Sections are pydantic models; the value of `kind` decides which of them applies.
    """
    values: list = []
    for section in sections:
        field = getattr(section, "__pydantic_fields__", {}).get("kind")
        if field:
            values += get_args(field.annotation)
    return Literal[tuple(values)]


def dotted(path: tuple) -> str:
    """Return a path of names and indices as text, such as "scenes.fig6.cases[0]"."""
    return "".join(f"[{x}]" if isinstance(x, int) else f".{x}" for x in path).removeprefix(".")


# Allowed values in words.


def requirement(annotation: Any, in_file: bool = False) -> str:
    """Return in words which values an annotation allows, such as "a finite number > 0".

    With `in_file` the words are about a configuration file, where numbers may be strings with
    units.
    """
    base, metadata = parts(annotation)
    for part in reversed(metadata):
        if isinstance(part, Allowed):
            return part.words
    origin = get_origin(base)
    if base in (float, int):
        return _number_in_words(base, metadata, in_file)
    if base is bool:
        return "true or false" if in_file else "True or False"
    if origin is Literal:
        return f"one of {', '.join(map(str if in_file else repr, get_args(base)))}"
    if origin in (tuple, list):
        return _list_in_words(get_args(base)[0], metadata, in_file)
    if origin is dict:
        names = "at least one name" if any(isinstance(x, MinLen) for x in metadata) else "names"
        return f"a mapping of {names} to {requirement(get_args(base)[1], in_file)}"
    if is_union(base):
        options = (x for x in get_args(base) if x is not types.NoneType)
        *others, last = (requirement(option, in_file) for option in options)
        return f"{', '.join(others)} or {last}"
    if base is str:
        return _text_in_words(metadata)
    if issubclass(base, pydantic.BaseModel):
        return f"a mapping with the keys {', '.join(base.__pydantic_fields__)}"
    return f"a {base.__name__}"


def _number_in_words(base: type, metadata: tuple, in_file: bool) -> str:
    """Return in words which numbers are allowed, such as "a finite number > 0", with their unit.

    `base` is int or float; `metadata` are the entries of an `Annotated` type, with bounds and unit.
    With `in_file` the words are about a configuration file, where numbers may be strings with
    units.
    """
    unit = next((x for x in reversed(metadata) if isinstance(x, Unit)), Unit("1"))
    texts = {}
    for kind, name, sign in ((Gt, "gt", ">"), (Ge, "ge", ">="), (Lt, "lt", "<"), (Le, "le", "<=")):
        for bound in metadata:
            if isinstance(bound, kind):
                texts[sign] = _bound_in_words(getattr(bound, name))
    if texts.keys() >= {">=", "<="}:
        limits = f"from {texts['>=']} to {texts['<=']}"
    else:
        limits = " and ".join(f"{sign} {text}" for sign, text in texts.items())
    if base is int:
        noun = "an integer"
    else:
        noun = "a number" if unit.infinite else "a finite number"
    note = "(rad)" if unit.unit == "rad" else ""
    if unit.infinite:
        note = f"({unit.infinite})"
    if in_file and unit.unit != "1":
        infinity = "or .inf, " if unit.infinite else ""
        note = f"{infinity}in {unit.unit} or a text with its unit such as {unit.example!r}"
    return " ".join(filter(None, (noun, limits, note)))


def _list_in_words(item: Any, metadata: tuple, in_file: bool) -> str:
    """Return in words which lists are allowed, such as "a list of 2 entries, each a finite number".

    `item` is the type of the entries; `metadata` are the entries of an `Annotated` type, which may
    limit their number. With `in_file` the words are about a configuration file, where numbers may
    be strings with units.
    """
    values = next((x for x in metadata if isinstance(x, Values)), Values())
    min_length = next((x.min_length for x in metadata if isinstance(x, MinLen)), 0)
    max_length = next((x.max_length for x in metadata if isinstance(x, MaxLen)), None)
    length = values.count or (min_length if min_length == max_length else None)
    if length:
        entries = f"{length} entries"
    else:
        entries = "at least one entry" if min_length else "entries"
    single = "one value or " if values.repeat else ""
    return f"{single}a list of {entries}, each {requirement(item, in_file)}"


def _text_in_words(metadata: tuple) -> str:
    """Return in words which strings `metadata` allow by a pattern or a largest length."""
    for part in metadata:
        if pattern := getattr(part, "pattern", None):
            return f"a text matching {pattern}"
        if isinstance(part, MaxLen):
            return f"a text of 1 to {part.max_length} characters"
    return "a text"


def _bound_in_words(value: float) -> str:
    """Return the bound of a number as a string: fractions of pi for angles, such as "pi / 2"."""
    if value == math.tau:
        return "2 pi"
    for n in (2, 3, 4):
        if abs(value) == math.pi / n:
            return f"{'-' * (value < 0.0)}pi / {n}"
    return f"{value:g}" if isinstance(value, float) else str(value)


# Models and functions with declared parameters.


@dataclass_transform(frozen_default=True, kw_only_default=True)
def declared(*, kw_only: bool = True) -> Callable[[type[_T]], type[_T]]:
    """Return a decorator that makes an immutable dataclass whose fields pydantic checks.

    A wrong value raises an `InputError`. A table of the parameters is added to the docstring of the
    class. With `kw_only` all arguments are keyword arguments.
    """

    def decorate(cls: type[_T]) -> type[_T]:
        """Return the checked dataclass that replaces the class `cls` with annotated fields."""
        dataclass_type = pydantic.dataclasses.dataclass(
            frozen=True, kw_only=kw_only, config=STRICT
        )(cls)
        initialize = dataclass_type.__init__
        names = [field.name for field in dataclasses.fields(dataclass_type)]

        def __init__(self, *args, **arguments):
            """Initialize the dataclass; raise the error of pydantic as an `InputError`."""
            try:
                initialize(self, *args, **arguments)
            except ValidationError as error:
                named_arguments = dict(zip(names, args, strict=False)) | arguments
                raise _input_error(error, dataclass_type, named_arguments) from None

        __init__.__module__ = cls.__module__  # Tools that read the code look for its source there.
        dataclass_type.__init__ = __init__
        return documented(dataclass_type)

    return decorate


def _input_error(error: ValidationError, cls: type, arguments: dict) -> Exception:
    """Convert the first error of pydantic to an `InputError`, or to a TypeError for a wrong name.

    `cls` is the dataclass that was called, `arguments` are its arguments by name. An error that the
    class itself raised in `__post_init__` is returned unchanged.
    """
    details = error.errors(include_url=False)[0]
    location, cause = details["loc"], details.get("ctx", {}).get("error")
    if not location and cause is not None:
        return cause  # It was raised by `__post_init__`.
    names, problem = list(arguments), details["type"].replace("_", " ")
    if isinstance(location[0], int) and "unexpected" not in problem:
        # pydantic gives the number of a positional argument, which is replaced by its name.
        location = names[location[0]], *location[1:]
    path, annotation = place_of(cls, location)
    if problem == "missing" or not path:
        known = ", ".join(field.name for field in dataclasses.fields(cls))
        return TypeError(f"{cls.__name__}: {problem} {location[0]!r}; its parameters are {known}")
    value = arguments.get(path[0])
    for index in path[1:]:
        value = value[index] if isinstance(value, tuple | list) else details["input"]
    # The parts of a gear train (bodies and meshes) have names, which the message can state.
    name = arguments.get("name")
    owner = f"{cls.__name__.lower()} {name}" if isinstance(name, str) else ""
    allowed = requirement(annotation) + unit_hint(value, annotation)
    return InputError(dotted(path), value, allowed, owner=owner)


def checked(function: Callable) -> Callable:
    """Decorate a function so that arguments with an `Annotated` type are checked and documented.

    Defaults are not checked. Loops may call the undecorated function, `function.__wrapped__`, to
    save the time of the checks.
    """
    parameters = declared_parameters(function)
    positional_names = inspect.getfullargspec(function).args

    def checked_value(name: str, value: Any) -> Any:
        """Return the value of the argument `name`, converted to its declared type if it has one.

        A default is returned without a check.
        """
        parameter = parameters.get(name)
        if parameter is None or value is parameter.default:
            return value
        return parameter.check(name, value)

    @functools.wraps(function)
    def call(*args, **arguments):
        """Call the function with checked arguments, surplus positional ones unchecked."""
        checked_args = map(checked_value, positional_names, args)
        arguments = {name: checked_value(name, value) for name, value in arguments.items()}
        return function(*checked_args, *args[len(positional_names) :], **arguments)

    return documented(call)


#: End of a docstring without a section "Raises".
_RAISES = """

Raises
------
ValueError
    If a value is impossible; the message names parameter, value and range."""


def documented(constructor: Any) -> Any:
    """Add a table of declared parameters to the docstring of a class or function, and return it.

    A docstring that already has a section "Parameters" stays unchanged. In the signature,
    annotations are replaced by plain types without bounds and units, which `help` shows.
    """
    text, parameters = inspect.getdoc(constructor) or "", declared_parameters(constructor)
    if "\nParameters\n---" not in text and any(x.text for x in parameters.values()):
        lines = ["", "Parameters", "----------"]
        for name, parameter in parameters.items():
            default = "" if parameter.default is MISSING else f", default {parameter.default!r}"
            default = ", optional" if parameter.default is None else default
            lines.append(f"{name} : {parameter.allowed}{default}")
            lines.append(textwrap.indent(textwrap.fill(parameter.description, 92), "    "))
        summary, raises, errors = text.partition("\n\nRaises\n---")
        constructor.__doc__ = "\n".join([summary, *lines]) + (raises + errors or _RAISES)
    signature = inspect.signature(constructor)
    plain_parameters = [
        x.replace(annotation=_plain(x.annotation)) for x in signature.parameters.values()
    ]
    constructor.__signature__ = signature.replace(parameters=plain_parameters)
    if inspect.isclass(constructor):
        self_parameter = inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY)
        initialize: Any = constructor.__init__
        initialize.__signature__ = signature.replace(parameters=[self_parameter, *plain_parameters])
    return constructor


def _plain(annotation: Any) -> Any:
    """Return a type, and the type of its items if it is a list or tuple, without metadata.

    Metadata are the bounds, units and descriptions of `Annotated` types.
    """
    base, item = parts(annotation)[0], _item_of(annotation)
    return base if item is None else get_origin(base)[(_plain(item), *get_args(base)[1:])]


#: Factors to SI of the units of gear geometry, in which numbers are often given by mistake.
_GEOMETRY_UNITS = {"mm": 1e-3, "um": 1e-6, "deg": math.pi / 180.0}


def unit_hint(value: Any, annotation: Any) -> str:
    """Return a hint on a wrong value such as "; did you mean 3 mm?", "" if there is none.

    The usual mistake is a length in mm or an angle in degrees where SI units are expected. There is
    a hint if the number is above its upper bound, but within it when read in the unit of the
    example in the annotation. For an integer that compiled code cannot store, the hint is the
    largest integer.
    """
    base, metadata = parts(annotation)
    is_bounded = any(isinstance(part, Le) for part in metadata)
    if base is int and not is_bounded and isinstance(value, Integral) and int(value) > _MAX_INTEGER:
        return f" and <= {_MAX_INTEGER}"
    unit = next((x.example.partition(" ")[2] for x in metadata if isinstance(x, Unit)), "")
    if unit not in _GEOMETRY_UNITS or isinstance(value, bool) or not isinstance(value, Real):
        return ""
    scaled = float(value) * _GEOMETRY_UNITS[unit]
    for part in metadata:
        if isinstance(part, Le | Lt):
            bound: Any = part.le if isinstance(part, Le) else part.lt
            if scaled <= bound < value:
                return f"; did you mean {float(value):g} {unit}?"
    return ""


# Types of parameters.

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
#: Dimensions of gear geometry; larger numbers must have been meant in another unit.
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
#: Phases of a mesh period of gears given by geometry.
Phases = Annotated[int, Ge(8), Le(100_000), INTEGER]
WholeNumber = Annotated[int, Ge(0), INTEGER]
Boolean = Annotated[bool, BeforeValidator(_read_boolean)]
#: Name of a part.
Text = Annotated[str, MinLen(1)]
#: Limits of an interval, and numbers of a table.
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
#: Unknown if None, which is allowed at rest.
MaterialDamping = Annotated[Damping | None, described("Damping of the material in contact", "k_1")]
BacklashDamping = Annotated[Damping, described("Damping of the oil in free flight", "k_1m")]
PressureAngle = Annotated[WorkingAngle, described("Pressure angle in operation")]

# Damping of gears given by geometry; of the first three at most one is given.
DampingRatio = Annotated[NonNegative | None, described("Damping ratio in contact, beta")]
Decrement = Annotated[
    NonNegative | None,
    described("delta = 2 pi beta / sqrt(1 - beta^2), in place of damping_ratio"),
]
ContactDamping = Annotated[Damping | None, described("k_1 in contact, in place of damping_ratio")]
BacklashDampingRatio = Annotated[NonNegative, described("Damping ratio in free flight, beta_m")]

#: Method of integration -> its module in `gearlib.integrators`, which is imported when it is used.
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

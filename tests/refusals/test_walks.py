"""A walk over the parameters of the library and the keys of files: just outside, just inside.

What is allowed is said by the annotation; the numbers to try are read from its words.
"""

import inspect
import math
import re
from contextlib import suppress
from functools import partial
from typing import Annotated, Literal, get_args, get_origin

import pytest
from pydantic import BaseModel, ValidationError

from gearlib import Harmonics
from gearlib import parameters as p
from gearlib.config import ConfigError, load, validation
from gearlib.config.configuration import Config
from gearlib.config.gear_pair_section import Damping
from gearlib.config.measured_description import Description
from gearlib.geometry import SpurGear
from tests.paper import CONFIG, PAPER
from tests.refusals import expressions

#: A name that a user may choose in a mapping; it is also a damping of the paper's configuration.
NAME = "k1"
#: Class -> a value of it, where more is required than the declarations say.
EXAMPLES = {type(x): x for x in (expressions.A, expressions.AB, expressions.stage, PAPER)}
EXAMPLES |= {Harmonics: Harmonics(), SpurGear: expressions.stage.pinion}
EXAMPLES[Damping] = CONFIG["dampings"][NAME]
EXAMPLES[Config] = {key: CONFIG[key] for key in ("gear_pair", "dampings")}
_BOUND = re.compile(r"(>=|>|<=|<|from|to) (-?)(pi / [234]|2 pi|\d[\d.e+-]*)")
_PI = {"2 pi": math.tau} | {f"pi / {n}": math.pi / n for n in (2, 3, 4)}


def numbers(words):
    """Return (numbers just outside a range in words and those of no range, numbers just inside)."""
    number = int if "integer" in words else float
    outside = [math.nan, *[1.5] * (number is int), *[-math.inf] * ("-inf" not in words)]
    outside += [] if "infin" in words or ".inf" in words else [math.inf]
    inside = []
    for sign, minus, text in _BOUND.findall(words):
        bound = (_PI.get(text) or number(text)) * (-1 if minus else 1)
        step = (
            1 if number is int else max(1e-12, abs(bound) * 1e-12)
        )  # of which the square is not 0
        step *= -1 if sign in (">", ">=", "from") else 1
        outside.append(bound if sign in "<>" else bound + step)
        inside.append(bound - step if sign in "<>" else bound)
    return outside, inside or [0]


def children(annotation):
    """Return key -> annotation of a section, or `NAME` -> annotation of the values of a mapping."""
    base, _ = p.parts(annotation)
    if get_origin(base) is dict:
        return {NAME: get_args(base)[1]}
    fields = getattr(base, "__pydantic_fields__", {}).items()
    return {key: Annotated[(x.annotation, *x.metadata, x)] for key, x in fields}


def valid(annotation):
    """Return an allowed value; of a section the one with the required keys only."""
    base, words = p.parts(annotation)[0], p.requirement(annotation)
    if p.is_union(base):
        return valid(get_args(base)[0])
    if base in (int, float):
        inside = numbers(words)[1]
        return 1 if min(inside) <= 1 <= max(inside) else base(sum(inside) / len(inside))
    if get_origin(base) in (list, tuple):
        count = re.match(r"(one value or )?a list of (\d+)", words)
        return [valid(get_args(base)[0])] * (int(count[2]) if count else 1)
    if base not in EXAMPLES and (
        get_origin(base) is dict or issubclass(type(base), type(BaseModel))
    ):
        fields = getattr(base, "__pydantic_fields__", {})
        return {
            k: valid(x) for k, x in children(base).items() if not fields or fields[k].is_required()
        }
    default = get_args(base)[0] if get_origin(base) is Literal else True if base is bool else NAME
    return EXAMPLES.get(base, default)


def wrong(annotation, text_of):
    """Yield (value, index of the wrong part in it, problem); files have `text_of` values in YAML."""
    in_file = text_of is validation.as_text
    (base, metadata), words = p.parts(annotation), p.requirement(annotation, in_file)
    if get_origin(base) in (list, tuple):
        entries, values = valid(annotation), [[]] * ("least one" in words)
        values += [] if "one value or" in words else [7, "text", {}]
        values += [[*entries, entries[0]]] * bool(re.match(r".*?a list of \d", words))
        for value, index, problem in wrong(get_args(base)[0], text_of) if "a list" in words else ():
            yield [*entries[1:], value], f"[{len(entries) - 1}]{index}", problem
        if any("uniqueItems" in (getattr(x, "json_schema_extra", 0) or ()) for x in metadata):
            yield 2 * entries, "", "lists "
    elif base in (int, float):
        values = ["fast", True, [1.0], {}, *numbers(words)[0]]
        values += ["3 mol", *["1e400", ".inf"] * (".inf" not in words)] if in_file else ["1.0"]
    elif base is str:
        values = [3.5, ["a"], {}, *["~ text" for x in metadata if getattr(x, "pattern", None)]]
        values += ["x" * (int(most) + 1) for most in re.findall(r"to (\d+) characters", words)]
    elif base is bool or get_origin(base) is Literal:
        values = [3.5, ["a"], {}, "no such text"]
    elif words.startswith("a mapping"):
        values = [7, "text", [], *[{}] * ("at least" in words)]
    else:  # options, whose method checks them, and parts of models
        values = [[1.0], {}, math.nan] if in_file else ["wrong"]
    yield from ((x, "", f"= {text_of(x)} is not allowed: it must be {words}") for x in values)


def inside(annotation, in_file):
    """Yield numbers just inside the range of an annotation, with a unit, as entries of a list."""
    base, metadata = p.parts(annotation)
    if base in (int, float):
        yield from numbers(p.requirement(annotation))[1]
        yield from (x.example for x in metadata if isinstance(x, p.Unit) and x.example and in_file)
    elif get_origin(base) in (list, tuple):
        yield from ([x] * len(valid(annotation)) for x in inside(get_args(base)[0], in_file))


def sections(annotation, place, path=()):
    """Yield (path, annotation, function that places a content in a file) of all sections."""
    base, _ = p.parts(annotation)
    if p.is_union(base):
        for option in get_args(base):
            yield from sections(option, place, path)
    elif get_origin(base) is list:
        yield from sections(get_args(base)[0], lambda value: place([value]), (*path, 0))
    elif keys := children(annotation):
        yield path, annotation, place
        content = valid(annotation)
        for key, child in keys.items():
            yield from sections(child, lambda x, k=key: place(content | {k: x}), (*path, key))


def refusals_of_call(call, needed, name, value):
    """Return the sentences about a value of a parameter in a list."""
    try:
        with suppress(TypeError):  # functions check what is declared before they miss the rest
            call(**needed | {name: value})
    except ValueError as error:
        return [str(error)]
    return []


def refusals_of_file(place, content, *changes):
    """Return the sentences about a file with a content at its place, and one key of it changed."""
    changed = content | dict([changes] if changes else [])
    root, file = place({key: value for key, value in changed.items() if value is not None})
    try:
        if root is Description:
            Description.model_validate(file)
        else:  # gears take the place of a gear pair
            load({k: v for k, v in file.items() if k != "gear_pair" or "gears" not in file})
    except ValidationError as error:
        return validation.sentences(error, Description, file)
    except ConfigError as error:
        return str(error).splitlines()
    return []


SECTIONS = {
    str(p.parts(annotation)[0]): (path, annotation, place)
    for root in (Description, Config)
    for path, annotation, place in sections(root, lambda value, root=root: (root, value))
}
CASES = [
    pytest.param(
        child,
        p.dotted((*path, key)),
        partial(refusals_of_file, place, valid(x), key),
        validation.as_text,
    )
    for path, x, place in SECTIONS.values()
    for key, child in children(x).items()
    if (path, key) != (("profile",), "kind")
]
for call in expressions.CALLS:
    declared = p.declared_parameters(call)
    required = {} if inspect.isroutine(call) else declared
    needed = {k: valid(x.annotation) for k, x in required.items() if x.default is p.MISSING}
    for name, x in declared.items():
        CASES.append(
            pytest.param(
                x.annotation,
                name,
                partial(refusals_of_call, call, needed, name),
                repr,
                id=f"{call.__qualname__}.{name}",
            )
        )
cases = pytest.mark.parametrize(("annotation", "place", "refusals", "text_of"), CASES)


@cases
def test_each_wrong_value_is_refused_in_one_sentence(annotation, place, refusals, text_of):
    for value, index, problem in wrong(annotation, text_of):
        (text,) = refusals(value)
        pattern = rf"{re.escape(place + index)}( of \w+ \w+)? {re.escape(problem)}"
        assert re.match(pattern, text) and "\n" not in text and len(text) < 1200, (text, problem)


@cases
def test_values_just_inside_are_not_refused_for_their_range(annotation, place, refusals, text_of):
    words = p.requirement(annotation, text_of is validation.as_text).rpartition("each ")[2]
    for value in inside(annotation, text_of is validation.as_text):
        # Other sentences are allowed: values of several parameters may not go together.
        pattern = rf"{re.escape(place)}\S* = .* must be {re.escape(words)}"
        assert not [text for text in refusals(value) if re.match(pattern, text)]


@pytest.mark.parametrize(("path", "section", "place"), SECTIONS.values(), ids=SECTIONS)
def test_unknown_and_missing_keys_and_wrong_names_are_refused(path, section, place):
    content, keys, base = valid(section), children(section), p.parts(section)[0]
    name, last = p.dotted(path) or "the configuration", [*keys][-1]
    allowed = f"{name} must be {p.requirement(section, in_file=True)}"
    problems = [("no_such_key", 1, f"= 1 is not a known key: {allowed}")]
    problems += [(f"{last}~", 1, f"= 1 is not a known key: did you mean {last}?")]
    for key, field in getattr(base, "__pydantic_fields__", {}).items():
        if field.is_required() and (path, key) != (("profile",), "kind"):
            allowed = p.requirement(keys[key], in_file=True)
            problems.append((key, None, f"is missing: it must be {allowed}"))
    if get_origin(base) is dict:  # columns of measured tables may have any name
        allowed = p.requirement(get_args(base)[0], in_file=True)
        problems = [("~", content[NAME], f"is not allowed as a name: it must be {allowed}")]
        problems *= place({})[0] is Config
    for key, value, problem in problems:
        begin = f"{p.dotted((*path, key))} {problem}"
        sentences = refusals_of_file(place, content, key, value)
        assert any(text.startswith(begin) for text in sentences), (begin, sentences)

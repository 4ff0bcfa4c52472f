"""A walk over the parameters of the library and the keys of files: just outside, just inside.

What is allowed is said by the annotation, see `tests.declarations`.
"""

import inspect
import re
from contextlib import suppress
from functools import partial
from typing import get_args, get_origin

import pytest
from pydantic import ValidationError

from gearlib import parameters as p
from gearlib.config import ConfigError, load, validation
from gearlib.config.configuration import Config
from gearlib.config.measured_description import Description
from tests.declarations import (
    DECLARED_CALLABLES,
    MAPPING_KEY,
    child_annotations,
    example_value,
    invalid_values,
    iterate_sections,
    values_within_range,
)


def refusals_of_call(call, needed, name, value):
    """Return the sentences that refuse a value of a parameter, in a list."""
    try:
        # Functions check declared parameters before they report missing ones.
        with suppress(TypeError):
            call(**needed | {name: value})
    except ValueError as error:
        return [str(error)]
    return []


def refusals_of_file(place, content, *changes):
    """Return the sentences that refuse a file with given content, of which one key is changed."""
    changed = content | dict([changes] if changes else [])
    root, file = place({key: value for key, value in changed.items() if value is not None})
    try:
        if root is Description:
            Description.model_validate(file)
        else:  # gears take the place of a gear pair
            load({k: v for k, v in file.items() if k != "gear_pair" or "gears" not in file})
    except ValidationError as error:
        return validation.error_messages(error, Description, file)
    except ConfigError as error:
        return str(error).splitlines()
    return []


SECTIONS = {
    str(p.split_annotation(annotation)[0]): (path, annotation, place)
    for root in (Description, Config)
    for path, annotation, place in iterate_sections(root, lambda value, root=root: (root, value))
}
CASES = []
for path, section, place in SECTIONS.values():
    for key, child in child_annotations(section).items():
        if (path, key) != (("profile",), "kind"):
            refusals = partial(refusals_of_file, place, example_value(section), key)
            CASES.append((child, p.format_path((*path, key)), refusals, validation.format_value))
for call in sorted(DECLARED_CALLABLES, key=lambda call: call.__qualname__):
    declared = p.declared_parameters(call)
    required = {} if inspect.isroutine(call) else declared
    needed = {k: example_value(x.annotation) for k, x in required.items() if x.default is p.MISSING}
    for name, x in declared.items():
        CASES.append((x.annotation, name, partial(refusals_of_call, call, needed, name), repr))
IDS = [f"{place} {i}" for i, (_, place, *_) in enumerate(CASES)]
cases = pytest.mark.parametrize(("annotation", "place", "refusals", "text_of"), CASES, ids=IDS)


@cases
def test_each_wrong_value_is_refused_in_one_sentence(annotation, place, refusals, text_of):
    for value, index, problem in invalid_values(annotation, text_of):
        (text,) = refusals(value)
        pattern = rf"{re.escape(place + index)}( of \w+ \w+)? {re.escape(problem)}"
        assert re.match(pattern, text) and "\n" not in text and len(text) < 1200, (text, problem)


@cases
def test_values_just_inside_a_range_are_not_refused_for_it(annotation, place, refusals, text_of):
    words = p.describe_requirement(annotation, text_of is validation.format_value).rpartition(
        "each "
    )[2]
    for value in values_within_range(annotation, text_of is validation.format_value):
        # Other refusals are allowed, because values of several parameters may be inconsistent.
        pattern = rf"{re.escape(place)}\S* = .* must be {re.escape(words)}"
        assert not [text for text in refusals(value) if re.match(pattern, text)]


@pytest.mark.parametrize(
    ("path", "section", "place"),
    SECTIONS.values(),
    ids=[f"{p.format_path(path)} {i}" for i, (path, *_) in enumerate(SECTIONS.values())],
)
def test_unknown_and_missing_keys_and_wrong_names_are_refused(path, section, place):
    """Add an unknown and a misspelt key, and remove each required key of a section."""
    content, keys, base = (
        example_value(section),
        child_annotations(section),
        p.split_annotation(section)[0],
    )
    name, last = p.format_path(path) or "the configuration", [*keys][-1]
    allowed = f"{name} must be {p.describe_requirement(section, in_file=True)}"
    problems = [("no_such_key", 1, f"= 1 is not a known key: {allowed}")]
    problems += [(f"{last}~", 1, f"= 1 is not a known key: did you mean {last}?")]
    for key, field in getattr(base, "__pydantic_fields__", {}).items():
        if field.is_required() and (path, key) != (("profile",), "kind"):
            allowed = p.describe_requirement(keys[key], in_file=True)
            problems.append((key, None, f"is missing: it must be {allowed}"))
    if get_origin(base) is dict:  # columns of measured tables may have any name
        allowed = p.describe_requirement(get_args(base)[0], in_file=True)
        problems = [("~", content[MAPPING_KEY], f"is not allowed as a name: it must be {allowed}")]
        problems *= place({})[0] is Config
    for key, value, problem in problems:
        begin = f"{p.format_path((*path, key))} {problem}"
        sentences = refusals_of_file(place, content, key, value)
        assert any(text.startswith(begin) for text in sentences), (begin, sentences)

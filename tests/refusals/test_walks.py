"""Check values just inside and just outside the range of each parameter and configuration key.

The ranges follow from annotations, see `tests.declarations`.
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


def refusals_of_call(function, required_arguments, name, value):
    """Return a list of the sentences with which a call refuses a value of a parameter."""
    try:
        # A function checks the given arguments before it reports missing ones by a TypeError.
        with suppress(TypeError):
            function(**required_arguments | {name: value})
    except ValueError as error:
        return [str(error)]
    return []


def refusals_of_file(insert_section, section, key, value):
    """Return the sentences with which a file is refused if a key of a section is changed.

    `insert_section` returns the type of the file and its content with the section. The value None
    removes the key.
    """
    changed_section = {k: v for k, v in (section | {key: value}).items() if v is not None}
    root, file = insert_section(changed_section)
    try:
        if root is Description:
            Description.model_validate(file)
        else:
            # A configuration has either gears or a gear pair.
            load({k: v for k, v in file.items() if k != "gear_pair" or "gears" not in file})
    except ValidationError as error:
        return validation.error_messages(error, Description, file)
    except ConfigError as error:
        return str(error).splitlines()
    return []


SECTIONS = {
    str(p.split_annotation(annotation)[0]): (path, annotation, insert_section)
    for root in (Description, Config)
    for path, annotation, insert_section in iterate_sections(
        root, lambda value, root=root: (root, value)
    )
}
CASES = []
for path, section, insert_section in SECTIONS.values():
    for key, child in child_annotations(section).items():
        if (path, key) != (("profile",), "kind"):
            refusals_of = partial(refusals_of_file, insert_section, example_value(section), key)
            CASES.append((child, p.format_path((*path, key)), refusals_of, validation.format_value))
for function in sorted(DECLARED_CALLABLES, key=lambda function: function.__qualname__):
    declared = p.declared_parameters(function)
    # Declared classes check all fields at once, so that the required ones must be given.
    required = {} if inspect.isroutine(function) else declared
    required_arguments = {
        name: example_value(parameter.annotation)
        for name, parameter in required.items()
        if parameter.default is p.MISSING
    }
    for name, parameter in declared.items():
        refusals_of = partial(refusals_of_call, function, required_arguments, name)
        CASES.append((parameter.annotation, name, refusals_of, repr))
IDS = [f"{name} {i}" for i, (_, name, *_) in enumerate(CASES)]
for_each_parameter = pytest.mark.parametrize(
    ("annotation", "name", "refusals_of", "format_value"), CASES, ids=IDS
)


@for_each_parameter
def test_each_wrong_value_is_refused_in_one_sentence(annotation, name, refusals_of, format_value):
    """Values just outside the declared range must be refused by the name and the allowed range."""
    for value, index, problem in invalid_values(annotation, format_value):
        (sentence,) = refusals_of(value)
        pattern = rf"{re.escape(name + index)}( of \w+ \w+)? {re.escape(problem)}"
        assert re.match(pattern, sentence), (sentence, problem)
        assert "\n" not in sentence and len(sentence) < 1200, sentence


@for_each_parameter
def test_values_just_inside_a_range_are_not_refused_for_it(
    annotation, name, refusals_of, format_value
):
    """Values just inside the declared range must not be refused with this range as the reason."""
    in_file = format_value is validation.format_value
    # For sequences the requirement of each item follows the word "each".
    requirement = p.describe_requirement(annotation, in_file).rpartition("each ")[2]
    pattern = rf"{re.escape(name)}\S* = .* must be {re.escape(requirement)}"
    for value in values_within_range(annotation, in_file):
        # Other reasons are possible, because the value may not suit other parameters.
        assert not [sentence for sentence in refusals_of(value) if re.match(pattern, sentence)]


@pytest.mark.parametrize(
    ("path", "section", "insert_section"),
    SECTIONS.values(),
    ids=[f"{p.format_path(path)} {i}" for i, (path, *_) in enumerate(SECTIONS.values())],
)
def test_unknown_and_missing_keys_and_wrong_names_are_refused(path, section, insert_section):
    """An unknown, a misspelt and a missing required key of a section must each be refused."""
    content, keys, base = (
        example_value(section),
        child_annotations(section),
        p.split_annotation(section)[0],
    )
    name, last_key = p.format_path(path) or "the configuration", [*keys][-1]
    allowed = f"{name} must be {p.describe_requirement(section, in_file=True)}"
    problems = [("no_such_key", 1, f"= 1 is not a known key: {allowed}")]
    problems += [(f"{last_key}~", 1, f"= 1 is not a known key: did you mean {last_key}?")]
    for key, field in getattr(base, "__pydantic_fields__", {}).items():
        if field.is_required() and (path, key) != (("profile",), "kind"):
            allowed = p.describe_requirement(keys[key], in_file=True)
            problems.append((key, None, f"is missing: it must be {allowed}"))
    if get_origin(base) is dict:  # a mapping whose keys are names chosen by the user
        allowed = p.describe_requirement(get_args(base)[0], in_file=True)
        problems = [("~", content[MAPPING_KEY], f"is not allowed as a name: it must be {allowed}")]
        if insert_section({})[0] is Description:
            problems = []  # columns of measured tables may have any name
    for key, value, problem in problems:
        expected = f"{p.format_path((*path, key))} {problem}"
        sentences = refusals_of_file(insert_section, content, key, value)
        assert any(sentence.startswith(expected) for sentence in sentences), (expected, sentences)

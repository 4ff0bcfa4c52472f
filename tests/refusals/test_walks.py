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

from gearlib import Harmonics
from gearlib import parameters as p
from gearlib.config import ConfigError, load, validation
from gearlib.config.configuration import Config
from gearlib.config.gear_pair_section import Damping
from gearlib.config.measured_description import Description
from gearlib.geometry import SpurGear
from tests.declarations import EXAMPLES, NAME, children, inside, valid, wrong
from tests.paper import CONFIG, PAPER
from tests.refusals.test_combinations import AB, CALLS, stage
from tests.refusals.test_combinations import A as BODY

#: Class -> a value of it, where more is required than the declarations say.
EXAMPLES |= {type(x): x for x in (BODY, AB, stage, PAPER)}
EXAMPLES |= {Harmonics: Harmonics(), SpurGear: stage.pinion}
EXAMPLES[Damping] = CONFIG["dampings"][NAME]
EXAMPLES[Config] = {key: CONFIG[key] for key in ("gear_pair", "dampings")}


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
for call in CALLS:
    declared = p.declared_parameters(call)
    required = {} if inspect.isroutine(call) else declared
    needed = {k: valid(x.annotation) for k, x in required.items() if x.default is p.MISSING}
    for name, x in declared.items():
        CASES.append((x.annotation, name, partial(refusals_of_call, call, needed, name), repr))
IDS = [f"{place} {i}" for i, (_, place, *_) in enumerate(CASES)]
cases = pytest.mark.parametrize(
    ("annotation", "place", "refusals", "text_of"),
    CASES,
    ids=[f"{x[1]} {i}" for i, x in enumerate(CASES)],
)


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

"""A walk over the annotations of configurations and measured sets: each key outside and inside.

All keys of a section are broken at once, so that a sentence too many is seen as well.
"""

import re
from itertools import zip_longest
from typing import get_args, get_origin

import pytest
from pydantic import ValidationError

from gearlib.config import ConfigError, load, validation
from gearlib.config.configuration import Config
from gearlib.config.gear_pair_section import Damping
from gearlib.config.measured_description import Description
from gearlib.config.validation import as_text
from gearlib.parameters import Unit, dotted, is_union, parts, requirement
from tests.paper import CONFIG
from tests.refusals.declared import NAME, children, numbers, valid, wrong

#: Contents of sections in which more is required than the keys without a default.
CONTENTS = {Config: {key: CONFIG[key] for key in ("gear_pair", "dampings")}}
CONTENTS[Damping] = CONFIG["dampings"][NAME]


def sections(annotation, place, path=()):
    """Yield (path, annotation, function that places a content in a file) of all sections."""
    base, _ = parts(annotation)
    if is_union(base):
        for option in get_args(base):
            yield from sections(option, place, path)
    elif get_origin(base) is list:
        yield from sections(get_args(base)[0], lambda value: place([value]), (*path, 0))
    elif keys := children(annotation):
        yield path, annotation, place
        content = valid(annotation, CONTENTS)
        for key, child in keys.items():
            yield from sections(child, lambda x, k=key: place(content | {k: x}), (*path, key))


def refusals(place, value):
    """Return the sentences about a file with a value at its place."""
    root, content = place(value)
    try:
        if root is Description:
            Description.model_validate(content)
        else:  # gears take the place of a gear pair
            load({k: v for k, v in content.items() if k != "gear_pair" or "gears" not in content})
    except ValidationError as error:
        return validation.sentences(error, Description, content)
    except ConfigError as refusal:
        return str(refusal).splitlines()
    return []


def at_once(candidates):
    """Yield dicts with the first candidate of every key, then the second one where there is one."""
    for row in zip_longest(*candidates.values()):
        yield {key: x for key, x in zip(candidates, row, strict=True) if x is not None}


#: Of a class the first section of each top level key, and those near the top.
SECTIONS = {
    (str(parts(x)[0]), path[:1] if len(path) < 3 else ()): pytest.param(
        path, x, place, id=f"{root.__name__} {dotted(path)}"
    )
    for root in (Description, Config)
    for path, x, place in reversed([*sections(root, lambda value, root=root: (root, value))])
}
walk = pytest.mark.parametrize(("path", "annotation", "place"), SECTIONS.values())


@walk
def test_each_wrong_value_gets_one_sentence(path, annotation, place):
    # Gears and a gear pair exclude each other, and another kind has other keys.
    left_out = {*["gears"] * (not path), *["kind"] * ("profile" in path)}
    keys = {key: child for key, child in children(annotation).items() if key not in left_out}
    for broken in at_once({key: [*wrong(child, in_file=True)] for key, child in keys.items()}):
        values = {key: value for key, (value, *_) in broken.items()}
        sentences = refusals(place, valid(annotation, CONTENTS) | values)
        for key, (value, rest, words) in broken.items():
            for index in rest:
                value = value[index]
            begin = f"{dotted((*path, key, *rest))} = {as_text(value)} is not allowed: it must be "
            own = [text for text in sentences if text.startswith(begin + words)]
            assert len(own) == 1 and len(own[0]) < 1200, (begin, words, sentences)
        assert len(sentences) == len(broken), sentences


@walk
def test_unknown_missing_and_repeated_entries_and_invalid_names_are_refused(
    path, annotation, place
):
    content, keys, base = valid(annotation, CONTENTS), children(annotation), parts(annotation)[0]

    def assert_refused(key, value, problem):
        """Check that a key has a problem if it has a value, or has none (None)."""
        changed = {k: v for k, v in (content | {key: value}).items() if v is not None}
        begin = f"{dotted((*path, key))} {problem}"
        assert any(text.startswith(begin) for text in refusals(place, changed)), begin

    if get_origin(base) is dict:
        if place({})[0] is Config:  # columns of tables may have any name
            allowed = requirement(get_args(base)[0], in_file=True)
            assert_refused("~", content[NAME], f"is not allowed as a name: it must be {allowed}")
        return
    unknown = f"{dotted(path) or 'the configuration'} must be {requirement(annotation, True)}"
    assert_refused("no_such_key", 1, f"= 1 is not a known key: {unknown}")
    assert_refused(f"{[*keys][-1]}~", 1, f"= 1 is not a known key: did you mean {[*keys][-1]}?")
    for key, child in keys.items():
        if any(
            "uniqueItems" in (getattr(x, "json_schema_extra", 0) or ()) for x in parts(child)[1]
        ):
            assert_refused(key, 2 * valid(child)[:1], f"lists {valid(child)[0]!r} twice")
        if base.__pydantic_fields__[key].is_required() and (key, *path) != ("kind", "profile"):
            assert_refused(key, None, f"is missing: it must be {requirement(child, True)}")


@walk
def test_values_just_inside_are_not_refused_for_their_range(path, annotation, place):
    candidates, ranges = {}, {}
    for key, child in children(annotation).items():
        is_list = get_origin(parts(child)[0]) is list
        item = get_args(parts(child)[0])[0] if is_list else child
        if parts(item)[0] in (int, float):
            ranges[key] = re.escape(requirement(item, in_file=True))
            examples = [x.example for x in parts(item)[1] if isinstance(x, Unit) and x.example]
            values = numbers(requirement(item))[1] + examples
            candidates[key] = [[x] * len(valid(child)) for x in values] if is_list else values
    for values in at_once(candidates):
        for text in refusals(place, valid(annotation, CONTENTS) | values):
            for key in values:
                # Other sentences are allowed: values of several keys may not go together.
                begin = re.escape(dotted((*path, key)))
                assert not re.fullmatch(rf"{begin}\S* = .* must be {ranges[key]}(; did .*)?", text)

"""A walk over the annotations of configurations and measured sets: each key outside and inside.

All keys of a section are broken at once, so that a sentence too many is seen as well.
"""

import re
from itertools import zip_longest
from typing import get_args, get_origin

import pytest
from pydantic import BaseModel, ValidationError

from gearlib.config import ConfigError, load, validation
from gearlib.config.configuration import Config
from gearlib.config.gear_pair_section import Damping
from gearlib.config.measured_description import Description
from gearlib.config.validation import as_text
from gearlib.parameters import Unit, dotted, is_union, parts, requirement
from tests.paper import CONFIG
from tests.refusals.declared import NAME, children, inside, is_number, valid, wrong

#: Contents of sections in which more is required than the keys without a default.
SECTIONS = {
    Config: {key: CONFIG[key] for key in ("gear_pair", "dampings")},
    Damping: CONFIG["dampings"][NAME],
}


def sections(annotation, place, path=(), seen=()):
    """Yield (path, annotation, function that places a content in a file) of sections."""
    base, _ = parts(annotation)
    if is_union(base):
        for option in get_args(base):
            yield from sections(option, place, path, seen)
    elif get_origin(base) is list:
        yield from sections(get_args(base)[0], lambda value: place([value]), (*path, 0), seen)
    elif get_origin(base) is dict or isinstance(base, type) and issubclass(base, BaseModel):
        yield path, annotation, place
        for key, child in children(annotation).items():
            content = valid(annotation, SECTIONS)
            yield from sections(child, lambda x, k=key, c=content: place(c | {k: x}), (*path, key))


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


def all_sections():
    """Yield pytest parameters; a class has a parameter in each section of the file."""
    seen = set()
    for root in (Config, Description):
        for path, annotation, place in sections(root, lambda value, root=root: (root, value)):
            key = str(parts(annotation)[0]), path[:1] if len(path) < 3 else ()
            if key not in seen:
                seen.add(key)
                name = f"{root.__name__}.{dotted(path)}.{getattr(parts(annotation)[0], '__name__', '')}"
                yield pytest.param(path, annotation, place, id=name)


walk = pytest.mark.parametrize(("path", "annotation", "place"), [*all_sections()])


@walk
def test_each_wrong_value_gets_one_sentence(path, annotation, place):
    candidates = {key: [*wrong(child, in_file=True)] for key, child in children(annotation).items()}
    # Gears and a gear pair exclude each other, and another kind has other keys.
    for key in ["gears"] * (not path) + ["kind"] * ("profile" in path):
        candidates.pop(key, None)
    content = valid(annotation, SECTIONS)
    for broken in at_once(candidates):
        sentences = refusals(place, content | {key: value for key, (value, *_) in broken.items()})
        for key, (value, rest, words) in broken.items():
            for index in rest:
                value = value[index]
            begin = f"{dotted((*path, key, *rest))} = {as_text(value)} is not allowed: it must be "
            own = [text for text in sentences if text.startswith(begin + words)]
            assert len(own) == 1 and len(own[0]) < 1200, (begin, words, sentences)
        assert len(sentences) == len(broken), sentences


@walk
def test_unknown_missing_and_repeated_entries_and_invalid_names_are_refused(path, annotation, place):
    base, content = parts(annotation)[0], valid(annotation, SECTIONS)
    if get_origin(base) is dict:
        sentence = f"{dotted((*path, '~'))} is not allowed as a name: it must be "
        sentence += requirement(get_args(base)[0], True)
        # Columns of tables may have any name.
        is_any = place({})[0] is Description
        assert is_any or sentence in refusals(place, {"~": content[NAME]}), sentence
        return
    key = [*children(annotation)][-1]
    name, place_of = dotted(path) or "the configuration", lambda key: dotted((*path, key))
    unknown = [f"{name} must be {requirement(annotation, True)}", f"did you mean {key}?"]
    for key, advice in zip(("no_such_key", f"{key}~"), unknown, strict=True):
        sentence = f"{place_of(key)} = 1 is not a known key: {advice}"
        assert sentence in refusals(place, content | {key: 1}), sentence
    for key, child in children(annotation).items():
        extras = [getattr(part, "json_schema_extra", None) or {} for part in parts(child)[1]]
        if any("uniqueItems" in extra for extra in extras if isinstance(extra, dict)):
            sentences = refusals(place, content | {key: 2 * valid(child)[:1]})
            begin = f"{place_of(key)} lists "
            assert any(x.startswith(begin) and "must be all different" in x for x in sentences), key
        if base.__pydantic_fields__[key].is_required() and (key, *path) != ("kind", "profile"):
            sentences = refusals(place, {k: v for k, v in content.items() if k != key})
            missing = f"{place_of(key)} is missing: it must be {requirement(child, True)}"
            assert any(x.startswith(missing) for x in sentences), (missing, sentences)


@walk
def test_values_just_inside_are_not_refused_for_their_range(path, annotation, place):
    candidates = {}
    for key, child in children(annotation).items():
        item = get_args(parts(child)[0])[0] if get_origin(parts(child)[0]) is list else child
        examples = [x.example for x in parts(item)[1] if isinstance(x, Unit) and x.example]
        values = inside(requirement(item)) + examples if is_number(item) else []
        candidates[key] = values if item is child else [[x] * len(valid(child)) for x in values]
    for values in at_once(candidates):
        for text in refusals(place, valid(annotation, SECTIONS) | values):
            for key in values:
                # Other sentences are allowed: values of several keys may not go together.
                words = re.escape(requirement(children(annotation)[key], True).rpartition("each ")[2])
                begin = re.escape(dotted((*path, key)))
                assert not re.fullmatch(rf"{begin}\S* = .* must be {words}(; did .*)?", text), text

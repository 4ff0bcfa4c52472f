"""A walk over the schema of the configuration: each key just outside and just inside its range.

All keys of a section are broken at once, each in one sentence, so that a sentence too many is seen
as well.
"""

import math
import re
from functools import partial
from itertools import zip_longest

import pytest

from gearlib.config import ConfigError, load, schema, validation
from gearlib.config.validation import as_text
from tests.paper import CONFIG
from tests.refusals.ranges import Range

SCHEMA = schema()
#: A name that a user may choose in a mapping; it is also a damping of the paper's configuration.
NAME = "k1"
#: The node of a damping, where one of two keys is required, which the schema does not say.
DAMPING = SCHEMA["$defs"]["Damping"]
resolve = partial(validation.resolve, schema=SCHEMA)
#: The words of a refusal for what a node may be.
allowed = partial(validation.allowed_text, schema=SCHEMA)


def children(node):
    """Return key -> node of a section, or `NAME` -> node of the entries of a mapping."""
    entries = node.get("patternProperties", {}).values()
    return node.get("properties", {}) | dict.fromkeys([NAME] * len(entries), *entries)


def is_section(node):
    return resolve(node).get("type") == "object"


def spell(path):
    """Return a path of keys and indices as refusals spell it, such as `scenes.k1.cases[0]`."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".") or "the configuration"


def minimal_value(node):
    """Return a value that the schema allows for a node, with nothing but the required keys."""
    node = resolve(node)
    kind = node["type"]
    if "enum" in node:
        return node["enum"][0]
    if kind == "array":
        return [minimal_value(node["items"]) for _ in range(max(1, node.get("minItems", 1)))]
    if kind == "object":
        required = node.get("required", []) + [NAME] * node.get("minProperties", 0)
        if node is DAMPING:
            return CONFIG["dampings"][NAME]
        return {key: minimal_value(c) for key, c in children(node).items() if key in required}
    if kind in ("boolean", "string"):
        # Some texts have to name a damping.
        return True if kind == "boolean" else NAME
    low = max(node.get("minimum", -math.inf), node.get("exclusiveMinimum", -math.inf))
    high = min(node.get("maximum", math.inf), node.get("exclusiveMaximum", math.inf))
    # Candidates for integers, narrow ranges, and ranges without a lowest number.
    return next(n for n in (1, low + 1, (low + high) / 2, high - 1) if low < n < high)


def wrong_values(node):
    """Yield (value, path of the wrong part in the value, words of what is allowed there)."""
    node, words = resolve(node), allowed(node)
    kind = node["type"]
    if kind == "object":
        values = [None, 7, "text", [], *[{}] * node.get("minProperties", 0)]
    elif kind == "array":
        valid, least = minimal_value(node), node.get("minItems", 0)
        values = [None, 7, "text", {}]
        if node.get("default") != []:
            values.append(valid[1:])  # too short
        if node.get("maxItems") == least:
            values.append([*valid, valid[0]])  # too long
        index = max(least - 1, 0)
        for value, path, inner in (
            wrong_values(node["items"]) if not is_section(node["items"]) else ()
        ):
            yield [*valid[:index], value], (index, *path), inner
    elif kind == "boolean":
        values = [1, "yes", None, 0.0]
    elif kind == "string" or "enum" in node:
        # Names have a pattern; other texts have 1 to 60 characters.
        texts = ["no such ~ text"] if "enum" in node or "pattern" in node else ["", "x" * 61]
        values = [3, None, ["a"], {}, *texts]
    elif "string" in kind and "pattern" not in node:
        values = [None, [1.0], {}, math.nan, math.inf] + [True] * ("boolean" not in kind)
    else:
        number = Range(words)
        values = ["fast", "3 mol", None, True, [1.0], {}, *number.outside()]
        values += [] if number.infinite else [".inf"]
        values += [] if re.search("speed|rpm|Hz", words) else ["15 rpm"]
    yield from ((value, (), words) for value in values)


def inside(node):
    """Return numbers just inside the range of a key, one with a unit; lists of them for a list."""
    node = resolve(node)
    kind = node["type"]
    if kind == "array" and not is_section(node["items"]):
        times = 1 if node.get("uniqueItems") else max(1, node.get("minItems", 1))
        return [[value] * times for value in inside(node["items"])]
    if "enum" in node or not {*([kind] if isinstance(kind, str) else kind)} & {"number", "integer"}:
        return []
    example = re.search("such as '(.*)'", node.get("$comment", ""))
    values = Range(allowed(node)).inside()
    if "in rad" in allowed(node):
        # The bounds of angles are rounded in the sentences.
        values = [0.999 * value for value in values]
    return values + ([example[1]] if example else [])


def sections(node=SCHEMA, path=(), seen=None):
    """Yield (path, node) of each section; of a node with several places once for each first key."""
    seen = set() if seen is None else seen
    node = resolve(node)
    place = (id(node), path[:1] if len(path) < 3 else ())
    if node["type"] == "array" and is_section(node["items"]):
        yield from sections(node["items"], (*path, 0), seen)
    elif node["type"] == "object" and place not in seen:
        seen.add(place)
        yield path, node
        for key, child in children(node).items():
            yield from sections(child, (*path, key), seen)


def configuration(path, value, node=SCHEMA):
    """Return a configuration with a value at a path, and the keys required around that."""
    if not path:
        return value
    node, (key, *rest) = resolve(node), path
    if key == 0:
        return [configuration(rest, value, node["items"])]
    required = minimal_value(node) if node is not SCHEMA else {"dampings": CONFIG["dampings"]}
    if node is SCHEMA and key != "gears":
        # Gears take the place of a gear pair.
        required["gear_pair"] = CONFIG["gear_pair"]
    return required | {key: configuration(rest, value, children(node)[key])}


def refusals(path, value):
    """Return the sentences that refuse a value at a path of the configuration."""
    try:
        load(configuration(path, value))
    except ConfigError as refusal:
        return str(refusal).splitlines()
    return []


def at_once(candidates):
    """Yield dicts with the first candidate of every key, then the second one where there is one."""
    for row in zip_longest(*candidates.values()):
        yield {key: v for key, v in zip(candidates, row, strict=True) if v is not None}


SECTIONS = {spell(path): (path, node) for path, node in sections()}


@pytest.mark.parametrize("name", SECTIONS)
def test_each_wrong_value_gets_one_sentence(name):
    path, node = SECTIONS[name]
    candidates = {key: [*wrong_values(child)] for key, child in children(node).items()}
    if not path:
        # Gears and a gear pair exclude each other.
        del candidates["gears"]
    valid = minimal_value(node) if path else {k: CONFIG[k] for k in ("gear_pair", "dampings")}
    for broken in at_once(candidates):
        sentences = refusals(path, valid | {key: value for key, (value, *_) in broken.items()})
        for key, (value, rest, words) in broken.items():
            for part in rest:
                value = value[part]
            begin = f"{spell((*path, key, *rest))} = {as_text(value)} is not allowed: it must be "
            own = [text for text in sentences if text.startswith(begin + words)]
            assert len(own) == 1 and len(own[0]) < 1200, (begin, words, sentences)
        assert len(sentences) == len(broken), sentences


@pytest.mark.parametrize("name", SECTIONS)
def test_unknown_missing_and_repeated_entries_and_invalid_names_are_refused(name):
    path, node = SECTIONS[name]
    valid = minimal_value(node)
    if "properties" not in node:
        first, *_ = refusals(path, {"a ~": minimal_value(children(node)[NAME])})
        begin = f"{spell((*path, 'a ~'))} is not allowed as a name: it must be a text matching"
        assert first.startswith(begin)
        return
    unknown = f"{spell((*path, 'no_such_key'))} = 1 is not a known key: {name} must be "
    assert f"{unknown}{allowed(node)}" in refusals(path, valid | {"no_such_key": 1})
    for key, child in children(node).items():
        if resolve(child).get("uniqueItems"):
            begin = f"{spell((*path, key))} lists "
            sentences = refusals(path, valid | {key: 2 * minimal_value(child)[:1]})
            assert any(t.startswith(begin) and "must be all different" in t for t in sentences)
    for key in node.get("required", []):
        sentences = refusals(path, {other: v for other, v in valid.items() if other != key})
        missing = f"{spell((*path, key))} is missing: it must be {allowed(children(node)[key])}"
        assert any(text.startswith(missing) for text in sentences), key


@pytest.mark.parametrize("name", SECTIONS)
def test_values_just_inside_are_not_refused_for_their_range(name):
    path, node = SECTIONS[name]
    for values in at_once({key: inside(child) for key, child in children(node).items()}):
        # Other sentences are allowed: values of several keys may not go together.
        for text in refusals(path, minimal_value(node) | values):
            for key in values:
                # The words of a list end with the range of its entries; "did you mean" may follow.
                words = re.escape(allowed(children(node)[key]).rpartition("each ")[2])
                place = re.escape(spell((*path, key)))
                assert not re.fullmatch(rf"{place}\S* = .* must be {words}(; did .*)?", text), text

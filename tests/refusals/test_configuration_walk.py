"""A walk over the schema of the configuration: each key just outside and just inside its range.

All keys of a section are broken at once, each in one sentence, so that a sentence too many is seen
as well.
"""

import math
import re
from itertools import zip_longest

import pytest

from gearlib.config import ConfigError, load, schema, validation
from gearlib.config.validation import as_text
from tests.paper import CONFIG
from tests.refusals.ranges import Range

SCHEMA = schema()
#: A name of one's own, where a mapping asks for names; one of the dampings, too.
MINE = "k1"
#: Of which one key of two has to be there, as a schema cannot say.
DAMPING = SCHEMA["$defs"]["Damping"]


def resolve(node):
    return validation.resolve(node, SCHEMA)


def children(node):
    """Return key -> node of a section, or of the entries of a mapping."""
    entries = node.get("patternProperties", {}).values()
    return node.get("properties", {}) | dict.fromkeys([MINE] * len(entries), *entries)


def is_section(node):
    return resolve(node).get("type") == "object"


def spell(path):
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".") or "the configuration"


def allowed(node):
    return validation.allowed_text(node, SCHEMA)


def made(node):
    """Return a value that a node takes by itself, whatever others say."""
    node = resolve(node)
    kind = node["type"]
    if "enum" in node:
        return node["enum"][0]
    if kind == "array":
        return [made(node["items"]) for _ in range(max(1, node.get("minItems", 1)))]
    if kind == "object":
        needed = node.get("required", []) + [MINE] * node.get("minProperties", 0)
        if node is DAMPING:
            return CONFIG["dampings"]["k1"]
        return {key: made(one) for key, one in children(node).items() if key in needed}
    if kind in ("boolean", "string"):
        # What stands for a damping is one of the paper's.
        return True if kind == "boolean" else MINE
    low = max(node.get("minimum", -math.inf), node.get("exclusiveMinimum", -math.inf))
    high = min(node.get("maximum", math.inf), node.get("exclusiveMaximum", math.inf))
    return next(n for n in (1, low + 1, (low + high) / 2, high - 1) if low < n < high)


def wrong(node):
    """Yield (value, rest of the path, words of what is allowed) of what a key must not take."""
    node, words = resolve(node), allowed(node)
    kind = node["type"]
    if kind == "object":
        values = [None, 7, "text", [], *[{}] * node.get("minProperties", 0)]
    elif kind == "array":
        good, least = made(node), node.get("minItems", 0)
        # What is empty by default may be.
        values = [None, 7, "text", {}] + [good[1:]] * (node.get("default") != [])
        values += [[*good, good[0]]] * (node.get("maxItems") == least)
        for value, rest, inner in wrong(node["items"]) if not is_section(node["items"]) else ():
            at = max(least - 1, 0)
            yield [*good[:at], value], (at, *rest), inner
    elif kind == "boolean":
        values = [1, "yes", None, 0.0]
    elif kind == "string" or "enum" in node:
        unlike = ["no such ~ text"] if "enum" in node or "pattern" in node else ["", "x" * 61]
        values = [3, None, ["a"], {}, *unlike]
    elif "string" in kind and "pattern" not in node:
        values = [None, [1.0], {}, math.nan, math.inf] + [True] * ("boolean" not in kind)
    else:
        number = Range(words)
        values = ["fast", "3 mol", None, True, [1.0], {}, *[".inf"] * (not number.infinite)]
        values += ["15 rpm"] * (not re.search("speed|rpm|Hz", words)) + number.outside()
    yield from ((value, (), words) for value in values)


def inside(node):
    """Return values just inside the range of a key, and with a unit; of a list, lists of such."""
    node = resolve(node)
    kind = node["type"]
    if kind == "array" and not is_section(node["items"]):
        times = 1 if node.get("uniqueItems") else max(1, node.get("minItems", 1))
        return [[value] * times for value in inside(node["items"])]
    if "enum" in node or not {*([kind] if isinstance(kind, str) else kind)} & {"number", "integer"}:
        return []
    example = re.search("such as '(.*)'", node.get("$comment", ""))
    # Angles are rounded in words.
    scale = 0.999 if "in rad" in allowed(node) else 1.0
    values = [scale * value if scale < 1.0 else value for value in Range(allowed(node)).inside()]
    return values + ([example[1]] if example else [])


def sections(node=SCHEMA, path=(), seen=None):
    """Yield (path, node) of each section, once in each place that has keys of its own."""
    seen = set() if seen is None else seen
    node = resolve(node)
    if node["type"] == "array" and is_section(node["items"]):
        yield from sections(node["items"], (*path, 0), seen)
    elif node["type"] == "object" and (id(node), path[:1] if len(path) < 3 else ()) not in seen:
        seen.add((id(node), path[:1] if len(path) < 3 else ()))
        yield path, node
        for key, one in children(node).items():
            yield from sections(one, (*path, key), seen)


def placed(path, value, node=SCHEMA):
    """Return a configuration with a value at a path, and around it what has to be there."""
    if not path:
        return value
    node, (key, *rest) = resolve(node), path
    if key == 0:
        return [placed(rest, value, node["items"])]
    around = made(node) if node is not SCHEMA else {"dampings": CONFIG["dampings"]}
    if node is SCHEMA and key != "gears":
        around["gear_pair"] = CONFIG["gear_pair"]
    return around | {key: placed(rest, value, children(node)[key])}


def refusals(settings):
    try:
        load(settings)
    except ConfigError as refusal:
        return str(refusal).splitlines()
    return []


SECTIONS = dict((spell(path), (path, node)) for path, node in sections())


@pytest.mark.parametrize("name", SECTIONS)
def test_each_wrong_value_gets_one_sentence(name):
    path, node = SECTIONS[name]
    broken = {key: [*wrong(inner)] for key, inner in children(node).items()}
    if not path:
        # Either of both, and dampings without which there is none.
        del broken["gears"]
    good = made(node) if path else {key: CONFIG[key] for key in ("gear_pair", "dampings")}
    for values in zip_longest(*broken.values()):
        now = {key: one for key, one in zip(broken, values, strict=True) if one}
        found = refusals(placed(path, good | {key: one[0] for key, one in now.items()}))
        for key, (value, rest, words) in now.items():
            for part in rest:
                value = value[part]
            begin = f"{spell((*path, key, *rest))} = {as_text(value)} is not allowed: it must be "
            told = [text for text in found if text.startswith(begin + words)]
            assert len(told) == 1 and len(told[0]) < 1200, (begin, words, found)
        assert len(found) == len(now), found


@pytest.mark.parametrize("name", SECTIONS)
def test_keys_that_are_missing_unknown_or_no_names(name):
    path, node = SECTIONS[name]
    key, good = spell(path), made(node)
    if "properties" in node:
        found = refusals(placed(path, good | {"no_such_key": 1}))
        unknown = f"{spell((*path, 'no_such_key'))} = 1 is not a known key: {key} must be "
        assert f"{unknown}{allowed(node)}" in found
        for one, inner in children(node).items():
            if resolve(inner).get("uniqueItems"):
                twice = f"{spell((*path, one))} lists "
                found = refusals(placed(path, good | {one: 2 * made(inner)[:1]}))
                assert any(t.startswith(twice) and "must be all different" in t for t in found)
        for one in node.get("required", []):
            less = {other: value for other, value in good.items() if other != one}
            missing = f"{spell((*path, one))} is missing: it must be {allowed(children(node)[one])}"
            assert any(t.startswith(missing) for t in refusals(placed(path, less))), one
    else:
        found, *_ = refusals(placed(path, {"a ~": made(children(node)[MINE])}))
        no_name = f"{spell((*path, 'a ~'))} is not allowed as a name: it must be a text matching"
        assert found.startswith(no_name)


@pytest.mark.parametrize("name", SECTIONS)
def test_what_is_just_inside_is_allowed(name):
    path, node = SECTIONS[name]
    good = {key: inside(inner) for key, inner in children(node).items()}
    for values in zip_longest(*good.values()):
        now = {key: one for key, one in zip(good, values, strict=True) if one is not None}
        for text in refusals(placed(path, made(node) | now)):
            for key in now:
                words = re.escape(allowed(children(node)[key]).rpartition("each ")[2])
                place = re.escape(spell((*path, key)))
                assert not re.fullmatch(rf"{place}\S* = .* must be {words}(; did .*)?", text), text

"""A walk over the schema of the configuration: each key just outside and just inside its range.

All keys of a section are broken at once, each in one sentence, so that a sentence too many is seen
as well. What a number may be is said by `ranges.yaml`, not by the schema.
"""

import math
import re
from itertools import zip_longest

import pytest

from gearlib.config import ConfigError, load, schema
from tests.paper import CONFIG
from tests.refusals.ranges import Ranges, said

SCHEMA, RANGES = schema(), Ranges("configuration")
#: A name of one's own, where a mapping asks for names.
MINE = "k1"
#: Of which one key of two has to be there, as a schema cannot say.
DAMPING = SCHEMA["$defs"]["Damping"]
#: Of options that only their method can check.
ANYTHING = "a finite number, true, false or a text"
#: Of texts that only another key can check.
AMOUNT = "a finite number or a text with its unit, or a share such as '5 %'"


def resolve(node):
    return SCHEMA["$defs"][node["$ref"].removeprefix("#/$defs/")] if "$ref" in node else node


def children(node):
    """Return key -> node of a section, or of the entries of a mapping."""
    entries = node.get("patternProperties", {}).values()
    return node.get("properties", {}) | dict.fromkeys([MINE] * len(entries), *entries)


def is_section(node):
    return resolve(node).get("type") == "object"


def spell(path):
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".") or "the configuration"


def show(value):
    if value is None or isinstance(value, bool):
        return {None: "null (empty)", True: "true", False: "false"}[value]
    return repr(value) if len(repr(value)) <= 60 else f"{value!r:.60}..."


def range_of(node, path):
    """Return the `Range` of a key; the table leaves out names of one's own and places in lists."""
    while resolve(node)["type"] == "array":
        node = resolve(node)["items"]
    if resolve(node)["type"] in ("string", "boolean", "object") or "enum" in resolve(node):
        return None
    return RANGES.of([part for part in path if isinstance(part, str) and part != MINE])


def words(node, path):
    """Return what a sentence says is allowed: of numbers by the table, else by the schema."""
    node, found = resolve(node), range_of(node, path)
    if "enum" in node:
        return f"one of {', '.join(map(str, node['enum']))}"
    if found:
        return found.words.removesuffix(" or a speed")
    if node["type"] == "array":
        least, most = node.get("minItems", 0), node.get("maxItems")
        entries = f"{least} entries" if least == most else "at least one entry"
        return f"a list of {entries}, each {words(node['items'], path)}"
    if "properties" in node:
        return f"a mapping with the keys {', '.join(node['properties'])}"
    return "a mapping of " if is_section(node) else node["$comment"]


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


def wrong(node, own, number=None):
    """Yield (value, rest of the path, words of what is allowed) of what a key must not take."""
    node = resolve(node)
    kind = node["type"]
    if kind == "object":
        yield from ((value, (), own) for value in (None, 7, "text", []))
        if node.get("minProperties"):
            yield {}, (), own
    elif kind == "array":
        good, least = made(node), node.get("minItems", 0)
        # What is empty by default may be.
        lengths = [good[1:]] * (node.get("default") != [])
        lengths += [[*good, good[0]]] * (node.get("maxItems") == least)
        yield from ((value, (), own) for value in (None, 7, "text", {}, *lengths))
        if not is_section(node["items"]):
            entry = own.partition(", each ")[2], number and number.entry
            for value, rest, allowed in wrong(node["items"], *entry):
                at = max(least - 1, 0)
                yield [*good[:at], value], (at, *rest), allowed
    elif kind == "boolean":
        yield from ((value, (), own) for value in (1, "yes", None, 0.0))
    elif kind == "string" or "enum" in node:
        unlike = ["no such ~ text"] if "enum" in node or "pattern" in node else ["", "x" * 61]
        yield from ((value, (), own) for value in (3, None, ["a"], {}, *unlike))
    elif own in (ANYTHING, AMOUNT):
        values = (None, [1.0], {}, math.nan, math.inf, *([True] if own == AMOUNT else []))
        yield from ((value, (), own) for value in values)
    else:
        texts = ["fast", "3 mol", *([] if number.infinite else [".inf"])]
        if not re.search("speed|rpm|Hz", number.words):
            texts.append("15 rpm")
        yield from ((value, (), own) for value in (*texts, None, True, [1.0], {}))
        yield from ((value, (), own) for value in number.outside())


def inside(node, path, found=None):
    """Return values just inside the range of a key, and with a unit; of a list, lists of such."""
    node, found = resolve(node), found or range_of(node, path)
    if found is None or found.words in (ANYTHING, AMOUNT):
        return []
    if found.count != 0:
        times = 1 if node.get("uniqueItems") else found.count or 1
        return [[one] * times for one in inside(node["items"], path, found.entry)]
    example = re.search("'(.*)'", node.get("$comment", ""))
    return found.inside() + ([example[1]] if example else [])


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
    broken = {
        key: [*wrong(one, words(one, (*path, key)), range_of(one, (*path, key)))]
        for key, one in children(node).items()
    }
    if not path:
        # Either of both, and dampings without which there is none.
        del broken["gears"]
    good = made(node) if path else {key: CONFIG[key] for key in ("gear_pair", "dampings")}
    for values in zip_longest(*broken.values()):
        now = {key: one for key, one in zip(broken, values, strict=True) if one}
        found = refusals(placed(path, good | {key: one[0] for key, one in now.items()}))
        for key, (value, rest, allowed) in now.items():
            for part in rest:
                value = value[part]
            begin = f"{spell((*path, key, *rest))} = {show(value)} is not allowed: it must be "
            told = [text for text in found if text.startswith(begin)]
            told = [text for text in told if said(allowed, text.removeprefix(begin))]
            assert len(told) == 1 and len(told[0]) < 1200, (begin, allowed, found)
        assert len(found) == len(now), found


@pytest.mark.parametrize("name", SECTIONS)
def test_keys_that_are_missing_unknown_or_no_names(name):
    path, node = SECTIONS[name]
    key, good = spell(path), made(node)
    if "properties" in node:
        found = refusals(placed(path, good | {"no_such_key": 1}))
        unknown = f"{spell((*path, 'no_such_key'))} = 1 is not a known key: {key} must be "
        assert f"{unknown}{words(node, path)}" in found
        for one, inner in children(node).items():
            if resolve(inner).get("uniqueItems"):
                twice = f"{spell((*path, one))} lists "
                found = refusals(placed(path, good | {one: 2 * made(inner)[:1]}))
                assert any(t.startswith(twice) and "must be all different" in t for t in found)
        for one in node.get("required", []):
            less = {other: value for other, value in good.items() if other != one}
            missing = f"{spell((*path, one))} is missing: it must be "
            allowed = words(children(node)[one], (*path, one))
            assert any(t.startswith(missing + allowed) for t in refusals(placed(path, less))), one
    else:
        found, *_ = refusals(placed(path, {"a ~": made(children(node)[MINE])}))
        no_name = f"{spell((*path, 'a ~'))} is not allowed as a name: it must be a text matching"
        assert found.startswith(no_name)


@pytest.mark.parametrize("name", SECTIONS)
def test_what_is_just_inside_is_allowed(name):
    path, node = SECTIONS[name]
    good = {key: inside(one, (*path, key)) for key, one in children(node).items()}
    for values in zip_longest(*good.values()):
        now = {key: one for key, one in zip(good, values, strict=True) if one is not None}
        for text in refusals(placed(path, made(node) | now)):
            for key in now:
                allowed = words(children(node)[key], (*path, key)).rpartition("each ")[2]
                begin = re.escape(spell((*path, key)))
                end = rf"{re.escape(allowed)}( or a (text|speed) .*|, in .*)?"
                assert not re.fullmatch(rf"{begin}\S* = .* is not allowed: it must be {end}", text)


def test_the_table_has_every_number_of_the_schema():
    found = {}
    for path, node in SECTIONS.values():
        for key, one in children(node).items():
            inner = resolve(one)
            while inner["type"] == "array":
                inner = resolve(inner["items"])
            numeric = inner["type"] in ("integer", "number") or inner["type"][0] == "number"
            if numeric and "enum" not in inner:
                found[spell((*path, key))] = range_of(one, (*path, key))
    assert len(found) > 200 and [key for key in found if found[key] is None] == []

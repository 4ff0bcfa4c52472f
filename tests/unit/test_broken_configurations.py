"""Broken configurations, made from the schema: each is refused in words that name the key."""

import copy
import math
from pathlib import Path

import pytest
import yaml

from gearlib.config import ConfigError, load, schema

PAPER = yaml.safe_load(Path("config.yaml").read_text(encoding="utf-8"))
# All of its keys may be left out, so that config.yaml shows few; in SI, which is read faster.
PAPER["train"] = yaml.safe_load(Path("tests/every_train.yaml").read_text(encoding="utf-8"))
PAPER["train"] = load(PAPER).train.model_dump()
SCHEMA = schema()


def resolve(node):
    return SCHEMA["$defs"][node["$ref"].removeprefix("#/$defs/")] if "$ref" in node else node


def places(value, node, path=()):
    """Yield (path, schema node, value) of everything in a configuration, from the top down."""
    node = resolve(node)
    yield path, node, value
    if isinstance(value, dict):
        for key, entry in value.items():
            inner = node.get("properties", {}).get(key)
            if inner is None:
                (inner,) = node["patternProperties"].values()
            yield from places(entry, inner, (*path, key))
    elif isinstance(value, list) and value:
        # The first entry stands for the others.
        yield from places(value[0], node["items"], (*path, 0))


def beyond(node):
    """Yield numbers outside the bounds of a schema node."""
    if "minimum" in node:
        yield node["minimum"] - 1
    if "exclusiveMinimum" in node:
        yield node["exclusiveMinimum"]
    if "maximum" in node:
        yield node["maximum"] + 1
    if "exclusiveMaximum" in node:
        yield node["exclusiveMaximum"]


def wrong_values(node, value):
    """Yield values that a schema node must not take."""
    kind = node.get("type")
    if kind in ("number", "integer", ["number", "string"]):
        yield from ["fast", "3 parsec^2", None, True, [value], {}, math.nan, -math.inf]
        if ".inf" not in node.get("$comment", ""):
            yield from ["1e400", math.inf]
        yield from beyond(node)
    if kind == "integer":
        yield from [1.5, 10**9 + 0.5]
    if kind == "boolean":
        yield from [1, "yes", None]
    if kind == "string":
        yield from [3, None, [value], {}]
        if "enum" in node or "pattern" in node:
            yield "no such ~ text"
    if kind == "array":
        yield from [None, 7, "text", {}]
        # What is empty by default may be.
        if node.get("default") != []:
            yield []
        if node.get("uniqueItems"):
            yield [value[0], value[0]]
    if kind == "object":
        yield from [None, 7, "text", []]
        if "properties" in node:
            yield value | {"no_such_key": 1}
            for key in node.get("required", []):
                yield {name: entry for name, entry in value.items() if name != key}
        else:
            yield {f"no such ~ {name}": entry for name, entry in value.items()}


def put(path, value):
    if not path:
        return value
    # With the gears it depends on nothing else whether a section is refused.
    settings = {key: PAPER[key] for key in ("gear_pair", "dampings", path[0])}
    settings = section = copy.deepcopy(settings)
    for part in path[:-1]:
        section = section[part]
    section[path[-1]] = value
    return settings


def spell(path):
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


BROKEN = [
    (path, value)
    for path, node, good in places(PAPER, SCHEMA)
    for value in wrong_values(node, good)
]


def test_there_are_many():
    assert len(BROKEN) > 1000


@pytest.mark.parametrize("section", ["", *PAPER])
def test_every_broken_configuration_is_refused_in_clear_sentences(section):
    for path, value in BROKEN:
        if (str(path[0]) if path else "") != section:
            continue
        with pytest.raises(ConfigError) as refusal:
            load(put(path, value))
        sentences = str(refusal.value).splitlines()
        # The key, or a key below it, or the one that is missing or unknown there.
        assert any(text.startswith(spell(path)) for text in sentences), (path, value, sentences)
        for text in sentences:
            assert "must be" in text or "needs" in text, text
            assert len(text) < 1200, text

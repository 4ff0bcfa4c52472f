"""Problems of a configuration in words: one sentence naming the key, the value, the range.

The allowed range is read from the JSON schema, so that message, schema and check agree.
"""

import difflib
import re

from gearlib.config import units
from gearlib.parameters import likely
from gearlib.removed import REMOVED, sentence

_BOUNDS = {
    "exclusiveMinimum": "> {}",
    "minimum": ">= {}",
    "exclusiveMaximum": "< {}",
    "maximum": "<= {}",
}
#: Characters of a value and digits of a computed number that are shown, sections that are named.
_MAX_CHARACTERS, _MAX_DIGITS, _MAX_PLACES = 60, 12, 3
#: A key and the number that it is said to have; a sum has no key.
_ASSIGNED = re.compile(
    r"(?<! and )\b([A-Za-z][\w.+\[\]-]*) = (-?(?:\d+(?:\.\d+)?(?:e[-+]?\d+)?|inf)\b)"
)


def sentences(errors, schema):
    """Return a sentence for each of ``ValidationError.errors()``, by the JSON schema checked."""
    return [_sentence(error, schema) for error in errors]


def _sentence(error, schema):
    kind, value = error["type"], error["input"]
    # Pydantic marks a complaint about the key itself, not its value, by a last "[key]".
    path = [part for part in error["loc"] if part != "[key]"]
    key = _key(path)
    is_key = kind == "invalid_key" or error["loc"][-1:] == ("[key]",)
    if is_key and not isinstance(value, str):
        # YAML takes ``4:``, ``on:`` and ``null:`` for other things.
        place = _key([*path[:-1], show(value)])
        return f"{place} is not allowed as a name: it must be a text, in quotes where YAML has none"
    if kind == "value_error":
        text = str(error["ctx"]["error"])
        if is_key:
            text = f". is not allowed as a name{text[text.index(':') :]}"
        return in_full(text, key if path else "")
    if kind == "extra_forbidden":
        return unknown_key(path, value, schema)
    if is_key:
        pattern = next(iter(node_at(path[:-1], schema)["patternProperties"]))
        return f"{key} is not allowed as a name: it must be a text matching {pattern}"
    if kind == "missing_key":
        kind, path = "missing", [*path, error["ctx"]["key"]]
    if kind == "missing":
        return f"{_key(path)} is missing: it must be {allowed(node_at(path, schema), schema)}"
    if {"targets", "method", "methods"} & {*map(str, path)} and str(value) in REMOVED:
        return sentence(value)
    node = node_at(path, schema)
    example = re.search("such as '(.*)'", node.get("$comment", ""))
    largest = node.get("maximum", node.get("exclusiveMaximum"))
    hint = likely(value, example[1], largest) if example else ""
    return f"{key} = {show(value)} is not allowed: it must be {allowed(node, schema)}{hint}"


def in_full(text, key):
    """Return a message with full keys where ``.`` and ``.name`` stand for those of a section."""
    prefix = f"{key}." if key else ""
    full = re.sub(r"(?<!\S)\.(\w?)", lambda found: f"{prefix}{found[1]}" if found[1] else key, text)
    return full if full != text or not key or text.startswith(key) else f"{key}: {text}"


def unknown_key(path, value, schema):
    """Return the sentence that refuses a key, by its path, which its section does not have."""
    section, key, name = node_at(path[:-1], schema), _key(path), str(path[-1])
    for removed in (key, f"{path[0]}.{name}"):
        if removed in REMOVED:
            return sentence(removed)
    if similar := difflib.get_close_matches(name, section.get("properties", []), 1):
        advice = f"did you mean {similar[0]}?"
    elif places := sorted(_sections_with(name, schema), key=lambda place: place.count(".")):
        advice = f"{name} belongs in {' or '.join(places[:_MAX_PLACES])}"
    else:
        advice = f"{_key(path[:-1])} must be {allowed(section, schema)}"
    return f"{key} = {show(value)} is not a known key: {advice}"


def _sections_with(name, schema, node=None, place=""):
    """Yield the sections that have a key of a name."""
    node = resolve(node or schema, schema)
    if name in node.get("properties", {}):
        yield place or "the configuration itself, beside its sections"
    for key, inner in node.get("properties", {}).items():
        yield from _sections_with(name, schema, inner, f"{place}.{key}" if place else key)
    for inner in node.get("patternProperties", {}).values():
        yield from _sections_with(name, schema, inner, f"{place}.<name>")
    if "items" in node:
        yield from _sections_with(name, schema, node["items"], f"{place}[i]")


def as_typed(sentence, mapping):
    """Return a sentence with the texts of a mapping in place of the numbers that they became."""

    def typed(match):
        value = _value_at(mapping, match[1])
        if value == float(match[2]) or (isinstance(value, str) and units.TEXT.fullmatch(value)):
            return f"{match[1]} = {show(value)}"
        # A value that nobody typed needs no more digits than the eye takes in.
        computed = value is None and len(match[2]) > _MAX_DIGITS
        return f"{match[1]} = {float(match[2]):.6g}" if computed else match[0]

    text = _ASSIGNED.sub(typed, sentence)
    # Whoever gave a unit meant that one.
    return re.sub(r"(= '[^']*[A-Za-zµ°]' .*); did you mean [^?]*\?", r"\1", text)


def _value_at(node, key):
    """Return the value of a key such as run_ups.revolutions[0], None if there is none."""
    for part in re.findall(r"[^.\[\]]+", key):
        if isinstance(node, (list, tuple)) and part.isdigit() and int(part) < len(node):
            node = node[int(part)]
        else:
            node = node.get(part) if isinstance(node, dict) else None
    return node


def show(value):
    """Return a value as it would stand in YAML, shortened to one line."""
    if value is None:
        return "null (empty)"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _MAX_CHARACTERS else f"{text[:_MAX_CHARACTERS]}..."


def allowed(node, schema):
    """Return the allowed values of a node of the JSON schema `schema` in words."""
    node = resolve(node, schema)
    if "enum" in node:
        return f"one of {', '.join(map(str, node['enum']))}"
    if "const" in node:
        return str(node["const"])
    kind, comment = node["type"], node.get("$comment", "")
    if kind in ("number", "integer", ["number", "string"]):
        # The one number that may be infinite says so in its comment.
        noun = "a number" if ".inf" in comment else "a finite number"
        noun = "an integer" if kind == "integer" else noun
        return " ".join(filter(None, [noun, _range(node), comment]))
    if kind in ("string", "boolean") or isinstance(kind, list):
        return comment
    if kind == "array":
        least = node.get("minItems", 0)
        entries = f"{least} entries" if least == node.get("maxItems") else "at least one entry"
        return f"a list of {entries}, each {allowed(node['items'], schema)}"
    if "properties" in node:
        return f"a mapping with the keys {', '.join(node['properties'])}"
    (inner,) = node["patternProperties"].values()
    names = "at least one name" if node.get("minProperties") else "names"
    return f"a mapping of {names} to {allowed(inner, schema)}"


def _range(node):
    # Fractions of pi rounded; the unit follows.
    bounds = {
        name: f"{node[name]:.5g}" if isinstance(node[name], float) else node[name]
        for name in _BOUNDS
        if name in node
    }
    if {"minimum", "maximum"} <= bounds.keys():
        return f"from {bounds['minimum']} to {bounds['maximum']}"
    return " and ".join(_BOUNDS[name].format(value) for name, value in bounds.items())


def _key(path):
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return "".join(parts).removeprefix(".") or "the configuration"


def node_at(path, schema):
    """Return the node of the JSON schema of a key, given by its path."""
    node = schema
    for part in path:
        node = resolve(node, schema)
        if isinstance(part, int):
            node = node["items"]
        elif "properties" in node:
            node = node["properties"][part]
        else:
            (node,) = node["patternProperties"].values()
    return resolve(node, schema)


def resolve(node, schema):
    """Return a node, or the one to which it refers."""
    if "$ref" in node:
        return schema["$defs"][node["$ref"].removeprefix("#/$defs/")]
    return node

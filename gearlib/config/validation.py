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
_LONGEST_VALUE = 60
#: Most sections named for a misplaced key, and characters of a computed value shown in full.
MAX_PLACES, MAX_DIGITS = 3, 12
#: A key and the number that it is said to have; of a sum there is none to show.
_ASSIGNED = re.compile(
    r"(?<! and )\b([A-Za-z][\w.+\[\]-]*) = (-?(?:\d+(?:\.\d+)?(?:e[-+]?\d+)?|inf)\b)"
)
#: Title of a section -> its keys of former versions, and what they are called now.
_RENAMED = {"Damping": {"material": "material_damping", "backlash": "backlash_damping"}}


def sentences(errors, schema):
    """Return a sentence for each of ``ValidationError.errors()``, by the JSON schema checked."""
    return [_sentence(error, schema) for error in errors]


def _sentence(error, schema):
    kind, value = error["type"], error["input"]
    # Pydantic marks a complaint about the key itself, not its value, by a last "[key]".
    path = [part for part in error["loc"] if part != "[key]"]
    key = _key(path)
    if kind == "value_error":
        return str(error["ctx"]["error"])
    if kind == "duplicate":
        twice = show(error["ctx"]["value"])
        return f"{key} lists {twice} twice: its entries must be all different"
    if kind == "extra_forbidden":
        return unknown_key(path, value, schema)
    if error["loc"][-1:] == ("[key]",):
        pattern = next(iter(node_at(path[:-1], schema)["patternProperties"]))
        return f"{key} is not allowed as a name: it must be a text matching {pattern}"
    if kind == "both":
        names = " and ".join(f"{key}.{name}" for name in error["ctx"]["names"])
        return f"{names} are not allowed together: it must be one of them"
    if kind == "missing_one":
        kind, path = "missing", [*path, error["ctx"]["key"]]
        key = _key(path)
    if kind == "missing":
        return f"{key} is missing: it must be {allowed(node_at(path, schema), schema)}"
    if {"targets", "method", "methods"} & {*map(str, path)} and str(value) in REMOVED:
        return sentence(value)
    node = node_at(path, schema)
    hint = _hint(value, node)
    return f"{key} = {show(value)} is not allowed: it must be {allowed(node, schema)}{hint}"


def unknown_key(path, value, schema):
    """Return the sentence that refuses a key, by its path, which its section does not have."""
    section, key = node_at(path[:-1], schema), _key(path)
    for name in (key, f"{path[0]}.{path[-1]}"):
        if name in REMOVED:
            return sentence(name)
    new = _RENAMED.get(section.get("title"), {}).get(path[-1])
    if new:
        return f"{key} = {show(value)} is not a known key: it is called {new} now, in N s/m"
    return f"{key} = {show(value)} is not a known key: {_where(path, section, schema)}"


def _where(path, section, schema):
    """Return where an unknown key belongs, else which key was likely meant, else what is known."""
    name, place = str(path[-1]), _key(path[:-1])
    if places := sorted(_sections_with(name, schema), key=lambda section: section.count(".")):
        return f"{name} belongs in {' or '.join(places[:MAX_PLACES])}"
    if meant := difflib.get_close_matches(name, section.get("properties", []), 1):
        return f"did you mean {meant[0]}?"
    return f"{place} must be {allowed(section, schema)}"


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
        computed = value is None and len(match[2]) > MAX_DIGITS
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


def _hint(value, node):
    """Return the unit in which a bare number above its range was likely meant."""
    example = re.search("such as '(.*)'", node.get("$comment", ""))
    most = node.get("maximum", node.get("exclusiveMaximum"))
    return likely(value, example[1], most) if example else ""


def show(value):
    """Return a value as it would stand in YAML, shortened to one line."""
    if value is None:
        text = "null (empty)"
    elif isinstance(value, bool):
        text = str(value).lower()
    else:
        text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}..."


def allowed(node, schema):
    """Return the allowed values of a node of the JSON schema `schema` in words."""
    node = resolve(node, schema)
    if "enum" in node:
        return f"one of {', '.join(map(str, node['enum']))}"
    if "const" in node:
        return str(node["const"])
    kind = node["type"]
    if kind == ["number", "string"]:
        kind = "number"
    if kind in ("number", "integer"):
        # The one number that may be infinite says so in its comment.
        finite = "a number" if ".inf" in node.get("$comment", "") else "a finite number"
        noun = "an integer" if kind == "integer" else finite
        return " ".join(filter(None, [noun, _range(node), node.get("$comment")]))
    if kind in ("string", "boolean") or isinstance(kind, list):
        return node["$comment"]
    if kind == "array":
        least, most = node.get("minItems", 0), node.get("maxItems")
        entries = f"{least} entries" if least == most else "at least one entry"
        return f"a list of {entries}, each {allowed(node['items'], schema)}"
    if "properties" in node:
        return f"a mapping with the keys {', '.join(node['properties'])}"
    (entry,) = node["patternProperties"].values()
    names = "at least one name" if node.get("minProperties") else "names"
    return f"a mapping of {names} to {allowed(entry, schema)}"


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
    key = ""
    for part in path:
        key += f"[{part}]" if isinstance(part, int) else f".{part}" if key else str(part)
    return key or "the configuration"


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

"""Error messages of a configuration, with the key, its value and the allowed values.

The allowed values are read from the JSON schema, so that message, schema and check agree.
"""

import difflib
import re

from gearlib.config import units
from gearlib.parameters import unit_hint

#: Bounds of the JSON schema -> sign.
_SIGNS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
#: Largest numbers of characters of a value, digits of a computed number, and sections in a message.
_MAX_CHARACTERS, _MAX_DIGITS, _MAX_SECTIONS = 60, 12, 3
#: A key and its numeric value, as in "key = 1.5", but not in a sum.
_ASSIGNMENT = re.compile(
    r"(?<! and )\b([A-Za-z][\w.+\[\]-]*) = (-?(?:\d+(?:\.\d+)?(?:e[-+]?\d+)?|inf)\b)"
)


def error_messages(errors, schema):
    """Return a message for each of pydantic's ``ValidationError.errors()``, by the JSON schema."""
    return [_error_message(error, schema) for error in errors]


def _error_message(error, schema):
    """Return the message of one of pydantic's errors: key, value and allowed values."""
    kind, value = error["type"], error["input"]
    # Pydantic marks an error of the key itself, not of its value, by a last "[key]".
    path = [part for part in error["loc"] if part != "[key]"]
    key = _dotted_key(path)
    is_key_error = kind == "invalid_key" or error["loc"][-1:] == ("[key]",)
    if is_key_error and not isinstance(value, str):
        # YAML reads the keys ``4:``, ``on:`` and ``null:`` as a number, a boolean and null.
        key = _dotted_key([*path[:-1], as_text(value)])
        return f"{key} is not allowed as a name: it must be a text; put it in quotes"
    if kind == "value_error":
        text = str(error["ctx"]["error"])
        if is_key_error:
            # The text is "... is not allowed: it must be ..."; "." will be replaced by the key.
            text = f". is not allowed as a name{text[text.index(':') :]}"
        return _with_full_keys(text, key if path else "")
    if kind == "extra_forbidden":
        return unknown_key_error(path, value, schema)
    if is_key_error:
        pattern = next(iter(node_at(path[:-1], schema)["patternProperties"]))
        return f"{key} is not allowed as a name: it must be a text matching {pattern}"
    if kind == "missing_key":
        kind, path = "missing", [*path, error["ctx"]["key"]]
    node = node_at(path, schema)
    if kind == "missing":
        return f"{_dotted_key(path)} is missing: it must be {allowed_text(node, schema)}"
    # The comment of a number with a unit ends with an example such as '10 um'.
    example = re.search("such as '(.*)'", node.get("$comment", ""))
    limits = [node.get(x.lower(), node.get(f"exclusive{x}")) for x in ("Maximum", "Minimum")]
    hint = ""
    if example:
        hint = unit_hint(value, example[1], *limits)
    elif similar := difflib.get_close_matches(str(value), map(str, node.get("enum", [])), 1):
        hint = f"; did you mean {similar[0]}?"
    return f"{key} = {as_text(value)} is not allowed: it must be {allowed_text(node, schema)}{hint}"


def _with_full_keys(message, section_key):
    """Return a message with the section key before keys such as ".name", and in place of "."."""
    prefix = f"{section_key}." if section_key else ""
    text = re.sub(r"(?<!\S)\.(?=\w)", lambda _: prefix, message)
    text = re.sub(r"(?<!\S)\.(?!\w)", lambda _: section_key, text)
    has_key = text != message or not section_key or message.startswith(section_key)
    return text if has_key else f"{section_key}: {message}"


def unknown_key_error(path, value, schema):
    """Return the error message for the unknown key at the end of `path`, a list of nested keys."""
    section, name = node_at(path[:-1], schema), str(path[-1])
    if similar_names := difflib.get_close_matches(name, section.get("properties", []), 1):
        advice = f"did you mean {similar_names[0]}?"
    elif sections := sorted(_sections_with(name, schema), key=lambda key: key.count(".")):
        advice = f"{name} belongs in {' or '.join(sections[:_MAX_SECTIONS])}"
    else:
        advice = f"{_dotted_key(path[:-1])} must be {allowed_text(section, schema)}"
    return f"{_dotted_key(path)} = {as_text(value)} is not a known key: {advice}"


def _sections_with(name, schema, node=None, section_key=""):
    """Yield the keys of the sections that have a key `name`, in `node` and below it."""
    node = resolve(node or schema, schema)
    properties, prefix = node.get("properties", {}), f"{section_key}." if section_key else ""
    if name in properties:
        yield section_key or "the configuration itself, beside its sections"
    for key, inner_node in properties.items():
        yield from _sections_with(name, schema, inner_node, f"{prefix}{key}")
    for inner_node in node.get("patternProperties", {}).values():
        yield from _sections_with(name, schema, inner_node, f"{section_key}.<name>")
    if "items" in node:
        yield from _sections_with(name, schema, node["items"], f"{section_key}[i]")


def with_original_values(message, mapping):
    """Return an error message with values as in the YAML file, such as "10 um" in place of 1e-05.

    `mapping` is the content of the file. Numbers that are not in it are shortened, and what is None
    is missing.
    """

    def original_value(match):
        """Return "key = value" for a match (key, number): as in the file, or shortened."""
        key, number = match[1], match[2]
        value = _value_at(mapping, key)
        if value == float(number) or (isinstance(value, str) and units.TEXT.fullmatch(value)):
            return f"{key} = {as_text(value)}"
        is_computed = value is None and len(number) > _MAX_DIGITS
        return f"{key} = {float(number):.6g}" if is_computed else match[0]

    text = _ASSIGNMENT.sub(original_value, message)
    text = re.sub(r"(\S+) = None with (\S+) = None is not allowed", r"\1 and \2 are missing", text)
    text = text.replace(" = None is not allowed", " is missing")
    # A value with a unit needs no hint that another unit was meant.
    return re.sub(r"(= '[-+.\d][^']*[A-Za-zµ°]' .*); did you mean [^?]*\?", r"\1", text)


def _value_at(node, dotted_key):
    """Return the value of a key such as "run_ups.revolutions[0]" in a nested mapping, or None."""
    for part in re.findall(r"[^.\[\]]+", dotted_key):
        if isinstance(node, (list, tuple)) and part.isdigit() and int(part) < len(node):
            node = node[int(part)]
        else:
            node = node.get(part) if isinstance(node, dict) else None
    return node


def as_text(value):
    """Return a value as text in the style of YAML, shortened to one line."""
    if value is None:
        return "null (empty)"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _MAX_CHARACTERS else f"{text[:_MAX_CHARACTERS]}..."


def allowed_text(node, schema):
    """Return a description of the allowed values of a node of the JSON schema `schema`."""
    node = resolve(node, schema)
    if "enum" in node:
        return f"one of {', '.join(map(str, node['enum']))}"
    if "const" in node:
        return str(node["const"])
    kind, comment = node["type"], node.get("$comment", "")
    if kind in ("number", "integer", ["number", "string"]):
        noun = "a number" if ".inf" in comment else "a finite number"
        noun = "an integer" if kind == "integer" else noun
        return " ".join(filter(None, [noun, _range(node), comment]))
    if kind in ("string", "boolean") or isinstance(kind, list):
        return comment
    if kind == "array":
        length = node.get("minItems", 0)
        items = f"{length} entries" if length == node.get("maxItems") else "at least one entry"
        return f"a list of {items}, each {allowed_text(node['items'], schema)}"
    if "properties" in node:
        return f"a mapping with the keys {', '.join(node['properties'])}"
    (value_node,) = node["patternProperties"].values()
    names = "at least one name" if node.get("minProperties") else "names"
    return f"a mapping of {names} to {allowed_text(value_node, schema)}"


def _range(node):
    """Return the bounds of a number in a JSON schema as text, rounded to five digits."""
    numbers = ((name, node[name]) for name in _SIGNS if name in node)
    bounds = {name: f"{x:.5g}" if isinstance(x, float) else x for name, x in numbers}
    if {"minimum", "maximum"} <= bounds.keys():
        return f"from {bounds['minimum']} to {bounds['maximum']}"
    return " and ".join(f"{_SIGNS[name]} {bound}" for name, bound in bounds.items())


def _dotted_key(path):
    """Return a path of keys and list indices as text, such as "scenes.fig6.cases[0]"."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return "".join(parts).removeprefix(".") or "the configuration"


def node_at(path, schema):
    """Return the node of the JSON schema for a path of keys and list indices."""
    node = schema
    for part in path:
        node = resolve(node, schema)
        # A key that is an integer is no index.
        if isinstance(part, int) and "items" in node:
            node = node["items"]
        elif "properties" in node:
            node = node["properties"][part]
        else:
            (node,) = node["patternProperties"].values()
    return resolve(node, schema)


def resolve(node, schema):
    """Return a node of the JSON schema, or the definition to which it refers."""
    if "$ref" in node:
        return schema["$defs"][node["$ref"].removeprefix("#/$defs/")]
    return node

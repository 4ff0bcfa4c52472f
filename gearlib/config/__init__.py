"""The typed model of ``config.yaml``: every key, its meaning, its allowed range, its default.

Sections lie in files named by their subject; `types` says what a number, a name, a list may be,
`configuration` joins the sections, `validation` writes refusals, `defaults` depend on the gears.

Only ``gear_pair`` (or ``gears`` instead) and ``dampings`` have no defaults. The JSON schema for
editors is made from the model: ``gearlib schema`` prints it, the documentation holds it.

This package stays free of the numerical stack, because every start of the workflow reads it.
"""

import json
import re
from functools import cache

from gearlib.config.validation import as_typed, sentences, show, unknown_key

#: Cases are part of the names of rules.
CASE_NAME = "[A-Za-z][A-Za-z0-9_]*"
#: Key of a damping -> keys that may stand in its place.
IN_PLACE_OF = {
    "material_damping": ("damping_ratio", "logarithmic_decrement"),
    "backlash_damping": ("backlash_damping_ratio",),
}
#: Keys of one section of which there is one.
_ALTERNATIVES = (
    {"gears", "gear_pair"},
    *({key, *others} for key, others in IN_PLACE_OF.items()),
)


class ConfigError(ValueError):
    """The configuration is refused; the message has one sentence per problem."""


def load(mapping):
    """Return the checked configuration; ConfigError has a sentence for each problem.

    `mapping`, what was read from YAML, must have ``gear_pair`` or ``gears``, and ``dampings``.
    """
    # Here and below: a command that needs options only does not wait for the whole.
    from pydantic import ValidationError

    from gearlib.config import defaults
    from gearlib.config.configuration import Config

    if isinstance(mapping, dict) and {"gears", "gear_pair"} <= mapping.keys():
        raise ConfigError(
            "gears and gear_pair are not allowed together: it must be either the drawing of the "
            "gears or the numbers of their mesh"
        )
    try:
        whole, context = defaults.filled(mapping)
        return Config.model_validate(whole, context=context)
    except ValidationError as error:
        problems = sentences(error.errors(), schema())
        raise ConfigError("\n".join(as_typed(text, mapping) for text in problems)) from None


def unknown_sections(mapping):
    """Return a sentence for each section of a mapping that no configuration has."""
    known = {"cases", *schema()["properties"]}
    return [unknown_key([key], mapping[key], schema()) for key in mapping if key not in known]


def laid_over(base, change):
    """Return a copy of `base` with the keys of `change`; mappings are laid over each other.

    A key of the change takes the place of those that say the same in another way.
    """
    replaced = {key for group in _ALTERNATIVES if group & change.keys() for key in group}
    both = {key: value for key, value in base.items() if key not in replaced - change.keys()}
    for key, value in change.items():
        inner = isinstance(value, dict) and isinstance(base.get(key), dict)
        both[key] = laid_over(base[key], value) if inner else value
    return both


def cases(mapping):
    """Return name -> configuration of all cases, each accepted by `load`.

    Each lays the keys that it has under ``cases`` over those beside it.
    """
    changes = mapping["cases"]
    if not isinstance(changes, dict) or not changes:
        raise ConfigError(
            f"cases = {show(changes)} is not allowed: it must be a mapping of at least one name to "
            "the keys that differ"
        )
    common = {key: value for key, value in mapping.items() if key != "cases"}
    settings, problems = {}, []
    for name, change in changes.items():
        if not isinstance(name, str) or not re.fullmatch(CASE_NAME, name):
            problems.append(
                f"cases.{name} is not allowed as a name: it must be letters, digits and _, a "
                "letter first"
            )
        elif not isinstance(change, dict):
            problems.append(
                f"cases.{name} = {show(change)} is not allowed: it must be a mapping of the keys "
                "that differ"
            )
        else:
            settings[name] = laid_over(common, change)
            try:
                load(settings[name])
            except ConfigError as error:
                problems += [f"cases.{name}: {line}" for line in str(error).splitlines()]
    if problems:
        raise ConfigError("\n".join(problems))
    return settings


def chosen(merged, change):
    """Return the keys that count of a configuration over which a change was laid.

    Where the configuration has a `gear_pair` and the change `gears`, only the change counts:
    dampings, bearings and choices of scenes suit the pair for which they were made. A train comes
    without the choice of targets, which suits that of the other one; where nothing is changed but
    the train, they are those of trains. `merged` is all that was read.
    """
    from gearlib.config.targets import OF_ANY_TRAIN

    named = change.get("cases")
    parts = [change, *(named.values() if isinstance(named, dict) else ())]
    changed = {key for part in parts if isinstance(part, dict) for key in part}
    if "gears" in changed and "gear_pair" in merged and "gear_pair" not in change:
        return change
    if "train" in changed and "targets" not in changed:
        merged = {key: value for key, value in merged.items() if key != "targets"}
        if not changed & {"gears", "gear_pair"}:
            merged["targets"] = list(OF_ANY_TRAIN)
    return laid_over(merged, change)


@cache
def schema():
    """Return the JSON schema of the configuration as a dict."""
    from gearlib.config.configuration import Config

    whole = Config.model_json_schema()
    _drop_null_defaults(whole)
    whole["required"].remove("gear_pair")
    whole["oneOf"] = [{"required": ["gear_pair"]}, {"required": ["gears"]}]
    return whole


def _drop_null_defaults(node):
    """Drop defaults of keys that may be left out: null is refused."""
    if isinstance(node, dict):
        if "default" in node and node["default"] is None:
            del node["default"]
        for value in node.values():
            _drop_null_defaults(value)


def schema_text():
    """Return the JSON schema as the text of its file; it knows the key `cases` too."""
    whole = {**schema(), "properties": dict(schema()["properties"])}
    whole["properties"]["cases"] = {
        "description": "Several cases side by side: name -> keys that differ; results/<case>/.",
        "patternProperties": {f"^{CASE_NAME}$": {"type": "object"}},
        "additionalProperties": False,
        "minProperties": 1,
        "type": "object",
    }
    # Cases may have all of it.
    pair = {"oneOf": whole.pop("oneOf"), "required": whole.pop("required")}
    whole["anyOf"] = [pair, {"required": ["cases"]}]
    return json.dumps(whole, indent=2) + "\n"

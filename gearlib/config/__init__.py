"""The typed model of ``config.yaml``: every key, its meaning, its allowed range, its default.

`types` defines numbers, names and lists, `configuration` joins the sections, `validation` writes
error messages, `defaults` derives defaults from the gears. ``gear_pair`` (or ``gears`` instead) and
``dampings`` have no defaults. The JSON schema for editors is made from the model.

This package does not import the numerical stack, because every start of the workflow reads it.
"""

import json
import re
from functools import cache
from typing import Any

from gearlib.config import validation

#: Pattern of the names of cases, which are parts of names of workflow rules.
CASE_NAME = "[A-Za-z][A-Za-z0-9_]*"
#: Damping coefficient -> keys that may replace it.
RATIO_KEYS = {
    "material_damping": ("damping_ratio", "logarithmic_decrement"),
    "backlash_damping": ("backlash_damping_ratio",),
}
#: Sets of keys that exclude each other within a section.
_ALTERNATIVES = [{"gears", "gear_pair"}, *({key, *keys} for key, keys in RATIO_KEYS.items())]


class ConfigError(ValueError):
    """The configuration is refused; the message has one sentence per problem."""


def load(mapping: dict) -> Any:
    """Return the validated configuration for the content of a YAML file, or raise ConfigError."""
    # pydantic is imported here so that `gearlib --help` starts quickly.
    from pydantic import ValidationError

    from gearlib.config import defaults
    from gearlib.config.configuration import Config

    if isinstance(mapping, dict) and {"gears", "gear_pair"} <= mapping.keys():
        raise ConfigError(
            "gears and gear_pair are not allowed together: it must be either the drawing of the "
            "gears or the numbers of their mesh"
        )
    try:
        completed, context = defaults.add_defaults(mapping)
        return Config.model_validate(completed, context=context)
    except ValidationError as error:
        messages = validation.sentences(error, Config, mapping)
        raise ConfigError("\n".join(messages)) from None


def unknown_sections(mapping: dict) -> list[str]:
    """Return an error message for each top-level key of `mapping` that is not in the schema."""
    from gearlib.config.configuration import Config

    unknown_keys = [key for key in mapping if key not in {"cases", *Config.model_fields}]
    return [validation.unknown_key(Config, Config, (key,), mapping[key]) for key in unknown_keys]


def overlay(base: dict, changes: dict) -> dict:
    """Return a copy of the configuration `base` updated with `changes`, section by section.

    A key of `changes` also removes alternative keys of `base` that set the same quantity, such as
    `gear_pair` where `changes` has `gears`.
    """
    alternatives = {key for group in _ALTERNATIVES if group & changes.keys() for key in group}
    merged = {
        key: value for key, value in base.items() if key in changes or key not in alternatives
    }
    for key, value in changes.items():
        is_section = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = overlay(base[key], value) if is_section else value
    return merged


def cases(mapping: dict) -> dict[str, dict]:
    """Return the configuration of each case by the name of the case, each accepted by `load`.

    The keys of a case under ``cases`` replace those of the rest of the configuration `mapping`,
    whose scenes are left out for another `gear_pair`.
    """
    case_changes = mapping["cases"]
    if not isinstance(case_changes, dict) or not case_changes:
        raise ConfigError(
            f"cases = {validation.as_text(case_changes)} is not allowed: it must be a mapping of "
            "at least one name to the keys that differ"
        )
    common = {key: value for key, value in mapping.items() if key != "cases"}
    configurations, problems = {}, []
    for name, changes in case_changes.items():
        if not isinstance(name, str) or not re.fullmatch(CASE_NAME, name):
            problems.append(
                f"cases.{name} is not allowed as a name: it must be letters, digits and _, a "
                "letter first"
            )
        elif not isinstance(changes, dict):
            problems.append(
                f"cases.{name} = {validation.as_text(changes)} is not allowed: it must be a "
                "mapping of the keys that differ"
            )
        else:
            configurations[name] = _overlay_pair(common, changes)
            try:
                load(configurations[name])
            except ConfigError as error:
                problems += [f"cases.{name}: {line}" for line in str(error).splitlines()]
    if problems:
        raise ConfigError("\n".join(problems))
    return configurations


def overlay_gears(base: dict, changes: dict) -> dict:
    """Return the configuration `base` updated with `changes`, without keys that no longer fit.

    If `base` has a `gear_pair` and `changes` has drawn `gears`, return only `changes`, because the
    dampings, bearings and scenes of `base` belong to another pair; of another `gear_pair` only the
    scenes are left out. If `changes` replaces the train
    without naming targets, the targets of `base` are dropped. If `changes` also replaces the gears,
    the default targets apply; otherwise only the targets of trains are kept.
    """
    from gearlib.config.targets import TRAIN_TARGETS

    case_changes = changes.get("cases")
    sections = [changes]
    if isinstance(case_changes, dict):
        sections += case_changes.values()
    changed = {key for section in sections if isinstance(section, dict) for key in section}
    if "gears" in changed and "gear_pair" in base and "gear_pair" not in changes:
        return changes
    if "train" in changed and "targets" not in changed:
        base = {key: value for key, value in base.items() if key != "targets"}
        if not changed & {"gears", "gear_pair"}:
            base["targets"] = list(TRAIN_TARGETS)
    return _overlay_pair(base, changes)


def _overlay_pair(base: dict, changes: dict) -> dict:
    """Return the configuration `base` updated with `changes`, without scenes of another pair."""
    from gearlib.config import gear_names

    merged = overlay(base, changes)
    if "scenes" in base and gear_names.parameters_differ(base, merged):
        return overlay({key: x for key, x in base.items() if key != "scenes"}, changes)
    return merged


@cache
def schema() -> dict:
    """Return the JSON schema of the configuration."""
    from gearlib.config.configuration import Config

    config_schema = Config.model_json_schema()
    _drop_null_defaults(config_schema)
    config_schema["required"].remove("gear_pair")
    config_schema["oneOf"] = [{"required": ["gear_pair"]}, {"required": ["gears"]}]
    return config_schema


def _drop_null_defaults(node: object) -> None:
    """Remove the default null from a node and those in it: the key may be missing, but not null."""
    if isinstance(node, dict):
        if "default" in node and node["default"] is None:
            del node["default"]
        for value in node.values():
            _drop_null_defaults(value)


def schema_text() -> str:
    """Return the JSON schema of configuration files as text; it includes the key `cases`."""
    file_schema = {**schema(), "properties": dict(schema()["properties"])}
    file_schema["properties"]["cases"] = {
        "description": "Cases side by side: name -> keys that differ; results in results/<case>/.",
        "patternProperties": {f"^{CASE_NAME}$": {"type": "object"}},
        "additionalProperties": False,
        "minProperties": 1,
        "type": "object",
    }
    # A file with cases may have the required keys in its cases only.
    without_cases = {"oneOf": file_schema.pop("oneOf"), "required": file_schema.pop("required")}
    file_schema["anyOf"] = [without_cases, {"required": ["cases"]}]
    return json.dumps(file_schema, indent=2) + "\n"

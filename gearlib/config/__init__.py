"""The typed model of ``config.yaml``: every key with its meaning, allowed range and default.

`types` defines numbers, names and lists, `configuration` combines the sections, `validation` writes
error messages, `defaults` derives default values from the gears. ``gear_pair`` (or ``gears``
instead) and ``dampings`` have no defaults. The JSON schema for editors is generated from the model.

This package does not import the numerical packages, because the workflow loads it at every start.
"""

import json
from functools import cache
from typing import Any

from gearlib.config import validation

#: Damping coefficient -> keys that can be given instead.
RATIO_KEYS = {
    "material_damping": ("damping_ratio", "logarithmic_decrement"),
    "backlash_damping": ("backlash_damping_ratio",),
}
#: Sets of mutually exclusive keys of a section.
_ALTERNATIVES = [{"gears", "gear_pair"}, *({key, *keys} for key, keys in RATIO_KEYS.items())]


class ConfigError(ValueError):
    """Error for an invalid configuration; the message has one line per problem."""


def load(mapping: dict) -> Any:
    """Validate the content of a YAML file and return it as a `Config` with all defaults.

    Raise `ConfigError` if the content is invalid; the message has one line per problem.
    """
    # These modules are imported here, not above, to keep `gearlib --help` fast.
    from pydantic import ValidationError

    from gearlib.config import defaults
    from gearlib.config.configuration import Config

    if isinstance(mapping, dict) and "gearbox" in mapping:
        mapping = _add_unused_pair(mapping)
    if isinstance(mapping, dict) and {"gears", "gear_pair"} <= mapping.keys():
        raise ConfigError(
            "gears and gear_pair are not allowed together: give either the geometry of the gears "
            "or the parameters of the gear pair"
        )
    try:
        completed, context = defaults.add_defaults(mapping)
        return Config.model_validate(completed, context=context)
    except ValidationError as error:
        messages = validation.error_messages(error, Config, mapping)
        raise ConfigError("\n".join(messages)) from None


def _add_unused_pair(mapping: dict) -> dict:
    """Add a gear pair to the configuration of a gearbox if it has none, and return it.

    The configuration requires a gear pair and a damping, but the gearbox, which becomes the only
    default target, does not use them. The gear pair of the paper and zero damping are added. Keys
    of `mapping`, the content of the YAML file, take precedence.
    """
    from gearlib.config.targets import NOT_GIVEN
    from gearlib.models.pair_parameters import PAPER

    if {"gears", "gear_pair"} & mapping.keys():
        return mapping
    pair = PAPER | {"load": 1.0, "backlash": 1.0, "teeth": 1}
    dampings = {NOT_GIVEN: {"material_damping": 0.0, "backlash_damping": 0.0}}
    return {"gear_pair": pair, "dampings": dampings, "targets": ["gearbox"]} | mapping


def unknown_section_messages(mapping: dict) -> list[str]:
    """Return an error message for each unknown top-level key of a YAML file.

    `mapping` is the content of the file. The known keys are the fields of the class `Config`.
    """
    from gearlib.config.configuration import Config

    unknown_keys = [key for key in mapping if key not in Config.model_fields]
    return [
        validation.unknown_key_message(Config, Config, (key,), mapping[key]) for key in unknown_keys
    ]


def overlay(base: dict, changes: dict) -> dict:
    """Return a copy of the configuration `base`, recursively updated with `changes`.

    Both are nested dicts, as in a YAML file. A key of `changes` also removes the keys of `base`
    that are mutually exclusive with it (see `_ALTERNATIVES`). E.g. `gears` removes `gear_pair`, and
    `damping_ratio` removes `material_damping`.
    """
    replaced_keys = set()
    for alternatives in _ALTERNATIVES:
        if alternatives & changes.keys():
            replaced_keys |= alternatives
    merged = {
        key: value for key, value in base.items() if key in changes or key not in replaced_keys
    }
    for key, value in changes.items():
        is_section = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = overlay(base[key], value) if is_section else value
    return merged


def overlay_gears(base: dict, changes: dict) -> dict:
    """Return `base` updated with `changes`, without sections that do not suit the new gears.

    Both are nested dicts, as in a YAML file.

    - If gears given by geometry or a gearbox replace a `gear_pair`, nothing of `base` is kept,
      because its dampings, bearings and scenes (figures of selected runs) belong to that pair.
    - If another `gear_pair` is given, the scenes are removed.
    - If a gear train is given without gears or targets, the targets of gear trains are used.
    """
    from gearlib.config import gear_names
    from gearlib.config.targets import TRAIN_TARGETS

    if {"gears", "gearbox"} & changes.keys() and "gear_pair" in base and "gear_pair" not in changes:
        return changes
    if "train" in changes and not {"gears", "gear_pair", "targets"} & changes.keys():
        changes = {"targets": list(TRAIN_TARGETS), **changes}
    if gear_names.parameters_differ(base, overlay(base, changes)):
        base = {key: value for key, value in base.items() if key != "scenes"}
    return overlay(base, changes)


@cache
def schema() -> dict:
    """Return the JSON schema of the configuration, with which editors check a file.

    pydantic generates the schema from the class `Config`, in which `gear_pair` is required: if a
    file has the section `gears` instead, the pair is derived before the validation. The returned
    schema requires exactly one of the two sections.
    """
    from gearlib.config.configuration import Config

    config_schema = Config.model_json_schema()
    _drop_null_defaults(config_schema)
    config_schema["required"].remove("gear_pair")
    config_schema["oneOf"] = [{"required": ["gear_pair"]}, {"required": ["gears"]}]
    return config_schema


def _drop_null_defaults(node: object) -> None:
    """Recursively remove the default null from a node of a JSON schema.

    In the model, None means that a key is omitted. In a file, null is not allowed as a value, so
    the schema must not suggest it.
    """
    if isinstance(node, dict):
        if "default" in node and node["default"] is None:
            del node["default"]
        for value in node.values():
            _drop_null_defaults(value)


def schema_text() -> str:
    """Return the JSON schema of configuration files as a JSON string."""
    return json.dumps(schema(), indent=2) + "\n"

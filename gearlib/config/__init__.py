"""The typed model of ``config.yaml``: every key, its meaning, its allowed range, its default.

`types` defines numbers, names and lists, `configuration` joins the sections, `validation` writes
error messages, `defaults` derives defaults from the gears. ``gear_pair`` (or ``gears`` instead) and
``dampings`` have no defaults. The JSON schema for editors is made from the model.

This package does not import the numerical stack, because each start of the workflow loads it.
"""

import json
from functools import cache
from typing import Any

from gearlib.config import validation

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
    """Return the validated `Config` for the content of a YAML file, or raise ConfigError.

    `mapping` is the content of the file as a dict, to which defaults are added here. The message of
    the error has one line per problem.
    """
    # These modules are imported here, not above, so that `gearlib --help` starts quickly.
    from pydantic import ValidationError

    from gearlib.config import defaults
    from gearlib.config.configuration import Config

    if isinstance(mapping, dict) and "gearbox" in mapping:
        mapping = _add_unused_pair(mapping)
    if isinstance(mapping, dict) and {"gears", "gear_pair"} <= mapping.keys():
        raise ConfigError(
            "gears and gear_pair are not allowed together: it must be either the geometry of the "
            "gears or the numbers of their mesh"
        )
    try:
        completed, context = defaults.add_defaults(mapping)
        return Config.model_validate(completed, context=context)
    except ValidationError as error:
        messages = validation.error_messages(error, Config, mapping)
        raise ConfigError("\n".join(messages)) from None


def _add_unused_pair(mapping: dict) -> dict:
    """Return a configuration that has a gearbox, with a gear pair added if it has none.

    `mapping` is the content of a YAML file. The added pair (the gear pair of the paper) and its
    zero damping only make the configuration valid, because the model requires a pair. The only
    default target, the gearbox, does not use them. Keys of `mapping` take precedence.
    """
    from gearlib.config.targets import NOT_GIVEN
    from gearlib.models.pair_parameters import PAPER

    if {"gears", "gear_pair"} & mapping.keys():
        return mapping
    pair = PAPER | {"load": 1.0, "backlash": 1.0, "teeth": 1}
    dampings = {NOT_GIVEN: {"material_damping": 0.0, "backlash_damping": 0.0}}
    return {"gear_pair": pair, "dampings": dampings, "targets": ["gearbox"]} | mapping


def unknown_section_messages(mapping: dict) -> list[str]:
    """Return an error message for each top-level key of `mapping` that is not allowed.

    `mapping` is the content of a YAML file. Allowed keys are the fields of the class `Config`.
    """
    from gearlib.config.configuration import Config

    unknown_keys = [key for key in mapping if key not in Config.model_fields]
    return [
        validation.unknown_key_message(Config, Config, (key,), mapping[key]) for key in unknown_keys
    ]


def overlay(base: dict, changes: dict) -> dict:
    """Return a copy of the configuration `base` updated with `changes`, section by section.

    Both are nested dicts as in a YAML file. A key of `changes` also removes those keys of `base`
    that would set the same quantity in another way, as listed in `_ALTERNATIVES`: `gears` removes
    `gear_pair`, for example, and `damping_ratio` removes `material_damping`.
    """
    alternatives = set()
    for group in _ALTERNATIVES:
        if group & changes.keys():
            alternatives |= group
    merged = {
        key: value for key, value in base.items() if key in changes or key not in alternatives
    }
    for key, value in changes.items():
        is_section = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = overlay(base[key], value) if is_section else value
    return merged


def overlay_gears(base: dict, changes: dict) -> dict:
    """Return the configuration `base` updated with `changes`, without keys that no longer fit.

    Both are nested dicts as in a YAML file. If `changes` has gears given by geometry or a gearbox,
    and `base` has a `gear_pair`, nothing of `base` is kept, because its damping values, bearings
    and scenes (figures of a few chosen runs) belong to that pair. If `changes` has another
    `gear_pair`, the scenes of `base` are removed. If `changes` has a gear train but neither gears
    nor targets, the targets become those of gear trains.
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
    """Return the JSON schema of the configuration, which editors use to check a file.

    pydantic makes the schema from the class `Config`. In this class `gear_pair` is required,
    because a pair is derived from the section `gears` before the validation if a file has that
    section. The schema says instead that a file must have exactly one of the two.
    """
    from gearlib.config.configuration import Config

    config_schema = Config.model_json_schema()
    _drop_null_defaults(config_schema)
    config_schema["required"].remove("gear_pair")
    config_schema["oneOf"] = [{"required": ["gear_pair"]}, {"required": ["gears"]}]
    return config_schema


def _drop_null_defaults(node: object) -> None:
    """Remove each default null from a node of a JSON schema and from all nodes below it.

    In the model None only means that a key is left out. A schema that states null as the default
    would suggest that a user may write it, which is not allowed.
    """
    if isinstance(node, dict):
        if "default" in node and node["default"] is None:
            del node["default"]
        for value in node.values():
            _drop_null_defaults(value)


def schema_text() -> str:
    """Return the JSON schema of configuration files as text."""
    return json.dumps(schema(), indent=2) + "\n"

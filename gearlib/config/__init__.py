"""The typed model of ``config.yaml``: every key, its meaning, its allowed range, its default.

Sections lie in files named by their subject; `types` says what a number, a name, a list may be,
`configuration` joins the sections, `validation` writes refusals, `defaults` depend on the gears.

Only ``gear_pair`` (or ``gears`` instead) and ``dampings`` have no defaults. The JSON schema for
editors is made from the model: ``gearlib schema`` prints it, the documentation holds it.

This package stays free of the numerical stack, because every start of the workflow reads it.
"""

import copy
import json
import re
from functools import cache

from gearlib.config.validation import as_typed, sentences, show, unknown_key

#: Cases are part of the names of rules.
CASE_NAME = "[A-Za-z][A-Za-z0-9_]*"


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

    problems = list(names_that_are_no_texts(mapping))
    if isinstance(mapping, dict) and {"gears", "gear_pair"} <= mapping.keys():
        problems.append(
            "gears and gear_pair are not allowed together: it must be either the drawing of the "
            "gears or the numbers of their mesh"
        )
    if problems:
        raise ConfigError("\n".join(problems))
    whole, problems = defaults.filled(mapping)
    if not problems:
        try:
            return Config.model_validate(whole)
        except ValidationError as error:
            problems = sentences(error.errors(), schema())
    raise ConfigError("\n".join(as_typed(problem, mapping) for problem in problems))


def unknown_sections(mapping):
    """Return a sentence for each section of a mapping that no configuration has."""
    known = {"cases", *schema()["properties"]}
    return [unknown_key([key], mapping[key], schema()) for key in mapping if key not in known]


def names_that_are_no_texts(mapping, where=""):
    """Yield a sentence for each; YAML takes ``4:``, ``on:`` and ``null:`` for other things."""
    if isinstance(mapping, dict):
        for key, value in mapping.items():
            if not isinstance(key, str):
                yield (
                    f"{where}{show(key)} is not allowed as a name: it must be a text, in quotes "
                    "where YAML reads something else"
                )
            else:
                yield from names_that_are_no_texts(value, f"{where}{key}.")
    elif isinstance(mapping, list):
        for i, value in enumerate(mapping):
            yield from names_that_are_no_texts(value, f"{where.removesuffix('.')}[{i}].")


def cases(mapping):
    """Return name -> configuration of all cases, each accepted by `load`.

    Each lays the keys that it has under ``cases`` over those beside it.
    """
    from gearlib.config.laying import laid_over

    changes = mapping["cases"]
    if not isinstance(changes, dict) or not changes:
        raise ConfigError(
            f"cases = {show(changes)} is not allowed: it must be a mapping of at least one name to "
            "the keys that differ"
        )
    common = {key: value for key, value in mapping.items() if key != "cases"}
    found, problems = {}, []
    for name, change in changes.items():
        if not isinstance(name, str) or not re.fullmatch(CASE_NAME, name):
            problems.append(
                f"cases.{name} is not allowed as a name: it must be letters, digits and _, a "
                "letter first"
            )
            continue
        if not isinstance(change, dict):
            problems.append(
                f"cases.{name} = {show(change)} is not allowed: it must be a mapping of the keys "
                "that differ"
            )
            continue
        found[name] = laid_over(common, change)
        try:
            load(found[name])
        except ConfigError as error:
            problems += [f"cases.{name}: {line}" for line in str(error).splitlines()]
    if problems:
        raise ConfigError("\n".join(problems))
    return found


def chosen(merged, given):
    """Return what counts of a configuration that was laid over another one.

    Where the other one has a `gear_pair` and what was laid over it `gears`, only this counts:
    dampings, bearings and choices of scenes suit the pair for which they were made. A train comes
    without the choice of targets, which suits that of the other one; where nothing is given but the
    train, they are those of trains. `merged` is all that was read, `given` what was laid over the
    other one.
    """
    from gearlib.config.laying import laid_over
    from gearlib.config.targets import OF_ANY_TRAIN

    named = given.get("cases")
    parts = [given, *(named.values() if isinstance(named, dict) else ())]
    said = {key for part in parts if isinstance(part, dict) for key in part}
    if "gears" in said and "gear_pair" in merged and "gear_pair" not in given:
        return given
    if "train" in said and "targets" not in said:
        merged = {key: value for key, value in merged.items() if key != "targets"}
        if not said & {"gears", "gear_pair"}:
            merged["targets"] = list(OF_ANY_TRAIN)
    return laid_over(merged, given)


@cache
def schema():
    """Return the JSON schema of the configuration as a dict."""
    from gearlib.config import defaults
    from gearlib.config.configuration import Config

    whole = Config.model_json_schema()
    defaults.release(whole)
    _drop_null_defaults(whole)
    whole["required"].remove("gear_pair")
    whole["oneOf"] = [{"required": ["gear_pair"]}, {"required": ["gears"]}]
    return whole


def _drop_null_defaults(node):
    """A key that may be left out has no default that could be written: null is refused."""
    if isinstance(node, dict):
        default = node.get("default")
        if "default" in node and (default is None or None in getattr(default, "values", list)()):
            del node["default"]
        for value in node.values():
            _drop_null_defaults(value)


def schema_text():
    """Return the JSON schema as the text of its file; it knows the key `cases` too."""
    whole = copy.deepcopy(schema())
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

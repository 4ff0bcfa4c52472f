"""Read YAML files and write error messages with the key, its value and the allowed values.

Duplicate keys are reported as errors, because PyYAML silently keeps only the last one.
"""

import difflib
from collections.abc import Iterator
from typing import Any, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError

from gearlib import parameters
from gearlib.checks import InputError, describe_violation

#: Largest number of characters of a value, and of sections, in a message.
_MAX_CHARACTERS, _MAX_SECTIONS = 60, 3


def error_messages(error: ValidationError, root: type, content: Any) -> list[str]:
    """Return one error message for each problem that pydantic found in a YAML file.

    `content` is the content of the file, and `root` the section class that was validated.
    """
    return [_error_message(details, root, content) for details in error.errors(include_url=False)]


def _error_message(details: Any, root: type, content: Any) -> str:
    """Return the message for one problem that pydantic found: key, value, allowed values.

    `details` is an entry of `ValidationError.errors`, a dict with the location ("loc") and the type
    of the problem. `root` is the section class of the whole `content` of the YAML file.
    """
    location, error_type = details["loc"], details["type"]
    cause = details.get("ctx", {}).get("error")
    # Pydantic appends "[key]" to the location if the key is invalid, not its value.
    names = tuple(name for name in location if name != "[key]")
    path, annotation = parameters.resolve_location(root, names)
    if location[-1:] == ("[key]",) or error_type == "invalid_key":
        mapping = parameters.resolve_location(root, names[:-1])[1]
        return _invalid_name_message(mapping, (*names[:-1], details["input"]), cause)
    if error_type == "extra_forbidden":  # pydantic's name for an unknown key
        return unknown_key_message(root, annotation, (*path, names[-1]), details["input"])
    if error_type.startswith("union_tag"):  # the key `kind` that selects one of several sections
        sections = get_args(parameters.split_annotation(annotation)[0])
        path, annotation = (*path, "kind"), parameters.kind_literal(sections)
        error_type = error_type.replace("union_tag_not_found", "missing")
    key = parameters.format_path(path)
    if isinstance(cause, InputError):
        return input_error_message(cause, key, content)
    if cause is not None and str(cause):
        return f"{key}: {cause}" if key else str(cause)
    # For all other problems, the message states the allowed values of the type.
    allowed = parameters.describe_requirement(annotation, in_file=True)
    if error_type == "missing":
        return f"{key} is missing: it must be {allowed}"
    value = _get_nested(content, path, details["input"])
    problem = describe_violation(format_value(value), allowed + _suggest_value(value, annotation))
    return f"{key or 'the configuration'} {problem}"


def input_error_message(error: InputError, section: str, content: Any) -> str:
    """Return the message of an `InputError` raised by a section such as "gears.wheel".

    The path in `error` is relative to `section`. The message quotes the value from `content`, the
    content of the file. Computed values, which are not in the file, are rounded to six digits.
    """
    separator = "." if section and error.path and not error.path.startswith("[") else ""
    path = f"{section}{separator}{error.path}"
    full_name = f"{path} of {error.owner}" if error.owner else path
    if error.problem:
        return f"{full_name} {error.problem}"
    value = _get_nested(content, path.replace("[", ".").replace("]", "").split("."), None)
    if value is None and error.value is None:
        return f"{full_name} is missing: it must be {error.requirement}"
    if value is None:
        value = float(f"{error.value:.6g}") if isinstance(error.value, float) else error.value
    return f"{full_name} {describe_violation(format_value(value), error.requirement)}"


def _get_nested(content: Any, path: Any, default: Any) -> Any:
    """Return the value at a path of keys and indices in nested dicts and lists.

    If the path does not exist in `content`, return `default`.
    """
    for name in path:
        if isinstance(content, list | tuple) and str(name).isdigit() and int(name) < len(content):
            content = content[int(name)]
        elif isinstance(content, dict) and name in content:
            content = content[name]
        else:
            return default
    return content


def _suggest_value(value: Any, annotation: Any) -> str:
    """Return a suggestion for an invalid value, e.g. "; did you mean 3 mm?", or "".

    The suggestion is the most similar choice of the type `annotation`, or the value with a suitable
    unit.
    """
    choices = [str(choice) for choice in get_args(parameters.split_annotation(annotation)[0])]
    similar = difflib.get_close_matches(str(value), choices, 1)
    return f"; did you mean {similar[0]}?" if similar else parameters.unit_hint(value, annotation)


def _invalid_name_message(mapping: Any, path: tuple, cause: Any) -> str:
    """Return the message for an invalid name in a mapping whose keys are user-defined names.

    The name is the last entry of `path`. `mapping` is the type of the mapping, and `cause` the
    exception raised when the name was checked, or None.
    """
    if not isinstance(path[-1], str):
        # YAML parses the keys ``4:``, ``on:`` and ``null:`` as a number, a boolean and null.
        path = (*path[:-1], format_value(path[-1]))
        allowed = "a string; put it in quotes"
    elif isinstance(cause, InputError):
        allowed = cause.requirement
    else:
        allowed = parameters.describe_requirement(
            get_args(parameters.split_annotation(mapping)[0])[0], in_file=True
        )
    return f"{parameters.format_path(path)} is not allowed as a name: it must be {allowed}"


def unknown_key_message(root: type, section: Any, path: tuple, value: Any) -> str:
    """Return the message for an unknown key, with advice on the key that may be meant.

    The key is the last entry of `path`; its value is `value`. `section` is the type of its section
    and `root` the class of the whole configuration. The advice is a similar key of the section,
    other sections that have this key, or a list of the keys of the section.
    """
    fields, key = parameters.split_annotation(section)[0].__pydantic_fields__, str(path[-1])
    similar_names = difflib.get_close_matches(key, fields, 1)
    sections = sorted(_find_sections(key, root), key=lambda name: name.count("."))
    if similar_names:
        advice = f"did you mean {similar_names[0]}?"
    elif sections:
        advice = f"{key} belongs in {' or '.join(sections[:_MAX_SECTIONS])}"
    else:
        name = parameters.format_path(path[:-1]) or "the configuration"
        advice = f"{name} must be {parameters.describe_requirement(section, in_file=True)}"
    return f"{parameters.format_path(path)} = {format_value(value)} is not a known key: {advice}"


def _find_sections(key: str, annotation: Any, section: str = "") -> Iterator[str]:
    """Yield the paths of all sections that have the key `key`, e.g. "scenes.<name>.cases[i]".

    The recursive search starts at the section with the path `section` ("" for the whole
    configuration) and the type `annotation`.
    """
    base, _ = parameters.split_annotation(annotation)
    if isinstance(base, type) and issubclass(base, BaseModel):
        if key in base.__pydantic_fields__:
            yield section or "the configuration itself, beside its sections"
        for name, field in base.__pydantic_fields__.items():
            yield from _find_sections(key, field.annotation, f"{section}.{name}".lstrip("."))
    elif get_origin(base) is dict:
        yield from _find_sections(key, get_args(base)[1], f"{section}.<name>")
    elif get_origin(base) in (list, tuple):
        yield from _find_sections(key, get_args(base)[0], f"{section}[i]")


def format_value(value: Any) -> str:
    """Format a value in the style of YAML, truncated to `_MAX_CHARACTERS` characters."""
    if value is None:
        return "null (empty)"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _MAX_CHARACTERS else f"{text[:_MAX_CHARACTERS]}..."


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """Safe YAML loader that records duplicate keys."""

    duplicates: list[str]  #: messages such as "the key teeth is given again in line 4"

    def construct_mapping(self, node, deep=False):
        """Return a YAML mapping as a dict, and record its duplicate keys.

        The method overrides a method of PyYAML, which keeps the last value of a duplicate key
        without an error.
        """
        # Keys that are lists or mappings are skipped; the validation rejects them later.
        keys = [key for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        for i, key in enumerate(keys):
            if any(key.value == earlier.value for earlier in keys[:i]):
                line = key.start_mark.line + 1
                self.duplicates.append(f"the key {key.value} is given again in line {line}")
        return super().construct_mapping(node, deep)


def read_yaml(path):
    """Return the content of a YAML file as a dict, and a list of errors about duplicate keys.

    Raise ValueError if the file cannot be read or does not contain a mapping; the message states
    the file name and the line.
    """
    try:
        with open(path, encoding="utf-8") as file:
            loader = _Loader(file.read())
        loader.duplicates = []
        content = loader.get_single_data()
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, yaml.reader.ReaderError):
        raise ValueError(f"{path} is not YAML: it must be a text file in UTF-8") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not YAML{_format_yaml_error(error)}") from None
    if content is None:
        raise ValueError(f"{path} is empty: it must be a mapping of keys to values")
    if not isinstance(content, dict):
        allowed = "a mapping with a key, a colon and a value in each line"
        raise ValueError(f"{path}: {format_value(content)} is not allowed: it must be {allowed}")
    errors = [f"{path}: {message}, but must be given once" for message in loader.duplicates]
    return content, errors


def _format_yaml_error(error):
    """Format the position and the message of an error of the YAML parser.

    The text starts with the line and column, if they are known, and may end with a hint.
    """
    mark = getattr(error, "problem_mark", None)
    position = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    messages = [getattr(error, "context", None), getattr(error, "problem", None)]
    text = ", ".join(filter(None, messages)) or " ".join(str(error).split())
    is_about_colons = "mapping values" in text or "':'" in text
    hint = "; is a colon missing, or the indentation wrong?" if is_about_colons else ""
    return f"{position}: {text}{hint}"

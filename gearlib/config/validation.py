"""Reading of YAML files, and sentences about wrong values in them: key, value, allowed values.

Keys that a mapping repeats are reported, because YAML silently keeps the last one.
"""

import difflib
from collections.abc import Iterator
from typing import Any, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError

from gearlib import parameters
from gearlib.checks import InputError, describe_violation

#: Largest numbers of characters of a value, and of sections in a message.
_MAX_CHARACTERS, _MAX_SECTIONS = 60, 3


def error_messages(error: ValidationError, root: type, content: Any) -> list[str]:
    """Return a sentence for each problem that pydantic found in the content of a YAML file.

    `error` has the problems, and `root` is the section class of the whole `content`.
    """
    return [_error_message(details, root, content) for details in error.errors(include_url=False)]


def _error_message(details: Any, root: type, content: Any) -> str:
    """Return a sentence about one problem that pydantic found: key, value, allowed values.

    `details` is an entry of `ValidationError.errors`, a dict with the place ("loc") and the kind
    ("type") of the problem. `root` is the section class of the whole `content` of the YAML file.
    """
    location, kind = details["loc"], details["type"]
    cause = details.get("ctx", {}).get("error")
    # Pydantic marks an error of the key itself, not of its value, by a last "[key]".
    names = tuple(name for name in location if name != "[key]")
    path, annotation = parameters.resolve_location(root, names)
    if location[-1:] == ("[key]",) or kind == "invalid_key":
        mapping = parameters.resolve_location(root, names[:-1])[1]
        return _invalid_name_message(mapping, (*names[:-1], details["input"]), cause)
    if kind == "extra_forbidden":  # pydantic's name for an unknown key
        return unknown_key_message(root, annotation, (*path, names[-1]), details["input"])
    if kind.startswith("union_tag"):  # the key that chooses among several sections
        sections = get_args(parameters.split_annotation(annotation)[0])
        path, annotation = (*path, "kind"), parameters.kind_literal(sections)
        kind = kind.replace("union_tag_not_found", "missing")
    key = parameters.format_path(path)
    if isinstance(cause, InputError):
        return input_error_message(cause, key, content)
    if cause is not None and str(cause):
        return f"{key}: {cause}" if key else str(cause)
    # Other problems are described by the allowed values of the type.
    allowed = parameters.describe_requirement(annotation, in_file=True)
    if kind == "missing":
        return f"{key} is missing: it must be {allowed}"
    value = _get_nested(content, path, details["input"])
    problem = describe_violation(format_value(value), allowed + _suggest_value(value, annotation))
    return f"{key or 'the configuration'} {problem}"


def input_error_message(error: InputError, section: str, content: Any) -> str:
    """Return the sentence about an error in a section of a file, such as "gears.wheel".

    The path in the error is relative to the `section`. The sentence quotes the value as the
    `content` of the file has it. A value that is not in the file was computed, and is rounded to
    six digits.
    """
    separator = "." if section and error.path and not error.path.startswith("[") else ""
    path = f"{section}{separator}{error.path}"
    place = f"{path} of {error.owner}" if error.owner else path
    if error.problem:
        return f"{place} {error.problem}"
    value = _get_nested(content, path.replace("[", ".").replace("]", "").split("."), None)
    if value is None and error.value is None:
        return f"{place} is missing: it must be {error.requirement}"
    if value is None:
        value = float(f"{error.value:.6g}") if isinstance(error.value, float) else error.value
    return f"{place} {describe_violation(format_value(value), error.requirement)}"


def _get_nested(content: Any, path: Any, default: Any) -> Any:
    """Return the value at a path of names and indices in nested dicts and lists.

    If the content has no such path, return `default`.
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
    """Return a hint for a wrong value, such as "; did you mean 3 mm?", or "" if there is none.

    `annotation` is the type of the value. The hint is the most similar of its choices, if it has
    any, or the value with a suitable unit.
    """
    choices = [str(choice) for choice in get_args(parameters.split_annotation(annotation)[0])]
    similar = difflib.get_close_matches(str(value), choices, 1)
    return f"; did you mean {similar[0]}?" if similar else parameters.unit_hint(value, annotation)


def _invalid_name_message(mapping: Any, path: tuple, cause: Any) -> str:
    """Return the sentence about a name that is not allowed in a mapping, such as "4".

    The name is the last entry of `path`. `mapping` is the type of the mapping, and `cause` the
    exception that the check of the name has raised, or None.
    """
    if not isinstance(path[-1], str):
        # YAML reads the keys ``4:``, ``on:`` and ``null:`` as a number, a boolean and null.
        path = (*path[:-1], format_value(path[-1]))
        allowed = "a text; put it in quotes"
    elif isinstance(cause, InputError):
        allowed = cause.requirement
    else:
        allowed = parameters.describe_requirement(
            get_args(parameters.split_annotation(mapping)[0])[0], in_file=True
        )
    return f"{parameters.format_path(path)} is not allowed as a name: it must be {allowed}"


def unknown_key_message(root: type, section: Any, path: tuple, value: Any) -> str:
    """Return the sentence about an unknown key, with advice on the key that may be meant.

    The key is the last entry of `path` and has the value `value`; `section` is the type of its
    section, `root` the class of the whole configuration. The advice is a similar key of the
    section, or other sections with such a key, or a list of the keys of the section.
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
    """Yield the names of the sections that have `key`, searching nested sections, too.

    The search starts at the type `annotation` of the section with the name `section`, "" for the
    whole configuration. In the names "<name>" stands for any name and "[i]" for any index.
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
    """Return a value as text in the style of YAML, shortened to `_MAX_CHARACTERS`."""
    if value is None:
        return "null (empty)"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _MAX_CHARACTERS else f"{text[:_MAX_CHARACTERS]}..."


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """Loader of plain YAML that collects the keys that a mapping repeats."""

    repetitions: list[str]  #: such as "teeth is given twice, again in line 4"

    def construct_mapping(self, node, deep=False):
        """Return the dict of a YAML mapping, and note the keys that it repeats.

        PyYAML itself keeps the last value of such a key without an error. `node` and `deep` are the
        arguments of its method of this name.
        """
        # Keys that are lists or mappings are skipped; the validation refuses them later.
        keys = [key for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        for i, key in enumerate(keys):
            if any(key.value == earlier.value for earlier in keys[:i]):
                line = key.start_mark.line + 1
                self.repetitions.append(f"{key.value} is given twice, again in line {line}")
        return super().construct_mapping(node, deep)


def read_yaml(path):
    """Return the dict in a YAML file, and a list with an error message for each repeated key.

    Raise ValueError, which names file and line, if the file cannot be read or contains no mapping.
    """
    try:
        with open(path, encoding="utf-8") as file:
            loader = _Loader(file.read())
        loader.repetitions = []
        content = loader.get_single_data()
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, yaml.reader.ReaderError):
        raise ValueError(f"{path} is not YAML but binary: it must be a text in UTF-8") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not YAML{_format_yaml_error(error)}") from None
    if content is None:
        raise ValueError(f"{path} is empty: it must be a mapping of keys to values")
    if not isinstance(content, dict):
        allowed = "a mapping, each line a key, a colon and its value"
        raise ValueError(f"{path}: {format_value(content)} is not allowed: it must be {allowed}")
    errors = [f"{path}: the key {text}: it must be given once" for text in loader.repetitions]
    return content, errors


def _format_yaml_error(error):
    """Return the position and the message of an error of the YAML parser as text.

    The text starts with line and column, if they are known, and may end with a hint.
    """
    mark = getattr(error, "problem_mark", None)
    position = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    messages = [getattr(error, "context", None), getattr(error, "problem", None)]
    text = ", ".join(filter(None, messages)) or " ".join(str(error).split())
    is_about_colons = "mapping values" in text or "':'" in text
    hint = "; a line without a colon, or with a wrong indentation?" if is_about_colons else ""
    return f"{position}: {text}{hint}"

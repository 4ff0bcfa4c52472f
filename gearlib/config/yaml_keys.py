"""Reading of YAML files, and keys that are given twice, of which YAML keeps the last silently."""

import yaml

from gearlib.config.validation import as_text


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """Loader of plain YAML that collects the keys that a mapping repeats."""

    repetitions: list[str]  #: such as "teeth is given twice, again in line 4"

    def construct_mapping(self, node, deep=False):
        """Return the dict of a YAML mapping, and note its repeated keys."""
        # The validation of the configuration refuses keys that are not scalars.
        keys = [key for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        for i, key in enumerate(keys):
            if any(key.value == earlier.value for earlier in keys[:i]):
                line = key.start_mark.line + 1
                self.repetitions.append(f"{key.value} is given twice, again in line {line}")
        return super().construct_mapping(node, deep)


def read(path):
    """Return the mapping in a YAML file, and an error message for each repeated key.

    Raise ValueError, with file and line, if it cannot be read or is not a mapping in YAML.
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
        raise ValueError(f"{path} is not YAML{_position_and_problem(error)}") from None
    if content is None:
        raise ValueError(f"{path} is empty: it must be a mapping of keys to values")
    if not isinstance(content, dict):
        allowed = "a mapping, each line a key, a colon and its value"
        raise ValueError(f"{path}: {as_text(content)} is not allowed: it must be {allowed}")
    errors = [f"{path}: the key {text}: it must be given once" for text in loader.repetitions]
    return content, errors


def _position_and_problem(error):
    """Return the end of an error message: line and column of an error of YAML, and its message."""
    mark = getattr(error, "problem_mark", None)
    position = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    parts = [getattr(error, "context", None), getattr(error, "problem", None)]
    text = ", ".join(filter(None, parts)) or " ".join(str(error).split())
    is_colon = "mapping values" in text or "':'" in text
    hint = "; a line without a colon, or with a wrong indentation?" if is_colon else ""
    return f"{position}: {text}{hint}"

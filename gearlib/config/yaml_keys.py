"""YAML files, and the keys that they give twice: YAML itself would silently keep the last."""

import yaml

#: That of libyaml is ten times as fast.
_Base = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_Base):
    """Reads plain YAML and remembers the keys that a mapping repeats."""

    repeated: list[str]

    def construct_mapping(self, node, deep=False):
        # Keys that are no plain scalars are left to the check of the configuration.
        keys = [key for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        for i, key in enumerate(keys):
            if any(key.value == earlier.value for earlier in keys[:i]):
                line = key.start_mark.line + 1
                self.repeated.append(f"{key.value} is given twice, again in line {line}")
        return super().construct_mapping(node, deep)


def read(path):
    """Return (what a file says, one sentence for each key that it repeats within a mapping).

    ValueError, with file and line, where it is not YAML.
    """
    try:
        with open(path, encoding="utf-8") as file:
            loader = _Loader(file.read())
        loader.repeated = []
        content = loader.get_single_data()
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not YAML{_fault(error)}") from None
    if content is None:
        raise ValueError(f"{path} is empty: it must be a mapping of keys to values")
    return content, [f"{path}: the key {text}: it must stand once" for text in loader.repeated]


def _fault(error):
    """Return where a file is no YAML, and what is wrong there."""
    mark = getattr(error, "problem_mark", None)
    place = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    context, problem = (getattr(error, key, None) for key in ("context", "problem"))
    words = ", ".join(filter(None, [context, problem])) or " ".join(str(error).split())
    return f"{place}: {words}"

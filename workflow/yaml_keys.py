"""Keys that a YAML file gives twice: YAML itself would silently keep the last."""

import yaml


class _Loader(yaml.SafeLoader):
    """Reads plain YAML and remembers the keys that a mapping repeats."""

    def construct_mapping(self, node, deep=False):
        seen = set()
        # Keys that are no plain scalars are left to the check of the configuration.
        scalars = [key for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        for key in scalars:
            if key.value in seen:
                line = key.start_mark.line + 1
                self.repeated.append(f"{key.value} is given twice, again in line {line}")
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def repeated_keys(path):
    """Return one sentence for each key that the file repeats within a mapping."""
    with open(path, encoding="utf-8") as file:
        loader = _Loader(file.read())
    loader.repeated = []
    loader.get_single_data()
    return [f"{path}: the key {text}: it must stand once" for text in loader.repeated]

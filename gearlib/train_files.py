"""Write and read gear trains as YAML files, as in a configuration, or as netCDF files."""

import dataclasses
from pathlib import Path
from typing import Any

import yaml

from gearlib import checks
from gearlib.config import ConfigError, validation

_SUFFIXES = (".yaml", ".yml", ".nc")


def write_train(train: Any, path: Any) -> None:
    """Write a gear train to a file that can be edited and read by `read_train`.

    Parameters
    ----------
    train : gearlib.GearTrain
        The train.
    path : str or path-like
        A YAML file, which will contain the section ``train`` of a configuration, or a netCDF file,
        which will also contain the layout of the train. An existing file is replaced.

    Raises
    ------
    ValueError
        If the suffix is not .yaml, .yml or .nc, or the train consists of given matrices.
    """
    from gearlib.data import files, result, storage

    suffix = checks.check_choice("suffix", Path(path).suffix, _SUFFIXES)
    if train.matrices is not None:
        problem = "with given matrices cannot be written: it must consist of bodies"
        raise checks.InputError("train", problem=problem)
    if suffix == ".nc":
        storage.write(
            result.make_result("A gear train", train, train.layout(), method="none"), path
        )
        return
    arguments: dict = {}
    for name in ("bodies", "shafts", "meshes", "forces"):
        arguments[name] = [_nondefault_fields(element) for element in getattr(train, name)]
    for name in ("carrier_ratio", "gyroscopic"):
        arguments[name] = getattr(train, name)
    if train.modal_damping:
        arguments["modal_damping"] = list(train.modal_damping)
    section = {"kind": "own", "reference": train.reference, "own": arguments}
    if train.reference_frequency is not None:
        section["reference_frequency"] = train.reference_frequency
    with files.atomic_write(path) as temporary:
        text = yaml.safe_dump({"train": section}, sort_keys=False, allow_unicode=True)
        temporary.write_text(text, encoding="utf-8")


def _nondefault_fields(element: Any) -> dict:
    """Return the fields of a body, shaft, mesh or force that differ from their defaults, as a dict.

    The values are dicts, lists, numbers and strings. A name with a hyphen, e.g. "sun-planet", is
    omitted, because it is derived from the names of the bodies. The deviation of the coast-side
    flanks is omitted if it equals the deviation of the drive-side flanks.
    """
    values = {}
    for field in dataclasses.fields(element):
        value = getattr(element, field.name)
        is_derived_name = field.name == "name" and "-" in str(value)
        if value != field.default and not is_derived_name:
            values[field.name] = _to_yaml_value(value)
    if values.get("coast_deviation") == values.get("deviation"):
        values.pop("coast_deviation", None)
    return values


def _to_yaml_value(value: Any) -> Any:
    """Convert a value for YAML: a dataclass such as `Harmonics` to a dict, a tuple to a list."""
    if dataclasses.is_dataclass(value):
        return {name: list(entry) for name, entry in dataclasses.asdict(value).items()}
    if isinstance(value, tuple):
        return [_to_yaml_value(entry) for entry in value]
    return value


def read_train(path: Any) -> Any:
    """Read a gear train from a file in the format of `gearlib.write_train`.

    Parameters
    ----------
    path : str or path-like
        A YAML file with the section ``train`` of a configuration, whose kind must not need a
        ``gear_pair``, or a netCDF file with a result of a train.

    Returns
    -------
    GearTrain
        The train.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file contains no train or a wrong value; the message names the key.
    """
    from pydantic import ValidationError

    from gearlib.config.train_section import PAIR_TRAINS, TrainFile
    from gearlib.data import storage
    from gearlib.models import from_values

    if checks.check_choice("suffix", Path(path).suffix, _SUFFIXES) == ".nc":
        train = from_values.model_from_json(storage.read(path).attrs.get("model", "null"))
        if getattr(train, "train", None) is None:
            raise ValueError(f"{path} has no gear train: it must be a file of gearlib.write_train")
        return train
    Path(path).stat()  # This raises FileNotFoundError if the file is missing.
    content, messages = validation.read_yaml(path)
    if messages:
        raise ConfigError("\n".join(messages))
    content = {name: section for name, section in content.items() if name == "train"}
    try:
        section = TrainFile.model_validate(content, context={}).train
    except ValidationError as error:
        raise ConfigError("\n".join(validation.error_messages(error, TrainFile, content))) from None
    allowed = "own, planetary or planetary_set; the other kinds need a gear pair"
    checks.require(section.kind not in PAIR_TRAINS, "train.kind", section.kind, allowed)
    return from_values.build_train(**section.description(), pair=None)

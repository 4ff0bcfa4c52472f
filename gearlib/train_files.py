"""`write_train` and `read_train`: gear trains in YAML, as in a configuration, and in netCDF."""

import dataclasses
from pathlib import Path
from typing import Any

import yaml

from gearlib import checks
from gearlib.config import ConfigError, validation

_SUFFIXES = (".yaml", ".yml", ".nc")


def write_train(train: Any, path: Any) -> None:
    """Write a gear train to a file, to be corrected and read again.

    Parameters
    ----------
    train : gearlib.GearTrain
        The train.
    path : str or path-like
        A YAML file, which has the section ``train`` of a configuration, or a netCDF file, which has
        the layout of the train, too. An existing file is replaced.

    Raises
    ------
    ValueError
        If the suffix is not .yaml, .yml or .nc, or the train is one of given matrices.
    """
    from gearlib.data import files, result, storage

    suffix = checks.one_of("suffix", Path(path).suffix, _SUFFIXES)
    if train.matrices is not None:
        problem = "of given matrices cannot be written: only trains of bodies can"
        raise checks.InputError("train", problem=problem)
    if suffix == ".nc":
        storage.write(result.result("A gear train", train, train.layout(), method="none"), path)
        return
    own: dict = {
        name: [_given(element) for element in getattr(train, name)]
        for name in ("bodies", "shafts", "meshes", "forces")
    }
    own |= {name: getattr(train, name) for name in ("carrier_ratio", "gyroscopic")}
    own |= {"modal_damping": list(train.modal_damping)} if train.modal_damping else {}
    section = {"kind": "own", "reference": train.reference, "own": own}
    if train.reference_frequency is not None:
        section["reference_frequency"] = train.reference_frequency
    with files.replacing(path) as temporary:
        text = yaml.safe_dump({"train": section}, sort_keys=False, allow_unicode=True)
        temporary.write_text(text, encoding="utf-8")


def _given(element: Any) -> dict:
    """Return the fields of a body, shaft or mesh without defaults, as plain values."""
    values = {}
    for field in dataclasses.fields(element):
        value = getattr(element, field.name)
        if value != field.default and not (field.name == "name" and "-" in str(value)):
            values[field.name] = _plain(value)
    if values.get("coast_deviation") == values.get("deviation"):
        values.pop("coast_deviation", None)
    return values


def _plain(value: Any) -> Any:
    """Return a value of a field with dicts and lists in place of `Harmonics` and tuples."""
    if dataclasses.is_dataclass(value):
        return {name: list(entry) for name, entry in dataclasses.asdict(value).items()}
    return [_plain(entry) for entry in value] if isinstance(value, tuple) else value


def read_train(path: Any) -> Any:
    """Read the gear train of a file that `gearlib.write_train` wrote, or that has its form.

    Parameters
    ----------
    path : str or path-like
        A YAML file with the section ``train`` of a configuration, of a kind that needs no
        ``gear_pair``, or a netCDF file of a result with a train.

    Returns
    -------
    GearTrain
        The train.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file has no train, or a value is wrong; the message names the key.
    """
    from pydantic import ValidationError

    from gearlib.config.train_section import PAIR_TRAINS, TrainFile
    from gearlib.data import storage
    from gearlib.models import from_values

    if checks.one_of("suffix", Path(path).suffix, _SUFFIXES) == ".nc":
        train = from_values.model_from_json(storage.read(path).attrs.get("model", "null"))
        if getattr(train, "train", None) is None:
            raise ValueError(f"{path} has no gear train: it must be written by gearlib.write_train")
        return train
    Path(path).stat()  # FileNotFoundError rather than an error about YAML
    content, repeated = validation.read_yaml(path)
    if repeated:
        raise ConfigError("\n".join(repeated))
    content = {name: section for name, section in content.items() if name == "train"}
    try:
        section = TrainFile.model_validate(content, context={}).train
    except ValidationError as error:
        raise ConfigError("\n".join(validation.sentences(error, TrainFile, content))) from None
    allowed = "own, planetary or planetary_set; the other kinds need a gear pair"
    checks.require(section.kind not in PAIR_TRAINS, "train.kind", section.kind, allowed)
    return from_values.train(**section.description(), pair=None)

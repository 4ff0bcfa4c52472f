"""`read_measured`: a measured set, a YAML file and the table beside it, as one dataset in SI."""

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.config import measured_description, units
from gearlib.data import measured_names
from gearlib.data.files import canonical_json
from gearlib.models.pair_parameters import PairParameters
from gearlib.parameters import Number, declared
from gearlib.uncertainty import measured_tables
from gearlib.uncertainty.measured_tables import CONDITION, LONG

_DIRECTIONS = {"up": 1, "down": -1, "rest": 0}


def read_measured(path):
    """Read a measured set: a YAML file that says what it is, and the table beside it.

    Nothing is guessed and nothing dropped: what is not in order is refused in a sentence, or
    repaired and told.

    Parameters
    ----------
    path : str or path
        The YAML file, with ``data``, ``source``, ``licence`` and ``channels``. The table is a CSV,
        wide (a column for each channel) or long (columns observableId, measurement, and if wanted
        simulationConditionId, time, noiseParameters, as PEtab has them), or a universal
        file (.uff, sets 58, needs pyuff).

    Returns
    -------
    xarray.Dataset
        Over ``sample``, in SI: a variable for each observable, with the attributes units,
        long_name, sensor, noise_std (0: unknown), unknown_gain, unknown_offset (0 or 1); of a
        noise that differs from sample to sample also ``<name>_noise_std``. Coordinates, where they
        are known: time (s), speed (min-1), direction (1 up, -1 down, 0 from rest), condition.
        Scalars jump_up, jump_down, onset_of_contact_loss (min-1). Attributes: title, source,
        licence, synthetic, known and conditions (JSON), not_said, repairs. A time of
        infinity is a steady state, as in PEtab.

    Raises
    ------
    ValueError
        Naming the file, the key or column, its value and what is allowed.
    """
    if not isinstance(path, (str, Path)):
        raise checks.refusal("path", path, "a YAML file")
    path = Path(path)
    if not path.is_file():
        raise checks.refusal("path", str(path), "a YAML file")
    rig = measured_description.read(path)
    try:
        data = _dataset(rig, path.parent)
        known = {name: _known(name, value) for name, value in rig.known.items()}
    except ValueError as error:
        if isinstance(error, ImportError):
            raise
        raise ValueError(f"{path}: {error}") from None
    conditions = {name: condition.model_dump() for name, condition in rig.conditions.items()}
    data.attrs |= {
        "title": rig.title or path.stem,
        "source": rig.source,
        "licence": rig.licence,
        "synthetic": int(bool(rig.synthetic)),
        "known": canonical_json(known),
        "conditions": canonical_json(conditions),
        "not_said": ", ".join(rig.not_said()),
    }
    return data


def refused(paths):
    """Return a sentence for each set that is refused."""
    sentences = []
    for path in paths:
        try:
            read_measured(path)
        except ValueError as error:
            sentences.append(str(error))
    return sentences


def _known(name: str, value: Any) -> Any:
    """Return what is known of a rig as JSON has it, parameters of a gear pair in SI."""
    if isinstance(value, dict):
        return {key: _known(f"{name}.{key}", part) for key, part in value.items()}
    if isinstance(value, list):
        return [_known(f"{name}[{i}]", part) for i, part in enumerate(value)]
    if isinstance(value, float) and math.isnan(value):
        raise checks.refusal(f"known.{name}", value, "a number or a text")
    parameter = declared(PairParameters).get(name)
    unit = parameter.kind.unit if parameter and isinstance(parameter.kind, Number) else "1"
    if isinstance(value, str) and value[:1].isdigit() and unit != "1":
        try:
            return units.read(value, unit)
        except ValueError:
            allowed = f"a number or a text with a unit of the dimension of {unit}"
            raise checks.refusal(f"known.{name}", value, allowed) from None
    return value if isinstance(value, str | int | float | None) else str(value)


def _dataset(rig: Any, folder: Path) -> xr.Dataset:
    """Return the table and the single speeds of a description as a dataset."""
    data = xr.Dataset(attrs={"repairs": ""})
    if rig.data is not None:
        data = _of_table(rig, folder / rig.data)
    for name, speed in (rig.speeds.model_dump() if rig.speeds else {}).items():
        cf, words = measured_names.SPEEDS[name]
        attrs = {"units": cf, "long_name": words, "noise_std": speed.get("noise", 0.0)}
        data[name] = (), speed["value"], attrs
    return data


def _of_table(rig: Any, path: Path) -> xr.Dataset:
    """Return the table of a description as a dataset."""
    checks.require(path.is_file(), "data", rig.data, "a file beside its YAML")
    checks.require(path.stat().st_size, "data", rig.data, "a file with rows: it is empty")
    if rig.sha256 is not None:
        with open(path, "rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        checks.require(digest == rig.sha256, "sha256", rig.sha256, f"{digest}, that of {rig.data}")
    texts = {LONG[0], CONDITION}
    for key, channel in rig.channels.items():
        is_text = (channel.observableId or key) in ("direction", "condition")
        texts |= {key} if is_text or channel.unit == measured_description.DATES else set()
    columns = measured_tables.read(path, rig, texts)
    lengths = {name: len(values) for name, values in columns.items()}
    empty = not lengths or min(lengths.values()) == 0
    checks.require(not empty, "data", rig.data, "a file with samples: it has none")
    allowed = f"of columns of one length, not {lengths}"
    checks.require(len(set(lengths.values())) == 1, "data", rig.data, allowed)
    is_csv = path.suffix.lower() == ".csv"
    if is_csv and set(LONG) <= columns.keys():
        data = _of_columns(rig, *measured_tables.long_samples(rig, columns))
        names = [str(name) for name in columns[LONG[0]].categories]
    else:
        data = _of_columns(rig, columns, {}, xr.Dataset())
        names = measured_tables.header(path, rig)[0] if is_csv else []
    data.attrs["not_read"] = ", ".join(name for name in names if name not in rig.channels)
    return data


def _of_columns(rig: Any, columns: dict, noises: dict, data: xr.Dataset) -> xr.Dataset:
    """Return `data` with columns by their keys; noises: key -> that of each sample."""
    keys = {rig.channels[key].observableId or key: key for key in rig.channels if key in columns}
    # PEtab's columns, and the times that a format knows, need no channel.
    for name, key in (("time", "time"), ("condition", CONDITION)):
        if key in columns:
            keys.setdefault(name, key)
    coords, start = _coordinates(rig, columns, keys)
    order, repairs = _order(rig, keys, coords)
    for name, key in keys.items():
        if name in measured_names.COORDINATES:
            continue
        where, values = f"{rig.data}, column {key!r}", columns[key]
        is_speed = name in measured_names.SPEEDS
        checks.require(not is_speed, where, name, "none of a wide table: speeds has it")
        gaps = bool(rig.channels[key].gaps)
        if gaps and (empty := int(np.isnan(values).sum())):
            repairs.append(f"{name}: {empty} empty cells are not measured")
        noise = noises[key][order] if key in noises else None
        measured_tables.check_finite(where, values[order], gaps=gaps or noise is not None)
        data = data.assign(_variables(rig.channels[key], name, key, values[order], noise))
    if not data.data_vars:
        raise checks.refusal("channels", list(rig.channels), "at least one that was measured")
    for name, values in coords.items():
        cf, words = measured_names.COORDINATES[name]
        data.coords[name] = "sample", values[order], {"units": cf, "long_name": words}
    if start:
        data["time"].attrs["start"] = start
    data.attrs["repairs"] = "; ".join(repairs)
    return data


def _order(rig: Any, keys: dict, coords: dict) -> tuple[Any, list[str]]:
    """Return the order in which the time of each condition rises, and what that repairs."""
    if "time" not in coords:
        return slice(None), []
    groups = [coords[name] for name in ("condition", "direction") if name in coords]
    group = np.zeros(len(coords["time"]), int)
    for values in groups:
        group = 3 * group + np.unique(values, return_inverse=True)[1]
    where = f"{rig.data}, column {keys['time']!r}"
    order = measured_tables.in_order(where, coords["time"], group)
    if order is None:
        return slice(None), []
    return order, ["samples sorted by time" + ", each condition apart" * bool(groups)]


def _variables(channel: Any, name: str, key: str, values: np.ndarray, noise: Any) -> dict:
    """Return the variable of an observable, and its noise where it differs between samples."""
    factor, cf = channel.scale(key)
    attrs = {
        "units": cf,
        "long_name": measured_names.of(name)[1],
        "column": key,
        "sensor": channel.sensor or "",
        "noise_std": channel.noise_std(key),
        "unknown_gain": int(channel.gain == "unknown"),
        "unknown_offset": int(channel.offset == "unknown"),
    }
    variables = {}
    if noise is not None and np.isfinite(noise).any():
        noise = np.where(np.isnan(noise), channel.noise_std(key), noise * abs(factor))
        known = noise[np.isfinite(values)]
        attrs["noise_std"] = math.sqrt(float(np.mean(known**2)))
        if known.min() != known.max():
            words = f"standard deviation of {name}"
            variables[f"{name}_noise_std"] = "sample", noise, {"units": cf, "long_name": words}
    return variables | {name: ("sample", values * factor, attrs)}


def _coordinates(rig: Any, columns: dict, keys: dict) -> tuple[dict, str]:
    """Return name -> values of the coordinates, and when the first sample was taken, or ""."""
    coords, start = {}, ""
    places = {name: f"{rig.data}, column {key!r}" for name, key in keys.items()}
    for name in [name for name in ("time", "speed") if name in keys]:
        channel, values = rig.channels.get(keys[name]), columns[keys[name]]
        if channel is not None and channel.unit == measured_description.DATES:
            values, start = measured_tables.dates(places[name], values)
        measured_tables.check_finite(places[name], values, endless=name == "time")
        coords[name] = values * (1.0 if channel is None else channel.scale(keys[name])[0])
    if "direction" in keys:
        words = columns[keys["direction"]]
        coords["direction"] = measured_tables.directions(places["direction"], words)
    conditions, codes = list(rig.conditions.values()), np.zeros(len(next(iter(columns.values()))))
    if "condition" in keys:
        column = columns[keys["condition"]]
        codes = measured_tables.complete(places["condition"], column)
        names = [str(name) for name in column.categories]
        for name in names if rig.conditions else ():
            allowed = f"one of {', '.join(rig.conditions)}"
            checks.require(name in rig.conditions, CONDITION, name, allowed)
        coords["condition"] = np.array(names)[codes]
        conditions = [rig.conditions.get(name) for name in names]
    elif len(conditions) != 1:
        return coords, start
    for name, kind in (("speed", float), ("direction", np.int8)):
        values = [getattr(condition, name, None) for condition in conditions]
        if name not in coords and None not in values:
            values = np.array([_DIRECTIONS.get(value, value) for value in values], kind)
            coords[name] = values[codes.astype(int)]
    return coords, start

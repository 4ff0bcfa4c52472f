"""Read a measured data set, a YAML file and its table, into one dataset in SI units."""

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks, units
from gearlib.config import measured_description
from gearlib.data import measured_names
from gearlib.data.files import canonical_json
from gearlib.models.pair_parameters import PairParameters
from gearlib.parameters import declared_parameters
from gearlib.uncertainty import measured_tables
from gearlib.uncertainty.measured_tables import CONDITION_COLUMN, DIRECTION_SIGNS, LONG_COLUMNS


def read_measured(path):
    """Read a measured data set, a YAML file and its table, and return it in SI units.

    Faulty data raise an error, or are repaired and reported in the attribute ``repairs``.

    Parameters
    ----------
    path : str or path
        The YAML file, with ``data``, ``source``, ``licence`` and ``channels``. The table is a CSV,
        wide (a column for each channel) or long (PEtab's columns observableId, measurement, and
        optionally simulationConditionId, time, noiseParameters), or a universal file (.uff,
        datasets of type 58, needs pyuff), whose axes have the units of the channels, if any.

    Returns
    -------
    xarray.Dataset
        Over ``sample``, in SI: a variable for each observable, with the attributes units,
        long_name, sensor, noise_std (0: unknown), unknown_gain, unknown_offset (0 or 1), and
        ``<name>_noise_std`` if the noise differs between samples. Coordinates, if known: time (s),
        speed (min-1), direction (1 up, -1 down, 0 from rest), condition. Scalars jump_up,
        jump_down, onset_of_contact_loss (min-1). Attributes: title, source, licence, synthetic,
        known (metadata of the test rig, JSON), conditions (JSON), not_said (properties of the rig
        that are missing in known), repairs. An infinite time is a steady state, as in PEtab.

    Raises
    ------
    ValueError
        Naming the file, the key or column, its value and what is allowed.
    """
    checks.require(isinstance(path, (str, Path)), "path", path, "a YAML file")
    path = Path(path)
    checks.require(path.is_file(), "path", str(path), "a YAML file")
    description = measured_description.read_description(path)
    data = xr.Dataset(attrs={"repairs": ""})
    try:
        if description.data is not None:
            data = _read_table(description, path.parent / description.data)
        metadata = {name: _json_value(name, value) for name, value in description.known.items()}
    except ValueError as error:
        if isinstance(error, ImportError):  # a missing package is not an error in the file
            raise
        raise ValueError(f"{path}: {error}") from None
    for name, speed in (description.speeds.model_dump() if description.speeds else {}).items():
        units, text = measured_names.SPEEDS[name]
        attrs = {"units": units, "long_name": text, "noise_std": speed.get("noise", 0.0)}
        data[name] = (), speed["value"], attrs
    conditions = {name: section.model_dump() for name, section in description.conditions.items()}
    data.attrs |= {
        "title": description.title or path.stem,
        "source": description.source,
        "licence": description.licence,
        "synthetic": int(bool(description.synthetic)),
        "known": canonical_json(metadata),
        "conditions": canonical_json(conditions),
        "not_said": ", ".join(description.unknown_properties()),
    }
    return data


def read_errors(paths):
    """Return the error messages of the invalid data sets among several measured data sets.

    `paths` are the paths of their YAML files; each of them is read by `read_measured`.
    """
    messages = []
    for path in paths:
        try:
            read_measured(path)
        except ValueError as error:
            messages.append(str(error))
    return messages


def _json_value(name: str, value: Any) -> Any:
    """Convert an entry of the metadata of a test rig, including nested entries, to JSON values.

    `name` is the path of its keys, e.g. "options.load", and `value` is the value in the YAML file.
    If `name` is a parameter of a gear pair, a string such as "80 um" is converted to a number in SI
    units. Raise ValueError for NaN or a unit of the wrong dimension.
    """
    if isinstance(value, dict):
        return {key: _json_value(f"{name}.{key}", entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_json_value(f"{name}[{i}]", entry) for i, entry in enumerate(value)]
    if isinstance(value, float) and math.isnan(value):
        raise checks.InputError(f"known.{name}", value, "a number or a text")
    parameter = declared_parameters(PairParameters).get(name)
    unit = parameter.unit if parameter else ""
    if isinstance(value, str) and value[:1].isdigit() and unit:
        try:
            return units.parse_quantity(value, unit)
        except ValueError:
            allowed = f"a number or a text with a unit of the dimension of {unit}"
            raise checks.InputError(f"known.{name}", value, allowed) from None
    return value if isinstance(value, str | int | float | None) else str(value)


def _read_table(description, path: Path) -> xr.Dataset:
    """Read the table of a measured data set, a CSV or universal file, as a dataset in SI units.

    `description` is the content of the YAML file of the data set, which describes the channels, and
    `path` the path of the table. Raise ValueError if the file is missing, is empty or does not have
    the stated checksum, or if its columns are invalid.
    """
    checks.require(path.is_file(), "data", description.data, "a file in the same folder")
    checks.require(path.stat().st_size, "data", description.data, "a file with rows: it is empty")
    if description.sha256 is not None:
        with open(path, "rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        allowed = f"{digest}, the checksum of {description.data}"
        checks.require(digest == description.sha256, "sha256", description.sha256, allowed)
    text_columns = {measured_tables.ID_COLUMN, CONDITION_COLUMN}
    for key, channel in description.channels.items():
        is_text = (channel.observableId or key) in ("direction", "condition")
        # Dates are read as strings; their unit is `DATES` ("ISO 8601").
        if is_text or channel.unit == measured_description.DATES:
            text_columns.add(key)
    names = []
    if path.suffix.lower() == ".csv":
        columns, names = measured_tables.read_csv(path, description, text_columns)
    else:
        columns = measured_tables.read_uff(path, description)
    lengths = {name: len(values) for name, values in columns.items()}
    has_samples = bool(lengths) and min(lengths.values()) > 0
    checks.require(has_samples, "data", description.data, "a file with samples, but it has none")
    allowed = f"a file with columns of equal length, not {lengths}"
    checks.require(len(set(lengths.values())) == 1, "data", description.data, allowed)
    if set(LONG_COLUMNS) <= set(names):
        tables = measured_tables.reshape_long_table(description, columns)
        data = _dataset_from_columns(description, *tables)
        names = [str(name) for name in columns[measured_tables.ID_COLUMN].categories]
    else:
        data = _dataset_from_columns(description, columns, {}, xr.Dataset())
    # Columns without a channel of the same name are not read.
    data.attrs["not_read"] = ", ".join(name for name in names if name not in description.channels)
    return data


def _dataset_from_columns(description, columns, std_columns, data: xr.Dataset) -> xr.Dataset:
    """Add the columns of a table to the dataset `data` as variables in SI units; return it.

    `description` is the content of the YAML file, with the channels (name, unit and sensor of each
    column). `columns` maps names of columns to arrays over samples in the units of the table. If
    the table is long (one row per measurement), `std_columns` has the standard deviations of its
    quantities, NaN if not given; if it is wide (one column per channel), `std_columns` is empty.
    """
    channels = description.channels.items()
    column_names = {channel.observableId or key: key for key, channel in channels if key in columns}
    # Time and condition need no channel if their columns have the PEtab names.
    for name, key in (("time", "time"), ("condition", CONDITION_COLUMN)):
        if key in columns:
            column_names.setdefault(name, key)
    coords, start = _sample_coordinates(description, columns, column_names)
    order, repairs = _sort_by_time(description, column_names, coords)
    for name, key in column_names.items():
        if name in measured_names.COORDINATES:
            continue
        location, values = f"{description.data}, column {key!r}", columns[key]
        allowed = "a name other than a speed, which belongs to the section speeds"
        checks.require(name not in measured_names.SPEEDS, location, name, allowed)
        has_gaps = bool(description.channels[key].gaps)
        if has_gaps and (empty_cells := int(np.isnan(values).sum())):
            repairs.append(f"{name}: {empty_cells} empty cells are not measured")
        stds = std_columns[key][order] if key in std_columns else None
        # In a long table a sample is NaN if the quantity was not measured.
        may_be_nan = has_gaps or stds is not None
        measured_tables.check_finite(location, values[order], gaps=may_be_nan)
        data = data.assign(
            _channel_variables(description.channels[key], name, key, values[order], stds)
        )
    channel_keys, allowed = list(description.channels), "at least one measured quantity"
    checks.require(data.data_vars, "channels", channel_keys, allowed)
    for name, values in coords.items():
        units, text = measured_names.COORDINATES[name]
        data.coords[name] = "sample", values[order], {"units": units, "long_name": text}
    if start:
        data["time"].attrs["start"] = start
    data.attrs["repairs"] = "; ".join(repairs)
    return data


def _sort_by_time(description: Any, column_names: dict, coords: dict) -> tuple[Any, list[str]]:
    """Return an index that sorts the samples of each condition by time, and notes on this repair.

    A condition is a named part of a measurement, such as one operating point. `description` is the
    content of the YAML file, `column_names` maps variables to columns of the table, and `coords`
    maps coordinates such as "time" to arrays over samples. The index is an array, or a slice if the
    samples are already sorted. Raise ValueError if a time is repeated in a condition.
    """
    if "time" not in coords:
        return slice(None), []
    groupings = [coords[name] for name in ("condition", "direction") if name in coords]
    groups = np.zeros(len(coords["time"]), int)
    for values in groupings:
        # Each condition is divided by up to three directions.
        groups = 3 * groups + np.unique(values, return_inverse=True)[1]
    # Groups keep the order of their first samples.
    _, first_rows, indices = np.unique(groups, return_index=True, return_inverse=True)
    order = np.lexsort((coords["time"], first_rows[indices]))
    time, groups = coords["time"][order], groups[order]
    is_repeated = (time[1:] == time[:-1]) & (groups[1:] == groups[:-1]) & np.isfinite(time[1:])
    if is_repeated.any():
        i, count = int(is_repeated.argmax()), int(is_repeated.sum())
        further = f", and {count - 1} more times" if count > 1 else ""
        raise ValueError(
            f"{description.data}, column {column_names['time']!r} = {time[i]:.12g} occurs twice, "
            f"in rows {order[i] + 1} and {order[i + 1] + 1}{further}: it must occur only once in "
            "each condition"
        )
    if (np.diff(order) > 0).all():
        return slice(None), []
    repair = "samples sorted by time"
    if groupings:
        repair += ", each condition apart"
    return order, [repair]


def _channel_variables(channel: Any, name: str, key: str, values: np.ndarray, stds: Any) -> dict:
    """Return the variable of a channel and, if its noise varies, the variable of the noise.

    `channel` describes a column of the table: its unit and sensor. `name` is the name of the
    variable, `key` the name of its column. `values`, (n,), and their standard deviations `stds`,
    NaN or None if not given, have the unit of the channel. The result maps names to (dimension,
    values in SI units, attributes).
    """
    factor, units = channel.scale(key)  # to SI units
    attrs = {
        "units": units,
        "long_name": measured_names.units_and_description(name)[1],
        "column": key,
        "sensor": channel.sensor or "",
        "noise_std": channel.noise_std(key),
        "unknown_gain": int(channel.gain == "unknown"),
        "unknown_offset": int(channel.offset == "unknown"),
    }
    variables = {}
    if stds is not None and np.isfinite(stds).any():
        stds = np.where(np.isnan(stds), channel.noise_std(key), stds * abs(factor))
        measured_stds = stds[np.isfinite(values)]
        attrs["noise_std"] = math.sqrt(float(np.mean(measured_stds**2)))
        if measured_stds.min() != measured_stds.max():
            noise_attrs = {"units": units, "long_name": f"standard deviation of {name}"}
            variables[f"{name}_noise_std"] = "sample", stds, noise_attrs
    return variables | {name: ("sample", values * factor, attrs)}


def _sample_coordinates(description: Any, columns: dict, column_names: dict) -> tuple[dict, str]:
    """Return (coordinates, earliest date) of the samples of a measured table.

    The coordinates are the known ones of time, speed, direction (1 up, -1 down, 0 from rest) and
    condition (named part of the measurement), as name -> array in SI units; speed and direction may
    also follow from the condition. The date is "" if the times are not dates. `description` is the
    content of the YAML file; `column_names` maps coordinates to the names of their `columns`.
    """
    coords: dict = {}
    start = ""
    locations = {name: f"{description.data}, column {key!r}" for name, key in column_names.items()}
    for name in ("time", "speed"):
        if name not in column_names:
            continue
        key = column_names[name]
        channel, values = description.channels.get(key), columns[key]
        if channel is not None and channel.unit == measured_description.DATES:
            values, start = measured_tables.seconds_since_first(locations[name], values)
        measured_tables.check_finite(locations[name], values, steady=name == "time")
        factor = 1.0 if channel is None else channel.scale(key)[0]
        coords[name] = values * factor
    if "direction" in column_names:
        column = columns[column_names["direction"]]
        location = locations["direction"]
        signs = [DIRECTION_SIGNS.get(str(text).strip().lower()) for text in column.categories]
        for sign, text in zip(signs, column.categories, strict=True):
            checks.require(sign is not None, location, text, "up, down or rest, or 1, -1, 0")
        direction_codes = measured_tables.category_codes(location, column)
        coords["direction"] = np.array(signs, np.int8)[direction_codes]
    conditions = list(description.conditions.values())
    # Index of the condition of each sample, 0 if there is only one condition.
    condition_indices = np.zeros(max(map(len, columns.values()), default=0))
    if "condition" in column_names:
        column = columns[column_names["condition"]]
        condition_indices = measured_tables.category_codes(locations["condition"], column)
        names = [str(name) for name in column.categories]
        if description.conditions:
            allowed = f"one of {', '.join(description.conditions)}"
            for name in names:
                checks.require(name in description.conditions, CONDITION_COLUMN, name, allowed)
        coords["condition"] = np.array(names)[condition_indices]
        conditions = [description.conditions.get(name) for name in names]
    elif len(conditions) != 1:  # there is no condition that applies to all samples
        return coords, start
    for name, dtype in (("speed", float), ("direction", np.int8)):
        values = [getattr(condition, name, None) for condition in conditions]
        if name not in coords and None not in values:
            values = np.array([DIRECTION_SIGNS.get(value, value) for value in values], dtype)
            coords[name] = values[condition_indices.astype(int)]
    return coords, start

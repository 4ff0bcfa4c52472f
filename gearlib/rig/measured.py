"""`read_measured`: a measured set, a YAML file and the table beside it, as one dataset in SI."""

import hashlib
import math
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.config import measured_description, units
from gearlib.data import measured_names
from gearlib.data.provenance import canonical_json
from gearlib.models.pair_parameters import PairParameters
from gearlib.parameters import Number, declared
from gearlib.rig import long_tables, measured_checks, measured_files
from gearlib.rig.measured_files import CONDITION, LONG

_DIRECTIONS = {"up": 1, "down": -1, "rest": 0}


def read_measured(path):
    """Read a measured set: a YAML file that says what it is, and the table beside it.

    Nothing is guessed and nothing dropped: what is not in order is refused in a sentence, or
    repaired and said so.

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
    said = measured_description.read(path)
    try:
        found = _dataset(said, path.parent)
        known = {name: _known(name, one) for name, one in said.known.items()}
    except ValueError as error:
        if isinstance(error, ImportError):
            raise
        raise ValueError(f"{path}: {error}") from None
    found.attrs |= {
        "title": said.title or path.stem,
        "source": said.source,
        "licence": said.licence,
        "synthetic": int(bool(said.synthetic)),
        "known": canonical_json(known),
        "conditions": canonical_json(
            {name: one.model_dump() for name, one in said.conditions.items()}
        ),
        "not_said": ", ".join(said.not_said()),
    }
    return found


def refused(paths):
    """Return a sentence for each set that is refused."""
    found = []
    for path in paths:
        try:
            read_measured(path)
        except ValueError as error:
            found.append(str(error))
    return found


def _known(name, value):
    """Return what is known of a rig as JSON has it, parameters of a gear pair in SI."""
    if isinstance(value, dict):
        return {key: _known(f"{name}.{key}", one) for key, one in value.items()}
    if isinstance(value, list):
        return [_known(f"{name}[{i}]", one) for i, one in enumerate(value)]
    if isinstance(value, float) and math.isnan(value):
        raise checks.refusal(f"known.{name}", value, "a number or a text")
    one = declared(PairParameters).get(name)
    if isinstance(value, str) and one is not None and isinstance(one.kind, Number):
        if value[:1].isdigit() and one.kind.unit != "1":
            try:
                return units.read(value, one.kind.unit)
            except ValueError:
                allowed = f"a number or a text with a unit of the dimension of {one.kind.unit}"
                raise checks.refusal(f"known.{name}", value, allowed) from None
    return value if isinstance(value, str | int | float | None) else str(value)


def _dataset(said, folder):
    found = xr.Dataset(attrs={"repairs": ""})
    if said.data is not None:
        found = _measured(said, folder / said.data)
    for name, one in (said.speeds.model_dump() if said.speeds else {}).items():
        cf, words = measured_names.SPEEDS[name]
        found[name] = (), one["value"], {
            "units": cf, "long_name": words, "noise_std": one.get("noise", 0.0)
        }  # fmt: skip
    return found


def _measured(said, path):
    if not path.is_file():
        raise checks.refusal("data", said.data, "a file beside its YAML")
    if path.stat().st_size == 0:
        raise checks.refusal("data", said.data, "a file with rows: it is empty")
    if said.sha256 is not None:
        with open(path, "rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        if digest != said.sha256:
            raise checks.refusal("sha256", said.sha256, f"{digest}, that of {said.data}")
    texts = {key for key, one in said.channels.items() if _is_text(key, one)}
    columns = measured_files.read(path, said, texts | {LONG[0], CONDITION})
    lengths = {name: len(values) for name, values in columns.items()}
    if not lengths or min(lengths.values()) == 0:
        raise checks.refusal("data", said.data, "a file with samples: it has none")
    if len(set(lengths.values())) > 1:
        raise checks.refusal("data", said.data, f"of columns of one length, not {lengths}")
    if set(LONG) <= columns.keys() and path.suffix.lower() == ".csv":
        found = _dataset_of(said, *long_tables.samples(said, columns))
        there = [str(one) for one in columns[LONG[0]].categories]
    else:
        found = _dataset_of(said, columns, {}, xr.Dataset())
        there = measured_files.header(path, said)[0] if path.suffix.lower() == ".csv" else []
    found.attrs["not_read"] = ", ".join(one for one in there if one not in said.channels)
    return found


def _is_text(key, channel):
    name = channel.observableId or key
    return name in ("direction", "condition") or channel.unit == measured_description.DATES


def _dataset_of(said, columns, noises, found):
    """Return the dataset of columns by their keys; noises: key -> that of each sample.

    `found` is what there is beside the samples.
    """
    names = {said.channels[key].observableId or key: key for key in said.channels if key in columns}
    # What PEtab's columns, and those of times that a format knows, are needs not be said.
    for name, key in (("time", "time"), ("condition", CONDITION)):
        if key in columns:
            names.setdefault(name, key)
    coords, start = _coordinates(said, columns, names)
    group = None
    for one in ("condition", "direction"):
        if one in coords:
            codes = np.unique(coords[one], return_inverse=True)[1]
            group = codes if group is None else group * (codes.max() + 1) + codes
    order, repairs = None, []
    if "time" in coords:
        where = f"{said.data}, column {names['time']!r}"
        order = measured_checks.in_order(where, coords["time"], group)
    if order is not None:
        repairs.append("samples sorted by time" + (", each condition apart" * (group is not None)))
        coords = {name: values[order] for name, values in coords.items()}
    for name, key in names.items():
        if name in measured_names.COORDINATES:
            continue
        channel = said.channels[key]
        where = f"{said.data}, column {key!r}"
        if name in measured_names.SPEEDS:
            raise checks.refusal(where, name, "none of a wide table: speeds has it")
        raw = columns[key] if order is None else columns[key][order]
        measured_checks.finite(where, raw, gaps=bool(channel.gaps) or key in noises)
        if channel.gaps and (empty := int(np.isnan(raw).sum())):
            repairs.append(f"{name}: {empty} empty cells are not measured")
        factor, cf = channel.scale(key)
        found[name] = "sample", raw * factor, _attributes(name, cf, channel, key)
        noise = noises.get(key)
        if noise is not None and np.isfinite(noise).any():
            noise = (noise if order is None else noise[order]) * abs(factor)
            noise[np.isnan(noise)] = channel.noise_std(key)
            known = noise[np.isfinite(raw)]
            found[name].attrs["noise_std"] = math.sqrt(float(np.mean(known**2)))
            if known.min() != known.max():
                words = f"standard deviation of {name}"
                found[f"{name}_noise_std"] = "sample", noise, {"units": cf, "long_name": words}
    if not found.data_vars:
        raise checks.refusal("channels", list(said.channels), "at least one that was measured")
    for name, values in coords.items():
        cf, words = measured_names.COORDINATES[name]
        found.coords[name] = "sample", values, {"units": cf, "long_name": words}
    if start:
        found["time"].attrs["start"] = start
    found.attrs["repairs"] = "; ".join(repairs)
    return found


def _attributes(name, cf, channel, key):
    return {
        "units": cf,
        "long_name": measured_names.of(name)[1],
        "column": key,
        "sensor": channel.sensor or "",
        "noise_std": channel.noise_std(key),
        "unknown_gain": int(channel.gain == "unknown"),
        "unknown_offset": int(channel.offset == "unknown"),
    }


def _coordinates(said, columns, taken):
    """Return name -> values of the coordinates, and when the first sample was taken, or ""."""
    coords, start = {}, ""
    for name in ("time", "speed"):
        if name in taken:
            key = taken[name]
            where, channel = f"{said.data}, column {key!r}", said.channels.get(key)
            values = columns[key]
            if channel is not None and channel.unit == measured_description.DATES:
                values, start = measured_checks.dates(where, values)
            measured_checks.finite(where, values, endless=name == "time")
            coords[name] = values * (1.0 if channel is None else channel.scale(key)[0])
    if "direction" in taken:
        where = f"{said.data}, column {taken['direction']!r}"
        coords["direction"] = measured_checks.directions(where, columns[taken["direction"]])
    if "condition" in taken:
        given = columns[taken["condition"]]
        codes = measured_checks.complete(f"{said.data}, column {taken['condition']!r}", given)
        names = [str(one) for one in given.categories]
        for one in names:
            if said.conditions and one not in said.conditions:
                raise checks.refusal(CONDITION, one, f"one of {', '.join(said.conditions)}")
        coords["condition"] = np.array(names)[codes]
        for name in ("speed", "direction"):
            each = [getattr(said.conditions.get(one), name, None) for one in names]
            if name not in coords and None not in each:
                each = [_DIRECTIONS.get(one, one) for one in each]
                coords[name] = np.array(each, np.int8 if name == "direction" else float)[codes]
    elif len(said.conditions) == 1:
        ((_, one),) = said.conditions.items()
        count = len(next(iter(columns.values())))
        if one.speed is not None:
            coords.setdefault("speed", np.full(count, one.speed))
        if one.direction is not None:
            coords.setdefault("direction", np.full(count, _DIRECTIONS[one.direction], np.int8))
    return coords, start

"""Long tables, a row for each measurement as PEtab has them, as columns over samples."""

import numpy as np
import xarray as xr

from gearlib.data import measured_names
from gearlib.rig import measured_checks
from gearlib.rig.measured_files import CONDITION, LONG, NOISE


def samples(said, columns):
    """Return (column -> array over samples, column -> noise of each sample, the single speeds).

    Measurements at the same condition, time and speed are one sample; where an observable was not
    measured it is NaN. At a time of infinity, or without times, an observable may be there several
    times: these are samples of their own.
    """
    import pandas as pd

    where = f"{said.data}, column "
    codes = measured_checks.complete(f"{where}{LONG[0]!r}", columns[LONG[0]])
    observables = [str(one) for one in columns[LONG[0]].categories]
    values = columns[LONG[1]]
    noise = columns.get(NOISE, np.full(values.size, np.nan))
    named = {key: i for i, key in enumerate(observables) if key in said.channels}
    for key in said.channels:
        if key not in named and key not in columns:
            raise ValueError(
                f"the observableId {key!r} of {said.data} is missing: it must be one of "
                f"{', '.join(map(repr, observables[:12]))}"
            )
    gaps = np.isin(codes, [i for key, i in named.items() if said.channels[key].gaps])
    measured_checks.finite(f"{where}{LONG[1]!r}", np.where(gaps & np.isnan(values), 0.0, values))
    wrong = np.flatnonzero((noise < 0) | np.isinf(noise))
    if wrong.size:
        raise ValueError(
            f"{where}{NOISE!r}, row {wrong[0] + 1} = {noise[wrong[0]]!r} is not allowed: it must "
            "be a finite number >= 0"
        )
    single, found = {}, xr.Dataset()
    for key in [one for one in named if _name(said, one) in measured_names.SPEEDS]:
        single[key] = named.pop(key)
        _add_speed(found, said, key, values[codes == single[key]], noise[codes == single[key]])
    rest = np.isin(codes, list(named.values()))
    keys = {
        name: columns[name].codes[rest] if name == CONDITION else columns[name][rest]
        for name in columns if name not in (*LONG, NOISE)
    }  # fmt: skip
    codes, values, noise = codes[rest], values[rest], noise[rest]
    frame = pd.DataFrame(keys | {LONG[0]: codes})
    endless = np.isinf(keys["time"]) if "time" in keys else np.ones(codes.shape, bool)
    again = frame.groupby(list(frame.columns), sort=False).cumcount().to_numpy()
    twice = (again > 0) & ~endless
    if twice.any():
        at = int(twice.argmax())
        raise ValueError(
            f"{where}'time' = {keys['time'][at]:.12g} is there twice for the observableId "
            f"{observables[codes[at]]!r}, {int(twice.sum())} times in all: it must be once in each "
            "condition"
        )
    frame = frame.drop(columns=LONG[0]).assign(again=again)
    number = frame.groupby(list(frame.columns), sort=False).ngroup().to_numpy()
    count = int(number.max(initial=-1)) + 1
    first = np.unique(number, return_index=True)[1]
    wide, noises = {}, {}
    for name in keys:
        wide[name] = columns[name][rest][first]
    for key, i in named.items():
        own = codes == i
        wide[key], noises[key] = np.full(count, np.nan), np.full(count, np.nan)
        wide[key][number[own]], noises[key][number[own]] = values[own], noise[own]
    return wide, noises, found


def _name(said, key):
    return said.channels[key].observableId or key


def _add_speed(found, said, key, values, noise):
    """Add the one measurement of a speed at which the motion changes."""
    if values.size > 1:
        raise ValueError(
            f"the observableId {key!r} of {said.data} is there {values.size} times: it must be once"
        )
    channel, name = said.channels[key], _name(said, key)
    factor, cf = channel.scale(key)
    std = noise[0] * factor if np.isfinite(noise[0]) else channel.noise_std(key)
    words = measured_names.SPEEDS[name][1]
    found[name] = (), values[0] * factor, {"units": cf, "long_name": words, "noise_std": std}

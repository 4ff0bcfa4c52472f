"""Golden data: which numbers behind the figures are kept, and how new ones are held against them.

Motions that do not settle (no period was found) carry rounding without bound: of them only their
label and, widely, the fractions of time in each phase of contact are compared.
"""

from contextlib import suppress
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib.data import variables
from tests.golden.tolerances import tolerance

FOLDER = Path(__file__).with_name("data")

#: Of a time course this many samples at most are kept, evenly spread.
SAMPLES = 64

#: A fraction of time of a motion that does not settle, over the recorded periods, by rounding.
UNSETTLED_FRACTION = 0.5

#: What is compared of motions that do not settle as of all others.
_LABELS = ("period", "label", "status")

#: Sentences, with digits inside.
_PROSE = "message"

#: Attributes that figures show, by variable.
_SHOWN = {"verdict": "flag_meanings"}


def datasets(results):
    """Return the datasets behind the figures, as paths below the folder `results`, sorted.

    Shards that are gathered (``x/`` beside ``x.nc``) are not, nor wall times.
    """
    found = [path.relative_to(results) for path in Path(results).rglob("*.nc")]
    gathered = {path.with_suffix("") for path in found}
    return sorted(
        str(path)
        for path in found
        if not gathered & set(path.parents) and not path.name.startswith("times")
    )


def kept(path):
    """Return what is compared of the dataset at `path`."""
    with xr.open_dataset(path) as file:
        dataset = file.load()
    times = [name for name, one in dataset.items() if one.attrs.get("units") == "s"]
    dataset = dataset.drop_vars([*times, *({_PROSE} & set(dataset))])
    steps = {name: -(-size // SAMPLES) for name, size in dataset.sizes.items()}
    dataset = dataset.isel({name: slice(None, None, step) for name, step in steps.items()})
    dataset.attrs = {}
    for name, one in dataset.variables.items():
        one.attrs = {key: one.attrs[key] for key in one.attrs if key == _SHOWN.get(name)}
    return dataset.load()


def write(dataset, path):
    """Write golden data; netCDF-3, whose files have no overhead for each variable."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for variable in dataset.variables.values():
        variable.encoding.clear()
    dataset.to_netcdf(path, engine="netcdf4", format="NETCDF3_64BIT")


def read(name):
    """Return the golden data of a dataset, with the units and long names that figures show."""
    with xr.open_dataset(FOLDER / name, engine="netcdf4") as file:
        dataset = file.load()
    for name in dataset.variables:
        # Other variables are described by the study that makes them.
        with suppress(KeyError):
            alone = xr.Dataset({name: dataset[name].variable})
            dataset[name].attrs |= variables.describe(alone)[name].attrs
    return dataset


def settled(dataset):
    """Return where motions settled, a bool array, or None where the dataset does not say.

    A sweep up or down hands its state on, so that a motion after one that did not settle may be
    another of several.
    """
    if "period" not in dataset:
        return None
    result = dataset.period > 0
    if "tuning" in result.dims and "direction" in dataset.coords:
        before = result.shift(tuning=1, fill_value=True)
        after = result.shift(tuning=-1, fill_value=True)
        result &= before | (dataset.direction != "up")
        result &= after | (dataset.direction != "down")
    return result


def differences(name, golden, found):
    """Return a sentence for each variable of the dataset `name` that has moved too far."""
    lost, new = set(golden.variables) - set(found.variables), set(found.variables) - set(golden)
    sentences = [f"{name}: {each} is gone" for each in sorted(lost)]
    new -= set(golden.coords)
    sentences += [f"{name}: {each} has no golden data" for each in sorted(new)]
    if golden.sizes != found.sizes:
        return [*sentences, f"{name}: sizes {dict(golden.sizes)} are now {dict(found.sizes)}"]
    steady = settled(golden)
    for each, key in _SHOWN.items():
        if {each} <= set(golden.variables) & set(found.variables):
            old, new = golden[each].attrs.get(key), found[each].attrs.get(key)
            sentences += [f"{name}: {key} was {old!r}, is {new!r}"] if old != new else []
    for each in golden.variables:
        if each not in lost:
            sentences += _difference(name, each, golden[each], found[each], steady)
    return sentences


def _difference(name, each, golden, found, steady):
    """Return no sentence or one."""
    if golden.dims != found.dims:
        return [f"{name}: {each} had the dimensions {golden.dims}, has {found.dims}"]
    old, new = golden.values, found.values
    if old.dtype.kind in "OUS":
        equal = (old.astype(str) == new.astype(str)).all()
        return [] if equal else [f"{name}: {each} was {old.tolist()}, is {new.tolist()}"]
    row = tolerance(name, each, old.dtype.kind)
    absolute = np.full(old.shape, row.absolute)
    relative = np.full(old.shape, row.relative)
    if each not in _LABELS and steady is not None and set(steady.dims) <= set(golden.dims):
        loose = ~steady.broadcast_like(golden).transpose(*golden.dims).values
        absolute[loose] = UNSETTLED_FRACTION if each.startswith("fraction_") else np.inf
        relative[loose] = 0.0
    with np.errstate(invalid="ignore"):
        far = np.abs(new.astype(float) - old) > absolute + relative * np.abs(old)
    same = (old == new) | (np.isnan(old.astype(float)) & np.isnan(new.astype(float)))
    unlike = np.isfinite(old.astype(float)) != np.isfinite(new.astype(float))
    far = (far | (unlike & np.isfinite(absolute))) & ~same
    if far.sum() <= row.stray * far.size:
        return []
    place = np.unravel_index(np.argmax(far), far.shape)
    return [
        f"{name}: {far.sum()} of {far.size} numbers of {each} moved, at {tuple(map(int, place))} "
        f"from {old[place]:.17g} to {new[place]:.17g}; allowed: {row.relative:g} relative, "
        f"{row.absolute:g} absolute ({row.reason})"
    ]

"""Golden data: the numbers behind the figures, and how far new ones may differ from them.

Motions that do not settle (no period was found) carry rounding without bound: only their label and,
widely, the fractions of time in each contact state are compared.
"""

from contextlib import suppress
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from gearlib.data import variables

FOLDER = Path(__file__).with_name("data")

#: Largest number of samples of a time history that are stored, evenly spread.
MAX_SAMPLES = 64
#: Attributes of datasets that appear in figures.
SHOWN = {"variable", "amplitude", "stage", "load_case"}

#: Largest difference of a fraction of time for a motion that does not settle.
UNSETTLED_FRACTION = 0.5

#: Variables that are compared even for motions that do not settle.
LABELS = ("period", "label", "status")


class Tolerance(NamedTuple):
    """Largest relative and absolute difference, and the fraction of numbers that may exceed it."""

    relative: float
    absolute: float
    exceptions: float = 0.0


#: Settled motions differ by rounding only; exp and sin differ between processors.
ROUNDING = Tolerance(1e-9, 1e-9)
#: Counts, labels and flags.
EXACT = Tolerance(0.0, 0.0)

#: Tolerances by patterns of the dataset and of its variables; the first that fits applies.
#: They follow from changes of the gear pair's parameters by one unit in the last place.
TOLERANCES = {
    # Steps are chosen from errors of the size of rounding: up to 4 % more or fewer.
    ("*", "evaluations *_evaluations cost"): Tolerance(0.1, 0.0),
    # Without damping multipliers lie on the unit circle. Where two of them meet, they separate by
    # the
    # square root of rounding, and beyond this point the branch may continue on another orbit.
    ("branches/conservative.nc", "*"): Tolerance(1e-6, 1e-6, exceptions=0.15),
    # Where two multipliers meet, they differ by the square root of rounding.
    ("loci.nc", "multiplier_*"): Tolerance(1e-6, 1e-6),
    # On soft bearings rounding grows for a long time, and in one of the four models without end.
    # Two
    # of the four changes refer to this model.
    ("models/fig8_*", "value"): Tolerance(1e-4, 1e-9, exceptions=0.25),
    ("models/fig8_*", "change"): Tolerance(1e-4, 1e-9, exceptions=0.5),
    # If only oil damps the motion, in free flight, motions settle slowly or never.
    ("nonlinear_damping/oil_*", "period jump jump_size peak peak_tuning lost_from lost_to"): (
        Tolerance(0.05, 0.0, exceptions=0.1)
    ),
    # Chaotic motions have few reliable digits and inexact averages, but their label is exact.
    ("labels/*", "digits exponent uncertainty"): Tolerance(0.1, 2.0),
}


def tolerance_of(dataset_name, variable):
    """Return the `Tolerance` of a variable of a dataset, given by its path below results/."""
    for (datasets, names), tolerance in TOLERANCES.items():
        fits = any(fnmatch(str(variable.name), name) for name in names.split())
        if fits and fnmatch(dataset_name, datasets):
            return tolerance
    return ROUNDING if variable.dtype.kind == "f" else EXACT


def datasets(results):
    """Return the sorted paths, below the folder `results`, of the datasets behind the figures.

    Shards that are gathered (``x/`` beside ``x.nc``) and wall times are left out.
    """
    paths = [path.relative_to(results) for path in Path(results).rglob("*.nc")]
    gathered = {path.with_suffix("") for path in paths}
    return sorted(
        str(path)
        for path in paths
        if not gathered & set(path.parents) and not path.name.startswith("times")
    )


def compared_part(path):
    """Return the compared part of a dataset, without times and messages and with few samples."""
    with xr.open_dataset(path) as file:
        dataset = file.load()
    times = [name for name, variable in dataset.items() if variable.attrs.get("units") == "s"]
    dataset = dataset.drop_vars([*times, "message"], errors="ignore")
    steps = {name: -(-size // MAX_SAMPLES) or 1 for name, size in dataset.sizes.items()}
    dataset = dataset.isel({name: slice(None, None, step) for name, step in steps.items()})
    dataset.attrs = {name: text for name, text in dataset.attrs.items() if name in SHOWN}
    for name, variable in dataset.variables.items():
        meanings = variable.attrs.get("flag_meanings") if name == "verdict" else None
        variable.attrs = {"flag_meanings": meanings} if meanings else {}
    return dataset.load()


def write(dataset, path):
    """Write golden data as netCDF-3, whose files have no overhead for each variable."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for variable in dataset.variables.values():
        variable.encoding.clear()
    dataset.to_netcdf(path, engine="netcdf4", format="NETCDF3_64BIT")


def read(name):
    """Return the golden data of a dataset, with the units and long names that figures show."""
    with xr.open_dataset(FOLDER / name, engine="netcdf4") as file:
        dataset = file.load()
    for name in dataset.variables:
        # Variables without a common description are described by their study.
        with suppress(KeyError):
            alone = xr.Dataset({name: dataset[name].variable})
            dataset[name].attrs |= variables.add_metadata(alone)[name].attrs
    return dataset


def settled(dataset):
    """Return whether each motion has settled, as a bool array, or None if the dataset does not say.

    A sweep up or down passes its state on, so that the motion after an unsettled one may also
    differ.
    """
    if "period" not in dataset:
        return None
    periodic = dataset.period > 0
    if "tuning" in periodic.dims and "direction" in dataset.coords:
        previous_settled = periodic.shift(tuning=1, fill_value=True)
        next_settled = periodic.shift(tuning=-1, fill_value=True)
        periodic &= previous_settled | (dataset.direction != "up")
        periodic &= next_settled | (dataset.direction != "down")
    return periodic


def differences(name, golden, dataset):
    """Return a sentence for each variable of a dataset that differs by more than its tolerance."""
    if golden.variables.keys() - dataset.variables or dataset.data_vars.keys() - golden.variables:
        return [f"{name}: variables {[*golden.variables]} are now {[*dataset.variables]}"]
    if golden.sizes != dataset.sizes:
        return [f"{name}: sizes {dict(golden.sizes)} are now {dict(dataset.sizes)}"]
    periodic = settled(golden)
    pairs = [(golden[key], dataset[key]) for key in golden.variables]
    return [text for old, new in pairs if (text := _difference(name, old, new, periodic))]


def _difference(dataset_name, golden, variable, periodic):
    """Return a sentence on the difference of a variable, or "" if it is within the tolerance.

    `periodic` tells which motions have settled, or is None; others are compared loosely.
    """
    place = f"{dataset_name}: {golden.name}"
    if golden.dims != variable.dims:
        return f"{place} had the dimensions {golden.dims}, has {variable.dims}"
    meanings = [array.attrs.get("flag_meanings") for array in (golden, variable)]
    if golden.name == "verdict" and meanings[0] != meanings[1]:
        return f"{place} meant {meanings[0]!r}, means {meanings[1]!r}"
    if golden.dtype.kind in "OUS":
        old, new = (array.values.astype(str).tolist() for array in (golden, variable))
        return "" if old == new else f"{place} was {old}, is {new}"
    tolerance = tolerance_of(dataset_name, golden)
    old, new = golden.values.astype(float), variable.values.astype(float)
    with np.errstate(invalid="ignore"):
        differs = np.abs(new - old) > tolerance.absolute + tolerance.relative * np.abs(old)
        differs |= np.isfinite(old) != np.isfinite(new)
        if (
            golden.name not in LABELS
            and periodic is not None
            and {*periodic.dims} <= {*golden.dims}
        ):
            is_unsettled = ~periodic.broadcast_like(golden).transpose(*golden.dims).values
            differs_widely = np.abs(new - old) > UNSETTLED_FRACTION
            differs &= ~is_unsettled | (differs_widely if "fraction" in str(golden.name) else False)
    if differs.sum() <= tolerance.exceptions * differs.size:
        return ""
    index = np.unravel_index(np.argmax(differs), differs.shape)
    return (
        f"{place}: {differs.sum()} of {differs.size} numbers moved, at {tuple(map(int, index))} "
        f"from {old[index]:.17g} to {new[index]:.17g}; allowed are {tolerance}"
    )

"""Golden data: the numbers behind the figures, and how far new ones may differ from them.

If a motion does not settle (no period was found), rounding errors grow without bound. Then only its
labels are compared and, with a large tolerance, the fractions of time in each contact state.
"""

import math
from contextlib import suppress
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from gearlib.data import variables

FOLDER = Path(__file__).with_name("data")

#: Largest number of samples of a time history that are stored, at equal distances.
MAX_SAMPLES = 64
#: Attributes of datasets that appear in figures.
COMPARED_ATTRIBUTES = {"variable", "amplitude", "stage", "load_case"}

#: Largest allowed difference of a fraction of time for a motion that does not settle.
UNSETTLED_FRACTION = 0.5

#: Variables that are compared even for motions that do not settle.
LABELS = ("period", "label", "status")


class Tolerance(NamedTuple):
    """Largest allowed relative and absolute difference, and the fraction of exceptions."""

    relative: float
    absolute: float
    exceptions: float = 0.0


#: Settled motions differ by rounding only; exp and sin differ between processors.
ROUNDING = Tolerance(1e-9, 1e-9)
#: Counts, labels and flags must be equal.
EXACT = Tolerance(0.0, 0.0)

#: Tolerances by name patterns of dataset and variables; the first pattern that matches applies.
#: They were found by changing the gear pair's parameters by one unit in the last place.
TOLERANCES = {
    # Steps are chosen from errors of the size of rounding: up to 4 % more or fewer.
    ("*", "evaluations *_evaluations cost"): Tolerance(0.1, 0.0),
    # Without damping, multipliers lie on the unit circle. Where two of them meet, their error is
    # the square root of rounding errors, and the branch may continue on another orbit.
    ("branches/conservative.nc", "*"): Tolerance(1e-6, 1e-6, exceptions=0.15),
    # Where two multipliers meet, their error is the square root of rounding errors.
    ("loci.nc", "multiplier_*"): Tolerance(1e-6, 1e-6),
    # On soft bearings rounding errors grow for a long time, and in one of the four models without
    # bound. Two of the four changes refer to this model.
    ("models/fig8_*", "value"): Tolerance(1e-4, 1e-9, exceptions=0.25),
    ("models/fig8_*", "change"): Tolerance(1e-4, 1e-9, exceptions=0.5),
    # If only oil damps the motion, i.e. in free flight, motions settle slowly or never.
    ("nonlinear_damping/oil_*", "period jump jump_size peak peak_tuning lost_from lost_to"): (
        Tolerance(0.05, 0.0, exceptions=0.1)
    ),
    # Chaotic motions have few reliable digits and inexact averages, but their labels are reliable.
    ("labels/*", "digits exponent uncertainty"): Tolerance(0.1, 2.0),
}


def tolerance_of(dataset_name, variable):
    """Return the `Tolerance` of a variable of a dataset, given by its path below results/."""
    for (dataset_pattern, variable_patterns), tolerance in TOLERANCES.items():
        matches = any(fnmatch(str(variable.name), pattern) for pattern in variable_patterns.split())
        if matches and fnmatch(dataset_name, dataset_pattern):
            return tolerance
    return ROUNDING if variable.dtype.kind == "f" else EXACT


def dataset_names(results):
    """Return the sorted paths of the datasets behind the figures, relative to `results`.

    Wall times are left out, and so are shards, i.e. files in ``x/`` that were gathered in ``x.nc``.
    """
    paths = [path.relative_to(results) for path in Path(results).rglob("*.nc")]
    gathered = {path.with_suffix("") for path in paths}
    return sorted(
        str(path)
        for path in paths
        if not gathered & set(path.parents) and not path.name.startswith("times")
    )


def read_compared_data(path):
    """Read a dataset without wall times and messages, with at most `MAX_SAMPLES` samples."""
    with xr.open_dataset(path) as file:
        dataset = file.load()
    times = [name for name, variable in dataset.items() if variable.attrs.get("units") == "s"]
    dataset = dataset.drop_vars([*times, "message"], errors="ignore")
    steps = {name: math.ceil(size / MAX_SAMPLES) or 1 for name, size in dataset.sizes.items()}
    dataset = dataset.isel({name: slice(None, None, step) for name, step in steps.items()})
    dataset.attrs = {
        name: text for name, text in dataset.attrs.items() if name in COMPARED_ATTRIBUTES
    }
    for name, variable in dataset.variables.items():
        meanings = variable.attrs.get("flag_meanings") if name == "verdict" else None
        variable.attrs = {"flag_meanings": meanings} if meanings else {}
    return dataset.load()


def write(dataset, path):
    """Write golden data as netCDF-3, which needs less space per variable than netCDF-4."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for variable in dataset.variables.values():
        variable.encoding.clear()
    dataset.to_netcdf(path, engine="netcdf4", format="NETCDF3_64BIT")


def read(name):
    """Return the golden data of a dataset, with the units and long names that figures show."""
    with xr.open_dataset(FOLDER / name, engine="netcdf4") as file:
        dataset = file.load()
    for name in dataset.variables:
        # Variables of a single study are not in the common table, which raises a KeyError.
        with suppress(KeyError):
            single_variable = xr.Dataset({name: dataset[name].variable})
            dataset[name].attrs |= variables.add_metadata(single_variable)[name].attrs
    return dataset


def find_settled_motions(dataset):
    """Return whether each motion has settled, as a bool array, or None without a period variable.

    In sweeps up and down each motion starts from the previous one, so that a motion also counts as
    unsettled if the previous one is.
    """
    if "period" not in dataset:
        return None
    is_settled = dataset.period > 0
    if "tuning" in is_settled.dims and "direction" in dataset.coords:
        previous_settled = is_settled.shift(tuning=1, fill_value=True)
        next_settled = is_settled.shift(tuning=-1, fill_value=True)
        is_settled &= previous_settled | (dataset.direction != "up")
        is_settled &= next_settled | (dataset.direction != "down")
    return is_settled


def describe_differences(name, golden, dataset):
    """Return a sentence for each variable of a dataset that differs by more than its tolerance."""
    if golden.variables.keys() - dataset.variables or dataset.data_vars.keys() - golden.variables:
        return [f"{name}: variables {[*golden.variables]} are now {[*dataset.variables]}"]
    if golden.sizes != dataset.sizes:
        return [f"{name}: sizes {dict(golden.sizes)} are now {dict(dataset.sizes)}"]
    is_settled = find_settled_motions(golden)
    pairs = [(golden[key], dataset[key]) for key in golden.variables]
    return [
        text for old, new in pairs if (text := _describe_difference(name, old, new, is_settled))
    ]


def _describe_difference(dataset_name, golden, new_variable, is_settled):
    """Return a sentence on the difference of a variable, or "" if it is within the tolerance.

    `is_settled` says which motions have settled; the others are compared with large tolerances. It
    is None if all numbers are compared equally.
    """
    label = f"{dataset_name}: {golden.name}"
    if golden.dims != new_variable.dims:
        return f"{label} had the dimensions {golden.dims}, has {new_variable.dims}"
    old_meanings, new_meanings = (
        array.attrs.get("flag_meanings") for array in (golden, new_variable)
    )
    if golden.name == "verdict" and old_meanings != new_meanings:
        return f"{label} had the flags {old_meanings!r}, has {new_meanings!r}"
    if golden.dtype.kind in "OUS":
        old, new = (array.values.astype(str).tolist() for array in (golden, new_variable))
        return "" if old == new else f"{label} was {old}, is {new}"
    tolerance = tolerance_of(dataset_name, golden)
    old, new = golden.values.astype(float), new_variable.values.astype(float)
    with np.errstate(invalid="ignore"):
        differs = np.abs(new - old) > tolerance.absolute + tolerance.relative * np.abs(old)
        differs |= np.isfinite(old) != np.isfinite(new)
        depends_on_motion = is_settled is not None and {*is_settled.dims} <= {*golden.dims}
        if depends_on_motion and golden.name not in LABELS:
            counts = is_settled.broadcast_like(golden).transpose(*golden.dims).values
            if "fraction" in str(golden.name):
                counts = counts | (np.abs(new - old) > UNSETTLED_FRACTION)
            differs &= counts
    if differs.sum() <= tolerance.exceptions * differs.size:
        return ""
    index = np.unravel_index(np.argmax(differs), differs.shape)
    return (
        f"{label}: {differs.sum()} of {differs.size} numbers differ, at {tuple(map(int, index))} "
        f"{old[index]:.17g} became {new[index]:.17g}; the tolerance is {tolerance}"
    )

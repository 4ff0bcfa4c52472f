"""Compute shards of `gearlib.scatter`, Sobol' indices, and a table of tolerances."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from gearlib.data.variables import QUANTITIES
from gearlib.models.geometry import from_values as geometry
from gearlib.models.pair import GearPair
from gearlib.uncertainty.designs import StageDesign
from gearlib.uncertainty.scatter import shard as scatter_shard
from gearlib.uncertainty.scatter import sobol_indices

#: Endings of the variables with the moments of a quantity, and the percentiles of the table.
_MOMENTS, _PERCENTILES = ("nominal", "mean", "deviation"), (5, 50, 95)


def nominal_design(pair: GearPair, gears: dict | None = None) -> GearPair | StageDesign:
    """Return the design whose parameters scatter: a `GearPair`, or gears given by geometry.

    `gears` has the geometry of two gears, their torque and stiffness method, or is None; they have
    the damping of `pair`.
    """
    if gears is None:
        return pair
    return StageDesign(
        geometry.stage(gears),
        keep_backlash=gears.get("backlash") is not None,
        torque=gears["torque"],
        stiffness=gears.get("stiffness"),
        options=gears.get("stiffness_options"),
        material_damping=pair.material_damping,
        backlash_damping_ratio=pair.backlash_damping_ratio,
    )


def scatter_of_shard(
    *, pair: GearPair, tolerances: dict, samples: int, shard: str, threads, gears=None, **settings
) -> xr.Dataset:
    """Return the results of `gearlib.scatter` for a part of all random samples.

    `shard` is a string such as "0-100": the indices of its first sample and of the first sample
    after it. `pair` and `gears` are arguments of `nominal_design`, `tolerances` maps
    parameters to their distributions, `settings` are further arguments of `gearlib.scatter`.
    """
    first, last = map(int, shard.split("-"))
    design = nominal_design(pair, gears)
    return scatter_shard(design, tolerances, samples, first, last, threads=threads, **settings)


def sobol_indices_of_design(
    *, pair: GearPair, tolerances: dict, samples: int, gears: dict | None = None, **settings: Any
) -> xr.Dataset:
    """Return the Sobol' indices of a design from a number of samples.

    `pair` and `gears` are arguments of `nominal_design`, `tolerances` maps parameters to their
    distributions, `settings` are further arguments of `gearlib.sobol_indices`.
    """
    return sobol_indices(nominal_design(pair, gears), tolerances, n=samples, **settings)


def rows(scattered: xr.Dataset) -> Iterator[list]:
    """Yield the rows of the table of `gearlib.scatter`: the names of the columns, then values.

    Each quantity of the dataset `scattered` has a row; found is the number of designs that have it.
    """
    quantiles = [f"quantile_{percentile}" for percentile in _PERCENTILES]
    yield ["quantity", "unit", *_MOMENTS, *quantiles, "found", "samples"]
    for name in QUANTITIES:
        if name not in scattered:
            continue
        defined = scattered[f"{name}_status"].values == 0
        values = scattered[name].values[defined] if defined.any() else np.nan
        moments = [scattered.get(f"{name}_{moment}", np.nan) for moment in _MOMENTS]
        numbers = [*moments, *np.percentile(values, _PERCENTILES)]
        cells = [f"{float(number):.6g}" for number in numbers]
        yield [name, scattered[name].attrs["units"], *cells, int(defined.sum()), defined.size]

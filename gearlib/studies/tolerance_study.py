"""Compute shards of `gearlib.scatter`, Sobol' indices, and a table of tolerances."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from gearlib.data.variables import QUANTITIES
from gearlib.models.geometry import from_values as geometry
from gearlib.models.pair import GearPair
from gearlib.uncertainty.designs import DrawnPair
from gearlib.uncertainty.indices import sobol_indices
from gearlib.uncertainty.scatter import shard as scatter_shard

#: Endings of the variables with the moments of a quantity, and the percentiles of the table.
_MOMENTS, _PERCENTILES = ("nominal", "mean", "deviation"), (5, 50, 95)


def nominal_design(pair: GearPair, drawing: dict | None = None) -> GearPair | DrawnPair:
    """Return the design whose parameters scatter: a `GearPair`, or gears that are drawn.

    `drawing` has the drawing data of two gears, their torque
    and stiffness method, or is None; the damping of drawn gears is that of `pair`.
    """
    if drawing is None:
        return pair
    return DrawnPair(
        geometry.stage(drawing),
        # "drawing" keeps the backlash of the drawing; with None it follows from other parameters.
        backlash=None if drawing.get("backlash") is None else "drawing",
        torque=drawing["torque"],
        stiffness=drawing.get("stiffness"),
        options=drawing.get("stiffness_options"),
        material_damping=pair.material_damping,
        backlash_damping_ratio=pair.backlash_damping_ratio,
    )


def scatter_of_shard(
    *, pair: GearPair, tolerances: dict, samples: int, shard: str, threads, drawing=None, **settings
) -> xr.Dataset:
    """Return the results of `gearlib.scatter` for a part of all random samples.

    `shard` is a string such as "0-100": the indices of its first sample and of the first sample
    after it. `pair` and `drawing` are arguments of `nominal_design`, `tolerances` maps
    parameters to their distributions, `settings` are further arguments of `gearlib.scatter`.
    """
    first, last = map(int, shard.split("-"))
    design = nominal_design(pair, drawing)
    return scatter_shard(design, tolerances, samples, first, last, threads=threads, **settings)


def sobol_indices_of_design(
    *, pair: GearPair, tolerances: dict, samples: int, drawing: dict | None = None, **settings: Any
) -> xr.Dataset:
    """Return the Sobol' indices of a design from a number of samples.

    `pair` and `drawing` are arguments of `nominal_design`, `tolerances` maps parameters to their
    distributions, `settings` are further arguments of `gearlib.sobol_indices`.
    """
    return sobol_indices(nominal_design(pair, drawing), tolerances, n=samples, **settings)


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

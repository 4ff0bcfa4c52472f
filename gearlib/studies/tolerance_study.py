"""Compute shards of `gearlib.scatter`, Sobol' indices, and the table of scattering quantities."""

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

#: Suffixes of variables with moments of a quantity, and percentiles in the table.
_MOMENTS, _PERCENTILES = ("nominal", "mean", "deviation"), (5, 50, 95)


def build_nominal_design(pair: GearPair, gears: dict | None = None) -> GearPair | StageDesign:
    """Return the nominal design: `pair`, or a `StageDesign` if the geometry of the gears is given.

    `gears` is None or a dict with the geometry of two gears, their torque (N m) and the stiffness
    method. The damping is taken from `pair`.
    """
    if gears is None:
        return pair
    return StageDesign(
        geometry.build_stage(gears),
        keep_backlash=gears.get("backlash") is not None,
        torque=gears["torque"],
        stiffness=gears.get("stiffness"),
        options=gears.get("stiffness_options"),
        material_damping=pair.material_damping,
        backlash_damping_ratio=pair.backlash_damping_ratio,
    )


def compute_scatter_shard(
    *, pair: GearPair, tolerances: dict, samples: int, shard: str, threads, gears=None, **settings
) -> xr.Dataset:
    """Compute a part (shard) of the random designs of `gearlib.scatter`.

    `samples` is the total number of designs. `shard` is a string "FIRST-STOP", e.g. "0-100" for the
    designs 0 to 99. `pair` and `gears` are arguments of `build_nominal_design`, and `tolerances`
    maps parameters to distributions. `settings` has further arguments of `gearlib.scatter`.
    """
    start, stop = map(int, shard.split("-"))
    design = build_nominal_design(pair, gears)
    return scatter_shard(design, tolerances, samples, start, stop, threads=threads, **settings)


def compute_sobol_indices(
    *, pair: GearPair, tolerances: dict, samples: int, gears: dict | None = None, **settings: Any
) -> xr.Dataset:
    """Compute Sobol' indices: the contribution of each tolerance to the variance of a result.

    `pair` and `gears` are arguments of `build_nominal_design`, and `tolerances` maps parameters to
    distributions. `samples` is the number of samples, a power of 2; each sample takes several
    designs. `settings` has further arguments of `gearlib.sobol_indices`.
    """
    return sobol_indices(build_nominal_design(pair, gears), tolerances, n=samples, **settings)


def table_rows(scattered: xr.Dataset) -> Iterator[list]:
    """Yield the rows of the table of scattering quantities, beginning with the column names.

    `scattered` is a dataset of `gearlib.scatter`. Each quantity has a row with nominal value, mean,
    standard deviation and percentiles. The column "found" is the number of designs for which the
    quantity was found (status 0), and "samples" the total number of designs.
    """
    quantiles = [f"quantile_{percentile}" for percentile in _PERCENTILES]
    yield ["quantity", "unit", *_MOMENTS, *quantiles, "found", "samples"]
    for name in QUANTITIES:
        if name not in scattered:
            continue
        is_found = scattered[f"{name}_status"].values == 0
        values = scattered[name].values[is_found] if is_found.any() else np.nan
        moments = [scattered.get(f"{name}_{moment}", np.nan) for moment in _MOMENTS]
        numbers = [*moments, *np.percentile(values, _PERCENTILES)]
        cells = [f"{float(number):.6g}" for number in numbers]
        yield [name, scattered[name].attrs["units"], *cells, int(is_found.sum()), is_found.size]

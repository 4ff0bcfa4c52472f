"""Tolerances in the workflow: shards of `gearlib.scatter`, Sobol' indices and a table."""

import numpy as np

from gearlib.data.variables import QUANTITIES
from gearlib.models.geometry import drawings
from gearlib.models.pair import GearPair
from gearlib.uncertainty.designs import DrawnPair
from gearlib.uncertainty.indices import sobol_indices
from gearlib.uncertainty.scatter import shard as shard_of

#: Ends of the names of a quantity's moments, and its percentiles.
_MOMENTS, _PERCENTILES = ("nominal", "mean", "deviation"), (5, 50, 95)


def model_of(pair, drawing=None):
    """Return what scatters: a `GearPair` by its parameters, or its drawing with their dampings."""
    model = GearPair(**pair)
    if drawing is None:
        return model
    return DrawnPair(
        drawings.mesh(drawing),
        backlash=None if drawing.get("backlash") is None else "drawing",
        torque=drawing["torque"],
        stiffness=drawing.get("stiffness"),
        options=drawing.get("stiffness_options"),
        material_damping=model.material_damping,
        backlash_damping_ratio=model.backlash_damping_ratio,
    )


def compute(*, pair, tolerances, samples, shard, threads, drawing=None, **settings):
    """Return a shard "first-last" of `gearlib.scatter`, whose other arguments are `settings`."""
    first, last = map(int, shard.split("-"))
    model = model_of(pair, drawing)
    return shard_of(model, tolerances, samples, first, last, threads=threads, **settings)


def indices(*, pair, tolerances, samples, drawing=None, **settings):
    """Return Sobol' indices by `gearlib.sobol_indices` from so many samples."""
    return sobol_indices(model_of(pair, drawing), tolerances, n=samples, **settings)


def rows(scattered):
    """Yield the table of `gearlib.scatter`: a head and a row for each quantity."""
    quantiles = [f"quantile_{share}" for share in _PERCENTILES]
    yield ["quantity", "unit", *_MOMENTS, *quantiles, "found", "samples"]
    for name in filter(scattered.__contains__, QUANTITIES):
        found = scattered[f"{name}_status"].values == 0
        values = scattered[name].values[found] if found.any() else np.nan
        moments = [scattered.get(f"{name}_{end}", np.nan) for end in _MOMENTS]
        numbers = [*moments, *np.percentile(values, _PERCENTILES)]
        cells = [f"{float(number):.6g}" for number in numbers]
        yield [name, scattered[name].attrs["units"], *cells, int(found.sum()), found.size]

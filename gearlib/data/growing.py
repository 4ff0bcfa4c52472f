"""Curves without motions that grow: undamped ones reach 1e8 static deflections and more."""

import numpy as np

#: A motion so many times as large as its model is one that grows.
FAR_OFF = 1e3


def without_growth(curve, extent):
    """Return a result of `gearlib.sweep` with NaN where its motion has grown beyond all use.

    extent: as in `Model.extent`, the largest length of the model in static deflections.
    """
    reach = np.maximum(abs(curve.displacement_max), abs(curve.displacement_min))
    seen = reach.max([dim for dim in reach.dims if dim != "tuning"]) <= FAR_OFF * extent
    return curve.assign(
        {
            name: values.where(seen)
            for name, values in curve.data_vars.items()
            if "tuning" in values.dims and values.dtype.kind == "f"
        }
    )

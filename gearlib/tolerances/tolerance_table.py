"""What of each quantity the tolerances leave open, as a table."""

import numpy as np

from gearlib.data.scatter_variables import QUANTITIES

#: Ends of the names of what is told of a quantity.
TOLD = ("nominal", "mean", "deviation")
_QUANTILES = (5, 50, 95)


def rows(scattered):
    """Yield the names of the columns, and a row for each quantity of `gearlib.scatter`."""
    quantiles = [f"quantile_{share}" for share in _QUANTILES]
    yield ["quantity", "unit", *TOLD, *quantiles, "found", "samples"]
    for name in filter(scattered.__contains__, QUANTITIES):
        there = scattered[f"{name}_status"].values == 0
        values = scattered[name].values[there]
        spread = np.percentile(values, _QUANTILES) if values.size else [np.nan] * 3
        numbers = [scattered.get(f"{name}_{end}", np.nan) for end in TOLD]
        cells = [f"{float(one):.6g}" for one in (*numbers, *spread)]
        yield [name, scattered[name].attrs["units"], *cells, int(there.sum()), there.size]

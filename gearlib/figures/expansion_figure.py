"""Polynomial chaos beside exact runs: distributions at several speeds, errors over the runs."""

import numpy as np

from gearlib.figures import plot_curves, style

_HEIGHT = 3.8
_WAYS = {"polynomial_chaos": "polynomial chaos", "samples": "as many runs"}
#: Below it an error is that of the reference.
_LEAST = 1e-4


@style.styled()
def expansions(found, *, figure=None):
    """Draw what polynomial chaos makes of a distribution, and its errors, at each speed.

    Parameters
    ----------
    found : xarray.Dataset
        Of `gearlib.tolerances.expansions.expansion_errors`; of many speeds choose some by ``sel``.
    figure : matplotlib.figure.Figure, optional

    Returns
    -------
    matplotlib.figure.Figure
        For each speed the share of designs below a height, exact and by the polynomial of the
        highest order, above the largest errors of that share over the number of runs.

    Raises
    ------
    ValueError
        If the dataset is another, or of one speed alone.
    """
    names = ("distribution_error", "height_quantile", "exact_height_quantile", "designs_run")
    plot_curves.need("expansions", found, names, "tolerances.expansions.expansion_errors")
    if "speed" not in found.dims:
        raise ValueError(
            f"speed = {float(found.speed):g} is not allowed: it must be a dimension, as of "
            "found.sel(speed=[...])"
        )
    if figure is None:
        from matplotlib import pyplot

        size = (style.PAGE_WIDTH, _HEIGHT)
        figure = pyplot.figure(figsize=size, layout="constrained")
    above, below = figure.subplots(2, found.sizes["speed"], sharey="row", squeeze=False)
    highest = int(found.polynomial_order[-1])
    scale, unit = style.length_unit(float(found.exact_height_quantile.max()))
    share, looks = found["quantile"].values, style.looks(_WAYS)
    for j, speed in enumerate(found.speed.values):
        one = found.isel(speed=j)
        exact = one.exact_height_quantile.values / scale
        above[j].plot(exact, share, color="black", lw=1.6, label="exact runs")
        stand_in = one.height_quantile.sel(estimate="polynomial_chaos").values[-1] / scale
        look = looks["polynomial_chaos"]
        words = f"polynomial of order {highest}"
        above[j].plot(stand_in, share, color=look.colour, ls=look.line, lw=0.9, label=words)
        # Beyond the exact ones a polynomial of high order has no end.
        above[j].set_xlim(style.limits(exact, margin=0.3))
        above[j].set_title(f"{speed:g} rpm")
        above[j].set_xlabel(f"peak-to-peak displacement ({unit})")
        for way, words in _WAYS.items():
            errors = np.maximum(one.distribution_error.sel(estimate=way).values, _LEAST)
            look, runs = looks[way], one.designs_run.values
            marks = {"color": look.colour, "ls": look.line, "marker": look.marker, "ms": 3}
            below[j].loglog(runs, errors, label=words, **marks)
        below[j].set_xlabel("runs")
    above[0].set_ylabel("share of the designs below")
    above[0].set_ylim(0.0, 1.0)
    below[0].set_ylabel("largest error of the share")
    parts = [one.get_legend_handles_labels()[0] for one in (above[0], below[0])]
    style.legend(figure, [*parts[0], *parts[1]], 4)
    return figure

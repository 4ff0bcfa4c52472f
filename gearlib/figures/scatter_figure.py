"""Scatter by tolerances: bands over speed, histograms of quantities, and Sobol' indices."""

import math

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gearlib.data.variables import QUANTITIES, STATUSES
from gearlib.figures import panels, style

_HEIGHT, _ROW_HEIGHT = 5.0, 1.7
_BINS = 24
_DIRECTIONS = {
    "up": "speed rises",
    "down": "speed falls",
    "cold": "from rest",
    "seeded": "seeded starts",
}
_BAND_OPACITY = 0.25
_GREY = "#CFCFCF"


@style.styled()
def draw(scattered: xr.Dataset, *, indices: xr.Dataset | None = None) -> dict[str, Figure]:
    """Return the figures of a result of `gearlib.scatter`, in a dict by name.

    `indices` is a result of `gearlib.sobol_indices` or None.
    """
    return {
        "tolerance_bands": draw_bands(scattered),
        "tolerance_quantities": draw_quantities(scattered, indices=indices),
    }


@style.styled()
def draw_bands(scattered: xr.Dataset):
    """Return a figure of quantile bands of displacement, and of probabilities, over the speed.

    `scattered` is a result of `gearlib.scatter`, over "tuning" or "speed": its variable height_band
    has quantiles of the peak-to-peak displacement, its direction "seeded" random initial states.
    """
    figure = style.page_figure(_HEIGHT)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    dim = "tuning" if "tuning" in scattered.dims else "speed"
    x, band = scattered[dim], scattered.height_band
    size, unit = style.readable_unit(band.units, band)
    curve_styles = style.curve_styles(map(str, scattered.direction.values))
    handles = []
    for name, curve_style in curve_styles.items():
        line = {"color": curve_style.colour, "linestyle": curve_style.line}
        # Seeded starts end on several motions, for which a common band would have no meaning.
        if name != "seeded" or len(curve_styles) == 1:
            low, median, high = band.sel(direction=name).values / size
            options = {"color": curve_style.colour, "alpha": _BAND_OPACITY, "linewidth": 0}
            above.fill_between(x, low, high, **options)
            above.plot(x, median, **line)
        below.plot(x, scattered.contact_loss_probability.sel(direction=name), **line)
        handles.append(style.legend_entry(_DIRECTIONS[name], curve_style.colour, curve_style.line))
    label = "5 to 95 %"
    above.legend(handles=[*handles, Patch(color="black", alpha=_BAND_OPACITY, lw=0, label=label)])
    if "two_motions_probability" in scattered:
        probability = scattered.two_motions_probability
        below.fill_between(x, probability, color=_GREY, linewidth=0, zorder=0, label="two motions")
        below.legend()
    above.set(ylim=(0.0, None), xlim=style.limits(x, margin=0.0))
    above.set_ylabel(panels.axis_label(panels.in_unit(band, size, unit), width=40))
    below.set_ylim(0.0, 1.02)
    below.set_ylabel(panels.axis_label(scattered.contact_loss_probability, width=30))
    below.set_xlabel("speed (rpm)" if dim == "speed" else style.OWN_TUNING_LABEL)
    return figure


@style.styled()
def draw_quantities(scattered: xr.Dataset, *, indices: xr.Dataset | None = None):
    """Return a figure of histograms of a result of `gearlib.scatter`, beside Sobol' indices.

    `indices` is a result of `gearlib.sobol_indices`, by default None without these panels.
    """
    names = [name for name in QUANTITIES if name in scattered]
    figure = style.page_figure(_ROW_HEIGHT * len(names))
    grid = figure.subplots(len(names), 1 if indices is None else 2, squeeze=False)
    for row, name in zip(grid, names, strict=True):
        _draw_histogram(row[0], scattered, name)
        if indices is not None:
            _draw_indices(row[1], indices.sel(quantity=name))
    if indices is not None:
        grid[-1, 1].set_xlabel("share of the variance")
    return figure


def _draw_histogram(axes, scattered: xr.Dataset, name: str):
    """Draw a histogram of the quantity `name` of all designs, and its nominal value."""
    values = scattered[name].values[scattered[f"{name}_status"].values == STATUSES.index("ok")]
    unit, _ = QUANTITIES[name]
    size, unit = style.readable_unit({"min-1": "rpm", "1": ""}.get(unit, unit), values)
    axes.set_xlabel(name.replace("_", " ") + (f" ({unit})" if unit else ""))
    axes.set_ylabel("designs")
    if not values.size:
        return
    low, high = style.limits(values / size, margin=0.02)
    axes.hist(values / size, np.linspace(low, high, _BINS + 1), color=_GREY)
    nominal = float(scattered[f"{name}_nominal"]) / size
    if math.isfinite(nominal):
        axes.axvline(nominal, color="black", linestyle=style.DASHED, lw=0.6, label="nominal")
        axes.legend()
    axes.set_xlim(low, high)


def _draw_indices(axes, indices: xr.Dataset):
    """Draw the total and first-order Sobol' indices of all parameters, with their intervals."""
    positions = np.arange(indices.sizes["parameter"])
    for name, options in (
        ("total_index", {"facecolor": "none", "edgecolor": "black", "linewidth": 0.6}),
        ("first_index", {"color": style.PALETTE[0], "alpha": 0.6}),
    ):
        index, (low, high) = indices[name].values, indices[f"{name}_interval"].values.T
        errors = np.clip([index - low, high - index], 0.0, None)
        options |= {"xerr": errors, "error_kw": {"lw": 0.6, "ecolor": "black"}}
        axes.barh(positions, index, height=0.7, **options)
    axes.set_yticks(positions, [str(name).replace("_", " ") for name in indices.parameter.values])
    axes.invert_yaxis()
    axes.set_xlim(-0.05, 1.1)

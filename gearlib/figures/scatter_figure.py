"""Scatter due to tolerances: bands over speed, histograms of quantities, and Sobol' indices."""

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


@style.rc_context()
def draw(scattered: xr.Dataset, *, indices: xr.Dataset | None = None) -> dict[str, Figure]:
    """Return two figures of the scatter of results due to tolerances, as a dict by name.

    `scattered` is a result of `gearlib.scatter`, computed for many random designs. `indices` is a
    result of `gearlib.sobol_indices` (contributions of the parameters to the variance), or None.
    """
    return {
        "tolerance_bands": draw_bands(scattered),
        "tolerance_quantities": draw_quantities(scattered, indices=indices),
    }


@style.rc_context()
def draw_bands(scattered: xr.Dataset):
    """Return a figure of the scatter over the speed: quantile bands above probabilities.

    `scattered` is a result of `gearlib.scatter`, over "tuning" (mesh frequency over natural
    frequency) or "speed". Its variable height_band contains the 5 %, 50 % and 95 % quantiles of the
    peak-to-peak displacement. The lower panel shows the probability of contact loss and, shaded,
    that of two different motions at the same speed. The direction "seeded" denotes random initial
    states.
    """
    figure = style.page_figure(_HEIGHT)
    band_axes, probability_axes = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    dim = "tuning" if "tuning" in scattered.dims else "speed"
    x, band = scattered[dim], scattered.height_band
    unit_size, unit = style.readable_unit(band.units, band)
    curve_styles = style.curve_styles(map(str, scattered.direction.values))
    handles = []
    for direction, curve_style in curve_styles.items():
        line = {"color": curve_style.colour, "linestyle": curve_style.line_style}
        # Random initial states may lead to several motions, for which one band is meaningless.
        if direction != "seeded" or len(curve_styles) == 1:
            low, median, high = band.sel(direction=direction).values / unit_size
            options = {"color": curve_style.colour, "alpha": _BAND_OPACITY, "linewidth": 0}
            band_axes.fill_between(x, low, high, **options)
            band_axes.plot(x, median, **line)
        probability = scattered.contact_loss_probability.sel(direction=direction)
        probability_axes.plot(x, probability, **line)
        label = _DIRECTIONS[direction]
        handles.append(style.legend_handle(label, curve_style.colour, curve_style.line_style))
    handles.append(Patch(color="black", alpha=_BAND_OPACITY, lw=0, label="5 to 95 %"))
    band_axes.legend(handles=handles)
    if "two_motions_probability" in scattered:
        probability = scattered.two_motions_probability
        probability_axes.fill_between(
            x, probability, color=_GREY, linewidth=0, zorder=0, label="two motions"
        )
        probability_axes.legend()
    band_axes.set(ylim=(0.0, None), xlim=style.axis_limits(x, margin=0.0))
    band_axes.set_ylabel(panels.axis_label(panels.convert_unit(band, unit_size, unit), width=40))
    probability_axes.set_ylim(0.0, 1.02)
    probability_axes.set_ylabel(panels.axis_label(scattered.contact_loss_probability, width=30))
    probability_axes.set_xlabel("speed (rpm)" if dim == "speed" else style.OWN_TUNING_LABEL)
    return figure


@style.rc_context()
def draw_quantities(scattered: xr.Dataset, *, indices: xr.Dataset | None = None):
    """Return a figure of histograms of scattered quantities, with their Sobol' indices if given.

    `scattered` is a result of `gearlib.scatter`, computed for many random designs. `indices` is a
    result of `gearlib.sobol_indices` (contributions of the parameters to the variance), or None.
    """
    names = [name for name in QUANTITIES if name in scattered]
    figure = style.page_figure(_ROW_HEIGHT * len(names))
    grid = figure.subplots(len(names), 1 if indices is None else 2, squeeze=False)
    for row_axes, name in zip(grid, names, strict=True):
        _draw_histogram(row_axes[0], scattered, name)
        if indices is not None:
            _draw_indices(row_axes[1], indices.sel(quantity=name))
    if indices is not None:
        grid[-1, 1].set_xlabel("share of the variance")
    return figure


def _draw_histogram(axes, scattered: xr.Dataset, name: str):
    """Draw a histogram of the quantity `name` of all random designs, with its nominal value.

    Designs are omitted if the status of the quantity is not "ok", e.g. because it does not exist.
    """
    values = scattered[name].values[scattered[f"{name}_status"].values == STATUSES.index("ok")]
    unit, _ = QUANTITIES[name]
    unit_size, unit = style.readable_unit({"min-1": "rpm", "1": ""}.get(unit, unit), values)
    axes.set_xlabel(name.replace("_", " ") + (f" ({unit})" if unit else ""))
    axes.set_ylabel("designs")
    if not values.size:
        return
    low, high = style.axis_limits(values / unit_size, margin=0.02)
    axes.hist(values / unit_size, np.linspace(low, high, _BINS + 1), color=_GREY)
    nominal = float(scattered[f"{name}_nominal"]) / unit_size
    if math.isfinite(nominal):
        axes.axvline(nominal, color="black", linestyle=style.DASHED, lw=0.6, label="nominal")
        axes.legend()
    axes.set_xlim(low, high)


def _draw_indices(axes, indices: xr.Dataset):
    """Draw the total and first-order Sobol' indices of all parameters as bars, with error bars.

    A Sobol' index is the contribution of a parameter to the variance of the quantity: alone (first
    order) or including interactions (total).
    """
    positions = np.arange(indices.sizes["parameter"])
    bar_options = {
        "total_index": {"facecolor": "none", "edgecolor": "black", "linewidth": 0.6},
        "first_index": {"color": style.PALETTE[0], "alpha": 0.6},
    }
    for name, options in bar_options.items():
        values = indices[name].values
        low, high = indices[f"{name}_interval"].values.T
        # Due to rounding, lengths of error bars could become negative, which is not allowed.
        errors = np.clip([values - low, high - values], 0.0, None)
        options |= {"xerr": errors, "error_kw": {"lw": 0.6, "ecolor": "black"}}
        axes.barh(positions, values, height=0.7, **options)
    axes.set_yticks(positions, [str(name).replace("_", " ") for name in indices.parameter.values])
    axes.invert_yaxis()
    axes.set_xlim(-0.05, 1.1)

"""Scatter by tolerances: bands over speed, jumps and peaks, and their causes."""

import math

import numpy as np
from matplotlib.patches import Patch

from gearlib.data.variables import QUANTITIES
from gearlib.figures import style

_HEIGHT, _ROW = 5.0, 1.7
_BINS = 24
_WAYS = {"up": "speed rises", "down": "speed falls", "cold": "from rest", "seeded": "seeded starts"}
#: Opacity of a band.
_PALE = 0.25


@style.styled()
def draw(scattered, *, indices=None):
    """Draw `gearlib.scatter` of bands and quantities, and their Sobol' indices: two figures."""
    return {
        "tolerance_bands": bands(scattered),
        "tolerance_quantities": quantities(scattered, indices=indices),
    }


@style.styled()
def bands(scattered, *, axes=None):
    """Draw bands over speed above probabilities; return the figure."""
    figure = style.page(_HEIGHT)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    over = "tuning" if "tuning" in scattered.dims else "speed"
    x, band = scattered[over].values, scattered.height_band
    scale, unit = 1.0, "length units of the model"
    if over == "speed":
        scale, unit = style.length_unit(float(np.nanmax(band)))
    looks = style.looks(map(str, scattered.direction.values))
    for name, look in looks.items():
        # Seeded starts end on several motions, which share no band.
        if name != "seeded" or len(looks) == 1:
            low, middle, high = band.sel(direction=name).values / scale
            above.fill_between(x, low, high, color=look.colour, alpha=_PALE, linewidth=0)
            above.plot(x, middle, color=look.colour, linestyle=look.line)
        lost = scattered.contact_loss_probability.sel(direction=name)
        below.plot(x, lost, color=look.colour, linestyle=look.line)
    handles = [style.entry(_WAYS[name], look.colour, look.line) for name, look in looks.items()]
    words = "all but a twentieth at either end"
    handles.append(Patch(color="black", alpha=_PALE, lw=0, label=words))
    above.legend(handles=handles)
    if "two_motions_probability" in scattered:
        two = scattered.two_motions_probability.values
        below.fill_between(x, two, color="#CFCFCF", linewidth=0, zorder=0, label="two motions")
        below.legend()
    above.set_ylim(bottom=0.0)
    below.set_ylim(0.0, 1.02)
    above.set_xlim(x[0], x[-1] if x.size > 1 else x[0] + 1.0)
    above.set_ylabel(f"peak-to-peak displacement ({unit})")
    below.set_ylabel("share of the designs\nthat lose contact")
    below.set_xlabel("speed (rpm)" if over == "speed" else style.OWN_TUNING)
    return figure


@style.styled()
def quantities(scattered, *, indices=None):
    """Draw a histogram of each quantity, and its Sobol' indices beside; return the figure."""
    names = [name for name in QUANTITIES if name in scattered]
    figure = style.page(_ROW * len(names))
    grid = figure.subplots(len(names), 1 if indices is None else 2, squeeze=False)
    for row, name in zip(grid, names, strict=True):
        _histogram(row[0], scattered, name)
        if indices is not None:
            last = name == names[-1]
            _bars(row[1], indices.sel(quantity=name), last)
    return figure


def _histogram(axes, scattered, name):
    one = scattered[name]
    values = one.values[scattered[f"{name}_status"].values == 0]
    units = QUANTITIES[name][0]
    scale, unit = 1.0, {"min-1": "rpm", "1": ""}.get(units, units)
    if unit == "m" and values.size:
        scale, unit = style.length_unit(float(np.abs(values).max()))
    words = name.replace("_", " ") + (f" ({unit})" if unit else "")
    axes.set_xlabel(words)
    axes.set_ylabel("designs")
    if not values.size:
        return
    low, high = style.limits(values / scale, margin=0.02)
    axes.hist(values / scale, np.linspace(low, high, _BINS + 1), color="#CFCFCF")
    middle = float(scattered[f"{name}_nominal"])
    if math.isfinite(middle):
        axes.axvline(middle / scale, color="black", linestyle=style.DASHED, lw=0.6, label="nominal")
        axes.legend()
    axes.set_xlim(low, high)


def _bars(axes, one, last):
    """Draw the indices of a quantity, with their intervals."""
    names = [str(name) for name in one.parameter.values]
    places = np.arange(len(names))
    for which, look in (
        ("total_index", {"facecolor": "none", "edgecolor": "black", "linewidth": 0.6}),
        ("first_index", {"color": style.PALETTE[0], "alpha": 0.6}),
    ):
        values = one[which].values
        low, high = one[f"{which}_interval"].values.T
        wide = np.abs(np.clip([values - low, high - values], 0.0, None))
        error = {"lw": 0.6, "ecolor": "black"}
        axes.barh(places, values, xerr=wide, error_kw=error, height=0.7, **look)
    axes.set_yticks(places, [name.replace("_", " ") for name in names])
    axes.invert_yaxis()
    axes.set_xlim(-0.05, 1.1)
    if last:
        axes.set_xlabel("share of the variance")

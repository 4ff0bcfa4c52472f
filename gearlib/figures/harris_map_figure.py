"""Harris maps: static transmission error over the mesh phase at several loads."""

import math

import numpy as np
import xarray as xr
from matplotlib import colormaps

from gearlib.figures import panels, style

ERROR = "static transmission error (µm)"


@style.styled()
def draw(data: xr.Dataset):
    """Return a figure of the transmission error at all loads for each tip relief.

    Below are its peak-to-peak value and the contact ratio. `data` is that of
    `gearlib.studies.drawn_gears.harris_map`; the line of the design load is thick.
    """
    figure = style.page(5.2)
    above, below = figure.subfigures(2, 1, height_ratios=(1.2, 1.0))
    maps = above.subplots(1, data.sizes["relief"], sharey=True, squeeze=False)[0]
    load = (data.torque / data.design_torque).drop_attrs()
    load.attrs["long_name"] = "torque over design torque"
    for axes, name in zip(maps, data.relief.values, strict=True):
        relief = data.sel(relief=name)
        draw_courses(axes, relief, load.values)
        amounts = " and ".join(f"{1e6 * amount:.1f}" for amount in relief.relief_amount.values)
        title = panels.value_label(relief.relief)
        axes.set_title(f"{title}, {amounts} µm" if relief.relief_amount.any() else title)
    maps[0].set_ylabel(ERROR)
    peak_to_peak = panels.in_unit(data.peak_to_peak_error, 1e-6, "µm")
    ranges = data.assign(peak_to_peak_error=peak_to_peak).assign_coords(torque=load)
    # Without a load no teeth are in contact.
    ranges["effective_contact_ratio"] = ranges.effective_contact_ratio.where(ranges.torque > 0.0)
    names = "peak_to_peak_error", "effective_contact_ratio"
    for axes, name in zip(below.subplots(1, 2), names, strict=True):
        options = {"colour": "relief", "marker": "o", "markersize": 3.0}
        entries = panels.draw_curves(axes, ranges, "torque", name, **options)
        axes.axvline(1.0, color="black", linewidth=0.5, linestyle=(0, (1, 2)))
    style.legend(figure, entries, 3)
    return figure


def draw_courses(axes, data: xr.Dataset, loads: np.ndarray, design=1.0):
    """Draw the transmission error over two mesh periods for each of `loads`, those of `data`.

    Loads are shares of the design torque; the line of the load `design` is thick.
    """
    periods = data.phase.values / (2.0 * math.pi)
    # The lightest colours are hard to see on white; all loads may be zero.
    shades = colormaps["viridis"](0.92 * loads / max(loads.max(), 1e-9))
    for load, colour, error in zip(loads, shades, data.transmission_error.values, strict=True):
        width = 2.0 if math.isclose(load, design) else 0.9
        # A period begins in double contact; two periods show both of its ends.
        x = np.concatenate([periods, periods + periods[-1] + periods[1]])
        axes.plot(x, 1e6 * np.tile(error, 2), color=colour, linewidth=width)
        options = {"of": ("axes fraction", "data"), "fontsize": 5.5}
        style.note(axes, f"{load:g}", (1.0, 1e6 * error[0]), (2, 0), **options)
    axes.set(xlabel="mesh periods", xlim=(0.0, 2.0))

"""Harris maps: static transmission error over the mesh phase at several loads."""

import math

import numpy as np
import xarray as xr
from matplotlib import colormaps

from gearlib.figures import panels, style

ERROR_LABEL = "static transmission error (µm)"


@style.styled()
def draw(data: xr.Dataset):
    """Return a figure of the transmission error at all loads for each tip relief.

    Below are its peak-to-peak value and the contact ratio. `data` is a result of
    `gearlib.studies.gear_geometry.harris_map`; the line of the design load is thick.
    """
    figure = style.page_figure(height=5.2)
    above, below = figure.subfigures(2, 1, height_ratios=(1.2, 1.0))
    maps = above.subplots(1, data.sizes["relief"], sharey=True, squeeze=False)[0]
    load = (data.torque / data.design_torque).drop_attrs()
    load.attrs["long_name"] = "torque over design torque"
    for axes, name in zip(maps, data.relief.values, strict=True):
        relief = data.sel(relief=name)
        draw_errors(axes, relief, load.values)
        amounts = " and ".join(f"{1e6 * amount:.3g}" for amount in relief.relief_amount.values)
        title = panels.value_label(relief.relief)
        axes.set_title(f"{title}\n{amounts} µm" if relief.relief_amount.any() else title)
    maps[0].set_ylabel(ERROR_LABEL)
    peak_to_peak = panels.in_unit(data.peak_to_peak_error, 1e-6, "µm")
    ranges = data.assign(peak_to_peak_error=peak_to_peak).assign_coords(torque=load)
    # No teeth are in contact without a load.
    ranges["effective_contact_ratio"] = ranges.effective_contact_ratio.where(ranges.torque > 0.0)
    names = "peak_to_peak_error", "effective_contact_ratio"
    for axes, name in zip(below.subplots(1, 2), names, strict=True):
        options = {"colour": "relief", "marker": "o", "markersize": 3.0}
        entries = panels.draw_curves(axes, ranges, "torque", name, **options)
        axes.axvline(1.0, color="black", linewidth=0.5, linestyle=(0, (1, 2)))
    style.legend(figure, entries, columns=3)
    return figure


def draw_errors(axes, data: xr.Dataset, loads: np.ndarray, design_load=1.0):
    """Draw the transmission error of a dataset over two mesh periods, a line for each of its loads.

    `loads` label the lines; that of `design_load` is thick.
    """
    periods = data.phase.values / (2.0 * math.pi)
    # The lightest colours are hard to see on white. The lower bound avoids a division by zero.
    colours = colormaps["viridis"](0.92 * loads / max(loads.max(), 1e-9))
    lines = zip(
        loads, style.number_texts(loads), colours, data.transmission_error.values, strict=True
    )
    for load, text, colour, error in lines:
        width = 2.0 if math.isclose(load, design_load) else 0.9
        # The period begins within double contact, which only two periods show as a whole.
        x = np.concatenate([periods, periods + periods[-1] + periods[1]])
        axes.plot(x, 1e6 * np.tile(error, 2), color=colour, linewidth=width)
        options = {"coords": ("axes fraction", "data"), "fontsize": 5.5}
        style.annotate(axes, text, (1.0, 1e6 * error[0]), (2, 0), **options)
    axes.set(xlabel="mesh periods", xlim=(0.0, 2.0))

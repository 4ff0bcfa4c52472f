"""Harris maps: static transmission error over the mesh phase at several loads."""

import numpy as np
import xarray as xr
from matplotlib import colormaps

from gearlib.figures import panels, style


@style.styled()
def draw(data):
    """Draw the error at all loads for each relief, and below its range and the contact ratio.

    `data` is that of `gearlib.studies.tip_relief.harris_map`. Thick: the design load.
    """
    load = (data.torque / data.design_torque).assign_attrs(long_name="torque over design torque")
    data = data.assign_coords(torque=load.assign_attrs(units="1"))
    for name in ("transmission_error", "peak_to_peak_error", "relief_amount"):
        data[name] = panels.in_unit(data[name], 1e-6, "µm")
    figure = style.page(5.2)
    above, below = figure.subfigures(2, 1, height_ratios=(1.2, 1.0))
    _draw_maps(above, data)
    # Nothing touches without a load.
    data["effective_contact_ratio"] = data.effective_contact_ratio.where(data.torque > 0.0)
    for axes, name in zip(
        below.subplots(1, 2), ("peak_to_peak_error", "effective_contact_ratio"), strict=True
    ):
        entries = panels.draw_curves(
            axes, data, "torque", name, colour="relief", marker="o", markersize=3.0
        )
        axes.axvline(1.0, color="black", linewidth=0.5, linestyle=(0, (1, 2)))
    style.legend(figure, entries, 3)
    return figure


def _draw_maps(figure, data):
    """Draw the error over two mesh periods, so that both ends of double contact are seen."""
    periods = panels.in_mesh_periods(data)
    step = float(periods.phase[1])
    second = periods.assign_coords(phase=periods.phase + periods.phase[-1] + step)
    twice = xr.concat([periods[["transmission_error"]], second[["transmission_error"]]], "phase")
    shades = colormaps["viridis"](0.92 * data.torque / max(float(data.torque.max()), 1e-9))
    styles = {
        load: {"color": shade, "linewidth": 2.0 if np.isclose(load, 1.0) else 0.9}
        for load, shade in zip(data.torque.values, shades, strict=True)
    }
    options = {"panel": "relief", "colour": "torque", "styles": styles, "figure": figure}
    grid = panels.draw_panels(twice, "phase", "transmission_error", **options)
    for axes, relief in zip(grid[0], data.relief.values, strict=True):
        chosen = data.sel(relief=relief)
        if chosen.relief_amount.any():
            amounts = " and ".join(f"{amount:.1f}" for amount in chosen.relief_amount.values)
            axes.set_title(f"{axes.get_title()}, {amounts} µm")
        for load, error in zip(data.torque.values, chosen.transmission_error.values, strict=True):
            place = {"of": ("axes fraction", "data"), "fontsize": 5.5}
            style.note(axes, f"{load:g}", (1.0, error[0]), (2, 0), **place)
        axes.set_xlim(0.0, 2.0)

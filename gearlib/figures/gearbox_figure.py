"""Figures of gearboxes: the box from the side, stages over the speed, modes and their energies."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from gearlib.figures import orders_figure, style, trains_figure

_SHAFT_COLOUR = "#D9D9D9"
#: Most modes of the figure of strain energies.
_MODES = 16


def draw_outline(axes: Axes, outline: xr.Dataset) -> None:
    """Draw shafts and gears to scale, seen from the side, by the result of `Gearbox.outline`."""
    labels = dict.fromkeys(str(x) for x in outline.part_stage.values if str(x))
    colours = {label: style.PALETTE[i % len(style.PALETTE)] for i, label in enumerate(labels)}
    for i, stage in enumerate(map(str, outline.part_stage.values)):
        corners = 1e3 * outline.corner_position.values[i]
        options = {"facecolor": _SHAFT_COLOUR, "edgecolor": "0.4", "linewidth": 0.4, "zorder": 1}
        if stage:
            options |= {"facecolor": colours[stage], "alpha": 0.6, "zorder": 2, "label": stage}
        axes.add_patch(Polygon(corners, **options))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set(xlabel="along the shafts (mm)", ylabel="across them (mm)")
    found, names = axes.get_legend_handles_labels()
    handles = dict(zip(names, found, strict=True))
    axes.legend(handles.values(), handles, fontsize=6, loc="upper left", bbox_to_anchor=(1.0, 1.0))


@style.styled()
def draw_view(outline: xr.Dataset):
    """Return the figure of a gearbox from the side."""
    figure = style.page_figure(height=4.0)
    draw_outline(figure.add_subplot(), outline)
    return figure


@style.styled()
def draw_stages(stages: list[xr.Dataset]):
    """Return the figure of dynamic factor and transmission error of the stages over the speed.

    Each dataset is a result of `gearlib.studies.gearboxes.stage_over_speed`.
    """
    figure = style.page_figure(height=1.9 * len(stages) + 0.5)
    grid = figure.subplots(len(stages), 2, squeeze=False)
    for (left, right), data in zip(grid, stages, strict=True):
        for direction, line in zip(data.direction.values, style.LINES, strict=False):
            curve = data.sel(direction=direction)
            options = {"linestyle": line, "label": f"speed goes {direction}"}
            left.plot(curve.speed, curve.dynamic_factor, **options)
            right.plot(curve.speed, 1e6 * curve.error_peak_to_peak, **options)
        for axes in (left, right):
            if np.isfinite(speed := float(data.operating_speed)):
                axes.axvline(speed, color="0.5", linewidth=0.8, label="operating speed")
            axes.set_xlabel("speed of the pinion (rpm)")
        left.set_ylabel("dynamic factor $K_v$")
        right.set_ylabel("peak-to-peak error (µm)")
        left.set_title(f"{data.attrs['stage']}, {data.attrs['load_case']}", fontsize=7)
    style.legend(figure, grid[0, 0], columns=3)
    return figure


@style.styled()
def draw_modes(box: xr.Dataset):
    """Return the Campbell diagram of a gearbox beside the strain energies of its modes.

    `box` is a result of `gearlib.studies.gearboxes.whole_box`.
    """
    figure = style.page_figure(height=5.6)
    upper, lower = figure.subplots(2, 1)
    highest = float(box.get("operating_speed", np.nan))
    speeds = box.critical_speed.values
    stop = 1.5 * highest if np.isfinite(highest) else 1.02 * float(speeds.max())
    handles = trains_figure.draw_orders(upper, box, stop)
    if np.isfinite(highest):
        upper.axvline(highest, color="C3", linewidth=0.8)
        handles.append(style.legend_entry("operating speed", "C3", linewidth=0.8))
    upper.legend(handles=handles, fontsize=6, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    modes = box.natural_mode[:_MODES]
    bottom = np.zeros(modes.size)
    for name, dim in (("mode_strain_energy", "mesh"), ("mode_shaft_energy", "shaft")):
        for i, label in enumerate(box[dim].values):
            share = box[name].isel(natural_mode=slice(0, _MODES)).sel({dim: label}).values
            colour = style.PALETTE[i % len(style.PALETTE)]
            hatch = "" if dim == "mesh" else "///"
            lower.bar(
                modes, share, bottom=bottom, color=colour, hatch=hatch, label=f"{dim} {label}"
            )
            bottom += share
    labels = [f"{value:.4g}" for value in box.mode_frequency.values[:_MODES]]
    lower.set_xticks(modes, labels, rotation=60, fontsize=6)
    lower.set(xlabel="natural frequency (Hz)", ylabel="share of strain energy")
    lower.legend(fontsize=5.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def draw_run_up(found: xr.Dataset, frequencies: xr.Dataset):
    """Return the order map of a result of `gearlib.studies.gearboxes.run_up`."""
    return orders_figure.order_map(found.rename(block="time"), frequencies=frequencies)

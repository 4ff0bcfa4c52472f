"""Figures of gearboxes: side view, stages over the speed, natural modes and strain energies."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from gearlib.figures import orders_figure, style, trains_figure

_SHAFT_COLOUR = "#D9D9D9"
#: Largest number of modes in the figure of strain energies.
_MAX_MODES = 16


def draw_outline(axes: Axes, outline: xr.Dataset) -> None:
    """Draw the shafts and gears of a gearbox to scale in a side view.

    `outline` is a result of `Gearbox.outline`. Its variable corner_position contains the corners of
    each part, m, and part_stage the gear stage to which a gear belongs, or "" for a shaft. Each
    stage has its own colour.
    """
    stages = [str(stage) for stage in outline.part_stage.values]
    stage_names = dict.fromkeys(stage for stage in stages if stage)
    colours = {name: style.PALETTE[i % len(style.PALETTE)] for i, name in enumerate(stage_names)}
    for i, stage in enumerate(stages):
        corners = 1e3 * outline.corner_position.values[i]
        options = {"facecolor": _SHAFT_COLOUR, "edgecolor": "0.4", "linewidth": 0.4, "zorder": 1}
        if stage:
            options |= {"facecolor": colours[stage], "alpha": 0.6, "zorder": 2, "label": stage}
        axes.add_patch(Polygon(corners, **options))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set(xlabel="along the shafts (mm)", ylabel="across them (mm)")
    # Gears of a stage have the same label, which must appear only once in the legend.
    handles, labels = axes.get_legend_handles_labels()
    handle_by_label = dict(zip(labels, handles, strict=True))
    options = {"fontsize": 6, "loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
    axes.legend(handle_by_label.values(), handle_by_label, **options)


@style.rc_context()
def draw_view(outline: xr.Dataset):
    """Return a figure with the side view of a gearbox, for a result of `Gearbox.outline`."""
    figure = style.page_figure(height=4.0)
    draw_outline(figure.add_subplot(), outline)
    return figure


@style.rc_context()
def draw_stages(stages: list[xr.Dataset]):
    """Return a figure of dynamic factor and transmission error over the speed, one row per stage.

    `stages` are results of `gearlib.studies.gearboxes.sweep_stage`, one for each pair of gears.
    There is one curve for each direction in which the speed changes.
    """
    figure = style.page_figure(height=1.9 * len(stages) + 0.5)
    grid = figure.subplots(len(stages), 2, squeeze=False)
    for (factor_axes, error_axes), data in zip(grid, stages, strict=True):
        for direction, dashes in zip(data.direction.values, style.LINE_STYLES, strict=False):
            curve = data.sel(direction=direction)
            options = {"linestyle": dashes, "label": f"speed goes {direction}"}
            factor_axes.plot(curve.speed, curve.dynamic_factor, **options)
            error_axes.plot(curve.speed, 1e6 * curve.error_peak_to_peak, **options)
        for axes in (factor_axes, error_axes):
            operating_speed = float(data.operating_speed)  # NaN if it is not known
            if np.isfinite(operating_speed):
                axes.axvline(operating_speed, color="0.5", linewidth=0.8, label="operating speed")
            axes.set_xlabel("speed of the pinion (rpm)")
        factor_axes.set_ylabel("dynamic factor $K_v$")
        error_axes.set_ylabel("peak-to-peak error (µm)")
        factor_axes.set_title(f"{data.attrs['stage']}, {data.attrs['load_case']}", fontsize=7)
    style.add_legend(figure, grid[0, 0], columns=3)
    return figure


@style.rc_context()
def draw_modes(box: xr.Dataset):
    """Return a Campbell diagram of a gearbox, above the strain energies of its natural modes.

    A Campbell diagram shows natural and mesh frequencies over the speed. In the lower panel, each
    mode has a bar, stacked from the fractions of its strain energy in all meshes and, hatched, in
    all shafts. `box` is a result of `gearlib.studies.gearboxes.analyse_gearbox`.
    """
    figure = style.page_figure(height=5.6)
    campbell_axes, energy_axes = figure.subplots(2, 1)
    operating_speed = float(box.get("operating_speed", np.nan))
    # The speed axis ends at 1.5 times the operating speed or, if unknown, after the last critical
    # speed.
    max_speed = 1.02 * float(box.critical_speed.values.max())
    if np.isfinite(operating_speed):
        max_speed = 1.5 * operating_speed
    handles = trains_figure.draw_orders(campbell_axes, box, max_speed)
    if np.isfinite(operating_speed):
        campbell_axes.axvline(operating_speed, color="C3", linewidth=0.8)
        handles.append(style.legend_handle("operating speed", "C3", linewidth=0.8))
    campbell_axes.legend(handles=handles, fontsize=6, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    modes = box.natural_mode[:_MAX_MODES]
    bar_bottoms = np.zeros(modes.size)
    for variable, dim in (("mode_strain_energy", "mesh"), ("mode_shaft_energy", "shaft")):
        for i, label in enumerate(box[dim].values):
            shares = box[variable].isel(natural_mode=slice(0, _MAX_MODES)).sel({dim: label}).values
            colour = style.PALETTE[i % len(style.PALETTE)]
            hatch = "" if dim == "mesh" else "///"
            energy_axes.bar(
                modes, shares, bottom=bar_bottoms, color=colour, hatch=hatch, label=f"{dim} {label}"
            )
            bar_bottoms += shares
    labels = [f"{value:.4g}" for value in box.mode_frequency.values[:_MAX_MODES]]
    energy_axes.set_xticks(modes, labels, rotation=60, fontsize=6)
    energy_axes.set(xlabel="natural frequency (Hz)", ylabel="share of strain energy")
    energy_axes.legend(fontsize=5.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def draw_run_up(spectrogram: xr.Dataset, frequencies: xr.Dataset):
    """Return an order map of a run-up: amplitudes over speed and order of the shaft.

    `spectrogram` is a result of `gearlib.studies.gearboxes.compute_run_up_orders`. Lines mark
    `frequencies`, a dataset with variables of `gearlib.characteristic_frequencies`. The dimension
    "block" is renamed, because `order_map` requires the name "time".
    """
    return orders_figure.order_map(spectrogram.rename(block="time"), frequencies=frequencies)

"""Figures of gearboxes: the box from the side, stages over the speed, modes and their energies."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from gearlib.figures import campbell_figure, style

_SHAFT_COLOUR, _BEARING_COLOUR = "#D9D9D9", "#707070"
#: Most modes of the figure of strain energies.
_MODES = 16


def draw_box(axes: Axes, box: Any) -> None:
    """Draw shafts, gears and bearings of a `Gearbox` to scale, seen from the side, in mm.

    The view is across the direction in which the axes lie furthest apart.
    """
    lines = {key: shaft for key, shaft in box.shafts.items() if shaft.start is not None}
    places = np.array([shaft.start[1:] for shaft in lines.values()]).reshape(-1, 2)
    spread = places - places.mean(axis=0) if lines else places
    across = np.linalg.svd(spread)[2][0] if lines else np.array([0.0, 1.0])
    across = across if across[1] >= 0.0 else -across

    def polygon(shaft: Any, ends: tuple, inner: tuple, outer: tuple, **options: Any) -> None:
        """Draw a conical part of a shaft, hollow where the inner diameters are not 0."""
        u = 1e3 * (shaft.start[0] + shaft.direction * np.array(ends))
        height = 1e3 * float(shaft.start[1:] @ across)
        inner, outer = (500.0 * np.array(diameters) for diameters in (inner, outer))
        for side in (1.0, -1.0):
            y = np.concatenate([height + side * outer, height + side * inner[::-1]])
            axes.add_patch(Polygon(np.stack([[*u, *u[::-1]], y], axis=1), **options))

    for shaft in lines.values():
        for section in shaft.sections:
            ends = section.start, section.end
            options = {"facecolor": _SHAFT_COLOUR, "edgecolor": "0.4", "linewidth": 0.4}
            polygon(shaft, ends, section.inner, section.outer, **options)
    drawn: set = set()
    for i, (name, stage) in enumerate(box.stages.items()):
        geometry = None if name in box.refused else box.stage(name)
        for gear, side in ((stage.pinion, "pinion"), (stage.wheel, "wheel")):
            shaft = lines.get(box.shaft_of[gear.id].id)
            if geometry is None or shaft is None or gear.id in drawn:
                continue
            drawn.add(gear.id)
            made = getattr(geometry, side)
            diameters = made.bore, made.tip_diameter
            diameters = (made.tip_diameter, made.outer_diameter) if made.internal else diameters
            inner, outer = ((d, d) for d in diameters)
            colour = style.PALETTE[i % len(style.PALETTE)]
            options = {"facecolor": colour, "alpha": 0.6, "edgecolor": "black", "linewidth": 0.6}
            polygon(shaft, box.face(gear), inner, outer, label=name, **options)
    for bearing in box.bearings:
        shaft = lines.get(bearing.inner[0].id)
        if shaft is not None and bearing.inner[1] is not None:
            u = 1e3 * (shaft.start[0] + shaft.direction * bearing.inner[1])
            height = 1e3 * float(shaft.start[1:] @ across)
            style.draw_markers(axes, [u], [height], "x", _BEARING_COLOUR, 5.0, label="bearing")
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set(xlabel="along the shafts (mm)", ylabel="across them (mm)")
    handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    if handles:
        axes.legend(handles.values(), handles, fontsize=6, loc="upper left", bbox_to_anchor=(1, 1))


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
    handles = campbell_figure.draw_orders(upper, box, stop)
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
            lower.bar(modes, share, bottom=bottom, color=colour, hatch=hatch, label=f"{dim} {label}")
            bottom += share
    labels = [f"{value:.4g}" for value in box.mode_frequency.values[:_MODES]]
    lower.set_xticks(modes, labels, rotation=60, fontsize=6)
    lower.set(xlabel="natural frequency (Hz)", ylabel="share of strain energy")
    lower.legend(fontsize=5.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure

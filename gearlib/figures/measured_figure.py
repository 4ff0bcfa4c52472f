"""Measured curves, time courses and mesh orders beside those of the model."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gearlib.figures import panels, style

#: Colours of measured sets beside characteristics, markers by the sign of the change of speed.
_SET_COLOURS = ("#D55E00", "#CC79A7", "#56B4E9", "#882255")
_DIRECTION_MARKERS = {1: "^", -1: "v", 0: "o"}
_JUMPS = ("jump_up", "jump_down", "onset_of_contact_loss")
_POINT_COLOUR = "#8C8C8C"
_MEASURED = style.entry("measured", _POINT_COLOUR, "none", ".")


def draw_curves(axes: Axes, curves: Sequence[xr.Dataset], names: tuple) -> list[Line2D]:
    """Draw measured points of some observables over the tuning; return the legend's entries.

    curves: datasets of `gearlib.studies.measured`. Jumps are dotted lines. What lies
    beyond the limits of the axes is left out.
    """
    handles, limits = [], {"xlim": axes.get_xlim(), "ylim": axes.get_ylim()}
    for curve, colour in zip(curves, _SET_COLOURS * len(curves), strict=False):
        face = colour
        for name in [name for name in names if name in curve]:
            attrs = curve[name].attrs
            face = "none" if attrs["unknown_gain"] or attrs["unknown_offset"] else colour
            values = (curve[name] - attrs["fitted_offset"]) / attrs["fitted_gain"]
            options = {"markerfacecolor": face, "markeredgewidth": 0.5, "zorder": 3}
            for sign, marker in _DIRECTION_MARKERS.items():
                chosen = curve.direction.values == sign
                points = curve.tuning.values[chosen], values.values[chosen]
                style.dots(axes, *points, marker, colour, 3.0, **options)
        jumps = [name for name in _JUMPS if name in curve]
        for name in jumps:
            tuning = curve.attrs["tuning_rate"] * float(curve[name])
            axes.axvline(tuning, color=colour, linestyle=":", linewidth=0.9, zorder=1.6)
        if jumps or set(names) & set(curve):
            words = f"measured: {curve.title}"
            handles.append(style.entry(words, colour, ":", "^", markerfacecolor=face))
    axes.set(**limits)
    return handles


@style.styled()
def draw_courses(courses: list[xr.Dataset], *, colours: dict[str, str] | None = None) -> Figure:
    """Draw datasets of `gearlib.studies.measured.courses`, a panel for each course.

    courses: one or several; colours: those of the dampings by name.
    """
    places = [
        data.isel(course=i, observable=j)
        for data in courses
        for i, j in np.ndindex(data.sizes["course"], data.sizes["observable"])
    ]
    rows = max(1, -(-len(places) // 2))
    figure = style.page(2.6 * rows + 0.5)
    styles = panels.curve_styles(courses[0].damping, colours)
    for k, place in enumerate(places):
        data = panels.in_mesh_periods(panels.in_mesh_periods(place), "point_phase")
        axes = figure.add_subplot(rows, 2, k + 1)
        style.dots(axes, data.point_phase, data.point, ".", _POINT_COLOUR, 2.0, zorder=1)
        panels.draw_curves(axes, data, "phase", "computed", colour="damping", styles=styles)
        name = data.observable.item()
        unit = dict(part.split(" in ") for part in data.course_units.split(", "))[name]
        axes.set_title(f"{data.title}, {float(data.speed):.5g} rpm")
        axes.set_ylabel(f"{name.replace('_', ' ')} ({unit})")
    style.legend(figure, [_MEASURED, *panels.legend_entries(styles)], 5)
    return figure


@style.styled()
def draw_orders(orders: list[xr.Dataset], *, colours: dict[str, str] | None = None) -> Figure:
    """Draw datasets of `gearlib.studies.measured.orders`.

    orders: one or several; colours: those of the dampings by name. A row for each observable, a
    column for each order; levels in dB of the largest measured one, so that an unknown gain moves
    nothing.
    """
    rows = [
        data.isel(track=i, observable=j)
        for data in orders
        for i, j in np.ndindex(data.sizes["track"], data.sizes["observable"])
    ]
    figure = style.page(2.4 * max(1, len(rows)) + 0.5)
    shared = {"squeeze": False, "sharex": "row", "sharey": "row"}
    grid = figure.subplots(max(1, len(rows)), orders[0].sizes["order"], **shared)
    styles = panels.curve_styles(orders[0].damping, colours)
    for line, data in zip(grid, rows, strict=False):
        data["level"] = _level(data.amplitude, data.amplitude.max())
        computed = data.computed_amplitude
        data["computed_level"] = _level(computed, computed.max(["order", "block"]))
        for k, axes in enumerate(line):
            order = data.isel(order=k)
            style.dots(axes, order.speed, order.level, ".", _POINT_COLOUR, 2.5, zorder=1)
            curves = {"colour": "damping", "styles": styles}
            panels.draw_curves(axes, order, "speed", "computed_level", **curves)
            axes.set_title(f"order {'' if k == 0 else k + 1}z")
            axes.set_ylabel(f"{data.title}\n{data.observable.item().replace('_', ' ')} (dB)")
            axes.label_outer()
    style.legend(figure, [_MEASURED, *panels.legend_entries(styles)], 5)
    return figure


def _level(amplitude: xr.DataArray, largest: xr.DataArray) -> xr.DataArray:
    """Return levels in dB of the largest amplitude."""
    return 20.0 * np.log10((amplitude / largest).where(amplitude > 0.0))

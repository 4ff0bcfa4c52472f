"""Measured curves, time histories and mesh orders, compared with a model or a fit."""

import math

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from gearlib.colours import distinct_colours
from gearlib.figures import panels, style

#: Markers for rising (1), falling (-1) and other (0) speed.
_DIRECTION_MARKERS = {1: "^", -1: "v", 0: "o"}
_SPEEDS_OF_JUMPS = ("jump_up", "jump_down", "onset_of_contact_loss")
_POINT_COLOUR = "#8C8C8C"
#: Heights of a row of panels and of the legend, inches.
_HISTORY_HEIGHT, _ORDER_HEIGHT, _LEGEND_HEIGHT = 2.6, 2.4, 0.5
_MEASURED_ENTRY = style.legend_handle("measured", _POINT_COLOUR, "none", ".")


def draw_curves(axes, curves: list[xr.Dataset], names: tuple, computed: dict) -> list:
    """Draw measured values of the variables `names` over the tuning; return legend handles.

    The tuning is the mesh frequency over the natural frequency. `curves` are results of
    `gearlib.studies.measured.read_response_curve`, one for each measured set. The marker shape
    shows whether the speed rises or falls; markers are open if the gain or offset of the sensor is
    unknown. Dotted lines show the speeds of jumps. `computed` maps the names of computed curves in
    these axes to `CurveStyle`s, so that other colours are used. The axis limits do not change.
    """
    handles = []
    axis_limits = {"xlim": axes.get_xlim(), "ylim": axes.get_ylim()}
    colours = distinct_colours(curve.colour for curve in computed.values())
    for curve, colour in zip(curves, colours, strict=False):
        face_colour = colour
        measured_names = [name for name in names if name in curve]
        for name in measured_names:
            attrs = curve[name].attrs
            is_uncalibrated = attrs["unknown_gain"] or attrs["unknown_offset"]
            face_colour = "none" if is_uncalibrated else colour
            # Correct the values for the fitted gain and offset of the sensor.
            values = (curve[name] - attrs["fitted_offset"]) / attrs["fitted_gain"]
            options = {"markerfacecolor": face_colour, "markeredgewidth": 0.5, "zorder": 3}
            for sign, marker in _DIRECTION_MARKERS.items():
                mask = curve.direction.values == sign
                points = curve.tuning.values[mask], values.values[mask]
                style.draw_markers(axes, *points, marker, colour, 3.0, **options)
        jumps = [name for name in _SPEEDS_OF_JUMPS if name in curve]
        for name in jumps:
            tuning_per_rpm = curve.attrs["tuning_rate"]
            jump_tuning = tuning_per_rpm * float(curve[name])
            axes.axvline(jump_tuning, color=colour, linestyle=":", linewidth=0.9, zorder=1.6)
        if jumps or measured_names:
            label = f"measured: {curve.title}"
            handles.append(
                style.legend_handle(label, colour, ":", "^", markerfacecolor=face_colour)
            )
    axes.set(**axis_limits)
    return handles


@style.rc_context()
def draw_courses(courses: list[xr.Dataset], *, colours: dict[str, str] | None = None):
    """Return a figure of measured and computed time histories, with one panel for each.

    `courses` are results of `gearlib.studies.measured.compare_time_histories`. Each contains time
    histories (dimension "course") of measured quantities ("observable"), with samples `point` at
    the mesh phases `point_phase`. `colours` maps the names of damping combinations, for which the
    histories were computed, to colours; others get colours of the palette.
    """
    histories = [
        data.isel(course=i, observable=j)
        for data in courses
        for i, j in np.ndindex(data.sizes["course"], data.sizes["observable"])
    ]
    rows = max(1, math.ceil(len(histories) / 2))
    figure = style.page_figure(_HISTORY_HEIGHT * rows + _LEGEND_HEIGHT)
    styles = panels.plot_options(courses[0].damping, colours)
    speeds = style.format_numbers([float(history.speed) for history in histories])
    for k, history in enumerate(histories):
        data = panels.phase_to_mesh_periods(panels.phase_to_mesh_periods(history), "point_phase")
        axes = figure.add_subplot(rows, 2, k + 1)
        style.draw_markers(axes, data.point_phase, data.point, ".", _POINT_COLOUR, 2.0, zorder=1)
        panels.draw_curves(axes, data, "phase", "computed", colour_dim="damping", styles=styles)
        name = data.observable.item()
        # The attribute is a text such as "displacement in m, dynamic_force in N".
        unit = dict(entry.split(" in ") for entry in data.course_units.split(", "))[name]
        axes.set_title(f"{data.title}, {speeds[k]} rpm")
        axes.set_ylabel(f"{name.replace('_', ' ')} ({unit})")
    style.add_legend(figure, [_MEASURED_ENTRY, *panels.legend_handles(styles)], columns=5)
    return figure


@style.rc_context()
def draw_orders(orders: list[xr.Dataset], *, colours: dict[str, str] | None = None):
    """Return a figure of measured and computed amplitudes of mesh orders, one column per order.

    `orders` are results of `gearlib.studies.measured.compare_run_ups`: amplitudes of run-ups
    ("track") and measured quantities ("observable") at the orders z, 2z, ... of a gear with z
    teeth. `colours` maps names of damping combinations to colours. Levels are in dB relative to the
    largest amplitude, so that they do not depend on the sensor gain.
    """
    row_data = [
        data.isel(track=i, observable=j)
        for data in orders
        for i, j in np.ndindex(data.sizes["track"], data.sizes["observable"])
    ]
    figure = style.page_figure(_ORDER_HEIGHT * max(1, len(row_data)) + _LEGEND_HEIGHT)
    grid_options = {"squeeze": False, "sharex": "row", "sharey": "row"}
    grid = figure.subplots(max(1, len(row_data)), orders[0].sizes["order"], **grid_options)
    styles = panels.plot_options(orders[0].damping, colours)
    for grid_row, data in zip(grid, row_data, strict=False):
        data["level"] = _to_decibels(data.amplitude, data.amplitude.max())
        computed = data.computed_amplitude
        data["computed_level"] = _to_decibels(computed, computed.max(["order", "block"]))
        for k, axes in enumerate(grid_row):
            order = data.isel(order=k)
            style.draw_markers(axes, order.speed, order.level, ".", _POINT_COLOUR, 2.5, zorder=1)
            curve_options = {"colour_dim": "damping", "styles": styles}
            panels.draw_curves(axes, order, "speed", "computed_level", **curve_options)
            axes.set_title(f"order {'' if k == 0 else k + 1}z")
            axes.set_ylabel(f"{data.title}\n{data.observable.item().replace('_', ' ')} (dB)")
            axes.label_outer()
    style.add_legend(figure, [_MEASURED_ENTRY, *panels.legend_handles(styles)], columns=5)
    return figure


def _to_decibels(amplitude: xr.DataArray, reference: xr.DataArray):
    """Convert amplitudes to dB relative to a reference amplitude; zero amplitudes become NaN."""
    ratio = (amplitude / reference).where(amplitude > 0.0)
    return 20.0 * np.log10(ratio)


_MEASURED_COLOUR, _FITTED_COLOUR = "#8C8C8C", style.PALETTE[0]
_ROW_HEIGHT = 2.0
#: Half width of a 95 % confidence interval, in standard deviations.
_HALF_INTERVAL = 1.96


@style.rc_context()
def fit(found, *, figure: Figure | None = None):
    """Draw the measured curves of a fit, and the fitted curves over them.

    Parameters
    ----------
    found : Fit
        Result of `gearlib.fit`.
    figure : matplotlib.figure.Figure, optional
        Empty figure to draw into; by default a new pyplot figure.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with one panel for each curve: measured values are dots, fitted values a line, which
        is dotted where the speed falls. The last panel shows the speeds of jumps and of the onset
        of contact loss.

    Raises
    ------
    ValueError
        If `found` is not a result of `gearlib.fit`.
    """
    # Only results of `gearlib.fit` have a reduced chi-square.
    if not hasattr(found, "redchi"):
        raise ValueError("found is not allowed: it must be a result of gearlib.fit")
    # Curves over speed or phase have the attribute x. The others are single measured speeds, of
    # jumps and of the onset of contact loss.
    curves = [curve for curve in found.curves() if hasattr(curve, "x")]
    speeds = [speed for speed in found.curves() if not hasattr(speed, "x")]
    panel_count = len(curves) + (1 if speeds else 0)
    rows = math.ceil(panel_count / 2)
    if figure is None:
        from matplotlib import pyplot

        figure_size = (style.PAGE_WIDTH, _ROW_HEIGHT * rows)
        figure = pyplot.figure(figsize=figure_size, layout="constrained")
    for i, curve in enumerate(curves):
        _draw_curve(figure.add_subplot(rows, 2, i + 1), curve)
    if speeds:
        _draw_speeds(figure.add_subplot(rows, 2, len(curves) + 1), speeds)
    figure.axes[0].legend()
    return figure


def _draw_curve(axes, curve):
    """Draw a measured curve as dots and the fitted curve as a line, dotted where the speed falls.

    `curve` is one of the curves over speed or phase returned by `Fit.curves`.
    """
    measured, fitted = curve.values
    unit_size, unit = style.readable_unit(curve.units, measured)
    markers = measured / unit_size, ".", _MEASURED_COLOUR, 2.5
    style.draw_markers(axes, curve.x, *markers, label="measured")
    is_falling = curve.speed_falls
    for mask, dashes, label in ((~is_falling, "-", "fitted"), (is_falling, ":", "speed falls")):
        if mask.any():
            line = {"color": _FITTED_COLOUR, "linestyle": dashes, "linewidth": 0.9, "label": label}
            axes.plot(curve.x, np.where(mask, fitted / unit_size, np.nan), **line)
    axes.set_xlabel("speed (rpm)" if curve.x_name == "speed" else "mesh periods")
    has_unit = unit not in ("", "1")
    axes.set_ylabel(f"{curve.name} ({unit})" if has_unit else curve.name)


def _draw_speeds(axes, speeds: list):
    """Draw fitted minus measured speeds, with 95 % confidence intervals of the measured speeds.

    `speeds` are the speeds of jumps and of the onset of contact loss returned by `Fit.curves`, in
    rpm; `deviation` is the standard deviation of a measured speed.
    """
    positions = np.arange(len(speeds))
    options = {"fmt": ".", "color": _MEASURED_COLOUR, "capsize": 3, "label": "measured"}
    intervals = [_HALF_INTERVAL * speed.deviation for speed in speeds]
    axes.errorbar(positions, 0.0 * positions, yerr=intervals, **options)
    differences = [speed.fitted - speed.measured for speed in speeds]
    options = {"label": "fitted", "mfc": "none"}
    style.draw_markers(axes, positions, differences, "o", _FITTED_COLOUR, 4, **options)
    axes.set_xticks(positions, [f"{speed.name}\n{speed.measured:.6g}" for speed in speeds])
    axes.set(xlim=(-0.5, len(speeds) - 0.5), ylabel="fitted minus measured (rpm)")

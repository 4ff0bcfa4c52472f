"""Gears given by geometry: mesh stiffness, Harris maps, dynamic factor over speed."""

import math

import numpy as np
import xarray as xr
from matplotlib import colormaps

from gearlib.figures import panels, style
from gearlib.figures.plot_curves import WARM_STARTED_STYLES

#: Methods whose uncertainty is drawn; the other methods are as uncertain as the energy method.
_METHODS_WITH_UNCERTAINTY = ("iso", "energy")
#: Markers of the means by the four methods; width of the names of published sources, in units of
#: the x axis.
_MEAN_MARKERS, _SOURCE_WIDTH = "so^D", 3.6


@style.rc_context()
def draw_mesh_stiffness(stiffness: xr.Dataset):
    """Return a figure of the mesh stiffness over the mesh period, and its mean, for each gear pair.

    `stiffness` is a result of `gearlib.studies.gear_geometry.mesh_stiffness`, with one curve for
    each method. Bands show the uncertainty of a method, crosses show published means.
    """
    data = stiffness.copy()
    for variable in ("mesh_stiffness", "mean_mesh_stiffness", "published_stiffness"):
        data[variable] = panels.convert_unit(stiffness[variable], 1e8, "$10^8$ N/m")
    styles = panels.plot_options(data.stiffness_method)
    pair_count = data.sizes["pair"]
    rows = math.ceil(pair_count / 2)
    figure = style.page_figure(2.6 * rows + 0.5)
    grid = figure.add_gridspec(rows, min(pair_count, 2))
    for i, pair_name in enumerate(data.pair.values):
        cell = grid[i // 2, i % 2].subgridspec(1, 2, width_ratios=(3.0, 1.0), wspace=0.0)
        curve_axes, mean_axes = cell.subplots(sharey=True)
        pair = data.sel(pair=pair_name)
        handles = _draw_stiffness(curve_axes, pair, styles)
        _draw_means(mean_axes, pair, styles)
        curve_axes.set_title(pair_name, loc="left")
        # Increase the upper limit to make room for markers and error bars.
        low, high = curve_axes.get_ylim()
        curve_axes.set_ylim(max(low, 0.0), high + 0.05 * (high - low))
    style.add_legend(figure, handles, columns=4, fontsize=6.5)
    return figure


def _draw_stiffness(axes, pair: xr.Dataset, styles: dict[str, dict]) -> list:
    """Draw the stiffness of a gear pair over a mesh period by each method; return legend handles.

    `styles` maps methods to options of `Axes.plot`. Two methods get a band of uncertainty.
    """
    for method in _METHODS_WITH_UNCERTAINTY:
        curve = pair.sel(stiffness_method=method)
        low = curve.mesh_stiffness * (1 - curve.method_uncertainty)
        high = curve.mesh_stiffness * (1 + curve.method_uncertainty)
        options = {"color": styles[method]["color"], "alpha": 0.12, "linewidth": 0}
        axes.fill_between(curve.stiffness_phase, low, high, **options)
    curve_options = {"colour_dim": "stiffness_method", "styles": styles}
    handles = panels.draw_curves(axes, pair, "stiffness_phase", "mesh_stiffness", **curve_options)
    axes.set_xlim(-math.pi, math.pi)
    axes.set_xticks([-math.pi, 0.0, math.pi], ["$-\\pi$", "0", "$\\pi$"])
    return handles


def _draw_means(axes, pair: xr.Dataset, styles: dict[str, dict]):
    """Draw the mean stiffness of a gear pair by each of four methods, and published means.

    `styles` maps methods to options of `Axes.plot`. Two methods get an error bar. The horizontal
    positions only separate the values.
    """
    methods = zip(styles.items(), _MEAN_MARKERS, strict=True)
    for x, ((method, options), marker) in enumerate(methods):
        result = pair.sel(stiffness_method=method)
        mean, error = float(result.mean_mesh_stiffness), 0.0
        if method in _METHODS_WITH_UNCERTAINTY:
            error = mean * float(result.method_uncertainty)
        bar_options = {"color": options["color"], "markersize": 4, "capsize": 2, "lw": 0.8}
        axes.errorbar(x, mean, error, marker=marker, **bar_options)
    published = pair.isel(published=pair.published_pair.values == pair.pair.item())
    x = len(styles)
    for source in published.published.values:
        value = float(published.published_stiffness.sel(published=source))
        axes.plot(x, value, "x", color="black", markersize=4)
        style.annotate(axes, source, (x, value), (4, 0), fontsize=5.5)
    text_width = _SOURCE_WIDTH if published.published.size else 0.0
    axes.set(xlim=(-0.8, x + text_width), xlabel="means")
    axes.set_xticks([])
    axes.tick_params(labelleft=False)


ERROR_LABEL = "static transmission error (µm)"


@style.rc_context()
def draw_harris_maps(data: xr.Dataset):
    """Return a figure of Harris maps (transmission error at several loads), one per tip relief.

    The line of the design load is thick. Panels below the maps show the peak-to-peak error and the
    effective contact ratio over the load. `data` is a result of
    `gearlib.studies.gear_geometry.harris_map`.
    """
    figure = style.page_figure(height=5.2)
    map_area, load_area = figure.subfigures(2, 1, height_ratios=(1.2, 1.0))
    maps = map_area.subplots(1, data.sizes["relief"], sharey=True, squeeze=False)[0]
    load = (data.torque / data.design_torque).drop_attrs()
    load.attrs["long_name"] = "torque over design torque"
    for axes, name in zip(maps, data.relief.values, strict=True):
        relief = data.sel(relief=name)
        draw_errors(axes, relief, load.values)
        amounts = " and ".join(f"{1e6 * amount:.3g}" for amount in relief.relief_amount.values)
        title = panels.value_label(relief.relief)
        axes.set_title(f"{title}\n{amounts} µm" if relief.relief_amount.any() else title)
    maps[0].set_ylabel(ERROR_LABEL)
    peak_to_peak = panels.convert_unit(data.peak_to_peak_error, 1e-6, "µm")
    curves = data.assign(peak_to_peak_error=peak_to_peak).assign_coords(torque=load)
    # Without a load, no teeth are in contact.
    curves["effective_contact_ratio"] = curves.effective_contact_ratio.where(curves.torque > 0.0)
    names = "peak_to_peak_error", "effective_contact_ratio"
    for axes, name in zip(load_area.subplots(1, 2), names, strict=True):
        options = {"colour_dim": "relief", "marker": "o", "markersize": 3.0}
        handles = panels.draw_curves(axes, curves, "torque", name, **options)
        axes.axvline(1.0, color="black", linewidth=0.5, linestyle=(0, (1, 2)))
    style.add_legend(figure, handles, columns=3)
    return figure


def draw_errors(axes, data: xr.Dataset, loads: np.ndarray, design_load=1.0):
    """Draw the transmission error over two mesh periods, with one line for each load.

    `data` contains the variable transmission_error (m) over (load, phase in rad). `loads`, in any
    unit, are the labels of the lines; the line of `design_load` is thick.
    """
    periods = data.phase.values / (2.0 * math.pi)
    # The factor 0.92 excludes the lightest colours, which are hard to see on white. The lower bound
    # avoids a division by zero if all loads are zero.
    colours = colormaps["viridis"](0.92 * loads / max(loads.max(), 1e-9))
    texts, errors = style.format_numbers(loads), data.transmission_error.values
    for load, text, colour, error in zip(loads, texts, colours, errors, strict=True):
        width = 2.0 if math.isclose(load, design_load) else 0.9
        # The period begins within double contact; two periods are needed to show it as a whole.
        x = np.concatenate([periods, periods + periods[-1] + periods[1]])
        axes.plot(x, 1e6 * np.tile(error, 2), color=colour, linewidth=width)
        options = {"coords": ("axes fraction", "data"), "fontsize": 5.5}
        style.annotate(axes, text, (1.0, 1e6 * error[0]), (2, 0), **options)
    axes.set(xlabel="mesh periods", xlim=(0.0, 2.0))


_LABELS = {"up": "running up", "down": "running down"}
_ISO_COLOUR, _OPERATING_COLOUR = "#8C8C8C", "#D55E00"


@style.rc_context()
def draw_dynamic_factor(curves: xr.Dataset):
    """Return a figure of dynamic factor and transmission error over the speed of the pinion.

    Dotted lines with an arrow show the speeds at which the motion jumps, a dashed line the
    operating speed. `curves` is a result of `gearlib.studies.teeth_over_speed.sweep_speeds`, for
    rising and falling speed.
    """
    figure = style.page_figure(height=4.6)
    factor_axes, error_axes = figure.subplots(2, 1, sharex=True)
    speed = curves.speed.values
    curve_styles = style.curve_styles([str(direction) for direction in curves.direction.values])
    error = panels.convert_unit(curves.error_peak_to_peak, 1e-6, "µm")
    handles = []
    for direction, curve_style in curve_styles.items():
        dashes, _ = WARM_STARTED_STYLES[direction]
        options = {"color": curve_style.colour, "linestyle": dashes}
        factor = curves.dynamic_factor.sel(direction=direction)
        handles += factor_axes.plot(speed, factor, label=_LABELS[direction], **options)
        error_axes.plot(speed, error.sel(direction=direction), **options)
    if "iso_dynamic_factor" in curves:
        options = {"color": _ISO_COLOUR, "linestyle": ":", "label": "ISO 6336-1, method B"}
        handles += factor_axes.plot(speed, curves.iso_dynamic_factor, **options)
    if curves.operating_speed.notnull():
        options = {"color": _OPERATING_COLOUR, "linestyle": "--", "linewidth": 0.8}
        for axes in (factor_axes, error_axes):
            line = axes.axvline(float(curves.operating_speed), label="operating speed", **options)
        handles.append(line)
    for direction, curve_style in curve_styles.items():
        for jump_speed in curves[f"jump_{direction}_speed"].dropna("hysteresis").values:
            factor_axes.axvline(jump_speed, color=curve_style.colour, linestyle=":", linewidth=0.8)
            arrow = "↑" if direction == "up" else "↓"
            point, coords = (jump_speed, 0.93), ("data", "axes fraction")
            style.annotate(factor_axes, f"{arrow} {jump_speed:.0f}", point, (2, 0), coords=coords)
    factor_axes.set_ylim(bottom=0.0)
    error_axes.set_ylim(bottom=0.0)
    factor_axes.set_xlim(style.axis_limits(speed, margin=0.0))
    factor_axes.set_ylabel("dynamic factor $K_v$")
    error_axes.set_xlabel(panels.axis_label(curves.speed))
    error_axes.set_ylabel(panels.axis_label(error, width=30))
    style.add_legend(figure, handles, columns=4)
    return figure

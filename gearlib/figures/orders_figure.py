"""Order spectra, order maps, and run-ups above the order map of the slowest one."""

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from gearlib import checks
from gearlib.figures import panels, plot_curves, style

#: Smallest amplitude drawn, relative to the largest one.
_MIN_RELATIVE_AMPLITUDE = 1e-6
#: Largest number of labels of tooth-passing harmonics.
_MAX_LABELS = 10


@style.rc_context()
def orders(*spectra: xr.Dataset, axes=None, labels=None, variable="force_amplitude") -> Axes:
    """Draw order spectra: amplitudes over the orders, with labels at tooth-passing harmonics.

    An order is the ratio of a frequency to the frequency of the shaft. The mean (order 0) and
    amplitudes below a millionth of the largest are omitted.

    Parameters
    ----------
    *spectra : xarray.Dataset
        Order spectra returned by `gearlib.orders`; each mesh of a train has its own colour.
    axes : matplotlib.axes.Axes, optional
        Axes to draw into; by default the axes of a new pyplot figure.
    labels : sequence of str, optional
        Legend labels of the datasets.
    variable : {"force_amplitude", "error_amplitude"}
        Amplitudes to draw: of the mesh force or of the transmission error.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset is not an order spectrum, or lacks the variable.
    """
    checks.check_choice("variable", variable, ("force_amplitude", "error_amplitude"))
    # Error messages name the function that draws (caller) and the one that computes (source).
    sources = {"dim": "order", "caller": "orders", "source": "orders"}
    curves = plot_curves.create_curves(spectra, labels, (variable, "mesh_order"), **sources)
    axes = plot_curves.get_axes(axes)
    # Omit order 0, the mean.
    spectra = [curve.data.isel(order=slice(1, None)) for curve in curves]
    variables = [spectrum[variable] for spectrum in spectra]
    unit_size, unit = style.readable_unit(variables[0].units, *variables)
    for curve, spectrum in zip(curves, spectra, strict=True):
        amplitudes = spectrum[variable].values / unit_size
        bottom = _MIN_RELATIVE_AMPLITUDE * amplitudes.max()
        mask = amplitudes > bottom
        orders, amplitudes = spectrum.order.values[mask], amplitudes[mask]
        options = {"color": curve.style.colour, "label": curve.label}
        axes.vlines(orders, bottom, amplitudes, lw=1.4, **options)
        style.draw_markers(axes, orders, amplitudes, "o", curve.style.colour, 2.5)
    axes.set_yscale("log")
    _label_harmonics(axes, max(spectra, key=lambda spectrum: spectrum.order[-1]))
    axes.set_xlabel("order (waves per revolution)")
    kind = "mesh force" if variable == "force_amplitude" else "transmission error"
    axes.set_ylabel(f"{kind} ({unit}, peak)")
    return plot_curves.add_legend(axes)


def _label_harmonics(axes, data: xr.Dataset):
    """Draw labelled lines at the harmonics of the mesh frequency in an order spectrum.

    Harmonics are the orders at which the variable `mesh_order` of `data` is an integer. If there
    are more than `_MAX_LABELS`, only every second, third etc. is labelled.
    """
    is_harmonic = (data.mesh_order.values % 1 == 0) & (data.mesh_order.values > 0)
    orders = data.order.values[is_harmonic]
    label_step = math.ceil(len(orders) / _MAX_LABELS)
    for k, order in enumerate(orders, 1):
        axes.axvline(order, color="0.85", lw=0.8, zorder=0)
        if k % label_step == 0:
            label = "mesh" if k == 1 else f"{k} × mesh"
            options = {"coords": ("data", "axes fraction"), "anchor": "center baseline"}
            rotation = 90 if len(orders) > 4 else 0
            style.annotate(axes, label, (order, 1.0), (0, 2), rotation=rotation, **options)
    axes.set_xlim(0.0, 1.03 * float(np.max(data.order)))


#: CF unit of a variable -> (size in SI, name) of the reference value of its levels in dB.
REFERENCE_UNITS = {
    "m": (1e-6, "µm"),
    "N": (1.0, "N"),
    "m s-1": (1.0, "m/s"),
    "m s-2": (1.0, "m/s²"),
}
#: Range of the colour scale below the highest level, dB.
LEVEL_RANGE = 80.0
#: Number of labelled mesh orders z, 2z, ...
MESH_ORDERS = 3
#: Variable of characteristic frequencies -> legend label.
LEGEND_LABELS = {
    "mesh_frequency_hertz": "mesh frequency",
    "hunting_tooth_frequency": "hunting tooth",
    "assembly_phase_frequency": "assembly phase",
    "sideband_spacing": "sideband spacing",
    "shaft_frequency": "shaft",
    "planet_passing_frequency": "planet passing",
}
#: Largest number of circles on each mesh order of a measured map.
MAX_CIRCLES = 30


@style.rc_context()
def order_map(
    found: xr.Dataset,
    *,
    figure=None,
    vertical="order",
    levels=None,
    measured=None,
    frequencies=None,
):
    """Draw an order map, with the rising and the falling speed side by side.

    An order map shows amplitudes over the speed and the order (waves per revolution). Labelled
    lines are the mesh orders z, 2z, ... and the subharmonic z/2 of a gear with z teeth, dotted
    lines are the sidebands z - 1, z + 1 etc. The axes below each map show the overall level. Time
    intervals without data remain empty.

    Parameters
    ----------
    found : xarray.Dataset
        Order map returned by `gearlib.order_map`, for a train the map of one mesh.
    figure : matplotlib.figure.Figure, optional
        Empty figure to draw into; by default a new pyplot figure.
    vertical : {"order", "frequency"}
        Quantity of the vertical axis.
    levels : tuple of float, optional
        Lowest and highest level, dB; by default the highest level and 80 dB below it.
    measured : xarray.Dataset, optional
        Measured order map of the same variable. Its overall level is drawn as dots, and its levels
        on the mesh orders as coloured circles, which become invisible where both maps agree.
    frequencies : xarray.Dataset, optional
        Characteristic frequencies, returned by `gearlib.characteristic_frequencies`, of the gear
        whose speed is shown. They are drawn as lines with a legend.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with two axes for each direction of the speed: map and overall level.

    Raises
    ------
    ValueError
        If a dataset is not an order map of one mesh, or the two maps have different variables.
    """
    checks.check_choice("vertical", vertical, ("order", "frequency"))
    for name, data in {"found": found, "measured": found if measured is None else measured}.items():
        if getattr(getattr(data, "amplitude", None), "dims", ()) != ("time", "order"):
            raise ValueError(
                f"{name} is not allowed: it must be an order map of gearlib.order_map, of one mesh"
            )
        for attribute in ("variable", "amplitude"):
            value, allowed = data.attrs[attribute], found.attrs[attribute]
            checks.require(value == allowed, f"measured.{attribute}", value, repr(allowed))
    found, unit = _convert_to_decibels(found, vertical)
    high = float(found.level.max())
    low, high = (high - LEVEL_RANGE, high) if levels is None else levels
    colours = {"cmap": "magma", "vmin": low, "vmax": high}
    directions = np.unique(found.direction)[::-1]
    if figure is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=(2.7 * directions.size + 1.0, 3.8), layout="constrained")
    options = {"squeeze": False, "sharex": True, "sharey": "row", "height_ratios": (3, 1)}
    grid = figure.subplots(2, directions.size, **options)
    for (map_axes, level_axes), direction in zip(grid.T, directions, strict=True):
        run = _select_direction(found, direction)
        speed, level = np.broadcast_arrays(run.rpm.values[:, None], run.level.clip(low, high))
        options = colours | {"shading": "nearest", "rasterized": True}
        image = map_axes.pcolormesh(speed, run.height, level, **options)
        _draw_mesh_orders(map_axes, run)
        if frequencies is not None:
            _draw_frequencies(map_axes, run, frequencies)
        map_axes.set_title(f"speed goes {direction}")
        level_axes.plot(run.rpm, run.overall, color="C0")
        if measured is not None:
            measured_run = _select_direction(_convert_to_decibels(measured, vertical)[0], direction)
            _draw_circles(map_axes, measured_run, colours)
            options = {"zorder": 1, "label": "measured"}
            points = measured_run.rpm, measured_run.overall
            style.draw_markers(level_axes, *points, ".", "#8C8C8C", 2.0, **options)
        level_axes.set_xlabel("speed (rpm)")
        # With more ticks, speeds with five digits would overlap.
        level_axes.locator_params(axis="x", nbins=5)
    grid[0, 0].set_ylabel("order" if vertical == "order" else "frequency (Hz)")
    grid[1, 0].set_ylabel(f"overall\n({unit})")
    label = f"{found.attrs['variable'].replace('_', ' ')}, {found.attrs['amplitude']}\n({unit})"
    figure.colorbar(image, ax=grid[0], label=label)
    return figure


def _convert_to_decibels(data: xr.Dataset, vertical: str) -> tuple[xr.Dataset, str]:
    """Return an order map with levels in dB, prepared for drawing, and the unit of the levels.

    The map gets the variables `level` and `overall` (dB); `direction` ("up" or "down", the change
    of speed); `height`, the vertical position of each level on an axis of the quantity `vertical`
    ("order" or "frequency"); and `scale`, the ratio of height to order. Order 0, the mean, is
    omitted.
    """
    data = _insert_empty_blocks(data.isel(order=slice(1, None)))
    unit = data.overall.attrs.get("units", "N")
    reference, name = REFERENCE_UNITS.get(unit, (1.0, unit))
    # Squared amplitudes ("power") are converted to amplitudes.
    amplitude = data.amplitude**0.5 if data.attrs["amplitude"] == "power" else data.amplitude
    with np.errstate(divide="ignore"):
        level = 20.0 * np.log10(amplitude / reference)
        overall = 20.0 * np.log10(data.overall / reference)
    rpm = np.abs(data.rpm)
    is_falling = np.gradient(rpm.values) < 0.0 if rpm.size > 1 else np.zeros(1, bool)
    scale = rpm / 60.0 if vertical == "frequency" else xr.ones_like(rpm)
    levels = {"level": level, "overall": overall, "scale": scale, "height": scale * data.order}
    direction = "time", np.where(is_falling, "down", "up")
    return data.assign(levels | {"direction": direction}), f"dB re 1 {name}"


def _insert_empty_blocks(data: xr.Dataset) -> xr.Dataset:
    """Insert an empty block (NaN) at both ends of each time gap of an order map.

    A block is a set of samples from which one spectrum is computed; the number of its revolutions
    is the inverse of the order resolution. Without empty blocks, the map would be drawn across the
    gaps.
    """
    time, durations = data.time.values, 60.0 / (data.order_resolution * np.abs(data.rpm)).values
    # There is a gap if the distance between the centres of two blocks is much longer than their
    # mean duration.
    gaps = np.flatnonzero(np.diff(time) > 0.75 * (durations[1:] + durations[:-1]))
    if not gaps.size:
        return data
    gap_starts = time[gaps] + durations[gaps]
    gap_ends = time[gaps + 1] - durations[gaps + 1]
    extended_map = data.reindex(time=np.unique([*time, *gap_starts, *gap_ends]))
    rpm = np.interp(extended_map.time, time, data.rpm)
    return extended_map.assign(rpm=("time", rpm, data.rpm.attrs))


def _select_direction(data: xr.Dataset, direction: str) -> xr.Dataset:
    """Return the blocks of an order map with rising ("up") or falling ("down") speed, by speed."""
    return data.isel(time=np.flatnonzero(data.direction == direction)).sortby("rpm")


def _draw_circles(axes, measured: xr.Dataset, colours: dict):
    """Draw circles, coloured by level, on the mesh orders of a measured order map.

    Mesh orders are the multiples of the number of teeth. `measured` is a map returned by
    `_convert_to_decibels`. `colours` contains the colour map (cmap) and its limits in dB (vmin,
    vmax). At most `MAX_CIRCLES` circles are drawn on each order.
    """
    block_step = max(1, math.ceil(measured.sizes["time"] / MAX_CIRCLES))
    blocks = measured.isel(time=slice(None, None, block_step))
    for order in float(measured.teeth) * np.arange(1, MESH_ORDERS + 1):
        # The measured map may not contain this order.
        if np.abs(measured.order - order).min() < 1e-6:
            track = blocks.sel(order=order, method="nearest")
            options = colours | {"edgecolors": "white", "linewidth": 0.4, "zorder": 3}
            level = track.level.clip(colours["vmin"], colours["vmax"])
            axes.scatter(track.rpm, order * track.scale, 12.0, level, **options)


def _draw_frequencies(axes, run: xr.Dataset, frequencies: xr.Dataset):
    """Draw dashed lines at the orders of characteristic frequencies, e.g. the shaft frequency.

    Each kind of frequency has its own colour and legend entry. `run` is an order map returned by
    `_convert_to_decibels`. `frequencies` is a result of `gearlib.characteristic_frequencies`, in
    Hz at its `speed` in rpm.
    """
    frequency_names = frequencies.filter_by_attrs(units="Hz").data_vars
    for i, name in enumerate([name for name in frequency_names if name in LEGEND_LABELS]):
        values = np.unique(np.round(frequencies[name].values, 9))
        orders = values[np.isfinite(values) & (values > 0.0)] * 60.0 / float(frequencies.speed)
        label = LEGEND_LABELS[name]
        for order in orders[orders <= float(run.order[-1])]:
            heights = order * run.scale
            axes.plot(run.rpm, heights, lw=0.5, ls="--", color=f"C{i}", label=label)
            label = None  # Each kind must have only one legend entry.
    handles, labels = axes.get_legend_handles_labels()
    handle_by_label = dict(zip(labels, handles, strict=True))
    entries = {}
    for label, handle in handle_by_label.items():
        if label in LEGEND_LABELS.values():
            entries[label] = handle
    if entries:
        axes.legend(entries.values(), entries, fontsize=5, loc="upper left")


def _draw_mesh_orders(axes, data: xr.Dataset):
    """Draw labelled lines at mesh orders and their subharmonic, and dotted lines at sidebands.

    Mesh orders are the multiples of the number of teeth z, and z/2 is the subharmonic. `data` is an
    order map returned by `_convert_to_decibels`. The lines may bend at the lowest speed, so only
    their ends and this point are drawn.
    """
    slowest_index, last_index = int(np.abs(data.rpm).argmin("time")), data.sizes["time"] - 1
    teeth = float(data.teeth)
    line_points = data.isel(time=sorted({0, slowest_index, last_index}))
    orders = {"z/2": 0.5 * teeth, "z": teeth}
    orders |= {f"{k}z": k * teeth for k in range(2, MESH_ORDERS + 1)}
    options = {"color": "white", "alpha": 0.6}
    for name, order in orders.items():
        if order <= data.order[-1]:
            axes.plot(line_points.rpm, order * line_points.scale, lw=0.5, label=name, **options)
            point = line_points.rpm[-1], order * line_points.scale[-1]
            style.annotate(axes, name, point, (2, 0), "left baseline")
        sideband_offsets = (-1.0, 1.0) if name != "z/2" else ()
        for offset in sideband_offsets:
            if order + offset <= data.order[-1]:
                label, heights = f"{name} {offset:+.0f}", (order + offset) * line_points.scale
                axes.plot(line_points.rpm, heights, lw=0.4, ls=":", label=label, **options)


_HEIGHT, _MAP_HEIGHT = 3.4, 4.0
_EXTREMA = ("displacement_max", "displacement_min")
_SWEEP_LINE = {"color": "#BBBBBB", "linewidth": 2.5, "zorder": 1}
_FOLD_LINE = {"line_style": style.DASHED, "linewidth": 0.6}
#: Code of folds in the variable `label` of branches.
_FOLD_CODE = 1


@style.rc_context()
def draw_run_ups(run_ups: xr.Dataset, *, resonance=None, branches=None):
    """Return a figure of the displacement extrema in run-ups, above an order map of the slowest.

    `run_ups` is a result of `gearlib.studies.run_ups.run_ups_at_several_rates`. If `resonance`, a
    dataset over (damping, direction, tuning), is given, its sweeps with increasing and decreasing
    tuning (mesh frequency over natural frequency) are drawn behind the run-ups. If `branches` of
    periodic orbits are given, dashed lines mark the tunings of their folds, where jumps occur.
    """
    figure = style.page_figure(_HEIGHT + _MAP_HEIGHT)
    extrema_area, map_area = figure.subfigures(2, 1, height_ratios=[_HEIGHT, _MAP_HEIGHT])
    axes = extrema_area.subplots()
    for name in _EXTREMA:
        curve_options = {"colour_dim": "revolutions", "line_dim": "direction"}
        handles = panels.draw_curves(axes, run_ups, "tuning", name, **curve_options)
    if resonance is not None:
        _draw_sweeps(axes, resonance.sortby("tuning"), str(run_ups.damping.values))
        colour, width = _SWEEP_LINE["color"], _SWEEP_LINE["linewidth"]
        handles.append(style.legend_handle("sweeps", colour, linewidth=width))
    if branches is not None:
        for tuning in np.unique(branches.tuning.values[branches.label.values == _FOLD_CODE]):
            axes.axvline(tuning, color="black", linestyle=_FOLD_LINE["line_style"], linewidth=0.6)
        handles.append(style.legend_handle("fold", **_FOLD_LINE))
    axes.set_xlim(run_ups.tuning.min(), run_ups.tuning.max())
    axes.set_ylabel("largest and smallest displacement\n(static deflections)")
    axes.legend(handles=handles, ncols=2)
    # These attributes may be missing in data gathered from several files.
    attributes = {"variable": "dynamic_force", "amplitude": "rms"} | run_ups.attrs
    order_map(run_ups.rename(block="time").assign_attrs(attributes), figure=map_area)
    return figure


def _draw_sweeps(axes, resonance: xr.Dataset, damping: str):
    """Draw the displacement extrema of sweeps with increasing and decreasing tuning.

    The tuning is the mesh frequency over the natural frequency. Nothing is drawn unless `resonance`
    contains the damping combination named `damping`.
    """
    if damping in resonance.damping.values:
        sweeps = resonance.sel(damping=damping)
        sweeps = sweeps.sel(direction=[d for d in ("up", "down") if d in sweeps.direction])
        for name in _EXTREMA:
            options = {"line_dim": "direction", "linestyle": "-"} | _SWEEP_LINE
            panels.draw_curves(axes, sweeps, "tuning", name, **options)

"""Panels with curves of a dataset; labels, units and legends are derived from its attributes."""

import re
import textwrap
from itertools import cycle
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike

from gearlib.figures import style

ROW_HEIGHT, LEGEND_HEIGHT = 1.8, 0.7
#: Number of label characters per inch of an axis.
CHARACTERS_PER_INCH = 15

_UNITS = {"1": "", "min-1": "rpm", "degree": "degrees"}
_VALUE_LABELS = {
    "up": "speed up",
    "down": "speed down",
    "cold": "from rest",
    "alike": "branches alike",
    "pin_error": "axis of satellite 1 displaced",
    "unequal_backlash": "unequal backlash",
    "iso": "ISO 6336-1",
    "energy": "energy method, one body",
    "energy_twice": "a body for each pair",
    "energy_logarithmic": "logarithmic contact",
    "none": "no relief",
    "own": "own relief",
    "short": "short relief",
    "long": "long relief",
}
_GREEK = {"nu": "ν", "tau": "τ", "kappa": "κ", "epsilon": "ε", "beta": "β"}


def name_and_unit(variable: xr.DataArray) -> tuple[str, str]:
    """Return the name of a variable for axis labels, and its unit in common notation.

    The name is the attribute long_name up to a comma or colon; names of Greek letters are replaced
    by the letters. Units are converted from CF notation, e.g. "min-1" to "rpm" and "1" to "".
    """
    name = variable.attrs.get("long_name", str(variable.name).replace("_", " "))
    greek_words = rf"\b(d?)({'|'.join(_GREEK)})\b"
    name = re.sub(greek_words, lambda match: match[1] + _GREEK[match[2]], name)
    cf_unit = variable.attrs.get("units", "1")
    unit = _UNITS.get(cf_unit, re.sub(r" (\w+)-1$", r"/\1", cf_unit))
    return re.split("[,:]", name)[0], unit


def axis_label(variable: xr.DataArray, width: int | None = None) -> str:
    """Return the axis label "name (unit)" of a variable, wrapped after `width` characters."""
    name, unit = name_and_unit(variable)
    text = f"{name} ({unit})" if unit else name
    return textwrap.fill(text, width) if width else text


def value_label(coordinate: xr.DataArray) -> str:
    """Return a label for the value of a scalar coordinate, as `value_labels` does."""
    return value_labels(coordinate)[0]


def value_labels(coordinate: xr.DataArray) -> list[str]:
    """Return a label for each value of a coordinate; different values get different labels.

    A string gets a readable name, e.g. "from rest" for "cold"; a number gets "name = number unit".
    """
    values = np.ravel(coordinate.values).tolist()
    if isinstance(values[0], str):
        return [_VALUE_LABELS.get(value, style.typeset_dampings(value)) for value in values]
    name, unit = name_and_unit(coordinate)
    return [f"{name} = {text} {unit}".strip() for text in style.format_numbers(values)]


def format_tunings(tunings: ArrayLike, speeds: ArrayLike | None = None) -> list[str]:
    """Format tunings (mesh frequency over natural frequency), if useful with their speeds.

    If `speeds`, in rpm, are given, the speed is appended to each tuning with many digits, because
    the user must have given the speed instead of the tuning.
    """
    texts = style.format_numbers(tunings, digits=4, form="f", decimals=2)
    if speeds is None:
        return texts
    for i, (tuning, rpm) in enumerate(
        zip(np.ravel(tunings).tolist(), style.format_numbers(speeds), strict=True)
    ):
        if not style.has_few_digits(tuning):
            texts[i] += f" ({rpm} rpm)"
    return texts


def plot_options(coordinate: xr.DataArray, colours: dict | None = None) -> dict[Any, dict]:
    """Return a dict: coordinate value -> options of `Axes.plot` (colour, line style, label).

    `colours` maps some coordinate values to colours; all others get colours of the palette.
    """
    styles = style.curve_styles(coordinate.values.tolist(), colours)
    labels = value_labels(coordinate) if styles else []
    return {
        value: {"color": curve.colour, "linestyle": curve.line_style, "label": label}
        for (value, curve), label in zip(styles.items(), labels, strict=True)
    }


def set_plain_ticks(axis: Axis):
    """Label the ticks of a logarithmic axis with plain numbers, for a range of few decades."""
    axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def legend_handles(styles: dict[str, dict]) -> list[Line2D]:
    """Return one legend handle per curve; `styles` maps curves to options of `Axes.plot`."""
    return [Line2D([], [], **options) for options in styles.values()]


def phase_to_mesh_periods(dataset: xr.Dataset, name="phase") -> xr.Dataset:
    """Convert the phase coordinate `name` of a dataset from rad to mesh periods."""
    periods = dataset[name] / (2.0 * np.pi)
    return dataset.assign_coords({name: periods.assign_attrs(long_name="mesh periods", units="1")})


def convert_unit(variable: xr.DataArray, unit_size: float, unit: str) -> xr.DataArray:
    """Convert a variable to another `unit`; `unit_size` is its size in the present unit."""
    return (variable / unit_size).assign_attrs(variable.attrs | {"units": unit})


def draw_curves(
    axes: Axes,
    data: xr.Dataset,
    x: str,
    y: str,
    *,
    colour_dim=None,
    line_dim=None,
    styles=None,
    **options,
) -> list[Line2D]:
    """Draw the variable `y` of a dataset over the variable `x`; return legend handles.

    One curve is drawn for each combination of values of the dimensions `colour_dim` and `line_dim`,
    which determine the colour and the line style; either may be None. `styles` maps values of
    `colour_dim` to options of `Axes.plot`; `options` apply to all curves.
    """
    colour_styles = {None: {"color": style.PALETTE[0]}}
    line_styles = {None: {}}
    if colour_dim is not None:
        colour_styles = styles or plot_options(data[colour_dim])
    if line_dim is not None:
        values = data[line_dim].values.tolist()
        labels = value_labels(data[line_dim])
        line_styles = {
            value: {"linestyle": line_style, "label": label}
            for value, label, line_style in zip(
                values, labels, cycle(style.LINE_STYLES), strict=False
            )
        }
    for colour_value, colour_style in colour_styles.items():
        for line_value, line_style in line_styles.items():
            curve = data if colour_dim is None else data.sel({colour_dim: colour_value})
            curve = curve if line_dim is None else curve.sel({line_dim: line_value})
            curve_style = colour_style | line_style | {"label": None} | options
            axes.plot(curve[x].values, curve[y].values, **curve_style)
    # The label of the vertical axis is wrapped to the height of the axes.
    height = axes.get_window_extent().height / axes.figure.dpi
    axes.set_xlabel(axis_label(data[x]))
    axes.set_ylabel(axis_label(data[y], max(12, round(CHARACTERS_PER_INCH * height))))
    # The legend lists colours (with solid lines) and line styles (in black) separately.
    handle_options = [] if colour_dim is None else [*colour_styles.values()]
    if line_dim is not None:
        handle_options = [options | {"linestyle": "-"} for options in handle_options]
        handle_options += [{"color": "black"} | options for options in line_styles.values()]
    return [Line2D([], [], **options) for options in handle_options]


def draw_panels(
    data, x, y, *, panel_dim=None, colour_dim=None, line_dim=None, styles=None, figure=None
) -> np.ndarray:
    """Draw variables of a dataset in panels with a common legend; return the array of axes.

    `x` is the name of the variable on the horizontal axes, and `y` the name of the variable to
    draw, or a list of names, one for each row of panels. `panel_dim`, `colour_dim` and `line_dim`
    are dimensions or None; their values determine the column of panels, the colour and the line
    style. `styles` maps values of `colour_dim` to options of `Axes.plot`. If `figure` is None, a
    new figure is created.
    """
    names = [y] if isinstance(y, str) else list(y)
    selections = [data]
    if panel_dim is not None:
        selections = [data.sel({panel_dim: value}) for value in data[panel_dim].values]
    figure = figure or style.page_figure(ROW_HEIGHT * len(names) + LEGEND_HEIGHT)
    grid = figure.subplots(len(names), len(selections), squeeze=False, sharex=True, sharey="row")
    titles = [""] if panel_dim is None else value_labels(data[panel_dim])
    curve_options = {"colour_dim": colour_dim, "line_dim": line_dim, "styles": styles}
    for column, selection, title in zip(grid.T, selections, titles, strict=True):
        column[0].set_title(title)
        for axes, name in zip(column, names, strict=True):
            handles = draw_curves(axes, selection, x, name, **curve_options)
            axes.label_outer()
    # Matplotlib gives lines without a label a label with a leading underscore.
    handles = [handle for handle in handles if not str(handle.get_label()).startswith("_")]
    if handles:
        style.add_legend(figure, handles, columns=min(len(handles), 4))
    return grid

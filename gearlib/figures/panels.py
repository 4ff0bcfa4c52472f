"""Panels of curves of a dataset; labels, units and legends come from its attributes."""

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
#: Number of characters of a label per inch of an axis.
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
    """Return the name of a variable for axis labels, and its unit as written in text.

    The name is the attribute long_name up to a comma or colon, with Greek letters in place of their
    names. Units in CF notation are rewritten: "min-1" becomes "rpm", "1" becomes "".
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
    """Return the label of a scalar coordinate: a readable name, or "name = number unit"."""
    return value_labels(coordinate)[0]


def value_labels(coordinate: xr.DataArray) -> list[str]:
    """Return a label for each value of a coordinate; different values have different labels.

    Strings get a readable name, such as "from rest" for "cold"; numbers get "name = number unit".
    """
    values = np.ravel(coordinate.values).tolist()
    if isinstance(values[0], str):
        return [_VALUE_LABELS.get(value, style.typeset_dampings(value)) for value in values]
    name, unit = name_and_unit(coordinate)
    return [f"{name} = {text} {unit}".strip() for text in style.format_numbers(values)]


def format_tunings(tunings: ArrayLike, speeds: ArrayLike | None = None) -> list[str]:
    """Return each tuning as text; a tuning computed from a speed is followed by this speed.

    The tuning is the mesh frequency over the natural frequency. Computed tunings have more digits
    than those that a user wrote. `speeds`, in rpm, has the speed of each tuning; with None no text
    has a speed.
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
    """Return a dict: coordinate value -> `Axes.plot` options (colour, dashes, label) of its curve.

    `colours` maps some coordinate values to colours; the others get colours of the palette.
    """
    styles = style.curve_styles(coordinate.values.tolist(), colours)
    labels = value_labels(coordinate) if styles else []
    return {
        value: {"color": curve.colour, "linestyle": curve.line, "label": label}
        for (value, curve), label in zip(styles.items(), labels, strict=True)
    }


def set_plain_ticks(axis: Axis):
    """Label the ticks of a logarithmic axis over few decades with plain numbers such as 1.5."""
    axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def legend_handles(styles: dict[str, dict]) -> list[Line2D]:
    """Return a legend handle for each curve; `styles` maps curves to options of `Axes.plot`."""
    return [Line2D([], [], **options) for options in styles.values()]


def phase_to_mesh_periods(dataset: xr.Dataset, name="phase") -> xr.Dataset:
    """Return a dataset with its phase coordinate `name` converted from rad to mesh periods."""
    periods = dataset[name] / (2.0 * np.pi)
    return dataset.assign_coords({name: periods.assign_attrs(long_name="mesh periods", units="1")})


def convert_unit(variable: xr.DataArray, size: float, unit: str) -> xr.DataArray:
    """Return a variable divided by `size`, the size of the new `unit` in the present unit."""
    return (variable / size).assign_attrs(variable.attrs | {"units": unit})


def draw_curves(
    axes: Axes, data: xr.Dataset, x: str, y: str, *, colour=None, line=None, styles=None, **options
) -> list[Line2D]:
    """Draw the variable named `y` of a dataset over the variable named `x`; return legend handles.

    `colour` and `line` are names of dimensions or None. There is a curve for each combination of
    their values: each value of `colour` has its colour, each value of `line` its dashes. `styles`
    maps values of `colour` to options of `Axes.plot`; `options` are such options for all curves.
    """
    colour_styles = {None: {"color": style.PALETTE[0]}}
    line_styles = {None: {}}
    if colour is not None:
        colour_styles = styles or plot_options(data[colour])
    if line is not None:
        values = data[line].values.tolist()
        line_styles = {
            value: {"linestyle": dashes, "label": label}
            for value, label, dashes in zip(
                values, value_labels(data[line]), cycle(style.LINE_STYLES), strict=False
            )
        }
    for colour_value, colour_style in colour_styles.items():
        for line_value, line_style in line_styles.items():
            curve = data if colour is None else data.sel({colour: colour_value})
            curve = curve if line is None else curve.sel({line: line_value})
            curve_style = colour_style | line_style | {"label": None} | options
            axes.plot(curve[x].values, curve[y].values, **curve_style)
    # The label of the vertical axis is wrapped to the height of the axes in inches.
    height = axes.get_window_extent().height / axes.figure.dpi
    axes.set_xlabel(axis_label(data[x]))
    axes.set_ylabel(axis_label(data[y], max(12, round(CHARACTERS_PER_INCH * height))))
    # The legend lists colours and dashes separately: colours with solid lines, dashes in black.
    entry_options = [] if colour is None else [*colour_styles.values()]
    if line is not None:
        entry_options = [options | {"linestyle": "-"} for options in entry_options]
        entry_options += [{"color": "black"} | options for options in line_styles.values()]
    return [Line2D([], [], **options) for options in entry_options]


def draw_panels(
    data, x, y, *, panel=None, colour=None, line=None, styles=None, figure=None
) -> np.ndarray:
    """Draw variables of a dataset in panels, with a legend below; return the array of axes.

    `x` is the name of the variable on all horizontal axes; `y` is the name of the variable to draw,
    or a list of names with a row of panels each. `panel`, `colour` and `line` are names of
    dimensions or None: each value of `panel` has a column of panels, each value of `colour` a
    colour, each value of `line` its dashes. `styles` maps values of `colour` to options of
    `Axes.plot`. Without a `figure`, a new one is made.
    """
    names = [y] if isinstance(y, str) else list(y)
    selections = [data]
    if panel is not None:
        selections = [data.sel({panel: value}) for value in data[panel].values]
    figure = figure or style.page_figure(ROW_HEIGHT * len(names) + LEGEND_HEIGHT)
    grid = figure.subplots(len(names), len(selections), squeeze=False, sharex=True, sharey="row")
    titles = [""] if panel is None else value_labels(data[panel])
    for column, selected, title in zip(grid.T, selections, titles, strict=True):
        column[0].set_title(title)
        for axes, name in zip(column, names, strict=True):
            entries = draw_curves(axes, selected, x, name, colour=colour, line=line, styles=styles)
            axes.label_outer()
    # Matplotlib labels lines that have no label with a leading underscore.
    entries = [entry for entry in entries if not str(entry.get_label()).startswith("_")]
    if entries:
        style.add_legend(figure, entries, columns=min(len(entries), 4))
    return grid

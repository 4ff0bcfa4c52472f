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

from gearlib.figures import style

ROW_HEIGHT, LEGEND_HEIGHT = 1.8, 0.7
#: Characters of a label that fit along an inch of an axis.
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
    "short": "short relief",
    "long": "long relief",
}
_GREEK = {"nu": "ν", "tau": "τ", "kappa": "κ", "epsilon": "ε", "beta": "β"}
_DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (6, 1.5, 1.5, 1.5)))


def name_and_unit(variable: xr.DataArray) -> tuple[str, str]:
    """Return a variable's long name up to a comma or colon, "nu" as "ν" etc., and its unit."""
    name = variable.attrs.get("long_name", str(variable.name).replace("_", " "))
    greek_words = rf"\b(d?)({'|'.join(_GREEK)})\b"
    name = re.sub(greek_words, lambda match: match[1] + _GREEK[match[2]], name)
    unit = variable.attrs.get("units", "1")
    return re.split("[,:]", name)[0], _UNITS.get(unit, re.sub(r" (\w+)-1$", r"/\1", unit))


def axis_label(variable: xr.DataArray, width: int | None = None) -> str:
    """Return the axis label "name (unit)" of a variable, in lines of at most `width` characters."""
    name, unit = name_and_unit(variable)
    text = f"{name} ({unit})" if unit else name
    return textwrap.fill(text, width) if width else text


def value_label(coordinate: xr.DataArray) -> str:
    """Return the label of a scalar coordinate: its name as printed, or "name = number unit"."""
    value = coordinate.item()
    if isinstance(value, str):
        return _VALUE_LABELS.get(value, style.damping_label(value))
    name, unit = name_and_unit(coordinate)
    return f"{name} = {value:g} {unit}".strip()


def curve_styles(coordinate: xr.DataArray, colours: dict | None = None) -> dict[Any, dict]:
    """Return a dict of `Axes.plot` options (colour, dashes, label) for each coordinate value.

    `colours` maps some coordinate values to colours; the others take those of the palette.
    """
    given_colours = colours or {}
    return {
        value.item(): {
            "color": given_colours.get(value.item(), colour),
            "linestyle": dashes,
            "label": value_label(value),
        }
        for value, colour, dashes in zip(
            coordinate, cycle(style.PALETTE), cycle(_DASHES), strict=False
        )
    }


def plain_ticks(axis: Axis):
    """Label the ticks of a logarithmic axis, of a few decades, with plain numbers such as 1.5."""
    axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def legend_entries(styles: dict[str, dict]) -> list[Line2D]:
    """Return a legend handle for each curve; `styles` maps curves to options of `Axes.plot`."""
    return [Line2D([], [], **options) for options in styles.values()]


def in_mesh_periods(dataset: xr.Dataset, name="phase") -> xr.Dataset:
    """Return a dataset with its phase coordinate `name` converted from rad to mesh periods."""
    periods = dataset[name] / (2.0 * np.pi)
    return dataset.assign_coords({name: periods.assign_attrs(long_name="mesh periods", units="1")})


def in_unit(variable: xr.DataArray, size: float, unit: str) -> xr.DataArray:
    """Return a variable divided by `size`, with `unit` as the name of its new unit."""
    return (variable / size).assign_attrs(variable.attrs | {"units": unit})


def draw_curves(
    axes: Axes, data: xr.Dataset, x: str, y: str, *, colour=None, line=None, styles=None, **options
) -> list[Line2D]:
    """Draw the variable named `y` of a dataset over the one named `x`; return legend handles.

    There is a curve for each value of the dimensions named `colour` and `line`, which differ in
    colour and in dashes. `styles` maps values of `colour` to options of `Axes.plot`; `options`
    hold for all curves.
    """
    by_colour = {None: {"color": style.PALETTE[0]}}
    by_line = {None: {}}
    if colour is not None:
        by_colour = styles or curve_styles(data[colour])
    if line is not None:
        dashes = zip(data[line], cycle(_DASHES), strict=False)
        by_line = {
            value.item(): {"linestyle": dash, "label": value_label(value)} for value, dash in dashes
        }
    for colour_value, colour_style in by_colour.items():
        for line_value, line_style in by_line.items():
            indexers = {colour: colour_value, line: line_value}
            curve = data.sel({name: value for name, value in indexers.items() if name is not None})
            curve_style = colour_style | line_style | {"label": None} | options
            axes.plot(curve[x].values, curve[y].values, **curve_style)
    height = axes.get_window_extent().height / axes.figure.dpi
    axes.set_xlabel(axis_label(data[x]))
    axes.set_ylabel(axis_label(data[y], max(12, round(CHARACTERS_PER_INCH * height))))
    entries = [*(by_colour.values() if colour else ())]
    if line is not None:
        entries = [entry | {"linestyle": "-"} for entry in entries]
        entries += [{"color": "black"} | entry for entry in by_line.values()]
    return [Line2D([], [], **entry) for entry in entries]


def draw_panels(
    data, x, y, *, panel=None, colour=None, line=None, styles=None, figure=None
) -> np.ndarray:
    """Draw variables of a dataset over another in panels, a legend below; return the axes.

    Parameters
    ----------
    data : xarray.Dataset
    x : str
        Variable of the horizontal axes, which all panels share.
    y : str or sequence of str
        Variables of the vertical axes: a row of panels for each.
    panel, colour, line : str, optional
        Dimensions of which each value has its column of panels, its colour, its dashes.
    styles : dict, optional
        Options of `Axes.plot` by value of `colour`, instead of those of `curve_styles`.
    figure : matplotlib.figure.Figure or SubFigure, optional
        Where they are drawn; a new page by default.

    Returns
    -------
    numpy.ndarray of matplotlib.axes.Axes
        Shape (number of y, number of panels).
    """
    rows = [y] if isinstance(y, str) else list(y)
    selections = [data] if panel is None else [data.sel({panel: v}) for v in data[panel].values]
    figure = figure or style.page(ROW_HEIGHT * len(rows) + LEGEND_HEIGHT)
    grid = figure.subplots(len(rows), len(selections), squeeze=False, sharex=True, sharey="row")
    for column, selected in zip(grid.T, selections, strict=True):
        for axes, name in zip(column, rows, strict=True):
            entries = draw_curves(axes, selected, x, name, colour=colour, line=line, styles=styles)
            axes.label_outer()
        if panel is not None:
            column[0].set_title(value_label(selected[panel]))
    # Matplotlib labels lines that have no label with a leading underscore.
    entries = [entry for entry in entries if not str(entry.get_label()).startswith("_")]
    if entries:
        style.legend(figure, entries, min(len(entries), 4))
    return grid

"""Panels of curves of a dataset, told by the names of its variables and dimensions.

Labels, units and legends are those of the attributes of the dataset.
"""

import re
import textwrap
from itertools import cycle

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from gearlib.figures import style

ROW_HEIGHT, LEGEND_HEIGHT = 1.8, 0.7
#: Characters of a label that fit along an inch of an axis.
CHARACTERS_PER_INCH = 15

_UNITS = {"1": "", "min-1": "rpm", "degree": "degrees"}
_WORDS = {
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


def name_and_unit(variable):
    """Return the long name of a variable, up to a comma or colon, and its unit as printed."""
    name = variable.attrs.get("long_name", str(variable.name).replace("_", " "))
    name = re.sub(rf"\b(d?)({'|'.join(_GREEK)})\b", lambda m: m[1] + _GREEK[m[2]], name)
    unit = variable.attrs.get("units", "1")
    return re.split("[,:]", name)[0], _UNITS.get(unit, re.sub(r" (\w+)-1$", r"/\1", unit))


def axis_label(variable, width=None):
    """Return the label "name (unit)" of an axis, broken into lines of `width` characters."""
    name, unit = name_and_unit(variable)
    text = f"{name} ({unit})" if unit else name
    return textwrap.fill(text, width) if width else text


def value_label(coordinate):
    """Return the words for the one value of a coordinate: a name, or a number with its unit."""
    value = coordinate.item()
    if isinstance(value, str):
        return _WORDS.get(value, style.damping_label(value))
    name, unit = name_and_unit(coordinate)
    return f"{name} = {value:g} {unit}".strip()


def curve_styles(coordinate, colours=None):
    """Return value -> options of `Axes.plot` that tell the curves of these values apart.

    `colours`, by value, replace those of the palette.
    """
    chosen = colours or {}
    return {
        value.item(): {
            "color": chosen.get(value.item(), colour),
            "linestyle": dashes,
            "label": value_label(value),
        }
        for value, colour, dashes in zip(
            coordinate, cycle(style.PALETTE), cycle(_DASHES), strict=False
        )
    }


def plain_ticks(axis):
    """Write plain numbers at the ticks of a logarithmic axis over few decades."""
    axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def legend_entries(styles):
    """Return the entries of a legend for options of `Axes.plot`."""
    return [Line2D([], [], **look) for look in styles.values()]


def in_mesh_periods(dataset, name="phase"):
    """Return a dataset whose mesh phase is counted in mesh periods."""
    periods = dataset[name] / (2.0 * np.pi)
    return dataset.assign_coords({name: periods.assign_attrs(long_name="mesh periods", units="1")})


def in_unit(variable, size, unit):
    """Return a variable in a unit of this size, named in its attributes."""
    return (variable / size).assign_attrs(variable.attrs | {"units": unit})


def draw_curves(axes, data, x, y, *, colour=None, line=None, styles=None, **options):
    """Draw one variable of a dataset over another; return the entries of the legend.

    Each value of the dimension `colour` has its colour, each of the dimension `line` its dashes.
    `styles` are options of `Axes.plot` by value of `colour`; `options` are those of all curves.
    """
    by_colour = {None: {"color": style.PALETTE[0]}}
    by_line = {None: {}}
    if colour is not None:
        by_colour = styles or curve_styles(data[colour])
    if line is not None:
        dashes = zip(data[line], cycle(_DASHES), strict=False)
        by_line = {v.item(): {"linestyle": d, "label": value_label(v)} for v, d in dashes}
    for colour_value, colour_style in by_colour.items():
        for line_value, line_style in by_line.items():
            chosen = {colour: colour_value, line: line_value}
            curve = data.sel({name: value for name, value in chosen.items() if name is not None})
            look = colour_style | line_style | {"label": None}
            axes.plot(curve[x].values, curve[y].values, **look | options)
    height = axes.get_window_extent().height / axes.figure.dpi
    axes.set_xlabel(axis_label(data[x]))
    axes.set_ylabel(axis_label(data[y], max(12, round(CHARACTERS_PER_INCH * height))))
    entries = [*(by_colour.values() if colour else ())]
    if line is not None:
        entries = [entry | {"linestyle": "-"} for entry in entries]
        entries += [{"color": "black"} | entry for entry in by_line.values()]
    return [Line2D([], [], **entry) for entry in entries]


def draw_panels(data, x, y, *, panel=None, colour=None, line=None, styles=None, figure=None):
    """Draw variables of a dataset over another in panels above a common legend; return the axes.

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
    columns = [data] if panel is None else [data.sel({panel: v}) for v in data[panel].values]
    figure = figure or style.page(ROW_HEIGHT * len(rows) + LEGEND_HEIGHT)
    grid = figure.subplots(len(rows), len(columns), squeeze=False, sharex=True, sharey="row")
    for column, part in zip(grid.T, columns, strict=True):
        for axes, name in zip(column, rows, strict=True):
            entries = draw_curves(axes, part, x, name, colour=colour, line=line, styles=styles)
            axes.label_outer()
        if panel is not None:
            column[0].set_title(value_label(part[panel]))
    entries = [entry for entry in entries if not entry.get_label().startswith("_")]
    if entries:
        style.legend(figure, entries, min(len(entries), 4))
    return grid

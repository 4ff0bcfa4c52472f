"""Curves of datasets for `gearlib.plot`: their names, their looks, and their scales in SI units."""

import json
from dataclasses import dataclass
from itertools import product

import xarray as xr
from matplotlib.axes import Axes

from gearlib.data.variables import SI_SCALES
from gearlib.figures import panels, style

#: Dimensions of which each value is a curve.
CURVE_DIMENSIONS = ("case", "damping", "direction", "mesh")
#: Directions of a sweep: their names, and the dashes and markers of those that carry their state.
DIRECTIONS = {"cold": "from rest", "up": "tuning going up", "down": "tuning going down"}
CARRIED = {"up": ("-", ">"), "down": ((0, (3, 1)), "<")}


@dataclass(frozen=True)
class Curve:
    """One curve of a picture: its data, its name in the legend and its look."""

    data: xr.Dataset
    label: str
    look: style.Look


def require(caller, dataset, names, maker, dimension=None):
    """Raise ValueError unless a dataset has these variables, over the dimension if it is given."""
    known = getattr(dataset, "variables", {})
    missing = [
        name for name in names if name not in known or dimension not in (None, *known[name].dims)
    ]
    if missing:
        over = f" over {dimension}" if dimension else ""
        raise ValueError(
            f"{missing[0]}{over} is missing: gearlib.plot.{caller} draws datasets of "
            f"gearlib.{maker}"
        )


def curves(caller, datasets, labels, names, maker, dimension):
    """Return the `Curve` list of datasets that hold these variables over a dimension."""
    for dataset in datasets or [None]:
        require(caller, dataset, names, maker, dimension)
    if labels is not None and len(labels) != len(datasets):
        raise ValueError(
            f"labels = {labels!r} is not allowed: they must be {len(datasets)}, one for each "
            "dataset"
        )
    data, properties = [], []
    for i, dataset in enumerate(datasets):
        origin = _origin(dataset) if labels is None else {"label": labels[i]}
        dims = [dim for dim in CURVE_DIMENSIONS if dim in dataset[names[0]].dims]
        for values in product(*(dataset[dim].values for dim in dims)):
            data.append(dataset.sel(dict(zip(dims, values, strict=True))))
            properties.append(origin | dict(zip(dims, map(str, values), strict=True)))
    differing = {
        name
        for name in dict.fromkeys(name for one in properties for name in one)
        if name == "label" or len({one.get(name) for one in properties}) > 1
    }
    distinct = [{n: v for n, v in one.items() if n in differing} for one in properties]
    return [*map(Curve, data, map(_label, distinct), _looks(distinct))]


def _origin(dataset):
    """Return what tells a dataset from others without labels: its damping and its direction."""
    parameters = json.loads(dataset.attrs.get("parameters", "{}"))
    origin = {name: parameters[name] for name in ("direction",) if name in parameters}
    if "damping" in dataset.coords and not dataset.damping.ndim:
        origin["damping"] = str(dataset.damping.item())
    return origin


def _label(properties):
    """Return the name of a curve in the legend, by the properties that tell it from others."""
    names = [
        DIRECTIONS.get(value, value) if name == "direction" else style.damping_label(value)
        for name, value in properties.items()
    ]
    return ", ".join(names)


def _looks(properties):
    """Return a `style.Look` for each curve: directions have their dashes, all else has colours."""
    keys = [tuple(v for n, v in one.items() if n != "direction") for one in properties]
    if len({*keys}) == 1:
        keys = [tuple(one.values()) for one in properties]
    looks = style.looks(list(dict.fromkeys(keys)))
    for key, one in zip(keys, properties, strict=True):
        carried = CARRIED.get(one.get("direction"), (looks[key].line, looks[key].marker))
        yield style.Look(looks[key].colour, *carried)


def axes_or_new(axes):
    """Return axes, or those of a new figure of pyplot if there are none."""
    from matplotlib import pyplot

    if axes is None:
        return pyplot.figure(figsize=(5.4, 3.6), layout="constrained").add_subplot()
    if not isinstance(axes, Axes):
        raise ValueError(
            f"axes = {axes!r} is not allowed: it must be axes of matplotlib, such as "
            "those of pyplot.figure().add_subplot(), or None"
        )
    return axes


def common_scalar(curves, name):
    """Return the value of a scalar that all curves share, else None."""
    values = {curve.data[name].item() if name in curve.data else None for curve in curves}
    return values.pop() if len(values) == 1 else None


def in_si(curves):
    """Return whether all curves have one scale to SI units; pairs given by ratios have none."""
    return common_scalar(curves, "static_deflection") not in (None, 1.0)


def add_si_scale(axes, curves, variable, side):
    """Add a second scale in SI units on the "top" or "right" side, if the curves share one."""
    name = SI_SCALES.get(variable, "")
    factor = common_scalar(curves, name)
    if factor is None or not in_si(curves):
        return
    _, unit = panels.name_and_unit(curves[0].data[name])
    if unit == "m":
        size, unit = style.length_unit(factor)
        factor /= size
    style.second_scale(axes, factor, f"{variable.replace('_', ' ')} ({unit})", side)


def shade_backlash(axes, curves, direction):
    """Shade the backlash along the axis of the displacement, "x" or "y", if all curves share it."""
    backlash = common_scalar(curves, "backlash_ratio")
    if backlash is not None:
        limits = axes.axis()
        style.shade_areas(axes, backlash, direction)
        axes.axis(limits)


def add_legend(axes):
    """Add a legend if curves have names; return the axes."""
    if any(axes.get_legend_handles_labels()[1]):
        axes.legend()
    return axes

"""Curves of datasets for `gearlib.plot`: their names, their looks, and their scales in SI units."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import xarray as xr
from matplotlib.axes import Axes

from gearlib.data.variables import SI_SCALES
from gearlib.figures import panels, style

#: Dimensions of which each value is a curve.
CURVE_DIMENSIONS = ("case", "damping", "direction", "mesh")
#: Directions of a sweep: their labels, and the dashes and markers of warm-started ones.
DIRECTIONS = {"cold": "from rest", "up": "tuning going up", "down": "tuning going down"}
CARRIED = {"up": ("-", ">"), "down": ((0, (3, 1)), "<")}


@dataclass(frozen=True)
class Curve:
    """One curve of a picture: its data, its name in the legend and its look."""

    data: xr.Dataset
    label: str
    look: style.Look


def require(caller: str, dataset: xr.Dataset | None, names: tuple, maker: str, dimension=None):
    """Raise ValueError unless a dataset has the variables `names`, over `dimension` if given.

    The message names `gearlib.plot.<caller>`, which draws, and `gearlib.<maker>`, which computes.
    """
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


def curves(caller, datasets: Sequence, labels, names, maker, dimension) -> list[Curve]:
    """Return a `Curve` (data, label, look) for each curve in datasets.

    The variables `names` must have `dimension`; a damping, direction, mesh or case is a curve.
    `labels`, one per dataset, or None, start the legend labels. `caller` and `maker` are the
    functions of `gearlib.plot` and `gearlib` that error messages name.
    """
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
    # A property that all curves share does not tell them apart.
    differing = {
        name
        for name in {name for curve in properties for name in curve}
        if name == "label" or len({curve.get(name) for curve in properties}) > 1
    }
    distinct = [{n: v for n, v in curve.items() if n in differing} for curve in properties]
    return [*map(Curve, data, map(_label, distinct), _looks(distinct))]


def _origin(dataset: xr.Dataset) -> dict[str, str]:
    """Return the direction and the damping of a dataset, for its legend label, where known."""
    parameters = json.loads(dataset.attrs.get("parameters", "{}"))
    origin = {"direction": parameters["direction"]} if "direction" in parameters else {}
    if "damping" in dataset.coords and not dataset.damping.ndim:
        origin["damping"] = str(dataset.damping.item())
    return origin


def _label(properties: dict[str, str]) -> str:
    """Return the legend label of a curve from its properties (label, damping, direction, ...)."""
    names = [
        DIRECTIONS.get(value, value) if name == "direction" else style.damping_label(value)
        for name, value in properties.items()
    ]
    return ", ".join(names)


def _looks(properties: list[dict[str, str]]) -> Iterator[style.Look]:
    """Yield each curve's look: sweep directions differ in dashes, other properties in colour."""
    colour_keys = [tuple(v for n, v in curve.items() if n != "direction") for curve in properties]
    if len({*colour_keys}) == 1:
        colour_keys = [tuple(curve.values()) for curve in properties]
    looks = style.looks(list(dict.fromkeys(colour_keys)))
    for colour_key, curve in zip(colour_keys, properties, strict=True):
        look = looks[colour_key]
        line, marker = CARRIED.get(curve.get("direction"), (look.line, look.marker))
        yield style.Look(look.colour, line, marker)


def axes_or_new(axes: Axes | None) -> Axes:
    """Return `axes`, or the axes of a new pyplot figure if it is None."""
    from matplotlib import pyplot

    if axes is None:
        return pyplot.figure(figsize=(5.4, 3.6), layout="constrained").add_subplot()
    if not isinstance(axes, Axes):
        raise ValueError(
            f"axes = {axes!r} is not allowed: it must be axes of matplotlib, such as "
            "those of pyplot.figure().add_subplot(), or None"
        )
    return axes


def common_scalar(curves: list[Curve], name: str) -> float | None:
    """Return the scalar variable `name` if all curves have the same value of it, else None."""
    values = {curve.data[name].item() if name in curve.data else None for curve in curves}
    return values.pop() if len(values) == 1 else None


def in_si(curves: list[Curve]) -> bool:
    """Return whether all curves share a static deflection in m; models given by ratios have 1."""
    return common_scalar(curves, "static_deflection") not in (None, 1.0)


def add_si_scale(axes: Axes, curves: list[Curve], variable: str, side: str):
    """Add a scale in SI units for `variable` on the "top" or "right" side, if all curves agree."""
    name = SI_SCALES.get(variable, "")
    factor = common_scalar(curves, name)
    if factor is None or not in_si(curves):
        return
    _, unit = panels.name_and_unit(curves[0].data[name])
    if unit == "m":
        size, unit = style.length_unit(factor)
        factor /= size
    style.second_scale(axes, factor, f"{variable.replace('_', ' ')} ({unit})", side)


def shade_backlash(axes: Axes, curves: list[Curve], direction: str):
    """Shade the backlash area if all curves share one; `direction` is the displacement's axis."""
    backlash = common_scalar(curves, "backlash_ratio")
    if backlash is not None:
        limits = axes.axis()
        style.shade_areas(axes, backlash, direction)
        axes.axis(limits)


def add_legend(axes: Axes) -> Axes:
    """Add a legend to axes if any curve has a label; return the axes."""
    if any(axes.get_legend_handles_labels()[1]):
        axes.legend()
    return axes

"""Curves of datasets for `gearlib.plot`: labels, styles, and secondary axes in SI units."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import xarray as xr
from matplotlib.axes import Axes

from gearlib import checks
from gearlib.data.variables import SI_SCALES
from gearlib.figures import panels, style
from gearlib.figures.style import CurveStyle

#: Dimensions whose values each get a curve.
CURVE_DIMENSIONS = ("case", "damping", "direction", "mesh")
#: Direction of a sweep -> its label; direction of a warm-started sweep -> (line style, marker).
DIRECTION_LABELS = {"cold": "from rest", "up": "tuning going up", "down": "tuning going down"}
WARM_STARTED_STYLES = {"up": ("-", ">"), "down": ((0, (3, 1)), "<")}


@dataclass(frozen=True)
class Curve:
    """A curve of a plot: its data, legend label and style."""

    data: xr.Dataset
    label: str
    style: CurveStyle


def require_variables(caller: str, dataset: xr.Dataset | None, names: tuple, source: str, dim=None):
    """Raise ValueError unless a dataset has the variables `names`, each over the dimension `dim`.

    If `dim` is None, any dimensions are allowed. The message names `gearlib.plot.<caller>`, the
    function that draws, and `gearlib.<source>`, the function that computes such datasets.
    """
    variables = getattr(dataset, "variables", {})
    for name in names:
        has_variable = checks.is_one_of(name, variables)
        if not has_variable or dim not in (None, *variables[name].dims):
            over = f" over {dim}" if dim else ""
            raise ValueError(
                f"{name}{over} is missing: gearlib.plot.{caller} draws datasets of gearlib.{source}"
            )


def create_curves(datasets: Sequence, labels, names, *, dim, caller, source) -> list[Curve]:
    """Create a `Curve` (data, label, style) for each damping, direction, mesh and case of datasets.

    Each dataset must have the variables `names` over the dimension `dim`. `labels` contains a
    prefix of the legend labels for each dataset; None means direction and damping. Properties that
    all curves have in common are omitted. Error messages name `caller`, a function of
    `gearlib.plot`, and `source`, a function of `gearlib`.
    """
    # If there are no datasets, pass None to raise an error that names the missing variable.
    for dataset in datasets or [None]:
        require_variables(caller, dataset, names, source, dim)
    if labels is not None:
        allowed = f"{len(datasets)} strings, one for each dataset"
        texts = [text for text in checks.check_sequence("labels", labels) if isinstance(text, str)]
        checks.require(len(texts) == len(labels) == len(datasets), "labels", labels, allowed)
    data, properties = [], []
    for i, dataset in enumerate(datasets):
        common = _sweep_properties(dataset) if labels is None else {"label": labels[i]}
        dims = [dim for dim in CURVE_DIMENSIONS if dim in dataset[names[0]].dims]
        for values in product(*(dataset[dim].values for dim in dims)):
            data.append(dataset.sel(dict(zip(dims, values, strict=True))))
            properties.append(common | dict(zip(dims, map(str, values), strict=True)))
    all_names = {name for curve in properties for name in curve}
    # Properties with the same value for all curves do not affect labels and styles.
    constant_names = {
        name
        for name in all_names - {"label"}
        if len({curve.get(name) for curve in properties}) == 1
    }
    varying = [
        {name: value for name, value in curve.items() if name not in constant_names}
        for curve in properties
    ]
    return [*map(Curve, data, map(_legend_label, varying), _curve_styles(varying))]


def _sweep_properties(dataset: xr.Dataset) -> dict[str, str]:
    """Return the direction and the damping of a sweep as a dict, if the dataset contains them.

    The direction is an argument of the run, stored as JSON in the attribute "parameters".
    """
    parameters = json.loads(dataset.attrs.get("parameters", "{}"))
    properties = {}
    if "direction" in parameters:
        properties["direction"] = parameters["direction"]
    if "damping" in dataset.coords and not dataset.damping.ndim:
        properties["damping"] = str(dataset.damping.item())
    return properties


def _legend_label(properties: dict[str, str]) -> str:
    """Join the properties of a curve (damping, direction etc.) to a legend label."""
    if properties.get("direction") in DIRECTION_LABELS:
        properties = properties | {"direction": DIRECTION_LABELS[properties["direction"]]}
    return ", ".join(map(style.typeset_dampings, properties.values()))


def _curve_styles(properties: list[dict[str, str]]) -> Iterator[CurveStyle]:
    """Yield a style for each curve: directions differ in line style, other properties in colour.

    `properties` contains a dict for each curve, e.g. {"damping": "k1", "direction": "up"}. If
    curves only differ in direction, the directions also differ in colour.
    """
    colour_keys = []
    for curve in properties:
        colour_keys.append(tuple(curve[name] for name in curve if name != "direction"))
    if len({*colour_keys}) == 1:
        # Only the directions differ.
        colour_keys = [tuple(curve.values()) for curve in properties]
    styles = style.curve_styles(list(dict.fromkeys(colour_keys)))
    for colour_key, curve in zip(colour_keys, properties, strict=True):
        default_style = styles[colour_key]
        line_style, marker = default_style.line_style, default_style.marker
        if curve.get("direction") in WARM_STARTED_STYLES:
            line_style, marker = WARM_STARTED_STYLES[curve["direction"]]
        yield CurveStyle(default_style.colour, line_style, marker)


def get_axes(axes: Axes | None) -> Axes:
    """Return `axes`, or the axes of a new pyplot figure if it is None.

    Raise an `InputError` if `axes` are not matplotlib axes.
    """
    from matplotlib import pyplot

    if axes is None:
        return pyplot.figure(figsize=(5.4, 3.6), layout="constrained").add_subplot()
    allowed = "matplotlib axes, such as pyplot.figure().add_subplot(), or None"
    checks.require(isinstance(axes, Axes), "axes", axes, allowed)
    return axes


def common_scalar(curves: list[Curve], name: str) -> float | None:
    """Return the value of a scalar variable if it is the same for all curves, else None."""
    values = {curve.data[name].item() if name in curve.data else None for curve in curves}
    return values.pop() if len(values) == 1 else None


def have_si_units(curves: list[Curve]) -> bool:
    """Return whether all curves have the same static deflection in m, which scales displacements.

    Models defined by ratios have no unit of length; their static deflection is stored as 1.
    """
    return common_scalar(curves, "static_deflection") not in (None, 1.0)


def add_si_axis(axes: Axes, curves: list[Curve], variable: str, side: str):
    """Add a secondary axis in SI units for a dimensionless variable, at the "top" or "right".

    `SI_SCALES` contains the names of the scale factors. Nothing is added unless the factor is
    known and the same for all curves.
    """
    name = SI_SCALES.get(variable, "")
    factor = common_scalar(curves, name)
    if factor is None or not have_si_units(curves):
        return
    _, unit = panels.name_and_unit(curves[0].data[name])
    if unit == "m":
        unit_size, unit = style.length_unit(factor)
        factor /= unit_size
    style.add_secondary_axis(axes, factor, f"{variable.replace('_', ' ')} ({unit})", side)


def shade_lost_contact(axes: Axes, curves: list[Curve], direction: str):
    """Shade the displacements without drive-side contact if all curves have the same backlash.

    `direction` is the displacement axis, "x" or "y". The axis limits do not change.
    """
    backlash = common_scalar(curves, "backlash_ratio")
    if backlash is not None:
        axis_limits = axes.axis()
        style.shade_lost_contact(axes, backlash, direction)
        axes.axis(axis_limits)


def add_legend(axes: Axes) -> Axes:
    """Add a legend to axes if any curve has a label; return the axes."""
    if any(axes.get_legend_handles_labels()[1]):
        axes.legend()
    return axes

"""Axes, curves of datasets, legends and second scales of the pictures of `gearlib.plot`."""

import json
from itertools import product

from gearlib.figures import resonance_figure, style

#: Variable of a time course -> what stands at its axis, its scale to SI and the unit of that.
COURSES = {
    "displacement": ("displacement $y$ (static deflections)", "static_deflection", "m"),
    "velocity": ("velocity $dy/d\\tau$ (static deflections/rad)", "velocity_scale", "m/s"),
    "dynamic_force": ("mesh force over load (1)", "force_scale", "N"),
    "stiffness": ("mesh stiffness over its mean (1)", "stiffness_scale", "N/m"),
}
#: Dimensions of which each entry is a curve, and those along one.
_MANY = ("case", "damping", "direction", "mesh")


def axes(axes):
    """Return axes to draw in, and whether they are new."""
    from matplotlib import pyplot
    from matplotlib.axes import Axes

    if axes is not None and not isinstance(axes, Axes):
        raise ValueError(
            f"axes = {axes!r} is not allowed: it must be axes of matplotlib, such as "
            "those of pyplot.figure().add_subplot(), or None"
        )
    if axes is not None:
        return axes, False

    with style.styled():
        return pyplot.figure(figsize=(5.4, 3.6), layout="constrained").add_subplot(), True


def need(call, data, names, maker):
    missing = [name for name in names if name not in getattr(data, "variables", ())]
    if missing:
        raise ValueError(
            f"{missing[0]} is missing: gearlib.plot.{call} draws datasets of gearlib.{maker}"
        )


def parts(call, datasets, labels, names, maker):
    """Return (label, where, dataset) of each curve; `where` chooses it among those of its dataset.

    Labels tell what differs.
    """
    for one in datasets or [None]:
        need(call, one, names, maker)
    if labels is not None and len(labels) != len(datasets):
        raise ValueError(
            f"labels = {labels!r} is not allowed: they must be {len(datasets)}, one for each "
            "dataset"
        )
    found = []
    for i, data in enumerate(datasets):
        own = [dim for dim in _MANY if dim in data[names[0]].dims]
        for values in product(*(data[dim].values for dim in own)):
            where = dict(zip(own, map(str, values), strict=True))
            one = data.sel(dict(zip(own, values, strict=True)))
            said = {name: str(one[name].item()) for name in ("damping",) if name in one.coords}
            given = json.loads(data.attrs.get("parameters", "{}"))
            if "direction" in given:
                said["direction"] = given["direction"]
            said |= where
            if labels is not None:
                said["label"] = labels[i]
            found.append((said, where, one))
    differing = {
        name
        for said, _, _ in found
        for name in said
        if len({other.get(name) for other, _, _ in found}) > 1 or name == "label"
    }
    if labels is not None:
        differing -= {"damping", "direction"} - {d for _, where, _ in found for d in where}
    return [({n: said[n] for n in said if n in differing}, *rest) for said, *rest in found]


def looks(parts, of_direction=None):
    """Yield (words of the legend, `style.Look`): a colour for each but the direction.

    Where only that differs, it has the colours.
    """
    keys = [
        tuple(value for name, value in said.items() if name != "direction") for said, _, _ in parts
    ]
    alone = len({*keys}) == 1
    if alone:
        keys = [tuple(said.values()) for said, _, _ in parts]
    looks = style.looks(list(dict.fromkeys(keys)))
    for key, (said, _, _) in zip(keys, parts, strict=True):
        look = looks[key]
        if of_direction and said.get("direction") in of_direction:
            look = style.Look(look.colour, *of_direction[said["direction"]])
        words = [
            resonance_figure.DIRECTIONS.get(value, value)
            if name == "direction"
            else style.damping_label(value)
            for name, value in said.items()
        ]
        yield ", ".join(words), look


def scale(parts, name):
    """Return a scalar that all have alike, else None; scales of one are those of bare ratios."""
    values = {float(one[name]) for _, _, one in parts if name in one and not one[name].ndim}
    if len(values) != 1 or not all(name in one for _, _, one in parts):
        return None
    value = values.pop()
    return None if name == "static_deflection" and value == 1.0 else value


def shade(axes, parts, direction):
    """Shade the backlash, if it is that of all."""
    backlash = scale(parts, "backlash_ratio")
    if backlash is not None:
        limits = axes.get_xlim() if direction == "x" else axes.get_ylim()
        style.shade_areas(axes, backlash, direction)
        (axes.set_xlim if direction == "x" else axes.set_ylim)(limits)


def second(axes, direction, rate, label):
    """Add a second scale above or on the right."""
    place = {"x": "top", "y": "right"}[direction]
    add = getattr(axes, f"secondary_{direction}axis")
    scale = add(place, functions=(lambda value: value * rate, lambda value: value / rate))
    getattr(scale, f"set_{direction}label")(label)


def length(axes, direction, parts, words):
    """Add a scale in a unit of length, where there is one."""
    deflection = scale(parts, "static_deflection")
    if deflection is not None:
        unit, name = style.length_unit(deflection)
        second(axes, direction, deflection / unit, f"{words} ({name})")


def course_scale(axes, parts, variable):
    """Add the scale in SI units of a variable of a time course."""
    if variable == "displacement":
        length(axes, "y", parts, variable)
    elif variable in COURSES and scale(parts, "static_deflection") is not None:
        _, name, unit = COURSES[variable]
        rate = scale(parts, name)
        if rate is not None:
            second(axes, "y", rate, f"{variable.replace('_', ' ')} ({unit})")


def words(variable):
    """Return what stands at the axis of a variable: its name in words and its unit."""
    unit = variable.attrs.get("units", "1")
    return f"{variable.attrs.get('long_name', variable.name)} ({unit})"


def finish(axes, own):
    """Explain the curves that have labels."""
    if any(axes.get_legend_handles_labels()[1]):
        axes.legend()
    return axes

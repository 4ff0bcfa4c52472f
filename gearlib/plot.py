"""One call for each of the usual pictures of a dataset: `resonance`, `phase_plane` and the like.

All draw into ``axes``, or into those of a new figure of pyplot, and return them, so that
``axes.figure.savefig("curve.png")`` writes the picture. Look and code are those of the workflow's
figures. Second scales are in SI units where the gears have them: a pair by its ratios has none.
"""

import json
import math
from itertools import cycle, product

import numpy as np

from gearlib.analysis.orbits.shooting import Orbit
from gearlib.figures import (
    branches_figure,
    campbell_figure,
    harris_map_figure,
    resonance_figure,
    style,
    time_courses_figure,
)
from gearlib.runs.simulation import simulate

__all__ = ["campbell", "harris_map", "orbit", "phase_plane", "resonance", "time_course"]

_EXTREMA = ("displacement_max", "displacement_min")
#: Variable of a time course -> what stands at its axis, its scale to SI and the unit of that.
_COURSES = {
    "displacement": ("displacement $y$ (static deflections)", "static_deflection", "m"),
    "velocity": ("velocity $dy/d\\tau$ (static deflections/rad)", "velocity_scale", "m/s"),
    "dynamic_force": ("mesh force over load (1)", "force_scale", "N"),
    "stiffness": ("mesh stiffness over its mean (1)", "stiffness_scale", "N/m"),
}
#: Dimensions of which each entry is a curve, and those along one.
_MANY = ("case", "damping", "direction", "mesh")


def resonance(*curves, axes=None, labels=None, variable=None):
    """Draw resonance characteristics: lines where the motion repeats, dots where it does not.

    Parameters
    ----------
    *curves : xarray.Dataset
        Of `gearlib.sweep`, as many as shall be compared; over damping and direction as well, as the
        workflow has them, each is a curve.
    axes : matplotlib.axes.Axes, optional
    labels : sequence of str, optional
        Of the datasets; by default damping, direction and mesh, as far as these differ.
    variable : str, optional
        Any over the tuning; by default the largest and smallest displacement, of a gear train
        the dynamic factor of each mesh.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset has no such variable over the tuning.
    """
    train = any("mesh" in one.dims for one in curves)
    names = (variable,) if variable else ("dynamic_factor",) if train else _EXTREMA
    parts = _parts("resonance", curves, labels, (*names, "tuning", "period"), "sweep")
    axes, own = _axes(axes)
    limits = [resonance_figure.displacement_limits(one, names) for _, _, one in parts]
    axes.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
    tunings = [one.tuning.values[[0, -1]] for _, _, one in parts]
    axes.set_xlim(np.min(tunings), np.max(tunings) + (0.0 if np.ptp(tunings) else 0.01))
    if names == _EXTREMA:
        _shade(axes, parts, "y")
    groups = [group for group, _, _ in parts]
    for number, (label, look) in enumerate(_looks(parts, resonance_figure.CARRIED)):
        one = parts[number][2].sortby("tuning")
        resonance_figure.draw_sweep(axes, one, look, number / len(groups), names=names)
        axes.plot([], [], color=look.colour, ls=look.line, marker=look.marker, ms=3.5, label=label)
    axes.set_xlabel(style.OWN_TUNING)
    first = parts[0][2]
    axes.set_ylabel("displacement $y_\\mathrm{max}$, $y_\\mathrm{min}$\n(static deflections)")
    if names != _EXTREMA:
        axes.set_ylabel(_words(first[names[0]]))
    speeds = {float(one.speed[-1] / one.tuning[-1]) for _, _, one in parts if "speed" in one}
    if len(speeds) == 1 and _scale(parts, "static_deflection") is not None:
        _second(axes, "x", speeds.pop(), "speed (rpm)")
    if names[0] in _EXTREMA:
        _length(axes, "y", parts, "displacement")
    return _finish(axes, own)


def phase_plane(*runs, axes=None, labels=None):
    """Draw velocities over displacements; orbits that repeat are closed.

    Parameters
    ----------
    *runs : xarray.Dataset
        Of `gearlib.simulate`; each mesh, case or damping in them is a curve.
    axes : matplotlib.axes.Axes, optional
    labels : sequence of str, optional
        Of the datasets.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset has no time course.
    """
    parts = _parts("phase_plane", runs, labels, ("displacement", "velocity"), "simulate")
    axes, own = _axes(axes)
    for (label, look), (_, _, one) in zip(_looks(parts), parts, strict=True):
        x, v = one.displacement.values, one.velocity.values
        if int(one.period) > 0:
            # The record holds whole orbits: its end is its start.
            x, v = np.append(x, x[0]), np.append(v, v[0])
        axes.plot(x, v, color=look.colour, linestyle=look.line, label=label)
    axes.set_xlim(axes.get_xlim())
    # With moving bearings the far flank is no line in this plane.
    if not any("backlash" in one for one in runs):
        _shade(axes, parts, "x")
    axes.set_xlabel(_COURSES["displacement"][0])
    axes.set_ylabel(_COURSES["velocity"][0])
    _length(axes, "x", parts, "displacement")
    _course_scale(axes, parts, "velocity")
    return _finish(axes, own)


def time_course(*runs, axes=None, labels=None, variable="displacement"):
    """Draw a variable over the mesh periods, with each gain and loss of contact.

    Of one curve the times in the backlash are shaded. A tick of its colour on a curve is where the
    contact changes.

    Parameters
    ----------
    *runs : xarray.Dataset
        Of `gearlib.simulate`; each mesh, case or damping in them is a curve.
    axes : matplotlib.axes.Axes, optional
    labels : sequence of str, optional
        Of the datasets.
    variable : str
        Any over the phase, such as velocity, dynamic_force, stiffness.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset has no such variable over the phase.
    """
    parts = _parts("time_course", runs, labels, (variable, "phase"), "simulate")
    axes, own = _axes(axes)
    for (label, look), (_, at, one) in zip(_looks(parts), parts, strict=True):
        turns = one.phase.values / math.tau
        axes.plot(turns, one[variable].values, color=look.colour, ls=look.line, label=label)
        if "event_phase" in one:
            here = one.event_phase.values
            if "mesh" in at and "event_mesh" in one:
                here = here[one.event_mesh.values == at["mesh"]]
            height = np.interp(here / math.tau, turns, one[variable].values)
            style.dots(axes, here / math.tau, height, "|", look.colour, 7.0, zorder=3)
    if len(parts) == 1 and "contact" in parts[0][2]:
        time_courses_figure.shade_contact(axes, turns, parts[0][2].contact.values)
    axes.set_xlim(turns[0], turns[-1])
    axes.set_xlabel("mesh periods")
    axes.set_ylabel(_COURSES.get(variable, [_words(parts[0][2][variable])])[0])
    frequency = _scale(parts, "mesh_frequency")
    if frequency is not None and _scale(parts, "static_deflection") is not None:
        _second(axes, "x", 1e3 * math.tau / frequency, "time (ms)")
    _course_scale(axes, parts, variable)
    return _finish(axes, own)


def campbell(diagram, *, axes=None, to=None):
    """Draw the natural frequencies of a train and the mesh frequencies over the speed.

    Dots are intersections at which the meshes excite the mode, circles those at which not.

    Parameters
    ----------
    diagram : xarray.Dataset
        Of `GearTrain.campbell`.
    axes : matplotlib.axes.Axes, optional
    to : float, optional
        Where the picture ends, rpm; by default beyond the last intersection of the first order.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the dataset is no Campbell diagram of one order or more.
    """
    _need("campbell", diagram, ("critical_speed", "excites"), "GearTrain.campbell")
    if not diagram.critical_speed.size:
        raise ValueError("the diagram has no order of a mesh frequency: it must have one or more")
    axes, own = _axes(axes)
    end = 1.02 * float(diagram.critical_speed.max()) if to is None else float(to)
    if not 0.0 < end < math.inf:
        raise ValueError(f"to = {to!r} is not allowed: it must be a finite number > 0, in rpm")
    campbell_figure.draw_orders(axes, diagram, end)
    handles = campbell_figure.entries(diagram)
    axes.legend(handles=handles, fontsize=6.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return axes


def harris_map(errors, *, axes=None):
    """Draw the static transmission error over two mesh periods, a curve for each torque.

    Parameters
    ----------
    errors : xarray.Dataset
        Of `gearlib.geometry.Mesh.transmission_error`; the torque, in N m, is beside its curve.
    axes : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the dataset has no transmission error over torque and phase.
    """
    _need("harris_map", errors, ("transmission_error", "torque"), "geometry.Mesh")
    if errors.transmission_error.ndim != 2:
        raise ValueError(
            f"transmission_error over {errors.transmission_error.dims} is not allowed: it must be "
            "over torque and phase; choose one of the others by `sel`"
        )
    axes, own = _axes(axes)
    design = float(errors.get("design_torque", math.nan))
    data = errors.transpose("torque", "phase", ...)
    harris_map_figure.draw_courses(axes, data, data.torque.values, design)
    axes.set_ylabel(harris_map_figure.ERROR)
    axes.set_title("torque of the pinion in N m beside its curve")
    return axes


def orbit(*orbits, axes=None, labels=None):
    """Draw periodic orbits in the phase plane, or branches of them over their parameter.

    Parameters
    ----------
    *orbits : Orbit or xarray.Dataset
        Of `gearlib.periodic_orbit`: stable ones are solid, unstable ones dashed. Or of
        `gearlib.continue_orbit`: largest and smallest displacement, solid where stable, with
        folds, period doublings and grazings marked.
    axes : matplotlib.axes.Axes, optional
    labels : sequence of str, optional
        Of orbits; by default their periods.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If it is neither, or both.
    """
    if orbits and all(isinstance(one, Orbit) for one in orbits):
        words = labels or [
            f"{'stable' if one.stable else 'unstable'}, {one.period} mesh periods" for one in orbits
        ]
        runs = [_course_of(one) for one in orbits]
        axes = phase_plane(*runs, axes=axes, labels=words)
        each = len(axes.lines) // len(orbits)
        for i, line in enumerate(axes.lines):
            line.set_linestyle("-" if orbits[i // each].stable else style.DASHED)
        if labels or len(orbits) > 1 or each == 1:
            axes.legend()
        return axes
    for one in orbits or [None]:
        _need("orbit", one, ("displacement_max", "stable", "label"), "continue_orbit")
    axes, own = _axes(axes)
    found = set()
    for one, colour in zip(orbits, cycle(style.PALETTE), strict=False):
        name = one.attrs.get("parameter", "tuning")
        branch = one.rename({name: "tuning"}) if name != "tuning" else one
        if "branch" not in one:
            branch = branch.assign(branch=("point", np.zeros(one.sizes["point"], int)))
        for variable in _EXTREMA:
            branches_figure.draw_curve(axes, branch, variable, colour)
            x, y = branch.tuning.values, branch[variable].values
            found |= {*branches_figure.draw_special_points(axes, x, y, one.label.values)}
    axes.set_xlabel(style.OWN_TUNING if name == "tuning" else name.replace("_", " "))
    axes.set_ylabel("displacement $y_\\mathrm{max}$, $y_\\mathrm{min}$\n(static deflections)")
    handles = [style.entry("stable orbit"), style.entry("unstable orbit", line=style.DASHED)]
    axes.legend(handles=[*handles, *map(branches_figure.special_entry, sorted(found))])
    return axes


def _course_of(one):
    """Return the time course of an orbit over one of its periods."""
    counts = {"periods": one.period, "record_periods": one.period}
    run = simulate(one.pair, one.tuning, initial_state=tuple(one.state), **counts)
    # Of an unstable one rounding may grow: what was shot is the orbit.
    return run.assign(period=one.period)


def _axes(axes):
    """Return axes to draw in, and whether they are new."""
    if axes is not None:
        return axes, False
    from matplotlib import pyplot

    with style.styled():
        return pyplot.figure(figsize=(5.4, 3.6), layout="constrained").add_subplot(), True


def _need(call, data, names, maker):
    missing = [name for name in names if name not in getattr(data, "variables", ())]
    if missing:
        raise ValueError(
            f"{missing[0]} is missing: gearlib.plot.{call} draws datasets of gearlib.{maker}"
        )


def _parts(call, datasets, labels, names, maker):
    """Return (label, where, dataset) of each curve; `where` chooses it among those of its dataset.

    Labels tell what differs.
    """
    for one in datasets or [None]:
        _need(call, one, names, maker)
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


def _looks(parts, of_direction=None):
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


def _scale(parts, name):
    """Return a scalar that all have alike, else None; scales of one are those of bare ratios."""
    values = {float(one[name]) for _, _, one in parts if name in one and not one[name].ndim}
    if len(values) != 1 or not all(name in one for _, _, one in parts):
        return None
    value = values.pop()
    return None if name == "static_deflection" and value == 1.0 else value


def _shade(axes, parts, direction):
    """Shade the backlash, if it is that of all."""
    backlash = _scale(parts, "backlash_ratio")
    if backlash is not None:
        limits = axes.get_xlim() if direction == "x" else axes.get_ylim()
        style.shade_areas(axes, backlash, direction)
        (axes.set_xlim if direction == "x" else axes.set_ylim)(limits)


def _second(axes, direction, rate, label):
    """Add a second scale above or on the right."""
    place = {"x": "top", "y": "right"}[direction]
    add = getattr(axes, f"secondary_{direction}axis")
    scale = add(place, functions=(lambda value: value * rate, lambda value: value / rate))
    getattr(scale, f"set_{direction}label")(label)


def _length(axes, direction, parts, words):
    """Add a scale in a unit of length, where there is one."""
    deflection = _scale(parts, "static_deflection")
    if deflection is not None:
        unit, name = style.length_unit(deflection)
        _second(axes, direction, deflection / unit, f"{words} ({name})")


def _course_scale(axes, parts, variable):
    """Add the scale in SI units of a variable of a time course."""
    if variable == "displacement":
        _length(axes, "y", parts, variable)
    elif variable in _COURSES and _scale(parts, "static_deflection") is not None:
        _, name, unit = _COURSES[variable]
        rate = _scale(parts, name)
        if rate is not None:
            _second(axes, "y", rate, f"{variable.replace('_', ' ')} ({unit})")


def _words(variable):
    """Return what stands at the axis of a variable: its name in words and its unit."""
    unit = variable.attrs.get("units", "1")
    return f"{variable.attrs.get('long_name', variable.name)} ({unit})"


def _finish(axes, own):
    """Explain the curves that have labels."""
    if any(axes.get_legend_handles_labels()[1]):
        axes.legend()
    return axes

"""One call for each of the usual pictures of a dataset: `resonance`, `phase_plane` and the like.

All draw into ``axes``, or into those of a new figure of pyplot, and return them, so that
``axes.figure.savefig("curve.png")`` writes the picture. Look and code are those of the workflow's
figures. Second scales are in SI units where the gears have them: a pair by its ratios has none.
"""

import math
from itertools import cycle

import numpy as np

from gearlib.analysis.orbits.shooting import Orbit
from gearlib.figures import (
    branches_figure,
    campbell_figure,
    harris_map_figure,
    phase_planes_figure,
    plot_curves,
    resonance_figure,
    style,
    time_courses_figure,
)
from gearlib.figures import schematic as train_schematic
from gearlib.figures.fit_figure import fit
from gearlib.figures.order_map_figure import order_map
from gearlib.figures.orders_figure import orders
from gearlib.figures.run_up_figure import run_up
from gearlib.runs.simulation import simulate

__all__ = [
    "campbell",
    "fit",
    "harris_map",
    "orbit",
    "order_map",
    "orders",
    "phase_plane",
    "resonance",
    "run_up",
    "schematic",
    "time_course",
    "values",
]

_EXTREMA = ("displacement_max", "displacement_min")


@style.styled()
def resonance(*sweeps, axes=None, labels=None, variable=None):
    """Draw resonance characteristics: lines where the motion repeats, dots where it does not.

    Parameters
    ----------
    *sweeps : xarray.Dataset
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
    for one in sweeps:
        if "tuning" not in getattr(one, "dims", ()):
            raise ValueError(
                "tuning has one value: gearlib.plot.resonance draws datasets of gearlib.sweep"
            )
    train = any("mesh" in one.dims for one in sweeps)
    names = (variable,) if variable else ("dynamic_factor",) if train else _EXTREMA
    parts = plot_curves.parts("resonance", sweeps, labels, (*names, "tuning", "period"), "sweep")
    axes, own = plot_curves.axes(axes)
    ends = [end for _, _, one in parts for end in resonance_figure.extent(one, names)]
    axes.set_ylim(style.limits(ends))
    tunings = [one.tuning.values[[0, -1]] for _, _, one in parts]
    axes.set_xlim(np.min(tunings), np.max(tunings) + (0.0 if np.ptp(tunings) else 0.01))
    if names == _EXTREMA:
        plot_curves.shade(axes, parts, "y")
    groups = [group for group, _, _ in parts]
    for number, (label, look) in enumerate(plot_curves.looks(parts, resonance_figure.CARRIED)):
        one = parts[number][2].sortby("tuning")
        shift = number / len(groups)
        marks = look.colour, look.line, look.marker
        resonance_figure.draw_sweep(axes, one, *marks, shift, names=names)
        axes.plot([], [], color=look.colour, ls=look.line, marker=look.marker, ms=3.5, label=label)
    axes.set_xlabel(style.OWN_TUNING)
    first = parts[0][2]
    axes.set_ylabel("displacement $y_\\mathrm{max}$, $y_\\mathrm{min}$\n(static deflections)")
    if names != _EXTREMA:
        axes.set_ylabel(plot_curves.words(first[names[0]]))
    speeds = {float(one.speed[-1] / one.tuning[-1]) for _, _, one in parts if "speed" in one}
    if len(speeds) == 1 and plot_curves.scale(parts, "static_deflection") is not None:
        plot_curves.second(axes, "x", speeds.pop(), "speed (rpm)")
    if names[0] in _EXTREMA:
        plot_curves.length(axes, "y", parts, "displacement")
    return plot_curves.finish(axes, own)


@style.styled()
def phase_plane(*runs, axes=None, labels=None):
    """Draw velocities over displacements; orbits that repeat, in whole records, are closed.

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
    parts = plot_curves.parts("phase_plane", runs, labels, ("displacement", "velocity"), "simulate")
    axes, own = plot_curves.axes(axes)
    for (label, look), (_, _, one) in zip(plot_curves.looks(parts), parts, strict=True):
        x, v = phase_planes_figure.orbit_of(one)
        axes.plot(x, v, color=look.colour, linestyle=look.line, label=label)
    axes.set_xlim(axes.get_xlim())
    # With moving bearings the far flank is no line in this plane.
    if not any("backlash" in one for one in runs):
        plot_curves.shade(axes, parts, "x")
    axes.set_xlabel(plot_curves.COURSES["displacement"][0])
    axes.set_ylabel(plot_curves.COURSES["velocity"][0])
    plot_curves.length(axes, "x", parts, "displacement")
    plot_curves.course_scale(axes, parts, "velocity")
    return plot_curves.finish(axes, own)


@style.styled()
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
    parts = plot_curves.parts("time_course", runs, labels, (variable, "phase"), "simulate")
    axes, own = plot_curves.axes(axes)
    for (label, look), (_, at, one) in zip(plot_curves.looks(parts), parts, strict=True):
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
    axes.set_ylabel(
        plot_curves.COURSES.get(variable, [plot_curves.words(parts[0][2][variable])])[0]
    )
    frequency = plot_curves.scale(parts, "mesh_frequency")
    if frequency is not None and plot_curves.scale(parts, "static_deflection") is not None:
        plot_curves.second(axes, "x", 1e3 * math.tau / frequency, "time (ms)")
    plot_curves.course_scale(axes, parts, variable)
    return plot_curves.finish(axes, own)


@style.styled()
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
    plot_curves.need("campbell", diagram, ("critical_speed", "excites"), "GearTrain.campbell")
    if not diagram.critical_speed.size:
        raise ValueError("the diagram has no order of a mesh frequency: it must have one or more")
    axes, own = plot_curves.axes(axes)
    end = 1.02 * float(diagram.critical_speed.max()) if to is None else float(to)
    if not 0.0 < end < math.inf:
        raise ValueError(f"to = {to!r} is not allowed: it must be a finite number > 0, in rpm")
    campbell_figure.draw_orders(axes, diagram, end)
    handles = campbell_figure.entries(diagram)
    axes.legend(handles=handles, fontsize=6.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return axes


@style.styled()
def schematic(train, *, run=None, phase=None, axes=None):
    """Draw a train seen along its axes: pitch circles, shafts, carriers, and its meshes by name.

    Meshes have the colours of their curves in `resonance` and `time_course`.

    Parameters
    ----------
    train : gearlib.GearTrain
    run : xarray.Dataset, optional
        Of `gearlib.simulate`, or `GearTrain.static`: meshes that are out of contact at this phase
        are open, those whose far flanks touch are diamonds.
    phase : float, optional
        Of the reference mesh, rad, by which the train has turned; by default that at which the
        record of the run begins, 0 without one.
    axes : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If it is no train, the run is not one of its meshes, or the phase lies beside its record.
    """
    try:
        layout = train.layout()
    except AttributeError:
        words = f"train = {train!r} is not allowed: it must be a gearlib.GearTrain"
        raise ValueError(words) from None
    if run is not None:
        plot_curves.need("schematic", run, ("contact", "status"), "simulate")
    phase, contact = train_schematic.at(layout, run, phase)
    axes, own = plot_curves.axes(axes)
    train_schematic.draw(axes, layout, None, phase, contact)
    axes.set_title("\n".join(train_schematic.words(layout, contact)))
    return axes


@style.styled()
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
    plot_curves.need("harris_map", errors, ("transmission_error", "torque"), "geometry.Mesh")
    if errors.transmission_error.ndim != 2:
        raise ValueError(
            f"transmission_error over {errors.transmission_error.dims} is not allowed: it must be "
            "over torque and phase; choose one of the others by `sel`"
        )
    axes, own = plot_curves.axes(axes)
    design = float(errors.get("design_torque", math.nan))
    data = errors.transpose("torque", "phase", ...)
    harris_map_figure.draw_courses(axes, data, data.torque.values, design)
    axes.set_ylabel(harris_map_figure.ERROR)
    axes.set_title("torque of the pinion in N m beside its curve")
    return axes


@style.styled()
def values(data, *names, axes=None):
    """Draw variables over their last dimension, a mark for each entry, as tables hold them.

    Parameters
    ----------
    data : xarray.Dataset
        Such as of `GearTrain.modes` or `GearTrain.static`; each entry of other dimensions has marks
        of its own.
    *names : str
        Variables of one unit.
    axes : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If no name is given, or the dataset has no such variable over a dimension.
    """
    plot_curves.need("values", data, names or ("names",), "GearTrain.modes and others")
    for name in names:
        if not data[name].ndim:
            raise ValueError(f"{name} is not allowed: it must be a variable over a dimension")
    axes, _ = plot_curves.axes(axes)
    over, drawn = data[names[0]].dims[-1], []
    for name in names:
        others = data[name].dims[:-1]
        for place in np.ndindex(*data[name].shape[:-1]):
            row = data[name].isel(dict(zip(others, place, strict=True)))
            words = [name.replace("_", " ")] * (len(names) > 1)
            words += [f"{row[dim].item():g}" for dim in others]
            drawn.append((" ".join(words), row.values))
    for look, (words, row) in zip(style.looks(range(len(drawn))).values(), drawn, strict=True):
        axes.plot(row, look.marker, color=look.colour, ms=4, label=words)
    entries = [str(entry) for entry in data[over].values]
    few = slice(None, None, -(-len(entries) // 12))
    tilted = {"rotation": 30, "ha": "right"} if max(map(len, entries)) > 5 else {}
    axes.set_xticks(range(len(entries))[few], entries[few], **tilted)
    axes.set_xlabel(over.replace("_", " "))
    unit = data[names[0]].attrs.get("units", "1")
    axes.set_ylabel(f"{', '.join(names).replace('_', ' ')} ({unit})")
    axes.set_ylim(style.limits([row for _, row in drawn]))
    if len(drawn) > 1:
        axes.legend(title=" and ".join(others).replace("_", " "))
    return axes


@style.styled()
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
        plot_curves.need("orbit", one, ("displacement_max", "stable", "label"), "continue_orbit")
    axes, own = plot_curves.axes(axes)
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

"""One call for each of the usual pictures of a dataset: `resonance`, `phase_plane` and the like.

All draw into ``axes``, or into those of a new figure of pyplot, and return them, so that
``axes.figure.savefig("curve.png")`` writes the picture. Look and code are those of the workflow's
figures. Second scales are in SI units where the gears have them: a pair by its ratios has none.
"""

import math

import numpy as np

from gearlib.analysis.orbits.shooting import Orbit
from gearlib.figures import (
    branches_figure,
    campbell_figure,
    harris_map_figure,
    panels,
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
    train = any("mesh" in sweep.dims for sweep in sweeps)
    default = ("dynamic_factor",) if train else resonance_figure.EXTREMA
    names = default if variable is None else (variable,)
    curves = plot_curves.curves("resonance", sweeps, labels, (*names, "period"), "sweep", "tuning")
    axes = plot_curves.axes_or_new(axes)
    data = [curve.data.sortby("tuning") for curve in curves]
    axes.set_ylim(style.limits(*(resonance_figure.shown_range(one, names) for one in data)))
    axes.set_xlim(style.limits(*(one.tuning for one in data), margin=0.0))
    for number, (curve, sweep) in enumerate(zip(curves, data, strict=True)):
        shift = number / len(curves)
        resonance_figure.draw_sweep(axes, sweep, curve.look, shift, names, label=curve.label)
    axes.set_xlabel(style.OWN_TUNING)
    axes.set_ylabel(panels.axis_label(data[0][names[0]], 45))
    speeds = {float(one.speed[-1] / one.tuning[-1]) for one in data if "speed" in one}
    if len(speeds) == 1 and plot_curves.in_si(curves):
        style.second_scale(axes, speeds.pop(), panels.axis_label(data[0].speed))
    if names == resonance_figure.EXTREMA:
        axes.set_ylabel(resonance_figure.EXTREMA_LABEL)
        plot_curves.shade_backlash(axes, curves, "y")
        plot_curves.add_si_scale(axes, curves, "displacement", "right")
    return plot_curves.add_legend(axes)


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
    names = ("displacement", "velocity")
    curves = plot_curves.curves("phase_plane", runs, labels, names, "simulate", "phase")
    axes = plot_curves.axes_or_new(axes)
    for curve in curves:
        orbit = phase_planes_figure.closed_orbit(curve.data)
        line = curve.look.line
        if "stable" in curve.data:
            line = "-" if curve.data.stable else style.DASHED
        axes.plot(*orbit, color=curve.look.colour, linestyle=line, label=curve.label)
    # With moving bearings the far flank is no line in this plane.
    if not any("backlash" in run for run in runs):
        plot_curves.shade_backlash(axes, curves, "x")
    for name, direction, side in zip(names, "xy", ("top", "right"), strict=True):
        axes.set(**{f"{direction}label": panels.axis_label(curves[0].data[name], 50)})
        plot_curves.add_si_scale(axes, curves, name, side)
    return plot_curves.add_legend(axes)


@style.styled()
def time_course(*runs, axes=None, labels=None, variable="displacement"):
    """Draw a variable over the mesh periods, with each gain and loss of contact.

    The times in the backlash are shaded if there is only one curve. A tick on the curve of a pair
    is where the contact changes.

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
    curves = plot_curves.curves("time_course", runs, labels, (variable,), "simulate", "phase")
    axes = plot_curves.axes_or_new(axes)
    ends = []
    for curve in curves:
        run = panels.in_mesh_periods(curve.data)
        periods, heights = run.phase.values, run[variable].values
        look = {"color": curve.look.colour, "linestyle": curve.look.line}
        axes.plot(periods, heights, label=curve.label, **look)
        ends += [periods[0], periods[-1]]
        if "event_phase" in run and "mesh" not in run.coords:
            events = run.event_phase.values / math.tau
            at = np.interp(events, periods, heights)
            style.dots(axes, events, at, "|", curve.look.colour, 7.0, zorder=3)
    if len(curves) == 1 and "contact" in run:
        time_courses_figure.shade_contact(axes, periods, run.contact.values)
    axes.set_xlim(min(ends), max(ends))
    axes.set_xlabel(panels.axis_label(run.phase))
    axes.set_ylabel(panels.axis_label(run[variable], 45))
    frequency = plot_curves.common_scalar(curves, "mesh_frequency")
    if frequency is not None and plot_curves.in_si(curves):
        style.second_scale(axes, 1e3 * math.tau / frequency, "time (ms)")
    plot_curves.add_si_scale(axes, curves, variable, "right")
    return plot_curves.add_legend(axes)


@style.styled()
def run_up(*runs, axes=None, labels=None, variable="dynamic_force_max"):
    """Draw a variable of the revolutions of run-ups over their speed; dotted where it falls.

    Parameters
    ----------
    *runs : xarray.Dataset
        Of `gearlib.run_up`; each mesh of a train is a colour.
    axes : matplotlib.axes.Axes, optional
    labels : sequence of str, optional
        Of the datasets.
    variable : str
        Any over ``revolution``: extrema of displacement and dynamic_force, mean_force, bounces,
        fraction_normal.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset is no run-up, or has no such variable.
    """
    names = (variable, "revolution_speed")
    curves = plot_curves.curves("run_up", runs, labels, names, "run_up", "revolution")
    axes = plot_curves.axes_or_new(axes)
    variables = [curve.data[variable] for curve in curves]
    size, unit = style.readable_unit(variables[0].units, *variables)
    for curve, heights in zip(curves, variables, strict=True):
        speed = curve.data.revolution_speed.values
        # The last revolution goes on as the one before it.
        falls = np.diff(speed, prepend=2.0 * speed[0] - speed[1]) < 0.0
        look = {"color": curve.look.colour, "label": curve.label}
        style.draw_rise_and_fall(axes, speed, heights.values / size, falls, **look)
    axes.set_xlabel("speed (rpm)")
    axes.set_ylabel(panels.axis_label(panels.in_unit(variables[0], size, unit), 45))
    return plot_curves.add_legend(axes)


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
    plot_curves.require("campbell", diagram, ("critical_speed", "excites"), "GearTrain.campbell")
    if not diagram.critical_speed.size:
        raise ValueError("the diagram has no order of a mesh frequency: it must have one or more")
    axes = plot_curves.axes_or_new(axes)
    end = 1.02 * float(diagram.critical_speed.max()) if to is None else float(to)
    if not 0.0 < end < math.inf:
        raise ValueError(f"to = {to!r} is not allowed: it must be a finite number > 0, in rpm")
    handles = campbell_figure.draw_orders(axes, diagram, end)
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
        message = f"train = {train!r} is not allowed: it must be a gearlib.GearTrain"
        raise ValueError(message) from None
    if run is not None:
        plot_curves.require("schematic", run, ("contact", "status"), "simulate")
    phase, contact = train_schematic.instant_of_run(layout, run, phase)
    axes = plot_curves.axes_or_new(axes)
    train_schematic.draw(axes, layout, None, phase, contact)
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
    plot_curves.require("harris_map", errors, ("transmission_error", "torque"), "geometry.Mesh")
    if errors.transmission_error.ndim != 2:
        raise ValueError(
            f"transmission_error over {errors.transmission_error.dims} is not allowed: it must be "
            "over torque and phase; choose one of the others by `sel`"
        )
    axes = plot_curves.axes_or_new(axes)
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
    plot_curves.require("values", data, names or ("names",), "GearTrain.modes and others")
    for name in names:
        if not data[name].ndim:
            raise ValueError(f"{name} is not allowed: it must be a variable over a dimension")
    axes = plot_curves.axes_or_new(axes)
    *others, over = data[names[0]].dims
    rows = {}
    for name in names:
        prefix = [panels.name_and_unit(data[name])[0]] * (len(names) > 1)
        for place in np.ndindex(*data[name].shape[:-1]):
            row = data[name].isel(dict(zip(others, place, strict=True)))
            rows[" ".join([*prefix, *(f"{row[dim].item():g}" for dim in others)])] = row
    for label, look in style.looks(rows).items():
        axes.plot(rows[label], look.marker, color=look.colour, ms=4, label=label)
    ticks = [str(value) for value in data[over].values]
    shown = slice(None, None, -(-len(ticks) // 12))
    tilted = {"rotation": 30, "ha": "right"} if max(map(len, ticks)) > 5 else {}
    axes.set_xticks(range(len(ticks))[shown], ticks[shown], **tilted)
    axes.set_xlabel(over.replace("_", " "))
    label = panels.axis_label(data[names[0]], 45)
    axes.set_ylabel(label if len(names) == 1 else ", ".join(names).replace("_", " "))
    axes.set_ylim(style.limits(*rows.values()))
    if len(rows) > 1:
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
    if orbits and all(isinstance(orbit, Orbit) for orbit in orbits):
        periods = [
            f"{'stable' if orbit.stable else 'unstable'}, {orbit.period} mesh periods"
            for orbit in orbits
        ]
        return phase_plane(*map(_time_course_of, orbits), axes=axes, labels=labels or periods)
    names = ("displacement_max", "stable", "label")
    curves = plot_curves.curves("orbit", orbits, labels, names, "continue_orbit", "point")
    axes = plot_curves.axes_or_new(axes)
    parameter = orbits[0].attrs.get("parameter", "tuning")
    for curve in curves:
        points = curve.data.rename({parameter: "tuning"} if parameter != "tuning" else {})
        if "branch" not in points:
            points = points.assign(branch=0 * points.label)
        for name in resonance_figure.EXTREMA:
            branches_figure.draw_curve(axes, points, name, curve.look.colour)
            branches_figure.draw_special_points(axes, points.tuning, points[name], points.label)
    axes.set_xlabel(panels.axis_label(orbits[0][parameter]))
    axes.set_ylabel(resonance_figure.EXTREMA_LABEL)
    codes = np.concatenate([branch.label for branch in orbits])
    axes.legend(handles=branches_figure.entries(codes))
    return axes


def _time_course_of(orbit):
    """Return the run of an orbit over one of its periods, and whether it is stable."""
    counts = {"periods": orbit.period, "record_periods": orbit.period}
    run = simulate(orbit.pair, orbit.tuning, initial_state=tuple(orbit.state), **counts)
    # Rounding may grow along an unstable orbit, so that the run does not find its period.
    return run.assign(period=orbit.period, stable=bool(orbit.stable))

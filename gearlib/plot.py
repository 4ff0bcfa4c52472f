"""Functions that plot datasets: `resonance`, `phase_plane`, `time_course` and others.

All functions plot on ``axes``, by default those of a new pyplot figure, and return them, so that
``axes.figure.savefig("curve.png")`` saves the plot. The figures of the workflow use the same style
and code. Secondary axes are in SI units; gear pairs defined by ratios have none.
"""

import math

import numpy as np
import xarray as xr

from gearlib import checks, parameters
from gearlib.analysis.orbits.shooting import Orbit
from gearlib.data import motions
from gearlib.figures import (
    branches_figure,
    gear_geometry_figure,
    gearbox_figure,
    motions_figure,
    panels,
    plot_curves,
    resonance_figure,
    style,
    trains_figure,
)
from gearlib.figures import schematic as train_schematic
from gearlib.figures.measured_figure import fit
from gearlib.figures.orders_figure import order_map, orders
from gearlib.parameters import Speed
from gearlib.runs.simulation import simulate

__all__ = [
    "campbell",
    "fit",
    "gearbox",
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


@style.rc_context()
def resonance(*sweeps, axes=None, labels=None, variable=None):
    """Plot resonance curves, with lines for periodic motions and markers for all others.

    They show the amplitude of the motion over the tuning (mesh frequency / natural frequency).

    Parameters
    ----------
    *sweeps : xarray.Dataset
        Datasets returned by `gearlib.sweep`, or results of the workflow with a curve for each
        damping and direction.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.
    labels : sequence of str, optional
        Legend label of each dataset; by default damping, direction and mesh where they differ.
    variable : str, optional
        Name of a variable over the tuning; by default the largest and smallest displacement or, for
        a gear train, the ratio of the largest to the static force of each mesh.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset has no such variable over the tuning.
    """
    is_train = any("mesh" in getattr(sweep, "dims", ()) for sweep in sweeps)
    names = (variable,) if variable else resonance_figure.EXTREMA
    if is_train and variable is None:
        names = ("dynamic_factor" if "dynamic_factor" in sweeps[0] else "peak_force_ratio",)
    # Error messages name the plotting function and the function that computes the datasets.
    sources = {"dim": "tuning", "caller": "resonance", "source": "sweep"}
    curves = plot_curves.create_curves(sweeps, labels, (*names, "period"), **sources)
    axes = plot_curves.get_axes(axes)
    sorted_sweeps = [curve.data.sortby("tuning") for curve in curves]
    ranges = [resonance_figure.visible_range(sweep, names) for sweep in sorted_sweeps]
    axes.set_ylim(style.axis_limits(*ranges))
    axes.set_xlim(style.axis_limits(*(sweep.tuning for sweep in sorted_sweeps), margin=0.0))
    for number, (curve, sweep) in enumerate(zip(curves, sorted_sweeps, strict=True)):
        # The markers of each curve are shifted along the line, so that equal curves stay visible.
        marker_shift = number / len(curves)
        resonance_figure.draw_sweep(
            axes, sweep, curve.style, marker_shift, names, label=curve.label
        )
    axes.set_xlabel(style.OWN_TUNING_LABEL)
    axes.set_ylabel(panels.axis_label(sorted_sweeps[0][names[0]], width=45))
    # A secondary speed axis is added if the ratio of speed to tuning is the same for all curves.
    speed_ratios = {float(s.speed[-1] / s.tuning[-1]) for s in sorted_sweeps if "speed" in s}
    if len(speed_ratios) == 1 and plot_curves.have_si_units(curves):
        style.add_secondary_axis(
            axes, speed_ratios.pop(), panels.axis_label(sorted_sweeps[0].speed)
        )
    if names == resonance_figure.EXTREMA:
        axes.set_ylabel(resonance_figure.EXTREMA_LABEL)
        plot_curves.shade_lost_contact(axes, curves, "y")
        plot_curves.add_si_axis(axes, curves, "displacement", "right")
    return plot_curves.add_legend(axes)


@style.rc_context()
def phase_plane(*runs, axes=None, labels=None):
    """Plot velocities over displacements; a periodic motion is a closed curve.

    Curves of unstable orbits are dashed. Displacements without drive-side contact are shaded.

    Parameters
    ----------
    *runs : xarray.Dataset
        Datasets returned by `gearlib.simulate`; each mesh, case or damping has its own curve.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.
    labels : sequence of str, optional
        Legend label of each dataset.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset has no time history.
    """
    names = ("displacement", "velocity")
    # Error messages name the plotting function and the function that computes the datasets.
    sources = {"dim": "phase", "caller": "phase_plane", "source": "simulate"}
    curves = plot_curves.create_curves(runs, labels, names, **sources)
    axes = plot_curves.get_axes(axes)
    for curve in curves:
        displacements, velocities = motions_figure.closed_orbit(curve.data)
        line = curve.style.line_style
        if "stable" in curve.data:
            line = "-" if curve.data.stable else style.DASHED
        options = {"color": curve.style.colour, "linestyle": line}
        axes.plot(displacements, velocities, label=curve.label, **options)
    # With elastic bearings the backlash varies and has no fixed limit in this plane.
    if not any("coast_line" in run for run in runs):
        plot_curves.shade_lost_contact(axes, curves, "x")
    displacement, velocity = curves[0].data.displacement, curves[0].data.velocity
    axes.set_xlabel(panels.axis_label(displacement, width=50))
    plot_curves.add_si_axis(axes, curves, "displacement", "top")
    axes.set_ylabel(panels.axis_label(velocity, width=50))
    plot_curves.add_si_axis(axes, curves, "velocity", "right")
    return plot_curves.add_legend(axes)


@style.rc_context()
def time_course(*runs, axes=None, labels=None, variable="displacement"):
    """Plot a variable over the mesh periods, with contact changes.

    If there is only one curve, intervals of contact loss are shaded. Ticks on the curve of a gear
    pair mark contact events (gain or loss of contact).

    Parameters
    ----------
    *runs : xarray.Dataset
        Datasets returned by `gearlib.simulate`; each mesh, case or damping has its own curve.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.
    labels : sequence of str, optional
        Legend label of each dataset.
    variable : str
        Name of a variable over the phase, e.g. velocity, dynamic_force or stiffness.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset has no such variable over the phase.
    """
    # Error messages name the plotting function and the function that computes the datasets.
    sources = {"dim": "phase", "caller": "time_course", "source": "simulate"}
    curves = plot_curves.create_curves(runs, labels, (variable,), **sources)
    axes = plot_curves.get_axes(axes)
    period_limits = []
    for curve in curves:
        run = panels.phase_to_mesh_periods(curve.data)
        periods, values = run.phase.values, run[variable].values
        options = {"color": curve.style.colour, "linestyle": curve.style.line_style}
        axes.plot(periods, values, label=curve.label, **options)
        period_limits += [periods[0], periods[-1]]
        if "event_phase" in run and "mesh" not in run.coords:
            events = run.event_phase.values / math.tau
            event_values = np.interp(events, periods, values)
            style.draw_markers(axes, events, event_values, "|", curve.style.colour, 7.0, zorder=3)
    # If there is only one curve, `run` and `periods` belong to it.
    if len(curves) == 1 and "contact" in run:
        motions_figure.shade_contact(axes, periods, run.contact.values)
    axes.set_xlim(min(period_limits), max(period_limits))
    axes.set_xlabel(panels.axis_label(run.phase))
    axes.set_ylabel(panels.axis_label(run[variable], width=45))
    frequency = plot_curves.common_scalar(curves, "mesh_frequency")
    if frequency is not None and plot_curves.have_si_units(curves):
        style.add_secondary_axis(axes, 1e3 * math.tau / frequency, "time (ms)")
    plot_curves.add_si_axis(axes, curves, variable, "right")
    return plot_curves.add_legend(axes)


@style.rc_context()
def run_up(*runs, axes=None, labels=None, variable=None):
    """Plot a variable of run-ups per revolution over the speed, dotted where the speed decreases.

    Parameters
    ----------
    *runs : xarray.Dataset
        Datasets returned by `gearlib.run_up`; each mesh of a train has its own colour.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.
    labels : sequence of str, optional
        Legend label of each dataset.
    variable : str, optional
        Name of a variable over ``revolution``: extrema of displacement and dynamic_force,
        mean_force, bounces, fraction_drive. By default the largest magnitude of the dynamic force.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset is not a run-up, or has no such variable.
    """
    names = (variable,) if variable else ("dynamic_force_max", "dynamic_force_min")
    # Error messages name the plotting function and the function that computes the datasets.
    sources = {"dim": "revolution", "caller": "run_up", "source": "run_up"}
    curves = plot_curves.create_curves(runs, labels, (*names, "revolution_speed"), **sources)
    axes = plot_curves.get_axes(axes)
    variables = [
        curve.data[variable] if variable else motions.largest_force(curve.data) for curve in curves
    ]
    unit_size, unit = style.readable_unit(variables[0].units, *variables)
    for curve, values in zip(curves, variables, strict=True):
        speed = curve.data.revolution_speed.values
        # The first revolution has no predecessor, so `prepend` repeats the speed change after it.
        is_falling = np.diff(speed, prepend=2.0 * speed[0] - speed[1]) < 0.0
        options = {"color": curve.style.colour, "label": curve.label}
        style.draw_solid_and_dotted(axes, speed, values.values / unit_size, is_falling, **options)
    axes.set_xlabel("speed (rpm)")
    axes.set_ylabel(panels.axis_label(panels.convert_unit(variables[0], unit_size, unit), width=45))
    return plot_curves.add_legend(axes)


@style.rc_context()
def campbell(diagram, *, axes=None, to=None):
    """Plot a Campbell diagram, the natural and mesh frequencies of a train over the speed.

    Dots mark intersections at which the meshes excite the natural mode, circles all others.

    Parameters
    ----------
    diagram : xarray.Dataset
        Dataset returned by `GearTrain.campbell`.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.
    to : float, optional
        Upper limit of the speed axis in rpm; by default just above the last intersection.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the dataset is not a Campbell diagram, or has no mesh frequency.
    """
    plot_curves.require_variables(
        "campbell", diagram, ("critical_speed", "excites"), "GearTrain.campbell"
    )
    if not diagram.critical_speed.size:
        raise ValueError("the diagram has no mesh frequency: it must have at least one")
    axes = plot_curves.get_axes(axes)
    to = 1.02 * float(diagram.critical_speed.max()) if to is None else to
    max_speed = parameters.check("to", to, Speed)
    handles = trains_figure.draw_orders(axes, diagram, max_speed)
    axes.legend(handles=handles, fontsize=6.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return axes


@style.rc_context()
def gearbox(box, *, axes=None):
    """Draw a side view of a gearbox to scale: shafts with sections, and gears coloured by stage.

    Parameters
    ----------
    box : gearlib.gearboxes.gearbox.Gearbox
        Gearbox returned by `gearlib.read_gearbox`.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If `box` is not a gearbox, or its file has no positions.
    """
    checks.require(hasattr(box, "outline"), "box", box, "a result of gearlib.read_gearbox")
    outline = box.outline()
    if not outline.sizes["part"]:
        raise ValueError("the gearbox cannot be drawn: its shafts must have a support_vector")
    axes = plot_curves.get_axes(axes)
    gearbox_figure.draw_outline(axes, outline)
    return axes


@style.rc_context()
def schematic(train, *, run=None, phase=None, axes=None):
    """Draw a train as seen along its axes: pitch circles, shafts, carriers and labelled meshes.

    Meshes have the same colours as their curves in `resonance` and `time_course`.

    Parameters
    ----------
    train : gearlib.GearTrain
        Gear train to draw.
    run : xarray.Dataset, optional
        Dataset returned by `gearlib.simulate` or `GearTrain.static` for this train. Meshes without
        contact at `phase` have open markers, and meshes in coast-side contact have diamonds.
    phase : float, optional
        Phase of the reference mesh in rad at which the train is drawn; by default the first
        recorded phase of the run, or 0 without a run.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If `train` is not a gear train, if the run has other meshes, or if `phase` is outside the
        recorded phases.
    """
    try:
        layout = train.layout()
    except AttributeError:
        message = f"train = {train!r} is not allowed: it must be a gearlib.GearTrain"
        raise ValueError(message) from None
    if run is not None:
        plot_curves.require_variables("schematic", run, ("contact", "status"), "simulate")
    # The call fills in the default phase; `contact` is None without a run.
    phase, contact = train_schematic.select_phase_and_contact(layout, run, phase)
    axes = plot_curves.get_axes(axes)
    train_schematic.draw_schematic(axes, layout, None, phase, contact)
    return axes


@style.rc_context()
def harris_map(errors, *, axes=None):
    """Plot a Harris map, the static transmission error over two mesh periods for each torque.

    The curve at the design torque, if the dataset has one, is thick.

    Parameters
    ----------
    errors : xarray.Dataset
        Dataset returned by `gearlib.geometry.GearStage.transmission_error`, over torque and phase;
        each curve is labelled with its torque in N m.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the dataset has no transmission error over torque and phase.
    """
    plot_curves.require_variables(
        "harris_map", errors, ("transmission_error", "torque"), "geometry.GearStage"
    )
    if errors.transmission_error.ndim != 2:
        raise ValueError(
            f"transmission_error over {errors.transmission_error.dims} is not allowed: it must be "
            "over torque and phase; use `sel` to select one value of each other dimension"
        )
    axes = plot_curves.get_axes(axes)
    design = float(errors.get("design_torque", math.nan))
    data = errors.transpose("torque", "phase", ...)
    gear_geometry_figure.draw_errors(axes, data, data.torque.values, design)
    axes.set_ylabel(gear_geometry_figure.ERROR_LABEL)
    axes.set_title("torque of the pinion in N m beside its curve")
    return axes


@style.rc_context()
def values(data, *names, axes=None):
    """Plot variables with a common unit over their last dimension, with a marker for each value.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset, e.g. a result of `GearTrain.modes` or `GearTrain.static`; each entry of the other
        dimensions has its own marker style.
    *names : str
        Names of variables with equal units and dimensions.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If no name is given, or the dataset has no such variable over a dimension.
    """
    # Without names, a variable "names" is required, so that the message is "names is missing".
    plot_curves.require_variables("values", data, names or ("names",), "GearTrain.modes and others")
    for name in names:
        if not data[name].ndim:
            raise ValueError(f"{name} is not allowed: it must be a variable over a dimension")
    axes = plot_curves.get_axes(axes)
    *other_dims, last_dim = data[names[0]].dims
    labels_of_dims = []
    for dim in other_dims:
        is_text = data[dim].dtype.kind in "OU"
        labels = data[dim].values.tolist() if is_text else style.format_numbers(data[dim])
        labels_of_dims.append(labels)
    curves = {}
    for name in names:
        prefix = [panels.name_and_unit(data[name])[0]] if len(names) > 1 else []
        for index in np.ndindex(*data[name].shape[:-1]):
            curve = data[name].isel(dict(zip(other_dims, index, strict=True)))
            labels = [texts[i] for texts, i in zip(labels_of_dims, index, strict=True)]
            curves[" ".join(prefix + labels)] = curve
    for label, curve_style in style.curve_styles(curves).items():
        axes.plot(curves[label], curve_style.marker, color=curve_style.colour, ms=4, label=label)
    tick_labels = [str(value) for value in data[last_dim].values]
    # At most 12 ticks are labelled.
    label_slice = slice(None, None, math.ceil(len(tick_labels) / 12))
    options = {"rotation": 30, "ha": "right"} if max(map(len, tick_labels)) > 5 else {}
    axes.set_xticks(range(len(tick_labels))[label_slice], tick_labels[label_slice], **options)
    axes.set_xlabel(last_dim.replace("_", " "))
    label = panels.axis_label(data[names[0]], width=45)
    axes.set_ylabel(label if len(names) == 1 else ", ".join(names).replace("_", " "))
    axes.set_ylim(style.axis_limits(*curves.values()))
    if len(curves) > 1:
        axes.legend(title=" and ".join(other_dims).replace("_", " "))
    return axes


@style.rc_context()
def orbit(*orbits, axes=None, labels=None):
    """Plot periodic orbits in the phase plane, or branches of orbits over their parameter.

    A branch is a family of orbits that varies continuously with a parameter, e.g. the tuning (mesh
    frequency / natural frequency).

    Parameters
    ----------
    *orbits : Orbit or xarray.Dataset
        Either orbits returned by `gearlib.periodic_orbit`, or branches returned by
        `gearlib.continue_orbit`. Branches are shown by their largest and smallest displacement,
        with markers at special points such as folds and period doublings. Lines are solid where
        orbits are stable and dashed where they are unstable.
    axes : matplotlib.axes.Axes, optional
        Axes to plot on; by default a new figure is created.
    labels : sequence of str, optional
        Legend label of each orbit or branch; by default stability and period of each orbit.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If orbits and datasets are mixed, or an argument is neither.
    """
    if orbits and all(isinstance(orbit, Orbit) for orbit in orbits):
        periods = [
            f"{'stable' if orbit.stable else 'unstable'}, {orbit.period} mesh periods"
            for orbit in orbits
        ]
        labels = periods if labels is None else labels
        return phase_plane(*map(_simulate_orbit, orbits), axes=axes, labels=labels)
    names = ("displacement_max", "stable", "label")
    # Error messages name the plotting function and the function that computes the datasets.
    sources = {"dim": "point", "caller": "orbit", "source": "continue_orbit"}
    curves = plot_curves.create_curves(orbits, labels, names, **sources)
    axes = plot_curves.get_axes(axes)
    parameter = orbits[0].attrs.get("parameter", "tuning")
    for curve in curves:
        # `draw_curve` requires the variables "tuning" and "branch". The parameter of a branch may
        # have another name, and a single branch has no variable "branch".
        points = curve.data.rename({parameter: "tuning"} if parameter != "tuning" else {})
        if "branch" not in points:
            points = points.assign(branch=xr.zeros_like(points.label))
        for name in resonance_figure.EXTREMA:
            branches_figure.draw_curve(axes, points, name, curve.style.colour)
            branches_figure.draw_special_points(axes, points.tuning, points[name], points.label)
    axes.set_xlabel(panels.axis_label(orbits[0][parameter]))
    axes.set_ylabel(resonance_figure.EXTREMA_LABEL)
    # The legend explains only those special points (fold, period doubling, ...) that occur.
    special_point_codes = np.concatenate([branch.label for branch in orbits])
    axes.legend(handles=branches_figure.legend_handles(special_point_codes))
    return axes


def _simulate_orbit(orbit: Orbit):
    """Simulate a periodic orbit over one period, for the phase plane.

    Return the dataset of `simulate`, with the additional variable `stable`, which selects solid or
    dashed lines.
    """
    options = {"initial_state": tuple(orbit.state), "periods": orbit.period}
    run = simulate(orbit.model, orbit.tuning, record_periods=orbit.period, **options)
    # The period is set explicitly, because the run may not detect it: rounding errors grow along an
    # unstable orbit.
    return run.assign(period=orbit.period, stable=bool(orbit.stable))

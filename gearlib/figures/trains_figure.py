"""Gear trains over speed: force ratios and contact loss of all meshes, Campbell diagrams.

Lines are medians over all initial states, shades are their range, markers show sweeps up and down.
Curves of meshes with the same motion overlap. The lowest row of panels shows the fraction of
initial states whose motion settles, and the fraction that leads to the most frequent orbit.
"""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gearlib.data.motions import FRACTION_TOLERANCE, force_ratio
from gearlib.figures import panels, schematic, style

_SWEPT_MARKERS = {"up": "^", "down": "v"}
#: Relative difference below which motions are considered equal.
SAME_MOTION_TOLERANCE = 0.01
#: Variable -> vertical position of its markers (fraction of the axes), marker, label.
_SINGLE_BRANCH_MARKERS = {
    "lost_alone_share": (0.03, "s", "contact lost in this branch only"),
    "struck_alone_share": (0.08, "x", "coast-side flank struck in this branch only"),
}
#: Height of the lowest row of panels relative to the other rows.
_SHARE_HEIGHT_RATIO = 0.35
_MARKERS_ONLY = {"line_style": "none", "markersize": 3}


@style.rc_context()
def draw_sweep(curves: xr.Dataset):
    """Return a figure of force ratios and contact loss of all meshes of a train over the speed.

    The force ratio is the largest mesh force divided by the static one. `curves` is a result of
    `gearlib.studies.trains.sweep_train`. The train is drawn beside the curves.
    """
    figure = style.page_figure(height=5.2)
    styles = _set_decreasing_widths(panels.plot_options(curves.mesh))
    colours = {mesh: options["color"] for mesh, options in styles.items()}
    remaining = schematic.draw_train(figure, curves, colours)
    rows = [(name, styles) for name in (force_ratio(curves).name, "contact_loss_fraction")]
    grid = _draw_columns(remaining, [curves], "speed", rows)
    grid[-1, 0].set_xlabel("speed of the reference pinion (rpm)")
    tuning_per_speed = float(curves.tuning[-1] / curves.speed[-1])
    style.add_secondary_axis(grid[0, 0], tuning_per_speed, style.OWN_TUNING_LABEL)
    style.add_legend(figure, panels.legend_handles(styles) + _common_legend_handles(), columns=4)
    return figure


@style.rc_context()
def draw_reducer(characteristics: xr.Dataset):
    """Return a figure of force ratios and load sharing in a reducer, with one column per case.

    The power of the reducer is split among parallel branches of two stages each. The force ratio is
    the largest mesh force divided by the static one; load sharing is the mesh force divided by its
    mean over the branches. Curves are over the tuning (mesh frequency over natural frequency); each
    branch has a colour. `characteristics` is a result of `gearlib.studies.trains.sweep_reducer`.
    """
    figure = style.page_figure(height=6.8)
    meshes, mesh_branches = characteristics.mesh.values, characteristics.mesh_branch.values
    branch_of = dict(zip(meshes, mesh_branches, strict=True))
    branch_styles = style.curve_styles(characteristics.branch.values.tolist())
    colours = {mesh: branch_styles[int(branch)].colour for mesh, branch in branch_of.items()}
    remaining = schematic.draw_train(figure, characteristics, colours, below=True)
    stage_styles = {}
    for stage in (1, 2):
        styles = {
            mesh: {"color": colours[mesh], "label": f"branch {branch_of[mesh]}, from rest"}
            for mesh in meshes[characteristics.mesh_stage.values == stage]
        }
        stage_styles[stage] = _set_decreasing_widths(styles)
    rows = [
        ("peak_force_ratio", stage_styles[1]),
        ("peak_force_ratio", stage_styles[2]),
        ("load_sharing", stage_styles[1]),
    ]
    cases = [characteristics.sel(case=case) for case in characteristics.case.values]
    grid = _draw_columns(remaining, cases, "tuning", rows)
    for axes, stage in zip(grid[:, 0], (1, 2, 1), strict=False):
        axes.set_ylabel(f"{axes.get_ylabel()}\n(stage {stage})")
    for column, case in zip(grid.T, cases, strict=True):
        _mark_single_branches(column[0], case)
        column[0].set_title(panels.value_label(case.case))
        column[-1].set_xlabel("tuning of the pair alone $\\nu$")
        speed_per_tuning = float(characteristics.speed[-1] / characteristics.tuning[-1])
        style.add_secondary_axis(column[0], speed_per_tuning, "speed of the input (rpm)")
    handles = panels.legend_handles(stage_styles[1]) + _common_legend_handles()
    for _, marker, label in _SINGLE_BRANCH_MARKERS.values():
        handles.append(style.legend_handle(label, marker=marker, **_MARKERS_ONLY))
    style.add_legend(figure, handles, columns=4, fontsize=6.5)
    return figure


def _set_decreasing_widths(styles: dict[str, dict]) -> dict[str, dict]:
    """Set decreasing line widths, so that overlapping curves remain visible; return `styles`.

    `styles` maps curves to options of `Axes.plot`, which are changed in place.
    """
    for options, width in zip(styles.values(), np.linspace(3.0, 0.8, len(styles)), strict=True):
        options |= {"linestyle": "-", "linewidth": width}
    return styles


def _common_legend_handles() -> list:
    """Return the legend handles that are common to all figures of gear trains.

    They explain the markers (sweeps up and down outside the range of all initial states), the shade
    of this range, and the lowest row of panels.
    """
    options = {"mfc": "none", **_MARKERS_ONLY}
    handles = []
    for direction, marker in _SWEPT_MARKERS.items():
        label = f"speed {direction}, if different"
        handles.append(style.legend_handle(label, marker=marker, **options))
    label = "range over all initial states"
    handles.append(Patch(color="0.6", alpha=0.4, linewidth=0, label=label))
    handles.append(Patch(color="0.8", label="fraction of initial states that settle"))
    handles.append(style.legend_handle("on one orbit", style.PALETTE[0], linewidth=0.9))
    return handles


def _draw_columns(figure: Figure, cases: list[xr.Dataset], x: str, rows: list) -> np.ndarray:
    """Draw one column of panels for each case of a gear train; return the array of axes.

    `x` is the variable on the horizontal axes, "speed" or "tuning" (mesh frequency over natural
    frequency). `rows` has a pair for each row: a variable name and a dict with the plot options of
    each mesh. An additional last row shows the fraction of initial states whose motion becomes
    periodic, and the fraction that leads to the most frequent orbit.
    """
    height_ratios = [1.0] * len(rows) + [_SHARE_HEIGHT_RATIO]
    options = {"sharex": True, "sharey": "row", "squeeze": False, "height_ratios": height_ratios}
    grid = figure.subplots(len(height_ratios), len(cases), **options)
    for column, case in zip(grid.T, cases, strict=True):
        from_rest = case.sel(direction="cold")
        for axes, (name, styles) in zip(column, rows, strict=False):
            _draw_meshes(axes, case, x, name, styles)
        fill_options = {"step": "mid", "color": "0.8", "linewidth": 0.0}
        column[-1].fill_between(from_rest[x], 0.0, from_rest.settled_share, **fill_options)
        line_options = {"where": "mid", "color": style.PALETTE[0], "linewidth": 0.9}
        column[-1].step(from_rest[x], from_rest.largest_share, **line_options)
        column[-1].set(ylabel="fraction of\ninitial states", ylim=(-0.05, 1.05), yticks=[0.0, 1.0])
        column[-1].set_xlim(from_rest[x][0], from_rest[x][-1])
        for axes in column:
            axes.label_outer()
    return grid


def _draw_meshes(axes, case: xr.Dataset, x: str, name: str, styles: dict[str, dict]):
    """Draw the variable `name` of all meshes over the variable `x`, with the range of all starts.

    Lines show motions from rest (direction "cold"), shades the range over all initial states.
    Markers show sweeps up and down outside this range. `styles` maps meshes to plot options.
    """
    from_rest = case.sel(direction="cold")
    panels.draw_curves(axes, from_rest, x, name, colour_dim="mesh", styles=styles)
    for mesh, curve_options in styles.items():
        low, high = (from_rest[f"{name}_{end}"].sel(mesh=mesh) for end in ("low", "high"))
        options = {"color": curve_options["color"], "alpha": 0.25, "linewidth": 0.0}
        axes.fill_between(from_rest[x], low, high, **options)
    for direction, marker in _SWEPT_MARKERS.items():
        values = case[name].sel(direction=direction)
        low, high = from_rest[f"{name}_low"], from_rest[f"{name}_high"]
        excess = np.maximum(values - high, low - values)
        is_outside = excess > SAME_MOTION_TOLERANCE * abs(from_rest[name])
        options = {"marker": marker, "linestyle": "none", "mfc": "none", "markersize": 2.2}
        data = case[[x]].assign({name: values.where(is_outside)})
        panels.draw_curves(axes, data, x, name, colour_dim="mesh", styles=styles, **options)
    axes.grid(linewidth=0.3, color="0.85")


def _mark_single_branches(axes, case: xr.Dataset):
    """Mark tunings at which only one branch of a reducer loses contact or has coast-side impacts.

    Branches are parallel power paths; the tuning is the mesh frequency over the natural frequency.
    A tuning is marked if this happens for all initial states. `case` contains the corresponding
    fractions of the initial states, stored for the direction "cold".
    """
    styles = style.curve_styles(case.branch.values.tolist())
    for name, (height, marker, _) in _SINGLE_BRANCH_MARKERS.items():
        shares = case[name].sel(direction="cold")
        for branch, branch_style in styles.items():
            tuning = case.tuning.values[shares.sel(branch=branch).values == 1.0]
            y, colour = np.full(tuning.size, height), branch_style.colour
            options = {"transform": axes.get_xaxis_transform()}
            style.draw_markers(axes, tuning, y, marker, colour, 2.5, **options)


_MODE_COLOURS = {"rotational": "#D55E00", "translational": "#56B4E9", "satellite": "#CC79A7"}
_OTHER_MODE_COLOUR, _LOST_CONTACT_COLOUR = "0.5", "#F0E442"
#: Whether the meshes excite the mode at an intersection -> label, face colour and marker size.
_INTERSECTIONS = {True: ("excited", "black", 3.5), False: ("not excited", "white", 2.5)}


@style.rc_context()
def draw_campbell(diagram: xr.Dataset):
    """Return a Campbell diagram (natural and mesh frequencies over speed) of a gear train.

    A broad line behind a mesh frequency marks the speeds at which this mesh loses contact in a
    sweep. The train is drawn next to the diagram. `diagram` is a result of
    `gearlib.studies.trains.compute_campbell_diagram`; its variable mesh_rate is the mesh frequency
    relative to that of the reference mesh.
    """
    figure = style.page_figure(height=4.2)
    # `draw_train` returns the remaining area of the figure.
    axes = schematic.draw_train(figure, diagram, colours={}).add_subplot()
    speed = diagram.speed.values
    handles = draw_orders(axes, diagram, speed[-1])
    # The suffix "high" denotes the largest value over several initial states.
    loses_contact = diagram.contact_loss_fraction_high.max("direction") > FRACTION_TOLERANCE
    # Each marked speed represents an interval of one step of the sweep.
    half_step = np.array([-0.5, 0.5]) * (speed[1] - speed[0])
    for mesh in diagram.mesh.values:
        relative_frequency = float(diagram.mesh_rate.sel(mesh=mesh))
        for centre in speed[loses_contact.sel(mesh=mesh)]:
            speeds = centre + half_step
            frequencies = mesh_frequency_per_speed(diagram) * relative_frequency * speeds
            axes.plot(speeds, frequencies, color=_LOST_CONTACT_COLOUR, linewidth=5, zorder=0.5)
    axes.axvline(speed[0], color="0.6", linestyle=":", linewidth=0.8, zorder=0.4)
    style.add_secondary_axis(axes, float(diagram.tuning[-1]) / speed[-1], style.OWN_TUNING_LABEL)
    handles.append(style.legend_handle("sweeps begin", "0.6", ":", linewidth=0.8))
    handles.append(
        style.legend_handle("contact lost in a sweep", _LOST_CONTACT_COLOUR, linewidth=5)
    )
    style.add_legend(figure, handles, columns=4, fontsize=6.5)
    return figure


def mesh_frequency_per_speed(diagram: xr.Dataset) -> float:
    """Return the frequency of the reference mesh, kHz, at a pinion speed of 1 rpm.

    It is computed from the first mode and the first order: at a critical speed, the natural
    frequency is equal to the order times the mesh frequency.
    """
    order = float(diagram.stiffness_order[0])
    # The factor 1e-3 converts Hz to kHz.
    return 1e-3 * float(diagram.natural_frequency[0] / diagram.critical_speed[0, 0]) / order


def draw_orders(axes, diagram: xr.Dataset, stop: float) -> list:
    """Draw the natural frequencies and orders of a Campbell diagram; return legend handles.

    An order is the ratio of an excitation frequency to the frequency of the reference mesh. Mesh
    frequencies are solid lines, their multiples are dashed. Filled circles mark intersections at
    which the meshes excite the mode. `diagram` is a result of `GearTrain.campbell` or
    `gearlib.studies.trains.compute_campbell_diagram`; `stop` is the upper limit of the speed, rpm.
    """
    frequency_per_speed = mesh_frequency_per_speed(diagram)
    natural_frequencies = 1e-3 * diagram.natural_frequency.values
    colours = {str(kind): _OTHER_MODE_COLOUR for kind in diagram.mode_kind.values} | _MODE_COLOURS
    max_frequency = 1.05 * natural_frequencies.max()
    for frequency, kind in zip(natural_frequencies, diagram.mode_kind.values, strict=True):
        axes.axhline(frequency, color=colours[str(kind)], linewidth=0.7, zorder=1)
    # If the mesh orders are unknown, all lines are solid.
    mesh_orders = diagram.get("mesh_rate", diagram.stiffness_order).values
    orders = diagram.stiffness_order.values
    for order, text in zip(orders, style.format_numbers(orders, digits=3), strict=True):
        # The line ends at the right or the upper limit of the axes.
        slope = frequency_per_speed * order
        end = min(stop, max_frequency / slope) * np.array([1.0, slope])  # (speed, frequency)
        dashes = "-" if order in mesh_orders else "--"
        axes.plot([0.0, end[0]], [0.0, end[1]], dashes, color="0.3", linewidth=0.8)
        box = style.white_box(padding=0.15)
        style.annotate(axes, text, 0.97 * end, anchor="center center", bbox=box)
    for is_excited, (_, face_colour, marker_size) in _INTERSECTIONS.items():
        mask = diagram.excites.values == is_excited
        x = diagram.critical_speed.values[mask]
        y = np.broadcast_to(natural_frequencies, mask.shape)[mask]
        options = {"markerfacecolor": face_colour, "markeredgewidth": 0.5, "zorder": 3}
        style.draw_markers(axes, x, y, "o", "black", marker_size, **options)
    axes.set(xlim=(0.0, stop), ylim=(0.0, max_frequency))
    axes.set(xlabel="speed of the reference pinion (rpm)", ylabel="frequency (kHz)")
    kinds = dict.fromkeys(map(str, diagram.mode_kind.values))
    handles = [style.legend_handle(f"{kind} mode", colours[kind]) for kind in kinds]
    handles.append(style.legend_handle("mesh frequency", "0.3", linewidth=0.8))
    handles.append(style.legend_handle("its multiple", "0.3", "--", linewidth=0.8))
    for name, face_colour, marker_size in _INTERSECTIONS.values():
        options = {"marker": "o", "markerfacecolor": face_colour, "markersize": marker_size}
        handles.append(style.legend_handle(name, line_style="none", **options))
    return handles

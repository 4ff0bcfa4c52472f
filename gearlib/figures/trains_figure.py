"""All meshes of a gear train over speed: dynamic factors, load sharing, time in contact."""

import numpy as np
from matplotlib.patches import Patch

from gearlib.figures import panels, schematic, style

#: Rows of panels of the reducer: variable, stage of its meshes.
_REDUCER_ROWS = (("dynamic_factor", 1), ("dynamic_factor", 2), ("load_sharing", 1))
_SWEEP_ROWS = ("dynamic_factor", "fraction_normal")
_DIRECTION_MARKERS = {"up": "^", "down": "v"}
#: Motions whose values differ by a smaller share look the same.
SAME_MOTION_TOLERANCE = 0.01
#: Ranges that are narrower, shares of the value, are drawn as a line.
NARROW_RANGE = 1e-3
#: Share of the starts -> height of its marks in a panel, marker, words.
_SINGLE_BRANCH_MARKS = {
    "lost_alone_share": (0.03, "s", "contact lost in this branch only"),
    "struck_alone_share": (0.08, "x", "far flank struck in this branch only"),
}


@style.styled()
def draw_sweep(curves):
    """Draw a colour for each mesh; meshes that move alike lie on top of each other.

    `curves` are those of `gearlib.studies.trains.over_speed`. Shades are ranges over
    all starts beside static equilibrium, dots their medians; lines carry one start, where it
    settles.
    """
    figure = style.page(5.2)
    styles = _mesh_styles(curves, panels.curve_styles(curves.mesh))
    part = schematic.with_train(figure, curves, {n: look["color"] for n, look in styles.items()})
    grid = part.subplots(3, 1, sharex=True, height_ratios=(1.0, 1.0, 0.3))
    carried, rest = curves.sel(direction=["up", "down"]), curves.sel(direction="cold")
    unsettled = rest.where(rest.settled == 0)
    for axes, name in zip(grid, _SWEEP_ROWS, strict=False):
        told = {"colour": "mesh", "styles": styles}
        handles = panels.draw_curves(axes, carried, "speed", name, line="direction", **told)
        dots = {"marker": ".", "linestyle": "none", "markersize": 1.5}
        panels.draw_curves(axes, unsettled, "speed", name, **told, **dots)
        _draw_ranges(axes, rest, "speed", name, styles)
    _draw_start_shares(grid[-1], rest, "speed")
    grid[-1].set_xlabel("speed of the reference pinion (rpm)")
    for axes in grid:
        axes.label_outer()
    speed = curves.speed.values
    style.second_scale(grid[0], float(curves.tuning[-1]) / speed[-1], style.OWN_TUNING)
    grid[0].set_xlim(speed[0], speed[-1])
    style.legend(figure, [*handles, *_start_entries("on one orbit")], 4)
    return figure


@style.styled()
def draw_reducer(characteristics):
    """Draw a column for each case: the branches from rest, up and down where these differ.

    `characteristics` are those of `gearlib.studies.trains.reducer`. From rest, lines
    are medians over all starts and shades their range; the lowest row has the share of the
    starts that settle, and of those that share one motion.
    """
    data = characteristics
    figure = style.page(6.8)
    branches = dict(zip(data.mesh.values, data.mesh_branch.values, strict=True))
    colours = {mesh: style.PALETTE[int(branch) - 1] for mesh, branch in branches.items()}
    part = schematic.with_train(figure, data, colours, below=True)
    ratios = [1.0] * len(_REDUCER_ROWS) + [0.35]
    shared = {"sharex": True, "sharey": "row", "squeeze": False, "height_ratios": ratios}
    grid = part.subplots(len(ratios), data.sizes["case"], **shared)
    for column, case in zip(grid.T, data.case.values, strict=True):
        shown = data.sel(case=case)
        for axes, (name, stage) in zip(column, _REDUCER_ROWS, strict=False):
            meshes = shown.isel(mesh=shown.mesh_stage.values == stage)
            handles = _draw_branches(axes, meshes, name, colours)
            axes.set_ylabel(f"{axes.get_ylabel()}, stage {stage}")
        _mark_single_branches(column[0], shown)
        _draw_start_shares(column[-1], shown.sel(direction="cold"), "tuning")
        column[0].set_title(panels.value_label(shown.case))
        column[-1].set_xlabel("tuning of the pair alone $\\nu$")
        for axes in column:
            axes.label_outer()
        rate = float(data.speed[-1] / data.tuning[-1])
        style.second_scale(column[0], rate, "speed of the input (rpm)")
    grid[0, 0].set_xlim(data.tuning.values[0], data.tuning.values[-1])
    point = {"line": "none", "markersize": 3}
    handles += [
        style.entry(
            f"speed {way}, where it differs", marker=marker, markerfacecolor="none", **point
        )
        for way, marker in _DIRECTION_MARKERS.items()
    ]
    for _, marker, words in _SINGLE_BRANCH_MARKS.values():
        handles.append(style.entry(words, marker=marker, **point))
    same = data.largest_share.equals(data.settled_share)
    handles += _start_entries("that share one motion" if same else "that share the most common one")
    style.legend(figure, handles, 4, fontsize=6.5)
    return figure


def _mesh_styles(data, styles):
    """Give each mesh a thinner line than the mesh before it, so that equal ones are all seen."""
    widths = np.linspace(3.0, 0.8, len(styles))
    for look, width in zip(styles.values(), widths, strict=True):
        look |= {"linestyle": "-", "linewidth": width}
    return styles


def _draw_branches(axes, data, name, colours):
    """Draw a variable of the meshes of one stage; return the entries of the legend."""
    rest = data.sel(direction="cold")
    styles = {
        mesh: {"color": colours[mesh], "label": f"branch {branch}, from rest"}
        for mesh, branch in zip(data.mesh.values, data.mesh_branch.values, strict=True)
    }
    told = {"colour": "mesh", "styles": _mesh_styles(data, styles)}
    handles = panels.draw_curves(axes, rest, "tuning", name, **told)
    _draw_ranges(axes, rest, "tuning", name, styles)
    for direction, marker in _DIRECTION_MARKERS.items():
        carried = data.sel(direction=direction)
        above, below = carried[name] - rest[f"{name}_high"], rest[f"{name}_low"] - carried[name]
        differs = np.maximum(above, below) > SAME_MOTION_TOLERANCE * abs(rest[name])
        marks = {"marker": marker, "linestyle": "none", "markerfacecolor": "none"}
        marks |= {"markersize": 2.2, "markeredgewidth": 0.4}
        panels.draw_curves(axes, carried.where(differs), "tuning", name, **told, **marks)
    return handles


def _draw_ranges(axes, rest, x, name, styles):
    """Shade the range of a variable of each mesh over all starts, where it has one, on a grid."""
    for mesh, look in styles.items():
        low, high = (rest[f"{name}_{end}"].sel(mesh=mesh).values for end in ("low", "high"))
        wide = high - low > NARROW_RANGE * np.abs(high)
        # To the neighbours, so that a range at one tuning is seen too.
        shown = wide | np.roll(wide, 1) | np.roll(wide, -1)
        shade = {"color": look["color"], "alpha": 0.25, "linewidth": 0.0}
        axes.fill_between(rest[x].values, low, high, where=shown, **shade)
    axes.grid(linewidth=0.3, color="0.85")


def _draw_start_shares(axes, rest, x):
    """Draw the shares of the starts that settle and that come to the most common orbit."""
    axes.fill_between(rest[x], 0.0, rest.settled_share, step="mid", color="0.8", linewidth=0.0)
    axes.step(rest[x], rest.largest_share, where="mid", color=style.PALETTE[0], linewidth=0.9)
    axes.set(ylim=(-0.05, 1.05), yticks=[0.0, 1.0], ylabel="share of\nthe starts")


def _start_entries(share):
    """Return the entries of the legend for ranges and shares of starts."""
    return [
        Patch(color="0.6", alpha=0.4, linewidth=0, label="range of all starts"),
        Patch(color="0.8", label="share of the starts that settle"),
        style.entry(share, style.PALETTE[0], linewidth=0.9),
    ]


def _mark_single_branches(axes, data):
    """Mark, near the lower edge, where from all starts one branch alone parts, strikes."""
    for name, (height, marker, _) in _SINGLE_BRANCH_MARKS.items():
        shares = data[name].sel(direction="cold")
        for branch in data.branch.values:
            tuning = data.tuning.values[shares.sel(branch=branch).values == 1.0]
            look = {"transform": axes.get_xaxis_transform()}
            colour = style.PALETTE[branch - 1]
            style.dots(axes, tuning, np.full(tuning.size, height), marker, colour, 2.5, **look)

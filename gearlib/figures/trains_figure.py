"""All meshes of a gear train over speed: dynamic factors, load sharing, time in contact.

From rest, lines are medians over all starts and shades their range; marks are motions swept up
and down. Meshes that move alike lie on top of each other. The lowest row has the share of the
starts that settle, and of those that share one motion.
"""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gearlib.figures import panels, schematic, style

_SWEPT_MARKERS = {"up": "^", "down": "v"}
#: Motions whose values differ by a smaller share look the same.
SAME_MOTION_TOLERANCE = 0.01
#: Share of the starts -> height of its marks in a panel, marker, label.
_SINGLE_BRANCH_MARKS = {
    "lost_alone_share": (0.03, "s", "contact lost in this branch only"),
    "struck_alone_share": (0.08, "x", "far flank struck in this branch only"),
}
_MARKERS_ONLY = {"line": "none", "markersize": 3}


@style.styled()
def draw_sweep(curves: xr.Dataset):
    """Return a figure of dynamic factors and contact of `gearlib.studies.trains.over_speed`."""
    figure = style.page(5.2)
    styles = _thinning_lines(panels.curve_styles(curves.mesh))
    colours = {mesh: options["color"] for mesh, options in styles.items()}
    remaining = schematic.with_train(figure, curves, colours)
    rows = [(name, styles) for name in ("dynamic_factor", "fraction_normal")]
    grid = _draw_columns(remaining, [curves], "speed", rows)
    grid[-1, 0].set_xlabel("speed of the reference pinion (rpm)")
    tuning_per_speed = float(curves.tuning[-1] / curves.speed[-1])
    style.second_scale(grid[0, 0], tuning_per_speed, style.OWN_TUNING)
    style.legend(figure, panels.legend_entries(styles) + _common_entries(), 4)
    return figure


@style.styled()
def draw_reducer(characteristics: xr.Dataset):
    """Return a figure of data of `gearlib.studies.trains.reducer`, a column for each case."""
    data = characteristics
    figure = style.page(6.8)
    branches = dict(zip(data.mesh.values, data.mesh_branch.values, strict=True))
    colours = {mesh: style.PALETTE[int(branch) - 1] for mesh, branch in branches.items()}
    remaining = schematic.with_train(figure, data, colours, below=True)
    stages = {
        stage: _thinning_lines(
            {
                mesh: {"color": colours[mesh], "label": f"branch {branches[mesh]}, from rest"}
                for mesh in data.mesh.values[data.mesh_stage.values == stage]
            }
        )
        for stage in (1, 2)
    }
    rows = [
        (name, stages[i])
        for name, i in (("dynamic_factor", 1), ("dynamic_factor", 2), ("load_sharing", 1))
    ]
    cases = [data.sel(case=case) for case in data.case.values]
    grid = _draw_columns(remaining, cases, "tuning", rows)
    for axes, stage in zip(grid[:, 0], (1, 2, 1), strict=False):
        axes.set_ylabel(f"{axes.get_ylabel()}\n(stage {stage})")
    for column, case in zip(grid.T, cases, strict=True):
        _mark_single_branches(column[0], case)
        column[0].set_title(panels.value_label(case.case))
        column[-1].set_xlabel("tuning of the pair alone $\\nu$")
        speed_per_tuning = float(data.speed[-1] / data.tuning[-1])
        style.second_scale(column[0], speed_per_tuning, "speed of the input (rpm)")
    handles = panels.legend_entries(stages[1]) + _common_entries()
    for _, marker, label in _SINGLE_BRANCH_MARKS.values():
        handles.append(style.entry(label, marker=marker, **_MARKERS_ONLY))
    style.legend(figure, handles, 4, fontsize=6.5)
    return figure


def _thinning_lines(styles: dict[str, dict]) -> dict[str, dict]:
    """Return plot options by curve, changed in place: each line is thinner than the one before."""
    for options, width in zip(styles.values(), np.linspace(3.0, 0.8, len(styles)), strict=True):
        options |= {"linestyle": "-", "linewidth": width}
    return styles


def _common_entries() -> list:
    """Return legend handles for warm-started motions, and for ranges and shares of the starts."""
    handles = [
        style.entry(f"speed {way}, where it differs", marker=mark, mfc="none", **_MARKERS_ONLY)
        for way, mark in _SWEPT_MARKERS.items()
    ]
    spread = Patch(color="0.6", alpha=0.4, linewidth=0, label="range of all starts")
    settled = Patch(color="0.8", label="share of the starts that settle")
    return [*handles, spread, settled, style.entry("on one orbit", style.PALETTE[0], linewidth=0.9)]


def _draw_columns(figure: Figure, cases: list[xr.Dataset], x: str, rows: list) -> np.ndarray:
    """Draw a column of panels for each case over the variable `x`; return the grid of axes.

    `rows` has a (variable name, styles) for each row, styles being plot options by mesh name. The
    last row has the shares of starts that settle.
    """
    ratios = [1.0] * len(rows) + [0.35]
    shared = {"sharex": True, "sharey": "row", "squeeze": False, "height_ratios": ratios}
    grid = figure.subplots(len(ratios), len(cases), **shared)
    for column, case in zip(grid.T, cases, strict=True):
        cold = case.sel(direction="cold")
        for axes, (name, styles) in zip(column, rows, strict=False):
            _draw_meshes(axes, case, x, name, styles)
        shares = {"step": "mid", "color": "0.8", "linewidth": 0.0}
        column[-1].fill_between(cold[x], 0.0, cold.settled_share, **shares)
        column[-1].step(cold[x], cold.largest_share, where="mid", color=style.PALETTE[0], lw=0.9)
        column[-1].set(ylabel="share of\nthe starts", ylim=(-0.05, 1.05), yticks=[0.0, 1.0])
        column[-1].set_xlim(cold[x][0], cold[x][-1])
        for axes in column:
            axes.label_outer()
    return grid


def _draw_meshes(axes, case: xr.Dataset, x: str, name: str, styles: dict[str, dict]):
    """Draw the variable `name` of meshes over `x`, from rest, with ranges over all starts.

    Markers show warm-started motions where they differ. `styles` has plot options by mesh name.
    """
    cold = case.sel(direction="cold")
    panels.draw_curves(axes, cold, x, name, colour="mesh", styles=styles)
    for mesh, curve_options in styles.items():
        low, high = (cold[f"{name}_{end}"].sel(mesh=mesh) for end in ("low", "high"))
        axes.fill_between(
            cold[x], low, high, color=curve_options["color"], alpha=0.25, linewidth=0.0
        )
    for direction, marker in _SWEPT_MARKERS.items():
        swept = case.sel(direction=direction)
        above = swept[name] - cold[f"{name}_high"]
        below = cold[f"{name}_low"] - swept[name]
        differs = np.maximum(above, below) > SAME_MOTION_TOLERANCE * abs(cold[name])
        options = {"marker": marker, "linestyle": "none", "mfc": "none", "markersize": 2.2}
        marks = case[[x]].assign({name: swept[name].where(differs)})
        panels.draw_curves(axes, marks, x, name, colour="mesh", styles=styles, **options)
    axes.grid(linewidth=0.3, color="0.85")


def _mark_single_branches(axes, case: xr.Dataset):
    """Mark tunings where, from all starts, one branch alone loses contact or strikes far flanks."""
    for name, (height, marker, _) in _SINGLE_BRANCH_MARKS.items():
        shares = case[name].sel(direction="cold")
        for branch in case.branch.values:
            tuning = case.tuning.values[shares.sel(branch=branch).values == 1.0]
            options = {"transform": axes.get_xaxis_transform()}
            colour = style.PALETTE[branch - 1]
            style.dots(axes, tuning, np.full(tuning.size, height), marker, colour, 2.5, **options)

"""All meshes of the reducer over speed: dynamic factors, load sharing, a column for each case."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearlib.figures import style
from gearlib.figures.starts import draw_range, draw_shares

_TITLES = {
    "alike": "branches alike",
    "pin_error": "axis of satellite 1 displaced",
    "unequal_backlash": "unequal backlash",
}
#: What is drawn of the meshes of a stage: variable, stage, words.
_ROWS = (
    ("dynamic_factor", 1, "dynamic factor,\nfirst meshes"),
    ("dynamic_factor", 2, "dynamic factor,\nsecond meshes"),
    ("load_sharing", 1, "load of a branch\nover equal share"),
)
_MARKS = {"up": "^", "down": "v"}
#: Motions that differ by less are one in a plot.
_SEEN = 0.01
#: Where in a panel the marks of single branches lie, shares of its height.
_STRIPS = {"lost_alone_share": 0.03, "struck_alone_share": 0.08}
_SYMBOLS = {"lost_alone_share": "s", "struck_alone_share": "x"}
_WIDTHS = (2.2, 1.4, 0.8)


@style.styled()
def draw(characteristics):
    """Draw a column for each case: the branches from rest, up and down where these differ.

    `characteristics` are those of `gearlib.studies.trains.reducer.compute`. From rest, lines
    are medians over all starts and shades their range; the lowest row has the share of the
    starts that settle, and of those that share one motion.
    """
    data = characteristics
    figure = Figure((style.PAGE_WIDTH, 6.8), layout="constrained")
    grid = figure.subplots(
        len(_ROWS) + 1,
        data.sizes["case"],
        sharex=True,
        sharey="row",
        squeeze=False,
        height_ratios=[1.0] * len(_ROWS) + [0.35],
    )
    tuning, speed = data.tuning.values, data.speed.values
    for column, case in zip(grid.T, data.case.values, strict=True):
        shown = data.sel(case=case)
        for axes, (name, stage, label) in zip(column, _ROWS, strict=False):
            _draw_branches(axes, shown, name, stage)
            axes.grid(linewidth=0.3, color="0.85")
            if axes is grid[list(column).index(axes), 0]:
                axes.set_ylabel(label)
        _draw_alone(column[0], shown)
        draw_shares(column[-1], tuning, shown.sel(direction="cold"))
        column[0].set_title(_TITLES[case])
        style.add_scale(column[0], tuning, speed, "speed of the input (rpm)")
        column[-1].set_xlabel("tuning of the pair alone $\\nu$")
    grid[-1, 0].set_ylabel("share of\nthe starts")
    grid[0, 0].set_xlim(tuning[0], tuning[-1])
    figure.legend(handles=_legend(data), loc="outside lower center", ncols=4, fontsize=6.5)
    return figure


def _draw_branches(axes, data, name, stage):
    """Draw one variable of the meshes of a stage, a colour for each branch."""
    tuning = data.tuning.values
    for j in np.flatnonzero(data.mesh_stage.values == stage):
        branch = int(data.mesh_branch[j])
        colour = style.PALETTE[branch - 1]
        values = data[name].isel(mesh=j)
        rest = values.sel(direction="cold").values
        draw_range(axes, tuning, data.sel(direction="cold").isel(mesh=j), name, colour)
        axes.plot(tuning, rest, color=colour, linewidth=_width(branch))
        for direction, marker in _MARKS.items():
            carried = values.sel(direction=direction).values
            # Nor in the range of all starts.
            low, high = (
                data[f"{name}_{end}"].isel(mesh=j).sel(direction="cold").values
                for end in ("low", "high")
            )
            apart = np.maximum(low - carried, carried - high) > _SEEN * np.abs(rest)
            axes.plot(
                tuning[apart],
                carried[apart],
                marker,
                color=colour,
                markersize=2.2,
                markeredgewidth=0.4,
                markerfacecolor="none",
            )


def _draw_alone(axes, data):
    """Mark, near the lower edge, where from all starts one branch alone parts, strikes."""
    for name, height in _STRIPS.items():
        shares = data[name].sel(direction="cold")
        for branch in data.branch.values:
            at = data.tuning.values[shares.sel(branch=branch).values == 1.0]
            axes.plot(
                at,
                np.full(at.size, height),
                _SYMBOLS[name],
                color=style.PALETTE[branch - 1],
                markersize=2.5,
                transform=axes.get_xaxis_transform(),
            )


def _width(branch):
    """Return the width of a line: of curves on top of each other all are seen."""
    return _WIDTHS[(branch - 1) % len(_WIDTHS)]


def _legend(data):
    branches = np.unique(data.mesh_branch.values)
    handles = [
        Line2D(
            [], [], color=style.PALETTE[n - 1], linewidth=_width(n), label=f"branch {n}, from rest"
        )
        for n in branches
    ]
    point = {"linestyle": "none", "color": "black", "markersize": 3}
    for direction, marker in _MARKS.items():
        words = f"speed {direction}, where it differs"
        handles.append(Line2D([], [], marker=marker, markerfacecolor="none", label=words, **point))
    symbols = {
        "lost_alone_share": "contact lost in this branch only",
        "struck_alone_share": "far flank struck in this branch only",
    }
    handles += [
        Line2D([], [], marker=_SYMBOLS[name], label=label, **point)
        for name, label in symbols.items()
    ]
    words = "one motion" if data.largest_share.equals(data.settled_share) else "the most common one"
    return [
        *handles,
        Patch(color="0.6", alpha=0.4, linewidth=0, label="range of all starts"),
        Patch(color="0.8", label="share of the starts that settle"),
        Line2D([], [], color=style.PALETTE[0], linewidth=0.9, label=f"that share {words}"),
    ]

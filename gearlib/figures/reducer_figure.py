"""All meshes of the reducer over speed: dynamic factors, load sharing, a column for each case."""

import numpy as np

from gearlib.figures import schematic, style
from gearlib.figures.starts import draw_range, draw_shares, entries

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
#: Of branches that all move alike, which are one line.
_ALIKE = "0.25"


@style.styled()
def draw(characteristics):
    """Draw a column for each case: the branches from rest, up and down where these differ.

    `characteristics` are those of `gearlib.studies.trains.reducer.compute`. From rest, lines
    are medians over all starts and shades their range; the lowest row has the share of the
    starts that settle, and of those that share one motion.
    """
    data = characteristics
    figure = style.page(6.8)
    branches = zip(data.mesh.values, data.mesh_branch.values, strict=True)
    colours = {name: style.PALETTE[int(branch) - 1] for name, branch in branches}
    part = schematic.with_train(figure, data, colours, below=True)
    grid = part.subplots(
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
    style.legend(figure, _legend(data), 4, fontsize=6.5)
    return figure


def _draw_branches(axes, data, name, stage):
    """Draw one variable of the meshes of a stage: a line for each branch, one where all agree."""
    tuning = data.tuning.values
    meshes = np.flatnonzero(data.mesh_stage.values == stage)
    every = data[name].isel(mesh=meshes)
    rests = every.sel(direction="cold").transpose("tuning", "mesh").values
    alike = np.ptp(rests, axis=1) <= _SEEN * np.abs(rests).max(axis=1)
    # Lines of branches begin at the last tuning at which all agree.
    inside = np.pad(alike, 1, constant_values=True)
    alone = alike & inside[:-2] & inside[2:]
    axes.plot(tuning, np.where(alike, rests[:, 0], np.nan), color=_ALIKE, linewidth=_width(1))
    for j in meshes:
        branch = int(data.mesh_branch[j])
        colour = style.PALETTE[branch - 1]
        values = data[name].isel(mesh=j)
        rest = values.sel(direction="cold").values
        draw_range(axes, tuning, data.sel(direction="cold").isel(mesh=j), name, colour)
        shown = np.where(alone, np.nan, rest)
        axes.plot(tuning, shown, color=colour, linewidth=_width(branch))
        for direction, marker in _MARKS.items():
            carried = values.sel(direction=direction).values
            # Nor in the range of all starts.
            low, high = (
                data[f"{name}_{end}"].isel(mesh=j).sel(direction="cold").values
                for end in ("low", "high")
            )
            apart = np.maximum(low - carried, carried - high) > _SEEN * np.abs(rest)
            look = {"markeredgewidth": 0.4, "markerfacecolor": "none"}
            style.dots(axes, tuning[apart], carried[apart], marker, colour, 2.2, **look)


def _draw_alone(axes, data):
    """Mark, near the lower edge, where from all starts one branch alone parts, strikes."""
    for name, height in _STRIPS.items():
        shares = data[name].sel(direction="cold")
        for branch in data.branch.values:
            at = data.tuning.values[shares.sel(branch=branch).values == 1.0]
            heights, colour = np.full(at.size, height), style.PALETTE[branch - 1]
            across = axes.get_xaxis_transform()
            style.dots(axes, at, heights, _SYMBOLS[name], colour, 2.5, transform=across)


def _width(branch):
    """Return the width of a line: of curves on top of each other all are seen."""
    return _WIDTHS[(branch - 1) % len(_WIDTHS)]


def _legend(data):
    branches = np.unique(data.mesh_branch.values)
    handles = [
        style.entry(f"branch {n}, from rest", style.PALETTE[n - 1], linewidth=_width(n))
        for n in branches
    ]
    handles.append(style.entry("all branches", _ALIKE, linewidth=_width(1)))
    point = {"line": "none", "markersize": 3}
    for direction, marker in _MARKS.items():
        words = f"speed {direction}, where it differs"
        handles.append(style.entry(words, marker=marker, markerfacecolor="none", **point))
    symbols = {
        "lost_alone_share": "contact lost in this branch only",
        "struck_alone_share": "far flank struck in this branch only",
    }
    handles += [style.entry(words, marker=_SYMBOLS[of], **point) for of, words in symbols.items()]
    words = "one motion" if data.largest_share.equals(data.settled_share) else "the most common one"
    return [*handles, *entries(f"that share {words}")]

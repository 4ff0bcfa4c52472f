"""Basins of attraction, Poincaré sections and bifurcation diagrams."""

import numpy as np
from matplotlib.lines import Line2D

from gearlib.figures import panels, style

#: Colours of periodic attractors in their order; other kinds of attractors have their own.
_PERIODIC_COLOURS = (*style.PALETTE, "#F0E442", "#8C510A", "#762A83", "#A6DBA0", "#FDB863")
_MARKERS = "o^sDvP*X<>hp"
_KINDS = ("period", "chaotic", "unbounded", "undecided")
_KIND_COLOURS = (None, "#000000", "#D9D9D9", "#FFFFFF")
#: Colours of chaotic, undecided and regular orbits in sections.
_CHAOTIC, _UNDECIDED = "#D55E00", "#A0A0A0"
_REGULAR = ("#0072B2", "#009E73", "#4D4D4D", "#56B4E9", "#CC79A7")
_DIRECTIONS = {
    "cold": ("random initial states", "#8A8A8A"),
    "down": ("tuning going down", "#D55E00"),
    "up": ("tuning going up", "#0072B2"),
}
#: Families whose largest share of the initial states is smaller have no entry in the legend.
MIN_NAMED_SHARE = 0.04
#: Band around a Lyapunov exponent, in standard errors.
BAND = 3.0
_BELOW = {"loc": "upper center", "frameon": False, "columnspacing": 1.0}


def attractor_colours(kinds):
    """Return the colour of each attractor from the codes of their kinds."""
    periodic = iter(np.resize(_PERIODIC_COLOURS, len(kinds)))
    return [_KIND_COLOURS[kind] or str(next(periodic)) for kind in kinds]


@style.styled()
def draw_basins(data):
    """Draw the basins of all cases of `gearlib.studies.global_picture.basin_cases`.

    Every initial state has the colour of its attractor, whose stroboscopic states are marked
    where they lie in the picture; below, periods and shares.
    """
    figure, grid = style.panels(data.sizes["case"], 3.9)
    for axes, (_, case) in zip(grid, data.groupby("case", squeeze=False), strict=True):
        _draw_basins_of_case(axes, case.squeeze("case"))
    return figure


def _draw_basins_of_case(axes, case):
    """Draw the map of one case and the states of its attractors."""
    case = case.isel(attractor=slice(int(case.basin.max()) + 1))
    kinds = case.attractor_kind.values
    colours, x, v = attractor_colours(kinds), case.displacement, case.velocity
    style.map_of_codes(axes, x.values, v.values, case.basin.values.T, colours)
    axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim())
    handles = []
    for i, (kind, colour, marker) in enumerate(zip(kinds, colours, _MARKERS * 9, strict=False)):
        name = f"period {int(case.period[i])}" if kind == 0 else _KINDS[kind]
        shares = 100.0 * case.share.values[i], 100.0 * case.share_error.values[i]
        look = {"color": colour, "marker": marker, "linestyle": "none"}
        if kind == 0:
            axes.plot(*case.state.values[i].T, markersize=5.5, markeredgecolor="white", **look)
        words = "{}: {:.1f} ± {:.2f} %".format(name, *shares)
        handles.append(Line2D([], [], label=words, markersize=5, markeredgecolor="grey", **look))
    axes.set_title(case.case.item())
    _label_plane(axes, "initial ")
    look = {"fontsize": 6.5, "handletextpad": 0.2, "bbox_to_anchor": (0.5, -0.16)}
    axes.legend(handles=handles, ncols=2, **_BELOW, **look)


def _label_plane(axes, word=""):
    """Label a phase plane, the velocity only in the first column."""
    axes.set_xlabel(f"{word}displacement (static defl.)")
    axes.set_ylabel(word + style.RATE if axes.get_subplotspec().is_first_col() else "")


@style.styled()
def draw_sections(data):
    """Draw the sections of all cases of `gearlib.studies.global_picture.sections`.

    Orange: chaotic orbits; grey: undecided ones; other colours: regular ones, each orbit in one
    colour.
    """
    figure, grid = style.panels(data.sizes["case"], 3.3)
    for i, axes in enumerate(grid):
        case = data.isel(case=i)
        chaotic, undecided = case.chaotic.values == 1, case.chaotic.values == 2
        regular = np.resize(_REGULAR, chaotic.size)
        colours = np.where(chaotic, _CHAOTIC, np.where(undecided, _UNDECIDED, regular))
        # Chaos first, so that islands in it are seen.
        for j in np.argsort(~chaotic, kind="stable"):
            states = case.displacement.values[j], case.velocity.values[j]
            look = {"markeredgewidth": 0.0, "rasterized": True}
            style.dots(axes, *states, ".", colours[j], 0.9 if chaotic[j] else 1.2, **look)
        words = f"$\\tau$ = {np.degrees(float(case.phase)):.0f}°; {100.0 * chaotic.mean():.0f} %"
        more = f", {undecided.sum()} undecided" if undecided.any() else ""
        axes.set_title(f"{case.case.item()}\n{words} of {chaotic.size} orbits chaotic{more}")
        _label_plane(axes)
    return figure


@style.styled()
def draw_bifurcation(diagram, shares, branches=None):
    """Draw diagram, exponents and shares of `gearlib.studies.global_picture.bifurcation`.

    `branches`, if given, are laid over the diagram, dashed where unstable: tuning, state
    (point, coordinate), stable and branch along ``point``.
    """
    figure = style.page(6.6)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(2.4, 1.0, 1.4))
    names = [str(name) for name in diagram.direction.values]
    for kind, (words, colour) in _DIRECTIONS.items():
        for name in reversed([name for name in names if name.split()[0] == kind]):
            motion = diagram.sel(direction=name)
            look = {"marker": ".", "markeredgewidth": 0.0, "rasterized": True, "color": colour}
            size = 1.4 if kind == "cold" else 1.8
            strobes = motion.displacement.transpose("tuning", "strobe").values
            top.plot(motion.tuning, strobes, linestyle="none", markersize=size, **look)
            _draw_exponents(middle, motion, colour, kind != "cold")
        if any(name.split()[0] == kind for name in names):
            style.dots(top, [], [], ".", colour, None, label=words)
    if branches is not None:
        _lay_over(top, branches)
    top.legend(loc="lower left", markerscale=1.5)
    top.set_ylabel("displacement at $\\tau = 0$\n(static defl.)")
    middle.axhline(0.0, color="black", linewidth=0.5)
    middle.set_ylabel(panels.axis_label(diagram.exponent, 24))
    _draw_family_shares(bottom, shares)
    bottom.set_xlabel(panels.axis_label(diagram.tuning))
    bottom.set_xlim(diagram.tuning[0], diagram.tuning[-1])
    style.second_scale(top, float(diagram.speed[-1] / diagram.tuning[-1]), "speed (rpm)")
    return figure


def _draw_exponents(axes, motion, colour, carried):
    """Draw exponents as dots; of carried motions with a band, and a line where they settle."""
    exponent, tuning = motion.exponent, motion.tuning
    joined = motion.settled.astype(bool) & carried
    dots = {"linestyle": "none", "marker": ".", "markersize": 2.0, "markeredgewidth": 0.0}
    axes.plot(tuning, exponent.where(~joined), color=colour, **dots)
    axes.plot(tuning, exponent.where(joined), color=colour, linewidth=0.7)
    if carried:
        low, high = exponent - BAND * motion.uncertainty, exponent + BAND * motion.uncertainty
        axes.fill_between(tuning, low, high, color=colour, alpha=0.3, linewidth=0)


def _lay_over(axes, branches):
    """Draw continued branches, dashed where they are unstable."""
    looks = {1: {"linewidth": 0.8}, 0: {"linewidth": 0.6, "linestyle": style.DASHED}}
    for _, branch in branches.groupby("branch"):
        stable = branch.stable.values.astype(bool)
        for code, look in looks.items():
            # A piece is drawn up to the point where stability changes.
            chosen = stable == bool(code)
            chosen[1:] |= chosen[:-1]
            states = np.where(chosen, branch.state.values[:, 0], np.nan)
            axes.plot(branch.tuning.values, states, color="black", **look)
    for code, words in ((1, "continued, stable"), (0, "unstable")):
        axes.plot([], [], color="black", label=words, **looks[code])


def _draw_family_shares(axes, shares):
    """Draw the shares of the families of attractors, one above the other."""
    share, kinds = (
        shares.share.transpose("attractor_family", "tuning").values,
        shares.attractor_kind,
    )
    heights = (shares.displacement_max - shares.displacement_min).values
    names = []
    for row, height, kind, period in zip(
        share, heights.T, kinds.values, shares.period.values, strict=True
    ):
        name = f"period {period}, height {height[row.argmax()]:.1f}" if kind == 0 else _KINDS[kind]
        names.append(name if row.max() >= MIN_NAMED_SHARE else None)
    colours = attractor_colours(kinds.values)
    look = {"edgecolor": "grey", "linewidth": 0.3, "labels": names}
    axes.stackplot(shares.tuning.values, share, colors=colours, step="mid", **look)
    title = "orbits: period in mesh periods, height in static deflections"
    look = {"bbox_to_anchor": (0.5, -0.28), "title": title, "title_fontsize": 7.5}
    axes.legend(ncols=4, **_BELOW, **look)
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel("share of the\ninitial states")

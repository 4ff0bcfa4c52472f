"""Bifurcation diagram, largest Lyapunov exponent and shares of the basins over one axis."""

import numpy as np

from gearlib.figures import style
from gearlib.figures.basins_figure import looks

_HEIGHT = 6.6
_COLOURS = {"up": "#0072B2", "down": "#D55E00", "cold": "#8A8A8A"}
_WORDS = {
    "up": "tuning going up",
    "down": "tuning going down",
    "cold": "random initial states",
}
_KINDS = ("", "chaotic", "unbounded", "undecided")
#: Families whose largest share is smaller have no entry in the legend.
_NAMED = 0.04


@style.styled()
def draw(diagram, shares, branches=None):
    """Draw diagram, exponents and shares of `gearlib.studies.global_picture.bifurcation`.

    `branches`, if given, are laid over the diagram, dashed where unstable: tuning, state
    (point, coordinate), stable and branch along ``point``.
    """
    figure = style.page(_HEIGHT)
    top, middle, bottom = figure.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": [2.4, 1.0, 1.4]}
    )
    tuning = diagram.tuning.values
    # Up and down over the scattered starts.
    for name in reversed(diagram.direction.values):
        one, kind = diagram.sel(direction=name), str(name).split()[0]
        colour = _COLOURS[kind]
        strobes, size = one.displacement.values, 1.4 if kind == "cold" else 1.8
        at, look = np.repeat(tuning, strobes.shape[1]), {"markeredgewidth": 0.0, "rasterized": True}
        style.dots(top, at, strobes.ravel(), ".", colour, size, **look)
        value, error = one.exponent.values, one.uncertainty.values
        # Lines join settled motions only.
        line = one.settled.values.astype(bool) & (kind != "cold")
        dots = np.where(line, np.nan, value)
        middle.plot(tuning, dots, ".", markersize=2.0, color=colour, markeredgewidth=0.0)
        if line.any():
            middle.plot(tuning, np.where(line, value, np.nan), color=colour, linewidth=0.7)
        if kind != "cold":
            low, high = value - 3.0 * error, value + 3.0 * error
            middle.fill_between(tuning, low, high, color=colour, alpha=0.3, linewidth=0)
    kinds = {str(name).split()[0] for name in diagram.direction.values}
    for kind, words in _WORDS.items():
        if kind in kinds:
            top.plot([], [], ".", color=_COLOURS[kind], label=words)
    if branches is not None:
        _lay_over(top, [branch for _, branch in branches.groupby("branch")])
    top.legend(loc="lower left", markerscale=1.5)
    top.set_ylabel("displacement at $\\tau = 0$\n(static defl.)")
    middle.axhline(0.0, color="black", linewidth=0.5)
    middle.set_ylabel("largest Lyapunov\nexponent per period")
    _draw_shares(bottom, shares)
    bottom.set_xlabel(style.TUNING)
    bottom.set_xlim(tuning[0], tuning[-1])
    style.add_scale(top, tuning, diagram.speed.values, "speed (rpm)")
    return figure


def _lay_over(axes, branches):
    """Draw continued branches, dashed where they are unstable."""
    for branch in branches:
        tuning, states = branch.tuning.values, branch.state.values[:, 0]
        stable = branch.stable.values.astype(bool)
        for shown, line, width in ((stable, "-", 0.8), (~stable, (0, (4, 2)), 0.6)):
            # A piece is drawn up to the point where stability changes.
            joined = shown | np.roll(shown, 1)
            joined[0] = shown[0]
            values = np.where(joined, states, np.nan)
            axes.plot(tuning, values, color="black", linestyle=line, linewidth=width)
    if branches:
        axes.plot([], [], color="black", linewidth=0.8, label="continued, stable")
        axes.plot([], [], color="black", linestyle="--", linewidth=0.6, label="unstable")


def _draw_shares(axes, shares):
    """Draw the shares of the families, one above the other."""
    share = shares.share.values.T
    kinds, periods = shares.attractor_kind.values, shares.period.values
    chosen = looks(kinds)
    height = np.nan_to_num((shares.displacement_max - shares.displacement_min).values.T)
    names = []
    for i, row in enumerate(share):
        name = f"period {periods[i]}, height {height[i, row.argmax()]:.1f}"
        names.append("" if row.max() < _NAMED else name if kinds[i] == 0 else _KINDS[kinds[i]])
    layers = axes.stackplot(
        shares.tuning.values, share, colors=[colour for colour, _ in chosen], step="mid"
    )
    for layer in layers:
        layer.set_edgecolor("grey")
        layer.set_linewidth(0.3)
    handles = [(layer, name) for layer, name in zip(layers, names, strict=True) if name]
    axes.legend(
        *zip(*handles, strict=True),
        loc="upper center",
        bbox_to_anchor=(0.5, -0.28),
        ncols=4,
        title="orbits: period in mesh periods, height in static deflections",
        title_fontsize=7.5,
        frameon=False,
        columnspacing=1.0,
    )
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel("share of the\ninitial states")

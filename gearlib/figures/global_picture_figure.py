"""Basins of attraction, Poincaré sections and bifurcation diagrams."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearlib.figures import panels, style

#: Colours of periodic attractors in their order; other kinds of attractors have their own.
_PERIODIC_COLOURS = (*style.PALETTE, "#F0E442", "#8C510A", "#762A83", "#A6DBA0", "#FDB863")
_KINDS = ("period", "chaotic", "unbounded", "undecided")
_KIND_COLOURS = (None, "#000000", "#D9D9D9", "#FFFFFF")
_MARKERS = "o^sDvP*X<>hp"
#: Colours of regular orbits in sections, and of chaotic and undecided ones.
_REGULAR = ("#0072B2", "#009E73", "#4D4D4D", "#56B4E9", "#CC79A7")
_CHAOTIC, _UNDECIDED = "#D55E00", "#A0A0A0"
#: Direction -> words, colour and size of its dots in bifurcation diagrams.
_DIRECTIONS = {
    "cold": ("random initial states", "#8A8A8A", 1.4),
    "down": ("tuning going down", "#D55E00", 1.8),
    "up": ("tuning going up", "#0072B2", 1.8),
}
#: Families whose largest share of the initial states is smaller have no entry in the legend.
MIN_NAMED_SHARE = 0.04
#: Half the width of the band around a Lyapunov exponent, in standard errors.
BAND_WIDTH = 3.0
_DOTS = {"markeredgewidth": 0.0, "rasterized": True}
_BELOW = {"loc": "upper center", "frameon": False, "columnspacing": 1.0}


def attractor_colours(kinds: np.ndarray) -> list[str]:
    """Return the colour of each attractor from the codes of their kinds."""
    periodic = iter(np.resize(_PERIODIC_COLOURS, len(kinds)))
    return [_KIND_COLOURS[kind] or str(next(periodic)) for kind in kinds]


@style.styled()
def draw_basins(data: xr.Dataset) -> Figure:
    """Draw the basins of all cases of `gearlib.studies.global_picture.basin_cases`.

    Every initial state has the colour of its attractor, whose stroboscopic states are marked
    where they lie in the picture; below, periods and shares.
    """
    figure, grid = style.panels(data.sizes["case"], 3.9)
    for i, axes in enumerate(grid):
        case = data.isel(case=i, attractor=slice(int(data.basin[i].max()) + 1))
        colours = attractor_colours(case.attractor_kind.values)
        states = case.displacement.values, case.velocity.values
        style.map_of_codes(axes, *states, case.basin.values.T, colours)
        axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim(), title=case.case.item())
        for j, (colour, marker) in enumerate(zip(colours, _MARKERS * 9, strict=False)):
            _mark_attractor(axes, case.isel(attractor=j), colour, marker)
        _label_plane(axes, "initial ")
        options = {"fontsize": 6.5, "handletextpad": 0.2, "bbox_to_anchor": (0.5, -0.16)}
        axes.legend(ncols=2, **_BELOW, **options)
    return figure


def _mark_attractor(axes: Axes, attractor: xr.Dataset, colour: str, marker: str):
    """Mark the states of a periodic attractor, and name any attractor for the legend."""
    kind, share = int(attractor.attractor_kind), 100.0 * float(attractor.share)
    name = f"period {int(attractor.period)}" if kind == 0 else _KINDS[kind]
    words = f"{name}: {share:.1f} ± {100.0 * float(attractor.share_error):.2f} %"
    x, v = attractor.state.values.T if kind == 0 else ([], [])
    edge = "white" if kind == 0 else "grey"
    style.dots(axes, x, v, marker, colour, 5.5, markeredgecolor=edge, label=words)


def _label_plane(axes: Axes, word=""):
    """Label a phase plane, the velocity only in the first column."""
    axes.set_xlabel(f"{word}displacement (static defl.)")
    axes.set_ylabel(word + style.RATE if axes.get_subplotspec().is_first_col() else "")


@style.styled()
def draw_sections(data: xr.Dataset) -> Figure:
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
            states = case.displacement[j], case.velocity[j]
            style.dots(axes, *states, ".", colours[j], 0.9 if chaotic[j] else 1.2, **_DOTS)
        words = f"$\\tau$ = {np.degrees(float(case.phase)):.0f}°; {100.0 * chaotic.mean():.0f} %"
        more = f", {undecided.sum()} undecided" if undecided.any() else ""
        axes.set_title(f"{case.case.item()}\n{words} of {chaotic.size} orbits chaotic{more}")
        _label_plane(axes)
    return figure


@style.styled()
def draw_bifurcation(diagram: xr.Dataset, shares: xr.Dataset, branches=None) -> Figure:
    """Draw diagram, exponents and shares of `gearlib.studies.global_picture.bifurcation`.

    `branches`, if given, are laid over the diagram, dashed where unstable: tuning, state
    (point, coordinate), stable and branch along ``point``.
    """
    figure = style.page(6.6)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(2.4, 1.0, 1.4))
    for kind, (words, colour, size) in _DIRECTIONS.items():
        for name in [name for name in diagram.direction.values if name.split()[0] == kind]:
            motion = diagram.sel(direction=name)
            strobes = motion.displacement.transpose("tuning", "strobe")
            style.dots(top, motion.tuning, strobes, ".", colour, size, **_DOTS)
            top.lines[-1].set_label(words)
            _draw_exponents(middle, motion, colour, kind != "cold")
    if branches is not None:
        _lay_over(top, branches)
    named = dict(zip(*reversed(top.get_legend_handles_labels()), strict=True))
    top.legend(named.values(), named, loc="lower left", markerscale=4.0)
    top.set_ylabel("displacement at $\\tau = 0$\n(static defl.)")
    middle.axhline(0.0, color="black", linewidth=0.5)
    middle.set_ylabel(panels.axis_label(diagram.exponent, 24))
    _draw_family_shares(bottom, shares)
    bottom.set(xlabel=panels.axis_label(diagram.tuning), xlim=diagram.tuning.values[[0, -1]])
    style.second_scale(top, float(diagram.speed[-1] / diagram.tuning[-1]), "speed (rpm)")
    return figure


def _draw_exponents(axes: Axes, motion: xr.Dataset, colour: str, carried: bool):
    """Draw exponents as dots; of carried motions with a band, and a line where they settle."""
    exponent, error = motion.exponent, BAND_WIDTH * motion.uncertainty
    joined = motion.settled.astype(bool) & carried
    style.dots(axes, motion.tuning, exponent.where(~joined), ".", colour, 2.0, markeredgewidth=0.0)
    axes.plot(motion.tuning, exponent.where(joined), color=colour, linewidth=0.7)
    if carried:
        band = {"color": colour, "alpha": 0.3, "linewidth": 0}
        axes.fill_between(motion.tuning, exponent - error, exponent + error, **band)


def _lay_over(axes: Axes, branches: xr.Dataset):
    """Draw continued branches, dashed where they are unstable."""
    for _, branch in branches.groupby("branch"):
        stable = branch.stable.values.astype(bool)
        for chosen, words, dashes in (
            (stable, "continued, stable", "-"),
            (~stable, "unstable", "--"),
        ):
            # A piece is drawn up to the point where stability changes.
            joined = chosen | np.append(False, chosen[:-1])
            states = branch.state[:, 0].where(joined)
            axes.plot(branch.tuning, states, color="black", ls=dashes, lw=0.7, label=words)


def _draw_family_shares(axes: Axes, shares: xr.Dataset):
    """Draw the shares of the families of attractors, one above the other."""
    share = shares.share.transpose("attractor_family", ...).fillna(0.0)
    largest = share.argmax("tuning")
    heights = (shares.displacement_max - shares.displacement_min).isel(tuning=largest).values
    kinds, periods = shares.attractor_kind.values, shares.period.values
    names = [
        f"period {period}, height {height:.1f}" if kind == 0 else _KINDS[kind]
        for kind, period, height in zip(kinds, periods, heights, strict=True)
    ]
    shown = (share.max("tuning") >= MIN_NAMED_SHARE).values
    labels = [name if named else None for name, named in zip(names, shown, strict=True)]
    options = {"edgecolor": "grey", "linewidth": 0.3, "step": "mid", "labels": labels}
    axes.stackplot(shares.tuning, share, colors=attractor_colours(kinds), **options)
    title = "orbits: period in mesh periods, height in static deflections"
    options = {"bbox_to_anchor": (0.5, -0.28), "title": title, "title_fontsize": 7.5}
    axes.legend(ncols=4, **_BELOW, **options)
    axes.set(ylim=(0.0, 1.0), ylabel="share of the\ninitial states")

"""Basins of attraction, Poincaré sections and bifurcation diagrams."""

import numpy as np
import xarray as xr

from gearlib.colours import MOTIONS, of_categories
from gearlib.figures import panels, style

_KINDS = ("period", "chaotic", "unbounded", "undecided")
#: Code of periodic attractors, and codes of chaotic and undecided orbits in sections.
_PERIODIC, _CHAOTIC, _UNDECIDED = 0, 1, 2
#: Colour of the attractors of a kind; each periodic one has a colour of its own.
_KIND_COLOURS = (None, "#000000", "#D9D9D9", "#FFFFFF")
_MARKERS = "o^sDvP*X<>hp"
#: Colours of regular orbits in sections, and of chaotic and undecided ones.
_REGULAR_COLOURS = ("#0072B2", "#009E73", "#4D4D4D", "#56B4E9", "#CC79A7")
_CHAOTIC_COLOUR, _UNDECIDED_COLOUR = MOTIONS["chaotic"], "#A0A0A0"
#: Direction -> label, colour and size of its markers in bifurcation diagrams.
_DIRECTIONS = {
    "cold": ("random initial states", "#8A8A8A", 1.4),
    "down": ("tuning going down", "#D55E00", 1.8),
    "up": ("tuning going up", "#0072B2", 1.8),
}
#: Families whose largest share of the initial states is smaller have no entry in the legend.
MIN_SHARE_IN_LEGEND = 0.04
#: Half width of the band around a Lyapunov exponent, in standard errors.
BAND_HALF_WIDTH = 3.0
_MARKER_OPTIONS = {"markeredgewidth": 0.0, "rasterized": True}
_LEGEND_BELOW = {"loc": "upper center", "frameon": False, "columnspacing": 1.0}


def attractor_colours(kinds: np.ndarray) -> list[str]:
    """Return a colour for each attractor; `kinds` are indices in `_KINDS`, 0 for periodic ones."""
    periodic = of_categories()
    return [_KIND_COLOURS[kind] or next(periodic) for kind in kinds]


@style.styled()
def draw_basins(data: xr.Dataset):
    """Return a figure of basins of attraction, a panel for each case.

    `data` is a result of `gearlib.studies.global_picture.basin_cases`. Every initial state has the
    colour of its attractor; legends have the periods of the attractors and the shares of basins.
    """
    figure, grid = style.panel_figure(data.sizes["case"], height=3.9)
    for i, axes in enumerate(grid):
        case = data.isel(case=i, attractor=slice(int(data.basin[i].max()) + 1))
        colours = attractor_colours(case.attractor_kind.values)
        states = case.displacement.values, case.velocity.values
        style.draw_code_map(axes, *states, case.basin.values.T, colours)
        axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim(), title=case.case.item())
        for j, (colour, marker) in enumerate(zip(colours, _MARKERS * len(colours), strict=False)):
            _mark_attractor(axes, case.isel(attractor=j), colour, marker)
        _label_plane(axes, "initial ")
        options = {"fontsize": 6.5, "handletextpad": 0.2, "bbox_to_anchor": (0.5, -0.16)}
        axes.legend(ncols=2, **_LEGEND_BELOW, **options)
    return figure


def _mark_attractor(axes, attractor: xr.Dataset, colour: str, marker: str):
    """Mark the stroboscopic states of a periodic attractor; label any attractor in the legend."""
    kind, share = int(attractor.attractor_kind), 100.0 * float(attractor.share)
    is_periodic = kind == _PERIODIC
    name = f"period {int(attractor.period)}" if is_periodic else _KINDS[kind]
    label = f"{name}: {share:.1f} ± {100.0 * float(attractor.share_error):.2f} %"
    x, v = attractor.state.values.T if is_periodic else ([], [])
    edge = "white" if is_periodic else "grey"
    style.draw_markers(axes, x, v, marker, colour, 5.5, markeredgecolor=edge, label=label)


def _label_plane(axes, prefix=""):
    """Label the axes of a phase plane, the velocity in the first column only."""
    axes.set_xlabel(f"{prefix}displacement (static defl.)")
    axes.set_ylabel(prefix + style.VELOCITY_LABEL if axes.get_subplotspec().is_first_col() else "")


@style.styled()
def draw_sections(data: xr.Dataset):
    """Return a figure of Poincaré sections, a panel for each case.

    `data` is a result of `gearlib.studies.global_picture.sections`. Chaotic orbits are orange,
    undecided ones grey, regular orbits have other colours.
    """
    figure, grid = style.panel_figure(data.sizes["case"], height=3.3)
    for i, axes in enumerate(grid):
        case = data.isel(case=i)
        chaotic, undecided = (case.chaotic.values == code for code in (_CHAOTIC, _UNDECIDED))
        colours = np.resize(_REGULAR_COLOURS, chaotic.size)
        colours[chaotic], colours[undecided] = _CHAOTIC_COLOUR, _UNDECIDED_COLOUR
        # Chaotic orbits are drawn first, so that islands in them are visible.
        for j in np.argsort(~chaotic, kind="stable"):
            states, size = (case.displacement[j], case.velocity[j]), 0.9 if chaotic[j] else 1.2
            style.draw_markers(axes, *states, ".", colours[j], size, **_MARKER_OPTIONS)
        phase, share = np.degrees(float(case.phase)), 100.0 * chaotic.mean()
        chaos = f"$\\tau$ = {phase:.5g}°; {share:.3g} % of {chaotic.size} orbits chaotic"
        suffix = f", {undecided.sum()} undecided" if undecided.any() else ""
        axes.set_title(f"{case.case.item()}\n{chaos}{suffix}")
        _label_plane(axes)
    return figure


@style.styled()
def draw_bifurcation(diagram: xr.Dataset, shares: xr.Dataset, branches=None):
    """Return a figure of a bifurcation diagram, Lyapunov exponents and shares of attractors.

    `diagram` and `shares` are results of `gearlib.studies.global_picture.bifurcation`. `branches`,
    a result of `gearlib.studies.resonance.branches` or None, are drawn over the diagram. The first
    word of a direction is "up", "down" or "cold" (random initial states).
    """
    figure = style.page_figure(height=6.6)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(2.4, 1.0, 1.4))
    for kind, (label, colour, size) in _DIRECTIONS.items():
        for name in [name for name in diagram.direction.values if name.split()[0] == kind]:
            motion = diagram.sel(direction=name)
            strobes = motion.displacement.transpose("tuning", "strobe")
            style.draw_markers(top, motion.tuning, strobes, ".", colour, size, **_MARKER_OPTIONS)
            top.lines[-1].set_label(label)
            _draw_exponents(middle, motion, colour, warm_started=kind != "cold")
    if branches is not None:
        _draw_branches(top, branches)
    # Several lines have the same label, which the legend shows once.
    handles, labels = top.get_legend_handles_labels()
    handle_of = dict(zip(labels, handles, strict=True))
    top.legend(handle_of.values(), handle_of, loc="lower left", markerscale=4.0)
    top.set_ylabel("displacement at $\\tau = 0$\n(static defl.)")
    middle.axhline(0.0, color="black", linewidth=0.5)
    middle.set_ylabel(panels.axis_label(diagram.exponent, width=24))
    _draw_family_shares(bottom, shares)
    bottom.set(xlabel=panels.axis_label(diagram.tuning), xlim=diagram.tuning.values[[0, -1]])
    style.second_scale(top, float(diagram.speed[-1] / diagram.tuning[-1]), "speed (rpm)")
    return figure


def _draw_exponents(axes, motion: xr.Dataset, colour: str, warm_started: bool):
    """Draw the Lyapunov exponents of one direction over the tuning as dots.

    Warm-started motions have a line where they settle, and a band of uncertainty.
    """
    exponent, error = motion.exponent, BAND_HALF_WIDTH * motion.uncertainty
    has_line = motion.settled.astype(bool) & warm_started
    dots = exponent.where(~has_line)
    style.draw_markers(axes, motion.tuning, dots, ".", colour, 2.0, markeredgewidth=0.0)
    axes.plot(motion.tuning, exponent.where(has_line), color=colour, linewidth=0.7)
    if warm_started:
        band = {"color": colour, "alpha": 0.3, "linewidth": 0}
        axes.fill_between(motion.tuning, exponent - error, exponent + error, **band)


def _draw_branches(axes, branches: xr.Dataset):
    """Draw the initial displacement of continued branches of orbits, dashed where unstable."""
    for _, branch in branches.groupby("branch"):
        stable = branch.stable.values.astype(bool)
        curves = (stable, "continued, stable", "-"), (~stable, "unstable", "--")
        for mask, label, dashes in curves:
            # Each line ends at the first point of the next one, so that no gap appears.
            extended_mask = mask | np.append(False, mask[:-1])
            displacement = branch.state[:, 0].where(extended_mask)
            axes.plot(branch.tuning, displacement, color="black", ls=dashes, lw=0.7, label=label)


def _draw_family_shares(axes, shares: xr.Dataset):
    """Draw each attractor family's share of the initial states over the tuning, stacked.

    Labels have the peak-to-peak displacement ("height") of orbits where their share is largest.
    """
    share = shares.share.transpose("attractor_family", ...).fillna(0.0)
    peak_to_peak = shares.displacement_max - shares.displacement_min
    heights = peak_to_peak.isel(tuning=share.argmax("tuning")).values
    kinds, periods = shares.attractor_kind.values, shares.period.values
    texts = style.number_texts(heights, digits=1, form="f", decimals=1)
    names = [
        f"period {period}, height {height}" if kind == _PERIODIC else _KINDS[kind]
        for kind, period, height in zip(kinds, periods, texts, strict=True)
    ]
    is_labelled = (share.max("tuning") >= MIN_SHARE_IN_LEGEND).values
    labels = [name if shown else None for name, shown in zip(names, is_labelled, strict=True)]
    options = {"edgecolor": "grey", "linewidth": 0.3, "step": "mid", "labels": labels}
    axes.stackplot(shares.tuning, share, colors=attractor_colours(kinds), **options)
    title = "orbits: period in mesh periods, height in static deflections"
    options = {"bbox_to_anchor": (0.5, -0.28), "title": title, "title_fontsize": 7.5}
    axes.legend(ncols=4, **_LEGEND_BELOW, **options)
    axes.set(ylim=(0.0, 1.0), ylabel="share of the\ninitial states")

"""Basins of attraction, Poincaré sections and bifurcation diagrams."""

import numpy as np
import xarray as xr

from gearlib.colours import MOTIONS, distinct_colours
from gearlib.figures import panels, style

_KINDS = ("period", "chaotic", "unbounded", "undecided")
#: Index of periodic attractors in `_KINDS`; codes of chaotic and undecided orbits in sections.
_PERIODIC, _CHAOTIC, _UNDECIDED = 0, 1, 2
#: Colour of the attractors of each kind; None means that each attractor has its own colour.
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
#: Attractor families with a smaller basin fraction have no legend entry.
MIN_SHARE_IN_LEGEND = 0.04
#: Half width of the band around a Lyapunov exponent, in standard errors.
BAND_HALF_WIDTH = 3.0
_MARKER_OPTIONS = {"markeredgewidth": 0.0, "rasterized": True}
_LEGEND_BELOW = {"loc": "upper center", "frameon": False, "columnspacing": 1.0}


def attractor_colours(kinds: np.ndarray) -> list[str]:
    """Return one colour for each attractor, i.e. for each motion to which initial states lead.

    `kinds` contains the kind of each attractor as an index of `_KINDS`: periodic 0, chaotic 1 etc.
    Each periodic attractor gets its own colour; attractors of any other kind share one.
    """
    periodic_colours = distinct_colours()
    return [_KIND_COLOURS[kind] or next(periodic_colours) for kind in kinds]


@style.rc_context()
def draw_basins(data: xr.Dataset):
    """Return a figure of basins of attraction, with one panel for each case.

    Each point of a panel is an initial state, coloured by the motion (attractor) to which it leads.
    Legends state the period of each attractor and its basin fraction. `data` is a result of
    `gearlib.studies.global_picture.compute_basins`.
    """
    figure, grid = style.panel_figure(data.sizes["case"], height=3.9)
    for i, axes in enumerate(grid):
        # Basins contain the indices of attractors. This case may have fewer than the dataset.
        case = data.isel(case=i, attractor=slice(int(data.basin[i].max()) + 1))
        colours = attractor_colours(case.attractor_kind.values)
        states = case.displacement.values, case.velocity.values
        style.draw_category_map(axes, *states, case.basin.values.T, colours)
        axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim(), title=case.case.item())
        for j, (colour, marker) in enumerate(zip(colours, _MARKERS * len(colours), strict=False)):
            _mark_attractor(axes, case.isel(attractor=j), colour, marker)
        _label_plane(axes, "initial ")
        options = {"fontsize": 6.5, "handletextpad": 0.2, "bbox_to_anchor": (0.5, -0.16)}
        axes.legend(ncols=2, **_LEGEND_BELOW, **options)
    return figure


def _mark_attractor(axes, attractor: xr.Dataset, colour: str, marker: str):
    """Draw markers at the stroboscopic states of an attractor, with a label for the legend.

    Only periodic attractors have such markers. The label states the period or the kind, and the
    percentage of initial states that lead to the attractor, with its standard error.
    """
    kind, share = int(attractor.attractor_kind), 100.0 * float(attractor.share)
    is_periodic = kind == _PERIODIC
    name = f"period {int(attractor.period)}" if is_periodic else _KINDS[kind]
    label = f"{name}: {share:.1f} ± {100.0 * float(attractor.share_error):.2f} %"
    x, v = attractor.state.values.T if is_periodic else ([], [])
    edge_colour = "white" if is_periodic else "grey"
    style.draw_markers(axes, x, v, marker, colour, 5.5, markeredgecolor=edge_colour, label=label)


def _label_plane(axes, prefix=""):
    """Label the axes of a phase plane.

    `prefix`, e.g. "initial ", precedes both names. The velocity is only labelled in the first
    column of panels.
    """
    axes.set_xlabel(f"{prefix}displacement (static defl.)")
    if axes.get_subplotspec().is_first_col():
        axes.set_ylabel(prefix + style.VELOCITY_LABEL)


@style.rc_context()
def draw_sections(data: xr.Dataset):
    """Return a figure of Poincaré sections (states once per mesh period), with one panel per case.

    Titles state the mesh phase tau of the section. Chaotic orbits are orange, undecided ones grey;
    regular orbits have other colours. `data` is a result of
    `gearlib.studies.global_picture.compute_poincare_sections`; its variable chaotic is 1 for
    chaotic and 2 for undecided orbits.
    """
    figure, grid = style.panel_figure(data.sizes["case"], height=3.3)
    for i, axes in enumerate(grid):
        case = data.isel(case=i)
        is_chaotic = case.chaotic.values == _CHAOTIC
        is_undecided = case.chaotic.values == _UNDECIDED
        colours = np.resize(_REGULAR_COLOURS, is_chaotic.size)
        colours[is_chaotic], colours[is_undecided] = _CHAOTIC_COLOUR, _UNDECIDED_COLOUR
        # Chaotic orbits are drawn first, so that they do not hide regular orbits.
        for j in np.argsort(~is_chaotic, kind="stable"):
            states, size = (case.displacement[j], case.velocity[j]), 0.9 if is_chaotic[j] else 1.2
            style.draw_markers(axes, *states, ".", colours[j], size, **_MARKER_OPTIONS)
        phase, percentage = np.degrees(float(case.phase)), 100.0 * is_chaotic.mean()
        title = f"{case.case.item()}\n$\\tau$ = {phase:.5g}°; "
        title += f"{percentage:.3g} % of {is_chaotic.size} orbits chaotic"
        if is_undecided.any():
            title += f", {is_undecided.sum()} undecided"
        axes.set_title(title)
        _label_plane(axes)
    return figure


@style.rc_context()
def draw_bifurcation(diagram: xr.Dataset, shares: xr.Dataset, branches=None):
    """Return a figure of a bifurcation diagram, Lyapunov exponents and basin fractions.

    All are drawn over the tuning (mesh frequency over natural frequency). `diagram` and `shares`
    are the two results of `gearlib.studies.global_picture.compute_bifurcation`. The names of
    directions in `diagram` begin with "up" or "down" (increasing or decreasing tuning) or "cold"
    (random initial states). `branches`, if given, are periodic orbits to draw in the diagram, a
    result of `gearlib.studies.resonance.compute_branches`.
    """
    figure = style.page_figure(height=6.6)
    grid = figure.subplots(3, 1, sharex=True, height_ratios=(2.4, 1.0, 1.4))
    diagram_axes, exponent_axes, share_axes = grid
    for kind, (label, colour, size) in _DIRECTIONS.items():
        for direction in diagram.direction.values:
            if direction.split()[0] != kind:
                continue
            motion = diagram.sel(direction=direction)
            # Each tuning has several dots, one for each recorded mesh period ("strobe").
            points = motion.tuning, motion.displacement.transpose("tuning", "strobe")
            style.draw_markers(diagram_axes, *points, ".", colour, size, **_MARKER_OPTIONS)
            diagram_axes.lines[-1].set_label(label)
            _draw_exponents(exponent_axes, motion, colour, warm_started=kind != "cold")
    if branches is not None:
        _draw_branches(diagram_axes, branches)
    # Lines may have the same label, which must appear only once in the legend.
    handles, labels = diagram_axes.get_legend_handles_labels()
    handle_by_label = dict(zip(labels, handles, strict=True))
    diagram_axes.legend(
        handle_by_label.values(), handle_by_label, loc="lower left", markerscale=4.0
    )
    diagram_axes.set_ylabel("displacement at $\\tau = 0$\n(static defl.)")
    exponent_axes.axhline(0.0, color="black", linewidth=0.5)
    exponent_axes.set_ylabel(panels.axis_label(diagram.exponent, width=24))
    _draw_family_shares(share_axes, shares)
    share_axes.set(xlabel=panels.axis_label(diagram.tuning), xlim=diagram.tuning.values[[0, -1]])
    style.add_secondary_axis(
        diagram_axes, float(diagram.speed[-1] / diagram.tuning[-1]), "speed (rpm)"
    )
    return figure


def _draw_exponents(axes, motion: xr.Dataset, colour: str, warm_started: bool):
    """Draw the largest Lyapunov exponents of one direction of a sweep over the tuning.

    The tuning is the mesh frequency over the natural frequency. Exponents are drawn as dots. If
    each run starts from the final state of the previous one (`warm_started`), periodic motions
    (`settled`) get a line instead, and a band shows `BAND_HALF_WIDTH` standard errors.
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
    """Draw branches of periodic orbits over the tuning, dashed where the orbits are unstable.

    The tuning is the mesh frequency over the natural frequency. The displacement is the one at the
    start of a mesh period.
    """
    for _, branch in branches.groupby("branch"):
        stable = branch.stable.values.astype(bool)
        curves = (stable, "continued, stable", "-"), (~stable, "unstable", "--")
        for mask, label, dashes in curves:
            # Extend the mask by the point after each section to avoid a gap between the lines.
            extended_mask = mask | np.append(False, mask[:-1])
            displacement = branch.state[:, 0].where(extended_mask)
            axes.plot(branch.tuning, displacement, color="black", ls=dashes, lw=0.7, label=label)


def _draw_family_shares(axes, shares: xr.Dataset):
    """Draw the basin fractions of all attractor families over the tuning as stacked areas.

    The tuning is the mesh frequency over the natural frequency. A family is an attractor traced
    over the tuning. Its label states the peak-to-peak displacement ("height") where its fraction is
    largest; families with fractions below `MIN_SHARE_IN_LEGEND` have no label.
    """
    share = shares.share.transpose("attractor_family", ...).fillna(0.0)
    peak_to_peak = shares.displacement_max - shares.displacement_min
    heights = peak_to_peak.isel(tuning=share.argmax("tuning")).values
    kinds, periods = shares.attractor_kind.values, shares.period.values
    texts = style.format_numbers(heights, digits=1, form="f", decimals=1)
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

"""Basins of attraction, Poincaré sections and bifurcation diagrams."""

import numpy as np
import xarray as xr

from gearlib.figures import panels, style

#: Colours of periodic attractors in turn; each other kind of attractor has one colour.
_PERIODIC_COLOURS = (*style.PALETTE, "#F0E442", "#8C510A", "#762A83", "#A6DBA0", "#FDB863")
_KINDS = ("period", "chaotic", "unbounded", "undecided")
_KIND_COLOURS = (None, "#000000", "#D9D9D9", "#FFFFFF")
_MARKERS = "o^sDvP*X<>hp"
#: Colours of regular orbits in sections, and of chaotic and undecided ones.
_REGULAR = ("#0072B2", "#009E73", "#4D4D4D", "#56B4E9", "#CC79A7")
_CHAOTIC, _UNDECIDED = "#D55E00", "#A0A0A0"
#: Direction -> label, colour and size of its dots in bifurcation diagrams.
_DIRECTIONS = {
    "cold": ("random initial states", "#8A8A8A", 1.4),
    "down": ("tuning going down", "#D55E00", 1.8),
    "up": ("tuning going up", "#0072B2", 1.8),
}
#: Families whose largest share of the initial states is smaller have no entry in the legend.
MIN_NAMED_SHARE = 0.04
#: Half the width of the band around a Lyapunov exponent, in standard errors.
BAND_WIDTH = 3.0
_DOT_OPTIONS = {"markeredgewidth": 0.0, "rasterized": True}
_LEGEND_BELOW = {"loc": "upper center", "frameon": False, "columnspacing": 1.0}


def attractor_colours(kinds: np.ndarray) -> list[str]:
    """Return a colour for each attractor; `kinds` are codes: 0 periodic, then as in `_KINDS`."""
    periodic = iter(np.resize(_PERIODIC_COLOURS, len(kinds)))
    return [_KIND_COLOURS[kind] or str(next(periodic)) for kind in kinds]


@style.styled()
def draw_basins(data: xr.Dataset):
    """Return a figure of the basins of all cases of `gearlib.studies.global_picture.basin_cases`.

    Every initial state has the colour of its attractor, whose stroboscopic states are marked;
    legends have the attractors' periods and shares.
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
        axes.legend(ncols=2, **_LEGEND_BELOW, **options)
    return figure


def _mark_attractor(axes, attractor: xr.Dataset, colour: str, marker: str):
    """Mark the stroboscopic states of a periodic attractor; label any attractor in the legend."""
    kind, share = int(attractor.attractor_kind), 100.0 * float(attractor.share)
    name = f"period {int(attractor.period)}" if kind == 0 else _KINDS[kind]
    label = f"{name}: {share:.1f} ± {100.0 * float(attractor.share_error):.2f} %"
    x, v = attractor.state.values.T if kind == 0 else ([], [])
    edge = "white" if kind == 0 else "grey"
    style.dots(axes, x, v, marker, colour, 5.5, markeredgecolor=edge, label=label)


def _label_plane(axes, prefix=""):
    """Label the axes of a phase plane, the velocity in the first column only."""
    axes.set_xlabel(f"{prefix}displacement (static defl.)")
    axes.set_ylabel(prefix + style.RATE if axes.get_subplotspec().is_first_col() else "")


@style.styled()
def draw_sections(data: xr.Dataset):
    """Return a figure of Poincaré sections of all cases of `gearlib.studies.global_picture`.

    `data` is that of its `sections`. Chaotic orbits are orange, undecided ones grey; each regular
    orbit has one of the other colours.
    """
    figure, grid = style.panels(data.sizes["case"], 3.3)
    for i, axes in enumerate(grid):
        case = data.isel(case=i)
        chaotic, undecided = case.chaotic.values == 1, case.chaotic.values == 2
        regular = np.resize(_REGULAR, chaotic.size)
        colours = np.where(chaotic, _CHAOTIC, np.where(undecided, _UNDECIDED, regular))
        # Chaotic orbits are drawn first, so that islands in them are visible.
        for j in np.argsort(~chaotic, kind="stable"):
            states = case.displacement[j], case.velocity[j]
            style.dots(axes, *states, ".", colours[j], 0.9 if chaotic[j] else 1.2, **_DOT_OPTIONS)
        phase, share = np.degrees(float(case.phase)), 100.0 * chaotic.mean()
        chaos = f"$\\tau$ = {phase:.0f}°; {share:.0f} % of {chaotic.size} orbits chaotic"
        suffix = f", {undecided.sum()} undecided" if undecided.any() else ""
        axes.set_title(f"{case.case.item()}\n{chaos}{suffix}")
        _label_plane(axes)
    return figure


@style.styled()
def draw_bifurcation(diagram: xr.Dataset, shares: xr.Dataset, branches=None):
    """Return a figure of a bifurcation diagram, Lyapunov exponents and shares of attractors.

    `diagram` and `shares` are those of `gearlib.studies.global_picture.bifurcation`. `branches` of
    orbits, or None, are drawn over it: tuning, state, stable and branch number of each point.
    """
    figure = style.page(6.6)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(2.4, 1.0, 1.4))
    for kind, (label, colour, size) in _DIRECTIONS.items():
        for name in [name for name in diagram.direction.values if name.split()[0] == kind]:
            motion = diagram.sel(direction=name)
            strobes = motion.displacement.transpose("tuning", "strobe")
            style.dots(top, motion.tuning, strobes, ".", colour, size, **_DOT_OPTIONS)
            top.lines[-1].set_label(label)
            _draw_exponents(middle, motion, colour, kind != "cold")
    if branches is not None:
        _draw_branches(top, branches)
    # Several lines have the same label, which the legend shows once.
    handles, labels = top.get_legend_handles_labels()
    handle_of = dict(zip(labels, handles, strict=True))
    top.legend(handle_of.values(), handle_of, loc="lower left", markerscale=4.0)
    top.set_ylabel("displacement at $\\tau = 0$\n(static defl.)")
    middle.axhline(0.0, color="black", linewidth=0.5)
    middle.set_ylabel(panels.axis_label(diagram.exponent, 24))
    _draw_family_shares(bottom, shares)
    bottom.set(xlabel=panels.axis_label(diagram.tuning), xlim=diagram.tuning.values[[0, -1]])
    style.second_scale(top, float(diagram.speed[-1] / diagram.tuning[-1]), "speed (rpm)")
    return figure


def _draw_exponents(axes, motion: xr.Dataset, colour: str, warm_started: bool):
    """Draw the Lyapunov exponents of one direction over the tuning as dots.

    Warm-started motions (`carried`) get a line where they settle, and a band of uncertainty.
    """
    exponent, error = motion.exponent, BAND_WIDTH * motion.uncertainty
    joined = motion.settled.astype(bool) & warm_started
    style.dots(axes, motion.tuning, exponent.where(~joined), ".", colour, 2.0, markeredgewidth=0.0)
    axes.plot(motion.tuning, exponent.where(joined), color=colour, linewidth=0.7)
    if warm_started:
        band = {"color": colour, "alpha": 0.3, "linewidth": 0}
        axes.fill_between(motion.tuning, exponent - error, exponent + error, **band)


def _draw_branches(axes, branches: xr.Dataset):
    """Draw the initial displacement of continued branches of orbits, dashed where unstable."""
    for _, branch in branches.groupby("branch"):
        stable = branch.stable.values.astype(bool)
        curves = (stable, "continued, stable", "-"), (~stable, "unstable", "--")
        for mask, label, dashes in curves:
            # Each line goes on to the point where stability changes, so that no gap appears.
            joined = mask | np.append(False, mask[:-1])
            states = branch.state[:, 0].where(joined)
            axes.plot(branch.tuning, states, color="black", ls=dashes, lw=0.7, label=label)


def _draw_family_shares(axes, shares: xr.Dataset):
    """Draw each attractor family's share of the initial states over the tuning, stacked."""
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
    axes.legend(ncols=4, **_LEGEND_BELOW, **options)
    axes.set(ylim=(0.0, 1.0), ylabel="share of the\ninitial states")

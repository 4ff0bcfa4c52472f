"""Branches of periodic orbits with their special points, and how damping moves these."""

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from gearlib.figures import panels, style

_HEIGHT = 6.6
#: Number of points on both sides of a fold that show on which side the branch lies.
POINTS_BESIDE_FOLD = 6
#: Special points within these fractions of the ranges of tuning and height have one common text.
TEXT_WIDTH, TEXT_HEIGHT = 0.05, 0.06
#: Code of `gearlib.analysis.orbits.special_points` -> (name, colour, marker).
SPECIAL_POINTS = {
    1: ("fold", style.PALETTE[4], "o"),
    2: ("period doubling", style.PALETTE[5], "D"),
    3: ("Neimark-Sacker", style.PALETTE[1], "^"),
    4: ("grazing", style.PALETTE[0], "s"),
    5: ("branch point", style.PALETTE[3], "x"),
}


@style.styled()
def draw(branches: xr.Dataset, loci: xr.Dataset):
    """Return a figure of branches of orbits with special points, above the loci of these points.

    `branches` and `loci` are results of the functions of `gearlib.studies.resonance` of the same
    name: orbit_height is the peak-to-peak displacement, own_damping the damping ratio of the
    branches, which a dotted line marks.
    """
    figure = style.page_figure(_HEIGHT)
    top, bottom = figure.subplots(2, sharex=True, height_ratios=[1.2, 1.0])
    draw_curve(top, branches, "orbit_height", "black")
    draw_special_points(top, branches.tuning, branches.orbit_height, branches.label)
    _write_tunings(top, branches)
    branch_damping = float(loci.own_damping)
    for number in np.unique(loci.locus):
        _draw_locus(bottom, loci.isel(point=np.flatnonzero(loci.locus == number)))
    bottom.axhline(branch_damping, color="black", linewidth=0.6, linestyle=":")
    at_damping = np.full(branches.sizes["point"], branch_damping)
    draw_special_points(bottom, branches.tuning, at_damping, branches.label, size=3.5)
    handles = legend_entries(branches.label, point_line="-")
    style.legend(figure, handles, columns=len(handles), side="upper")
    top.set_ylabel(panels.axis_label(branches.orbit_height, width=40))
    bottom.set_ylabel(panels.axis_label(loci.damping_ratio, width=40))
    bottom.set_xlabel(style.TUNING_LABEL)
    return figure


def draw_curve(axes, branches: xr.Dataset, variable: str, colour: str, width=1.0, zorder=2.0):
    """Draw the variable named `variable` of branches over the tuning, dashed where unstable."""
    tuning, values = branches.tuning.values, branches[variable].values
    stable = branches.stable.values.astype(bool)
    for number in np.unique(branches.branch):
        points = np.flatnonzero(branches.branch == number)
        changes = np.flatnonzero(np.diff(stable[points].astype(int))) + 1
        for section in np.split(points, changes):
            # The line starts at the last point before stability changes, so that no gap appears.
            section = np.arange(max(section[0] - 1, points[0]), section[-1] + 1)
            dashes = "-" if stable[section[-1]] else style.DASHED
            options = {"color": colour, "linestyle": dashes, "linewidth": width, "zorder": zorder}
            axes.plot(tuning[section], values[section], **options)


def draw_special_points(axes, x: ArrayLike, y: ArrayLike, labels: ArrayLike, size=4.5):
    """Mark special points of branches at (x, y); `labels` are codes, keys of `SPECIAL_POINTS`."""
    x, y, labels = (np.asarray(values) for values in (x, y, labels))
    for code, (_, colour, marker) in SPECIAL_POINTS.items():
        points = labels == code
        if points.any():
            style.draw_markers(axes, x[points], y[points], marker, colour, size, zorder=3)


def legend_entries(labels: ArrayLike, point_line="none") -> list:
    """Return legend handles of branches, and of special points with the codes in `labels`.

    `point_line` is the line style of the entries of special points: "none" for markers alone, "-"
    if a figure also has lines (loci) in the colours of the points.
    """
    handles = [
        style.legend_entry("stable orbit"),
        style.legend_entry("unstable orbit", line=style.DASHED),
    ]
    for code, (name, colour, marker) in SPECIAL_POINTS.items():
        if code in np.asarray(labels):
            handles.append(style.legend_entry(name, colour, point_line, marker, markersize=4))
    return handles


def _draw_locus(axes, locus: xr.Dataset):
    """Draw damping over tuning along the locus of a special point.

    The locus consists of two lines, stored one after the other: each starts at the special point,
    where the damping is that of the branches (own_damping).
    """
    _, colour, _ = SPECIAL_POINTS[int(locus.label[0])]
    damping, branch_damping = locus.damping_ratio.values, float(locus.own_damping)
    starts = np.flatnonzero(np.isclose(damping, branch_damping, rtol=1e-12, atol=0.0))
    for points in np.split(np.arange(damping.size), starts[1:]):
        axes.plot(locus.tuning.values[points], damping[points], color=colour, linewidth=1.0)


def _write_tunings(axes, branches: xr.Dataset):
    """Write the tuning beside each special point of branches; close points have a common text."""
    tuning, height, labels = (branches[name].values for name in ("tuning", "orbit_height", "label"))
    # Positions are in multiples of the text size.
    x = tuning / (np.ptp(tuning) or 1.0) / TEXT_WIDTH
    positions = np.stack([x, height / np.ptp(axes.get_ylim()) / TEXT_HEIGHT])
    points = np.flatnonzero(np.isin(labels, [*SPECIAL_POINTS]))
    while points.size:
        # The text of close points stands beside the point with the lowest code.
        close = (np.abs(positions[:, points] - positions[:, points[:1]]) < 1.0).all(axis=0)
        group, points = points[close], points[~close]
        first = group[labels[group].argmin()]
        text = ", ".join(style.number_texts(np.sort(tuning[group]), digits=4, form="f", decimals=4))
        # Beside a fold the text stands on the side without a branch, elsewhere above the point.
        before = tuning[max(first - POINTS_BESIDE_FOLD, 0)]
        after = tuning[min(first + POINTS_BESIDE_FOLD, tuning.size - 1)]
        side = int(np.sign(tuning[first] - before) + np.sign(tuning[first] - after))
        offset, anchor = (0, 6), "center bottom"
        # At a fold both neighbours lie at lower tunings, or both at higher ones.
        if abs(side) == 2:
            offset, anchor = (3 * side, 0), "left center" if side > 0 else "right center"
        point = tuning[first], height[first]
        box = style.white_box(padding=0.15, opacity=0.85)
        style.annotate(axes, text, point, offset, anchor, bbox=box, zorder=2.5)

"""Branches of periodic orbits with their special points, and the jump of the motion from rest.

One figure shows how damping moves special points, the other, beside Fig. 6, how far each choice
moves the jump.
"""

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
def draw_branches(branches: xr.Dataset, loci: xr.Dataset):
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


_TOP_HEIGHT, _ROW_HEIGHT = 2.1, 1.5
#: Kind of variation -> label and scale of the x axis.
_KINDS = {
    "harmonics": ("stiffness harmonics", "log"),
    "tolerance": ("relative tolerance of a 4(5) pair", "log"),
    "damping": ("factor on the damping", "log"),
    "backlash": ("factor on the backlash", "log"),
    "displacement": ("initial displacement (static defl.)", "linear"),
    "velocity": ("initial velocity (static defl./rad)", "linear"),
}
#: Shifts below this, in tuning, are drawn on a linear scale.
MAX_LINEAR_SHIFT = 1e-7
_BLUE, _ORANGE = style.PALETTE[0], style.PALETTE[4]


@style.styled()
def draw_jump(jumps: xr.Dataset, marked=()):
    """Return a figure of the peak-to-peak displacement over the tuning, and of shifts of its jump.

    `jumps` is a result of `gearlib.studies.jump.jump_and_shifts`. Its first variation is the
    unchanged run from rest, from whose jump shifts are counted; `switches` is the number of jumps.
    `marked` are up to two tunings with which the jump is compared: dashed lines, and an orange band
    between their shifts. Pale bars are ranges of shifts over many initial states. Values without a
    jump are listed above their panel.
    """
    kinds = [kind for kind in _KINDS if kind in jumps.kind.values]
    heights = [_TOP_HEIGHT] + [_ROW_HEIGHT] * -(-len(kinds) // 2)
    figure = style.page_figure(sum(heights))
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    _draw_scan(figure.add_subplot(grid[0, :]), jumps, marked)
    for i, kind in enumerate(kinds):
        first_panel = figure.axes[1] if i else None
        axes = figure.add_subplot(grid[1 + i // 2, i % 2], sharey=first_panel)
        variations = jumps.isel(variation=np.flatnonzero(jumps.kind.values == kind))
        marked_shifts = np.array(marked) - float(jumps.jump[0])
        label, scale = _KINDS[kind]
        _draw_shifts(axes, variations.sortby("value"), marked_shifts, label, scale)
        axes.set_ylabel("shift of the jump\n(tuning)" if i % 2 == 0 else "")
    if kinds and (jumps.switches > 1).any():
        figure.supxlabel("cross: several jumps in the scan", fontsize=6, x=0.99, ha="right")
    return figure


def _draw_scan(axes, jumps: xr.Dataset, marked):
    """Draw the peak-to-peak displacement ("height") over the tuning; dash the `marked` tunings."""
    # The first variation is the run from rest.
    tuning, jump = jumps.tuning.values, float(jumps.jump[0])
    options = {"marker": ".", "markersize": 2.5, "linewidth": 0.6}
    panels.draw_curves(axes, jumps, "tuning", "height", **options)
    title = "from rest the orbit does not jump in this scan: there is no shift to draw"
    if np.isfinite(jump):
        title = f"from rest the orbit jumps at $\\nu_s$ = {jump:.7f}"
    marked = [nu for nu in marked if tuning[0] <= nu <= tuning[-1]]
    for nu in marked:
        axes.axvline(nu, color=_ORANGE, linewidth=0.6, linestyle="--")
    if marked:
        title += f" (dashed: {' and '.join(style.number_texts(marked, 4, 'f', 4))})"
    axes.set(title=title, xlim=(tuning[0], tuning[-1]))


def _draw_shifts(axes, jumps: xr.Dataset, marked_shifts: np.ndarray, label: str, scale: str):
    """Draw the shift of the jump, in tuning, over the values of one kind of variation.

    Each point is a variation of the run; `switches` is the number of jumps in its scan. A band
    spans `marked_shifts`, for comparison. `label`, a text such as "name (unit)", and `scale`,
    "linear" or "log", are those of the x axis.
    """
    value, shift = jumps.value.values, jumps["shift"].values
    if marked_shifts.size and np.isfinite(marked_shifts).all():
        band = marked_shifts.min(), marked_shifts.max()
        axes.axhspan(*band, color=_ORANGE, alpha=0.6, linewidth=0.6)
    axes.axhline(0.0, color="black", linewidth=0.6, linestyle=":")
    # Stems instead of a line, because the shift between the values is not known.
    axes.vlines(value, 0.0, shift, color=_BLUE, linewidth=0.6)
    axes.vlines(value, jumps.shift_low, jumps.shift_high, color=_BLUE, linewidth=4.0, alpha=0.3)
    jump_count = jumps.switches.values
    several_jumps = jump_count > 1
    for mask, marker, size in ((~several_jumps, "o", 3), (several_jumps, "x", 4)):
        style.draw_markers(axes, value[mask], shift[mask], marker, _BLUE, size)
    axes.set(xscale=scale, xlabel=label)
    if scale == "log" and value.max() < 10.0 * value.min():
        # Within less than a decade the labels of ticks overlap, or read the same.
        axes.set_xlim(0.1 * value.min(), 10.0 * value.max())
    # The x limits must include values without a jump.
    axes.update_datalim(np.column_stack([value, np.zeros(value.size)]))
    axes.set_yscale("symlog", linthresh=MAX_LINEAR_SHIFT)
    axes.set_yticks([-1e-2, -1e-4, -1e-6, 0.0, 1e-6, 1e-4, 1e-2])
    without_jump = ", ".join(style.number_texts(value[np.isnan(jumps.jump.values)]))
    if without_jump:
        title = f"no jump in the scan where {label.split(' (')[0]} = {without_jump}"
        axes.set_title(title, fontsize=6, loc="left", pad=2.0)

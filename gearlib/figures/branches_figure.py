"""Branches of periodic orbits with their special points, and the jump of the motion from rest.

One figure shows how the special points depend on the damping. The other, which relates to Fig. 6,
shows how far changes of the run shift the jump.
"""

import math

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from gearlib.figures import panels, style

_HEIGHT = 6.6
#: Number of points on either side of a fold from which the side of the branch is determined.
POINTS_BESIDE_FOLD = 6
#: Size of a text relative to the ranges of tuning and height; special points within it share one.
TEXT_WIDTH, TEXT_HEIGHT = 0.05, 0.06
#: Code of `gearlib.analysis.orbits.special_points` -> (name, colour, marker).
SPECIAL_POINTS = {
    1: ("fold", style.PALETTE[4], "o"),
    2: ("period doubling", style.PALETTE[5], "D"),
    3: ("Neimark-Sacker", style.PALETTE[1], "^"),
    4: ("grazing", style.PALETTE[0], "s"),
    5: ("branch point", style.PALETTE[3], "x"),
}


@style.rc_context()
def draw_branches(branches: xr.Dataset, loci: xr.Dataset):
    """Return a figure of branches of periodic orbits, above the loci of their special points.

    Special points are folds, period doublings etc. (see `SPECIAL_POINTS`); a locus is the curve in
    the plane of tuning (mesh frequency over natural frequency) and damping on which such a point
    lies. The variable orbit_height is the peak-to-peak displacement. A dotted line marks the
    damping ratio of the branches. `branches` and `loci` are results of the functions with these
    names in `gearlib.studies.resonance`.
    """
    figure = style.page_figure(_HEIGHT)
    branch_axes, locus_axes = figure.subplots(2, sharex=True, height_ratios=[1.2, 1.0])
    draw_curve(branch_axes, branches, "orbit_height", "black")
    draw_special_points(branch_axes, branches.tuning, branches.orbit_height, branches.label)
    _write_tunings(branch_axes, branches)
    branch_damping = float(loci.own_damping)
    for locus_number in np.unique(loci.locus):
        _draw_locus(locus_axes, loci.isel(point=np.flatnonzero(loci.locus == locus_number)))
    locus_axes.axhline(branch_damping, color="black", linewidth=0.6, linestyle=":")
    dampings = np.full(branches.sizes["point"], branch_damping)
    draw_special_points(locus_axes, branches.tuning, dampings, branches.label, size=3.5)
    handles = legend_handles(branches.label, point_line="-")
    style.add_legend(figure, handles, columns=len(handles), side="upper")
    branch_axes.set_ylabel(panels.axis_label(branches.orbit_height, width=40))
    locus_axes.set_ylabel(panels.axis_label(loci.damping_ratio, width=40))
    locus_axes.set_xlabel(style.TUNING_LABEL)
    return figure


def draw_curve(axes, branches: xr.Dataset, variable: str, colour: str, width=1.0, zorder=2.0):
    """Draw a variable of orbit branches over the tuning, dashed where orbits are unstable.

    `branches` has an entry for each orbit: its tuning (mesh frequency over natural frequency), its
    stability, and the number of its branch. `variable` is the variable on the vertical axis, and
    `width` the line width in points.
    """
    tuning, values = branches.tuning.values, branches[variable].values
    stable = branches.stable.values.astype(bool)
    for branch_number in np.unique(branches.branch):
        points = np.flatnonzero(branches.branch == branch_number)
        # Split the branch where the stability changes.
        section_starts = np.flatnonzero(np.diff(stable[points].astype(int))) + 1
        for section in np.split(points, section_starts):
            # Start at the last point of the previous section to avoid a gap.
            section = np.arange(max(section[0] - 1, points[0]), section[-1] + 1)
            dashes = "-" if stable[section[-1]] else style.DASHED
            options = {"color": colour, "linestyle": dashes, "linewidth": width, "zorder": zorder}
            axes.plot(tuning[section], values[section], **options)


def draw_special_points(axes, x: ArrayLike, y: ArrayLike, labels: ArrayLike, size=4.5):
    """Draw markers at the special points of branches of orbits, e.g. folds; `size` is in points.

    `x`, `y` and `labels` have an entry for each orbit. A label is a key of `SPECIAL_POINTS`, or
    another number for orbits that are no special points.
    """
    x, y, labels = (np.asarray(values) for values in (x, y, labels))
    for code, (_, colour, marker) in SPECIAL_POINTS.items():
        mask = labels == code
        if mask.any():
            style.draw_markers(axes, x[mask], y[mask], marker, colour, size, zorder=3)


def legend_handles(labels: ArrayLike, point_line="none") -> list:
    """Return legend handles for branches of orbits and for the kinds of special points on them.

    `labels` are keys of `SPECIAL_POINTS`; only kinds that occur get a handle. `point_line` is the
    line style of these handles: "none" for a marker only, "-" if the figure also shows loci.
    """
    handles = [
        style.legend_handle("stable orbit"),
        style.legend_handle("unstable orbit", line_style=style.DASHED),
    ]
    for code, (name, colour, marker) in SPECIAL_POINTS.items():
        if code in np.asarray(labels):
            handles.append(style.legend_handle(name, colour, point_line, marker, markersize=4))
    return handles


def _draw_locus(axes, locus: xr.Dataset):
    """Draw the locus of a special point of orbits: a curve of damping over tuning.

    The tuning is the mesh frequency over the natural frequency. The curve is stored as two lines in
    opposite directions, one after the other. Both begin at the special point of the branch, where
    the damping ratio is `own_damping`.
    """
    _, colour, _ = SPECIAL_POINTS[int(locus.label[0])]
    damping, branch_damping = locus.damping_ratio.values, float(locus.own_damping)
    line_starts = np.flatnonzero(np.isclose(damping, branch_damping, rtol=1e-12, atol=0.0))
    for points in np.split(np.arange(damping.size), line_starts[1:]):
        axes.plot(locus.tuning.values[points], damping[points], color=colour, linewidth=1.0)


def _write_tunings(axes, branches: xr.Dataset):
    """Write the tuning next to each special point (fold etc.) of branches of orbits.

    The tuning is the mesh frequency over the natural frequency. If texts would overlap, they are
    combined into one text that lists the tunings.
    """
    tuning, height = branches.tuning.values, branches.orbit_height.values
    labels = branches.label.values
    # Positions are in units of the text size, so that texts overlap if both distances are below 1.
    x = tuning / (np.ptp(tuning) or 1.0) / TEXT_WIDTH
    positions = np.stack([x, height / np.ptp(axes.get_ylim()) / TEXT_HEIGHT])
    remaining = np.flatnonzero(np.isin(labels, [*SPECIAL_POINTS]))
    while remaining.size:
        distances = np.abs(positions[:, remaining] - positions[:, remaining[:1]])
        is_close = (distances < 1.0).all(axis=0)
        group, remaining = remaining[is_close], remaining[~is_close]
        text = ", ".join(
            style.format_numbers(np.sort(tuning[group]), digits=4, form="f", decimals=4)
        )
        # The text is placed at the point whose label has the lowest code.
        anchor_point = group[labels[group].argmin()]
        # Neighbours a few orbits away are used, because the tuning hardly changes close to a fold.
        before = tuning[max(anchor_point - POINTS_BESIDE_FOLD, 0)]
        after = tuning[min(anchor_point + POINTS_BESIDE_FOLD, tuning.size - 1)]
        side = int(np.sign(tuning[anchor_point] - before) + np.sign(tuning[anchor_point] - after))
        offset, alignment = (0, 6), "center bottom"
        # At a fold, both neighbours have lower tunings (side 2) or higher tunings (-2). The text is
        # placed on the side without a branch.
        if side == 2:
            offset, alignment = (6, 0), "left center"
        elif side == -2:
            offset, alignment = (-6, 0), "right center"
        position = tuning[anchor_point], height[anchor_point]
        box = style.white_box(padding=0.15, opacity=0.85)
        style.annotate(axes, text, position, offset, alignment, bbox=box, zorder=2.5)


_TOP_HEIGHT, _ROW_HEIGHT = 2.1, 1.5
#: Varied quantity -> label and scale of the x axis.
_KINDS = {
    "harmonics": ("stiffness harmonics", "log"),
    "tolerance": ("relative tolerance of a 4(5) pair", "log"),
    "damping": ("factor on the damping", "log"),
    "backlash": ("factor on the backlash", "log"),
    "displacement": ("initial displacement (static defl.)", "linear"),
    "velocity": ("initial velocity (static defl./rad)", "linear"),
}
#: Shifts of the tuning below this value are drawn on a linear scale.
MAX_LINEAR_SHIFT = 1e-7
_BLUE, _ORANGE = style.PALETTE[0], style.PALETTE[4]


@style.rc_context()
def draw_jump(jumps: xr.Dataset, marked=()):
    """Return a figure of the jump of the motion from rest, and of shifts of this jump.

    The upper panel shows the peak-to-peak displacement over the tuning (mesh frequency over natural
    frequency). The other panels show how far the jump shifts if one quantity is varied; pale bars
    are ranges over many initial states. `marked` contains up to two tunings for comparison with the
    jump, drawn as dashed lines and as an orange band. `jumps` is a result of
    `gearlib.studies.jump.compute_jump_and_shifts`; its first variation is the unchanged run.
    """
    kinds = [kind for kind in _KINDS if kind in jumps.kind.values]
    heights = [_TOP_HEIGHT] + [_ROW_HEIGHT] * math.ceil(len(kinds) / 2)
    figure = style.page_figure(sum(heights))
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    _draw_scan(figure.add_subplot(grid[0, :]), jumps, marked)
    for i, kind in enumerate(kinds):
        # All panels of shifts share the y axis of the first one, which follows the scan.
        first_shift_axes = figure.axes[1] if i else None
        axes = figure.add_subplot(grid[1 + i // 2, i % 2], sharey=first_shift_axes)
        variations = jumps.isel(variation=np.flatnonzero(jumps.kind.values == kind))
        marked_shifts = np.array(marked) - float(jumps.jump[0])
        label, scale = _KINDS[kind]
        _draw_shifts(axes, variations.sortby("value"), marked_shifts, label, scale)
        axes.set_ylabel("shift of the jump\n(tuning)" if i % 2 == 0 else "")
    if kinds and (jumps.switches > 1).any():
        figure.supxlabel("cross: several jumps in the scan", fontsize=6, x=0.99, ha="right")
    return figure


def _draw_scan(axes, jumps: xr.Dataset, marked):
    """Draw the peak-to-peak displacement ("height") of the runs from rest over the tuning.

    The tuning is the mesh frequency over the natural frequency. The title states the tuning of the
    jump; dashed lines show the tunings in `marked`.
    """
    # The first variation is the run from rest.
    tuning, jump = jumps.tuning.values, float(jumps.jump[0])
    options = {"marker": ".", "markersize": 2.5, "linewidth": 0.6}
    panels.draw_curves(axes, jumps, "tuning", "height", **options)
    title = "from rest the orbit does not jump in this scan: there is no shift to draw"
    if np.isfinite(jump):
        title = f"from rest, the orbit jumps at $\\nu_s$ = {jump:.7f}"
    marked = [nu for nu in marked if tuning[0] <= nu <= tuning[-1]]
    for nu in marked:
        axes.axvline(nu, color=_ORANGE, linewidth=0.6, linestyle="--")
    if marked:
        title += f" (dashed: {' and '.join(style.format_numbers(marked, 4, 'f', 4))})"
    axes.set(title=title, xlim=(tuning[0], tuning[-1]))


def _draw_shifts(axes, jumps: xr.Dataset, marked_shifts: np.ndarray, label: str, scale: str):
    """Draw how far the tuning of the jump shifts if one quantity of the run is varied.

    The tuning is the mesh frequency over the natural frequency. `jumps` contains the variations of
    this quantity, drawn as points; `switches` is the number of jumps that a variation has. A band
    spans `marked_shifts`, shifts for comparison. `label` and `scale` ("linear" or "log") belong to
    the x axis.
    """
    values, shifts = jumps.value.values, jumps["shift"].values
    if marked_shifts.size and np.isfinite(marked_shifts).all():
        band = marked_shifts.min(), marked_shifts.max()
        axes.axhspan(*band, color=_ORANGE, alpha=0.6, linewidth=0.6)
    axes.axhline(0.0, color="black", linewidth=0.6, linestyle=":")
    # Stems are drawn instead of a curve, because the shift between the varied values is unknown.
    axes.vlines(values, 0.0, shifts, color=_BLUE, linewidth=0.6)
    axes.vlines(values, jumps.shift_low, jumps.shift_high, color=_BLUE, linewidth=4.0, alpha=0.3)
    jump_count = jumps.switches.values
    several_jumps = jump_count > 1
    for mask, marker, size in ((~several_jumps, "o", 3), (several_jumps, "x", 4)):
        style.draw_markers(axes, values[mask], shifts[mask], marker, _BLUE, size)
    axes.set(xscale=scale, xlabel=label)
    if scale == "log" and values.max() < 10.0 * values.min():
        # Over less than a decade, tick labels would overlap or be equal.
        axes.set_xlim(0.1 * values.min(), 10.0 * values.max())
    # The x limits must include values without a jump.
    axes.update_datalim(np.column_stack([values, np.zeros(values.size)]))
    axes.set_yscale("symlog", linthresh=MAX_LINEAR_SHIFT)
    axes.set_yticks([-1e-2, -1e-4, -1e-6, 0.0, 1e-6, 1e-4, 1e-2])
    without_jump = ", ".join(style.format_numbers(values[np.isnan(jumps.jump.values)]))
    if without_jump:
        title = f"no jump in the scan where {label.split(' (')[0]} = {without_jump}"
        axes.set_title(title, fontsize=6, loc="left", pad=2.0)

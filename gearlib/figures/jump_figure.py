"""Beside Fig. 6: where the motion from rest jumps, and how far each choice moves the jump."""

import numpy as np
import xarray as xr

from gearlib.figures import panels, style

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
def draw(jumps: xr.Dataset, marked=()):
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

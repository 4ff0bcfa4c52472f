"""Beside Fig. 6: where the motion from rest jumps, and how far each choice moves the jump."""

import textwrap

import numpy as np
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from gearlib.figures import style

_TOP_HEIGHT, _ROW_HEIGHT = 2.1, 1.5
#: Characters of the small print that fit above a panel.
_LINE = 75
#: Axis label of each kind of variation, and whether its values are best spread on a logarithm.
_KINDS = {
    "harmonics": ("stiffness harmonics", True),
    "tolerance": ("relative tolerance of a 4(5) pair", True),
    "damping": ("factor on the damping", True),
    "backlash": ("factor on the backlash", True),
    "displacement": ("initial displacement (static defl.)", False),
    "velocity": ("initial velocity (static defl./rad)", False),
}
#: Shifts below this, in tuning, are drawn on a linear scale.
_LINEAR = 1e-7


@style.styled()
def draw(jumps, marked=()):
    """Draw the orbit's height over the tuning and the jump over everything that may move it.

    `jumps` are those of `gearlib.studies.jump.compute`, `marked` are tunings to compare with,
    at most two. Shifts on a logarithm to both sides of zero, pale: their range where many starts
    were asked; the orange band is where the jump would lie between the marked tunings. A variation
    without a jump in the scan is named above its panel.
    """
    kinds = [kind for kind in _KINDS if kind in jumps.kind.values]
    # Rounded up.
    rows = -(-len(kinds) // 2)
    heights = [_TOP_HEIGHT] + [_ROW_HEIGHT] * rows
    figure = style.page(sum(heights))
    grid = figure.add_gridspec(1 + rows, 2, height_ratios=heights)
    _draw_scan(figure.add_subplot(grid[0, :]), jumps, marked)
    first = None
    for i, kind in enumerate(kinds):
        axes = figure.add_subplot(grid[1 + i // 2, i % 2], sharey=first)
        first = first or axes
        shown = jumps.isel(variation=np.flatnonzero(jumps.kind.values == kind)).sortby("value")
        _draw_kind(axes, shown, float(jumps.jump[0]), marked, *_KINDS[kind])
        if i % 2:
            axes.tick_params(labelleft=False)
        else:
            axes.set_ylabel("shift of the jump\n(tuning)")
    if kinds and (jumps.switches.values > 1).any():
        figure.supxlabel("cross: several jumps in the scan", fontsize=6, x=0.99, ha="right")
    return figure


def _draw_scan(top, jumps, marked):
    """Draw the orbit's height over the tuning."""
    tuning, base = jumps.tuning.values, float(jumps.jump[0])
    top.plot(
        tuning, jumps.height.values, color=style.PALETTE[0], marker=".", markersize=2.5, lw=0.6
    )
    words = "from rest the orbit does not jump in this scan: there is no shift to draw"
    if np.isfinite(base):
        words = f"from rest the orbit jumps at $\\nu_s$ = {base:.7f}"
    marked = [nu for nu in marked if tuning[0] <= nu <= tuning[-1]]
    for nu in marked:
        top.axvline(nu, color=style.PALETTE[4], linewidth=0.6, linestyle="--")
    if marked:
        words += f" (dashed: {' and '.join(f'{nu:.4f}' for nu in marked)})"
    top.set_title(words)
    top.set_xlabel(style.TUNING)
    top.set_ylabel("height of the orbit\n(static defl.)")
    top.set_xlim(tuning[0], tuning[-1])


def _draw_kind(axes, rows, base, marked, label, logarithmic):
    """Draw the jump over the values of one kind of variation."""
    value, shift = rows.value.values, rows["shift"].values
    if np.isfinite(base) and marked:
        low, high = min(marked) - base, max(marked) - base
        axes.axhspan(low, high, color=style.PALETTE[4], alpha=0.6, linewidth=0.6)
    axes.axhline(0.0, color="black", linewidth=0.6, linestyle=":")
    many = rows.switches.values > 1
    # The panel also holds the values without a jump.
    axes.update_datalim(np.column_stack([value, np.zeros(value.size)]))
    # Stems, no line from value to value: what the jump does in between is not known.
    axes.vlines(value, 0.0, shift, color=style.PALETTE[0], linewidth=0.6)
    ranges = rows.shift_low.values, rows.shift_high.values
    axes.vlines(value, *ranges, color=style.PALETTE[0], linewidth=4.0, alpha=0.3)
    axes.plot(value[~many], shift[~many], "o", color=style.PALETTE[0], markersize=3)
    axes.plot(value[many], shift[many], "x", color=style.PALETTE[0], markersize=4)
    if logarithmic:
        axes.set_xscale("log")
        if value[-1] < 1000.0 * value[0]:
            # Within a few decades 0.5, 1, 2 are read more easily than powers of ten.
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            axes.xaxis.set_minor_locator(NullLocator())
    axes.set_yscale("symlog", linthresh=_LINEAR)
    axes.set_yticks([-1e-2, -1e-4, -1e-6, 0.0, 1e-6, 1e-4, 1e-2])
    axes.set_xlabel(label)
    none = value[np.isnan(rows.jump.values)]
    if none.size:
        # Above the frame, where no point can lie.
        values = ", ".join(f"{v:g}" for v in none)
        words = f"no jump in the scan where {label.split(' (')[0]} = {values}"
        axes.set_title(textwrap.fill(words, _LINE), fontsize=6, loc="left", pad=2.0)

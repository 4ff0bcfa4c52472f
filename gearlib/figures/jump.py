"""Beside Fig. 6: where the motion from rest jumps, and how far each choice moves the jump."""

import numpy as np
from matplotlib.figure import Figure

from gearlib.figures import style

_HEIGHT = 6.6
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
#: The two tunings of the paper's Fig. 6.
_PAPER = (0.815, 0.8151)


@style.styled()
def draw(jumps):
    """Draw the orbit's height over the tuning and the jump over everything that may move it.

    Parameters
    ----------
    jumps : xarray.Dataset
        As computed by `gearlib.jump.compute`.

    Returns
    -------
    matplotlib.figure.Figure
        Shifts on a logarithm to both sides of zero; the orange band is where the jump would lie
        between the paper's two tunings. A variation without a jump in the scan is named in its
        panel.
    """
    figure = Figure((style.PAGE_WIDTH, _HEIGHT), layout="constrained")
    grid = figure.add_gridspec(4, 2, height_ratios=[1.2, 1, 1, 1])
    top = figure.add_subplot(grid[0, :])
    tuning, base = jumps.tuning.values, float(jumps.jump[0])
    top.plot(
        tuning, jumps.height.values, color=style.PALETTE[0], marker=".", markersize=2.5, lw=0.6
    )
    for nu in _PAPER:
        top.axvline(nu, color=style.PALETTE[4], linewidth=0.6, linestyle="--")
    if np.isfinite(base):
        top.set_title(f"from rest the orbit jumps at $\\nu_s$ = {base:.7f}")
    top.set_xlabel("tuning $\\nu_s$")
    top.set_ylabel("height of the orbit\n(static defl.)")
    top.set_xlim(tuning[0], tuning[-1])
    kinds = [kind for kind in _KINDS if kind in jumps.kind.values]
    panels = grid[1:, :].subgridspec(3, 2).subplots(sharey=True)
    for axes in panels.flat[len(kinds) :]:
        axes.remove()
    for axes, kind in zip(panels.flat, kinds, strict=False):
        rows = jumps.isel(variation=np.flatnonzero(jumps.kind.values == kind)).sortby("value")
        _draw_kind(axes, rows, base, *_KINDS[kind])
    for axes in panels[:, 0]:
        axes.set_ylabel("shift of the jump")
    return figure


def _draw_kind(axes, rows, base, label, logarithmic):
    """Draw the jump over the values of one kind of variation."""
    value, jump = rows.value.values, rows["shift"].values
    low, high = (nu - base for nu in _PAPER)
    axes.axhspan(low, high, color=style.PALETTE[4], alpha=0.6, linewidth=0)
    axes.axhline(0.0, color="black", linewidth=0.6, linestyle=":")
    many = rows.switches.values > 1
    axes.plot(value, jump, color=style.PALETTE[0], linewidth=0.6)
    axes.plot(value[~many], jump[~many], "o", color=style.PALETTE[0], markersize=3)
    axes.plot(value[many], jump[many], "x", color=style.PALETTE[0], markersize=4)
    if logarithmic:
        axes.set_xscale("log")
    axes.set_yscale("symlog", linthresh=_LINEAR)
    axes.set_yticks([-1e-2, -1e-4, -1e-6, 0.0, 1e-6, 1e-4, 1e-2])
    axes.set_xlabel(label)
    none = value[np.isnan(jump)]
    if none.size:
        words = "no jump in the scan: " + ", ".join(f"{v:g}" for v in none)
        axes.annotate(words, (0.02, 0.05), xycoords="axes fraction", fontsize=6)

"""Motions from many starts: median and range, and the share of the starts that share a motion."""

import numpy as np
from matplotlib.patches import Patch

from gearlib.figures import style

#: Ranges that are narrower are a line, shares of the value.
_NARROW = 1e-3


def draw_range(axes, x, data, name, colour):
    """Shade the range of a variable over all starts, where it has one.

    `data` has name_low and name_high over tuning, as of
    `gearlib.studies.many_starts.over_starts`.
    """
    low, high = data[f"{name}_low"].values, data[f"{name}_high"].values
    wide = high - low > _NARROW * np.abs(high)
    # To the neighbours, so that a range at one tuning is seen too.
    shown = wide | np.roll(wide, 1) | np.roll(wide, -1)
    axes.fill_between(x, low, high, where=shown, color=colour, alpha=0.25, linewidth=0.0)


def entries(share):
    """Return what a legend says of range and shares; share: of those on the commonest orbit."""
    return [
        Patch(color="0.6", alpha=0.4, linewidth=0, label="range of all starts"),
        Patch(color="0.8", label="share of the starts that settle"),
        style.entry(share, style.PALETTE[0], linewidth=0.9),
    ]


def draw_shares(axes, x, data):
    """Draw the share of the starts that settle, and of those on the orbit that most come to."""
    axes.fill_between(x, 0.0, data.settled_share.values, step="mid", color="0.8", linewidth=0.0)
    axes.step(x, data.largest_share.values, where="mid", color=style.PALETTE[0], linewidth=0.9)
    axes.set_ylim(-0.05, 1.05)
    axes.set_yticks([0.0, 1.0])

"""Difficult problems against methods: a heat map of verdicts with the measured errors."""

import re

import numpy as np
import xarray as xr
from matplotlib.patches import Patch

from gearlib.figures import style

_ROW_HEIGHT, _MARGINS = 0.29, 1.6
#: Verdict -> (letter, colour, label). The colours are light enough for black letters.
_VERDICTS = {
    "right": ("r", "#E6F2EC", "right"),
    "inaccurate": ("i", "#F6DF9E", "inaccurate"),
    "missed_event": ("m", "#F0A860", "missed event"),
    "wrong_attractor": ("w", "#8CC3E8", "wrong attractor"),
    "invented_motion": ("n", "#D9A3C6", "invented motion"),
    "diverged": ("d", "#E07B5A", "diverged"),
    "stalled": ("s", "#A9A9A9", "stalled"),
    "refused": ("–", "#FFFFFF", "does not take the model"),
}


@style.styled()
def draw(matrix: xr.Dataset):
    """Return a figure of verdicts, a row for each problem and a column for each method.

    `matrix` is a result of `gearlib.data.gathering.gather_failures`: its dimension "trial" is over
    methods, its variable `words` has the descriptions of the problems, and `error` the measured
    errors. A star marks a run over fewer mesh periods than the others of its row.
    """
    verdicts = [_VERDICTS[name] for name in matrix.verdict.attrs["flag_meanings"].split()]
    periods = matrix.periods.values
    shortened = (periods > 0) & (periods < periods.max(axis=1, keepdims=True))
    rows, columns = matrix.verdict.shape
    figure = style.page_figure(_MARGINS + _ROW_HEIGHT * rows)
    axes = figure.subplots()
    codes, colours = matrix.verdict.values, [colour for _, colour, _ in verdicts]
    style.draw_code_map(axes, range(columns), range(rows), codes, colours)
    for i, j in np.ndindex(rows, columns):
        letter = verdicts[codes[i, j]][0] + "*" * int(shortened[i, j])
        options = {"anchor": "center center", "fontsize": 6}
        style.annotate(axes, letter, (j, i + 0.22), weight="bold", **options)
        style.annotate(axes, _error_text(float(matrix.error[i, j])), (j, i - 0.22), **options)
    axes.set_xticks(range(columns), matrix.trial.values, rotation=60, ha="left", fontsize=7)
    axes.xaxis.tick_top()
    axes.set_yticks(range(rows), matrix.words.values, fontsize=7)
    axes.set_xticks(np.arange(columns + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(rows + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=0.8)
    axes.tick_params(which="both", length=0)
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    edge = {"edgecolor": "#4D4D4D", "linewidth": 0.4}
    patches = [
        Patch(facecolor=colour, label=f"{letter}: {label}", **edge)
        for letter, colour, label in verdicts
    ]
    if shortened.any():
        patches.append(Patch(alpha=0.0, label="*: fewer periods"))
    style.legend(figure, patches, columns=5)
    return figure


def _error_text(error: float) -> str:
    """Return an error as text such as "3e-5", one digit and a short exponent; "" if not finite."""
    if not np.isfinite(error):
        return ""
    if error < 10.0 and error == round(error):
        return f"{error:.0f}"
    return re.sub(r"e\+?(-?)0*(\d)", r"e\1\2", f"{error:.0e}")

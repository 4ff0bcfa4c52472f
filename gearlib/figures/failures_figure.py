"""Difficult problems against methods: a heat map of verdicts with the measured errors."""

import math

import numpy as np
from matplotlib.patches import Patch

from gearlib.figures import style

_ROW_HEIGHT, _HEAD, _FOOT = 0.29, 0.85, 0.75
#: verdict -> (letter, colour); light enough for black letters, apart also in grey by the letter.
_LOOKS = {
    "right": ("r", "#E6F2EC"),
    "inaccurate": ("i", "#F6DF9E"),
    "missed_event": ("m", "#F0A860"),
    "wrong_attractor": ("w", "#8CC3E8"),
    "invented_motion": ("n", "#D9A3C6"),
    "diverged": ("d", "#E07B5A"),
    "stalled": ("s", "#A9A9A9"),
    "refused": ("–", "#FFFFFF"),
}


@style.styled()
def draw(matrix):
    """Draw the verdicts, a row for each problem and a column for each trial.

    `matrix` is gathered from `gearlib.studies.trials.failures.compute`. A star marks a run of
    fewer periods than the others of its row.
    """
    names = matrix.verdict.attrs["flag_meanings"].split()
    periods = matrix.periods.values
    brief = (periods > 0) & (periods < periods.max(axis=1, keepdims=True))
    rows, trials = matrix.verdict.shape
    figure = style.page(_HEAD + _FOOT + _ROW_HEIGHT * rows)
    axes = figure.subplots()
    colours = [_LOOKS[name][1] for name in names]
    style.map_of_codes(axes, range(trials), range(rows), matrix.verdict.values, colours)
    for i, j in np.ndindex(rows, trials):
        letter = _LOOKS[names[int(matrix.verdict[i, j])]][0] + "*" * int(brief[i, j])
        number = _number(float(matrix.error[i, j]))
        place = {"side": "center center", "fontsize": 6}
        style.note(axes, letter, (j, i + 0.22), weight="bold", **place)
        style.note(axes, number, (j, i - 0.22), **place)
    axes.set_xticks(range(trials), matrix.trial.values, rotation=60, ha="left", fontsize=7)
    axes.xaxis.tick_top()
    axes.set_yticks(range(rows), matrix.words.values, fontsize=7)
    axes.set_xticks(np.arange(trials + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(rows + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=0.8)
    axes.tick_params(which="both", length=0)
    axes.set(xlim=(-0.5, trials - 0.5), ylim=(rows - 0.5, -0.5))
    patches = [
        Patch(facecolor=colour, edgecolor="#4D4D4D", linewidth=0.4, label=f"{letter}: {words}")
        for name in names
        for letter, colour in [_LOOKS[name]]
        for words in [name.replace("_", " ").replace("refused", "does not take the model")]
    ]
    if brief.any():
        patches.append(Patch(alpha=0.0, label="*: fewer periods"))
    style.legend(figure, patches, 5)
    return figure


def _number(error: float) -> str:
    """Return an error as it is printed: one digit and an exponent without its zeros."""
    if not math.isfinite(error):
        return ""
    if error == 0.0 or (error >= 1.0 and error < 10.0 and error == round(error)):
        return f"{error:.0f}"
    mantissa, exponent = f"{error:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"

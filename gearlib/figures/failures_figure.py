"""Difficult problems against methods: a heat map of verdicts with the measured errors."""

import math

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch

from gearlib.figures import style

_ROW_HEIGHT, _HEAD, _FOOT = 0.215, 0.85, 0.75
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
_WORDS = {"refused": "–: does not take the model"}


def _number(error):
    """Return an error as it is printed: one digit and an exponent without its zeros."""
    if error == 0.0 or (error >= 1.0 and error < 10.0 and error == round(error)):
        return f"{error:.0f}"
    mantissa, exponent = f"{error:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"


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
    colours = np.ones((rows, trials, 3))

    def cell(i, j, look, error, mark=""):
        colours[i, j] = to_rgb(look[1])
        options = {"ha": "center", "va": "center"}
        axes.text(j, i - 0.2, look[0] + mark, fontsize=5.5, weight="bold", **options)
        if math.isfinite(error):
            axes.text(j, i + 0.24, _number(error), fontsize=4.5, **options)

    for i in range(rows):
        for j in range(trials):
            look = _LOOKS[names[int(matrix.verdict[i, j])]]
            cell(i, j, look, float(matrix.error[i, j]), "*" if brief[i, j] else "")
    looks = {name: _LOOKS[name] for name in names}
    axes.imshow(colours, aspect="auto", interpolation="none")
    axes.set_xticks(range(trials), matrix.trial.values, rotation=60, ha="left", fontsize=6)
    axes.xaxis.tick_top()
    axes.set_yticks(range(rows), matrix.words.values, fontsize=6)
    axes.tick_params(length=0)
    axes.set_xticks(np.arange(trials + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(rows + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=0.8)
    axes.tick_params(which="minor", length=0)
    patches = [
        Patch(
            facecolor=colour,
            edgecolor="#4D4D4D",
            linewidth=0.4,
            label=_WORDS.get(name, f"{letter}: {name.replace('_', ' ')}"),
        )
        for name, (letter, colour) in looks.items()
    ]
    if brief.any():
        patches.append(Patch(alpha=0.0, label="*: fewer periods"))
    style.legend(figure, patches, 5, fontsize=6)
    return figure

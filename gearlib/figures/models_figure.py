"""Scenes and models: what a larger model would change, beside the tolerance and the cost."""

import numpy as np

from gearlib.figures import style

_ROW_HEIGHT, _HEAD = 1.15, 0.6
_WORDS = {
    "one_degree": "1 degree",
    "six_degrees_plain": "6 degrees, plain",
    "six_degrees": "6 degrees, run-out, friction",
    "one_degree_harmonics": "1 degree, {} harmonics",
}
#: Changes below the one or above the other are drawn as these.
_LEAST, _MOST = 1e-6, 100.0
_OUTSIDE = 1e5


@style.styled()
def draw(comparisons, scenes):
    """Draw the change of every model as a bar, a row of bars per scene.

    `comparisons` are datasets of `gearlib.studies.model_comparison.compute`, of the scenes of
    these names. The chosen model is filled; the number on a bar is its cost, components of the
    state advanced per mesh period. The largest model has no change of its own. Where rounding
    decides, bars are medians over the starts, with their range, and have no numbers.
    """
    figure = style.page(_HEAD + _ROW_HEIGHT * len(comparisons))
    rows = figure.subplots(len(comparisons), 1, squeeze=False, sharex=True)[:, 0]
    for axes, scene, data in zip(rows, scenes, comparisons, strict=True):
        tolerance = float(data.tolerance)
        for i, name in enumerate(data.model.values):
            change, chosen = float(data.change[i]), name == data.chosen.item()
            width = _LEAST if np.isnan(change) else np.clip(change, _LEAST, _OUTSIDE)
            blue = style.PALETTE[0]
            axes.barh(i, width, color=blue if chosen else "white", edgecolor=blue, height=0.7)
            free = bool(data.change_free_of_rounding[i])
            if not np.isnan(change) and not free:
                ends = [min(float(data[f"change_{end}"][i]), _OUTSIDE) for end in ("low", "high")]
                axes.plot(ends, [i, i], color=style.PALETTE[4], linewidth=2.0)
                width = max(width, ends[1])
            words = f"{change:.2g}" if free else "rounding decides"
            words = "the largest model" if np.isnan(change) else words
            words += ", used for the scene" if chosen else ""
            words += f", cost {float(data.cost[i]):.3g}" if free else ""
            # Beside the bar, or within it where the words would leave the panel.
            inside = width > _MOST / (100.0 if free else 10.0)
            away, side = ((-4, 0), "right center") if inside else ((4, 0), "left center")
            # The dashed line would run through the words.
            style.note(axes, words, (min(width, _MOST), i), away, side, white=(0.1,))
        axes.axvline(tolerance, color=style.PALETTE[4], linewidth=0.8, linestyle="--")
        axes.set_xscale("log")
        axes.set_xlim(_LEAST, _MOST)
        # Inward ticks would lie in the bars and before the words.
        axes.tick_params(axis="y", length=0)
        names = [_WORDS[name].format(int(data.harmonics)) for name in data.model.values]
        axes.set_yticks(range(len(names)), names, fontsize=6)
        axes.invert_yaxis()
        axes.set_title(f"{scene}: {', '.join(data.observable.values)}", fontsize=7, loc="left")
    rows[-1].set_xlabel(
        "largest change of an observable (dashed: tolerance of the scene);\n"
        "extrema: share of the height of the orbit, or of the force; fractions and bounces: 1\n"
        "cost: components of the state advanced per mesh period",
        fontsize=7,
    )
    return figure

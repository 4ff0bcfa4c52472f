"""Does one mesh stand for the reducer: characteristics of all models, how far answers differ."""

import numpy as np
from matplotlib.colors import LogNorm

from gearlib.figures import schematic, style
from gearlib.figures.starts import draw_range

_CASES = {
    "in_phase": "in phase,\nheld alike",
    "disturbed": "in phase,\nstarts beside",
    "out_of_phase": "branches\nout of phase",
    "pin_error": "in phase,\none axis displaced",
    "soft_supports": "in phase,\nsoft supports",
}
_MODELS = {
    "pair": "one pair\nalone",
    "pair_in_train": "pair with its\nshare of the input",
    "two_meshes": "two meshes\nof one branch",
    "torsional": "torsional\ntrain",
    "whole": "whole\ntrain",
}
_OBSERVABLES = {
    "peak_tuning": "peak, tuning",
    "peak_factor": "peak, factor",
    "jump_tuning": "jump",
    "contact_loss": "contact loss",
    "load_sharing": "load sharing",
    "characteristic": "characteristic",
}
_LINES = ((0, (1.5, 1.2)), (0, (5, 1.5)), "-", (0, (6, 1.5, 1.5, 1.5)), "-")
_COLOURS = ("#E69F00", "#D55E00", "#0072B2", "#009E73", "#000000")
_WIDTHS = (1.0, 1.0, 2.0, 1.0, 0.7)
#: Changes are shaded from the tolerance to so many times as much.
_DARKEST = 10.0
#: Changes are written without decimals from the one on, as more than it from the other.
_WHOLE, _MANY = 10.0, 99.0
#: In place of a change that the starts do not share, or that rounding decides.
_DIFFERS = "~"


@style.styled()
def draw(comparison):
    """Draw for each case the characteristics of all models above the changes of their answers.

    `comparison` is that of `gearlib.studies.trains.one_mesh.compute`. Shaded: changes beyond
    the tolerance, medians over all starts; without a number where it differs from start to
    start; bold: the smallest model that suffices from all of them.
    """
    data = comparison
    figure = style.page(5.2)
    count = data.sizes["case"]
    # Curves are of models, not of meshes.
    part = schematic.with_train(figure, data, {}, below=True)
    upper = part.add_gridspec(2, count, height_ratios=(1.0, 0.9))
    first = left = None
    for i, case in enumerate(data.case.values):
        shown = data.sel(case=case)
        axes = part.add_subplot(upper[0, i], sharex=first, sharey=first)
        first = first or axes
        for name, dashes, colour, width in zip(
            data.model.values, _LINES, _COLOURS, _WIDTHS, strict=True
        ):
            values = shown.dynamic_factor.sel(model=name).values
            look = {"color": colour, "linestyle": dashes, "linewidth": width}
            draw_range(axes, data.tuning.values, shown.sel(model=name), "dynamic_factor", colour)
            axes.plot(data.tuning.values, values, label=_MODELS[name].replace("\n", " "), **look)
        axes.set_title(_CASES[case], fontsize=7)
        axes.set_xlabel(style.OWN_TUNING)
        axes.tick_params(labelleft=not i)
        table = part.add_subplot(upper[1, i])
        _draw_changes(table, shown)
        left = left or table
        if table is not left:
            table.set_yticklabels([])
    first.set_ylabel("largest dynamic factor,\nfirst meshes")
    first.set_xlim(data.tuning.values[[0, -1]])
    style.legend(figure, first, count, fontsize=6.5)
    return figure


def _draw_changes(axes, data):
    """Draw the changes that the whole train makes, models by observables."""
    change = data.answer_change.values[:-1]
    ends = [data[f"answer_change_{end}"].values[:-1] for end in ("low", "high")]
    # The last model is the whole train, from which changes are counted.
    free = data.answer_free_of_rounding.values
    free = free[:-1] & free[-1]
    tolerance = float(data.tolerance)
    beyond = np.where(change > tolerance, np.minimum(change, _DARKEST * tolerance), np.nan)
    axes.imshow(
        beyond,
        cmap="Oranges",
        norm=LogNorm(tolerance / 2.0, 4.0 * _DARKEST * tolerance),
        aspect="auto",
    )
    names = data.model.values[:-1]
    for i, name in enumerate(names):
        weight = "bold" if name == data.sufficient.item() else "normal"
        for j in range(change.shape[1]):
            low, high = (_words(end[i, j]) for end in ends)
            words = low if low == high and free[i, j] else _DIFFERS
            axes.text(j, i, words, ha="center", va="center", fontsize=5.5, weight=weight)
    axes.set_yticks(range(len(names)), [_MODELS[name] for name in names], fontsize=6)
    words = [_OBSERVABLES[name] for name in data.observable.values]
    axes.set_xticks(range(len(words)), words, fontsize=6, rotation=90)
    axes.tick_params(length=0)
    if data.sufficient.item() == data.model.values[-1]:
        axes.set_title("no smaller one suffices", fontsize=6)


def _words(change):
    """Return a change in as few digits as a cell holds."""
    if change > _MANY:
        return "∞" if np.isinf(change) else f">{_MANY:.0f}"
    return f"{change:.0f}" if change >= _WHOLE else f"{change:.2f}".removeprefix("0")

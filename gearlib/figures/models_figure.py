"""Comparison of models for each scene: changes by a larger model, tolerance and cost."""

import numpy as np
import xarray as xr

from gearlib.figures import style

_ROW_HEIGHT, _HEADER_HEIGHT = 1.15, 0.6
_MODEL_LABELS = {
    "pair": "1 degree",
    "six_degrees_plain": "6 degrees, plain",
    "six_degrees": "6 degrees, run-out, friction",
    "pair_harmonics": "1 degree, {} harmonics",
}
#: Changes beyond these are drawn at the edges of the panels.
_LIMITS = (1e-6, 100.0)
_BLUE, _ORANGE = style.PALETTE[0], style.PALETTE[4]
_LABEL = """largest change of an observable (dashed: tolerance of the scene);
extrema: share of the height of the orbit, or of the force; fractions and bounces: 1
cost: components of the state advanced per mesh period"""


@style.styled()
def draw(comparisons: list[xr.Dataset], scenes: list[str]):
    """Return a figure of model errors: how much observables change if a larger model is used.

    `comparisons` are results of `gearlib.studies.scenes.compare`, a panel of bars for each scene (a
    set of runs), named in `scenes`. A bar is the largest change of an observable; that of the
    chosen model is filled. If rounding errors make a motion irreproducible, bars are medians over
    initial states, with ranges.
    """
    figure = style.page_figure(_HEADER_HEIGHT + _ROW_HEIGHT * len(comparisons))
    rows = figure.subplots(len(comparisons), 1, squeeze=False, sharex=True)[:, 0]
    for axes, scene, data in zip(rows, scenes, comparisons, strict=True):
        axes.axvline(data.tolerance, color=_ORANGE, linewidth=0.8, linestyle="--")
        axes.set(xscale="log", xlim=_LIMITS)
        for i in range(data.sizes["model"]):
            _draw_bar(axes, data.isel(model=i), i)
        # Ticks inside the frame would overlap the bars.
        axes.tick_params(axis="y", length=0)
        names = [_MODEL_LABELS[name].format(int(data.harmonics)) for name in data.model.values]
        axes.set_yticks(range(len(names)), names, fontsize=6)
        axes.invert_yaxis()
        axes.set_title(f"{scene}: {', '.join(data.observable.values)}", fontsize=7, loc="left")
    rows[-1].set_xlabel(_LABEL, fontsize=7)
    return figure


def _draw_bar(axes, model: xr.Dataset, y: int):
    """Draw the change from one model to a larger one as a horizontal bar at `y`, with a text.

    The bar of the model that is `chosen` for the scene is filled.
    """
    change, is_chosen = float(model.change), model.model.item() == model.chosen.item()
    # If the motion depends on rounding errors, its change has a range over initial states.
    is_reproducible = bool(model.change_free_of_rounding)
    description = f"{change:.2g}" if is_reproducible else "rounding decides"
    if np.isnan(change):  # There is no larger model.
        description = "the largest model"
    else:
        face = _BLUE if is_chosen else "white"
        axes.barh(y, max(change, _LIMITS[0]), color=face, edgecolor=_BLUE, height=0.7)
        if not is_reproducible:
            axes.plot([model.change_low, model.change_high], [y] * 2, color=_ORANGE, lw=2.0)
    description += ", used for the scene" if is_chosen else ""
    description += f", cost {float(model.cost):.3g}" if is_reproducible else ""
    point, box = (_LIMITS[1], y), style.white_box(padding=0.1)
    style.annotate(axes, description, point, (-4, 0), "right center", bbox=box)

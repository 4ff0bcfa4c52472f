"""What the rectangular stiffness costs: heights over the tuning, differences beside the spread."""

import numpy as np

from gearlib.figures import style
from gearlib.figures.mesh_stiffness_figure import LOOKS

_WORDS = {
    "peak_height": "largest height",
    "peak_force": "largest force",
    "jump_up": "jump, speed rising",
    "jump_down": "jump, speed falling",
    "characteristic": "all heights",
    "contact_loss": "contact loss",
    "motion": "other period",
}
_REFERENCE = "energy"
#: Differences below the one or above the other are drawn as these.
_LEAST, _MOST = 1e-4, 10.0


@style.styled()
def draw(costs):
    """Draw for each pair the heights by whole course and rectangle, and what the latter costs.

    `costs` are those of `gearlib.studies.rectangle.compute`. Below: a mark for each method, its
    difference between course and rectangle; the bar is the spread between the methods; dashed:
    the tolerance.
    """
    count = costs.sizes["pair"]
    figure = style.page(5.0)
    upper = figure.subplots(2, count, squeeze=False, height_ratios=(1.0, 0.9))
    for i, pair in enumerate(costs.pair.values):
        own = costs.sel(pair=pair)
        _draw_heights(upper[0, i], own)
        _draw_costs(upper[1, i], own)
        upper[0, i].set_title(pair, loc="left")
        if i:
            upper[1, i].set_yticklabels([])
    upper[0, 0].set_ylabel("height of the orbit,\nstatic deflections")
    style.legend(figure, upper[0, 0], 3, fontsize=6.5)
    return figure


def _draw_heights(axes, own):
    tuning = own.tuning.values
    for name in own.stiffness_method.values:
        words, colour, dashes, _ = LOOKS[name]
        if name == _REFERENCE:
            continue
        look = {"color": colour, "linestyle": dashes, "linewidth": 0.6, "alpha": 0.8}
        heights = own.orbit_height.sel(stiffness_method=name, form="rectangle")
        for direction in own.direction.values:
            label = f"{words}, rectangle" if direction == own.direction.values[0] else None
            axes.plot(tuning, heights.sel(direction=direction).values, label=label, **look)
    words, colour, _, _ = LOOKS[_REFERENCE]
    looks = {"rectangle": (colour, "-", 1.8), "course": ("black", (0, (4, 1.5)), 0.9)}
    for form, (shade, dashes, width) in looks.items():
        heights = own.orbit_height.sel(stiffness_method=_REFERENCE, form=form)
        for direction in own.direction.values:
            label = f"{words}, {form}" if direction == own.direction.values[0] else None
            look = {"color": shade, "linestyle": dashes, "linewidth": width}
            axes.plot(tuning, heights.sel(direction=direction).values, label=label, **look)
    axes.set_xlim(tuning[[0, -1]])
    axes.set_ylim(0.0, None)
    axes.set_xlabel(style.OWN_TUNING)


def _draw_costs(axes, own):
    names = list(own.observable.values)
    spread = np.clip(own.method_spread.values, _LEAST, _MOST)
    left = _LEAST / 2.0
    axes.barh(range(len(names)), spread - left, left=left, color="#DDDDDD", height=0.6)
    for name in own.stiffness_method.values:
        # A rectangle by itself has no other course.
        if name == "iso":
            continue
        _, colour, _, marker = LOOKS[name]
        values = np.clip(own.rectangle_cost.sel(stiffness_method=name).values, _LEAST, _MOST)
        style.dots(axes, values, range(len(names)), marker, colour, 3.5)
    for j, verdict in enumerate(own.rectangle_verdict.values):
        of, side = ("axes fraction", "data"), "right center"
        style.note(axes, str(verdict), (1.0, j), (-3, 0), side, of, fontsize=5.5)
    axes.axvline(float(own.tolerance), color=style.PALETTE[4], linewidth=0.8, linestyle="--")
    axes.set_xscale("log")
    axes.set_xlim(left, 30.0 * _MOST)
    axes.set_yticks(range(len(names)), [_WORDS[name] for name in names], fontsize=6.5)
    axes.invert_yaxis()
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("difference between course and rectangle;\nbars: spread between the methods")

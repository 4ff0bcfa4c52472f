"""Poincare sections: states of many orbits at one mesh phase, regular and chaotic apart."""

import numpy as np

from gearlib.figures import style

_HEIGHT = 3.3
_CHAOTIC, _UNDECIDED = "#D55E00", "#A0A0A0"
_REGULAR = ("#0072B2", "#009E73", "#4D4D4D", "#56B4E9", "#CC79A7")


@style.styled()
def draw(data):
    """Draw the sections of all cases of `gearlib.studies.global_picture.sections`.

    Orange: chaotic orbits; grey: undecided ones; other colours: regular ones, each orbit in one
    colour.
    """
    figure, panels = style.panels(data.sizes["case"], _HEIGHT)
    for i, axes in enumerate(panels):
        _draw_case(axes, data.isel(case=i))
    return figure


def _draw_case(axes, case):
    chaotic, undecided = case.chaotic.values == 1, case.chaotic.values == 2
    # Chaos first, so that islands in it are seen.
    for i in np.argsort(~chaotic, kind="stable"):
        colour = _UNDECIDED if undecided[i] else _REGULAR[i % len(_REGULAR)]
        colour = _CHAOTIC if chaotic[i] else colour
        x, v, size = (
            case.displacement.values[i],
            case.velocity.values[i],
            0.9 if chaotic[i] else 1.2,
        )
        style.dots(axes, x, v, ".", colour, size, markeredgewidth=0.0, rasterized=True)
    share = 100.0 * chaotic.mean()
    degrees = np.degrees(float(case.phase))
    words = f", {undecided.sum()} undecided" if undecided.any() else ""
    axes.set_title(
        f"{case.case.item()}\n$\\tau$ = {degrees:.0f}°; {share:.0f} % of {chaotic.size} orbits "
        f"chaotic{words}"
    )
    axes.set_xlabel("displacement (static defl.)")
    axes.set_ylabel(style.RATE if axes.get_subplotspec().is_first_col() else "")

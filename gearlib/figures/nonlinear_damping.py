"""Linear, quadratic and cubic damping: characteristics, phase planes, and what moves."""

import numpy as np
from matplotlib.figure import Figure

from gearlib.figures import style

_PANEL_HEIGHT = 2.3
_LOOKS = {"linear": "-", "quadratic": (0, (5, 1.5)), "cubic": (0, (1.5, 1.2))}
#: Share of the orbits that the picture holds; see `gearlib.figures.resonance`.
_SHOWN_SHARE = 0.98


@style.styled()
def draw(studies):
    """Draw characteristics above (up and down), phase planes below, a column per place.

    Parameters
    ----------
    studies : list of xarray.Dataset
        Results of `gearlib.nonlinear_damping.compute`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    places = list(dict.fromkeys(study.place.item() for study in studies))
    shown = studies[0].shown.values
    figure = Figure((style.PAGE_WIDTH, _PANEL_HEIGHT * (1.4 + shown.size)), layout="constrained")
    grid = figure.subplots(
        1 + shown.size,
        len(places),
        squeeze=False,
        sharey="row",
        height_ratios=[1.4] + [1.0] * shown.size,
    )
    for column, place in enumerate(places):
        chosen = [study for study in studies if study.place.item() == place]
        _draw_characteristics(grid[0, column], chosen, place)
        for row, nu in enumerate(shown):
            _draw_planes(grid[1 + row, column], [study.sel(shown=nu) for study in chosen], nu)
    grid[0, 0].set_ylabel("$y_\\mathrm{max}$, $y_\\mathrm{min}$ (static defl.)")
    for axes in grid[1:, 0]:
        axes.set_ylabel("$dy/d\\tau$")
    grid[0, 0].legend(loc="upper left", fontsize=6)
    return figure


def _draw_characteristics(axes, studies, place):
    """Draw the sweeps up (thin) and down (thick, pale) of the powers of one place."""
    values = []
    for number, study in enumerate(studies):
        power = study.power.item()
        colour = style.PALETTE[number % len(style.PALETTE)]
        for name in ("displacement_max", "displacement_min"):
            up, down = study[name].sel(direction="up"), study[name].sel(direction="down")
            values += [up.values, down.values]
            axes.plot(study.tuning, down, color=colour, linewidth=2.6, alpha=0.3)
            label = f"{power} (pale: down)" if name == "displacement_max" else None
            axes.plot(
                study.tuning, up, color=colour, linewidth=0.8, linestyle=_LOOKS[power], label=label
            )
    finite = np.concatenate(values)
    finite = finite[np.isfinite(finite)]
    if finite.size:
        rest = (1.0 - _SHOWN_SHARE) / 2.0
        low, high = np.quantile(finite, [rest, 1.0 - rest])
        margin = 0.08 * (high - low) or 1.0
        axes.set_ylim(min(low, 0.0) - margin, high + margin)
    style.shade_areas(axes, float(studies[0].backlash_ratio), "y")
    axes.set_title(f"damping of the {place} only")
    axes.set_xlabel("tuning $\\nu_s$")
    axes.set_xlim(float(studies[0].tuning[0]), float(studies[0].tuning[-1]))


def _draw_planes(axes, studies, nu):
    """Draw the phase planes of the powers of one place at one tuning."""
    for number, study in enumerate(studies):
        axes.plot(
            study.displacement,
            study.velocity,
            color=style.PALETTE[number % len(style.PALETTE)],
            linewidth=0.8,
            linestyle=_LOOKS[study.power.item()],
        )
    axes.margins(0.08)
    style.shade_areas(axes, float(studies[0].backlash_ratio), "x")
    axes.set_title(f"$\\nu_s$ = {nu:g}, from rest")
    axes.set_xlabel("$y$ (static defl.)")

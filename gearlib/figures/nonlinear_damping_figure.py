"""Linear, quadratic and cubic damping: characteristics, phase planes, and what moves."""

import numpy as np

from gearlib.figures import style

_PANEL_HEIGHT = 2.3
_LOOKS = {"linear": "-", "quadratic": (0, (5, 1.5)), "cubic": (0, (1.5, 1.2))}
#: Share of the orbits that the picture holds; see `gearlib.figures.resonance_figure`.
_SHOWN_SHARE = 0.998
#: Rounds of an orbit that differ by less than this share of its size look the same.
_SAME = 2e-3


@style.styled()
def draw(studies):
    """Draw characteristics above (up and down), phase planes below, a column per place.

    `studies` are datasets of `gearlib.studies.nonlinear_damping.compute`.
    """
    places = list(dict.fromkeys(study.place.item() for study in studies))
    shown = studies[0].shown.values
    figure = style.page(_PANEL_HEIGHT * (1.4 + shown.size))
    grid = figure.subplots(
        1 + shown.size,
        len(places),
        squeeze=False,
        sharey="row",
        height_ratios=[1.4] + [1.0] * shown.size,
    )
    limits = _limits(studies)
    for column, place in enumerate(places):
        chosen = [study for study in studies if study.place.item() == place]
        _draw_characteristics(grid[0, column], chosen, place, limits)
        for row, nu in enumerate(shown):
            _draw_planes(grid[1 + row, column], [study.sel(shown=nu) for study in chosen], nu)
    grid[0, 0].set_ylabel("$y_\\mathrm{max}$, $y_\\mathrm{min}$ (static defl.)")
    for axes in grid[1:, 0]:
        axes.set_ylabel(style.RATE)
    # Outside of the panels: curves reach every corner of the upper ones.
    words = {"title": "damping (pale: sweep down)", "title_fontsize": 7.5}
    style.legend(figure, grid[0, 0], len(_LOOKS), "upper", **words)
    return figure


def _limits(studies):
    """Return the limits of the displacement that all characteristics share."""
    values = np.concatenate(
        [
            study[name].sel(direction=["up", "down"]).values.ravel()
            for study in studies
            for name in ("displacement_max", "displacement_min")
        ]
    )
    finite = values[np.isfinite(values)]
    if not finite.size:
        return -1.0, 1.0
    rest = (1.0 - _SHOWN_SHARE) / 2.0
    low, high = np.quantile(finite, [rest, 1.0 - rest])
    margin = 0.08 * (high - low) or 1.0
    return min(low, 0.0) - margin, high + margin


def _draw_characteristics(axes, studies, place, limits):
    """Draw the sweeps up (thin) and down (thick, pale) of the powers of one place."""
    for number, study in enumerate(studies):
        power = study.power.item()
        colour = style.PALETTE[number % len(style.PALETTE)]
        for name in ("displacement_max", "displacement_min"):
            up, down = study[name].sel(direction="up"), study[name].sel(direction="down")
            axes.plot(study.tuning, down, color=colour, linewidth=2.6, alpha=0.3)
            label = power if name == "displacement_max" else None
            axes.plot(
                study.tuning, up, color=colour, linewidth=0.8, linestyle=_LOOKS[power], label=label
            )
    axes.set_ylim(*limits)
    style.shade_areas(axes, float(studies[0].backlash_ratio), "y")
    axes.set_title(f"damping of the {place} only")
    axes.set_xlabel(style.TUNING)
    tuning = studies[0].tuning.values
    axes.set_xlim(tuning[0], tuning[-1])
    style.add_scale(axes, tuning, studies[0].speed.values, "speed (rpm)")


def _draw_planes(axes, studies, nu):
    """Draw the phase planes of the powers of one place at one tuning."""
    for number, study in enumerate(studies):
        axes.plot(
            *_orbit(study),
            color=style.PALETTE[number % len(style.PALETTE)],
            linewidth=0.8,
            linestyle=_LOOKS[study.power.item()],
        )
    axes.margins(0.08)
    style.shade_areas(axes, float(studies[0].backlash_ratio), "x")
    axes.set_title(f"$\\nu_s$ = {nu:g}, from rest")
    axes.set_xlabel(style.SHORT_DISPLACEMENT)


def _orbit(study):
    """Return displacement and velocity, of one mesh period only where the others repeat it.

    Many equal rounds would fill the gaps of a dashed line.
    """
    orbit = np.array([study.displacement.values, study.velocity.values])
    per_period = round(2.0 * np.pi / (study.phase.values[1] - study.phase.values[0]))
    moved = np.abs(orbit[:, per_period:] - orbit[:, :-per_period])
    if moved.size and np.all(moved < _SAME * np.ptp(orbit, axis=1, keepdims=True)):
        # One sample more, which closes the round.
        return orbit[:, -per_period - 1 :]
    return orbit

"""Linear, quadratic and cubic damping: characteristics, phase planes, and what moves."""

import numpy as np
import xarray as xr

from gearlib.figures import panels, style

_EXTREMA = ["displacement_max", "displacement_min"]
#: Share of the extrema that may lie beyond the limits of the picture, below and above.
HIDDEN_SHARE = 0.001
#: Share of an orbit's size by which its mesh periods may differ and look the same.
SAME_PERIOD_TOLERANCE = 2e-3


@style.styled()
def draw(studies):
    """Draw characteristics above (up and down), phase planes below, a column per place.

    `studies` are datasets of `gearlib.studies.nonlinear_damping.compute`.
    """
    places = list(dict.fromkeys(study.place.item() for study in studies))
    shown = studies[0].shown.values
    ratios = [1.4] + [1.0] * shown.size
    figure = style.page(2.3 * sum(ratios))
    shared = {"squeeze": False, "sharey": "row", "height_ratios": ratios}
    grid = figure.subplots(len(ratios), len(places), **shared)
    for column, place in zip(grid.T, places, strict=True):
        chosen = [study for study in studies if study.place.item() == place]
        powers = xr.concat(chosen, "power", coords="minimal", compat="override")
        styles = panels.curve_styles(powers.power)
        _draw_characteristics(column[0], powers, styles)
        for axes, nu in zip(column[1:], shown, strict=True):
            _draw_phase_planes(axes, powers.sel(shown=nu), styles)
    grid[0, 0].set_ylim(*_displacement_limits(studies))
    grid[0, 0].set_ylabel("$y_\\mathrm{max}$, $y_\\mathrm{min}$ (static defl.)")
    for axes in grid[1:, 0]:
        axes.set_ylabel(style.RATE)
    for axes in grid[0]:
        style.shade_areas(axes, float(studies[0].backlash_ratio), "y")
    title = {"title": "damping (pale: sweep down)", "title_fontsize": 7.5}
    style.legend(figure, panels.legend_entries(styles), len(styles), **title)
    return figure


def _displacement_limits(studies):
    """Return the limits of the displacement that all characteristics share."""
    values = np.concatenate([study[_EXTREMA].to_array().values.ravel() for study in studies])
    finite = values[np.isfinite(values)]
    if not finite.size:
        return -1.0, 1.0
    return style.limits([0.0], np.quantile(finite, [HIDDEN_SHARE, 1.0 - HIDDEN_SHARE]), margin=0.08)


def _draw_characteristics(axes, powers, styles):
    """Draw the sweeps up (thin) and down (thick, pale) of the powers of one place."""
    pale = {"linestyle": "-", "linewidth": 2.6, "alpha": 0.3}
    for direction, look in (("down", pale), ("up", {"linewidth": 0.8})):
        for name in _EXTREMA:
            sweep = powers.sel(direction=direction)
            panels.draw_curves(axes, sweep, "tuning", name, colour="power", styles=styles, **look)
    axes.set(title=f"damping of the {powers.place.item()} only", ylabel="")
    axes.set_xlim(powers.tuning[0], powers.tuning[-1])
    style.second_scale(axes, float(powers.speed[0, -1] / powers.tuning[-1]), "speed (rpm)")


def _draw_phase_planes(axes, powers, styles):
    """Draw the phase planes of the powers of one place at one tuning."""
    for power, look in styles.items():
        axes.plot(*_orbit(powers.sel(power=power)), linewidth=0.8, **look)
    axes.margins(0.08)
    style.shade_areas(axes, float(powers.backlash_ratio[0]), "x")
    axes.set(
        title=f"{panels.value_label(powers.shown)}, from rest", xlabel=style.SHORT_DISPLACEMENT
    )


def _orbit(study):
    """Return displacement and velocity, of one mesh period only where the others repeat it.

    Many equal rounds would fill the gaps of a dashed line.
    """
    orbit = np.array([study.displacement.values, study.velocity.values])
    samples = round(2.0 * np.pi / float(study.phase[1] - study.phase[0]))
    moved = np.abs(orbit[:, samples:] - orbit[:, :-samples])
    repeats = np.all(moved < SAME_PERIOD_TOLERANCE * np.ptp(orbit, axis=1, keepdims=True))
    # One sample more, which closes the round.
    return orbit[:, -samples - 1 :] if moved.size and repeats else orbit

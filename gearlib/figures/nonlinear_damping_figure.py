"""Linear, quadratic and cubic damping: characteristics, phase planes, and what moves."""

import xarray as xr

from gearlib.figures import panels, style

_EXTREMA = ["displacement_max", "displacement_min"]


@style.styled()
def draw(studies: list[xr.Dataset]):
    """Return a figure of nonlinear damping: resonance sweeps above, phase planes below.

    `studies` are datasets of `gearlib.studies.nonlinear_damping.compute`; there is a column for
    each place of the damping (mesh or bearings).
    """
    places = list(dict.fromkeys(study.place.item() for study in studies))
    shown = studies[0].shown.values
    ratios = [1.4] + [1.0] * shown.size
    figure = style.page(2.3 * sum(ratios))
    shared = {"squeeze": False, "sharey": "row", "height_ratios": ratios}
    grid = figure.subplots(len(ratios), len(places), **shared)
    for column, place in zip(grid.T, places, strict=True):
        of_place = [study for study in studies if study.place.item() == place]
        powers = xr.concat(of_place, "power", coords="minimal", compat="override")
        styles = panels.curve_styles(powers.power)
        _draw_characteristics(column[0], powers, styles)
        for axes, nu in zip(column[1:], shown, strict=True):
            _draw_phase_planes(axes, powers.sel(shown=nu), styles)
    grid[0, 0].set_ylabel("$y_\\mathrm{max}$, $y_\\mathrm{min}$ (static defl.)")
    for axes in grid[1:, 0]:
        axes.set_ylabel(style.RATE)
    grid[0, 0].set_ylim(grid[0, 0].get_ylim())
    for axes in grid[0]:
        style.shade_areas(axes, float(studies[0].backlash_ratio), "y")
    title = {"title": "damping (pale: sweep down)", "title_fontsize": 7.5}
    style.legend(figure, panels.legend_entries(styles), len(styles), **title)
    return figure


def _draw_characteristics(axes, powers: xr.Dataset, styles: dict[str, dict]):
    """Draw sweeps up (thin) and down (thick, pale), a curve for each damping power in `styles`."""
    pale = {"linestyle": "-", "linewidth": 2.6, "alpha": 0.3}
    for direction, look in (("down", pale), ("up", {"linewidth": 0.8})):
        for name in _EXTREMA:
            sweep = powers.sel(direction=direction)
            panels.draw_curves(axes, sweep, "tuning", name, colour="power", styles=styles, **look)
    axes.set(title=f"damping of the {powers.place.item()} only", ylabel="")
    axes.set_xlim(powers.tuning[0], powers.tuning[-1])
    style.second_scale(axes, float(powers.speed[0, -1] / powers.tuning[-1]), "speed (rpm)")


def _draw_phase_planes(axes, powers: xr.Dataset, styles: dict[str, dict]):
    """Draw phase planes at one tuning, a curve for each power of the damping law in `styles`."""
    curve_options = {"colour": "power", "styles": styles, "linewidth": 0.8}
    panels.draw_curves(axes, powers, "displacement", "velocity", **curve_options)
    style.shade_areas(axes, float(powers.backlash_ratio[0]), "x")
    axes.set(title=f"{panels.value_label(powers.shown)}, from rest", ylabel="")

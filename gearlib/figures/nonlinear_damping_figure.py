"""Linear, quadratic and cubic damping: resonance characteristics and phase planes."""

import xarray as xr

from gearlib.figures import panels, style

_UNIT_HEIGHT = 2.3  #: inches, of a panel with the height ratio 1
_EXTREMA = ["displacement_max", "displacement_min"]


@style.styled()
def draw(studies: list[xr.Dataset]):
    """Return a figure of nonlinear damping: resonance sweeps above, phase planes below.

    `studies` are results of `gearlib.studies.nonlinear_damping.damping_study`. A column has the
    studies with one location of the damping, `place` ("material" or "oil"); a row of phase planes
    has one of the tunings `shown`.
    """
    damping_locations = list(dict.fromkeys(study.place.item() for study in studies))
    tunings = studies[0].shown.values
    height_ratios = [1.4] + [1.0] * tunings.size
    figure = style.page_figure(_UNIT_HEIGHT * sum(height_ratios))
    options = {"squeeze": False, "sharey": "row", "height_ratios": height_ratios}
    grid = figure.subplots(len(height_ratios), len(damping_locations), **options)
    for column, location in zip(grid.T, damping_locations, strict=True):
        studies_of_location = [study for study in studies if study.place.item() == location]
        data = xr.concat(studies_of_location, "power", coords="minimal", compat="override")
        styles = panels.plot_options(data.power)
        _draw_characteristics(column[0], data, styles)
        speeds = tunings * float(data.speed[0, -1] / data.tuning[-1])
        labels = panels.tuning_texts(tunings, speeds)
        for axes, tuning, label in zip(column[1:], tunings, labels, strict=True):
            _draw_phase_planes(axes, data.sel(shown=tuning), styles)
            axes.set_title(f"tuning ν = {label}, from rest")
    grid[0, 0].set_ylabel("$y_\\mathrm{max}$, $y_\\mathrm{min}$ (static defl.)")
    for axes in grid[1:, 0]:
        axes.set_ylabel(style.VELOCITY_LABEL)
    # Shades must not change the automatic limits.
    grid[0, 0].set_ylim(grid[0, 0].get_ylim())
    for axes in grid[0]:
        style.shade_lost_contact(axes, float(studies[0].backlash_ratio), "y")
    options = {"title": "damping (pale: sweep down)", "title_fontsize": 7.5}
    style.legend(figure, panels.legend_entries(styles), columns=len(styles), **options)
    return figure


def _draw_characteristics(axes, data: xr.Dataset, styles: dict[str, dict]):
    """Draw sweeps up (thin) and down (thick, pale), a curve for each damping power in `styles`."""
    pale = {"linestyle": "-", "linewidth": 2.6, "alpha": 0.3}
    for direction, options in (("down", pale), ("up", {"linewidth": 0.8})):
        for name in _EXTREMA:
            sweep = data.sel(direction=direction)
            curve_options = {"colour": "power", "styles": styles} | options
            panels.draw_curves(axes, sweep, "tuning", name, **curve_options)
    axes.set(title=f"damping of the {data.place.item()} only", ylabel="")
    axes.set_xlim(data.tuning[0], data.tuning[-1])
    style.second_scale(axes, float(data.speed[0, -1] / data.tuning[-1]), "speed (rpm)")


def _draw_phase_planes(axes, data: xr.Dataset, styles: dict[str, dict]):
    """Draw the phase plane at one tuning, a curve for each damping power in `styles`."""
    curve_options = {"colour": "power", "styles": styles, "linewidth": 0.8}
    panels.draw_curves(axes, data, "displacement", "velocity", **curve_options)
    style.shade_lost_contact(axes, float(data.backlash_ratio[0]), "x")
    axes.set(ylabel="")

"""Numerical stability: spectral radius of one mesh period by each method, and the exact one."""

import numpy as np
import xarray as xr
from matplotlib.patches import Patch

from gearlib.figures import panels, style

#: Heights of a map, of the panel below the maps, and of this panel with the legend, inches.
_MAP_HEIGHT, _RADIUS_HEIGHT, _LOWER_HEIGHT = 2.3, 1.4, 2.2
#: A spectral radius counts as right if it differs from the exact one by at most this.
RADIUS_TOLERANCE = 0.01
#: Limit of explicit Runge-Kutta steps on the imaginary axis.
_RK4_LIMIT = 2.0 * np.sqrt(2.0)

#: Text and colour of each verdict, in the order of the codes below.
VERDICTS = (
    ("invents motion", "#D55E00"),
    ("grows too fast", "#E69F00"),
    ("right within 1 % per period", "#FFFFFF"),
    ("damps falsely", "#56B4E9"),
    ("hides the instability", "#0072B2"),
)
#: Codes of the verdicts; unstable motion of a stable system is spurious.
_SPURIOUS_INSTABILITY, _EXCESS_GROWTH, _RIGHT, _EXCESS_DAMPING, _MISSED_INSTABILITY = range(5)


def verdicts(radius: np.ndarray, true_radius: np.ndarray) -> np.ndarray:
    """Return the code of a verdict, an index in `VERDICTS`, for each spectral radius of a method.

    The spectral `radius` over a mesh period has the shape (steps, tunings), the exact one,
    `true_radius`, the shape (tunings,). Above 1 the motion is unstable.
    """
    is_stable = true_radius <= 1.0 + 1e-9
    is_too_large = radius > true_radius + RADIUS_TOLERANCE
    conditions = {
        _MISSED_INSTABILITY: (radius <= 1.0) & (true_radius > 1.0 + RADIUS_TOLERANCE),
        _EXCESS_DAMPING: radius < true_radius - RADIUS_TOLERANCE,
        _SPURIOUS_INSTABILITY: is_too_large & is_stable & (radius > 1.0 + RADIUS_TOLERANCE),
        _EXCESS_GROWTH: is_too_large,
    }
    # The first true condition counts.
    return np.select([*conditions.values()], [*conditions], default=_RIGHT)


@style.styled()
def draw(chart: xr.Dataset):
    """Return a figure of a map of verdicts for each method, and the true spectral radius below.

    `chart` is a result of `gearlib.studies.trials.stability_of_methods.compute`. The dashed line is
    the stability limit of explicit Runge-Kutta steps at the maximum stiffness.
    """
    rows = -(-chart.sizes["method"] // 2)
    figure = style.page_figure(_MAP_HEIGHT * rows + _LOWER_HEIGHT)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[_MAP_HEIGHT] * rows + [_RADIUS_HEIGHT])
    tuning, steps = chart.tuning.values, chart.steps.values
    true_radius = np.interp(tuning, chart.fine_tuning, chart.true_radius)
    for i, name in enumerate(chart.method.values):
        axes = figure.add_subplot(grid[i // 2, i % 2])
        codes = verdicts(chart.radius.values[i], true_radius)
        style.draw_code_map(axes, tuning, steps, codes, [colour for _, colour in VERDICTS])
        axes.set(yscale="log", title=name)
        axes.set_ylabel(panels.axis_label(chart.steps) if i % 2 == 0 else "")
        # Only the classical Runge-Kutta method, with or without additions, has this limit.
        if name.startswith("rk4"):
            limit = 2.0 * np.pi * np.sqrt(float(chart.stiffness_max)) / tuning / _RK4_LIMIT
            limit[(limit < steps[0]) | (limit > steps[-1])] = np.nan
            axes.plot(tuning, limit, color="black", linestyle="--", linewidth=0.8)
    below = figure.add_subplot(grid[rows, :])
    panels.draw_curves(below, chart, "fine_tuning", "true_radius", color="black", linewidth=0.8)
    below.set(xlabel=panels.axis_label(chart.tuning), ylabel="true radius")
    below.set_xlim(tuning[0], tuning[-1])
    handles = [Patch(facecolor=colour, edgecolor="grey", label=name) for name, colour in VERDICTS]
    style.legend(figure, handles, columns=3)
    return figure

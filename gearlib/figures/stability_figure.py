"""Numerical stability: spectral radius of one mesh period, methods beside the truth."""

import numpy as np
from matplotlib.patches import Patch

from gearlib.figures import style

_HEIGHT = 2.3
#: A radius this close to the true one is right to the eye of a user: 1 % per mesh period.
CLOSE = 0.01

VERDICTS = (
    ("invents motion", "#D55E00"),
    ("grows too fast", "#E69F00"),
    ("right within 1 % per period", "#FFFFFF"),
    ("damps falsely", "#56B4E9"),
    ("hides the instability", "#0072B2"),
)


def verdicts(radius, true):
    """Return the index in `VERDICTS` of every radius; shapes (s, t), (t,)."""
    stable = true <= 1.0 + 1e-9
    code = np.full(radius.shape, 2)
    code[(radius > true + CLOSE) & ~stable] = 1
    code[(radius > np.maximum(true, 1.0) + CLOSE) & stable] = 0
    code[(radius > true + CLOSE) & stable & (radius <= 1.0 + CLOSE)] = 1
    code[radius < true - CLOSE] = 3
    code[(radius <= 1.0) & ~stable & (true > 1.0 + CLOSE)] = 4
    return code


@style.styled()
def draw(chart):
    """Draw a map of verdicts for each method, and the true radius below.

    `chart` is that of `gearlib.studies.trials.stability_of_methods.compute`. The dashed line is the
    limit of explicit Runge-Kutta steps at the maximum stiffness.
    """
    methods = [str(name) for name in chart.method.values]
    rows = -(-len(methods) // 2)
    figure = style.page(_HEIGHT * rows + 2.2)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[_HEIGHT] * rows + [1.4])
    tuning, steps = chart.tuning.values, chart.steps.values
    fine = chart.fine_tuning.values
    true = np.interp(tuning, fine, chart.true_radius.values)
    for i, name in enumerate(methods):
        axes = figure.add_subplot(grid[i // 2, i % 2])
        code = verdicts(chart.radius.values[i], true)
        style.map_of_codes(axes, tuning, steps, code, [colour for _, colour in VERDICTS])
        axes.set_yscale("log")
        axes.set_title(name)
        axes.set_ylabel("steps per mesh period" if i % 2 == 0 else "")
        if name.startswith("rk4"):
            # Classical Runge-Kutta steps are stable up to 2 sqrt(2) on the imaginary axis.
            natural = np.sqrt(float(chart.stiffness_max)) / tuning
            limit = 2.0 * np.pi * natural / (2.0 * np.sqrt(2.0))
            inside = (limit >= steps[0]) & (limit <= steps[-1])
            axes.plot(tuning[inside], limit[inside], color="black", linestyle="--", linewidth=0.8)
    below = figure.add_subplot(grid[rows, :])
    below.plot(fine, chart.true_radius.values, color="black", linewidth=0.8)
    below.set_ylabel("true radius")
    below.set_xlabel(style.TUNING)
    below.set_xlim(tuning[0], tuning[-1])
    handles = [Patch(facecolor=colour, edgecolor="grey", label=name) for name, colour in VERDICTS]
    style.legend(figure, handles, 3)
    return figure

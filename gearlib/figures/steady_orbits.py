"""Settled orbits: errors of time integration and of the frequency domain over their cost.

Panels and looks are those of `gearlib.figures.work_precision`; costs are those of the whole search,
from rest or from no guess.
"""

import numpy as np

from gearlib.figures import style
from gearlib.figures.work_precision import (
    PROBLEMS,
    draw_panel,
    limits_of,
    lines_of,
    panelled,
    put_legend,
)

_MEASURES = {
    "state_error": ("state_floor", "error of the state"),
    "event_error": ("event_floor", "error of event phases (rad)"),
    "multiplier_error": ("multiplier_floor", "error of the multiplier"),
}


@style.styled()
def draw_orbits(errors):
    """Draw the errors of state, event phases and largest multiplier over evaluations.

    Parameters
    ----------
    errors : xarray.Dataset
        Of `gearlib.studies.trials.steady_orbits.errors`.

    Returns
    -------
    matplotlib.figure.Figure
        Closed forms evaluate no right-hand side: they are at the left edge.
    """
    names, lines = errors.problem.values, lines_of([errors])
    shown = [kind for kind in _MEASURES if np.isfinite(errors[kind].values).any()]
    figure, panels = panelled(len(shown) * names.size, names.size)
    panels = np.reshape(panels, (len(shown), names.size))
    cost = errors.orbit_evaluations.values
    for row, kind in zip(panels, shown, strict=True):
        floor, label = _MEASURES[kind]
        floors = errors[floor].values
        limits = limits_of(np.append(errors[kind].values, floors), 0.1)
        for i, axes in enumerate(row):
            axes.set_xlim(*limits_of(cost[i], 0.25))
            axes.set_ylim(*limits)
            values = errors[kind].values[i]
            if np.isfinite(values).any():
                draw_panel(axes, [(errors.line.values, cost[i])], [values], lines, floors[i])
            else:
                axes.text(0.5, 0.5, "nothing to compare", transform=axes.transAxes, ha="center")
        row[0].set_ylabel(label)
    for axes, name in zip(panels[0], names, strict=True):
        axes.set_title(PROBLEMS[name], fontsize=7)
    for axes in panels[-1]:
        axes.set_xlabel("evaluations in all")
    put_legend(figure, lines, "rounding")
    return figure


@style.styled()
def draw_orbit_times(errors, times):
    """Draw the errors of the state over the wall time until the orbit is found.

    Parameters
    ----------
    errors, times : xarray.Dataset
        Of `gearlib.studies.trials.steady_orbits.errors` and `times`, with the same methods.

    Returns
    -------
    matplotlib.figure.Figure
        Dotted: the time of shooting for the same orbit.
    """
    names, lines = errors.problem.values, lines_of([errors])
    figure, panels = panelled(names.size, 2)
    floors = errors.state_floor.values
    limits = limits_of(np.append(errors.state_error.values, floors), 0.1)
    for i, axes in enumerate(panels):
        cost, shooting = times.orbit_time.values[i], float(times.shooting_time[i])
        axes.set_xlim(*limits_of(np.append(cost, shooting), 0.5))
        axes.set_ylim(*limits)
        values = errors.state_error.values[i]
        draw_panel(axes, [(errors.line.values, cost)], [values], lines, floors[i])
        axes.axvline(shooting, color="black", linewidth=0.8, linestyle=":")
        axes.set_title(PROBLEMS[names[i]])
        if i % 2 == 0:
            axes.set_ylabel("error of the state")
        if i >= names.size - 2:
            axes.set_xlabel("wall time until the orbit is found (s)")
    put_legend(figure, lines, "rounding")
    return figure

"""Work and precision: errors of methods over evaluations or wall time, one panel per problem.

Colour and line style tell the family of a method, the marker the method itself.

Where no method can be, but by luck, is grey:

* below half the last place of the reference (of a multiplier: over the width of the central
  differences it is taken from): the right result itself, stored as a float, may be off by as much;
* to the left of the time of one evaluation of the closed form of contact: a run that looks at the
  motion once in a mesh period evaluates it once, and no step costs less than its solution.
"""

from itertools import cycle

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearlib.figures import style

_COLUMNS = 2
_ROW_HEIGHT, _FOOT = 2.15, 1.25
_GREY = style.AREA_COLOURS["backlash"]

#: What a problem is, of any gear pair; its name says what it is of the paper's.
PROBLEMS = {
    "smooth": "damped, $\\nu_s$ = 0.7",
    "bouncing": "damped, $\\nu_s$ = 0.9",
    "near_fold": "damped in contact, $\\nu_s$ = 0.815",
    "conservative": "conservative, $\\nu_s$ = 0.9",
    "six_degrees": "six degrees of freedom, $\\nu_s$ = 0.82",
    "cubic": "cubic damping, $\\nu_s$ = 0.9",
    "reducer": "gear train of six meshes, $\\nu_s$ = 0.9",
}
#: family -> (words, colour, line style)
FAMILIES = {
    "located": ("events located", "#0072B2", "-"),
    "controlled": ("step control only", "#D55E00", (0, (5, 1.5))),
    "fixed": ("fixed steps", "#E69F00", (0, (1.5, 1.2))),
    "smoothed": ("smoothed contact", "#CC79A7", (0, (6, 1.5, 1.5, 1.5))),
    "other": ("other packages", "#4D4D4D", (0, (3, 1))),
}
_MARKERS = "*osD^vPX<>hp"
_SIZE = {"*": 7.0}
_EVALUATIONS = "evaluations of the right-hand side per mesh period\n(left edge: none)"
_STATE = "error of the final state"


def lines_of(datasets):
    """Return line -> (family, marker) of all methods, in their order."""
    markers, found = cycle(_MARKERS), {}
    for data in datasets:
        for line, family in zip(data.line.values, data.family.values, strict=True):
            if line not in found:
                found[line] = family, next(markers)
    return found


def _options(family, marker):
    """Return the options of ``Axes.plot`` for a line."""
    _, colour, dashes = FAMILIES[family]
    return {
        "color": colour,
        "linestyle": dashes,
        "linewidth": 0.9,
        "marker": marker,
        "markersize": _SIZE.get(marker, 3.8),
        "markeredgewidth": 0.5,
        "markeredgecolor": "white",
    }


def put_legend(figure, lines, words):
    """Put the legend of lines and of the grey area under the panels."""
    families = sorted({family for family, _ in lines.values()}, key=list(FAMILIES).index)
    handles = [
        Line2D([], [], **_options(family, lines[name][1]), label=name)
        for family in families
        for name in lines
        if lines[name][0] == family
    ]
    handles += [style.entry(*FAMILIES[family]) for family in families]
    style.legend(figure, [*handles, Patch(color=_GREY, label=words)], 4, fontsize=6.5)


def limits_of(values, low=0.4, high=2.5):
    """Return limits with some room around the positive ones of values."""
    good = values[np.isfinite(values) & (values > 0.0)]
    return (low * good.min(), high * good.max()) if good.size else (0.1, 10.0)


def draw_panel(axes, costs, errors, lines, floor):
    """Draw the errors of all methods over their costs; those below `floor` are rounding.

    For each method, over its settings, `costs` has (names of lines, ndarray) and `errors` an
    ndarray; a cost of 0 is drawn at the left edge. `lines` are those of `lines_of`.
    """
    left, right = axes.get_xlim()
    bottom = axes.get_ylim()[0]
    if np.isfinite(floor):
        axes.axhspan(bottom, floor, color=_GREY, linewidth=0, zorder=0)
    for (names, cost), error in zip(costs, errors, strict=True):
        for name in dict.fromkeys(names):
            chosen = names == name
            x, y = cost[chosen], error[chosen]
            # An error of 0 is below every floor.
            y = np.where(y > 0.0, y, np.where(y == 0.0, 1.5 * bottom, np.nan))
            x = np.where(x > 0.0, x, np.where(x == 0.0, 1.4 * left, np.nan))
            axes.plot(x, y, **_options(*lines[name]), clip_on=False)
    axes.set_xlim(left, right)


def panelled(count, columns):
    """Return a figure and its axes, one for each panel."""
    rows = -(-count // columns)
    figure = style.page(_FOOT + _ROW_HEIGHT * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharey="row")
    for axes in grid.flat[count:]:
        axes.remove()
    for axes in grid.flat[:count]:
        axes.set_xscale("log")
        axes.set_yscale("log")
    return figure, grid.flat[:count]


def _draw_states(errors, costs, label, words):
    """Return the figure of the errors of the final state, and its panels."""
    names = errors[0].problem.values
    lines = lines_of(errors)
    figure, panels = panelled(names.size, _COLUMNS)
    floors = errors[0].state_floor.values
    every = np.concatenate([data.state_error.values.ravel() for data in errors])
    limits = limits_of(np.concatenate([every, floors]), 0.1)
    for i, axes in enumerate(panels):
        axes.set_ylim(*limits)
        axes.set_xlim(*limits_of(np.concatenate([cost[i] for cost in costs]), 0.25))
        rows = [data.state_error.values[i] for data in errors]
        named = [(data.line.values, cost[i]) for data, cost in zip(errors, costs, strict=True)]
        draw_panel(axes, named, rows, lines, floors[i])
        axes.set_title(PROBLEMS.get(names[i], names[i]))
        if i % _COLUMNS == 0:
            axes.set_ylabel(_STATE)
        if i >= names.size - _COLUMNS:
            axes.set_xlabel(label)
    put_legend(figure, lines, words)
    return figure, panels


def draw(errors):
    """Draw both figures of errors over evaluations; return them by their names."""
    return {
        "work_precision_evaluations": draw_evaluations(errors),
        "work_precision_measures": draw_measures(errors),
    }


@style.styled()
def draw_evaluations(errors):
    """Draw the error of the final state over evaluations of the right-hand side.

    `errors` are datasets of `gearlib.studies.trials.work_precision.errors`, one for each
    method. Closed forms evaluate no right-hand side: they are at the left edge.
    """
    costs = [data.period_evaluations.values for data in errors]
    figure, _ = _draw_states(errors, costs, _EVALUATIONS, "rounding of the state")
    return figure


@style.styled()
def draw_time(errors, times):
    """Draw the error of the final state over the wall time.

    Datasets of `errors` and `times` of `gearlib.studies.trials.work_precision`, of the same
    methods.
    """
    costs = [data.period_time.values for data in times]
    # The quickest measurement is the least disturbed one.
    least = min(float(data.closed_form_time) for data in times)
    words = "rounding; less than one closed form"
    figure, panels = _draw_states(errors, costs, "wall time per mesh period (s)", words)
    for axes in panels:
        right = axes.get_xlim()[1]
        axes.set_xlim(0.3 * least, right)
        axes.axvspan(0.3 * least, least, color=_GREY, linewidth=0, zorder=0)
    return figure


@style.styled()
def draw_measures(errors):
    """Draw the errors of event phases and Floquet multipliers over evaluations.

    `errors` as in `draw_evaluations`. A panel for every problem with events, then for every
    problem with a settled orbit.
    """
    kinds = {
        "event_error": ("event_floor", "error of event phases (rad)"),
        "multiplier_error": ("multiplier_floor", "error of the multiplier"),
    }
    names, lines = errors[0].problem.values, lines_of(errors)
    shown = {kind: _with_numbers(errors, kind) for kind in kinds}
    shown = {kind: places for kind, places in shown.items() if places}
    columns = max(map(len, shown.values()), default=1)
    figure, grid = panelled(max(len(shown), 1) * columns, columns)
    panels = np.reshape(grid, (-1, columns))
    for row, (kind, places) in zip(panels, shown.items(), strict=False):
        floor, label = kinds[kind]
        floors = errors[0][floor].values
        every = np.concatenate([data[kind].values.ravel() for data in errors])
        limits = limits_of(np.concatenate([every, floors]), 0.1)
        for axes in row[len(places) :]:
            axes.remove()
        for axes, i in zip(row, places, strict=False):
            costs = [data.period_evaluations.values[i] for data in errors]
            axes.set_xlim(*limits_of(np.concatenate(costs), 0.25))
            axes.set_ylim(*limits)
            rows = [data[kind].values[i] for data in errors]
            named = [(data.line.values, cost) for data, cost in zip(errors, costs, strict=True)]
            draw_panel(axes, named, rows, lines, float(floors[i]))
            words = PROBLEMS.get(names[i], names[i])
            axes.set_title(words.replace(", ", ",\n"), fontsize=7)
        row[0].set_ylabel(label)
    if shown:
        last = len([*shown.values()][-1])
        panels[-1, min(columns // 2, last - 1)].set_xlabel(_EVALUATIONS)
    put_legend(figure, lines, "rounding")
    return figure


def _with_numbers(errors, kind):
    """Return the places of the problems of which any method has an error of this kind."""
    found = np.any([np.isfinite(data[kind].values).any(axis=1) for data in errors], axis=0)
    return np.flatnonzero(found).tolist()

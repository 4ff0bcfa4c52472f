"""Work and precision: errors of methods over evaluations or wall time, one panel per problem.

Colour and line style show the family of a method, the marker the method itself. Grey areas are out
of reach: errors below the rounding error of the reference (for a multiplier, divided by the width
of its finite differences), and times below that of one evaluation of the solution within contact.
"""

from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gearlib.figures import panels, style

_ROW_HEIGHT, _LEGEND_HEIGHT = 2.15, 1.25
_GREY_AREA = {"color": style.AREA_COLOURS["no contact"], "linewidth": 0, "zorder": 0}

#: Problem -> title of its panel.
PROBLEMS = {
    "smooth": "damped, $\\nu_s$ = 0.7",
    "bouncing": "damped, $\\nu_s$ = 0.9",
    "near_fold": "damped in contact, $\\nu_s$ = 0.815",
    "conservative": "conservative, $\\nu_s$ = 0.9",
    "six_degrees": "six degrees of freedom, $\\nu_s$ = 0.82",
    "cubic": "cubic damping, $\\nu_s$ = 0.9",
    "reducer": "gear train of six meshes, $\\nu_s$ = 0.9",
}
#: Family of methods -> (label, colour, dashes).
_FAMILIES = {
    "located": ("events located", "#0072B2", "-"),
    "controlled": ("step control only", "#D55E00", (0, (5, 1.5))),
    "fixed": ("fixed steps", "#E69F00", (0, (1.5, 1.2))),
    "smoothed": ("smoothed contact", "#CC79A7", (0, (6, 1.5, 1.5, 1.5))),
    "other": ("other packages", "#4D4D4D", (0, (3, 1))),
}
_MARKERS = "osD^vPX<>hp"
#: Positions of zeros on logarithmic axes, relative to the lower limit.
_ZERO_COST_POSITION, _ZERO_ERROR_POSITION = 1.4, 1.5
_LINE_OPTIONS = {"linewidth": 0.9, "markersize": 3.8, "markeredgewidth": 0.5}
_LINE_OPTIONS["markeredgecolor"] = "white"


@style.styled()
def draw(errors: list[xr.Dataset], times: list[xr.Dataset]) -> dict[str, Figure]:
    """Return figures of errors over evaluations of the right-hand side and over wall time.

    `errors` and `times` are results of the functions of `gearlib.studies.trials.work_precision` of
    the same name, one for each method. The figures "work_precision_evaluations" and "_time" have
    errors of the final state, "_measures" those of event phases and Floquet multipliers. Methods
    without evaluations are at the left edge; times below that of one evaluation of the solution in
    closed form, which holds during contact, are grey.
    """
    data = _concatenate(errors).assign(period_time=_concatenate(times).period_time)
    states = _panels_with_errors(data, "state")
    measures = _panels_with_errors(data, "event") + _panels_with_errors(data, "multiplier")
    evaluations = "period_evaluations"
    figures = {
        "evaluations": _draw_panels(data, evaluations, states, "rounding of the state"),
        "measures": _draw_panels(data, evaluations, measures, "rounding"),
        "time": _draw_panels(data, "period_time", states, "rounding; less than one closed form"),
    }
    # The shortest of the measured times is the least disturbed one.
    closed_form_time = min(float(method.closed_form_time) for method in times)
    for axes in figures["time"].axes:
        axes.set_xlim(left=0.3 * closed_form_time)
        axes.axvspan(0.3 * closed_form_time, closed_form_time, **_GREY_AREA)
    return {f"work_precision_{name}": figure for name, figure in figures.items()}


def _concatenate(datasets: list[xr.Dataset]) -> xr.Dataset:
    """Return one dataset of all methods, concatenated along the dimension of accuracy levels."""
    return xr.concat(datasets, "rung", data_vars="minimal", coords="minimal", compat="override")


def _panels_with_errors(data: xr.Dataset, kind: str) -> list[tuple[str, str]]:
    """Return (problem, kind) for each problem with errors of a kind: state, event, multiplier."""
    has_errors = data[f"{kind}_error"].notnull().any("rung")
    return [(problem, kind) for problem in data.problem.values[has_errors.values]]


def _draw_panels(data: xr.Dataset, cost: str, panel_errors: list[tuple], grey_label: str):
    """Return a figure of errors over the variable `cost`, a panel for each of `panel_errors`.

    These are (problem, kind of error); `grey_label` is the legend label of the grey areas.
    """
    rows = -(-len(panel_errors) // 2)
    figure = style.page_figure(_LEGEND_HEIGHT + _ROW_HEIGHT * rows)
    styles = _line_styles(data)
    edge = "\n(left edge: none)" if cost == "period_evaluations" else ""
    for i, (problem, kind) in enumerate(panel_errors):
        axes = figure.add_subplot(rows, 2, i + 1)
        error, rounding_error = data[f"{kind}_error"], data[f"{kind}_floor"]
        axes.set(xscale="log", yscale="log", title=PROBLEMS.get(problem, problem))
        axes.set_xlim(*_log_limits(data[cost].sel(problem=problem), factor=0.25))
        axes.set_ylim(*_log_limits(error, rounding_error, factor=0.1))
        if i % 2 == 0 or panel_errors[i - 1][1] != kind:
            axes.set_ylabel(panels.axis_label(error, width=30))
        if i >= len(panel_errors) - 2:
            axes.set_xlabel(panels.axis_label(data[cost]) + edge)
        _draw_errors(axes, data.sel(problem=problem), cost, kind, styles)
    families = [_FAMILIES[name] for name in _FAMILIES if name in data.family]
    handles = panels.legend_entries(styles) + [style.legend_entry(*family) for family in families]
    style.legend(figure, [*handles, Patch(label=grey_label, **_GREY_AREA)], columns=4, fontsize=6.5)
    return figure


def _line_styles(data: xr.Dataset) -> dict[str, dict]:
    """Return the options of `Axes.plot` for each method, in a dict sorted by family of methods.

    The variable `line` of `data` has the label of the method at each level of accuracy.
    """
    families = dict(zip(data.line.values, data.family.values, strict=True))
    methods = sorted(families, key=lambda method: list(_FAMILIES).index(families[method]))
    styles = {}
    for method, marker in zip(methods, cycle(_MARKERS), strict=False):
        _, colour, dashes = _FAMILIES[families[method]]
        styles[method] = {"color": colour, "linestyle": dashes, "marker": marker, "label": method}
    return {method: options | _LINE_OPTIONS for method, options in styles.items()}


def _log_limits(*arrays: xr.DataArray, factor: float) -> tuple[float, float]:
    """Return log-axis limits: `factor` times the smallest positive value, 2.5 times the largest."""
    values = np.concatenate([array.values.ravel() for array in arrays])
    positive = values[values > 0.0]
    return (factor * positive.min(), 2.5 * positive.max()) if positive.size else (0.1, 10.0)


def _draw_errors(axes, data: xr.Dataset, cost: str, kind: str, styles: dict[str, dict]):
    """Draw errors of all methods over the variable `cost`; zeros lie near the edges of the panel.

    `kind` is that of the error: state, event or multiplier; errors below the rounding error of the
    reference (the suffix "_floor") are grey. `styles` has plot options by method, and the variable
    `line` of `data` the label of the method of each entry.
    """
    left, bottom = axes.get_xlim()[0], axes.get_ylim()[0]
    costs, errors = data[cost], data[f"{kind}_error"]
    x = costs.where(costs != 0.0, _ZERO_COST_POSITION * left)
    y = errors.where(errors != 0.0, _ZERO_ERROR_POSITION * bottom)
    for method, options in styles.items():
        mask = data.line.values == method
        axes.plot(x[mask], y[mask], clip_on=False, **options)
    axes.axhspan(bottom, np.nan_to_num(data[f"{kind}_floor"], nan=bottom), **_GREY_AREA)

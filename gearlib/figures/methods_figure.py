"""Comparison of methods: work-precision diagrams, difficult problems, numerical stability.

Work-precision diagrams have one panel for each problem. Colour and line style show the family of a
method, the marker shows the method. Grey areas are unattainable: errors below the rounding error of
the reference (for a multiplier, divided by the step of its finite differences), and times shorter
than one evaluation of the closed-form solution between two events.
"""

import math
import re
from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gearlib.figures import panels, style

_PANEL_HEIGHT, _LEGEND_HEIGHT = 2.3, 1.25
_GREY_AREA = {"color": style.AREA_COLOURS["no contact"], "linewidth": 0, "zorder": 0}

#: Problem -> title of its panel.
PROBLEMS = {
    "smooth": "contact is never lost\n(damped, $\\nu_s$ = 0.7)",
    "bouncing": "contact is lost in each period\n(damped, $\\nu_s$ = 0.9)",
    "near_fold": "close to a fold\n(damped, $\\nu_s$ = 0.815)",
    "conservative": "chaotic\n(no damping, $\\nu_s$ = 0.9)",
    "six_degrees": "six degrees of freedom\n($\\nu_s$ = 0.82)",
    "cubic": "nonlinear differential equation\n(cubic damping, $\\nu_s$ = 0.9)",
    "reducer": "gear train with six meshes\n($\\nu_s$ = 0.9)",
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
#: Positions of zeros on logarithmic axes, relative to the lower axis limit.
_ZERO_COST_POSITION, _ZERO_ERROR_POSITION = 1.4, 1.5
_LINE_OPTIONS = {"linewidth": 0.9, "markersize": 3.8, "markeredgewidth": 0.5}
_LINE_OPTIONS["markeredgecolor"] = "white"


@style.rc_context()
def draw_work_precision(errors: list[xr.Dataset], times: list[xr.Dataset]) -> dict[str, Figure]:
    """Return work-precision diagrams of integration methods as a dict: name -> figure.

    "work_precision_evaluations" and "work_precision_time" show errors of the final state over the
    number of evaluations of the right-hand side and over wall time; "work_precision_measures" shows
    errors of event phases and Floquet multipliers. Methods that never evaluate the right-hand side
    are at the left edge. Grey areas are unattainable: errors below rounding, and times shorter than
    one evaluation of the closed-form solution. `errors` and `times` contain, for each method, a
    result of the functions with these names in `gearlib.studies.trials.work_precision`.
    """
    data = _concatenate_methods(errors).assign(period_time=_concatenate_methods(times).period_time)
    states = _problems_with_errors(data, "state")
    measures = _problems_with_errors(data, "event") + _problems_with_errors(data, "multiplier")
    evaluations = "period_evaluations"
    figures = {
        "evaluations": _draw_panels(data, evaluations, states, "rounding of the state"),
        "measures": _draw_panels(data, evaluations, measures, "rounding"),
        "time": _draw_panels(data, "period_time", states, "rounding; less than one closed form"),
    }
    # The shortest measured time is the one least disturbed by other processes.
    closed_form_time = min(float(method.closed_form_time) for method in times)
    for axes in figures["time"].axes:
        axes.set_xlim(left=0.3 * closed_form_time)
        axes.axvspan(0.3 * closed_form_time, closed_form_time, **_GREY_AREA)
    return {f"work_precision_{name}": figure for name, figure in figures.items()}


def _concatenate_methods(datasets: list[xr.Dataset]) -> xr.Dataset:
    """Concatenate the datasets of all methods along the dimension "rung".

    Each entry of this dimension is a method with one value of its accuracy parameter, e.g. a
    tolerance.
    """
    return xr.concat(datasets, "rung", data_vars="minimal", coords="minimal", compat="override")


def _problems_with_errors(data: xr.Dataset, kind: str) -> list[tuple[str, str]]:
    """Return the pairs (problem, kind) of all problems for which `data` contains errors.

    `kind` is the kind of error: "state", "event" or "multiplier".
    """
    has_errors = data[f"{kind}_error"].notnull().any("rung")
    return [(problem, kind) for problem in data.problem.values[has_errors.values]]


def _draw_panels(data: xr.Dataset, cost: str, panel_errors: list[tuple], grey_label: str):
    """Return a figure of the errors of methods over their cost, with one panel for each problem.

    `data` contains all methods, and `cost` is its variable on the horizontal axes: evaluations of
    the right-hand side, or wall time. `panel_errors` has a pair (problem, kind of error) for each
    panel. `grey_label` is the legend label of the grey areas, which mark errors below rounding.
    """
    rows = math.ceil(len(panel_errors) / 2)
    figure = style.page_figure(_LEGEND_HEIGHT + _PANEL_HEIGHT * rows)
    styles = _line_styles(data)
    edge_note = "\n(left edge: none)" if cost == "period_evaluations" else ""
    for i, (problem, kind) in enumerate(panel_errors):
        axes = figure.add_subplot(rows, 2, i + 1)
        error, rounding_error = data[f"{kind}_error"], data[f"{kind}_floor"]
        axes.set(xscale="log", yscale="log", title=PROBLEMS.get(problem, problem))
        axes.set_xlim(*_log_limits(data[cost].sel(problem=problem), factor=0.25))
        axes.set_ylim(*_log_limits(error, rounding_error, factor=0.1))
        if i % 2 == 0 or panel_errors[i - 1][1] != kind:
            axes.set_ylabel(panels.axis_label(error, width=30))
        if i >= len(panel_errors) - 2:
            axes.set_xlabel(panels.axis_label(data[cost]) + edge_note)
        _draw_errors(axes, data.sel(problem=problem), cost, kind, styles)
    # The legend lists all methods, all families and the grey areas.
    families = [_FAMILIES[name] for name in _FAMILIES if name in data.family]
    handles = panels.legend_handles(styles) + [style.legend_handle(*family) for family in families]
    style.add_legend(
        figure, [*handles, Patch(label=grey_label, **_GREY_AREA)], columns=4, fontsize=6.5
    )
    return figure


def _line_styles(data: xr.Dataset) -> dict[str, dict]:
    """Return a dict: method -> options of `Axes.plot`, sorted by families of methods.

    Methods of the same family, e.g. those with fixed steps, have the same colour and line style but
    different markers. `data` has the variables "line" (method) and "family".
    """
    families = dict(zip(data.line.values, data.family.values, strict=True))
    methods = sorted(families, key=lambda method: list(_FAMILIES).index(families[method]))
    styles = {}
    for method, marker in zip(methods, cycle(_MARKERS), strict=False):
        _, colour, dashes = _FAMILIES[families[method]]
        styles[method] = {"color": colour, "linestyle": dashes, "marker": marker, "label": method}
    return {method: options | _LINE_OPTIONS for method, options in styles.items()}


def _log_limits(*arrays: xr.DataArray, factor: float) -> tuple[float, float]:
    """Return limits of a logarithmic axis for all positive values of the arrays, with a margin.

    The limits are `factor` times the smallest and 2.5 times the largest positive value.
    """
    values = np.concatenate([array.values.ravel() for array in arrays])
    positive = values[values > 0.0]
    return (factor * positive.min(), 2.5 * positive.max()) if positive.size else (0.1, 10.0)


def _draw_errors(axes, data: xr.Dataset, cost: str, kind: str, styles: dict[str, dict]):
    """Draw the errors of all methods for one problem over the variable `cost`.

    `kind` is the kind of error: "state", "event" or "multiplier". `styles` maps methods to options
    of `Axes.plot`; the variable `line` of `data` is the method of each entry. The axis limits must
    be set, because zeros are drawn near the lower limits of the logarithmic axes. A grey area
    covers errors below the rounding error of the reference (suffix "_floor").
    """
    left, bottom = axes.get_xlim()[0], axes.get_ylim()[0]
    costs, errors = data[cost], data[f"{kind}_error"]
    x = costs.where(costs != 0.0, _ZERO_COST_POSITION * left)
    y = errors.where(errors != 0.0, _ZERO_ERROR_POSITION * bottom)
    for method, options in styles.items():
        mask = data.line.values == method
        axes.plot(x[mask], y[mask], clip_on=False, **options)
    axes.axhspan(bottom, np.nan_to_num(data[f"{kind}_floor"], nan=bottom), **_GREY_AREA)


_ROW_HEIGHT, _MARGINS = 0.29, 1.6
#: Verdict -> (letter, colour, label). The colours are light enough for black letters.
_VERDICT_STYLES = {
    "right": ("r", "#E6F2EC", "right"),
    "inaccurate": ("i", "#F6DF9E", "inaccurate"),
    "missed_event": ("m", "#F0A860", "missed event"),
    "wrong_attractor": ("w", "#8CC3E8", "wrong attractor"),
    "invented_motion": ("n", "#D9A3C6", "invented motion"),
    "diverged": ("d", "#E07B5A", "diverged"),
    "stalled": ("s", "#A9A9A9", "stalled"),
    "refused": ("–", "#FFFFFF", "does not take the model"),
}


@style.rc_context()
def draw_failures(matrix: xr.Dataset):
    """Return a figure with a table of verdicts on integration methods for difficult problems.

    `matrix` is a result of `gearlib.data.gathering.gather_failures`. Rows are problems, described
    by the variable `words`, and columns are methods. Each cell contains the letter of the verdict,
    e.g. "d" for "diverged", and the error. An asterisk marks runs over fewer mesh periods than
    other runs in the same row.
    """
    verdict_names = matrix.verdict.attrs["flag_meanings"].split()
    verdict_styles = [_VERDICT_STYLES[name] for name in verdict_names]
    periods = matrix.periods.values
    is_shortened = (periods > 0) & (periods < periods.max(axis=1, keepdims=True))
    rows, columns = matrix.verdict.shape
    figure = style.page_figure(_MARGINS + _ROW_HEIGHT * rows)
    axes = figure.subplots()
    verdicts = matrix.verdict.values
    colours = [colour for _, colour, _ in verdict_styles]
    style.draw_category_map(axes, range(columns), range(rows), verdicts, colours)
    for i, j in np.ndindex(rows, columns):
        letter, _, _ = verdict_styles[verdicts[i, j]]
        if is_shortened[i, j]:
            letter += "*"
        options = {"anchor": "center center", "fontsize": 6}
        style.annotate(axes, letter, (j, i + 0.22), weight="bold", **options)
        style.annotate(axes, _format_error(float(matrix.error[i, j])), (j, i - 0.22), **options)
    axes.set_xticks(range(columns), matrix.trial.values, rotation=60, ha="left", fontsize=7)
    axes.xaxis.tick_top()
    axes.set_yticks(range(rows), matrix.words.values, fontsize=7)
    # Minor ticks at the cell edges are needed for the white grid lines between the cells.
    axes.set_xticks(np.arange(columns + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(rows + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=0.8)
    axes.tick_params(which="both", length=0)
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    edge_options = {"edgecolor": "#4D4D4D", "linewidth": 0.4}
    patches = [
        Patch(facecolor=colour, label=f"{letter}: {label}", **edge_options)
        for letter, colour, label in verdict_styles
    ]
    if is_shortened.any():
        patches.append(Patch(alpha=0.0, label="*: fewer periods"))
    style.add_legend(figure, patches, columns=5)
    return figure


def _format_error(error: float) -> str:
    """Format an error briefly: "3e-5", "7" for a small integer, "" if it is not finite."""
    if not np.isfinite(error):
        return ""
    if error < 10.0 and error == round(error):
        return f"{error:.0f}"
    return re.sub(r"e\+?(-?)0*(\d)", r"e\1\2", f"{error:.0e}")


#: Height of a map, of the panel below the maps, and of this panel with the legend, inches.
_MAP_HEIGHT, _RADIUS_HEIGHT, _LOWER_HEIGHT = 2.3, 1.4, 2.2
#: Tolerance within which a spectral radius is considered correct.
RADIUS_TOLERANCE = 0.01
#: Stability limit of the classical Runge-Kutta method on the imaginary axis.
_RK4_LIMIT = 2.0 * np.sqrt(2.0)

#: Text and colour of each verdict, in the order of the indices below.
VERDICTS = (
    ("invents motion", "#D55E00"),
    ("grows too fast", "#E69F00"),
    ("right within 1 % per period", "#FFFFFF"),
    ("damps falsely", "#56B4E9"),
    ("hides the instability", "#0072B2"),
)
#: Indices of `VERDICTS`.
_SPURIOUS_INSTABILITY, _EXCESS_GROWTH, _RIGHT, _EXCESS_DAMPING, _MISSED_INSTABILITY = range(5)


def classify_stability(radius: np.ndarray, true_radius: np.ndarray) -> np.ndarray:
    """Compare the stability computed by a method with the true stability; return verdicts.

    `radius`, of shape (step counts, tunings), is the spectral radius (largest magnitude of the
    Floquet multipliers) over a mesh period computed by the method, and `true_radius`, of shape
    (tunings,), is the exact one; motions are unstable if it exceeds 1. The verdicts, of the shape
    of `radius`, are indices of `VERDICTS`.
    """
    is_stable = true_radius <= 1.0 + 1e-9
    is_too_large = radius > true_radius + RADIUS_TOLERANCE
    # The first condition that is true determines the verdict.
    conditions = {
        _MISSED_INSTABILITY: (radius <= 1.0) & (true_radius > 1.0 + RADIUS_TOLERANCE),
        _EXCESS_DAMPING: radius < true_radius - RADIUS_TOLERANCE,
        _SPURIOUS_INSTABILITY: is_too_large & is_stable & (radius > 1.0 + RADIUS_TOLERANCE),
        _EXCESS_GROWTH: is_too_large,
    }
    return np.select([*conditions.values()], [*conditions], default=_RIGHT)


@style.rc_context()
def draw_stability(chart: xr.Dataset):
    """Return a figure with a map of numerical stability for each method.

    The maps compare computed with true stability, over the tuning (mesh frequency over natural
    frequency) and the number of steps per mesh period. The panel below shows the exact spectral
    radius (growth of perturbations per mesh period). The dashed line is the stability limit of the
    classical Runge-Kutta method at the maximum stiffness. `chart` is a result of
    `gearlib.studies.trials.stability_of_methods.compute_spectral_radii`.
    """
    rows = math.ceil(chart.sizes["method"] / 2)
    figure = style.page_figure(_MAP_HEIGHT * rows + _LOWER_HEIGHT)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[_MAP_HEIGHT] * rows + [_RADIUS_HEIGHT])
    tuning, steps = chart.tuning.values, chart.steps.values
    true_radius = np.interp(tuning, chart.fine_tuning, chart.true_radius)
    for i, name in enumerate(chart.method.values):
        axes = figure.add_subplot(grid[i // 2, i % 2])
        verdicts = classify_stability(chart.radius.values[i], true_radius)
        style.draw_category_map(axes, tuning, steps, verdicts, [colour for _, colour in VERDICTS])
        axes.set(yscale="log", title=name)
        axes.set_ylabel(panels.axis_label(chart.steps) if i % 2 == 0 else "")
        # Only the classical Runge-Kutta method and its variants have this limit.
        if name.startswith("rk4"):
            # The method is stable if frequency times step size is below `_RK4_LIMIT`.
            min_steps = 2.0 * np.pi * np.sqrt(float(chart.stiffness_max)) / tuning / _RK4_LIMIT
            min_steps[(min_steps < steps[0]) | (min_steps > steps[-1])] = np.nan
            axes.plot(tuning, min_steps, color="black", linestyle="--", linewidth=0.8)
    radius_axes = figure.add_subplot(grid[rows, :])
    options = {"color": "black", "linewidth": 0.8}
    panels.draw_curves(radius_axes, chart, "fine_tuning", "true_radius", **options)
    radius_axes.set(xlabel=panels.axis_label(chart.tuning), ylabel="true radius")
    radius_axes.set_xlim(tuning[0], tuning[-1])
    handles = [Patch(facecolor=colour, edgecolor="grey", label=name) for name, colour in VERDICTS]
    style.add_legend(figure, handles, columns=3)
    return figure

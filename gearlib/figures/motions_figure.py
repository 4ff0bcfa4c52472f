"""Motions in the paper's figures: phase planes (Fig. 5), and scenes (Figs. 4, 6, 7, 8).

A scene contains phase planes and time histories of a few runs. Its model is chosen by a comparison
of models.
"""

import re
import textwrap

import numpy as np
import xarray as xr

from gearlib.data.motions import describe_steadiness, true_intervals
from gearlib.figures import panels, style

_CELL_HEIGHT, _TITLES_HEIGHT = 1.25, 0.7
#: Largest total number of characters of the titles in a row.
_TITLE_CHARACTERS = 120
#: Periods of an orbit are considered equal within this fraction of the displacement range.
SAME_ORBIT_TOLERANCE = 5e-3


@style.rc_context()
def draw_phase_planes(phase_planes: xr.Dataset, *, colours: dict[str, str] | None = None):
    """Return a figure of phase planes (velocity over displacement) for each damping and tuning.

    `phase_planes` is a dataset over (damping, tuning, phase); each tuning (mesh frequency over
    natural frequency) is one row. `colours` maps names of damping combinations to colours. Titles
    state whether the motion is periodic; other motions have thinner lines.
    """
    tunings = phase_planes.tuning.values
    curve_styles = style.curve_styles([str(name) for name in phase_planes.damping.values], colours)
    figure = style.page_figure(_TITLES_HEIGHT + _CELL_HEIGHT * tunings.size)
    grid = figure.subplots(tunings.size, len(curve_styles), squeeze=False)
    width = min(30, _TITLE_CHARACTERS // max(1, len(curve_styles)))
    labels = panels.format_tunings(tunings, phase_planes.get("speed"))
    for i, (row_axes, tuning, label) in enumerate(zip(grid, tunings, labels, strict=True)):
        row_axes[0].set_ylabel(f"$\\nu_s$ = {label}\n$dy/d\\tau$".replace(" (", "\n("))
        for axes, (name, curve_style) in zip(row_axes, curve_styles.items(), strict=True):
            run = phase_planes.sel(tuning=tuning, damping=name)
            # The period is 0 for motions that are not periodic.
            line_width = 0.8 if int(run.period) else 0.3
            draw_plane(axes, run, color=curve_style.colour, linewidth=line_width)
            axes.tick_params(labelsize=5.5)
            header = [style.typeset_dampings(name)] if i == 0 else []
            axes.set_title(
                "\n".join([*header, *textwrap.wrap(_describe_steadiness(run), width)]), fontsize=6
            )
    for axes in grid[-1]:
        axes.set_xlabel(style.DISPLACEMENT_LABEL)
    return figure


def draw_plane(axes, run: xr.Dataset, **options):
    """Draw the phase plane of a run, and shade the displacements without drive-side contact.

    `run` is a result of `gearlib.simulate`; `options` are passed to `Axes.plot`.
    """
    displacement, velocity = closed_orbit(run)
    axes.set(xlim=style.axis_limits(displacement, 0.0), ylim=style.axis_limits(velocity, 0.0))
    # With moving bearings, the displacement at which the coast-side flanks touch varies. Therefore
    # all displacements below 0 are shaded equally, as for infinite backlash.
    backlash = np.inf if "coast_line" in run else float(run.backlash_ratio)
    style.shade_lost_contact(axes, backlash, "x")
    axes.plot(displacement, velocity, **options)


def closed_orbit(run: xr.Dataset) -> np.ndarray:
    """Return displacement and velocity of a run, shape (2, samples), as a closed curve if periodic.

    `run.period` is the period in mesh periods, or 0 if the motion is not periodic. The closed curve
    is the whole record if it consists of whole periods, otherwise the last period.
    """
    states = np.array([run.displacement.values, run.velocity.values])
    samples_per_mesh_period = round(2.0 * np.pi / np.diff(run.phase)[0])
    sample_count, period = states.shape[1], int(run.period) * samples_per_mesh_period
    if not 0 < period <= sample_count:
        return states
    # The record is considered periodic if changes between successive periods are invisible.
    changes = np.abs(states[0, period:] - states[0, :-period])[-period:]
    if changes.max(initial=0.0) > SAME_ORBIT_TOLERANCE * np.ptp(states[0]):
        return states
    start = 0
    if sample_count % period:
        start = sample_count - period
    return np.append(states[:, start:], states[:, start : start + 1], axis=1)


def _describe_steadiness(run: xr.Dataset) -> str:
    """Describe the steadiness of a run, e.g. "steady, 1 mesh period"; "no result" if it failed."""
    return describe_steadiness(run) if np.isfinite(run.displacement).all() else "no result"


_PLANE_HEIGHT, _HISTORY_HEIGHT, _LEGEND_HEIGHT = 2.2, 1.05, 0.6
_MODELS = {
    "pair": "1 degree of freedom, rectangular stiffness",
    "six_degrees_plain": "6 degrees of freedom, rectangular stiffness",
    "six_degrees": "6 degrees of freedom, rectangular stiffness, run-out, friction",
}
_MIN_STIFFNESS_COLOUR = "#D55E00"


@style.rc_context()
def draw_scene(scene: xr.Dataset, *, courses: list[str], periods_shown: int):
    """Return a figure of phase planes above time histories, with one column for each run.

    `scene` is a result of `gearlib.studies.scenes`: a few runs of one figure of the paper, along
    the dimension "case". `courses` are the variables to draw as time histories, one row each, over
    the last `periods_shown` mesh periods of the record.
    """
    samples = periods_shown * round(2.0 * np.pi / float(scene.phase[1] - scene.phase[0]))
    shown = scene.isel(phase=slice(scene.sizes["phase"] - samples, None))
    heights = [_PLANE_HEIGHT] + [_HISTORY_HEIGHT] * len(courses)
    figure = style.page_figure(_LEGEND_HEIGHT + sum(heights))
    grid = figure.subplots(
        len(heights), scene.sizes["case"], squeeze=False, sharey="row", height_ratios=heights
    )
    for column, title in zip(grid.T, map(str, shown.case.values), strict=True):
        run = shown.sel(case=title)
        draw_plane(column[0], run, color=style.PALETTE[0], linewidth=0.8)
        # The run has a single tuning.
        (tuning,) = panels.format_tunings(run.tuning, run.get("speed"))
        stated_tuning = re.search(r"(?:tuning|nu|ν)\s*=?\s*(\d+(?:\.\d+)?)", title)
        # The tuning is added to titles that do not state it.
        is_stated = stated_tuning is not None and float(stated_tuning[1]) == float(run.tuning)
        column[0].set_title(title if is_stated else f"{title}\n$\\nu_s$ = {tuning}")
        column[0].set_xlabel(style.DISPLACEMENT_LABEL)
        column[0].set_xlim(style.axis_limits(shown.displacement, 0.0))
        for axes, name in zip(column[1:], courses, strict=True):
            _draw_time_history(axes, panels.phase_to_mesh_periods(run), name)
            axes.label_outer()
    grid[0, 0].set_ylabel(panels.axis_label(scene.velocity, width=30))
    grid[0, 0].set_ylim(style.axis_limits(shown.velocity))
    figure.supxlabel(f"model: {_MODELS[scene.model.item()]}", fontsize=6, x=0.99, ha="right")
    return figure


def _draw_time_history(axes, run: xr.Dataset, name: str):
    """Draw the variable `name` of a run over the mesh periods, and shade contact loss.

    For the modified stiffness (mesh stiffness, but 0 without contact), a bar at the upper edge
    marks the times in contact at the minimum stiffness C_min. These are the times with a stiffness
    below 1, because stiffness is relative to its mean.
    """
    draw_style = "steps-post" if name.endswith("stiffness") else "default"
    panels.draw_curves(axes, run, "phase", name, linewidth=0.9, drawstyle=draw_style)
    axes.set_ylabel(panels.axis_label(run[name], width=20), fontsize=6.5)
    periods, contact = run.phase.values, run.contact.values
    axes.set_xlim(periods[0], periods[-1])
    axes.margins(y=0.12)
    shade_contact(axes, periods, contact)
    if name == "modified_stiffness":
        is_at_min_stiffness = (contact != 0) & (run.stiffness.values < 1.0)
        _shade_times(axes, periods, is_at_min_stiffness, _MIN_STIFFNESS_COLOUR, bottom=0.92)
        text = f"in mesh at $C_\\mathrm{{min}}$: {100 * float(run.fraction_min_stiffness):.1f} %"
        # The curve fills the panel, so the text stands above it.
        axes.set_title(text, loc="left", fontsize=6.0, color=_MIN_STIFFNESS_COLOUR, pad=2.0)


def shade_contact(axes, periods: np.ndarray, contact: np.ndarray):
    """Shade the times without contact and with coast-side contact.

    `periods` are equidistant times in mesh periods, and `contact` is the contact state at each: 1
    (drive side), 0 (no contact) or -1 (coast side).
    """
    for code, area in ((0, "no contact"), (-1, "coast-side contact")):
        _shade_times(axes, periods, contact == code, style.AREA_COLOURS[area])


def _shade_times(axes, periods: np.ndarray, mask: np.ndarray, colour: str, bottom=0.0):
    """Shade the intervals of the equidistant times `periods` in which `mask` is true.

    The shade extends from `bottom`, a fraction of the height of the axes, to the upper edge.
    """
    step = periods[1] - periods[0]
    options = {"color": colour, "linewidth": 0, "zorder": 0}
    for first, last in true_intervals(mask):
        axes.axvspan(periods[first], periods[last] + step, bottom, 1.0, **options)


_SCENE_HEIGHT, _AXIS_HEIGHT = 1.15, 0.6
_MODEL_LABELS = {
    "pair": "1 degree",
    "six_degrees_plain": "6 degrees, plain",
    "six_degrees": "6 degrees, run-out, friction",
    "pair_harmonics": "1 degree, {} harmonics",
}
#: Limits of the changes in the panels; smaller and larger changes are drawn at the edges.
_CHANGE_LIMITS = (1e-6, 100.0)
_BLUE, _ORANGE = style.PALETTE[0], style.PALETTE[4]
_LABEL = """largest change of an observable (dashed: tolerance of the scene);
extrema: share of the height of the orbit, or of the force; fractions and bounces: 1
cost: components of the state advanced per mesh period"""


@style.rc_context()
def draw_models(comparisons: list[xr.Dataset], scenes: list[str]):
    """Return a figure of model errors: how much results change with a more detailed model.

    `comparisons` are results of `gearlib.studies.scenes.compare_models`, one for each scene (set of
    runs); `scenes` are the names of the scenes. Each scene has a panel with a bar for each model:
    the largest change of an observable, e.g. the largest displacement. The bar of the chosen model
    is filled. If rounding errors make a motion irreproducible, bars show medians over initial
    states, with ranges.
    """
    figure = style.page_figure(_AXIS_HEIGHT + _SCENE_HEIGHT * len(comparisons))
    panel_axes = figure.subplots(len(comparisons), 1, squeeze=False, sharex=True)[:, 0]
    for axes, scene, data in zip(panel_axes, scenes, comparisons, strict=True):
        axes.axvline(data.tolerance, color=_ORANGE, linewidth=0.8, linestyle="--")
        axes.set(xscale="log", xlim=_CHANGE_LIMITS)
        for i in range(data.sizes["model"]):
            _draw_bar(axes, data.isel(model=i), i)
        # Ticks inside the axes would overlap the bars.
        axes.tick_params(axis="y", length=0)
        labels = [_MODEL_LABELS[name].format(int(data.harmonics)) for name in data.model.values]
        axes.set_yticks(range(len(labels)), labels, fontsize=6)
        axes.invert_yaxis()
        axes.set_title(f"{scene}: {', '.join(data.observable.values)}", fontsize=7, loc="left")
    panel_axes[-1].set_xlabel(_LABEL, fontsize=7)
    return figure


def _draw_bar(axes, model: xr.Dataset, y: int):
    """Draw the change of results from one model to a more detailed one as a bar at the height `y`.

    The bar of the chosen model is filled. A text next to the bar states the change (NaN for the
    most detailed model) and the cost of the model.
    """
    change, is_chosen = float(model.change), model.model.item() == model.chosen.item()
    # If the motion depends on rounding errors, an orange line shows the range of the change over
    # several initial states.
    is_reproducible = bool(model.change_free_of_rounding)
    description = f"{change:.2g}" if is_reproducible else "rounding decides"
    if np.isnan(change):
        description = "the largest model"
    else:
        face_colour = _BLUE if is_chosen else "white"
        bar_length = max(change, _CHANGE_LIMITS[0])
        axes.barh(y, bar_length, color=face_colour, edgecolor=_BLUE, height=0.7)
        if not is_reproducible:
            axes.plot([model.change_low, model.change_high], [y] * 2, color=_ORANGE, lw=2.0)
    if is_chosen:
        description += ", used for the scene"
    if is_reproducible:
        description += f", cost {float(model.cost):.3g}"
    point, box = (_CHANGE_LIMITS[1], y), style.white_box(padding=0.1)
    style.annotate(axes, description, point, (-4, 0), "right center", bbox=box)

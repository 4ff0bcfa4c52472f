"""Fig. 4, 6, 7, 8: phase planes and time histories of a few runs, in columns."""

import re

import numpy as np
import xarray as xr

from gearlib.data.motions import true_intervals
from gearlib.figures import panels, style
from gearlib.figures.phase_planes_figure import draw_plane

_PLANE_HEIGHT, _ROW_HEIGHT, _HEADER_HEIGHT = 2.2, 1.05, 0.6
_MODELS = {
    "pair": "1 degree of freedom, rectangular stiffness",
    "six_degrees_plain": "6 degrees of freedom, rectangular stiffness",
    "six_degrees": "6 degrees of freedom, rectangular stiffness, run-out, friction",
}
_MIN_STIFFNESS_COLOUR = "#D55E00"


@style.styled()
def draw(scene: xr.Dataset, *, courses: list[str], periods_shown: int):
    """Return a figure of phase planes above time histories, with a column for each run.

    `scene` is a result of `gearlib.studies.scenes`: a few runs, along its dimension "case".
    `courses` are the names of the variables that have a row of time histories each, over the last
    `periods_shown` mesh periods of the record.
    """
    samples = periods_shown * round(2.0 * np.pi / float(scene.phase[1] - scene.phase[0]))
    shown = scene.isel(phase=slice(scene.sizes["phase"] - samples, None))
    heights = [_PLANE_HEIGHT] + [_ROW_HEIGHT] * len(courses)
    figure = style.page_figure(_HEADER_HEIGHT + sum(heights))
    grid = figure.subplots(
        len(heights), scene.sizes["case"], squeeze=False, sharey="row", height_ratios=heights
    )
    for column, title in zip(grid.T, map(str, shown.case.values), strict=True):
        run = shown.sel(case=title)
        draw_plane(column[0], run, color=style.PALETTE[0], linewidth=0.8)
        (tuning,) = panels.tuning_texts(run.tuning, run.get("speed"))
        stated = re.search(r"(?:tuning|nu|ν)\s*=?\s*(\d+(?:\.\d+)?)", title)
        is_stated = stated is not None and float(stated[1]) == float(run.tuning)
        column[0].set_title(title if is_stated else f"{title}\n$\\nu_s$ = {tuning}")
        column[0].set_xlabel(style.DISPLACEMENT_LABEL)
        column[0].set_xlim(style.limits(shown.displacement, 0.0))
        for axes, name in zip(column[1:], courses, strict=True):
            _draw_time_history(axes, panels.in_mesh_periods(run), name)
            axes.label_outer()
    label, limits = panels.axis_label(scene.velocity, width=30), style.limits(shown.velocity)
    grid[0, 0].set(ylabel=label, ylim=limits)
    figure.supxlabel(f"model: {_MODELS[scene.model.item()]}", fontsize=6, x=0.99, ha="right")
    return figure


def _draw_time_history(axes, run: xr.Dataset, name: str):
    """Draw the variable `name` of a run over the mesh periods, with shades for contact loss.

    For the modified stiffness (0 without contact) a bar marks the times of contact at the lower
    level of the stiffness, which is below its mean 1.
    """
    steps = "steps-post" if name.endswith("stiffness") else "default"
    panels.draw_curves(axes, run, "phase", name, linewidth=0.9, drawstyle=steps)
    axes.set_ylabel(panels.axis_label(run[name], width=20), fontsize=6.5)
    periods, contact = run.phase.values, run.contact.values
    axes.set_xlim(periods[0], periods[-1])
    axes.margins(y=0.12)
    shade_contact(axes, periods, contact)
    if name == "modified_stiffness":
        is_soft_contact = (contact != 0) & (run.stiffness.values < 1.0)
        _shade_times(axes, periods, is_soft_contact, _MIN_STIFFNESS_COLOUR, bottom=0.92)
        text = f"in mesh at $C_\\mathrm{{min}}$: {100 * float(run.fraction_min_stiffness):.1f} %"
        options = {"anchor": "left baseline", "color": _MIN_STIFFNESS_COLOUR}
        options["bbox"] = style.white_box(padding=0.15, opacity=0.8)
        style.annotate(axes, text, (0.02, 0.45), coords="axes fraction", **options)


def shade_contact(axes, periods: np.ndarray, contact: np.ndarray):
    """Shade the times of contact loss (code 0) and coast-side contact (-1); times are `periods`."""
    for code, area in ((0, "no contact"), (-1, "coast-side contact")):
        _shade_times(axes, periods, contact == code, style.AREA_COLOURS[area])


def _shade_times(axes, periods: np.ndarray, mask: np.ndarray, colour: str, bottom=0.0):
    """Shade the intervals of `periods` where the mask is true, from `bottom` (0 to 1) upwards."""
    step, options = periods[1] - periods[0], {"color": colour, "linewidth": 0, "zorder": 0}
    for first, last in true_intervals(mask):
        axes.axvspan(periods[first], periods[last] + step, bottom, 1.0, **options)

"""Fig. 4, 6, 7, 8: phase plane and time courses of a few runs, a column each."""

import numpy as np
import xarray as xr

from gearlib.data.motions import true_intervals
from gearlib.figures import panels, style
from gearlib.figures.phase_planes_figure import draw_plane

_PLANE_HEIGHT, _ROW_HEIGHT, _HEAD = 2.2, 1.05, 0.6
_MODELS = {
    "one_degree": "1 degree of freedom, rectangular stiffness",
    "six_degrees_plain": "6 degrees of freedom, rectangular stiffness",
    "six_degrees": "6 degrees of freedom, rectangular stiffness, run-out, friction",
}
_MIN_STIFFNESS_COLOUR = "#D55E00"


@style.styled()
def draw(scene: xr.Dataset, *, courses: list[str], periods_shown: int):
    """Return a figure of a scene of `gearlib.studies.scenes`: phase planes above time histories.

    `courses` are names of variables to draw over time; the last `periods_shown` mesh periods of
    the record are drawn. Cases are in columns.
    """
    samples = periods_shown * round(2.0 * np.pi / float(scene.phase[1] - scene.phase[0]))
    shown = scene.isel(phase=slice(scene.sizes["phase"] - samples, None))
    heights = [_PLANE_HEIGHT] + [_ROW_HEIGHT] * len(courses)
    figure = style.page(_HEAD + sum(heights))
    grid = figure.subplots(
        len(heights), scene.sizes["case"], squeeze=False, sharey="row", height_ratios=heights
    )
    for column, title in zip(grid.T, map(str, shown.case.values), strict=True):
        run = shown.sel(case=title)
        draw_plane(column[0], run, color=style.PALETTE[0], linewidth=0.8)
        tuning = f"{float(run.tuning):g}"
        column[0].set_title(title if tuning in title else f"{title}\n$\\nu_s$ = {tuning}")
        column[0].set_xlabel(style.SHORT_DISPLACEMENT)
        column[0].set_xlim(style.limits(shown.displacement, 0.0))
        for axes, name in zip(column[1:], courses, strict=True):
            _draw_course(axes, panels.in_mesh_periods(run), name)
            axes.label_outer()
    grid[0, 0].set(ylabel=panels.axis_label(scene.velocity, 30), ylim=style.limits(shown.velocity))
    figure.supxlabel(f"model: {_MODELS[scene.model.item()]}", fontsize=6, x=0.99, ha="right")
    return figure


def _draw_course(axes, run: xr.Dataset, name: str):
    """Draw the variable `name` of a run over the mesh periods, with shades for contact loss.

    A bar above the modified stiffness marks where the mesh has its lower stiffness.
    """
    steps = "steps-post" if name.endswith("stiffness") else "default"
    panels.draw_curves(axes, run, "phase", name, linewidth=0.9, drawstyle=steps)
    axes.set_ylabel(panels.axis_label(run[name], 20), fontsize=6.5)
    periods, contact = run.phase.values, run.contact.values
    axes.set_xlim(periods[0], periods[-1])
    axes.margins(y=0.12)
    shade_contact(axes, periods, contact)
    if name == "modified_stiffness":
        low = (contact != 0) & (run.stiffness.values < 1.0)
        _shade_times(axes, periods, low, _MIN_STIFFNESS_COLOUR, lowest=0.92)
        share = f"in mesh at $C_\\mathrm{{min}}$: {100 * float(run.fraction_min_stiffness):.1f} %"
        options = {"side": "left baseline", "white": (0.15, 0.8), "color": _MIN_STIFFNESS_COLOUR}
        style.note(axes, share, (0.02, 0.45), of="axes fraction", **options)


def shade_contact(axes, periods: np.ndarray, contact: np.ndarray):
    """Shade contact loss (code 0 in `contact`) and back-side contact (-1) over `periods`."""
    for code, area in ((0, "backlash"), (-1, "inverse mesh")):
        _shade_times(axes, periods, contact == code, style.AREA_COLOURS[area])


def _shade_times(axes, periods: np.ndarray, mask: np.ndarray, colour: str, lowest=0.0):
    """Shade the intervals of `periods` where the mask is true, from `lowest` (0 to 1) upwards."""
    step, options = periods[1] - periods[0], {"color": colour, "linewidth": 0, "zorder": 0}
    for first, last in true_intervals(mask):
        axes.axvspan(periods[first], periods[last] + step, lowest, 1.0, **options)

"""Fig. 4, 6, 7, 8: phase plane and time courses of a few runs, a column each."""

import numpy as np

from gearlib.data.motions import stretches
from gearlib.figures import style

_PLANE_HEIGHT, _ROW_HEIGHT, _HEAD = 2.2, 1.05, 0.6

#: What stands at the vertical axes, with the unit of lengths; forces are over the load.
_SYMBOLS = {
    "displacement": "$y$\n(static defl.)",
    "velocity": "$dy/d\\tau$\n(static defl./rad)",
    "acceleration": "$d^2y/d\\tau^2$\n(static defl./rad²)",
    "stiffness": "$C/C_s$",
    "modified_stiffness": "$C(H_1+H_2)/C_s$",
    "dynamic_force": "$F_\\mathrm{dyn}/F$",
    "friction_force": "$F_T/F$",
    "bearing_y3": "$y_3$\n(static defl.)",
    "bearing_z3": "$z_3$\n(static defl.)",
    "bearing_y2": "$y_2$\n(static defl.)",
    "bearing_z2": "$z_2$\n(static defl.)",
}
_MODELS = {
    "one_degree": "1 degree of freedom, rectangular stiffness",
    "six_degrees_plain": "6 degrees of freedom, rectangular stiffness",
    "six_degrees": "6 degrees of freedom, rectangular stiffness, run-out, friction",
}
_MIN_STIFFNESS_COLOUR = "#D55E00"


@style.styled()
def draw(scene, *, courses, periods_shown):
    """Draw a scene of `gearlib.studies.scenes.compute`.

    `courses` are variables over (case, phase), drawn below the phase planes from above;
    `periods_shown` the last mesh periods of the record. Times in the backlash are shaded; times
    in mesh at the lower stiffness are marked by a bar above the modified stiffness, with their
    share of the record.
    """
    titles = [str(title) for title in scene.case.values]
    phase = scene.phase.values
    per_period = round(2.0 * np.pi / (phase[1] - phase[0]))
    shown = scene.isel(phase=slice(phase.size - per_period * periods_shown, None))
    heights = [_PLANE_HEIGHT] + [_ROW_HEIGHT] * len(courses)
    figure = style.page(_HEAD + sum(heights))
    grid = figure.subplots(
        1 + len(courses), len(titles), squeeze=False, sharey="row", height_ratios=heights
    )
    for axes in grid[0, 1:]:
        axes.sharex(grid[0, 0])
    for column, title in enumerate(titles):
        run = shown.isel(case=column)
        tuning = float(run.tuning)
        words = title if f"{tuning:g}" in title else f"{title}\n$\\nu_s$ = {tuning:g}"
        _draw_plane(grid[0, column], run, words)
        for name, axes in zip(courses, grid[1:, column], strict=True):
            _draw_course(axes, run, name)
        grid[-1, column].set_xlabel("mesh periods")
        for axes in grid[1:-1, column]:
            axes.tick_params(labelbottom=False)
    grid[0, 0].set_ylabel(_SYMBOLS["velocity"])
    figure.supxlabel(f"model: {_MODELS[scene.model.item()]}", fontsize=6, x=0.99, ha="right")
    for name, axes in zip(courses, grid[1:, 0], strict=True):
        axes.set_ylabel(_SYMBOLS[name])
    return figure


def _draw_plane(axes, run, title):
    """Draw the phase plane {y'; y} of one case."""
    axes.plot(run.displacement, run.velocity, color=style.PALETTE[0], linewidth=0.8)
    low, high = np.nanmin([run.displacement.min(), 0.0]), np.nanmax([run.displacement.max(), 0.0])
    margin = 0.06 * (high - low) or 1.0
    left, right = axes.get_xlim() if axes.get_title() else (low - margin, high + margin)
    others = [a for a in axes.get_shared_x_axes().get_siblings(axes) if a.get_title()]
    if others:
        # A common scale that holds the earlier columns too.
        known = others[0].get_xlim()
        left, right = min(known[0], left), max(known[1], right)
    axes.set_xlim(left, right)
    # With moving bearings the far flank is no line in this plane: only y < 0 is shaded then.
    still = "backlash" not in run
    style.shade_areas(axes, float(run.backlash_ratio) if still else np.inf, "x")
    axes.set_xlabel(style.SHORT_DISPLACEMENT)
    axes.set_title(title)


def _draw_course(axes, run, name):
    """Draw one variable over the mesh periods."""
    periods = run.phase.values / (2.0 * np.pi)
    flat = name.endswith("stiffness")
    axes.plot(
        periods,
        run[name],
        color=style.PALETTE[0],
        linewidth=0.9,
        drawstyle="steps-post" if flat else "default",
    )
    axes.set_xlim(periods[0], periods[-1])
    axes.margins(y=0.12)
    shade_contact(axes, periods, run.contact.values)
    if name == "modified_stiffness":
        low = (run.contact.values != 0) & (run.stiffness.values < 1.0)
        _shade_times(axes, periods, low, _MIN_STIFFNESS_COLOUR, 0.92, 1.0)
        words = f"in mesh at $C_\\mathrm{{min}}$: {100 * float(run.fraction_min_stiffness):.1f} %"
        look = {"side": "left baseline", "white": (0.15, 0.8), "color": _MIN_STIFFNESS_COLOUR}
        style.note(axes, words, (0.02, 0.45), of="axes fraction", **look)


def shade_contact(axes, periods, contact):
    """Shade the times out of normal mesh; contact: codes over time."""
    for code, area in ((0, "backlash"), (-1, "inverse mesh")):
        _shade_times(axes, periods, contact == code, style.AREA_COLOURS[area], 0.0, 1.0)


def _shade_times(axes, periods, where, colour, low, high):
    """Shade the intervals of time in which `where` holds."""
    step, look = periods[1] - periods[0], {"color": colour, "linewidth": 0, "zorder": 0}
    for first, last in stretches(where):
        axes.axvspan(periods[first], periods[last] + step, low, high, **look)

"""Measured time courses over a mesh period, beside those of the model."""

import numpy as np

from gearlib.figures import style

_HEIGHT = 2.6


@style.styled()
def draw(courses, *, colours=None):
    """Draw datasets of `gearlib.studies.measured_comparison.courses`, a panel for each course.

    courses: one or several; colours: those of the dampings by name.
    """
    panels = [
        (one.attrs["title"], one.attrs["course_units"], one.isel(course=i, observable=j))
        for one in courses
        for i in range(one.sizes["course"])
        for j in range(one.sizes["observable"])
    ]
    rows = max(1, -(-len(panels) // 2))
    figure = style.page(_HEIGHT * rows + 0.5)
    axes = figure.subplots(rows, 2, squeeze=False)
    for panel in axes.flat[len(panels) :]:
        panel.set_axis_off()
    dampings = [str(name) for name in courses[0].damping.values]
    looks = style.looks(dampings, colours)
    for panel, (title, units, one) in zip(axes.flat, panels, strict=False):
        name = str(one.observable.values)
        turns = one.phase.values / (2.0 * np.pi)
        at = one.point_phase.values / (2.0 * np.pi)
        style.dots(panel, at, one.point.values, ".", "#8C8C8C", 2.0, zorder=1)
        for damping, look in looks.items():
            values = one.computed.sel(damping=damping).values
            panel.plot(turns, values, color=look.colour, linestyle=look.line, linewidth=1.0)
        unit = dict(part.split(" in ") for part in units.split(", "))[name]
        panel.set_title(f"{title}, {float(one.speed):.5g} rpm", fontsize=8)
        panel.set_ylabel(f"{name.replace('_', ' ')} ({unit})")
        panel.set_xlabel("mesh period")
    handles = [style.entry(style.damping_label(n), k.colour, k.line) for n, k in looks.items()]
    style.legend(figure, [style.entry("measured", "#8C8C8C", "", "."), *handles], 5)
    return figure

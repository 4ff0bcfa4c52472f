"""All meshes of a gear train over speed: dynamic factors, share of time in contact."""

import numpy as np

from gearlib.figures import schematic, style
from gearlib.figures.starts import draw_range, draw_shares, entries

_ROWS = (
    ("dynamic_factor", "largest force over static force"),
    ("fraction_normal", "share of time in contact"),
)
_LINES = {"up": "-", "down": (0, (4, 2))}


@style.styled()
def draw(curves):
    """Draw a colour for each mesh; meshes that move alike lie on top of each other.

    `curves` are those of `gearlib.studies.trains.over_speed.compute`. Shades are ranges over
    all starts beside static equilibrium, dots their medians; lines carry one start, where it
    settles.
    """
    figure = style.page(5.2)
    names = list(curves.mesh.values)
    colours = style.mesh_colours(names)
    part = schematic.with_train(figure, curves, colours)
    ratios = [1.0] * len(_ROWS) + [0.3]
    grid = part.subplots(len(_ROWS) + 1, 1, sharex=True, height_ratios=ratios)
    cold = curves.sel(direction="cold")
    widths = np.linspace(3.0, 0.8, len(names))
    speed = curves.speed.values
    draw_shares(grid[-1], speed, cold)
    grid[-1].set_ylabel("share of\nthe starts")
    for axes, (variable, label) in zip(grid, _ROWS, strict=False):
        for j, (width, colour) in enumerate(zip(widths, colours.values(), strict=True)):
            one = cold.isel(mesh=j)
            draw_range(axes, speed, one, variable, colour)
            apart = one.settled.values == 0
            axes.plot(speed[apart], one[variable].values[apart], ".", color=colour, markersize=1.5)
            for direction, line in _LINES.items():
                values = curves[variable].sel(direction=direction).isel(mesh=j).values
                axes.plot(speed, values, color=colour, linestyle=line, linewidth=width)
        axes.set_ylabel(label)
        axes.grid(linewidth=0.3, color="0.85")
    per_tuning = speed[0] / curves.tuning.values[0]
    above = grid[0].secondary_xaxis(
        "top", functions=(lambda n: n / per_tuning, lambda nu: nu * per_tuning)
    )
    above.set_xlabel(style.OWN_TUNING)
    grid[-1].set_xlabel("speed of the reference pinion (rpm)")
    grid[0].set_xlim(speed[0], speed[-1])
    handles = [
        style.entry(name, colours[name], linewidth=width)
        for name, width in zip(names, widths, strict=True)
    ]
    handles += [style.entry(f"speed {way}", line=line) for way, line in _LINES.items()]
    style.legend(figure, [*handles, *entries("on one orbit")], 4)
    return figure

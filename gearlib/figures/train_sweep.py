"""All meshes of a gear train over speed: dynamic factors, share of time in contact."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gearlib.figures import style

_ROWS = (
    ("dynamic_factor", "largest force over static force"),
    ("fraction_normal", "share of time in contact"),
)
_LINES = {"up": "-", "down": (0, (4, 2))}


@style.styled()
def draw(curves):
    """Draw a colour for each mesh; meshes that move alike lie on top of each other.

    Parameters
    ----------
    curves : xarray.Dataset
        As of `gearlib.studies.trains.over_speed.compute`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure((style.PAGE_WIDTH, 4.6), layout="constrained")
    grid = figure.subplots(len(_ROWS), 1, sharex=True)
    names = list(curves.mesh.values)
    widths = np.linspace(3.0, 0.8, len(names))
    speed = curves.speed.values
    for axes, (variable, label) in zip(grid, _ROWS, strict=True):
        for j, width in enumerate(widths):
            for direction, line in _LINES.items():
                values = curves[variable].sel(direction=direction).isel(mesh=j).values
                colour = style.PALETTE[j % len(style.PALETTE)]
                axes.plot(speed, values, color=colour, linestyle=line, linewidth=width)
        axes.set_ylabel(label)
        axes.grid(linewidth=0.3, color="0.85")
    per_tuning = speed[0] / curves.tuning.values[0]
    above = grid[0].secondary_xaxis(
        "top", functions=(lambda n: n / per_tuning, lambda nu: nu * per_tuning)
    )
    above.set_xlabel("tuning $\\nu$")
    grid[-1].set_xlabel("speed of the reference pinion (rpm)")
    grid[0].set_xlim(speed[0], speed[-1])
    handles = [
        Line2D([], [], color=style.PALETTE[j % len(style.PALETTE)], linewidth=width, label=name)
        for j, (name, width) in enumerate(zip(names, widths, strict=True))
    ]
    handles += [
        Line2D([], [], color="black", linestyle=line, label=f"speed {direction}")
        for direction, line in _LINES.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure

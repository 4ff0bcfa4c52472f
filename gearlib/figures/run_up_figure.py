"""Run-ups: extrema and statistics of the revolutions over the speed."""

import numpy as np

from gearlib import checks
from gearlib.figures import plot_curves, style

#: What may be drawn, over the revolutions -> what stands at its axis without the unit.
_VARIABLES = {
    "dynamic_force_max": "largest mesh force",
    "dynamic_force_min": "least mesh force",
    "mean_force": "mean mesh force",
    "displacement_max": "largest displacement",
    "displacement_min": "least displacement",
    "bounces": "losses of contact per mesh period",
    "fraction_normal": "fraction of time in normal mesh",
}


@style.styled()
def run_up(*runs, axes=None, labels=None, variable="dynamic_force_max"):
    """Draw what the revolutions of run-ups have over their speed; dotted where it falls.

    Parameters
    ----------
    *runs : xarray.Dataset
        Of `gearlib.run_up`; each mesh of a train is a colour.
    axes : matplotlib.axes.Axes, optional
    labels : sequence of str, optional
        Of the datasets.
    variable : str
        Any over ``revolution``: extrema of displacement and dynamic_force, mean_force, bounces,
        fraction_normal.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset is no run-up, or has no such variable.
    """
    checks.one_of("variable", variable, tuple(_VARIABLES))
    parts = plot_curves.parts("run_up", runs, labels, (variable, "revolution_speed"), "run_up")
    axes, own = plot_curves.axes(axes)
    scale, name = 1.0, "N" if variable.endswith("force") or "force_" in variable else "1"
    if variable.startswith("displacement"):
        scale, name = style.length_unit(max(float(abs(one[variable]).max()) for *_, one in parts))
    for (label, look), (*_, one) in zip(plot_curves.looks(parts), parts, strict=True):
        speed, height = one.revolution_speed.values, one[variable].values / scale
        falls = np.diff(speed, append=speed[-1]) < 0.0
        # The last revolution goes on as the one before it.
        falls[-1:] = falls[-2:-1]
        for part, line in ((~falls, "-"), (falls, ":")):
            if part.any():
                y = np.where(part, height, np.nan)
                axes.plot(speed, y, color=look.colour, ls=line, label=label)
                label = None
    axes.set_xlabel("speed (rpm)")
    axes.set_ylabel(_VARIABLES[variable] + ("" if name == "1" else f" ({name})"))
    return plot_curves.finish(axes, own)

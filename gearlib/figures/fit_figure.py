"""Draw what a fit compared, measured and fitted."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearlib.figures import style

_MEASURED, _FITTED = "#8C8C8C", style.PALETTE[0]
_ROW_HEIGHT = 2.0
#: Half a 95 % interval in standard deviations.
_INTERVAL = 1.96


@style.styled()
def fit(found, *, figure: Figure | None = None) -> Figure:
    """Draw what a fit compared, measured and fitted.

    Parameters
    ----------
    found : Fit
        Of `gearlib.fit`.
    figure : matplotlib.figure.Figure, optional

    Returns
    -------
    matplotlib.figure.Figure
        An axes for each curve, dots measured and lines fitted, dotted where the speed falls; the
        last one for all speeds of jumps and of the onset of contact loss.

    Raises
    ------
    ValueError
        If it is no fit.
    """
    if not hasattr(found, "redchi"):
        raise ValueError("found is not allowed: gearlib.plot.fit draws a fit of gearlib.fit")
    curves = [curve for curve in found.curves() if hasattr(curve, "at")]
    speeds = [speed for speed in found.curves() if not hasattr(speed, "at")]
    rows = -(-(len(curves) + bool(speeds)) // 2)
    if figure is None:
        from matplotlib import pyplot

        size = (style.PAGE_WIDTH, _ROW_HEIGHT * rows)
        figure = pyplot.figure(figsize=size, layout="constrained")
    for i, curve in enumerate(curves):
        _draw_curve(figure.add_subplot(rows, 2, i + 1), curve)
    if speeds:
        _draw_speeds(figure.add_subplot(rows, 2, len(curves) + 1), speeds)
    figure.axes[0].legend()
    return figure


def _draw_curve(axes: Axes, curve):
    """Draw a measured curve as dots and the fitted one as a line, dotted where the speed falls."""
    measured, fitted = curve.heights
    scale, unit = 1.0, curve.units
    if unit == "m":
        scale, unit = style.length_unit(np.nanmax(np.abs(measured)))
    style.dots(axes, curve.at, measured / scale, ".", _MEASURED, 2.5, label="measured")
    for part, dashes, label in ((~curve.falls, "-", "fitted"), (curve.falls, ":", "speed falls")):
        if part.any():
            line = {"color": _FITTED, "linestyle": dashes, "linewidth": 0.9, "label": label}
            axes.plot(curve.at, np.where(part, fitted / scale, np.nan), **line)
    axes.set_xlabel("speed (rpm)" if curve.over == "speed" else "mesh periods")
    axes.set_ylabel(curve.name + (f" ({unit})" if unit not in ("", "1") else ""))


def _draw_speeds(axes: Axes, speeds: list):
    """Draw how far fitted speeds of jumps lie from the measured ones, with their intervals."""
    places = np.arange(len(speeds))
    bars = {"fmt": ".", "color": _MEASURED, "capsize": 3, "label": "measured"}
    axes.errorbar(places, 0.0 * places, yerr=[_INTERVAL * x.deviation for x in speeds], **bars)
    differences = [speed.fitted - speed.measured for speed in speeds]
    style.dots(axes, places, differences, "o", _FITTED, 4, label="fitted", mfc="none")
    axes.set_xticks(places, [f"{speed.name}\n{speed.measured:.6g}" for speed in speeds])
    axes.set(xlim=(-0.5, len(speeds) - 0.5), ylabel="fitted less measured (rpm)")

"""Measured curves of a fit beside the fitted ones."""

import numpy as np
from matplotlib.figure import Figure

from gearlib.figures import style

_MEASURED, _FITTED = "#8C8C8C", style.PALETTE[0]
_ROW_HEIGHT = 2.0
#: Half a 95 % interval in standard deviations.
_HALF_INTERVAL = 1.96


@style.styled()
def fit(found, *, figure: Figure | None = None):
    """Draw the measured curves of a fit and the fitted ones over them.

    Parameters
    ----------
    found : Fit
        Result of `gearlib.fit`.
    figure : matplotlib.figure.Figure, optional
        Empty figure to draw in; a new one of pyplot by default.

    Returns
    -------
    matplotlib.figure.Figure
        With axes for each curve: dots measured, lines fitted, dotted where the speed falls. The
        last axes show all speeds of jumps and of the onset of contact loss.

    Raises
    ------
    ValueError
        If `found` is no fit.
    """
    if not hasattr(found, "redchi"):
        raise ValueError("found is not allowed: gearlib.plot.fit draws a fit of gearlib.fit")
    # Curves have values `at` several speeds or phases; speeds of jumps are single numbers.
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


def _draw_curve(axes, curve):
    """Draw one curve of a fit: measured as dots, fitted as a line, dotted where the speed falls."""
    measured, fitted = curve.heights
    scale, unit = 1.0, curve.units
    if unit == "m":
        scale, unit = style.length_unit(np.nanmax(np.abs(measured)))
    style.dots(axes, curve.at, measured / scale, ".", _MEASURED, 2.5, label="measured")
    for mask, dashes, label in ((~curve.falls, "-", "fitted"), (curve.falls, ":", "speed falls")):
        if mask.any():
            line = {"color": _FITTED, "linestyle": dashes, "linewidth": 0.9, "label": label}
            axes.plot(curve.at, np.where(mask, fitted / scale, np.nan), **line)
    axes.set_xlabel("speed (rpm)" if curve.over == "speed" else "mesh periods")
    axes.set_ylabel(curve.name + (f" ({unit})" if unit not in ("", "1") else ""))


def _draw_speeds(axes, speeds: list):
    """Draw fitted minus measured speeds of jumps, with 95 % intervals of the measured ones."""
    positions = np.arange(len(speeds))
    bars = {"fmt": ".", "color": _MEASURED, "capsize": 3, "label": "measured"}
    intervals = [_HALF_INTERVAL * speed.deviation for speed in speeds]
    axes.errorbar(positions, 0.0 * positions, yerr=intervals, **bars)
    differences = [speed.fitted - speed.measured for speed in speeds]
    style.dots(axes, positions, differences, "o", _FITTED, 4, label="fitted", mfc="none")
    axes.set_xticks(positions, [f"{speed.name}\n{speed.measured:.6g}" for speed in speeds])
    axes.set(xlim=(-0.5, len(speeds) - 0.5), ylabel="fitted less measured (rpm)")

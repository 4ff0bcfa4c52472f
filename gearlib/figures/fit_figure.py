"""Measured curves of a fit beside the fitted ones."""

import numpy as np
from matplotlib.figure import Figure

from gearlib.figures import style

_MEASURED_COLOUR, _FITTED_COLOUR = "#8C8C8C", style.PALETTE[0]
_ROW_HEIGHT = 2.0
#: Half width of a 95 % interval in standard deviations.
_HALF_INTERVAL = 1.96


@style.styled()
def fit(found, *, figure: Figure | None = None):
    """Draw the measured curves of a fit and the fitted ones over them.

    Parameters
    ----------
    found : Fit
        Result of `gearlib.fit`.
    figure : matplotlib.figure.Figure, optional
        Empty figure to draw into; by default a new pyplot figure.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with axes for each curve: measured values as dots, fitted ones as a line, which is
        dotted where the speed falls. The last axes show the speeds of jumps and of the onset of
        contact loss.

    Raises
    ------
    ValueError
        If `found` is not a result of `gearlib.fit`.
    """
    # Only results of `gearlib.fit` have a reduced chi-square.
    if not hasattr(found, "redchi"):
        raise ValueError("found is not allowed: gearlib.plot.fit draws a fit of gearlib.fit")
    # Curves over speed or phase have abscissae x. The others are single measured speeds, those of
    # jumps and of the onset of contact loss.
    curves = [curve for curve in found.curves() if hasattr(curve, "x")]
    speeds = [speed for speed in found.curves() if not hasattr(speed, "x")]
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
    """Draw measured values of a curve as dots, fitted ones as a line, dotted where speed falls."""
    measured, fitted = curve.values
    unit_size, unit = style.readable_unit(curve.units, measured)
    markers = measured / unit_size, ".", _MEASURED_COLOUR, 2.5
    style.draw_markers(axes, curve.x, *markers, label="measured")
    is_falling = curve.speed_falls
    for mask, dashes, label in ((~is_falling, "-", "fitted"), (is_falling, ":", "speed falls")):
        if mask.any():
            line = {"color": _FITTED_COLOUR, "linestyle": dashes, "linewidth": 0.9, "label": label}
            axes.plot(curve.x, np.where(mask, fitted / unit_size, np.nan), **line)
    axes.set_xlabel("speed (rpm)" if curve.x_name == "speed" else "mesh periods")
    axes.set_ylabel(curve.name + (f" ({unit})" if unit not in ("", "1") else ""))


def _draw_speeds(axes, speeds: list):
    """Draw fitted minus measured speeds of jumps, with 95 % intervals of the measured ones."""
    positions = np.arange(len(speeds))
    options = {"fmt": ".", "color": _MEASURED_COLOUR, "capsize": 3, "label": "measured"}
    intervals = [_HALF_INTERVAL * speed.deviation for speed in speeds]
    axes.errorbar(positions, 0.0 * positions, yerr=intervals, **options)
    differences = [speed.fitted - speed.measured for speed in speeds]
    options = {"label": "fitted", "mfc": "none"}
    style.draw_markers(axes, positions, differences, "o", _FITTED_COLOUR, 4, **options)
    axes.set_xticks(positions, [f"{speed.name}\n{speed.measured:.6g}" for speed in speeds])
    axes.set(xlim=(-0.5, len(speeds) - 0.5), ylabel="fitted less measured (rpm)")

"""Draw what a fit compared, measured and fitted."""

import math

import numpy as np

from gearlib.figures import style

_MEASURED, _FITTED = "#8C8C8C", style.PALETTE[0]
_HEIGHT = 2.0


@style.styled()
def fit(found, *, figure=None):
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
    _check(found)
    every = found.curves()
    curves = [one for one in every if hasattr(one, "at")]
    places = [one for one in every if not hasattr(one, "at")]
    count = len(curves) + bool(places)
    rows = math.ceil(count / 2)
    if figure is None:
        from matplotlib import pyplot

        size = (style.PAGE_WIDTH, _HEIGHT * rows)
        figure = pyplot.figure(figsize=size, layout="constrained")
    panels = [figure.add_subplot(rows, 2, i + 1) for i in range(count)]
    for axes, curve in zip(panels, curves, strict=False):
        _draw_curve(axes, curve)
    if places:
        _draw_places(panels[-1], places)
    if curves:
        panels[0].legend()
    return figure


def _draw_curve(axes, curve):
    measured, fitted = curve.heights
    scale, unit = 1.0, curve.units
    if unit == "m":
        scale, unit = style.length_unit(np.nanmax(np.abs(measured)))
    style.dots(axes, curve.at, measured / scale, ".", _MEASURED, 2.5, label="measured")
    label = "fitted"
    for part, line in ((~curve.falls, "-"), (curve.falls, ":")):
        if part.any():
            y = np.where(part, fitted / scale, np.nan)
            axes.plot(curve.at, y, color=_FITTED, ls=line, lw=0.9, label=label)
            label = None
    axes.set_xlabel("speed (rpm)" if curve.over == "speed" else "mesh periods")
    axes.set_ylabel(curve.name + (f" ({unit})" if unit not in ("", "1") else ""))


def _draw_places(axes, places):
    at = np.arange(len(places))
    apart = [one.fitted - one.measured for one in places]
    axes.errorbar(
        at,
        np.zeros(len(places)),
        yerr=[1.96 * one.deviation for one in places],
        fmt=".",
        color=_MEASURED,
        capsize=3,
        label="measured",
    )
    style.dots(axes, at, apart, "o", _FITTED, 4, label="fitted", mfc="none")
    axes.set_xticks(at, [f"{one.name}\n{one.measured:.6g}" for one in places])
    axes.set_xlim(-0.5, len(places) - 0.5)
    axes.set_ylabel("fitted less measured (rpm)")


def _check(found):
    if not hasattr(found, "redchi"):
        raise ValueError("found is not allowed: gearlib.plot.fit draws a fit of gearlib.fit")

"""Fits: what was compared, measured and fitted, the starts, profiles of the parameters."""

import math

import numpy as np

from gearlib import checks
from gearlib.figures import plot_curves, style

_MEASURED, _FITTED = "#8C8C8C", style.PALETTE[0]
_HEIGHT = 2.0
#: -2 ln of the ratio of likelihoods at the ends of an interval of 95 %.
_LEVEL = 3.84


@style.styled()
def fit(found, *, figure=None):
    """Draw what a fit compared, measured and fitted, and beneath it the starts.

    Parameters
    ----------
    found : Fit
        Of `gearlib.fit`.
    figure : matplotlib.figure.Figure, optional

    Returns
    -------
    matplotlib.figure.Figure
        An axes for each curve, dots measured and lines fitted, dotted where the speed falls; one
        for all speeds of jumps and of the onset of contact loss; the last is the waterfall.

    Raises
    ------
    ValueError
        If it is no fit.
    """
    _check("fit", found)
    every = found.curves()
    curves = [one for one in every if hasattr(one, "at")]
    places = [one for one in every if not hasattr(one, "at")]
    count = len(curves) + bool(places) + 1
    rows = math.ceil(count / 2)
    if figure is None:
        from matplotlib import pyplot

        size = (style.PAGE_WIDTH, _HEIGHT * rows)
        figure = pyplot.figure(figsize=size, layout="constrained")
    panels = [figure.add_subplot(rows, 2, i + 1) for i in range(count)]
    for axes, curve in zip(panels, curves, strict=False):
        _draw_curve(axes, curve)
    if places:
        _draw_places(panels[-2], places)
    waterfall(found, axes=panels[-1])
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


@style.styled()
def waterfall(found, *, axes=None):
    """Draw what the starts of a fit cost, and what those that were improved came to.

    A step at the bottom that several starts share is no local minimum by chance.

    Parameters
    ----------
    found : Fit
        Of `gearlib.fit`.
    axes : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If it is no fit.
    """
    _check("waterfall", found)
    axes, own = plot_curves.axes(axes)
    for values, look, words in (
        (np.sort(found.starts), {"color": _MEASURED, "ls": "none", "marker": "."}, "starts"),
        (found.waterfall, {"color": _FITTED, "marker": "o", "mfc": "none"}, "improved"),
    ):
        shown = values[values < 1e20 * max(values.min(), 1e-300)] / found.ndata
        axes.plot(np.arange(1, shown.size + 1), shown, ms=4, lw=0.9, label=words, **look)
    axes.set_yscale("log")
    axes.set_xlabel("start, the best first")
    axes.set_ylabel("sum of squares per datum")
    return plot_curves.finish(axes, own)


@style.styled()
def profiles(found, *names, points=9, figure=None):
    """Draw the profiles of parameters: how much worse the fit gets where one of them is held.

    Parameters
    ----------
    found : Fit
        Of `gearlib.fit`.
    *names : str
        Of parameters; by default all.
    points : int, default 9
        Values of each, up to three standard errors away, of one that is not identifiable over its
        range.
    figure : matplotlib.figure.Figure, optional

    Returns
    -------
    matplotlib.figure.Figure
        With an axes for each parameter; the line at 3.84 is that of 95 %.

    Raises
    ------
    ValueError
        If it is no fit, or has no such parameter.
    """
    _check("profiles", found)
    points = checks.integer("points", points, 3, 1000)
    for name in names:
        checks.one_of("names", name, tuple(found.params))
    rows = [found.params[name] for name in names or found.params]
    if figure is None:
        from matplotlib import pyplot

        size = (2.4 * len(rows), 2.2)
        figure = pyplot.figure(figsize=size, layout="constrained")
    for axes, one in zip(np.ravel(figure.subplots(1, len(rows), sharey=True)), rows, strict=True):
        reach = 3.0 * one.stderr if one.identifiable else math.inf
        low, high = max(one.min, one.value - reach), min(one.max, one.value + reach)
        values = np.linspace(low, high, points)
        axes.plot(values, found.profile(one.name, values), ".-", color=_FITTED)
        axes.axhline(_LEVEL, color="black", ls=style.DASHED, lw=0.6)
        if one.identifiable:
            axes.axvline(one.value, color=_MEASURED, lw=0.6)
        units = found.model.derivatives[one.name][0]
        axes.set_xlabel(one.name.replace("_", " ") + ("" if units == "1" else f" ({units})"))
        axes.set_ylim(-0.3, 12.0)
    figure.axes[0].set_ylabel("rise of $-2\\,\\ln L$")
    return figure


def _check(call, found):
    if not {"waterfall", "profile"} <= set(dir(found)):
        raise ValueError(f"found is not allowed: gearlib.plot.{call} draws a fit of gearlib.fit")

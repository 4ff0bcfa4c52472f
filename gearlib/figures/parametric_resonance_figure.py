"""Parametric resonance: stability of the motion without loss of contact, after Ince and Strutt."""

import numpy as np
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from gearlib.data.numbers_given import stretches
from gearlib.figures import style

_Y_LABELS = {
    "stiffness_ratio": "stiffness ratio $\\kappa$",
    "contact_ratio": "contact ratio $\\epsilon$",
    "damping": "damping ratio $\\beta$",
}
_COLOURS = ("#000000", "#0072B2", "#009E73", "#D55E00", "#CC79A7")


@style.styled()
def draw(chart, facts):
    """Draw growth and tongues over the tuning and each of the other parameters.

    `chart` is that of `gearlib.studies.tongue_chart.compute`, `facts` that of
    `gearlib.studies.contact_loss.compute`, whose dampings go into the plane of damping. Shade:
    growth per mesh period at the first damping. Lines: edges of the tongues, one colour for
    each damping. Circles: points of width zero. Dashed: the pair itself.
    """
    figure = style.page(6.6)
    grid = figure.add_gridspec(2, 2, height_ratios=[1.25, 1.0])
    places = {"stiffness_ratio": grid[0, 0], "contact_ratio": grid[0, 1], "damping": grid[1, :]}
    largest = float(chart.growth.max()) or 1.0
    panels = []
    for plane, place in places.items():
        axes = figure.add_subplot(place)
        one = chart.sel(plane=plane)
        shade = axes.pcolormesh(
            chart.tuning.values,
            one.value.values,
            np.ma.masked_less_equal(one.growth.values, 0.0),
            cmap="YlOrBr",
            vmin=0.0,
            vmax=largest,
            shading="nearest",
            rasterized=True,
        )
        _draw_edges(axes, one)
        # Tongues lie at 2 / n: on a logarithmic scale their widths compare.
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlim(chart.tuning.values[0], chart.tuning.values[-1])
        axes.set_ylim(one.value.values[0], one.value.values[-1])
        axes.set_xlabel(style.TUNING)
        axes.set_ylabel(_Y_LABELS[plane])
        panels.append(axes)
    _draw_points(panels, chart)
    for axes, plane in zip(panels[:2], ("stiffness_ratio", "contact_ratio"), strict=True):
        value = float(chart.own_value.sel(plane=plane))
        axes.axhline(value, color="black", linewidth=0.7, linestyle=(0, (4, 3)))
        axes.plot([float(facts.asked)], [value], "k+", markersize=7)
    _draw_dampings(panels[2], chart, facts)
    figure.colorbar(shade, ax=panels, label="growth per mesh period, ln |multiplier|", aspect=40)
    handles = [
        style.entry(f"edges, $\\beta$ = {float(damping):.3g}", colour)
        for damping, colour in zip(chart.damping.values, _colours(chart), strict=True)
    ]
    handles += [
        style.entry("the pair", line=(0, (4, 3)), linewidth=0.7),
        style.entry("width zero", line="none", marker="o", markerfacecolor="white", markersize=3.5),
    ]
    style.legend(figure, handles, 6, "upper")
    return figure


def _colours(chart):
    return [_COLOURS[i % len(_COLOURS)] for i in range(chart.sizes["damping"])]


def _draw_edges(axes, one):
    """Draw the outlines of the tongues of one plane."""
    value = one.value.values
    for i, colour in enumerate(_colours(one)):
        for order in one.order.values:
            tongue = one.isel(damping=i).sel(order=order)
            low, high = tongue.tuning_from.values, tongue.tuning_to.values
            for first, last in stretches(np.isfinite(low)):
                run = slice(first, last + 1)
                # Up one edge and down the other; open where the picture cuts the tongue.
                x = np.concatenate([low[run], high[run][::-1]])
                y = np.concatenate([value[run], value[run][::-1]])
                if run.start > 0:
                    x, y = np.append(x, x[0]), np.append(y, y[0])
                if run.stop == value.size:
                    top = run.stop - run.start
                    x, y = np.insert(x, top, np.nan), np.insert(y, top, np.nan)
                axes.plot(x, y, color=colour, linewidth=0.8)


def _draw_points(panels, chart):
    """Draw the points where an undamped tongue has width zero."""
    for axes, plane in zip(panels[:2], ("stiffness_ratio", "contact_ratio"), strict=True):
        here = chart.point_plane.values == plane
        x, y = chart.point_tuning.values[here], chart.point_value.values[here]
        style.dots(axes, x, y, "o", "black", 3.5, markerfacecolor="white")


def _draw_dampings(axes, chart, facts):
    """Name the tongues in the plane of damping, and mark the dampings of the pair."""
    plane = chart.sel(plane="damping")
    for order in chart.order.values:
        closing = float(chart.closing_damping.sel(order=order))
        tongue = plane.isel(damping=0, row=0).sel(order=order)
        centre = 0.5 * float(tongue.tuning_from + tongue.tuning_to)
        if np.isfinite(closing) and np.isfinite(centre):
            words = f"order {order}\n$\\beta$ < {closing:.2g}"
            style.note(axes, words, (centre, closing), (0, 3), "center bottom")
    top = axes.get_ylim()[1]
    for ratio in np.unique(np.round(facts.damping_ratio.values, 12)):
        if 0.0 < ratio < top:
            axes.axhline(ratio, color="black", linewidth=0.7, linestyle=(0, (4, 3)))
            names = [
                style.damping_label(str(name))
                for name in facts.damping.values
                if abs(float(facts.damping_ratio.sel(damping=name)) - ratio) < 1e-9
            ]
            at, of = (0.01, ratio), ("axes fraction", "data")
            style.note(axes, ", ".join(names), at, (0, 2), "left baseline", of)
    axes.plot([float(facts.asked)], [0.0], "k+", markersize=7, clip_on=False)

"""Parametric resonance: stability of the motion without loss of contact, after Ince and Strutt."""

import numpy as np

from gearlib.data.motions import stretches
from gearlib.figures import panels, style

_Y_LABELS = {
    "stiffness_ratio": "stiffness ratio $\\kappa$",
    "contact_ratio": "contact ratio $\\epsilon$",
    "damping": "damping ratio $\\beta$",
}
_COLOURS = ("#000000", "#0072B2", "#009E73", "#D55E00", "#CC79A7")
_PAIR_LINE = {"line": (0, (4, 3)), "linewidth": 0.7}


@style.styled()
def draw(chart, facts):
    """Draw growth and tongues over the tuning and each of the other parameters.

    `chart` is that of `gearlib.studies.stability.chart`, `facts` that of
    `gearlib.studies.stability.contact_loss`, whose dampings go into the plane of damping. Shade:
    growth per mesh period at the first damping. Lines: edges of the tongues, one colour for
    each damping. Circles: points of width zero. Dashed: the pair itself.
    """
    figure = style.page(6.6)
    places = [["stiffness_ratio", "contact_ratio"], ["damping", "damping"]]
    grid = figure.subplot_mosaic(places, height_ratios=[1.25, 1.0])
    colours = dict(
        zip(chart.damping.values, np.resize(_COLOURS, chart.sizes["damping"]), strict=True)
    )
    for name, axes in grid.items():
        plane = chart.sel(plane=name)
        shade = _draw_growth(axes, plane, float(chart.growth.max()) or 1.0)
        for damping, colour in colours.items():
            _draw_edges(axes, plane.sel(damping=damping), colour)
        at_plane = chart.point_plane.values == name
        points = chart.point_tuning.values[at_plane], chart.point_value.values[at_plane]
        style.dots(axes, *points, "o", "black", 3.5, markerfacecolor="white")
        own = 0.0 if name == "damping" else float(plane.own_value)
        axes.plot([float(facts.asked)], [own], "k+", markersize=7, clip_on=False)
        if name != "damping":
            axes.axhline(own, color="black", linewidth=0.7, linestyle=_PAIR_LINE["line"])
        axes.set(xlabel=panels.axis_label(chart.tuning), ylabel=_Y_LABELS[name])
    _draw_dampings(grid["damping"], chart, facts)
    label = panels.axis_label(chart.growth)
    figure.colorbar(shade, ax=list(grid.values()), label=label, aspect=40)
    handles = [style.entry(f"edges, $\\beta$ = {b:.3g}", colour) for b, colour in colours.items()]
    circle = {"marker": "o", "markerfacecolor": "white", "markersize": 3.5}
    handles += [
        style.entry("the pair", **_PAIR_LINE),
        style.entry("width zero", line="none", **circle),
    ]
    style.legend(figure, handles, 6, "upper")
    return figure


def _draw_growth(axes, plane, largest):
    """Draw the growth in one plane over the tuning on a logarithm, where widths compare."""
    growth = plane.growth.where(plane.growth > 0.0)
    look = {"cmap": "YlOrBr", "vmin": 0.0, "vmax": largest, "shading": "nearest"}
    shade = axes.pcolormesh(plane.tuning, plane.value, growth, rasterized=True, **look)
    axes.set_xscale("log")
    panels.plain_ticks(axes.xaxis)
    axes.set_xlim(plane.tuning[0], plane.tuning[-1])
    axes.set_ylim(plane.value[0], plane.value[-1])
    return shade


def _draw_edges(axes, plane, colour):
    """Draw the outlines of the tongues of one plane and damping."""
    value = plane.value.values
    for order in plane.order.values:
        tongue = plane.sel(order=order)
        low, high = tongue.tuning_from.values, tongue.tuning_to.values
        for first, last in stretches(np.isfinite(low)):
            rows = slice(first, last + 1)
            # Up one edge and down the other; open where the picture cuts the tongue.
            gap = [np.nan] if rows.stop == value.size else []
            x = np.concatenate([low[rows], gap, high[rows][::-1], low[[first]]])
            y = np.concatenate([value[rows], gap, value[rows][::-1], value[[first]]])
            end = x.size if first > 0 else -1
            axes.plot(x[:end], y[:end], color=colour, linewidth=0.8)


def _draw_dampings(axes, chart, facts):
    """Name the tongues in the plane of damping, and mark the dampings of the pair."""
    tips = chart.sel(plane="damping").isel(damping=0, row=0)
    centres = 0.5 * (tips.tuning_from + tips.tuning_to)
    for order, centre, closing in zip(
        chart.order.values, centres.values, chart.closing_damping.values, strict=True
    ):
        if np.isfinite(closing) and np.isfinite(centre):
            words = f"order {order}\n$\\beta$ < {closing:.2g}"
            style.note(axes, words, (centre, closing), (0, 3), "center bottom")
    for ratio, dampings in facts.damping_ratio.round(12).groupby(facts.damping_ratio.round(12)):
        if 0.0 < ratio < axes.get_ylim()[1]:
            axes.axhline(ratio, color="black", linewidth=0.7, linestyle=_PAIR_LINE["line"])
            names = ", ".join(style.damping_label(name) for name in dampings.damping.values)
            place = {"side": "left baseline", "of": ("axes fraction", "data")}
            style.note(axes, names, (0.01, ratio), (0, 2), **place)

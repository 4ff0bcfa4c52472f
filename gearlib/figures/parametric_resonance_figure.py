"""Parametric resonance: stability of the motion without loss of contact, after Ince and Strutt."""

import numpy as np
import xarray as xr

from gearlib.figures import panels, style

_Y_LABELS = {
    "stiffness_ratio": "stiffness ratio $\\kappa$",
    "contact_ratio": "contact ratio $\\epsilon$",
    "damping": "damping ratio $\\beta$",
}
_COLOURS = ("#000000", "#0072B2", "#009E73", "#D55E00", "#CC79A7")
_PAIR_LINE = {"color": "black", "linewidth": 0.7, "linestyle": (0, (4, 3)), "label": "the pair"}


@style.styled()
def draw(chart: xr.Dataset, facts: xr.Dataset):
    """Return a stability chart: growth and tongues over the tuning and each other parameter.

    `chart` is that of `gearlib.studies.stability.chart`, `facts` that of its `contact_loss`, with
    the dampings of the gear pair. Shades are growth per mesh period at the first damping, lines the
    edges of tongues, circles points of width zero; the gear pair itself is dashed.
    """
    figure = style.page(6.6)
    mosaic = [["stiffness_ratio", "contact_ratio"], ["damping", "damping"]]
    grid = figure.subplot_mosaic(mosaic, height_ratios=[1.25, 1.0])
    for name, axes in grid.items():
        plane = chart.sel(plane=name)
        shade = _draw_tongues(axes, plane, float(chart.growth.max()) or 1.0)
        points = chart.isel(point=chart.point_plane.values == name)
        options = {"markerfacecolor": "white", "label": "width zero"}
        style.dots(axes, points.point_tuning, points.point_value, "o", "black", 3.5, **options)
        value = 0.0 if name == "damping" else float(plane.own_value)
        axes.plot([float(facts.asked)], [value], "k+", markersize=7, clip_on=False)
        if name == "damping":
            _draw_dampings(axes, plane, facts)
        else:
            axes.axhline(value, **_PAIR_LINE)
        axes.set(xlabel=panels.axis_label(chart.tuning), ylabel=_Y_LABELS[name])
    label = panels.axis_label(chart.growth)
    figure.colorbar(shade, ax=list(grid.values()), label=label, aspect=40)
    style.legend(figure, grid["stiffness_ratio"], 6, "upper")
    return figure


def _draw_tongues(axes, plane: xr.Dataset, largest: float):
    """Draw growth and edges of tongues of one plane of parameters; return the image of growth.

    The colour scale ends at the growth `largest`; the tuning has a logarithmic scale.
    """
    growth = plane.growth.where(plane.growth > 0.0)
    options = {"cmap": "YlOrBr", "vmin": 0.0, "vmax": largest, "shading": "nearest"}
    shade = axes.pcolormesh(plane.tuning, plane.value, growth, rasterized=True, **options)
    for damping, colour in zip(plane.damping, _COLOURS * plane.damping.size, strict=False):
        tongues = plane.sel(damping=damping).transpose("row", ...)
        options = {"color": colour, "linewidth": 0.8}
        axes.plot([], [], label=f"edges, $\\beta$ = {float(damping):.3g}", **options)
        axes.plot(tongues.tuning_from, plane.value, **options)
        axes.plot(tongues.tuning_to, plane.value, **options)
    axes.set(xscale="log", xlim=plane.tuning.values[[0, -1]], ylim=plane.value.values[[0, -1]])
    panels.plain_ticks(axes.xaxis)
    return shade


def _draw_dampings(axes, plane: xr.Dataset, facts: xr.Dataset):
    """Name the tongues in the plane of damping, and draw the gear pair's dampings (`facts`)."""
    tips = plane.isel(damping=0, row=0)
    for order in plane.order.values:
        tip = tips.sel(order=order)
        centre = 0.5 * float(tip.tuning_from + tip.tuning_to)
        closing = float(tip.closing_damping)
        if np.isfinite(closing) and np.isfinite(centre):
            text = f"order {order}\n$\\beta$ < {closing:.2g}"
            style.note(axes, text, (centre, closing), (0, 3), "center bottom")
    ratios = facts.damping_ratio.round(12)
    for ratio, dampings in ratios.groupby(ratios):
        if 0.0 < ratio < axes.get_ylim()[1]:
            axes.axhline(ratio, **_PAIR_LINE)
            names = ", ".join(map(style.damping_label, dampings.damping.values))
            options = {"side": "left baseline", "of": ("axes fraction", "data")}
            style.note(axes, names, (0.01, ratio), (0, 2), **options)

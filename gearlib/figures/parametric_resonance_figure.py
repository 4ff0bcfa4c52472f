"""Parametric resonance: Ince-Strutt diagrams of the motion without loss of contact."""

from itertools import chain

import numpy as np
import xarray as xr

from gearlib.colours import distinct_colours
from gearlib.figures import panels, style

_Y_LABELS = {
    "stiffness_ratio": "stiffness ratio $\\kappa$",
    "contact_ratio": "contact ratio $\\epsilon$",
    "damping": "damping ratio $\\beta$",
}
_COLOURS = ("#000000", "#0072B2", "#009E73", "#D55E00", "#CC79A7")
_PAIR_LINE = {"color": "black", "linewidth": 0.7, "linestyle": (0, (4, 3)), "label": "the pair"}


@style.rc_context()
def draw(chart: xr.Dataset, contact_loss: xr.Dataset):
    """Return a stability chart: growth and instability tongues in three parameter planes.

    A tongue is a region in which the motion without loss of contact is unstable. The planes have
    the tuning (mesh frequency over natural frequency) and the stiffness ratio, contact ratio or
    damping as axes. Shades show the growth per mesh period at the first damping, lines the edges of
    tongues, circles points at which a tongue has zero width. Dashed lines show the values of the
    gear pair. A cross marks the requested tuning (`asked`), at the value of the pair or at zero
    damping. `chart` and `contact_loss` are results of `gearlib.studies.stability`.
    """
    figure = style.page_figure(height=6.6)
    mosaic = [["stiffness_ratio", "contact_ratio"], ["damping", "damping"]]
    grid = figure.subplot_mosaic(mosaic, height_ratios=[1.25, 1.0])
    for plane_name, axes in grid.items():
        plane = chart.sel(plane=plane_name)
        image = _draw_tongues(axes, plane, float(chart.growth.max()) or 1.0)
        points = chart.isel(point=chart.point_plane.values == plane_name)
        options = {"markerfacecolor": "white", "label": "width zero"}
        style.draw_markers(
            axes, points.point_tuning, points.point_value, "o", "black", 3.5, **options
        )
        # In the damping plane, the cross is at zero damping.
        pair_value = 0.0 if plane_name == "damping" else float(plane.own_value)
        requested_tuning = float(contact_loss.asked)
        axes.plot([requested_tuning], [pair_value], "k+", markersize=7, clip_on=False)
        if plane_name == "damping":
            _label_tongues(axes, plane)
            _draw_damping_ratios(axes, contact_loss.damping_ratio.round(12))
        else:
            axes.axhline(pair_value, **_PAIR_LINE)
        axes.set(xlabel=panels.axis_label(chart.tuning), ylabel=_Y_LABELS[plane_name])
    label = panels.axis_label(chart.growth)
    figure.colorbar(image, ax=list(grid.values()), label=label, aspect=40)
    style.add_legend(figure, grid["stiffness_ratio"], columns=6, side="upper")
    return figure


def _draw_tongues(axes, plane: xr.Dataset, max_growth: float):
    """Draw growth and edges of instability tongues in one parameter plane; return the growth image.

    A tongue is a region in which the motion without loss of contact is unstable. The axes are the
    tuning (mesh frequency over natural frequency), on a logarithmic scale, and a parameter such as
    the stiffness ratio (dimension "row" of `plane`). The colour scale ends at `max_growth`.
    """
    growth = plane.growth.where(plane.growth > 0.0)
    options = {"cmap": "YlOrBr", "vmin": 0.0, "vmax": max_growth, "shading": "nearest"}
    image = axes.pcolormesh(plane.tuning, plane.value, growth, rasterized=True, **options)
    colours = chain(_COLOURS, distinct_colours(_COLOURS))
    texts = style.format_numbers(plane.damping.values, digits=3)
    for damping, text, colour in zip(plane.damping, texts, colours, strict=False):
        tongues = plane.sel(damping=damping).transpose("row", ...)
        options = {"color": colour, "linewidth": 0.8}
        axes.plot([], [], label=f"edges, $\\beta$ = {text}", **options)
        axes.plot(tongues.tuning_from, plane.value, **options)
        axes.plot(tongues.tuning_to, plane.value, **options)
    axes.set(xscale="log", xlim=plane.tuning.values[[0, -1]], ylim=plane.value.values[[0, -1]])
    panels.set_plain_ticks(axes.xaxis)
    return image


def _label_tongues(axes, plane: xr.Dataset):
    """Write the order and the closing damping ratio of each instability tongue at its tip.

    A tongue is a region in which the motion without loss of contact is unstable; it vanishes at the
    closing damping ratio. `plane` is the plane of tuning (mesh frequency over natural frequency)
    and damping.
    """
    for order in plane.order.values:
        # Tongues are widest in row 0, at zero damping. This plane has only one damping.
        tongue = plane.isel(damping=0, row=0).sel(order=order)
        centre = 0.5 * float(tongue.tuning_from + tongue.tuning_to)
        closing_damping = float(tongue.closing_damping)
        if np.isfinite(closing_damping) and np.isfinite(centre):
            text = f"order {order}\n$\\beta$ < {closing_damping:.2g}"
            style.annotate(axes, text, (centre, closing_damping), (0, 3), "center bottom")


def _draw_damping_ratios(axes, ratios: xr.DataArray):
    """Draw a horizontal line at each damping ratio, labelled with the names of the dampings.

    `ratios` are the damping ratios of the gear pair over the dimension "damping"; several dampings
    may have the same ratio. No line is drawn at zero or outside the axes.
    """
    for ratio, dampings in ratios.groupby(ratios):
        if 0.0 < ratio < axes.get_ylim()[1]:
            axes.axhline(ratio, **_PAIR_LINE)
            names = ", ".join(map(style.typeset_dampings, dampings.damping.values))
            options = {"anchor": "left baseline", "coords": ("axes fraction", "data")}
            style.annotate(axes, names, (0.01, ratio), (0, 2), **options)

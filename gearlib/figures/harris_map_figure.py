"""Harris maps: static transmission error over the mesh phase at several loads."""

import math

import numpy as np
from matplotlib import colormaps

from gearlib.figures import style

_TITLES = {
    "none": "no relief",
    "short": "short relief",
    "long": "long relief",
}
_LINES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))
_MARKERS = ("s", "x", "o")
ERROR = "transmission error, µm"


@style.styled()
def draw(data):
    """Draw the error at all loads for each relief, and below its range and the contact ratio.

    `data` is that of `gearlib.studies.tip_relief.harris_map`. Thick: the design load.
    """
    figure = style.page(5.0)
    rows = figure.subfigures(2, 1, height_ratios=(1.2, 1.0))
    maps = rows[0].subplots(1, data.sizes["relief"], sharey=True)
    loads = data.torque.values / float(data.design_torque)
    for axes, name in zip(np.atleast_1d(maps), data.relief.values, strict=True):
        draw_courses(axes, data.sel(relief=name), loads)
        axes.set_title(_words(data, name))
    maps[0].set_ylabel(ERROR)
    spread, contact = rows[1].subplots(1, 2)
    for i, name in enumerate(data.relief.values):
        shown = data.sel(relief=name)
        look = {
            "color": style.PALETTE[i],
            "linestyle": _LINES[i % len(_LINES)],
            "marker": _MARKERS[i % len(_MARKERS)],
            "markersize": 3.0,
            "label": _TITLES[name],
        }
        spread.plot(loads, 1e6 * shown.peak_to_peak_error.values, **look)
        loaded = loads > 0.0
        contact.plot(loads[loaded], shown.effective_contact_ratio.values[loaded], **look)
    spread.set_ylabel("peak to peak, µm")
    contact.set_ylabel("effective contact ratio")
    contact.set_xlim(spread.get_xlim())
    for axes in (spread, contact):
        axes.axvline(1.0, color="black", linewidth=0.5, linestyle=(0, (1, 2)))
        axes.set_xlabel("torque over design torque")
    spread.legend()
    return figure


def draw_courses(axes, data, loads, design=1.0):
    """Draw the error over two mesh periods at loads, those of `data`; thick: the design load."""
    turns = data.phase.values / (2.0 * math.pi)
    for load, course in zip(loads, 1e6 * data.transmission_error.values, strict=True):
        # A course begins in the middle of double contact; twice, so that both ends are seen.
        axes.plot(
            np.concatenate([turns, turns + turns[-1] + turns[1]]),
            np.tile(course, 2),
            color=colormaps["viridis"](0.92 * load / max(loads.max(), 1e-9)),
            linewidth=2.0 if math.isclose(load, design) else 0.9,
        )
        at, of = (1.0, course[0]), ("axes fraction", "data")
        style.note(axes, f"{load:g}", at, (2, 0), of=of, fontsize=5.5)
    axes.set_xlabel("mesh periods")
    axes.set_xlim(0.0, 2.0)


def _words(data, name):
    amounts = 1e6 * data.relief_amount.sel(relief=name).values
    if not amounts.any():
        return _TITLES[name]
    return f"{_TITLES[name]}, {amounts[0]:.1f} and {amounts[1]:.1f} µm"

"""Campbell diagram: natural frequencies, orders of the mesh frequencies, speeds of lost contact."""

import numpy as np

from gearlib.data.motions import lost_share
from gearlib.figures import schematic, style

_COLOURS = {"rotational": "#D55E00", "translational": "#56B4E9", "satellite": "#CC79A7"}
_OTHER = "0.5"
_LOST = "#F0E442"
#: Whether the meshes excite an intersection -> words, face and size of its mark.
_EXCITED = {True: ("excited", "black", 3.5), False: ("not excited", "white", 2.5)}


@style.styled()
def draw(diagram):
    """Draw frequencies over the speed of the reference pinion: `gearlib.studies.trains.campbell`.

    Dots: intersections that the meshes excite, circles: those that they do not. Behind the line
    of a mesh frequency: the speeds at which a mesh of it parts in a sweep.
    """
    data = diagram
    figure = style.page(4.2)
    # No mesh has a curve of its own.
    axes = schematic.with_train(figure, data, {}).add_subplot()
    speed = data.speed.values
    rate = draw_orders(axes, data, speed[-1])
    _mark_lost(axes, data, rate)
    axes.axvline(speed[0], color="0.6", linestyle=":", linewidth=0.8, zorder=0.4)
    style.add_scale(axes, speed, data.tuning.values, style.OWN_TUNING)
    handles = entries(data)
    handles.append(style.entry("sweeps begin", "0.6", ":", linewidth=0.8))
    handles.append(style.entry("contact lost in a sweep", _LOST, linewidth=5))
    style.legend(figure, handles, 4, fontsize=6.5)
    return figure


def draw_orders(axes, data, stop):
    """Draw modes, mesh frequencies and their intersections up to a speed, in rpm.

    `data` is that of `GearTrain.campbell`; lines of orders that are those of a mesh, where it has
    `mesh_rate`, are solid. Return the frequency of the reference mesh in kHz over its speed.
    """
    rate = 1e-3 * float(data.natural_frequency[0] / data.critical_speed[0, 0])
    rate /= float(data.stiffness_order[0])
    frequency = 1e-3 * data.natural_frequency.values
    kinds = [str(kind) for kind in data.mode_kind.values]
    top = 1.05 * frequency.max()
    for value, kind in zip(frequency, kinds, strict=True):
        axes.axhline(value, color=_COLOURS.get(kind, _OTHER), linewidth=0.7, zorder=1)
    for order in data.stiffness_order.values:
        end = min(stop, top / (rate * order))
        dashes = "-" if order in data.get("mesh_rate", data.stiffness_order).values else "--"
        axes.plot([0.0, end], [0.0, rate * order * end], dashes, color="0.3", linewidth=0.8)
        at = 0.97 * end, rate * order * 0.97 * end
        look = {"boxstyle": "round,pad=0.15", "facecolor": "white", "linewidth": 0}
        axes.text(*at, f"{order:.3g}", fontsize=6.5, ha="center", va="center", bbox=look)
    for excited, (_, face, size) in _EXCITED.items():
        shown, look = data.excites.values == excited, {"markeredgewidth": 0.5, "zorder": 3}
        x, y = data.critical_speed.values[shown], np.broadcast_to(frequency, shown.shape)[shown]
        style.dots(axes, x, y, "o", "black", size, markerfacecolor=face, **look)
    axes.set_xlim(0.0, stop)
    axes.set_ylim(0.0, top)
    axes.set_xlabel("speed of the reference pinion (rpm)")
    axes.set_ylabel("frequency (kHz)")
    return rate


def _mark_lost(axes, data, rate):
    """Mark, along the mesh frequencies, the speeds at which a mesh parts from all starts."""
    speed = data.speed.values
    lost = (lost_share(data.fraction_normal_high.values) > 0.0).any(axis=0)
    half = (speed[1] - speed[0]) / 2.0
    for own in np.unique(data.mesh_rate.values):
        there = lost[:, data.mesh_rate.values == own].any(axis=1)
        for at in speed[there]:
            ends = np.array([at - half, at + half])
            axes.plot(ends, rate * own * ends, color=_LOST, linewidth=5, zorder=0.5)


def entries(data):
    """Return what a legend says of `draw_orders`."""
    kinds = [str(kind) for kind in data.mode_kind.values]
    return [
        *(style.entry(f"{kind} mode", _COLOURS.get(kind, _OTHER)) for kind in dict.fromkeys(kinds)),
        style.entry("mesh frequency", "0.3", linewidth=0.8),
        style.entry("its multiple", "0.3", "--", linewidth=0.8),
        *(
            style.entry(words, line="none", marker="o", markerfacecolor=face, markersize=size)
            for words, face, size in _EXCITED.values()
        ),
    ]

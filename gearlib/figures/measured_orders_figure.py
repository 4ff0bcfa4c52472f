"""Mesh orders of measured run-ups over the speed, beside those of the model."""

import numpy as np

from gearlib.figures import style

_HEIGHT = 2.4


@style.styled()
def draw(orders, *, colours=None):
    """Draw datasets of `gearlib.studies.measured_comparison.orders`.

    orders: one or several; colours: those of the dampings by name. A row for each observable, a
    column for each order; levels in dB of the largest measured one, so that an unknown gain moves
    nothing.
    """
    rows = [
        (one.attrs["title"], one.isel(track=i, observable=j))
        for one in orders
        for i in range(one.sizes["track"])
        for j in range(one.sizes["observable"])
    ]
    count = orders[0].sizes["order"]
    figure = style.page(_HEIGHT * max(1, len(rows)) + 0.5)
    axes = figure.subplots(max(1, len(rows)), count, squeeze=False, sharex="row", sharey="row")
    looks = style.looks([str(name) for name in orders[0].damping.values], colours)
    for (title, one), line in zip(rows, axes, strict=False):
        most = float(one.amplitude.max())
        for k, panel in enumerate(line):
            speed = one.speed.values
            level = _level(one.amplitude.values[k], most)
            style.dots(panel, speed, level, ".", "#8C8C8C", 2.5, zorder=1)
            for name, look in looks.items():
                model = one.computed_amplitude.sel(damping=name)
                own = _level(model.values[k], float(model.max()))
                panel.plot(speed, own, color=look.colour, linestyle=look.line, linewidth=0.9)
            panel.set_title(f"order {'' if k == 0 else k + 1}z", fontsize=8)
            panel.set_xlabel("speed (rpm)")
        line[0].set_ylabel(f"{title}\n{str(one.observable.values).replace('_', ' ')} (dB)")
    handles = [style.entry(style.damping_label(n), k.colour, k.line) for n, k in looks.items()]
    style.legend(figure, [style.entry("measured", "#8C8C8C", "", "."), *handles], 5)
    return figure


def _level(values, most):
    """Return levels in dB of the largest one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 20.0 * np.log10(values / most)

"""Stability chart of a planetary train: exact tongues, and where those of first order differ."""

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from gearlib.figures import style

_LABELS = {
    "stiffness_jump": "stiffness jump over mean",
    "contact_ratio": "contact ratio $\\epsilon$ of all meshes",
}
#: What a point is -> its colour.
_POINTS = {
    "stable": "#FFFFFF",
    "unstable, in a tongue of first order": "#B4B4B4",
    "unstable, in none of first order": "#D55E00",
    "stable, in a tongue of first order": "#56B4E9",
}
#: Of `_POINTS` those that the first order has wrong: place, share, words.
_WRONG = ((2, "missed_share", "missed"), (3, "false_share", "not there"))
_LINES = ("-", (0, (4, 2)))


@style.styled()
def draw(chart):
    """Draw a panel for each plane and phasing, and the shares that the first order has wrong.

    `chart` is that of `gearlib.studies.trains.train_stability.compute`.
    """
    planes, phasings = chart.plane.values, range(chart.sizes["phasing"])
    figure = style.page(7.4)
    axes = figure.subplots(3, len(planes), height_ratios=[1.0, 1.0, 0.85], squeeze=False)
    frequency = chart.tuning.values * float(chart.reference_frequency) / 1e3
    # Growth of rounding is none.
    unstable = chart.growth.values > 1e-6
    named = chart.first_order_unstable.values.astype(bool)
    kind = np.where(unstable, np.where(named, 1, 2), np.where(named, 3, 0))
    for i in phasings:
        for j, plane in enumerate(planes):
            panel = axes[i, j]
            panel.pcolormesh(
                frequency,
                chart.value.values[j],
                kind[i, j],
                cmap=ListedColormap(list(_POINTS.values())),
                vmin=-0.5,
                vmax=len(_POINTS) - 0.5,
                shading="nearest",
                rasterized=True,
            )
            panel.set_title(_name(chart, i))
            panel.set_xlabel("mesh frequency, kHz")
            panel.set_ylabel(_LABELS[str(plane)])
    for j, plane in enumerate(planes):
        panel = axes[-1, j]
        for i in phasings:
            for code, key, words in _WRONG:
                colour, label = list(_POINTS.values())[code], f"{words}, {_name(chart, i)}"
                x, share = chart.value.values[j], 100.0 * chart[key].values[i, j]
                panel.plot(x, share, color=colour, linestyle=_LINES[i], label=label)
        panel.set_xlabel(_LABELS[str(plane)])
        panel.set_ylabel("share of the tongues, %")
        panel.set_ylim(bottom=0.0)
    axes[-1, 0].legend(loc="upper left", fontsize=6.5)
    handles = [
        Patch(facecolor=colour, edgecolor="black", linewidth=0.4, label=words)
        for words, colour in _POINTS.items()
    ]
    style.legend(figure, handles, 2, "upper")
    return figure


def _name(chart, i):
    return f"$z_s$ = {int(chart.teeth_sun[i])}, $z_r$ = {int(chart.teeth_ring[i])}"

"""Dynamic force with tip relief over speed: stiffness at the load beside pairs of teeth."""

import math

import numpy as np

from gearlib.data.lost_contact import lost_share
from gearlib.figures import style

_MODELS = {
    "stiffness_at_load": ("stiffness and deviation at the load", style.PALETTE[1], 2.2),
    "pairs_of_teeth": ("pairs of teeth that touch one by one", style.PALETTE[0], 1.0),
}
_LINES = {"up": "-", "down": (0, (2, 1.2))}


@style.styled()
def draw(data):
    """Draw the largest dynamic force over tuning, a panel for each load.

    `data` is that of `gearlib.studies.tip_relief.dynamics`. Shaded: tunings at which one of
    both models loses contact.
    """
    count = data.sizes["load_ratio"]
    figure = style.page(3.0)
    panels = np.atleast_1d(figure.subplots(1, count, sharey=True))
    tuning = data.tuning.values
    for axes, load in zip(panels, data.load_ratio.values, strict=True):
        shown = data.sel(load_ratio=load)
        lost = (lost_share(shown.fraction_normal) > 0.0).any(["model", "direction"]).values
        grey = {"color": style.AREA_COLOURS["backlash"], "linewidth": 0, "step": "mid"}
        axes.fill_between(tuning, 0, 1, lost, transform=axes.get_xaxis_transform(), **grey)
        for model, (words, colour, width) in _MODELS.items():
            for direction, dashes in _LINES.items():
                force = shown.dynamic_force_max.sel(model=model, direction=direction).values
                look = {"color": colour, "linestyle": dashes, "linewidth": width}
                axes.plot(tuning, force, label=f"{words}, {direction}", **look)
        axes.set_title(_words(shown), fontsize=7)
        axes.set_xlabel(style.OWN_TUNING)
        axes.set_xlim(tuning[0], tuning[-1])
    panels[0].set_ylabel("largest dynamic force over load")
    style.legend(figure, panels[0], 2, fontsize=6.5)
    return figure


def _words(data):
    """Return load and differences in words."""
    lines = [f"load {float(data.load_ratio):g}: "]
    lines[0] += "suffices" if bool(data.suffices) else "does not suffice"
    for key, words in (("difference_in_contact", "in contact"), ("difference_with_loss", "loss")):
        value = float(data[key])
        if not math.isnan(value):
            lines.append(f"{words}: up to {100.0 * value:.1f} %")
    return "\n".join(lines)

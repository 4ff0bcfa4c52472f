"""Run-ups beside the sweeps and folds of Fig. 3, above the order map of the slowest."""

import numpy as np

from gearlib.figures import style
from gearlib.figures.order_map_figure import order_map

_HEIGHT, _MAP_HEIGHT = 3.4, 4.0
_LINES = {"up": "-", "down": (0, (1.5, 1.2))}
_SWEEP = "#BBBBBB"
#: Code of a fold in the labels of branches.
_FOLD = 1


@style.styled()
def draw(run_ups, *, resonance=None, branches=None):
    """Draw `gearlib.studies.run_ups.compute`.

    resonance: as gathered, its sweeps up and down stand behind; branches: those of the damping, as
    of `gearlib.studies.resonance_branches`, whose folds are marked.
    """
    figure = style.page(_HEIGHT + _MAP_HEIGHT)
    above, below = figure.subfigures(2, 1, height_ratios=[_HEIGHT, _MAP_HEIGHT])
    axes = above.subplots()
    handles = []
    if resonance is not None:
        _draw_sweeps(axes, resonance.sortby("tuning"), str(run_ups.damping.values))
        handles.append(style.entry("sweeps", _SWEEP, linewidth=2.5))
    for i, count in enumerate(run_ups.revolutions.values):
        colour = style.PALETTE[i % len(style.PALETTE)]
        for j, direction in enumerate(run_ups.direction.values):
            for name in ("displacement_max", "displacement_min"):
                x, y = (run_ups[one].values[i, j] for one in ("tuning", name))
                axes.plot(x, y, color=colour, linestyle=_LINES[str(direction)])
        handles.append(style.entry(f"{count} revolutions", colour))
    handles += [style.entry(f"speed goes {way}", "black", line) for way, line in _LINES.items()]
    if branches is not None:
        for tuning in np.unique(branches.tuning.values[branches.label.values == _FOLD]):
            axes.axvline(tuning, color="black", linewidth=0.6, linestyle=style.DASHED)
        handles.append(style.entry("fold", line=style.DASHED, linewidth=0.6))
    tunings = run_ups.tuning.values
    axes.set_xlim(np.nanmin(tunings), np.nanmax(tunings))
    axes.set_xlabel(style.TUNING)
    axes.set_ylabel("largest and smallest displacement\n(static deflections)")
    axes.legend(handles=handles, ncols=2)
    # Of what the study says in its attributes numbers alone may be left.
    known = {"variable": "dynamic_force", "amplitude": "rms"} | run_ups.attrs
    order_map(run_ups.rename(block="time").assign_attrs(known), figure=below)
    return figure


def _draw_sweeps(axes, resonance, damping):
    """Draw the sweeps that carry their state, of one damping."""
    if damping not in resonance.damping.values:
        return
    for direction in ("up", "down"):
        if direction in resonance.direction.values:
            one = resonance.sel(damping=damping, direction=direction)
            for name in ("displacement_max", "displacement_min"):
                axes.plot(one.tuning, one[name], color=_SWEEP, linewidth=2.5, zorder=1)

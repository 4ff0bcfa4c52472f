"""Run-ups compared with the sweeps and folds of Fig. 3, above the order map of the slowest."""

import numpy as np
import xarray as xr

from gearlib.figures import panels, style
from gearlib.figures.order_map_figure import order_map

_HEIGHT, _MAP_HEIGHT = 3.4, 4.0
_EXTREMA = ("displacement_max", "displacement_min")
_SWEEP_LINE = {"color": "#BBBBBB", "linewidth": 2.5, "zorder": 1}
_FOLD_LINE = {"line": style.DASHED, "linewidth": 0.6}
#: Code of folds in the variable `label` of branches.
_FOLD_CODE = 1


@style.styled()
def draw(run_ups: xr.Dataset, *, resonance=None, branches=None):
    """Return a figure of the displacement extrema of run-ups, above an order map of the slowest.

    `run_ups` is a result of `gearlib.studies.run_ups.run_ups_at_several_rates`. The sweeps up and
    down of `resonance` are drawn behind them, and the folds of `branches` are marked.
    """
    figure = style.page_figure(_HEIGHT + _MAP_HEIGHT)
    above, below = figure.subfigures(2, 1, height_ratios=[_HEIGHT, _MAP_HEIGHT])
    axes = above.subplots()
    for name in _EXTREMA:
        curve_options = {"colour": "revolutions", "line": "direction"}
        handles = panels.draw_curves(axes, run_ups, "tuning", name, **curve_options)
    if resonance is not None:
        _draw_sweeps(axes, resonance.sortby("tuning"), str(run_ups.damping.values))
        colour, width = _SWEEP_LINE["color"], _SWEEP_LINE["linewidth"]
        handles.append(style.legend_entry("sweeps", colour, linewidth=width))
    if branches is not None:
        for tuning in np.unique(branches.tuning.values[branches.label.values == _FOLD_CODE]):
            axes.axvline(tuning, color="black", linestyle=_FOLD_LINE["line"], linewidth=0.6)
        handles.append(style.legend_entry("fold", **_FOLD_LINE))
    axes.set_xlim(run_ups.tuning.min(), run_ups.tuning.max())
    axes.set_ylabel("largest and smallest displacement\n(static deflections)")
    axes.legend(handles=handles, ncols=2)
    # Gathered data may have lost these attributes.
    attributes = {"variable": "dynamic_force", "amplitude": "rms"} | run_ups.attrs
    order_map(run_ups.rename(block="time").assign_attrs(attributes), figure=below)
    return figure


def _draw_sweeps(axes, resonance: xr.Dataset, damping: str):
    """Draw the sweeps up and down of a damping, if there are any."""
    if damping in resonance.damping.values:
        sweeps = resonance.sel(damping=damping)
        sweeps = sweeps.sel(direction=[d for d in ("up", "down") if d in sweeps.direction])
        for name in _EXTREMA:
            options = {"line": "direction", "linestyle": "-"} | _SWEEP_LINE
            panels.draw_curves(axes, sweeps, "tuning", name, **options)

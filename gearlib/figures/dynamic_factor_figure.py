"""Dynamic factor and transmission error of pairs of teeth over the speed, running up and down."""

import xarray as xr

from gearlib.figures import panels, style
from gearlib.figures.plot_curves import WARM_STARTED_STYLES

_LABELS = {"up": "running up", "down": "running down"}
_ISO_COLOUR, _OPERATING_COLOUR = "#8C8C8C", "#D55E00"


@style.styled()
def draw(curves: xr.Dataset):
    """Return a figure of dynamic factor and transmission error over the speed of the pinion.

    `curves` is a result of `gearlib.studies.teeth_over_speed.over_speed`. Jumps are dotted lines
    with an arrow; the operating speed is a broken line.
    """
    figure = style.page_figure(height=4.6)
    above, below = figure.subplots(2, 1, sharex=True)
    speed = curves.speed.values
    curve_styles = style.curve_styles([str(name) for name in curves.direction.values])
    error = panels.in_unit(curves.error_peak_to_peak, 1e-6, "µm")
    handles = []
    for name, curve_style in curve_styles.items():
        line, _ = WARM_STARTED_STYLES[name]
        options = {"color": curve_style.colour, "linestyle": line}
        (handle,) = above.plot(
            speed, curves.dynamic_factor.sel(direction=name), label=_LABELS[name], **options
        )
        handles.append(handle)
        below.plot(speed, error.sel(direction=name), **options)
    if "iso_dynamic_factor" in curves:
        options = {"color": _ISO_COLOUR, "linestyle": ":", "label": "ISO 6336-1, method B"}
        handles += above.plot(speed, curves.iso_dynamic_factor, **options)
    if curves.operating_speed.notnull():
        options = {"color": _OPERATING_COLOUR, "linestyle": "--", "linewidth": 0.8}
        for axes in (above, below):
            line = axes.axvline(float(curves.operating_speed), label="operating speed", **options)
        handles.append(line)
    for name, curve_style in curve_styles.items():
        for jump in curves[f"jump_{name}_speed"].values:
            above.axvline(jump, color=curve_style.colour, linestyle=":", linewidth=0.8)
            text = f"{'↑' if name == 'up' else '↓'} {jump:.0f}"
            style.annotate(above, text, (jump, 0.93), (2, 0), coords=("data", "axes fraction"))
    above.set_ylim(bottom=0.0)
    below.set_ylim(bottom=0.0)
    above.set_xlim(style.limits(speed, margin=0.0))
    above.set_ylabel("dynamic factor $K_v$")
    below.set(xlabel=panels.axis_label(curves.speed), ylabel=panels.axis_label(error, width=30))
    style.legend(figure, handles, columns=4)
    return figure

"""Fig. 2: phase lag of the motion behind the stiffness, for several dampings."""

import xarray as xr

from gearlib.figures import panels, style


@style.rc_context()
def draw(lags: xr.Dataset):
    """Return a figure of phase lags of the motion behind the mesh stiffness.

    Bars show the lags of all harmonics at one tuning (mesh frequency over natural frequency); the
    panels on the left show stiffness and motion over a mesh period at this tuning. The lower panel
    shows the lag of the first harmonic over the tuning. `lags` is a result of
    `gearlib.studies.paper.compute_phase_lag`.
    """
    figure = style.page_figure(height=6.4)
    mosaic = [["stiffness", "bars"], ["motion", "bars"], ["tuning", "tuning"]]
    axes = figure.subplot_mosaic(mosaic, height_ratios=(1.0, 1.6, 1.8))
    styles = panels.plot_options(lags.damping)
    curve_options = {"colour_dim": "damping", "styles": styles}
    periods = panels.phase_to_mesh_periods(lags)
    step_options = {"color": "black", "drawstyle": "steps-post"}
    panels.draw_curves(axes["stiffness"], periods, "phase", "stiffness", **step_options)
    handles = panels.draw_curves(axes["motion"], periods, "phase", "displacement", **curve_options)
    axes["stiffness"].set(xlabel="", title=panels.value_label(lags.shown_tuning))
    for name in ("stiffness", "motion"):
        axes[name].set_xlim(0.0, 1.0)
    _draw_bars(axes["bars"], lags, [*styles.values()])
    # Lags are between -90 and 270 degrees. The curve is interrupted where the lag wraps around.
    wraps = abs(lags.first_lag.diff("tuning")).reindex_like(lags, fill_value=0.0) > 180.0
    lags_with_gaps = lags.assign(first_lag=lags.first_lag.where(~wraps))
    panels.draw_curves(axes["tuning"], lags_with_gaps, "tuning", "first_lag", **curve_options)
    axes["tuning"].axvline(lags.shown_tuning, color="black", linewidth=0.6, linestyle=":")
    style.add_legend(figure, handles, columns=4)
    return figure


def _draw_bars(axes, lags: xr.Dataset, styles: list[dict]):
    """Draw the phase lags of all harmonics as grouped bars, one bar per damping combination.

    `styles` contains the options of `Axes.plot` (e.g. the colour) for each damping combination.
    """
    width = 0.8 / len(styles)
    for i, (options, lag) in enumerate(zip(styles, lags.lag.values, strict=True)):
        bar_centres = lags.harmonic + (i - 0.5 * (len(styles) - 1)) * width
        axes.bar(bar_centres, lag, width, color=options["color"], edgecolor="white")
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set(xlabel=panels.axis_label(lags.harmonic), ylabel=panels.axis_label(lags.lag))
    axes.set_xticks(lags.harmonic.values)

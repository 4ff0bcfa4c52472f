"""Fig. 2: motion over stiffness for some dampings, lag of the harmonics, lag over the tuning."""

import xarray as xr

from gearlib.figures import panels, style


@style.styled()
def draw(lags: xr.Dataset):
    """Return a figure of the phase lags of `gearlib.studies.paper.phase_lag`, by harmonic."""
    figure = style.page(6.4)
    mosaic = [["stiffness", "bars"], ["motion", "bars"], ["tuning", "tuning"]]
    axes = figure.subplot_mosaic(mosaic, height_ratios=(1.0, 1.6, 1.8))
    styles = panels.curve_styles(lags.damping)
    curve_options = {"colour": "damping", "styles": styles}
    periods = panels.in_mesh_periods(lags)
    steps = {"color": "black", "drawstyle": "steps-post"}
    panels.draw_curves(axes["stiffness"], periods, "phase", "stiffness", **steps)
    entries = panels.draw_curves(axes["motion"], periods, "phase", "displacement", **curve_options)
    axes["stiffness"].set(xlabel="", title=panels.value_label(lags.shown_tuning))
    for name in ("stiffness", "motion"):
        axes[name].set_xlim(0.0, 1.0)
    _draw_bars(axes["bars"], lags, [*styles.values()])
    # Where the lag wraps from 270 to -90 degrees, the line has a gap.
    wraps = abs(lags.first_lag.diff("tuning")).reindex_like(lags, fill_value=0.0) > 180.0
    gaps = lags.assign(first_lag=lags.first_lag.where(~wraps))
    panels.draw_curves(axes["tuning"], gaps, "tuning", "first_lag", **curve_options)
    axes["tuning"].axvline(lags.shown_tuning, color="black", linewidth=0.6, linestyle=":")
    style.legend(figure, entries, 4)
    return figure


def _draw_bars(axes, lags: xr.Dataset, styles: list[dict]):
    """Draw the lags of all harmonics as bars, side by side for the dampings, in their styles."""
    width = 0.8 / len(styles)
    for i, (options, lag) in enumerate(zip(styles, lags.lag.values, strict=True)):
        middle = lags.harmonic + (i - 0.5 * (len(styles) - 1)) * width
        axes.bar(middle, lag, width, color=options["color"], edgecolor="white")
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set(xlabel=panels.axis_label(lags.harmonic), ylabel=panels.axis_label(lags.lag))
    axes.set_xticks(lags.harmonic.values)

"""Fig. 2: motion over stiffness for some dampings, lag of the harmonics, lag over the tuning."""

import numpy as np

from gearlib.figures import style

_HEIGHT = 6.4


@style.styled()
def draw(lags):
    """Draw the phase lag of `gearlib.studies.phase_lag.compute`."""
    figure = style.page(_HEIGHT)
    grid = figure.add_gridspec(3, 2, height_ratios=[1.0, 1.6, 1.8])
    stiffness = figure.add_subplot(grid[0, 0])
    course = figure.add_subplot(grid[1, 0], sharex=stiffness)
    bars = figure.add_subplot(grid[:2, 1])
    over = figure.add_subplot(grid[2, :])
    looks = style.looks([f"{k:g} N s/m" for k in lags.damping.values])
    periods = np.append(lags.phase.values, 2.0 * np.pi) / (2.0 * np.pi)

    def closed(values):
        return np.append(values, values[0])

    stiffness.plot(periods, closed(lags.stiffness.values), color="black", drawstyle="steps-post")
    stiffness.set_ylabel("$C/C_s$")
    stiffness.set_title(f"tuning $\\nu_s$ = {float(lags.shown_tuning):g}")
    stiffness.tick_params(labelbottom=False)
    width = 0.8 / len(looks)
    for i, (name, look) in enumerate(looks.items()):
        options = {"color": look.colour, "linestyle": look.line, "label": f"$k_1$ = {name}"}
        course.plot(periods, closed(lags.displacement.values[i]), **options)
        bars.bar(
            lags.harmonic.values + (i - 0.5 * (len(looks) - 1)) * width,
            lags.lag.values[i],
            width,
            color=look.colour,
            hatch=("", "//", "..", "xx")[i % 4],
            edgecolor="white",
        )
        # A lag that wraps from 270 to -90 degrees is no line across the picture.
        lag = lags.first_lag.values[i]
        jumps = np.abs(np.diff(lag, prepend=lag[0])) > 180.0
        over.plot(lags.tuning.values, np.where(jumps, np.nan, lag), **options)
    course.set_xlabel("mesh periods")
    course.set_ylabel(style.SHORT_DISPLACEMENT)
    course.set_xlim(0.0, 1.0)
    course.margins(y=0.25)
    course.legend(loc="upper right")
    bars.axhline(0.0, color="black", linewidth=0.6)
    bars.set_xlabel("harmonic of the mesh period")
    bars.set_ylabel("lag behind $C$ (degrees)")
    bars.set_xticks(lags.harmonic.values)
    over.axvline(float(lags.shown_tuning), color="black", linewidth=0.6, linestyle=":")
    over.set_xlabel(style.TUNING)
    over.set_ylabel("lag of the first harmonic (degrees)")
    return figure

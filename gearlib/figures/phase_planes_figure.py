"""Fig. 5: phase planes of the recorded revolution, a row per tuning, a column per damping."""

import textwrap

import numpy as np
import xarray as xr

from gearlib.data import motions
from gearlib.figures import panels, style

_CELL_HEIGHT, _HEADER_HEIGHT = 1.25, 0.7
#: Number of characters of the titles that fit beside each other.
_TITLE_CHARACTERS = 120
#: Repetitions of an orbit count as equal if they differ by less than this fraction of its width.
SAME_ORBIT_TOLERANCE = 5e-3


@style.styled()
def draw(phase_planes: xr.Dataset, *, colours: dict[str, str] | None = None):
    """Return a figure of phase planes, velocity over displacement, for each damping and tuning.

    Titles say whether the motion is periodic. `phase_planes` is a dataset over (damping, tuning,
    phase); `colours` maps dampings to colours.
    """
    tunings = phase_planes.tuning.values
    curve_styles = style.curve_styles([str(name) for name in phase_planes.damping.values], colours)
    figure = style.page_figure(_HEADER_HEIGHT + _CELL_HEIGHT * tunings.size)
    grid = figure.subplots(tunings.size, len(curve_styles), squeeze=False)
    width = min(30, _TITLE_CHARACTERS // max(1, len(curve_styles)))
    labels = panels.tuning_texts(tunings, phase_planes.get("speed"))
    for i, (row, tuning, label) in enumerate(zip(grid, tunings, labels, strict=True)):
        row[0].set_ylabel(f"$\\nu_s$ = {label}\n$dy/d\\tau$".replace(" (", "\n("))
        for axes, (name, curve_style) in zip(row, curve_styles.items(), strict=True):
            run = phase_planes.sel(tuning=tuning, damping=name)
            line_width = 0.8 if int(run.period) else 0.3
            draw_plane(axes, run, color=curve_style.colour, linewidth=line_width)
            axes.tick_params(labelsize=5.5)
            header = [style.typeset_dampings(name)] if i == 0 else []
            axes.set_title(
                "\n".join([*header, *textwrap.wrap(_steadiness(run), width)]), fontsize=6
            )
    for axes in grid[-1]:
        axes.set_xlabel(style.DISPLACEMENT_LABEL)
    return figure


def draw_plane(axes, run: xr.Dataset, **options):
    """Draw the phase plane of a run and shade its backlash; `options` are those of `Axes.plot`."""
    displacement, velocity = closed_orbit(run)
    axes.set(xlim=style.limits(displacement, 0.0), ylim=style.limits(velocity, 0.0))
    # With moving bearings the displacement of coast-side contact varies: shade all of y < 0.
    backlash = np.inf if "coast_line" in run else float(run.backlash_ratio)
    style.shade_lost_contact(axes, backlash, "x")
    axes.plot(displacement, velocity, **options)


def closed_orbit(run: xr.Dataset) -> np.ndarray:
    """Return displacement and velocity of a run, shape (2, samples), as a closed curve if periodic.

    The curve is the whole record if this has complete periods only, else its last period.
    """
    states = np.array([run.displacement.values, run.velocity.values])
    samples_per_mesh_period = round(2.0 * np.pi / np.diff(run.phase)[0])
    samples, period = states.shape[1], int(run.period) * samples_per_mesh_period
    if not 0 < period <= samples:
        return states
    # The record counts as periodic if no change from one period to the next is visible.
    changes = np.abs(states[0, period:] - states[0, :-period])[-period:]
    if changes.max(initial=0.0) > SAME_ORBIT_TOLERANCE * np.ptp(states[0]):
        return states
    start = samples - period if samples % period else 0
    return np.append(states[:, start:], states[:, start : start + 1], axis=1)


def _steadiness(run: xr.Dataset) -> str:
    """Return a description such as "steady, 1 mesh period" of a run, "no result" if it failed."""
    return motions.describe_steadiness(run) if np.isfinite(run.displacement).all() else "no result"

"""Fig. 5: phase planes of the recorded revolution, a row per tuning, a column per damping."""

import textwrap

import numpy as np
import xarray as xr

from gearlib.data import motions
from gearlib.figures import style

_CELL_HEIGHT, _HEAD = 1.25, 0.7
#: Repetitions of an orbit that differ by less than this share of its width look the same.
SAME_ORBIT_TOLERANCE = 5e-3


@style.styled()
def draw(phase_planes: xr.Dataset, *, colours: dict[str, str] | None = None):
    """Return a figure of phase planes, velocity over displacement, with their steadiness as titles.

    `phase_planes` is a dataset over (damping, tuning, phase); `colours` maps dampings to colours.
    """
    tunings = phase_planes.tuning.values
    looks = style.looks([str(name) for name in phase_planes.damping.values], colours)
    figure = style.page(_HEAD + _CELL_HEIGHT * tunings.size)
    grid = figure.subplots(tunings.size, len(looks), squeeze=False)
    for row, tuning in zip(grid, tunings, strict=True):
        row[0].set_ylabel(f"$\\nu_s$ = {tuning:.2f}\n$dy/d\\tau$")
        for axes, (name, look) in zip(row, looks.items(), strict=True):
            run = phase_planes.sel(tuning=tuning, damping=name)
            draw_plane(axes, run, color=look.colour, linewidth=0.8 if int(run.period) else 0.3)
            axes.tick_params(labelsize=5.5)
            head = [style.damping_label(name)] if axes in grid[0] else []
            axes.set_title("\n".join([*head, *textwrap.wrap(_steadiness(run), 30)]), fontsize=6)
    for axes in grid[-1]:
        axes.set_xlabel(style.SHORT_DISPLACEMENT)
    return figure


def draw_plane(axes, run: xr.Dataset, **options):
    """Draw the phase plane of a run and shade its backlash; `options` are those of `Axes.plot`."""
    displacement, velocity = closed_orbit(run)
    axes.set(xlim=style.limits(displacement, 0.0), ylim=style.limits(velocity, 0.0))
    # If bearings move, back-side contact has no fixed displacement: only y < 0 is shaded.
    backlash = np.inf if "backlash" in run else float(run.backlash_ratio)
    style.shade_areas(axes, backlash, "x")
    axes.plot(displacement, velocity, **options)


def closed_orbit(run: xr.Dataset) -> np.ndarray:
    """Return displacement and velocity of a run, shape (2, samples), as a closed curve if periodic.

    The curve has all complete orbits, or only the last one if the record ends within another.
    """
    orbit = np.array([run.displacement.values, run.velocity.values])
    # `size` is the number of samples of one period; 0 if the motion has not settled.
    samples, size = orbit.shape[1], int(run.period) * round(2.0 * np.pi / np.diff(run.phase)[0])
    if not 0 < size <= samples:
        return orbit
    # Below a visible change from one period to the next, the record counts as periodic.
    changes = np.abs(orbit[0, size:] - orbit[0, :-size])[-size:]
    if changes.max(initial=0.0) > SAME_ORBIT_TOLERANCE * np.ptp(orbit[0]):
        return orbit
    start = samples - size if samples % size else 0
    return np.append(orbit[:, start:], orbit[:, start : start + 1], axis=1)


def _steadiness(run: xr.Dataset) -> str:
    """Return a description such as "period 1" of a run, or "no result" if its run failed."""
    return motions.steadiness(run) if np.isfinite(run.displacement).all() else "no result"

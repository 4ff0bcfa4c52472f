"""Fig. 5: phase planes of the recorded revolution, a row per tuning, a column per damping."""

import textwrap

import numpy as np

from gearlib.data import motions
from gearlib.figures import style

_CELL_HEIGHT, _HEAD = 1.25, 0.7

#: Room around the orbits of a row, in shares of their extent.
_MARGIN = 0.06
#: What is seen of a difference, in shares of the height.
_SEEN = 5e-3


@style.styled()
def draw(phase_planes, *, colours=None):
    """Draw a grid of phase planes {y'; y}, with colours by the name of the damping, if given.

    `phase_planes` are gathered: displacement and velocity over (damping, tuning, phase), period
    and followed over (damping, tuning), the scalar backlash_ratio. Each cell has its own scales,
    since undamped motions are many times larger, and above it its `motions.steadiness`. A run
    that could not go on (NaN) says so.
    """
    tunings = phase_planes.tuning.values
    looks = style.looks([str(name) for name in phase_planes.damping.values], colours)
    figure = style.page(_HEAD + _CELL_HEIGHT * tunings.size)
    grid = figure.subplots(tunings.size, len(looks), squeeze=False)
    for axes in grid[-1]:
        axes.set_xlabel(style.SHORT_DISPLACEMENT)
    for row, tuning in zip(grid, tunings, strict=True):
        runs = phase_planes.sel(tuning=tuning)
        row[0].set_ylabel(f"$\\nu_s$ = {tuning:.2f}\n$dy/d\\tau$")
        for axes, (name, look) in zip(row, looks.items(), strict=True):
            words = _draw_cell(axes, runs.sel(damping=name), look.colour)
            head = f"{style.damping_label(name)}\n" if axes in grid[0] else ""
            axes.set_title(f"{head}{words}", fontsize=6)
    return figure


def _limits(values):
    """Return limits around the finite values, zero included."""
    finite = values[np.isfinite(values)]
    low, high = min(finite.min(initial=0.0), 0.0), max(finite.max(initial=0.0), 0.0)
    margin = _MARGIN * (high - low) or 1.0
    return low - margin, high + margin


def orbit_of(run):
    """Return displacement and velocity of a run, closed where they repeat to the eye.

    Then they are whole orbits, or the last one where the record ends in the midst of another.
    """
    x, v, period = run.displacement.values, run.velocity.values, int(run.period)
    # The mesh phases of the record are equal steps.
    last = period * round(2.0 * np.pi / float(run.phase[1] - run.phase[0])) if period else 0
    rest = np.abs(x[-last:] - x[-2 * last : -last]) if period and x.size >= 2 * last else 0.0
    if not period or np.max(rest) > _SEEN * np.ptp(x):
        return x, v
    if x.size >= last:
        start = -last if x.size % last else 0
        x, v = (np.append(values[start:], values[start]) for values in (x, v))
    return x, v


def _draw_cell(axes, run, colour):
    """Draw one phase plane with its areas; return what is said of its motion."""
    x, v = orbit_of(run)
    axes.set(xlim=_limits(x), ylim=_limits(v))
    style.shade_areas(axes, float(run.backlash_ratio), "x")
    axes.plot(x, v, color=colour, linewidth=0.8 if int(run.period) else 0.3)
    axes.tick_params(labelsize=5.5)
    words = motions.steadiness(run) if np.isfinite(x).all() else "no result"
    return "\n".join(textwrap.wrap(words, 30))

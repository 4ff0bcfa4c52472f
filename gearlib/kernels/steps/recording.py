"""What is recorded of a run in steps: what a user of the method sees at step ends and samples.

Contact is that of the step ends. An event is a change of contact between them, located by the
straight line through their displacements: a bounce inside a step goes unseen.
"""

import math
from typing import NamedTuple

from gearlib.kernels import orbit
from gearlib.kernels.codes import BACKLASH, NORMAL
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.steps.equation_of_motion import (
    SIDE,
    acceleration,
    side_of,
    spring,
    stiffness_at,
    waves_at,
)

#: Coefficients of a step's dense output, a polynomial of the share of the step.
DENSE = 5


class Step(NamedTuple):
    """One step that has been taken."""

    period: int  #: number of the mesh period in which it starts
    phase: float  #: where, from the start of that period
    length: float
    x0: float
    v0: float
    x1: float
    v1: float


@inlined
def value_at(dense, share):
    """Return a dense output, shape (5,), at a share of the step."""
    total = dense[4]
    for k in range(3, -1, -1):
        total = total * share + dense[k]
    return total


@inlined
def fill_hermite(dense, h, p0, m0, p1, m1):
    """Fill a dense output with the cubic through two values and two slopes."""
    rise = p1 - p0
    dense[0] = p0
    dense[1] = h * m0
    dense[2] = 3.0 * rise - h * (2.0 * m0 + m1)
    dense[3] = -2.0 * rise + h * (m0 + m1)
    dense[4] = 0.0


@kernel
def low_length(breaks, low, start, end):
    """Return how much of the phases from `start` to `end` lies on pieces below the mean."""
    total, turn = 0.0, 2.0 * math.pi
    for n in range(int(math.floor(start / turn)), int(math.floor(end / turn)) + 1):
        for i in range(low.shape[0]):
            if low[i]:
                a, b = max(start, n * turn + breaks[i]), min(end, n * turn + breaks[i + 1])
                total += max(b - a, 0.0)
    return total


@kernel
def add_stretch(breaks, low, start, end, contact, summary):
    """Add the phases from `start` to `end`, spent at one contact code, to the summary."""
    if contact == BACKLASH:
        summary[orbit.TIME_BACKLASH] += end - start
        return
    summary[orbit.TIME_NORMAL if contact == NORMAL else orbit.TIME_INVERSE] += end - start
    summary[orbit.TIME_LOW] += low_length(breaks, low, start, end)


@kernel
def add_values(x, force, summary):
    """Add a displacement and a force to the extrema."""
    summary[orbit.X_MAX] = max(summary[orbit.X_MAX], x)
    summary[orbit.X_MIN] = min(summary[orbit.X_MIN], x)
    summary[orbit.FORCE_MAX] = max(summary[orbit.FORCE_MAX], force)
    summary[orbit.FORCE_MIN] = min(summary[orbit.FORCE_MIN], force)


@kernel
def note(events, found, period, phase, before, after, v, summary):
    """The same as `orbit.note` with a phase that may lie in a later period."""
    more = int(math.floor(phase / (2.0 * math.pi)))
    phase -= 2.0 * math.pi * more
    return orbit.note(events, found, period + more, phase, before, after, v, summary)


@inlined
def _stiffness(law, phase, side):
    phase -= 2.0 * math.pi * math.floor(phase / (2.0 * math.pi))
    return stiffness_at(law.breaks, law.pieces, law.stiffness, phase, side)


@kernel
def add_sample(law, m, phase, contact, x, v, row, summary):
    """Fill one sample, shape (6,), from a state, and add it to the extrema."""
    c, unit = _stiffness(law, phase, SIDE), law.tuning * law.tuning
    force = unit * c * spring(m, x)
    row[orbit.SAMPLE_X], row[orbit.SAMPLE_V] = x, v
    row[orbit.SAMPLE_A] = acceleration(m, c, waves_at(law.force, phase), x, v)
    row[orbit.SAMPLE_CONTACT] = contact
    row[orbit.SAMPLE_STIFFNESS] = unit * c
    row[orbit.SAMPLE_FORCE] = force
    add_values(x, force, summary)


@kernel
def add_ends(breaks, low, gap, step, share, events, found, summary):
    """Add times and changes of contact of a step, from a share of it on; return (events, found)."""
    period, phase, h, x0, v0, x1, v1 = step
    code, last, at = side_of(gap, x0), side_of(gap, x1), share
    while code != last:
        # The next flank line on the way from x0 to x1.
        if code == BACKLASH:
            line, after = (0.0 if last == NORMAL else -gap), last
        else:
            line, after = (0.0 if code == NORMAL else -gap), BACKLASH
            if gap == 0.0:
                after = -code
        crossing = (line - x0) / (x1 - x0)
        if crossing > share:
            add_stretch(breaks, low, phase + at * h, phase + crossing * h, code, summary)
            v = v0 + crossing * (v1 - v0)
            events, found = note(
                events, found, period, phase + crossing * h, code, after, v, summary
            )
            at = crossing
        code = after
    add_stretch(breaks, low, phase + at * h, phase + h, code, summary)
    return events, found


@kernel
def record_step(
    law, m, step, dense, refine, first, per_period, samples, taken, events, found, summary
):
    """Record one step.

    Parameters
    ----------
    law, m : Law, Contact
    step : Step
    dense : ndarray, shape (2, 5)
        Dense output of displacement and velocity.
    refine : int
        Equal parts of the step at whose ends the method shows the solution.
    first : int
        First period that is recorded; of a step that starts before it, the rest is.
    per_period : int
        Samples per mesh period.
    samples, events, summary : ndarray
        As of `gearlib.kernels.closed_form.pair_run.run`.
    taken, found : int
        Rows of samples and events in use.

    Returns
    -------
    taken, events, found
    """
    h, phase = step.length, step.phase
    share = max(0.0, (2.0 * math.pi * (first - step.period) - phase) / h)
    if share >= 1.0:
        return taken, events, found
    unit = law.tuning * law.tuning
    for j in range(refine + 1):
        # The first point is the step's start, or where the record starts.
        s = share if j == 0 else j / refine
        if j == 0 or s > share:
            x = step.x1 if j == refine else value_at(dense[0], s)
            c = _stiffness(law, phase + s * h, SIDE if j == 0 else -SIDE)
            add_values(x, unit * c * spring(m, x), summary)
    while taken < samples.shape[0]:
        back = taken - (step.period - first) * per_period
        at = 2.0 * math.pi * back / per_period
        if at >= phase + h - SIDE:
            break
        x, v = value_at(dense[0], (at - phase) / h), value_at(dense[1], (at - phase) / h)
        add_sample(law, m, at, side_of(m.gap, x), x, v, samples[taken], summary)
        taken += 1
    events, found = add_ends(law.breaks, law.low, m.gap, step, share, events, found, summary)
    return taken, events, found

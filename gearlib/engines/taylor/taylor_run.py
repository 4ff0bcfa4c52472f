"""The run of a nonlinear mesh: Taylor steps that end where the law of motion changes.

A step ends at the end of a piece of c(tau), at the first crossing of a flank line and, where the
damping has a quadratic part, at a change of sign of x'. Crossings are those of the step's own
polynomial: a bounce inside a step is found (`polynomial.first_fall`).
"""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import BACKLASH, EVENT_LIMIT, INVERSE, NORMAL, OK, OVERFLOW, UNRESOLVED
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.motion import contact_between
from gearlib.engines.polynomial import WORK_ROWS, first_fall, horner, lowest_of_parabola
from gearlib.engines.taylor.deviations import (
    cross,
    follow,
    reach_of,
    set_identity,
    stiffest_of,
)
from gearlib.engines.taylor.series import (
    D2,
    LOWER,
    ORDER,
    PUSH,
    ROWS,
    SCALED,
    UPPER,
    C,
    V,
    X,
    expand,
    state_at,
    step_length,
    tables,
)

#: What ended a step.
_SMOOTH, _NORMAL_FLANK, _FAR_FLANK, _TURN = range(4)


@inlined
def _scale(series, row, line, factor, h):
    """Fill the row SCALED with factor (series - line) as a polynomial of t / h.

    Returns the magnitudes of its terms above the square together.
    """
    power, tail = factor, 0.0
    for k in range(1, ORDER + 1):
        power *= h
        series[SCALED, k] = series[row, k] * power
        if k > 2:
            tail += abs(series[SCALED, k])
    series[SCALED, 0] = factor * (series[row, 0] - line)
    return tail


@kernel
def first_crossing(series, row, line, side, h, to_bernstein, work):
    """Return where side (series - line) first falls through zero, in shares of h; 2 if nowhere."""
    tail, curve = _scale(series, row, line, side, h), series[SCALED]
    # Most steps are far from the line.
    if lowest_of_parabola(curve[0], curve[1], curve[2]) > tail:
        return 2.0
    return first_fall(curve, to_bernstein, work)


@inlined
def take_step(
    constants, harmonics, to_bernstein, piece, phase, left, contact, sign, x, v, series, work
):
    """Take one step from `phase`, no longer than `left`; its series stay in `series`.

    Returns (h, during, contact, sign, x, v): the length of the step, negative where rounding hides
    whether it ends at a flank line; the contact code during it; the state at its end, on a flank
    line and on a turning point exactly so.
    """
    upper, lower = constants[0, 0, UPPER], constants[0, 0, LOWER]
    if v == 0.0:
        # At rest the acceleration decides where the motion goes, off a flank line too.
        expand(constants, harmonics, piece, phase, contact, 0.0, x, v, series, 1)
        sign = math.copysign(1.0, series[V, 1])
        contact = contact_between(upper, lower, x, sign)
    during = contact
    expand(constants, harmonics, piece, phase, contact, sign, x, v, series, ORDER)
    h = step_length(constants, series, left)
    # A step that leaves a remainder below rounding takes it along.
    if left - h < 1e-13:
        h = left
    best, what = 2.0, _SMOOTH
    if contact != INVERSE:
        side = 1.0 if contact == NORMAL else -1.0
        best, what = first_crossing(series, X, upper, side, h, to_bernstein, work), _NORMAL_FLANK
    if contact != NORMAL and lower > -math.inf:
        side = 1.0 if contact == BACKLASH else -1.0
        far = first_crossing(series, X, lower, side, h, to_bernstein, work)
        if far < best:
            best, what = far, _FAR_FLANK
    if constants[contact + 1, piece, D2] != 0.0:
        turn = first_crossing(series, V, 0.0, sign, h, to_bernstein, work)
        if turn < best:
            best, what = turn, _TURN
    t = h if best > 1.0 else best * h
    x, v = state_at(series, t)
    if best > 1.0:
        return t, during, contact, sign, x, v
    if best < 0.0:
        return -1.0, during, contact, sign, x, v
    if what == _TURN:
        return t, during, contact, -sign, x, 0.0
    x = upper if what == _NORMAL_FLANK else lower
    if contact == BACKLASH:
        contact = NORMAL if what == _NORMAL_FLANK else INVERSE
        v = max(v, 0.0) if what == _NORMAL_FLANK else min(v, 0.0)
    else:
        v = min(v, 0.0) if contact == NORMAL else max(v, 0.0)
        leaves = v < 0.0 if contact == NORMAL else v > 0.0
        if leaves:
            contact = BACKLASH if upper > lower else -contact
    return t, during, contact, math.copysign(1.0, v), x, v


@kernel
def add_step(tuning, low, to_bernstein, h, contact, series, work, summary):
    """Add a step of length h, on a piece that is `low` or not, to the summary."""
    curve = series[SCALED]
    _scale(series, X, 0.0, 1.0, h)
    orbit.add_curve(curve, to_bernstein, work, summary, orbit.X_MAX, orbit.X_MIN)
    orbit.add_time(contact, h, low, summary)
    if contact != BACKLASH:
        _scale(series, PUSH, 0.0, tuning * tuning, h)
        if summary.shape[0] > orbit.SUMMARY_COLUMNS:
            for k in range(ORDER + 1):
                summary[orbit.SUMMARY_COLUMNS] += h * curve[k] / (k + 1.0)
        orbit.add_curve(curve, to_bernstein, work, summary, orbit.FORCE_MAX, orbit.FORCE_MIN)


@kernel
def add_samples(tuning, phase, h, contact, series, samples, taken):
    """Fill the samples of one period that are wanted before phase + h; return how many are."""
    unit = tuning * tuning
    while taken < samples.shape[0]:
        t = samples[taken, orbit.SAMPLE_AT] - phase
        if t >= h:
            break
        samples[taken, orbit.SAMPLE_X], _ = horner(series[X], t)
        samples[taken, orbit.SAMPLE_V], samples[taken, orbit.SAMPLE_A] = horner(series[V], t)
        samples[taken, orbit.SAMPLE_CONTACT] = contact
        stiffness, _ = horner(series[C], t)
        samples[taken, orbit.SAMPLE_STIFFNESS] = unit * stiffness
        force = 0.0
        if contact != BACKLASH:
            force, _ = horner(series[PUSH], t)
        samples[taken, orbit.SAMPLE_FORCE] = unit * force
        taken += 1
    return taken


@inlined
def samples_of(samples, recorded, record_periods):
    """Return the samples of a mesh period, if it is recorded, with their phases."""
    count = samples.shape[0] // max(record_periods, 1)
    rows = samples[max(recorded, 0) * count : (recorded + 1) * count]
    orbit.equal_steps(rows, orbit.SAMPLE_AT, 2.0 * math.pi)
    return rows


@kernel
def run_nonlinear(
    law, to_bernstein, x, v, periods, record_periods, samples, events, limit, summary, maps
):
    """Run the nonlinear mesh as `gearlib.engines.pair.pair_run.run`, with its returns.

    `maps`, shape (periods, 2, 2) or (0, 2, 2), is filled with the map of small deviations of each
    mesh period. Returns in addition the number of Taylor steps, the deterministic cost of the run.
    """
    orbit.clear_summary(summary)
    constants, harmonics = tables(law)
    series, work = np.zeros((ROWS, ORDER + 1)), np.empty((WORK_ROWS, ORDER + 2))
    deviation, stiffest = np.zeros((6, ORDER + 1)), stiffest_of(law)
    # Looked up once: each look counts references.
    breaks, low, tuning, varied = law.breaks, law.low, law.tuning, maps.shape[0] > 0
    kept = min(periods, orbit.STROBE_PERIODS) if record_periods else 0
    strobes = np.empty((kept + 1, 2))
    found, steps = 0, 0
    contact, sign = contact_between(law.upper, law.lower, x, v), math.copysign(1.0, v)
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, steps
    for n in range(periods):
        row = n - (periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        if varied:
            set_identity(maps[n])
        recorded = n - (periods - record_periods)
        taken, counted = 0, steps
        rows = samples_of(samples, recorded, record_periods)
        for piece in range(low.shape[0]):
            at, end = breaks[piece], breaks[piece + 1]
            while at < end:
                if steps - counted >= limit:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                before, old = contact, sign
                still, left = v == 0.0, end - at
                if varied:
                    left = min(
                        left, reach_of(constants[contact + 1, piece], stiffest, contact, x, v)
                    )
                h, during, contact, sign, x, v = take_step(
                    constants,
                    harmonics,
                    to_bernstein,
                    piece,
                    at,
                    left,
                    contact,
                    sign,
                    x,
                    v,
                    series,
                    work,
                )
                steps += 1
                if h < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if varied:
                    # A step from rest sets out with the sign of its acceleration.
                    old = math.copysign(1.0, series[V, 1]) if still else old
                    cross(constants, piece, before, during, 0.0, maps[n])
                    follow(constants[during + 1, piece], during, old, h, series, deviation, maps[n])
                    cross(constants, piece, during, contact, v, maps[n])
                if not within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if recorded >= 0:
                    add_step(tuning, low[piece], to_bernstein, h, during, series, work, summary)
                    if orbit.unresolved(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    taken = add_samples(tuning, at, h, during, series, rows, taken)
                    if during != before:
                        # Leaves a flank line from rest, at the start of the step.
                        events, found = orbit.note(
                            events, found, n, at, before, during, 0.0, summary
                        )
                    if contact != during:
                        events, found = orbit.note(
                            events, found, n, at + h, during, contact, v, summary
                        )
                at += h
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return x, v, orbit.orbit_period(strobes, tuning, height), events, found, OK, steps

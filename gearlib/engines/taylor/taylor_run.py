"""The run of a nonlinear mesh: Taylor steps that end where the law of motion changes.

A step ends at the end of a piece of c(tau), at the first crossing of a flank line and, where the
damping has a quadratic part, at a change of sign of x'. Crossings are those of the step's own
polynomial: a bounce inside a step is found. Bounds of the polynomial or its shape rule most steps
out or show the only crossing; else it is isolated in Bernstein form (`polynomial.first_fall`).
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import BACKLASH, EVENT_LIMIT, INVERSE, NORMAL, OK, OVERFLOW, UNRESOLVED
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.mesh_constants import contact_between
from gearlib.engines.polynomial import (
    fall_by_shape,
    first_fall,
    horner,
    lowest_of_parabola,
)
from gearlib.engines.taylor.series import (
    BEND,
    D2,
    DEVIATION,
    LOWER,
    ORDER,
    PACE,
    PUSH,
    ROWS,
    SCALED,
    SHARE,
    SHARE_RATE,
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
    tail = _scale(series, row, line, side, h)
    curve = series[SCALED]
    # Most steps are far from the line.
    if lowest_of_parabola(curve[0], curve[1], curve[2]) > tail:
        return 2.0
    # From rest on the line its shape does not tell.
    if curve[0] != 0.0 or curve[1] != 0.0:
        found = fall_by_shape(curve, 1 if curve[0] == 0.0 else 0)
        if found >= 0.0:
            return found
    return first_fall(curve, to_bernstein, work)


@inlined
def take_step(
    constants, harmonics, ramp, to_bernstein, piece, phase, left, contact, sign, x, v, series, work
):
    """Take one step from `phase`, no longer than `left`; its series stay in `series`.

    Returns (h, during, contact, sign, x, v): the length of the step, negative where rounding hides
    whether it ends at a flank line; the contact code during it; the state at its end, on a flank
    line and on a turning point exactly so.
    """
    upper, lower = constants[0, 0, UPPER], constants[0, 0, LOWER]
    if v == 0.0:
        # At rest the acceleration decides where the motion goes, off a flank line too.
        expand(constants, harmonics, ramp, piece, phase, contact, 0.0, x, v, series, 1)
        sign = math.copysign(1.0, series[V, 1])
        contact = contact_between(upper, lower, x, sign)
    during = contact
    expand(constants, harmonics, ramp, piece, phase, contact, sign, x, v, series, ORDER)
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


class Course(NamedTuple):
    """Where a run goes: k mesh periods, over and over, of p segments in each of which c is smooth.

    Over theta, the phase of a steady run, on which speed and load are linear.
    """

    begin: np.ndarray  #: theta of its mesh period where a segment begins, shape (p,)
    end: np.ndarray  #: and where it ends
    first_segment: np.ndarray  #: int, where the mesh periods begin, shape (k + 1,)
    block: np.ndarray  #: int, which row of a summary each is in, shape (k,)
    taken: np.ndarray  #: int, where their samples begin, shape (k + 1,); of a steady run: (0,)
    piece: np.ndarray  #: int, of c(tau), shape (p,)
    phase: np.ndarray  #: tau where segments begin, shape (p,)
    speed: np.ndarray  #: dtau/dtheta there, shape (p,)
    share: np.ndarray  #: of the load there, shape (p,)
    ramp: np.ndarray  #: what of that of a step never changes, see `series`, shape (5,)
    deviation: np.ndarray  #: rows (order, cosine, sine), shape (j, 3)
    steady: bool  #: whether the speed is 1 all along


def steady_course(law):
    """Return the `Course` of a run at constant speed."""
    size, ends = len(law.low), (law.breaks[:-1].copy(), law.breaks[1:].copy())
    where = np.array([0, size]), *np.zeros((2, 1), np.int64), np.arange(size)
    none = np.zeros(5), np.empty((0, 3))
    return Course(*ends, *where, ends[0], np.ones(size), np.ones(size), *none, True)


@kernel
def _with_deviation(harmonics, rows):
    """Return the table of harmonics with a row more, that of the deviation."""
    most = max(harmonics.shape[1], rows.shape[0] + 1)
    found = np.zeros((DEVIATION + 1, most, harmonics.shape[2]))
    found[:DEVIATION, : harmonics.shape[1]] = harmonics
    found[DEVIATION, : rows.shape[0], :3] = rows
    return found


@inlined
def samples_of(course, samples, recorded, record_periods):
    """Return the samples of one of the mesh periods recorded, with the phases that are wanted."""
    if recorded < 0:
        return samples[:0]
    if not course.steady:
        return samples[course.taken[recorded] : course.taken[recorded + 1]]
    count = samples.shape[0] // max(record_periods, 1)
    rows = samples[recorded * count : (recorded + 1) * count]
    orbit.equal_steps(rows, orbit.SAMPLE_AT, 2.0 * math.pi)
    return rows


@inlined
def pace_of(course, p, t, ramp):
    """Fill the ramp of a step, t after the begin of segment p; return its phase."""
    ramp[PACE] = course.speed[p] + 2.0 * ramp[BEND] * t
    ramp[SHARE] = course.share[p] + ramp[SHARE_RATE] * t
    return course.phase[p] + (course.speed[p] + ramp[BEND] * t) * t


@kernel
def run_nonlinear(
    law, to_bernstein, course, x, v, periods, record_periods, samples, events, limit, summary
):
    """Run the nonlinear mesh as `gearlib.engines.pair.pair_run.run`, with its returns.

    `summary`, shape (b, 9), or (b, 10) with the integral of the force last, has a row for each
    block of the course. Returns in addition the number of Taylor steps, the deterministic cost of
    the run.
    """
    for row in range(summary.shape[0]):
        orbit.clear_summary(summary[row])
    constants, harmonics = tables(law)
    steady, ramp = course.steady, course.ramp.copy()
    if not steady:
        harmonics = _with_deviation(harmonics, course.deviation)
    series, work = np.zeros((ROWS, ORDER + 1)), np.empty((50, ORDER + 2))
    # Looked up once: each look counts references.
    first, pieces, low, tuning = course.first_segment, course.piece, law.low, law.tuning
    begins, ends = course.begin, course.end
    kept = min(periods, orbit.STROBE_PERIODS) if steady else 0
    strobes = np.empty((kept + 1, 2))
    found, steps = 0, 0
    contact, sign = contact_between(law.upper, law.lower, x, v), math.copysign(1.0, v)
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, steps
    for n in range(periods):
        row = n - (periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        recorded = n - (periods - record_periods)
        taken, counted, number = 0, steps, n % course.block.shape[0]
        own = summary[course.block[number]]
        rows = samples_of(course, samples, recorded, record_periods)
        for p in range(first[number], first[number + 1]):
            piece, at, end = pieces[p], begins[p], ends[p]
            while at < end:
                if steps - counted >= limit:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                before = contact
                phase = at if steady else pace_of(course, p, at - begins[p], ramp)
                h, during, contact, sign, x, v = take_step(
                    constants,
                    harmonics,
                    ramp,
                    to_bernstein,
                    piece,
                    phase,
                    end - at,
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
                if not within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if recorded >= 0:
                    add_step(tuning, low[piece], to_bernstein, h, during, series, work, own)
                    if orbit.unresolved(own):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    taken = add_samples(tuning, at, h, during, series, rows, taken)
                    if during != before:
                        # Leaves a flank line from rest, at the start of the step.
                        events, found = orbit.note(events, found, n, at, before, during, 0.0, own)
                    if contact != during:
                        events, found = orbit.note(
                            events, found, n, at + h, during, contact, v, own
                        )
                at += h
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[0, orbit.X_MAX] - summary[0, orbit.X_MIN]
    period = orbit.orbit_period(strobes, tuning, height) if steady else 0
    return x, v, period, events, found, OK, steps

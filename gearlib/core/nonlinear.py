"""The march of the nonlinear mesh: Taylor steps that end where the law changes.

A step ends at the end of a piece of c(tau), at the first crossing of a flank line and, where the
damping has a quadratic part, at a change of sign of x'. Crossings are those of the step's own
polynomial, isolated in Bernstein form (`polynomial.first_fall`): a bounce inside a step is found.
"""

import math

import numpy as np

from gearlib.core import orbit
from gearlib.core.jit import inlined, kernel
from gearlib.core.march import within_range
from gearlib.core.mesh import BACKLASH, INVERSE, NORMAL, contact_between
from gearlib.core.polynomial import first_fall, highest, horner
from gearlib.core.run import EVENT_LIMIT, OK, OVERFLOW, UNRESOLVED
from gearlib.core.series import damping_of, expand, step_length, storage

#: What ended a step.
_SMOOTH, _NORMAL_FLANK, _FAR_FLANK, _TURN = range(4)


@inlined
def _scale(series, offset, factor, h, out):
    """Fill `out` with factor (offset + series) as a polynomial of t / h."""
    power = factor
    for k in range(series.shape[0]):
        out[k] = series[k] * power
        power *= h
    out[0] += factor * offset


@inlined
def take_step(law, to_bernstein, piece, phase, end, contact, sign, x, v, s):
    """Take one step from `phase`, not beyond `end`.

    Returns
    -------
    h : float
        Length of the step; negative where rounding hides whether it ends at a flank line.
    during : int
        Contact code during the step.
    contact, sign, x, v : int, float, float, float
        State at its end; on a flank line and on a turning point exactly so.
    The series of the step stay in `s`.
    """
    if v == 0.0:
        # At rest the acceleration decides where the motion goes, off a flank line too.
        expand(law, piece, phase, contact, 0.0, x, v, s)
        sign = math.copysign(1.0, s.v[1])
        contact = contact_between(law.upper, law.lower, x, sign)
    during = contact
    expand(law, piece, phase, contact, sign, x, v, s)
    h = min(step_length(law, s), end - phase)
    # A step that leaves a remainder below rounding takes it along.
    if end - phase - h < 1e-13:
        h = end - phase
    xs, vs, scaled, work = s.x, s.v, s.scaled, s.work
    best, what = 2.0, _SMOOTH
    if contact == NORMAL:
        _scale(xs, -law.upper, 1.0, h, scaled)
        best, what = first_fall(scaled, to_bernstein, work), _NORMAL_FLANK
    elif contact == INVERSE:
        _scale(xs, -law.lower, -1.0, h, scaled)
        best, what = first_fall(scaled, to_bernstein, work), _FAR_FLANK
    else:
        _scale(xs, -law.upper, -1.0, h, scaled)
        best, what = first_fall(scaled, to_bernstein, work), _NORMAL_FLANK
        if law.lower > -math.inf:
            _scale(xs, -law.lower, 1.0, h, scaled)
            far = first_fall(scaled, to_bernstein, work)
            if far < best:
                best, what = far, _FAR_FLANK
    if damping_of(law, contact)[1] != 0.0:
        _scale(vs, 0.0, sign, h, scaled)
        turn = first_fall(scaled, to_bernstein, work)
        if turn < best:
            best, what = turn, _TURN
    if best > 1.0:
        x, _ = horner(xs, h)
        v, _ = horner(vs, h)
        return h, during, contact, sign, x, v
    if best < 0.0:
        return -1.0, during, contact, sign, x, v
    t = best * h
    x, _ = horner(xs, t)
    v, _ = horner(vs, t)
    if what == _TURN:
        return t, during, contact, -sign, x, 0.0
    x = law.upper if what == _NORMAL_FLANK else law.lower
    if contact == BACKLASH:
        contact = NORMAL if what == _NORMAL_FLANK else INVERSE
        v = max(v, 0.0) if what == _NORMAL_FLANK else min(v, 0.0)
    else:
        v = min(v, 0.0) if contact == NORMAL else max(v, 0.0)
        leaves = v < 0.0 if contact == NORMAL else v > 0.0
        if leaves:
            contact = BACKLASH if law.gap > 0.0 else -contact
    return t, during, contact, math.copysign(1.0, v), x, v


@kernel
def _add_step(law, to_bernstein, piece, h, contact, s, summary):
    """Add a step of length h to the summary; its series are in `s`."""
    _scale(s.x, 0.0, 1.0, h, s.scaled)
    summary[orbit.X_MAX] = highest(s.scaled, to_bernstein, s.work, summary[orbit.X_MAX])
    _scale(s.x, 0.0, -1.0, h, s.scaled)
    summary[orbit.X_MIN] = -highest(s.scaled, to_bernstein, s.work, -summary[orbit.X_MIN])
    if contact == BACKLASH:
        summary[orbit.TIME_BACKLASH] += h
        summary[orbit.FORCE_MAX] = max(summary[orbit.FORCE_MAX], 0.0)
        summary[orbit.FORCE_MIN] = min(summary[orbit.FORCE_MIN], 0.0)
        return
    summary[orbit.TIME_NORMAL if contact == NORMAL else orbit.TIME_INVERSE] += h
    if law.low[piece]:
        summary[orbit.TIME_LOW] += h
    unit = law.tuning * law.tuning
    _scale(s.k, 0.0, unit, h, s.scaled)
    summary[orbit.FORCE_MAX] = highest(s.scaled, to_bernstein, s.work, summary[orbit.FORCE_MAX])
    _scale(s.k, 0.0, -unit, h, s.scaled)
    summary[orbit.FORCE_MIN] = -highest(s.scaled, to_bernstein, s.work, -summary[orbit.FORCE_MIN])


@kernel
def _add_samples(law, phase, h, contact, s, samples, taken):
    """Fill the samples of one period that lie before phase + h; return how many are filled."""
    unit = law.tuning * law.tuning
    while taken < samples.shape[0]:
        t = 2.0 * math.pi * taken / samples.shape[0] - phase
        if t >= h:
            break
        samples[taken, orbit.SAMPLE_X], _ = horner(s.x, t)
        samples[taken, orbit.SAMPLE_V], samples[taken, orbit.SAMPLE_A] = horner(s.v, t)
        samples[taken, orbit.SAMPLE_CONTACT] = contact
        stiffness, _ = horner(s.c, t)
        samples[taken, orbit.SAMPLE_STIFFNESS] = unit * stiffness
        force = 0.0
        if contact != BACKLASH:
            force, _ = horner(s.k, t)
        samples[taken, orbit.SAMPLE_FORCE] = unit * force
        taken += 1
    return taken


@kernel
def _note(events, found, n, phase, before, after, v, summary):
    """Count a change of contact and append it to the event table, if one is wanted."""
    if before == NORMAL:
        summary[orbit.BOUNCES] += 1.0
    if events.shape[0] > 0:
        events, found = orbit.add_event(events, found, n, phase, before, after, v)
    return events, found


@kernel
def run_nonlinear(
    law, to_bernstein, x, v, periods, record_periods, samples, events, limit, summary
):
    """Run the nonlinear mesh; arguments and returns as of `gearlib.core.run.run`.

    Returns in addition the number of Taylor steps, the deterministic cost of the run.
    """
    orbit.clear_summary(summary)
    s = storage()
    kept = min(periods, orbit.STROBE_PERIODS)
    strobes = np.empty((kept + 1, 2))
    per_period = samples.shape[0] // record_periods
    found, steps = 0, 0
    contact, sign = contact_between(law.upper, law.lower, x, v), math.copysign(1.0, v)
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, steps
    for n in range(periods):
        row = n - (periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        recorded = n - (periods - record_periods)
        taken, counted = 0, steps
        for piece in range(law.pieces.shape[0]):
            phase, end = law.breaks[piece], law.breaks[piece + 1]
            while phase < end:
                if steps - counted >= limit:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                before = contact
                h, during, contact, sign, x, v = take_step(
                    law, to_bernstein, piece, phase, end, contact, sign, x, v, s
                )
                steps += 1
                if h < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if not within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if recorded >= 0:
                    _add_step(law, to_bernstein, piece, h, during, s, summary)
                    if orbit.unresolved(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    if per_period > 0:
                        rows = samples[recorded * per_period : (recorded + 1) * per_period]
                        taken = _add_samples(law, phase, h, during, s, rows, taken)
                    if during != before:
                        # Leaves a flank line from rest, at the start of the step.
                        events, found = _note(events, found, n, phase, before, during, 0.0, summary)
                    if contact != during:
                        events, found = _note(
                            events, found, n, phase + h, during, contact, v, summary
                        )
                phase += h
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    period = orbit.orbit_period(strobes, law.tuning, height)
    return x, v, period, events, found, OK, steps

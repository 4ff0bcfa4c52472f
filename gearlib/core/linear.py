"""Piecewise-linear systems with many coordinates: exact march between guaranteed events.

* Across a knot (see `gearlib.core.system`) the state goes by the precomputed exp(A h).
* A flank line is a linear functional g z; along a knot it is a polynomial whose coefficients are
  precomputed rows times the state. Its first crossing is isolated in Bernstein form
  (`polynomial.first_fall`): nothing is sampled, no margin is guessed.
* Behind a crossing the rest of the knot goes by the Taylor polynomial of the whole state.
"""

import math

import numpy as np

from gearlib.core import orbit
from gearlib.core.jit import inlined, kernel
from gearlib.core.mesh import BACKLASH, INVERSE, NORMAL
from gearlib.core.polynomial import first_fall, highest, horner, lowest_of_parabola
from gearlib.core.run import EVENT_LIMIT, OK, OVERFLOW
from gearlib.core.system import (
    ORDER,
    TAIL,
    advance,
    apply,
    dot,
    evaluate,
    expand,
    functional_of,
    prepare,
    scratch,
    tables,
)

#: A sum this small, as a share of its parts, is the rounding of zero.
_REST = 1e-14


@kernel
def _first_event(contact, on_line, at_rest, near, far, to_bernstein, scaled, work):
    """Return (share of the step, next contact code) of the first event; share 2: none.

    near, far: polynomials of y and y - s over the step. `on_line`: the step starts exactly on a
    line (1 the normal, -1 the far one, 0 none); `at_rest`: and at rest relative to it.
    """
    best, target = 2.0, contact
    if contact != INVERSE:
        scaled[:] = near if contact == NORMAL else -near
        if on_line == 1:
            scaled[0] = 0.0
            if at_rest:
                scaled[1] = 0.0
        best = first_fall(scaled, to_bernstein, work)
        target = BACKLASH if contact == NORMAL else NORMAL
    if contact != NORMAL:
        scaled[:] = -far if contact == INVERSE else far
        if on_line == -1:
            scaled[0] = 0.0
            if at_rest:
                scaled[1] = 0.0
        other = first_fall(scaled, to_bernstein, work)
        if other < best:
            best, target = other, (BACKLASH if contact == INVERSE else INVERSE)
    return best, target


@inlined
def _stays_above(rows, tails, i, p, side, z):
    """Return whether side times a functional provably stays above zero along a whole knot.

    Its parabola does, by more than all the higher terms can make: those up to TAIL one by one, the
    rest by the magnitudes of their rows. Most knots are far from a line, and this takes 8 products
    of the state instead of 21.
    """
    a, b, c, reach = 0.0, 0.0, 0.0, 0.0
    for r in range(z.shape[0]):
        value = z[r]
        a += rows[i, p, 0, r] * value
        b += rows[i, p, 1, r] * value
        c += rows[i, p, 2, r] * value
        reach += tails[i, p, r] * abs(value)
    for k in range(3, TAIL):
        term = 0.0
        for r in range(z.shape[0]):
            term += rows[i, p, k, r] * z[r]
        reach += abs(term)
    return lowest_of_parabola(side * a, side * b, side * c) > reach


@kernel
def _pass_knot(near, near_tail, far, far_tail, step, i, p, z, other):
    """Take z across a whole knot if contact code i - 1 provably lasts; return whether it does.

    Arrays instead of `Tables`: every look into a tuple counts references, which would cost more
    than the sums.
    """
    contact = i - 1
    if contact != INVERSE:
        side = 1.0 if contact == NORMAL else -1.0
        if not _stays_above(near, near_tail, i, p, side, z):
            return False
    if contact != NORMAL:
        side = -1.0 if contact == INVERSE else 1.0
        if not _stays_above(far, far_tail, i, p, side, z):
            return False
    n = z.shape[0]
    for r in range(n):
        total = 0.0
        for c in range(n):
            total += step[i, p, r, c] * z[c]
        other[r] = total
    for r in range(n):
        z[r] = other[r]
    return True


@inlined
def _along(rows, i, p, share, z, out):
    """Fill `out` with a functional along the first `share` of a knot, as a polynomial of it."""
    power = 1.0
    for k in range(ORDER + 1):
        total = 0.0
        for r in range(z.shape[0]):
            total += rows[i, p, k, r] * z[r]
        out[k] = total * power
        power *= share


@kernel
def go(system, table, to_bernstein, z, contact, on_line, at_rest, s, record, recorded, limit):
    """Go through one mesh period from its start; z is changed in place.

    Parameters
    ----------
    on_line, at_rest : int, bool
        Whether the period starts exactly on a line (1 the normal, -1 the far one, 0 none), and at
        rest relative to it.
    record : ndarray, shape (k, 4 + (ORDER + 1) n)
        If k > 0, filled with one row per step: phase, length, contact, stretch, Taylor
        coefficients of the state; enlarged as needed.
    recorded : int
        Rows in use.
    limit : int
        Most events.

    Returns
    -------
    contact : int
    events : int
        Number of events, limit + 1 when there were more.
    record, recorded
    """
    n = z.shape[0]
    keep = record.shape[0] > 0
    near, far = np.empty(ORDER + 1), np.empty(ORDER + 1)
    ready, step, other = table.ready, table.step, s.other
    fine, entries, places, values = table.fine, table.entries, table.places, table.values
    near_rows, near_tail, far_rows, far_tail = (
        table.near,
        table.near_tail,
        table.far,
        table.far_tail,
    )
    events = 0
    for p in range(system.knots.shape[0]):
        knots = system.knots[p]
        h = (system.starts[p + 1] - system.starts[p]) / knots
        for knot in range(knots):
            t = 0.0
            while t < h:
                i = contact + 1
                left = h - t
                whole = t == 0.0 and not keep
                if not ready[i, p]:
                    prepare(system, table, i, p)
                if whole and _pass_knot(
                    near_rows, near_tail, far_rows, far_tail, step, i, p, z, other
                ):
                    on_line = 0
                    break
                if keep:
                    expand(system.a[i, p], table.counts[i, p], table.columns[i, p], z, s.series)
                    if contact != INVERSE:
                        functional_of(s.series, system.near, left, near)
                    if contact != NORMAL:
                        functional_of(s.series, system.far, left, far)
                else:
                    if contact != INVERSE:
                        _along(near_rows, i, p, left / h, z, near)
                    if contact != NORMAL:
                        _along(far_rows, i, p, left / h, z, far)
                share, target = _first_event(
                    contact, on_line, at_rest, near, far, to_bernstein, s.scaled, s.work
                )
                at_rest = False
                if share > 1.0 and whole:
                    apply(table.step[i, p], z, s.other)
                    z[:] = s.other
                    on_line = 0
                    break
                length = left if share > 1.0 else share * left
                if keep:
                    if recorded == record.shape[0]:
                        larger = np.empty((2 * recorded, record.shape[1]))
                        larger[:recorded] = record
                        record = larger
                    record[recorded, 0] = system.starts[p] + knot * h + t
                    record[recorded, 1] = length
                    record[recorded, 2] = contact
                    record[recorded, 3] = p
                    record[recorded, 4:] = s.series.reshape((ORDER + 1) * n)
                    recorded += 1
                    evaluate(s.series, length, z)
                else:
                    advance(fine, entries, places, values, i, p, h, length, z, other, s.z)
                on_line = 0
                if share > 1.0:
                    break
                events += 1
                if events > limit:
                    return contact, events, record, recorded
                t += length
                line = 1 if NORMAL in (contact, target) else -1
                functional = system.near if line == 1 else system.far
                z[system.fix] -= dot(functional, z) / functional[system.fix]
                contact, on_line = target, line
    return contact, events, record, recorded


@kernel
def set_harmonics(system, z, phase):
    """Put the constant and the harmonics of z to their values at `phase`."""
    n, m = z.shape[0], system.harmonics.shape[0]
    z[n - 2 * m - 1] = 1.0
    for j in range(m):
        z[n - 2 * m + 2 * j] = math.cos(system.harmonics[j] * phase)
        z[n - 2 * m + 2 * j + 1] = math.sin(system.harmonics[j] * phase)


@kernel
def _summarise(system, to_bernstein, row, n, s, summary):
    """Add one recorded step to the orbit summary."""
    length, contact, p = row[1], int(row[2]), int(row[3])
    series = row[4:].reshape((ORDER + 1, n))
    functional_of(series, system.position, length, s.gap)
    summary[orbit.X_MAX] = highest(s.gap, to_bernstein, s.work, summary[orbit.X_MAX])
    s.scaled[:] = -s.gap
    summary[orbit.X_MIN] = -highest(s.scaled, to_bernstein, s.work, -summary[orbit.X_MIN])
    if contact == BACKLASH:
        summary[orbit.TIME_BACKLASH] += length
        summary[orbit.FORCE_MAX] = max(summary[orbit.FORCE_MAX], 0.0)
        summary[orbit.FORCE_MIN] = min(summary[orbit.FORCE_MIN], 0.0)
        return
    summary[orbit.TIME_NORMAL if contact == NORMAL else orbit.TIME_INVERSE] += length
    if system.low[p]:
        summary[orbit.TIME_LOW] += length
    functional_of(series, system.near if contact == NORMAL else system.far, length, s.gap)
    s.gap[:] *= system.stiffness[contact + 1, p]
    summary[orbit.FORCE_MAX] = highest(s.gap, to_bernstein, s.work, summary[orbit.FORCE_MAX])
    s.scaled[:] = -s.gap
    summary[orbit.FORCE_MIN] = -highest(s.scaled, to_bernstein, s.work, -summary[orbit.FORCE_MIN])


@kernel
def _sample(system, record, recorded, n, outputs, samples, s):
    """Fill the samples of one period from its recorded steps.

    Columns as of `orbit`, then one per row of `outputs`, a functional for each contact code and
    stretch, shape (outputs, 3, p, n).
    """
    i = 0
    for k in range(samples.shape[0]):
        phase = 2.0 * math.pi * k / samples.shape[0]
        while i + 1 < recorded and record[i + 1, 0] <= phase:
            i += 1
        contact, p, t = int(record[i, 2]), int(record[i, 3]), phase - record[i, 0]
        series = record[i, 4:].reshape((ORDER + 1, n))
        functional_of(series, system.position, 1.0, s.gap)
        x, v = horner(s.gap, t)
        samples[k, orbit.SAMPLE_X], samples[k, orbit.SAMPLE_V] = x, v
        for j in range(1, ORDER + 1):
            s.scaled[j - 1] = j * s.gap[j]
        s.scaled[ORDER] = 0.0
        _, samples[k, orbit.SAMPLE_A] = horner(s.scaled, t)
        samples[k, orbit.SAMPLE_CONTACT] = contact
        stiffness = system.stiffness[contact + 1, p]
        samples[k, orbit.SAMPLE_STIFFNESS] = stiffness
        evaluate(series, t, s.other)
        force = 0.0
        if contact == NORMAL:
            force = stiffness * dot(system.near, s.other)
        elif contact == INVERSE:
            force = stiffness * dot(system.far, s.other)
        samples[k, orbit.SAMPLE_FORCE] = force
        for j in range(outputs.shape[0]):
            samples[k, orbit.SAMPLE_COLUMNS + j] = dot(outputs[j, contact + 1, p], s.other)


@kernel
def _tendency(functional, free, z):
    """Return (sign with which a functional of a state on its line sets out, whether from rest)."""
    rate = free @ z
    speed = dot(functional, rate)
    # A rate of rounding is rest: then the acceleration decides.
    if abs(speed) <= _REST * np.abs(functional * rate).sum():
        return dot(functional, free @ rate), True
    return speed, False


@kernel
def contact_at(system, z):
    """Return (contact code, on_line, at_rest) of a state, the last two as in `go`.

    On a line the contact is that of the motion just after.
    """
    near, far, free = dot(system.near, z), dot(system.far, z), system.a[1, 0]
    if abs(near) <= _REST * np.abs(system.near * z).sum():
        near, at_rest = _tendency(system.near, free, z)
        return (NORMAL if near >= 0.0 else BACKLASH), 1, at_rest
    if near > 0.0:
        return NORMAL, 0, False
    if abs(far) <= _REST * np.abs(system.far * z).sum():
        far, at_rest = _tendency(system.far, free, z)
        return (INVERSE if far < 0.0 else BACKLASH), -1, at_rest
    return (INVERSE if far < 0.0 else BACKLASH), 0, False


@kernel
def run_linear(
    system, outputs, to_bernstein, z, periods, record_periods, samples, events, limit, summary
):
    """Run a piecewise-linear system; z is changed in place, its end is the end of the run.

    Arguments and returns otherwise as of `gearlib.core.run.run`; `outputs` as of the samples.
    """
    orbit.clear_summary(summary)
    n = z.shape[0]
    s = scratch(n)
    table = tables(system)
    kept = min(periods, orbit.STROBE_PERIODS)
    strobes = np.empty((kept + 1, 2))
    per_period = samples.shape[0] // record_periods
    found = 0
    record = np.empty((64, 4 + (ORDER + 1) * n))
    nothing = record[:0]
    set_harmonics(system, z, 0.0)
    contact, on_line, at_rest = contact_at(system, z)
    x, v = dot(system.position, z), dot(system.position, system.a[1, 0] @ z)
    previous = float(contact)
    for i in range(periods):
        # Harmonics are put to their values: their rounding must not grow with the run.
        set_harmonics(system, z, 2.0 * math.pi * i)
        row = i - (periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        recorded = i - (periods - record_periods)
        if recorded < 0:
            contact, count, _, _ = go(
                system, table, to_bernstein, z, contact, on_line, at_rest, s, nothing, 0, limit
            )
            previous = float(contact)
        else:
            contact, count, record, rows = go(
                system, table, to_bernstein, z, contact, on_line, at_rest, s, record, 0, limit
            )
        on_line, at_rest = 0, False
        if count > limit:
            return x, v, 0, events, 0, EVENT_LIMIT
        x, v = dot(system.position, z), dot(system.position, system.a[1, 0] @ z)
        if not (abs(x) < 1e150 and abs(v) < 1e150):
            return x, v, 0, events, 0, OVERFLOW
        if recorded < 0:
            continue
        for j in range(rows):
            _summarise(system, to_bernstein, record[j], n, s, summary)
            if record[j, 2] != previous:
                if previous == NORMAL:
                    summary[orbit.BOUNCES] += 1.0
                if events.shape[0] > 0:
                    series = record[j, 4:].reshape((ORDER + 1, n))
                    events, found = orbit.add_event(
                        events,
                        found,
                        i,
                        record[j, 0],
                        previous,
                        record[j, 2],
                        dot(system.near, series[1]),
                    )
                previous = record[j, 2]
        if per_period > 0:
            rows_of = samples[recorded * per_period : (recorded + 1) * per_period]
            _sample(system, record, rows, n, outputs, rows_of, s)
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return x, v, orbit.orbit_period(strobes, system.tuning, height), events, found, OK

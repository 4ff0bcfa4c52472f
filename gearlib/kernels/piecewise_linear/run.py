"""Piecewise-linear systems with many coordinates: exact propagation between guaranteed events.

Recorded mesh periods are propagated substep by substep (see
`gearlib.kernels.piecewise_linear.system`), by the Taylor polynomial of the whole state. The
distance from a flank line is a linear functional g z, and on a substep a polynomial whose first
crossing is isolated in Bernstein form (`polynomial.first_fall`): nothing is sampled, no margin is
guessed. Mesh periods that are not recorded use `gearlib.kernels.piecewise_linear.whole_periods`.
"""

import math

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.arrays import copy, enlarged
from gearlib.kernels.closed_form.event_by_event import within_range
from gearlib.kernels.codes import (
    BACKLASH,
    BOTH,
    EVENT_LIMIT,
    INVERSE,
    JAMMED,
    NORMAL,
    OK,
    OVERFLOW,
    UNRESOLVED,
)
from gearlib.kernels.jit import kernel
from gearlib.kernels.piecewise_linear.system import (
    ORDER,
    REST,
    behind,
    carry,
    dot,
    evaluate,
    expand,
    functional_of,
    image,
    next_contact,
    scratch,
    set_harmonics,
    tables,
)
from gearlib.kernels.piecewise_linear.whole_periods import pass_period, period_tables
from gearlib.kernels.polynomial import first_fall, horner


@kernel
def _multiply(factor, values, out):
    for k in range(values.shape[0]):
        out[k] = factor * values[k]


@kernel
def _first_event(contact, closing, on_line, at_rest, near, far, to_bernstein, scaled, work):
    """Return (share of the step, next contact code) of the first event.

    Share 2: none; -1: rounding hides whether there is one.

    near, far: polynomials of y and y - s over the step. `on_line`: the step starts exactly on a
    line (1 the normal, -1 the far one, 0 none); `at_rest`: and at rest relative to it. `closing`:
    whether, in contact, the other flank has to be looked at too.
    """
    best, target = 2.0, contact
    for line in (NORMAL, INVERSE):
        if contact == -line and not closing:
            continue
        side = float(line if contact == line else -line)
        _multiply(side, near if line == NORMAL else far, scaled)
        if on_line == line:
            scaled[0] = 0.0
            if at_rest:
                scaled[1] = 0.0
        share = first_fall(scaled, to_bernstein, work)
        if share < best:
            best, target = share, next_contact(contact, line)
    return best, target


@kernel
def go(system, table, to_bernstein, z, contact, on_line, at_rest, s, record, recorded, limit):
    """Go through one mesh period from its start and record it; z is changed in place.

    Parameters
    ----------
    system, table, to_bernstein, s : System, Tables, ndarray, Scratch
    z : ndarray, shape (n,)
    contact : int
    on_line, at_rest : int, bool
        Whether the period starts exactly on a line (1 the normal, -1 the far one, 0 none), and at
        rest relative to it.
    record : ndarray, shape (k, 4 + (ORDER + 1) n)
        Filled with one row per step: phase, length, contact, segment, Taylor coefficients of the
        state; enlarged as needed, k > 0.
    recorded : int
        Rows in use.
    limit : int
        Most events.

    Returns
    -------
    contact : int
    events : int
        Number of events, limit + 1 when there were more, limit + 2 where the flanks jam, limit + 3
        where rounding hides whether there is one.
    record, recorded
    """
    n = z.shape[0]
    near, far = np.empty(ORDER + 1), np.empty(ORDER + 1)
    events = 0
    for p in range(system.substeps.shape[0]):
        substeps = system.substeps[p]
        h = (system.starts[p + 1] - system.starts[p]) / substeps
        for step in range(substeps):
            t = 0.0
            while t < h:
                i = contact + 1
                left = h - t
                expand(system.a[i, p], table.counts[i, p], table.columns[i, p], z, s.series)
                if contact != INVERSE or system.closing:
                    functional_of(s.series, system.near, left, near)
                if contact != NORMAL or system.closing:
                    functional_of(s.series, system.far, left, far)
                share, target = _first_event(
                    contact,
                    system.closing,
                    on_line,
                    at_rest,
                    near,
                    far,
                    to_bernstein,
                    s.scaled,
                    s.work,
                )
                if share < 0.0:
                    return contact, limit + 3, record, recorded
                at_rest = False
                length = left if share > 1.0 else share * left
                if recorded == record.shape[0]:
                    record = enlarged(record, 2 * recorded)
                record[recorded, 0] = system.starts[p] + step * h + t
                record[recorded, 1] = length
                record[recorded, 2] = contact
                record[recorded, 3] = p
                copy(s.series.reshape((ORDER + 1) * n), record[recorded, 4:])
                recorded += 1
                evaluate(s.series, length, z)
                on_line = 0
                if share > 1.0:
                    break
                events += 1
                if events > limit:
                    return contact, events, record, recorded
                if target == BOTH:
                    return contact, limit + 2, record, recorded
                t += length
                line = 1 if NORMAL in (contact, target) else -1
                functional = system.near if line == 1 else system.far
                z[system.fix] -= dot(functional, z) / functional[system.fix]
                contact, on_line = target, line
    return contact, events, record, recorded


@kernel
def stopped(count, limit):
    """Return the status of a period with more than `limit` events, as counted by `go`."""
    if count == limit + 1:
        return EVENT_LIMIT
    return JAMMED if count == limit + 2 else UNRESOLVED


@kernel
def _summarise(system, to_bernstein, row, n, s, summary):
    """Add one recorded step to the orbit summary."""
    length, contact, p = row[1], int(row[2]), int(row[3])
    series = row[4:].reshape((ORDER + 1, n))
    functional_of(series, system.position, length, s.gap)
    orbit.add_curve(s.gap, to_bernstein, s.work, summary, orbit.X_MAX, orbit.X_MIN)
    orbit.add_time(contact, length, system.low[p], summary)
    if contact != BACKLASH:
        functional_of(series, system.near if contact == NORMAL else system.far, length, s.gap)
        _multiply(system.stiffness[contact + 1, p], s.gap, s.gap)
        orbit.add_curve(s.gap, to_bernstein, s.work, summary, orbit.FORCE_MAX, orbit.FORCE_MIN)


@kernel
def _sample(system, record, recorded, n, outputs, samples, s):
    """Fill the samples of one period from its recorded steps.

    Columns as of `orbit`, then one per row of `outputs`, a functional for each contact code and
    segment, shape (outputs, 3, p, n).
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
    rate = image(free, z)
    speed = dot(functional, rate)
    # A rate of rounding is rest: then the acceleration decides.
    if abs(speed) <= REST * np.abs(functional * rate).sum():
        return dot(functional, image(free, rate)), True
    return speed, False


@kernel
def contact_at(system, z):
    """Return (contact code, on_line, at_rest) of a state, the last two as in `go`.

    On a line the contact is that of the motion just after.
    """
    near, far, free = dot(system.near, z), dot(system.far, z), system.a[1, 0]
    if abs(near) <= REST * np.abs(system.near * z).sum():
        near, at_rest = _tendency(system.near, free, z)
        return (NORMAL if near >= 0.0 else BACKLASH), 1, at_rest
    if near > 0.0:
        return NORMAL, 0, False
    if abs(far) <= REST * np.abs(system.far * z).sum():
        far, at_rest = _tendency(system.far, free, z)
        return (INVERSE if far < 0.0 else BACKLASH), -1, at_rest
    return (INVERSE if far < 0.0 else BACKLASH), 0, False


@kernel
def jammed_at(system, z, contact, on_line):
    """Return whether both flanks touch at the start z of a run, which is in this contact."""
    return system.closing and (contact == NORMAL or on_line == 1) and behind(system.far, z)


@kernel
def _velocity(system):
    """Return the functional y', shape (n,): the same for every contact code."""
    return image(system.a[1, 0].T, system.near)


@kernel
def run_linear(
    system, part, outputs, to_bernstein, z, periods, record_periods, samples, events, limit, summary
):
    """Run a piecewise-linear system; z is changed in place, its end is the end of the run.

    The periods before the record go fast, by the `Part` that decides the events. Arguments and
    returns otherwise as of `gearlib.kernels.closed_form.run.run`; `outputs` as of the samples.
    """
    orbit.clear_summary(summary)
    n = z.shape[0]
    kept = min(periods, orbit.strobe_periods(system.repeats))
    strobes = np.empty((kept + 1, 2))
    unseen = periods - record_periods
    found = 0
    set_harmonics(system, z, 2.0 * math.pi * system.first)
    contact, on_line, at_rest = contact_at(system, z)
    speed = _velocity(system)
    x, v = dot(system.position, z), dot(speed, z)
    if jammed_at(system, z, contact, on_line):
        return x, v, 0, events, 0, JAMMED
    if unseen > 0:
        own, own_speed, way = part.system, _velocity(part.system), period_tables(part.system)
        short, rest = image(part.into, z), image(part.rest_into, z)
        for i in range(unseen):
            # Harmonics are put to their values: their rounding must not grow with the run.
            set_harmonics(own, short, 2.0 * math.pi * (system.first + i))
            row = i - (periods - kept)
            if row >= 0:
                strobes[row, 0], strobes[row, 1] = x, v
            contact, count = pass_period(
                own, way, to_bernstein, short, contact, on_line, at_rest, limit
            )
            on_line, at_rest = 0, False
            if count > limit:
                return x, v, 0, events, 0, stopped(count, limit)
            x, v = dot(own.position, short), dot(own_speed, short)
            if not within_range(x, v):
                return x, v, 0, events, 0, OVERFLOW
        carry(part.rest, rest, 2.0 * math.pi, unseen)
        copy(image(part.back, short) + image(part.rest_back, rest), z)
    s, table = scratch(n), tables(system)
    per_period = samples.shape[0] // record_periods
    record = np.empty((64, 4 + (ORDER + 1) * n))
    previous = contact
    for i in range(unseen, periods):
        set_harmonics(system, z, 2.0 * math.pi * (system.first + i))
        row = i - (periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        contact, count, record, rows = go(
            system, table, to_bernstein, z, contact, on_line, at_rest, s, record, 0, limit
        )
        on_line, at_rest = 0, False
        if count > limit:
            return x, v, 0, events, 0, stopped(count, limit)
        x, v = dot(system.position, z), dot(speed, z)
        if not within_range(x, v):
            return x, v, 0, events, 0, OVERFLOW
        for j in range(rows):
            _summarise(system, to_bernstein, record[j], n, s, summary)
            if orbit.unresolved(summary):
                return x, v, 0, events, 0, UNRESOLVED
            code = int(record[j, 2])
            if code != previous:
                at, rate = record[j, 0], dot(system.near, record[j, 4 + n : 4 + 2 * n])
                events, found = orbit.note(events, found, i, at, previous, code, rate, summary)
                previous = code
        if per_period > 0:
            first = (i - unseen) * per_period
            rows_of = samples[first : first + per_period]
            _sample(system, record, rows, n, outputs, rows_of, s)
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    period = orbit.orbit_period(strobes, system.tuning, height, system.repeats)
    return x, v, period, events, found, OK

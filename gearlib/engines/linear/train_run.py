"""A whole run of a gear train: from its start on, the mesh periods at its end recorded."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import BACKLASH, INVERSE, JAMMED, NORMAL, OK, OVERFLOW, UNRESOLVED
from gearlib.engines.jit import kernel, uncounted, woven
from gearlib.engines.linear.grid import FOUND, OPENING, PERIOD, SEGMENT, UNTIL
from gearlib.engines.linear.periods import BEYOND, go
from gearlib.engines.linear.train_system import REST, behind, dot, image, matrix_of, set_harmonics

#: Derivatives of a distance that are looked at where a motion starts on a flank line at rest.
_DERIVATIVES = 10


@uncounted
def _sign(functional, z):
    """Return the sign of a functional, 0 where it is the rounding of zero."""
    value, size = 0.0, 0.0
    for r in range(z.shape[0]):
        value += functional[r] * z[r]
        size += abs(functional[r] * z[r])
    if abs(value) <= REST * size:
        return 0.0
    return 1.0 if value > 0.0 else -1.0


@kernel
def set_contacts(system, open_, w, p):
    """Fill contact, line and rest of `Work` for its state at the start of segment p.

    On a line the contact is that of the motion just after, by the first derivative of the distance
    that is not zero. The forces of meshes whose distance begins with a higher one are zero so far.
    """
    m, n = system.near.shape
    z = w.z[:n]
    w.rest[:] = 0
    w.line[:] = 0
    waiting = np.zeros(m, dtype=np.bool_)
    for j in range(m):
        near = _sign(system.near[j], z)
        far = 1.0 if open_[j] else _sign(system.far[j], z)
        w.contact[j] = BACKLASH
        if near > 0.0:
            w.contact[j] = NORMAL
        elif near == 0.0:
            w.line[j], waiting[j] = 1, True
        elif far < 0.0:
            w.contact[j] = INVERSE
        elif far == 0.0:
            w.line[j], waiting[j] = -1, True
    a = np.empty((n, n))
    for order in range(1, _DERIVATIVES):
        if not waiting.any():
            break
        for j in range(m):
            w.effects[j] = system.effect[w.contact[j] + 1, p, j]
        matrix_of(system, w.effects, a)
        rate = image(a, z)
        for _ in range(order - 1):
            rate = image(a, rate)
        for j in range(m):
            if not waiting[j]:
                continue
            sign = _sign(system.near[j] if w.line[j] == 1 else system.far[j], rate)
            if sign != 0.0:
                waiting[j], w.rest[j] = False, order
                if sign == w.line[j]:
                    w.contact[j] = w.line[j]
    for j in range(m):
        if waiting[j]:
            w.rest[j] = _DERIVATIVES
            w.contact[j] = max(w.line[j], 0)


@uncounted
def _too_large(z):
    for r in range(z.shape[0]):
        if not abs(z[r]) < 1e150:
            return True
    return False


@kernel
def begin(system, grid, w):
    """Set the contacts of `Work` for its state at the start of a run; return the status."""
    n = system.near.shape[1]
    set_harmonics(system.harmonics, w.z[:n], 2.0 * math.pi * system.first)
    segments = system.first_segment
    set_contacts(system, grid.open, w, segments[system.first % (segments.shape[0] - 1)])
    for j in range(system.near.shape[0]):
        touches = w.contact[j] == NORMAL or w.line[j] == 1
        if grid.closing[j] and touches and behind(system.far[j], w.z[:n]):
            return JAMMED
    return OK


@uncounted
def run_train(
    system,
    grid,
    tables,
    w,
    periods,
    record_periods,
    samples,
    events,
    limit,
    summary,
    strobes,
    vectors,
    maps,
):
    """Run a gear train on from the state of `Work` and the mesh period counted there.

    Where the tables lack a combination, events a place, or a period its segments, the status is
    MISSING, FULL or BEYOND: call it again once they have it. The last `record_periods` are
    recorded: samples and events as of `periods.go`, a summary of each block of `Grid`, and in
    `strobes`, shape (m, k + 1, 2), the states of the meshes at the ends of the last k periods, and
    before. `maps`, shape (periods, 2 N, 2 N) or (0, 2 N, 2 N), get the growth of small deviations
    over each period; `vectors` are storage for these.
    """
    m, n = system.near.shape
    moving, kept = maps.shape[1], strobes.shape[1] - 1
    unseen = periods - record_periods
    per_period = samples.shape[0] // max(record_periods, 1)
    for i in range(w.place[PERIOD], periods):
        if i >= w.place[UNTIL]:
            return BEYOND
        if w.place[SEGMENT] < 0:
            # Harmonics are put to their values: their rounding must not grow with the run.
            set_harmonics(system.harmonics, w.z[:n], 2.0 * math.pi * (system.first + i))
            row = i - (periods - kept)
            if row >= 0:
                _strobe(system, grid, w.z, strobes, row)
            for r in range(vectors.shape[0]):
                for k in range(vectors.shape[1]):
                    vectors[r, k] = 1.0 if r == k else 0.0
        recording = i >= unseen
        number = (system.first + i) % (system.first_segment.shape[0] - 1)
        begin = max(i - unseen, 0) * per_period
        end = begin + per_period if recording else begin
        if grid.taken.shape[0] > 0:
            begin, end = grid.taken[number], grid.taken[number + 1]
        rows = summary[grid.block[number] * m :]
        taken = samples[begin:end]
        status = go(system, grid, tables, w, number, limit, vectors, recording, rows, taken, events)
        if status < 0:
            return status
        for row in range(w.place[OPENING], w.place[FOUND]):
            events[row, orbit.EVENT_PERIOD] = i
        if status == OK and _too_large(w.z):
            status = OVERFLOW
        if recording and status == OK:
            for j in range(m):
                if orbit.unresolved(rows[j]):
                    status = UNRESOLVED
        if status != OK:
            return status
        for r in range(vectors.shape[0]):
            for k in range(moving):
                maps[i, k, r] = vectors[r, k]
        w.place[PERIOD] = i + 1
    if record_periods > 0:
        _strobe(system, grid, w.z, strobes, kept)
    return OK


@kernel
def period_of(system, strobes, summary):
    """Return the period of a recorded run as of `orbit.orbit_period`, for all meshes."""
    period = 1
    for j in range(strobes.shape[0]):
        height = summary[j, orbit.X_MAX] - summary[j, orbit.X_MIN]
        one = orbit.orbit_period(strobes[j], system.tuning, height, system.repeats)
        period = period // math.gcd(period, one) * one if one > 0 else 0
        if period == 0:
            break
    return period


@woven
def _strobe(system, grid, z, strobes, row):
    own = z[: system.near.shape[1]]
    for j in range(strobes.shape[0]):
        strobes[j, row, 0] = dot(system.near[j], own)
        strobes[j, row, 1] = dot(grid.rate[j], own) / system.tuning

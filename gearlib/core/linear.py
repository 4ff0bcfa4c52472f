"""Piecewise-linear systems with many coordinates: exact march between guaranteed events.

While a contact code and a stretch of the mesh period last, the state obeys z' = A z. Constants and
harmonics are components of z (of frequency zero and n), so that excitation needs nothing of its
own. A stretch is cut into equal *knots*, so short that the Taylor polynomial of degree ORDER is
the solution to rounding, by the bound |remainder| <= (|A| h)^(ORDER + 1) / (ORDER + 1)! e^(|A| h).

* Across a knot the state goes by the precomputed exponential E = exp(A h).
* A flank line is a linear functional g z; along a knot it is a polynomial whose coefficients are
  precomputed rows times the state. Its first crossing is isolated in Bernstein form
  (`polynomial.first_fall`): nothing is sampled, no margin is guessed.
* Behind a crossing the rest of the knot goes by the Taylor polynomial of the whole state.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.core import orbit
from gearlib.core.jit import inlined, kernel
from gearlib.core.mesh import BACKLASH, INVERSE, NORMAL
from gearlib.core.polynomial import first_fall, highest, horner
from gearlib.core.run import EVENT_LIMIT, OK, OVERFLOW

ORDER = 20
#: |A| h of a knot: (1.3)^21 / 21! e^1.3 = 2e-17.
REACH = 1.3
#: A sum this small, as a share of its parts, is the rounding of zero.
_REST = 1e-14


class System(NamedTuple):
    """All matrices of one model at one tuning: n components, p stretches."""

    a: np.ndarray  #: z' = a[contact + 1, stretch] z, shape (3, p, n, n)
    starts: np.ndarray  #: phases that bound the stretches, shape (p + 1,), 0 to 2 pi
    knots: np.ndarray  #: knots of every stretch, int, shape (p,)
    low: np.ndarray  #: whether a stretch is one of C_min, shape (p,)
    stiffness: np.ndarray  #: c of every stretch, shape (p,)
    near: np.ndarray  #: functional y, displacement over the normal flank, shape (n,)
    far: np.ndarray  #: functional y - s, displacement over the far flank, shape (n,)
    fix: int  #: the component that is moved by rounding to put a state on a line
    harmonics: np.ndarray  #: frequencies of the cosine-sine pairs at the end of z, shape (m,)
    tuning: float


class Tables(NamedTuple):
    """What `System` needs precomputed; filled on first use, stretch by stretch."""

    ready: np.ndarray  #: bool, shape (3, p)
    step: np.ndarray  #: exp(A h), shape (3, p, n, n)
    near: np.ndarray  #: rows of y along a knot, shape (3, p, ORDER + 1, n)
    far: np.ndarray  #: rows of y - s
    counts: np.ndarray  #: entries of every row of A, shape (3, p, n)
    columns: np.ndarray  #: their columns, shape (3, p, n, n)


class Scratch(NamedTuple):
    """Arrays that a march writes to."""

    z: np.ndarray  #: shape (n,)
    other: np.ndarray  #: shape (n,)
    series: np.ndarray  #: Taylor coefficients of the state, shape (ORDER + 1, n)
    gap: np.ndarray  #: shape (ORDER + 1,)
    scaled: np.ndarray  #: shape (ORDER + 1,)
    work: np.ndarray  #: of `polynomial.first_fall`


@kernel
def tables(system):
    """Return empty `Tables`."""
    contacts, p, n, _ = system.a.shape
    return Tables(
        np.zeros((contacts, p), dtype=np.bool_),
        np.empty((contacts, p, n, n)),
        np.empty((contacts, p, ORDER + 1, n)),
        np.empty((contacts, p, ORDER + 1, n)),
        np.zeros((contacts, p, n), dtype=np.int64),
        np.empty((contacts, p, n, n), dtype=np.int64),
    )


@kernel
def scratch(n):
    """Return `Scratch` for n components."""
    return Scratch(
        np.empty(n),
        np.empty(n),
        np.empty((ORDER + 1, n)),
        np.empty(ORDER + 1),
        np.empty(ORDER + 1),
        np.empty((50, ORDER + 2)),
    )


@kernel
def _prepare(system, table, i, p):
    """Fill the tables of contact code i - 1 on stretch p."""
    n = system.near.shape[0]
    h = (system.starts[p + 1] - system.starts[p]) / system.knots[p]
    a = system.a[i, p]
    for r in range(n):
        for c in range(n):
            if a[r, c] != 0.0:
                table.columns[i, p, r, table.counts[i, p, r]] = c
                table.counts[i, p, r] += 1
    # Rows g (A h)^k / k!, and the exponential as the sum of (A h)^k / k!.
    for functional, rows in ((system.near, table.near[i, p]), (system.far, table.far[i, p])):
        rows[0] = functional
        for k in range(1, ORDER + 1):
            rows[k] = 0.0
            for r in range(n):
                if rows[k - 1, r] != 0.0:
                    rows[k] += rows[k - 1, r] * (h / k) * a[r]
    total = np.eye(n)
    term = np.eye(n)
    for k in range(1, ORDER + 1):
        new = np.zeros((n, n))
        for r in range(n):
            for c in range(n):
                if a[r, c] != 0.0:
                    new[r] += (a[r, c] * h / k) * term[c]
        term = new
        total += term
    table.step[i, p] = total
    table.ready[i, p] = True


@inlined
def _apply(matrix, z, out):
    """out = matrix z."""
    for r in range(z.shape[0]):
        total = 0.0
        for c in range(z.shape[0]):
            total += matrix[r, c] * z[c]
        out[r] = total


@kernel
def _expand(a, counts, columns, z, series):
    """Fill the Taylor coefficients of the state from z; `a` has few entries in a row."""
    n = z.shape[0]
    series[0] = z
    for k in range(1, ORDER + 1):
        share = 1.0 / k
        for r in range(n):
            total = 0.0
            for j in range(counts[r]):
                c = columns[r, j]
                total += a[r, c] * series[k - 1, c]
            series[k, r] = total * share


@kernel
def _evaluate(series, t, out):
    """Fill `out` with the state of a Taylor series at t."""
    out[:] = series[ORDER]
    for k in range(ORDER - 1, -1, -1):
        for r in range(out.shape[0]):
            out[r] = out[r] * t + series[k, r]


@kernel
def _functional(series, functional, h, out):
    """Fill `out` with a functional of a Taylor series as a polynomial of t / h."""
    power = 1.0
    for k in range(ORDER + 1):
        total = 0.0
        for r in range(functional.shape[0]):
            total += functional[r] * series[k, r]
        out[k] = total * power
        power *= h


@kernel
def _first_event(contact, on_line, near, far, to_bernstein, scaled, work):
    """Return (share of the step, next contact code) of the first event; share 2: none.

    near, far: polynomials of y and y - s over the step. `on_line`: the step starts exactly on a
    line (1 the normal, -1 the far one, 0 none).
    """
    best, target = 2.0, contact
    if contact != INVERSE:
        scaled[:] = near if contact == NORMAL else -near
        if on_line == 1:
            scaled[0] = 0.0
        best = first_fall(scaled, to_bernstein, work)
        target = BACKLASH if contact == NORMAL else NORMAL
    if contact != NORMAL:
        scaled[:] = -far if contact == INVERSE else far
        if on_line == -1:
            scaled[0] = 0.0
        other = first_fall(scaled, to_bernstein, work)
        if other < best:
            best, target = other, (BACKLASH if contact == INVERSE else INVERSE)
    return best, target


@kernel
def _dot(functional, z):
    total = 0.0
    for r in range(z.shape[0]):
        total += functional[r] * z[r]
    return total


@kernel
def go(system, table, to_bernstein, z, contact, s, record, recorded, limit):
    """Go through one mesh period from its start; z is changed in place.

    Parameters
    ----------
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
    events, on_line = 0, 0
    for p in range(system.knots.shape[0]):
        h = (system.starts[p + 1] - system.starts[p]) / system.knots[p]
        for knot in range(system.knots[p]):
            t = 0.0
            while t < h:
                i = contact + 1
                left = h - t
                whole = t == 0.0 and not keep
                if not table.ready[i, p]:
                    _prepare(system, table, i, p)
                if whole:
                    if contact != INVERSE:
                        rows = table.near[i, p]
                        for k in range(ORDER + 1):
                            near[k] = _dot(rows[k], z)
                    if contact != NORMAL:
                        rows = table.far[i, p]
                        for k in range(ORDER + 1):
                            far[k] = _dot(rows[k], z)
                else:
                    _expand(system.a[i, p], table.counts[i, p], table.columns[i, p], z, s.series)
                    if contact != INVERSE:
                        _functional(s.series, system.near, left, near)
                    if contact != NORMAL:
                        _functional(s.series, system.far, left, far)
                share, target = _first_event(
                    contact, on_line, near, far, to_bernstein, s.scaled, s.work
                )
                if share > 1.0 and whole:
                    _apply(table.step[i, p], z, s.other)
                    z[:] = s.other
                    on_line = 0
                    break
                if whole:
                    _expand(system.a[i, p], table.counts[i, p], table.columns[i, p], z, s.series)
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
                _evaluate(s.series, length, z)
                on_line = 0
                if share > 1.0:
                    break
                events += 1
                if events > limit:
                    return contact, events, record, recorded
                t += length
                line = 1 if NORMAL in (contact, target) else -1
                functional = system.near if line == 1 else system.far
                z[system.fix] -= _dot(functional, z) / functional[system.fix]
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
    _functional(series, system.near, length, s.gap)
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
    if contact == INVERSE:
        _functional(series, system.far, length, s.gap)
    s.gap[:] *= system.stiffness[p]
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
        _functional(series, system.near, 1.0, s.gap)
        x, v = horner(s.gap, t)
        samples[k, orbit.SAMPLE_X], samples[k, orbit.SAMPLE_V] = x, v
        for j in range(1, ORDER + 1):
            s.scaled[j - 1] = j * s.gap[j]
        s.scaled[ORDER] = 0.0
        _, samples[k, orbit.SAMPLE_A] = horner(s.scaled, t)
        samples[k, orbit.SAMPLE_CONTACT] = contact
        samples[k, orbit.SAMPLE_STIFFNESS] = system.stiffness[p]
        _evaluate(series, t, s.other)
        force = 0.0
        if contact == NORMAL:
            force = system.stiffness[p] * x
        elif contact == INVERSE:
            force = system.stiffness[p] * _dot(system.far, s.other)
        samples[k, orbit.SAMPLE_FORCE] = force
        for j in range(outputs.shape[0]):
            samples[k, orbit.SAMPLE_COLUMNS + j] = _dot(outputs[j, contact + 1, p], s.other)


@kernel
def _tendency(functional, free, z):
    """Return the sign with which a functional of a state on its line sets out."""
    rate = free @ z
    speed = _dot(functional, rate)
    # A rate of rounding is rest: then the acceleration decides.
    if abs(speed) <= _REST * np.abs(functional * rate).sum():
        return _dot(functional, free @ rate)
    return speed


@kernel
def contact_at(system, z):
    """Return the contact code of a state; on a line, that of the motion just after."""
    near, far, free = _dot(system.near, z), _dot(system.far, z), system.a[1, 0]
    on_near = abs(near) <= _REST * np.abs(system.near * z).sum()
    if on_near:
        near = _tendency(system.near, free, z)
    if near > 0.0 or (on_near and near == 0.0):
        return NORMAL
    on_far = abs(far) <= _REST * np.abs(system.far * z).sum()
    if on_far:
        far = _tendency(system.far, free, z)
    return INVERSE if far < 0.0 else BACKLASH


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
    contact = contact_at(system, z)
    x, v = _dot(system.near, z), _dot(system.near, system.a[1, 0] @ z)
    previous = float(contact)
    for i in range(periods):
        # Harmonics are put to their values: their rounding must not grow with the run.
        set_harmonics(system, z, 2.0 * math.pi * i)
        row = i - (periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        recorded = i - (periods - record_periods)
        if recorded < 0:
            contact, count, _, _ = go(system, table, to_bernstein, z, contact, s, nothing, 0, limit)
            previous = float(contact)
        else:
            contact, count, record, rows = go(
                system, table, to_bernstein, z, contact, s, record, 0, limit
            )
        if count > limit:
            return x, v, 0, events, 0, EVENT_LIMIT
        x, v = _dot(system.near, z), _dot(system.near, system.a[1, 0] @ z)
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
                        _dot(system.near, series[1]),
                    )
                previous = record[j, 2]
        if per_period > 0:
            rows_of = samples[recorded * per_period : (recorded + 1) * per_period]
            _sample(system, record, rows, n, outputs, rows_of, s)
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return x, v, orbit.orbit_period(strobes, system.tuning, height), events, found, OK

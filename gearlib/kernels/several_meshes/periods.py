"""Through mesh periods, substep by substep, with all events of all meshes.

On a substep the distance of every mesh from a flank is a polynomial of the phase, whose
coefficients are rows times the state. Its first terms mostly prove that the line is not reached;
otherwise the first crossing is proved by the shape of the polynomial, or isolated in Bernstein form
(`gearlib.kernels.polynomial`). The substep ends at the first event of any mesh. Crossings of
several meshes within their rounding are one event of them all: their saltation matrices commute,
so that the order does not matter (`docs/theory/trains.md`).
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.closed_form.mesh import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.closed_form.run import EVENT_LIMIT, JAMMED, OK, UNRESOLVED
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.piecewise_linear.system import ORDER, dot
from gearlib.kernels.polynomial import (
    fall_by_shape,
    first_fall,
    highest,
    horner,
    lowest_of_parabola,
)
from gearlib.kernels.several_meshes.combinations import (
    BEHIND,
    LOOK,
    PARTS,
    TERMS,
    combination,
    forget,
    multiply,
    whole_step,
)

#: Overlap of the flank lines, in shares of the terms of their distance, that is more than rounding.
_JAM = 1e-9
#: Two crossings closer than this share of a substep are one whatever their speeds: near grazing
#: rounding would spread without bound what happens at once.
_AT_ONCE = 1e-13

#: Columns of the event table: those of `orbit` and the number of the mesh.
EVENT_MESH = orbit.EVENT_COLUMNS
EVENT_COLUMNS = orbit.EVENT_COLUMNS + 1


class Grid(NamedTuple):
    """How the mesh periods of a system are divided."""

    knots: np.ndarray  #: int, substeps of every segment, shape (p,)
    length: np.ndarray  #: theta of such a substep, shape (p,)
    kind: np.ndarray  #: int, number of that length, shape (p,)
    rate: np.ndarray  #: functionals of dd_j/dtheta, shape (m, n)
    open: np.ndarray  #: bool, whether a mesh has no coast side, shape (m,)
    apart: np.ndarray  #: rows of far - near by constant and harmonics, (m, ORDER + 1, 1 + 2 h)
    spin: np.ndarray  #: frequencies of the harmonics by theta, shape (h,)


class Work(NamedTuple):
    """What changes on the way, and room to compute."""

    contact: np.ndarray  #: int, contact codes, shape (m,)
    rest: (
        np.ndarray
    )  #: int, leading coefficients that are 0: 1 on a line, more: at rest on it, (m,)
    line: np.ndarray  #: int, on which: 1 drive side, -1 coast side, shape (m,)
    effects: np.ndarray  #: int, shape (m,)
    clear: np.ndarray  #: bool, whether a mesh comes to no flank line, shape (m,)
    share: np.ndarray  #: where a mesh has its event, in shares of what is left, shape (m,)
    target: np.ndarray  #: int, its contact after that, shape (m,)
    spread: np.ndarray  #: rounding of that share, shape (m,)
    z: np.ndarray  #: the state, filled up
    term: np.ndarray
    image: np.ndarray
    look: np.ndarray  #: shape (LOOK m,)
    tail: np.ndarray
    behind: np.ndarray
    curve: np.ndarray  #: shape (ORDER + 1,)
    scaled: np.ndarray  #: shape (ORDER + 1,)
    bernstein: np.ndarray


def grid_of(system):
    """Return the `Grid` of a system; how many lengths it has is ``kind.max() + 1``."""
    spans = np.diff(system.starts) / system.tuning
    knots = np.maximum(np.ceil(spans / system.longest * (1.0 - 1e-12)), 1.0).astype(np.int64)
    length = spans / knots
    # Lengths that differ by rounding are one.
    order = np.argsort(length, kind="stable")
    new = np.concatenate([[True], np.diff(length[order]) > 1e-13 * length[order][1:]])
    kind = np.empty(length.size, np.int64)
    kind[order] = np.cumsum(new) - 1
    n, h = system.free.shape[0], system.harmonics.size
    one = n - 1 - 2 * h
    apart = np.zeros((len(system.near), ORDER + 1, 1 + 2 * h))
    rows = (system.far - system.near)[:, one:]
    waves = system.free[one:, one:]
    for k in range(ORDER + 1):
        apart[:, k] = rows
        rows = rows @ waves * (system.longest / (k + 1))
    never = ~system.far[:, :one].any(axis=1)
    spin = system.harmonics * system.tuning
    return Grid(knots, length, kind, system.near @ system.free, never, apart, spin)


@kernel
def work_of(n, m):
    """Return `Work` for n components and m meshes."""
    wide = (n + 7) // 8 * 8
    return Work(
        np.zeros(m, np.int64),
        np.zeros(m, np.int64),
        np.zeros(m, np.int64),
        np.zeros(m, np.int64),
        np.zeros(m, np.bool_),
        np.empty(m),
        np.zeros(m, np.int64),
        np.empty(m),
        np.zeros(wide),
        np.zeros(wide),
        np.zeros(wide),
        np.empty(LOOK * m),
        np.empty((m + 7) // 8 * 8),
        np.empty(BEHIND),
        np.empty(ORDER + 1),
        np.empty(ORDER + 1),
        np.empty((50, ORDER + 2)),
    )


@kernel
def _advance(fine, rate, c, spin, longest, t, z, term, image):
    """Take z by t <= longest along A of combination c; arrays of `Combinations` and `Work`."""
    n = rate.shape[1]
    h = spin.shape[0]
    coordinates = (n - 1) // 2 - h
    part = int(PARTS * t / longest + 0.5)
    if part > 0:
        multiply(fine, PARTS * c + part - 1, z, term)
        for r in range(n):
            z[r] = term[r]
        t -= part * (longest / PARTS)
    else:
        for r in range(n):
            term[r] = z[r]
    for k in range(1, TERMS + 1):
        share = t / k
        multiply(rate, c, term, image)
        for r in range(coordinates):
            term[r] = share * term[coordinates + r]
            term[coordinates + r] = share * image[r]
            z[r] += term[r]
            z[coordinates + r] += term[coordinates + r]
        term[2 * coordinates] = 0.0
        for j in range(h):
            c = 2 * coordinates + 1 + 2 * j
            cosine = -share * spin[j] * term[c + 1]
            term[c + 1] = share * spin[j] * term[c]
            term[c] = cosine
            z[c] += term[c]
            z[c + 1] += term[c + 1]


@kernel
def _polynomial(look, rows, row, behind, z, j, scale, curve):
    """Fill `curve` with the distance of mesh j over a part of a substep, drive side."""
    multiply(rows, row, z, behind)
    power = 1.0
    for k in range(ORDER + 1):
        curve[k] = power * (look[LOOK * j + k] if k < LOOK else behind[k - LOOK])
        power *= scale


@kernel
def _to_far(apart, j, scale, constants, curve):
    """Turn the distance of mesh j from its drive side into that from its coast side."""
    power = 1.0
    for k in range(ORDER + 1):
        for i in range(constants.shape[0]):
            curve[k] += power * apart[j, k, i] * constants[i]
        power *= scale
        if constants.shape[0] == 1:
            break


@inlined
def _look_ahead(rows, tails, apart, c, z, contact, never, look, tail, term, clear):
    """Fill `clear`, which meshes provably come to no flank line within the longest substep.

    Their parabolas stay clear of the line by more than all higher terms can make. Fills look and
    tail for the state; arrays of `Combinations`, `Grid` and `Work`. Returns whether all are clear.
    """
    multiply(rows, c, z, look)
    for r in range(rows.shape[1]):
        term[r] = abs(z[r])
    multiply(tails, c, term, tail)
    quiet = True
    for j in range(contact.shape[0]):
        i, code = LOOK * j, contact[j]
        x, v, a = look[i], look[i + 1], look[i + 2]
        reach = (abs(look[i + 3]) + abs(look[i + 4])) + (abs(look[i + 5]) + abs(look[i + 6]))
        reach += abs(look[i + 7]) + tail[j]
        if code == NORMAL:
            alone = lowest_of_parabola(x, v, a) > reach
        else:
            # Deviations that differ from flank to flank are left to the whole polynomial.
            alone = never[j] or apart.shape[2] == 1
            if code == BACKLASH:
                alone &= lowest_of_parabola(-x, -v, -a) > reach
            if not never[j]:
                side = 1.0 if code == BACKLASH else -1.0
                x += apart[j, 0, 0]
                alone &= lowest_of_parabola(side * x, side * v, side * a) > reach
        clear[j] = alone
        quiet &= alone
    return quiet


@kernel
def _fall(curve, scaled, rest, to_bernstein, bernstein):
    """Return (where a curve falls through zero first, as `first_fall`; rounding of that)."""
    for k in range(rest):
        curve[k] = 0.0
    scaled[:] = curve
    found = fall_by_shape(curve, rest) if rest < 2 else -1.0
    if found < 0.0:
        found = first_fall(curve, to_bernstein, bernstein)
    spread = 0.0
    if 0.0 <= found <= 1.0:
        for k in range(ORDER + 1):
            spread += abs(scaled[k])
        spread *= 4e-16 / abs(horner(scaled, found)[1])
    return found, spread


@kernel
def _first_events(system, grid, tables, c, w, left, to_bernstein):
    """Find when each mesh crosses a flank line first; fill share, target and spread of `Work`.

    Returns the smallest share of what is left of the substep, 2 if there is none, -1 if rounding
    hides whether there is one.
    """
    m, n = system.near.shape
    scale = left / system.longest
    constants = w.z[n - 1 - 2 * grid.spin.shape[0] : n]
    look, z, curve = w.look, w.z, w.curve
    best = 2.0
    for j in range(m):
        w.share[j], code = 2.0, w.contact[j]
        if w.clear[j] and w.rest[j] == 0:
            continue
        for line in (1, -1):
            # The drive side bounds the backlash from above, the coast side from below.
            if code == -line or (line == -1 and grid.open[j]):
                continue
            side = -1.0 if code != line and line == 1 else 1.0
            if line == -1 and code == INVERSE:
                side = -1.0
            rest = w.rest[j] if w.line[j] == line else 0
            _polynomial(look, tables.behind, m * c + j, w.behind, z, j, scale, curve)
            if line == -1:
                _to_far(grid.apart, j, scale, constants, curve)
            for k in range(ORDER + 1):
                curve[k] *= side
            share, spread = _fall(curve, w.scaled, rest, to_bernstein, w.bernstein)
            if share < 0.0:
                return -1.0
            if share < w.share[j]:
                w.share[j], w.spread[j] = share, spread
                w.target[j] = BACKLASH if code != BACKLASH else line
        best = min(best, w.share[j])
    return best


@kernel
def _cross(system, grid, w, j, p, vectors):
    """Let mesh j cross the flank line that it has come to; return its speed dd/dtheta."""
    old, new = system.effect[w.contact[j] + 1, p, j], system.effect[w.target[j] + 1, p, j]
    speed = dot(grid.rate[j], w.z)
    # A tangential crossing varies nothing: the force of the mesh does not jump.
    if vectors.shape[0] > 0 and speed != 0.0:
        jump = np.zeros(w.z.shape[0])
        for k in range(2):
            for r in range(system.near.shape[1]):
                jump[r] += system.push[j, new, k, r] * dot(system.grip[j, new, k], w.z)
                jump[r] -= system.push[j, old, k, r] * dot(system.grip[j, old, k], w.z)
        for i in range(vectors.shape[0]):
            vectors[i] += jump * (dot(system.near[j], vectors[i]) / speed)
    w.line[j] = 1 if NORMAL in (w.contact[j], w.target[j]) else -1
    w.rest[j] = 1
    w.contact[j] = w.target[j]
    return speed


@kernel
def _closed(system, grid, w, j):
    """Return whether mesh j, which has just left a flank, lies behind the other one already."""
    if w.contact[j] != BACKLASH or grid.open[j]:
        return False
    line = w.line[j]
    functional = system.far[j] if line == 1 else system.near[j]
    size = 0.0
    for r in range(functional.shape[0]):
        size += abs(functional[r] * w.z[r])
    return line * dot(functional, w.z) < -_JAM * size


@kernel
def _summarise(system, grid, tables, c, w, p, length, summary, to_bernstein):
    """Add a substep, or a part of one, to the summaries of all meshes."""
    m, n = system.near.shape
    scale, curve, phase = length / system.longest, w.curve, length * system.tuning
    constants = w.z[n - 1 - 2 * grid.spin.shape[0] : n]
    for j in range(m):
        _polynomial(w.look, tables.behind, m * c + j, w.behind, w.z, j, scale, curve)
        row, code = summary[j], w.contact[j]
        row[orbit.X_MAX] = highest(curve, to_bernstein, w.bernstein, row[orbit.X_MAX])
        for k in range(ORDER + 1):
            w.scaled[k] = -curve[k]
        row[orbit.X_MIN] = -highest(w.scaled, to_bernstein, w.bernstein, -row[orbit.X_MIN])
        if code == BACKLASH:
            row[orbit.TIME_BACKLASH] += phase
            row[orbit.FORCE_MAX] = max(row[orbit.FORCE_MAX], 0.0)
            row[orbit.FORCE_MIN] = min(row[orbit.FORCE_MIN], 0.0)
            continue
        row[orbit.TIME_NORMAL if code == NORMAL else orbit.TIME_INVERSE] += phase
        if system.low[code + 1, p, j]:
            row[orbit.TIME_LOW] += phase
        if code == INVERSE:
            _to_far(grid.apart, j, scale, constants, curve)
        for k in range(ORDER + 1):
            curve[k] *= system.stiffness[code + 1, p, j]
            w.scaled[k] = -curve[k]
        row[orbit.FORCE_MAX] = highest(curve, to_bernstein, w.bernstein, row[orbit.FORCE_MAX])
        row[orbit.FORCE_MIN] = -highest(w.scaled, to_bernstein, w.bernstein, -row[orbit.FORCE_MIN])


@kernel
def _sample(system, grid, tables, c, w, p, phase, length, samples, taken):
    """Fill the samples within a piece that begins at `phase`; return how many are taken.

    Columns: the state, shape (n,), the contact codes, shape (m,), the number of the segment.
    """
    m, n = system.near.shape
    end = phase + length * system.tuning - 1e-12
    while taken < samples.shape[0]:
        at = 2.0 * math.pi * taken / samples.shape[0]
        if at >= end:
            break
        z = w.z.copy()
        t = max(at - phase, 0.0) / system.tuning
        _advance(tables.fine, tables.rate, c, grid.spin, system.longest, t, z, w.term, w.image)
        samples[taken, :n] = z[:n]
        samples[taken, n : n + m] = w.contact
        samples[taken, n + m] = p
        taken += 1
    return taken


@kernel
def go(
    system,
    grid,
    tables,
    to_bernstein,
    w,
    number,
    limit,
    vectors,
    recording,
    summary,
    samples,
    events,
    found,
):
    """Go through one mesh period from its start; the state of `Work` is changed in place.

    Parameters
    ----------
    system, grid, tables, to_bernstein, w : TrainSystem, Grid, Combinations, ndarray, Work
    number : int
        Which of the mesh periods after which the excitation repeats.
    limit : int
        Most events.
    vectors : ndarray, shape (k, n filled up)
        Small deviations, changed in place: none, or as many as wanted.
    recording : bool
        Whether to fill what follows.
    summary : ndarray, shape (m, 9)
        As of `orbit`, one row a mesh.
    samples : ndarray, shape (k, n + m + 1)
        At equal steps of the period, as of `_sample`.
    events : ndarray, shape (k, 6)
        As of `orbit`, and the number of the mesh; the period is 0. Enlarged as needed, k > 0.
    found : int
        Rows in use.

    Returns
    -------
    status : int
    events, found
    """
    m, n = system.near.shape
    first, last = system.first_segment[number], system.first_segment[number + 1]
    fine, rate, step, spin = tables.fine, tables.rate, tables.step, grid.spin
    z, term, image_, longest = w.z, w.term, w.image, system.longest
    look_rows, tail_rows, apart, never = tables.look, tables.tail, grid.apart, grid.open
    contact, look, tail = w.contact, w.look, w.tail
    count, taken, on_line = 0, 0, True
    for p in range(first, last):
        c, h = -1, grid.length[p]
        for knot in range(grid.knots[p]):
            t = 0.0
            while t < h:
                if c < 0:
                    for j in range(m):
                        w.effects[j] = system.effect[w.contact[j] + 1, p, j]
                    c = combination(system, tables, w.effects)
                left, best = h - t, 2.0
                quiet = _look_ahead(
                    look_rows, tail_rows, apart, c, z, contact, never, look, tail, term, w.clear
                )
                if on_line or not quiet:
                    best = _first_events(system, grid, tables, c, w, left, to_bernstein)
                    w.rest[:] = 0
                    on_line = False
                if best < 0.0:
                    return UNRESOLVED, events, found
                length = left if best > 1.0 else best * left
                if recording:
                    phase = system.starts[p] - system.starts[first]
                    phase += (knot * h + t) * system.tuning
                    _summarise(system, grid, tables, c, w, p, length, summary, to_bernstein)
                    taken = _sample(system, grid, tables, c, w, p, phase, length, samples, taken)
                if best > 1.0 and t == 0.0:
                    s = whole_step(tables, c, grid.kind[p], h)
                    if s < 0:
                        forget(tables.known, tables.slots, tables.at)
                        c = combination(system, tables, w.effects)
                        s = whole_step(tables, c, grid.kind[p], h)
                    multiply(step, s, z, term)
                    z[:n] = term[:n]
                    for i in range(vectors.shape[0]):
                        multiply(step, s, vectors[i], term)
                        vectors[i, :n] = term[:n]
                else:
                    _advance(fine, rate, c, spin, longest, length, z, term, image_)
                    for i in range(vectors.shape[0]):
                        _advance(fine, rate, c, spin, longest, length, vectors[i], term, image_)
                if best > 1.0:
                    break
                spread = 0.0
                for j in range(m):
                    if w.share[j] == best:
                        spread = max(spread, w.spread[j])
                for j in range(m):
                    close = min(spread + w.spread[j], _AT_ONCE * longest / left)
                    if w.share[j] > 1.0 or w.share[j] - best > close:
                        continue
                    before = w.contact[j]
                    speed = _cross(system, grid, w, j, p, vectors)
                    count += 1
                    if recording:
                        at = phase + length * system.tuning
                        row = found
                        if row == events.shape[0]:
                            larger = np.empty((2 * row, EVENT_COLUMNS))
                            larger[:row] = events
                            events = larger
                        events[row, orbit.EVENT_PERIOD] = 0.0
                        events[row, orbit.EVENT_PHASE] = at
                        events[row, orbit.EVENT_FROM] = before
                        events[row, orbit.EVENT_TO] = w.contact[j]
                        events[row, orbit.EVENT_VELOCITY] = speed / system.tuning
                        events[row, EVENT_MESH] = j
                        found += 1
                        if before == NORMAL:
                            summary[j, orbit.BOUNCES] += 1.0
                    if _closed(system, grid, w, j):
                        return JAMMED, events, found
                if count > limit:
                    return EVENT_LIMIT, events, found
                t += length
                c, on_line = -1, True
    return OK, events, found

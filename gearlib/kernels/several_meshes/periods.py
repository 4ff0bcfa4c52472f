"""Through mesh periods, substep by substep, with all events of all meshes.

A substep ends at the first event of any mesh. Crossings of several meshes within their rounding are
one event of them all: their saltation matrices commute, so that the order does not matter
(`docs/theory/trains.md`).
"""

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.arrays import copy
from gearlib.kernels.codes import BOTH, EVENT_LIMIT, JAMMED, NORMAL, OK, UNRESOLVED
from gearlib.kernels.jit import kernel
from gearlib.kernels.piecewise_linear.system import dot
from gearlib.kernels.several_meshes.combinations import (
    combination,
    multiply,
    whole_step,
)
from gearlib.kernels.several_meshes.record import sample, summarise
from gearlib.kernels.several_meshes.substeps import advance, first_events, look_ahead

#: Two crossings closer than this share of a substep are one whatever their speeds: near grazing
#: rounding would spread without bound what happens at once.
_AT_ONCE = 1e-13

#: Columns of the event table: those of `orbit` and the number of the mesh.
EVENT_MESH = orbit.EVENT_COLUMNS
EVENT_COLUMNS = orbit.EVENT_COLUMNS + 1


@kernel
def _cross(system, grid, w, j, p, vectors):
    """Let mesh j cross the flank line that it has come to; return dd_j/dtheta."""
    n = system.near.shape[1]
    z = w.z[:n]
    w.line[j] = 1 if NORMAL in (w.contact[j], w.target[j]) else -1
    speed = dot(grid.rate[j] if w.line[j] == 1 else grid.far_rate[j], z)
    old, new = system.effect[w.contact[j] + 1, p, j], system.effect[w.target[j] + 1, p, j]
    # A tangential crossing varies nothing: the force of the mesh does not jump.
    if vectors.shape[0] > 0 and speed != 0.0:
        jump = np.zeros(n)
        for k in range(2):
            more, less = dot(system.grip[j, new, k], z), dot(system.grip[j, old, k], z)
            for r in range(n):
                jump[r] += system.push[j, new, k, r] * more - system.push[j, old, k, r] * less
        for i in range(vectors.shape[0]):
            share = dot(system.near[j], vectors[i, :n]) / speed
            for r in range(n):
                vectors[i, r] += jump[r] * share
    w.rest[j] = 1
    w.contact[j] = w.target[j]
    return dot(grid.rate[j], z)


@kernel
def in_order(events, row, first):
    """Put the last event, in `row`, before those at its phase whose mesh has a higher number."""
    while (
        row > first
        and events[row - 1, orbit.EVENT_PHASE] == events[row, orbit.EVENT_PHASE]
        and events[row - 1, EVENT_MESH] > events[row, EVENT_MESH]
    ):
        for k in range(EVENT_COLUMNS):
            events[row - 1, k], events[row, k] = events[row, k], events[row - 1, k]
        row -= 1


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
    summary : ndarray, shape (m, 10)
        As of `orbit`, one row a mesh.
    samples : ndarray, shape (k, n + m + 1)
        At equal steps of the period, as of `record.sample`.
    events : ndarray, shape (k, 6)
        As of `orbit`, and the number of the mesh; the period is 0. Enlarged as needed; none are
        recorded if it has no rows. How many there are stands in `Work`.

    Returns
    -------
    status : int
    events
    """
    m, n = system.near.shape
    first, last = system.first_segment[number], system.first_segment[number + 1]
    rate, step, spin = tables.rate, tables.step, grid.spin
    z, own, term, image_, longest = w.z, w.z[:n], w.term, w.image, system.longest
    look_rows, tail_rows, apart = tables.look, tables.tail, grid.apart
    contact, look, tail, never, closing = w.contact, w.look, w.tail, grid.open, grid.closing
    count, taken, on_line = 0, 0, True
    opening, latest = w.found[0], 0.0
    for p in range(first, last):
        c, h = -1, grid.length[p]
        for index in range(grid.substeps[p]):
            t = 0.0
            while t < h:
                if c < 0:
                    for j in range(m):
                        w.effects[j] = system.effect[w.contact[j] + 1, p, j]
                    c = combination(system, tables, w.effects)
                left, best = h - t, 2.0
                quiet = look_ahead(
                    look_rows,
                    tail_rows,
                    apart,
                    c,
                    z,
                    contact,
                    never,
                    closing,
                    look,
                    tail,
                    term,
                    w.clear,
                )
                if on_line or not quiet:
                    best = first_events(system, grid, tables, c, w, left, to_bernstein)
                    w.rest[:] = 0
                    on_line = False
                if best < 0.0:
                    return UNRESOLVED, events
                length = left if best > 1.0 else best * left
                if recording:
                    phase = system.starts[p] - system.starts[first]
                    phase += (index * h + t) * system.tuning
                    summarise(system, grid, tables, c, w, p, length, summary, to_bernstein)
                    taken = sample(system, grid, tables, c, w, p, phase, length, samples, taken)
                if best > 1.0 and t == 0.0:
                    s = whole_step(tables, c, grid.kind[p], h)
                    multiply(step, s, z, term)
                    copy(term, own)
                    for i in range(vectors.shape[0]):
                        multiply(step, s, vectors[i], term)
                        copy(term, vectors[i, :n])
                else:
                    advance(rate, c, spin, longest, length, z, term, image_)
                    for i in range(vectors.shape[0]):
                        advance(rate, c, spin, longest, length, vectors[i], term, image_)
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
                    if w.target[j] == BOTH:
                        return JAMMED, events
                    before = w.contact[j]
                    speed = _cross(system, grid, w, j, p, vectors)
                    count += 1
                    if recording:
                        # Sums of parts of a substep may round below the phase of the last event.
                        row, latest = w.found[0], max(phase + length * system.tuning, latest)
                        v = speed / system.tuning
                        events, w.found[0] = orbit.note(
                            events, row, 0, latest, before, w.contact[j], v, summary[j]
                        )
                        if w.found[0] > row:
                            events[row, EVENT_MESH] = j
                            in_order(events, row, opening)
                if count > limit:
                    return EVENT_LIMIT, events
                t += length
                c, on_line = -1, True
    return OK, events

"""Through mesh periods, from event to event of all meshes.

Up to the next switch of a stiffness or the next crossing of a flank line by any mesh the modes of
the present combination turn and shrink. Crossings of several meshes within their rounding are one
event of them all: their saltation matrices commute, so that the order does not matter
(`docs/theory/trains.md`).
"""

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import BOTH, EVENT_LIMIT, JAMMED, NORMAL, OK, UNRESOLVED
from gearlib.kernels.jit import kernel
from gearlib.kernels.piecewise_linear.system import dot
from gearlib.kernels.several_meshes.distances import first_events, keeps_off, sizes_of
from gearlib.kernels.several_meshes.grid import COUNT, FOUND, OPENING, SEGMENT, TAKEN
from gearlib.kernels.several_meshes.modes import (
    advance,
    key_of,
    multiply,
    slot_of,
    turn_by,
    turn_over,
)
from gearlib.kernels.several_meshes.record import record

#: Two crossings closer than this share of a piece are one whatever their speeds: near
#: grazing rounding would spread without bound what happens at once.
_AT_ONCE = 1e-13
#: Rounding that the states of equal meshes have gathered, over that of one distance.
_GATHERED = 8.0
#: Returned where the tables lack a combination: that of the effects of `Work`. No status of a run.
MISSING = -1

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
def go(system, grid, tables, w, number, limit, vectors, recording, summary, samples, events):
    """Go through one mesh period from its start; the state of `Work` is changed in place.

    Parameters
    ----------
    system, grid, tables, w : TrainSystem, Grid, Modes, Work
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
        At equal steps of the period, as of `record.record`.
    events : ndarray, shape (k, 6)
        As of `orbit`, and the number of the mesh; the period is 0. Enlarged as needed; none are
        recorded if it has no rows. How many there are stands in `Work`.

    Returns
    -------
    status : int
        MISSING where the tables lack a combination: it goes on from there when called again.
    events
    """
    m, phase = system.near.shape[0], 0.0
    first, last = system.first_segment[number], system.first_segment[number + 1]
    if w.place[SEGMENT] < 0:
        w.place[SEGMENT], w.place[COUNT], w.place[OPENING] = first, 0, w.place[FOUND]
        w.place[TAKEN], w.ahead[0], w.ahead[1] = 0, grid.length[first], 0.0
    while w.place[SEGMENT] < last:
        p, c, left = w.place[SEGMENT], -1, w.ahead[0]
        while left > 0.0:
            if c < 0:
                for j in range(m):
                    w.effects[j] = system.effect[w.contact[j] + 1, p, j]
                c = tables.slots[slot_of(tables, key_of(system, w.effects))]
                if c < 0:
                    w.ahead[0] = left
                    return MISSING, events
                w.clear[:] = False
                piece = tables.piece[c]
                multiply(tables.into, c, w.z, w.y)
            modes, quiet = sizes_of(tables, c, w.y, w.sizes), True
            for j in range(m):
                if not w.clear[j]:
                    code = w.contact[j]
                    w.clear[j] = w.rest[j] == 0 and keeps_off(
                        tables,
                        c,
                        j,
                        code,
                        grid.closing[j],
                        grid.open[j],
                        grid.plain[j],
                        w.sizes,
                        modes,
                    )
                    quiet &= w.clear[j]
            length, best = left, 2.0
            if not quiet:
                length = min(piece, left)
                best = first_events(tables, c, grid, w, length / piece)
                w.rest[:] = 0
                if best < 0.0:
                    return UNRESOLVED, events
                if best <= 1.0:
                    length = best * piece
            if recording:
                phase = system.starts[p] - system.starts[first]
                phase += (grid.length[p] - left) * system.tuning
                record(system, grid, tables, c, w, p, phase, length, summary, samples)
            kind = grid.kind[p]
            if length == grid.length[p] and kind < tables.at.shape[1]:
                factors = tables.turns[turn_over(tables, c, kind, length)]
            else:
                turn_by(tables, c, length, w.factors)
                factors = w.factors
            advance(tables, c, factors, length, w.y, w.term, w.image)
            left -= length
            for i in range(vectors.shape[0]):
                multiply(tables.into, c, vectors[i], w.other)
                advance(tables, c, factors, length, w.other, w.term, w.image)
                multiply(tables.out, c, w.other, vectors[i])
            if best > 1.0 and left > 0.0:
                continue
            multiply(tables.out, c, w.y, w.z)
            if best > 1.0:
                break
            spread = 0.0
            for j in range(m):
                if w.share[j] == best:
                    spread = max(spread, w.spread[j])
            for j in range(m):
                close = min(_GATHERED * (spread + w.spread[j]), _AT_ONCE)
                if w.share[j] > 1.0 or w.share[j] - best > close:
                    continue
                if w.target[j] == BOTH:
                    return JAMMED, events
                before = w.contact[j]
                speed = _cross(system, grid, w, j, p, vectors)
                w.place[COUNT] += 1
                if recording:
                    # Sums of lengths may round below the phase of the last event.
                    row, v = w.place[FOUND], speed / system.tuning
                    w.ahead[1] = max(phase + length * system.tuning, w.ahead[1])
                    events, w.place[FOUND] = orbit.note(
                        events, row, 0, w.ahead[1], before, w.contact[j], v, summary[j]
                    )
                    if w.place[FOUND] > row:
                        events[row, EVENT_MESH] = j
                        in_order(events, row, w.place[OPENING])
            if w.place[COUNT] > limit:
                return EVENT_LIMIT, events
            c = -1
        w.place[SEGMENT] = p + 1
        if p + 1 < last:
            w.ahead[0] = grid.length[p + 1]
    w.place[SEGMENT] = -1
    return OK, events

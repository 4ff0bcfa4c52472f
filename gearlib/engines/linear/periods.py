"""Through mesh periods, from event to event of all meshes.

Up to the next switch of a stiffness or the next crossing of a flank line by any mesh the modes of
the present combination turn and shrink. Crossings of several meshes within their rounding are one
event of them all: their saltation matrices commute, so that the order does not matter
(`docs/theory/trains.md`).
"""

from gearlib.engines import orbit
from gearlib.engines.codes import BOTH, EVENT_LIMIT, JAMMED, NORMAL, OK, UNRESOLVED
from gearlib.engines.jit import uncounted, woven
from gearlib.engines.linear.distances import first_events, keeps_off, sizes_of
from gearlib.engines.linear.grid import COUNT, FOUND, OPENING, SEGMENT, TAKEN
from gearlib.engines.linear.modal_arcs import advance, multiply, slot_of, turn_by, turn_over
from gearlib.engines.linear.record import record
from gearlib.engines.linear.sparse_series import (
    SERIES,
    expand,
    fill_distances_of,
    go_by_series,
    sum_of,
)
from gearlib.engines.linear.train_system import dot

#: Two crossings closer than this share of a piece are one whatever their speeds: near
#: grazing rounding would spread without bound what happens at once.
_AT_ONCE = 1e-13
#: Rounding that the states of equal meshes have gathered, over that of one distance.
_GATHERED = 8.0
#: Returned where the tables lack a combination, that of the effects of `Work`, and where there is
#: no place for more events, or segments end. No status of a run.
MISSING, FULL, BEYOND = -1, -2, -3

#: Columns of the event table: those of `orbit` and the number of the mesh.
EVENT_MESH = orbit.EVENT_COLUMNS
EVENT_COLUMNS = orbit.EVENT_COLUMNS + 1


@woven
def _cross(system, grid, w, j, p, vectors):
    """Let mesh j cross the flank line that it has come to, with the `vectors` of deviations."""
    n, line = system.near.shape[1], 1 if NORMAL in (w.contact[j], w.target[j]) else -1
    w.line[j] = line
    if vectors.shape[0] > 0:
        rate = grid.rate if line == 1 else grid.far_rate
        row = system.near if line == 1 else system.far
        speed = 0.0
        for r in range(n):
            speed += rate[j, r] * w.z[r]
        old, new = system.effect[w.contact[j] + 1, p, j], system.effect[w.target[j] + 1, p, j]
        for r in range(n):
            w.term[r] = 0.0
        for k in range(2):
            more, less = 0.0, 0.0
            for r in range(n):
                more += system.grip[j, new, k, r] * w.z[r]
                less += system.grip[j, old, k, r] * w.z[r]
            for r in range(n):
                w.term[r] += system.push[j, new, k, r] * more - system.push[j, old, k, r] * less
        # A tangential crossing varies nothing: the force of the mesh does not jump.
        for i in range(vectors.shape[0] if speed != 0.0 else 0):
            share = 0.0
            for r in range(n):
                share += row[j, r] * vectors[i, r]
            share /= speed
            for r in range(n):
                vectors[i, r] += w.term[r] * share
    w.rest[j] = 1
    w.contact[j] = w.target[j]


@uncounted
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


@woven
def go(system, grid, tables, w, number, limit, vectors, recording, summary, samples, events):
    """Go through one mesh period from its start; the state of `Work` is changed in place.

    The excitation repeats after several, of which this is the one with this `number`. `vectors`,
    shape (k, n filled up), are small deviations that change in place. Only if `recording`, summary,
    shape (m, 10), samples as of `record.record`, and events, shape (k, 6), are filled; no events if
    that has no rows. The status is MISSING where the tables lack a combination, FULL where events
    have no place: it goes on from there when called again.
    """
    (m, n), phase, piece = system.near.shape, 0.0, 0.0
    first, last = system.first_segment[number], system.first_segment[number + 1]
    if w.place[SEGMENT] < 0:
        w.place[SEGMENT], w.place[COUNT], w.place[OPENING] = first, 0, w.place[FOUND]
        w.place[TAKEN], w.ahead[0], w.ahead[1] = 0, grid.length[first], 0.0
        if grid.taken.shape[0] == 0:
            orbit.equal_steps(samples, n + m, system.starts[last] - system.starts[first])
    while w.place[SEGMENT] < last:
        p, c, left = w.place[SEGMENT], -1, w.ahead[0]
        while left > 0.0:
            if c < 0:
                for j in range(m):
                    w.effects[j] = system.effect[w.contact[j] + 1, p, j]
                    w.clear[j] = False
                slot = slot_of(tables.slots, tables.keys, w.effects)
                c = tables.slots[slot]
                if c < 0 and tables.steps[slot] < tables.price[0]:
                    c = SERIES
                full = recording and 0 < events.shape[0] < w.place[FOUND] + m
                if c == -1 or full:
                    w.ahead[0] = left
                    return MISSING if c == -1 else FULL
                if c == SERIES:
                    tables.steps[slot] += 1 + vectors.shape[0]
                    piece = expand(system, grid, w.effects, w.z, w.terms)
                    fill_distances_of(system, grid, w.terms, w.distances)
                else:
                    piece = tables.piece[c]
                    multiply(tables.into, c, w.z, w.y)
            modes, quiet = 0 if c == SERIES else sizes_of(tables, c, w.y, w.sizes), True
            for j in range(m):
                if not w.clear[j]:
                    w.clear[j] = w.rest[j] == 0 and keeps_off(tables, c, j, grid, w, modes)
                    quiet &= w.clear[j]
            length, best = min(piece, left) if c == SERIES or not quiet else left, 2.0
            if not quiet:
                best = first_events(tables, c, grid, w, length / piece)
                for j in range(m):
                    w.rest[j] = 0
                if best < 0.0:
                    return UNRESOLVED
                if best <= 1.0:
                    length = best * piece
            if recording:
                phase = system.starts[p] - system.starts[first]
                phase += (grid.length[p] - left) * system.tuning
                record(system, grid, tables, c, w, p, phase, length, piece, summary, samples)
            left -= length
            if c == SERIES:
                sum_of(w.terms, n, length / piece, w.z)
                for i in range(vectors.shape[0]):
                    go_by_series(system, grid, w.effects, length, vectors[i], w.terms)
                if best > 1.0 and left > 0.0:
                    # Modes may pay by now.
                    c = -1
                    continue
            else:
                kind, factors = grid.kind[p], w.factors
                if length == grid.length[p] and 0 <= kind < tables.at.shape[1]:
                    factors = tables.turns[turn_over(tables, c, kind, length)]
                else:
                    turn_by(tables, c, length, factors)
                advance(tables, c, factors, length, w.y, w.term, w.image)
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
                    return JAMMED
                before = w.contact[j]
                _cross(system, grid, w, j, p, vectors)
                w.place[COUNT] += 1
                if recording:
                    if before == NORMAL:
                        summary[j, orbit.BOUNCES] += 1.0
                    if events.shape[0] > 0:
                        v = dot(grid.rate[j], w.z[: grid.rate.shape[1]]) / system.tuning
                        # Sums of lengths may round below the phase of the last event.
                        w.ahead[1] = max(phase + length * system.tuning, w.ahead[1])
                        row = w.place[FOUND]
                        events[row, orbit.EVENT_PERIOD] = 0.0
                        events[row, orbit.EVENT_PHASE] = w.ahead[1]
                        events[row, orbit.EVENT_FROM] = before
                        events[row, orbit.EVENT_TO] = w.contact[j]
                        events[row, orbit.EVENT_VELOCITY] = v
                        events[row, EVENT_MESH] = j
                        w.place[FOUND] = row + 1
                        in_order(events, row, w.place[OPENING])
            if w.place[COUNT] > limit:
                return EVENT_LIMIT
            c = -1
        w.place[SEGMENT] = p + 1
        if p + 1 < last:
            w.ahead[0] = grid.length[p + 1]
    w.place[SEGMENT] = -1
    return OK

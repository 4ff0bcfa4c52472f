"""Whole mesh periods, segment by segment, without exp, sine or cosine.

The orbit is that of `events`, with shortcuts that are proven:

* A whole segment in contact is one 2 x 2 map when no flank line can be reached: when the amplitude
  is below the equilibrium deflection, or when the velocities at both ends and the length of the
  segment leave room for no minimum in between.
* From a landing to the end of the segment, or to where contact is lost, by `contact_table`.
* A flight from x = 0 that cannot reach the far flank returns once: by `flight.return_flight`.

All other cases use the closed forms, or `events`.
"""

from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.orbit import STROBE_PERIODS
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.contact_table import (
    BOUND,
    EMPTY,
    END_S,
    END_X,
    ENTRIES,
    EQUILIBRIUM,
    LAST,
    LENGTH,
    LEVEL_COLUMNS,
    MARGIN,
    PER_TIME,
    SPACING,
    SQUARE,
    TURN,
    TWICE_A,
    WITHIN_HALF,
    WITHIN_TURN,
    fill_table,
    go_by,
    leaving,
    lowest_entry,
    set_level,
    stays,
    stays_above,
    step,
)
from gearlib.engines.pair.events import descent_time, march_on
from gearlib.engines.pair.motion import evolve, fly, return_flight

#: States at the ends of the last periods, more than `orbit.orbit_period` asks for.
KEPT = STROBE_PERIODS + 1
# What is remembered from one call to the next. Of a flight under way: how much of it lies ahead
# (negative: there is none), its duration, its speeds at the start and at the landing; and the
# entries of the tables at which the flank was left last in the three segments of a period.
AHEAD, DURATION, START_SPEED, LANDING_SPEED, ENTRY = range(5)
MEMORY = ENTRY + 3
#: Contact code, within `advance` only, of such a flight.
_FLYING = 2


class Work(NamedTuple):
    """Tables and memory of the whole periods of one mesh; used again for the next mesh."""

    levels: np.ndarray  #: rows of `contact_table` for C_min and half a segment of C_max
    tables: np.ndarray  #: shape (2, ENTRIES, 2)
    memory: np.ndarray  #: shape (MEMORY,)
    states: np.ndarray  #: at the end of period n in row n % KEPT, shape (KEPT, 2)


@kernel
def new_work():
    """Return `Work` for `set_mesh`."""
    return Work(
        np.zeros((2, LEVEL_COLUMNS)),
        np.zeros((2, ENTRIES, 2)),
        np.zeros(MEMORY),
        np.zeros((KEPT, 2)),
    )


@kernel
def set_mesh(work, m):
    """Prepare `work` for the runs of a mesh."""
    set_level(m.low, m.whole_low, work.levels[0])
    set_level(m.high, m.half_high, work.levels[1])


@kernel
def set_start(work, x, v):
    """Prepare `work` for a run from (x, v): results must not depend on the run before."""
    work.memory[AHEAD] = -1.0
    work.memory[ENTRY:] = 0.0
    work.states[0, 0], work.states[0, 1] = x, v


@inlined
def _write(arcs, count, start, duration, contact, level, x, v):
    """Write row `count` of the arc table, if there is one; return the rows so far."""
    if count < arcs.shape[0]:
        arcs[count, 0], arcs[count, 1], arcs[count, 2] = start, duration, contact
        arcs[count, 3], arcs[count, 4], arcs[count, 5] = level, x, v
    return count + 1


@kernel
def advance(m, work, n, contact, x, v, periods, limit, arcs):
    """Go through mesh periods n, n + 1 ... from tau = 2 pi n; return (contact, x, v, count).

    `work` is of that mesh and carries a flight from one call to the next. `arcs`, shape (k, 6), is
    filled with the arcs of the last period, k = 0 for none; `count` is their number, more than
    `limit` when that did not suffice. The state may be out of range, see `within_range`.
    """
    levels, tables, memory, states = work
    escape = 2.0 * m.pull * m.gap * MARGIN
    count = np.int64(0)
    end_u = end_v = 0.0
    ahead, duration = memory[AHEAD], memory[DURATION]
    start_speed, landing_speed = memory[START_SPEED], memory[LANDING_SPEED]
    if ahead >= 0.0:
        contact = _FLYING
    for period in range(n, n + periods):
        if not within_range(x, v):
            break
        count = 0
        start = 0.0
        for segment in range(3):
            i = 1 - (segment & 1)
            length, equilibrium = levels[i, LENGTH], levels[i, EQUILIBRIUM]
            if segment > 0:
                start += levels[2 - segment, LENGTH]
            if length == 0.0:
                continue
            t, landed = 0.0, False
            if contact == _FLYING:
                if arcs.shape[0] > 0 and ahead > 0.0:
                    x, v = fly(m.drag, m.pull, 0.0, start_speed, duration - ahead)
                    count = _write(arcs, count, start, min(ahead, length), BACKLASH, i, x, v)
                if ahead >= length:
                    ahead -= length
                    continue
                contact = NORMAL
                t, u, v, landed = ahead, -equilibrium, landing_speed, True
            elif contact == NORMAL:
                u = x - equilibrium
                end_u, end_v = go_by(levels, i, u, v, levels[i, END_X], levels[i, END_S])
                half, turn = levels[i, WITHIN_HALF] > 0.0, levels[i, WITHIN_TURN] > 0.0
                if (
                    stays(half, turn, v, end_u + equilibrium, end_v)
                    or levels[i, SQUARE] * u * u + v * (v + levels[i, TWICE_A] * u)
                    < levels[i, BOUND]
                ):
                    count = _write(arcs, count, start, length, NORMAL, i, x, v)
                    x, v = end_u + equilibrium, end_v
                    continue
            else:
                t, contact, x, v, count = march_on(
                    m, i, start, t, length, contact, x, v, arcs, count, limit, True
                )
                if t >= length or count > limit:
                    continue
                u, landed = -equilibrium, True

            # Contact, flight, landing, contact ... until a segment ends in contact or in flight.
            lev = m.high if i == 1 else m.low
            if levels[i, LAST] == EMPTY:
                fill_table(lev, levels[i], tables[i])
            while True:
                left = length - t
                known = not landed
                count = _write(arcs, count, start + t, left, NORMAL, i, u + equilibrium, v)
                if landed:
                    k = int(left * levels[i, PER_TIME] + 0.5)
                    known = k <= levels[i, LAST]
                    if known:
                        end_u, end_v = go_by(levels, i, u, v, tables[i, k, 0], tables[i, k, 1])
                        end_u, end_v = step(levels, i, end_u, end_v, left - k * levels[i, SPACING])
                        half, turn = 2.0 * left < levels[i, TURN], left < levels[i, TURN]
                        if stays(half, turn, v, end_u + equilibrium, end_v):
                            x, v = end_u + equilibrium, end_v
                            break
                k = int(memory[ENTRY + segment])
                leave, speed, k = leaving(levels, tables, i, u, v, k, left)
                if leave < 0.0 and levels[i, LAST] > 0.0:
                    k, below = lowest_entry(levels, tables, i, u, v)
                    if below:
                        leave, speed, k = leaving(levels, tables, i, u, v, k, left)
                    elif known and stays_above(levels, tables, i, u, v, k):
                        x, v = end_u + equilibrium, end_v
                        break
                if leave < 0.0:
                    leave = descent_time(lev, u, v, -equilibrium, left)
                    if leave <= left:
                        _, speed = evolve(lev, u, v, leave)
                    if not (leave <= left and speed < 0.0):
                        x, v = evolve(lev, u, v, left)
                        x += equilibrium
                        break
                    k = int(leave * levels[i, PER_TIME] + 0.5)
                memory[ENTRY + segment] = k
                if count <= arcs.shape[0]:
                    arcs[count - 1, 1] = leave
                if speed * speed >= escape:
                    # The far flank may be met: event by event to the next landing.
                    flying = BACKLASH if m.gap > 0.0 else INVERSE
                    t, contact, x, v, count = march_on(
                        m, i, start, t + leave, length, flying, 0.0, speed, arcs, count, limit, True
                    )
                    if t >= length or count > limit:
                        break
                    u, landed = -equilibrium, True
                    continue
                duration, landing_speed = return_flight(m.drag, m.pull, speed)
                t += leave
                count = _write(
                    arcs, count, start + t, min(duration, length - t), BACKLASH, i, 0.0, speed
                )
                t += duration
                if t >= length:
                    contact, ahead, start_speed = _FLYING, t - length, speed
                    break
                if count > limit:
                    break
                u, v, landed = -equilibrium, landing_speed, True
            if count > limit:
                break
        if contact == _FLYING:
            if ahead > 0.0:
                x, v = fly(m.drag, m.pull, 0.0, start_speed, duration - ahead)
            else:
                contact, x, v = NORMAL, 0.0, landing_speed
        if count > limit:
            break
        row = (period + 1) % KEPT
        states[row, 0], states[row, 1] = x, v
    memory[AHEAD] = ahead if contact == _FLYING else -1.0
    memory[DURATION] = duration
    memory[START_SPEED], memory[LANDING_SPEED] = start_speed, landing_speed
    return (BACKLASH if contact == _FLYING else contact), x, v, count

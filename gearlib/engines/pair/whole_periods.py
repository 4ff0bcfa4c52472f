"""Fast run through whole mesh periods, segment by segment, without exp, sine or cosine.

The orbit is that of `events`, with shortcuts that are proven to be exact:

* A whole segment in contact is a 2 x 2 map if no flank line can be reached: if the amplitude is
  below the static deflection, or if the velocities at both ends and the length of the segment
  exclude a minimum in between.
* `contact_table` gives the motion from a landing to the loss of contact or the end of the segment.
* `motion.return_flight` gives the landing of a flight from x = 0 that cannot reach the far flank.

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
    first_loss_of_contact,
    first_minimum_is_above,
    lowest_entry,
    move_by,
    provably_stays,
    set_level,
    step_by_series,
)
from gearlib.engines.pair.events import descent_time, march_on
from gearlib.engines.pair.motion import evolve, fly, return_flight

#: Number of last periods whose states are stored, one more than `orbit.orbit_period` compares.
STORED_PERIODS = STROBE_PERIODS + 1
# Entries of `Work.memory`, which carries a flight from one call to the next: its remaining time
# (negative: there is no flight), its duration, its speeds at the start and at the landing; then the
# table entries of the last loss of contact in the three segments of a period.
REMAINING, DURATION, START_SPEED, LANDING_SPEED, ENTRY = range(5)
MEMORY = ENTRY + 3
#: Contact code of a flight from x = 0 that returns to it, used within `advance` only.
_FLYING = 2


class Work(NamedTuple):
    """Storage of runs through whole periods, used again for the next mesh."""

    levels: np.ndarray  #: rows of `contact_table` for C_min and half a segment of C_max
    tables: np.ndarray  #: shape (2, ENTRIES, 2)
    memory: np.ndarray  #: shape (MEMORY,)
    states: np.ndarray  #: at the end of period n in row n % STORED_PERIODS, (STORED_PERIODS, 2)


@kernel
def new_work():
    """Return empty storage for runs through whole periods, to be prepared by `set_mesh`."""
    return Work(
        np.zeros((2, LEVEL_COLUMNS)),
        np.zeros((2, ENTRIES, 2)),
        np.zeros(MEMORY),
        np.zeros((STORED_PERIODS, 2)),
    )


@kernel
def set_mesh(work, mesh):
    """Prepare storage `work` for runs of a `Mesh`: set the constants of its stiffness levels."""
    set_level(mesh.low, mesh.whole_low, work.levels[0])
    set_level(mesh.high, mesh.half_high, work.levels[1])


@kernel
def set_start(work, x, v):
    """Prepare storage `work` for a new run from displacement x and velocity v at tau = 0."""
    work.memory[REMAINING] = -1.0
    work.memory[ENTRY:] = 0.0
    work.states[0, 0], work.states[0, 1] = x, v


@inlined
def _write(arcs, count, start, duration, contact, level, x, v):
    """Write an arc to row `count` of the arc table, if it has this row; return `count` + 1.

    The arc has a `start` phase, `duration`, contact code, stiffness level (0 C_min, 1 C_max) and
    starts with displacement x and velocity v.
    """
    if count < arcs.shape[0]:
        arcs[count, 0], arcs[count, 1], arcs[count, 2] = start, duration, contact
        arcs[count, 3], arcs[count, 4], arcs[count, 5] = level, x, v
    return count + 1


@kernel
def advance(mesh, work, n, contact, x, v, periods, limit, arcs):
    """Run through `periods` mesh periods of a `Mesh` from tau = 2 pi n.

    The motion starts with a contact code, displacement x and velocity v. `work` is storage prepared
    for the mesh; it keeps a flight from one call to the next. `arcs`, shape (k, 6), receives the
    arcs of the last period; k may be 0. Returns (contact code, x, v, count) at the end, which may
    be out of range; `count` is the number of arcs of the last period, above `limit` after an abort.
    """
    levels, tables, memory, states = work
    escape_square = 2.0 * mesh.load * mesh.gap * MARGIN
    count = np.int64(0)
    end_u = end_v = 0.0
    flight_remaining, duration = memory[REMAINING], memory[DURATION]
    start_speed, landing_speed = memory[START_SPEED], memory[LANDING_SPEED]
    if flight_remaining >= 0.0:
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
                if arcs.shape[0] > 0 and flight_remaining > 0.0:
                    x, v = fly(mesh.drag, mesh.load, 0.0, start_speed, duration - flight_remaining)
                    count = _write(
                        arcs, count, start, min(flight_remaining, length), BACKLASH, i, x, v
                    )
                if flight_remaining >= length:
                    flight_remaining -= length
                    continue
                contact = NORMAL
                t, u, v, landed = flight_remaining, -equilibrium, landing_speed, True
            elif contact == NORMAL:
                u = x - equilibrium
                end_u, end_v = move_by(levels, i, u, v, levels[i, END_X], levels[i, END_S])
                half = levels[i, WITHIN_HALF] > 0.0
                turn = levels[i, WITHIN_TURN] > 0.0
                if (
                    provably_stays(half, turn, v, end_u + equilibrium, end_v)
                    or levels[i, SQUARE] * u * u + v * (v + levels[i, TWICE_A] * u)
                    < levels[i, BOUND]
                ):
                    count = _write(arcs, count, start, length, NORMAL, i, x, v)
                    x, v = end_u + equilibrium, end_v
                    continue
            else:
                t, contact, x, v, count = march_on(
                    mesh, i, start, t, length, contact, x, v, arcs, count, limit, True
                )
                if t >= length or count > limit:
                    continue
                u, landed = -equilibrium, True

            # Contact and flight alternate until the segment ends.
            level = mesh.high if i == 1 else mesh.low
            if levels[i, LAST] == EMPTY:
                fill_table(level, levels[i], tables[i])
            while True:
                remaining = length - t
                end_is_known = not landed
                count = _write(arcs, count, start + t, remaining, NORMAL, i, u + equilibrium, v)
                if landed:
                    k = int(remaining * levels[i, PER_TIME] + 0.5)
                    end_is_known = k <= levels[i, LAST]
                    if end_is_known:
                        end_u, end_v = move_by(levels, i, u, v, tables[i, k, 0], tables[i, k, 1])
                        end_u, end_v = step_by_series(
                            levels, i, end_u, end_v, remaining - k * levels[i, SPACING]
                        )
                        half = 2.0 * remaining < levels[i, TURN]
                        turn = remaining < levels[i, TURN]
                        if provably_stays(half, turn, v, end_u + equilibrium, end_v):
                            x, v = end_u + equilibrium, end_v
                            break
                k = int(memory[ENTRY + segment])
                loss_time, speed, k = first_loss_of_contact(levels, tables, i, u, v, k, remaining)
                if loss_time < 0.0 and levels[i, LAST] > 0.0:
                    k, below = lowest_entry(levels, tables, i, u, v)
                    if below:
                        loss_time, speed, k = first_loss_of_contact(
                            levels, tables, i, u, v, k, remaining
                        )
                    elif end_is_known and first_minimum_is_above(levels, tables, i, u, v, k):
                        x, v = end_u + equilibrium, end_v
                        break
                if loss_time < 0.0:
                    loss_time = descent_time(level, u, v, -equilibrium, remaining)
                    if loss_time <= remaining:
                        _, speed = evolve(level, u, v, loss_time)
                    if not (loss_time <= remaining and speed < 0.0):
                        x, v = evolve(level, u, v, remaining)
                        x += equilibrium
                        break
                    k = int(loss_time * levels[i, PER_TIME] + 0.5)
                memory[ENTRY + segment] = k
                if count <= arcs.shape[0]:
                    arcs[count - 1, 1] = loss_time
                if speed * speed >= escape_square:
                    # The far flank may be reached: march event by event to the next landing.
                    t += loss_time
                    flying = BACKLASH if mesh.gap > 0.0 else INVERSE
                    t, contact, x, v, count = march_on(
                        mesh, i, start, t, length, flying, 0.0, speed, arcs, count, limit, True
                    )
                    if t >= length or count > limit:
                        break
                    u, landed = -equilibrium, True
                    continue
                duration, landing_speed = return_flight(mesh.drag, mesh.load, speed)
                t += loss_time
                count = _write(
                    arcs, count, start + t, min(duration, length - t), BACKLASH, i, 0.0, speed
                )
                t += duration
                if t >= length:
                    contact, flight_remaining, start_speed = _FLYING, t - length, speed
                    break
                if count > limit:
                    break
                u, v, landed = -equilibrium, landing_speed, True
            if count > limit:
                break
        if contact == _FLYING:
            if flight_remaining > 0.0:
                x, v = fly(mesh.drag, mesh.load, 0.0, start_speed, duration - flight_remaining)
            else:
                contact, x, v = NORMAL, 0.0, landing_speed
        if count > limit:
            break
        row = (period + 1) % STORED_PERIODS
        states[row, 0], states[row, 1] = x, v
    memory[REMAINING] = flight_remaining if contact == _FLYING else -1.0
    memory[DURATION] = duration
    memory[START_SPEED], memory[LANDING_SPEED] = start_speed, landing_speed
    return (BACKLASH if contact == _FLYING else contact), x, v, count

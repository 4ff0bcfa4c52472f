"""Fast run through whole mesh periods, segment by segment, without exp, sine or cosine.

The motion is the same as in `events`. Shortcuts that are proven to be exact make it faster:

* A whole segment in contact is a 2 x 2 map if no flank line can be reached: if the amplitude is
  below the static deflection, or if the velocities at both ends and the length of the segment
  exclude a minimum in between.
* `contact_table` gives the motion from an impact to the loss of contact or the end of the segment.
* `motion.return_flight` gives the impact after a free flight from x = 0 that misses the coast side.

All other cases use the closed forms or `events`.
"""

from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel_part
from gearlib.engines.orbit import STROBE_PERIODS, is_within_range
from gearlib.engines.pair import contact_table as table
from gearlib.engines.pair import events
from gearlib.engines.pair.events import descent_time, march_rest_of_segment
from gearlib.engines.pair.motion import evolve, free_flight, return_flight

#: Number of mesh periods whose final states are stored; `orbit.orbit_period` compares one fewer.
STORED_PERIODS = STROBE_PERIODS + 1
# Entries of `Workspace.memory`, which carries a free flight from one call to the next: remaining
# time (negative if there is no flight), duration, and velocities at the start and at the impact,
# followed by the table entry of the previous loss of contact in each of the three segments.
REMAINING, FLIGHT_DURATION, START_SPEED, IMPACT_SPEED, LOSS_ENTRIES = range(5)
_MEMORY_SIZE = LOSS_ENTRIES + 3
#: Contact state during a free flight from x = 0 back to x = 0, used in `advance_periods` only.
_RETURN_FLIGHT = 2


class Workspace(NamedTuple):
    """Workspace of runs through whole mesh periods, which is reused at other tunings."""

    levels: np.ndarray  #: rows of level constants for C_min and for half a C_max segment
    tables: np.ndarray  #: tables of `contact_table` for both levels, shape (2, ENTRIES, 2)
    memory: np.ndarray  #: entries REMAINING to LOSS_ENTRIES + 2
    states: np.ndarray  #: state at the end of period n in row n % STORED_PERIODS


def allocate_workspace():
    """Return an empty `Workspace`, to be prepared by `prepare_workspace`."""
    levels, tables = np.zeros((2, table.LEVEL_COLUMNS)), np.zeros((2, table.ENTRIES, 2))
    return Workspace(levels, tables, np.zeros(_MEMORY_SIZE), np.zeros((STORED_PERIODS, 2)))


@kernel_part
def prepare_workspace(workspace, pair):
    """Set the constants of both stiffness levels of a gear pair in a `Workspace`.

    `pair` holds the `PairConstants`. The tables of both levels are marked as not filled.
    """
    table.fill_level_constants(pair.low_level, pair.low_length, workspace.levels[0])
    table.fill_level_constants(pair.high_level, pair.half_high_length, workspace.levels[1])


@kernel_part
def prepare_run(workspace, x, v):
    """Prepare a `Workspace` for a run from displacement x and velocity v at mesh phase 0."""
    workspace.memory[REMAINING] = -1.0  # No free flight is in progress.
    # Each segment of a period has its own table entry from which a loss of contact is searched.
    workspace.memory[LOSS_ENTRIES:] = 0.0
    workspace.states[0, 0], workspace.states[0, 1] = x, v


@kernel_part(inlined=True)
def _append_arc(arcs, row, start, duration, contact, level, x, v):
    """Write an arc, the motion between two events, to a row of the arc table; return the next row.

    The arc has a `start` phase, a `duration`, a contact state (1 drive side, 0 none, -1 coast side)
    and a stiffness level (0 C_min, 1 C_max); it starts with displacement x and velocity v. If the
    table does not have the row, the arc is only counted.
    """
    if row < arcs.shape[0]:
        arcs[row, events.START], arcs[row, events.DURATION] = start, duration
        arcs[row, events.CONTACT], arcs[row, events.LEVEL] = contact, level
        arcs[row, events.DISPLACEMENT], arcs[row, events.VELOCITY] = x, v
    return row + 1


@kernel_part
def advance_periods(pair, workspace, n, contact, x, v, periods, max_arcs, arcs):
    """Run a gear pair through a number of mesh `periods` from tau = 2 pi n.

    `pair` holds the `PairConstants`, and `workspace` has been prepared for them; it also carries a
    free flight from one call to the next. The motion starts with the contact state `contact`,
    displacement x and velocity v. `arcs`, shape (k, 6), is filled with the arcs of the last period;
    k may be 0. Returns (contact state, x, v, arc count) at the end, where x and v may be out of
    range. If a period needs more than `max_arcs` arcs, the run is aborted, and the arc count
    exceeds `max_arcs`.
    """
    levels, tables, memory, states = workspace
    max_return_energy = 2.0 * pair.load * pair.backlash_ratio * table.ROUNDING_MARGIN
    count = 0
    end_u = end_v = 0.0
    flight_remaining, duration = memory[REMAINING], memory[FLIGHT_DURATION]
    start_speed, impact_speed = memory[START_SPEED], memory[IMPACT_SPEED]
    if flight_remaining >= 0.0:
        contact = _RETURN_FLIGHT
    for period in range(n, n + periods):
        if not is_within_range(x, v):
            break
        count = 0
        start = 0.0
        for segment in range(3):
            i = 1 - (segment & 1)
            length, equilibrium = levels[i, table.SEGMENT_LENGTH], levels[i, table.EQUILIBRIUM]
            if segment > 0:
                start += levels[2 - segment, table.SEGMENT_LENGTH]
            if length == 0.0:
                continue
            t, starts_on_line = 0.0, False
            if contact == _RETURN_FLIGHT:
                if arcs.shape[0] > 0 and flight_remaining > 0.0:
                    x, v = free_flight(
                        pair.drag, pair.load, 0.0, start_speed, duration - flight_remaining
                    )
                    count = _append_arc(
                        arcs, count, start, min(flight_remaining, length), NO_CONTACT, i, x, v
                    )
                if flight_remaining >= length:
                    flight_remaining -= length
                    continue
                contact = DRIVE
                t, u, v, starts_on_line = flight_remaining, -equilibrium, impact_speed, True
            elif contact == DRIVE:
                u = x - equilibrium
                end_u, end_v = table.advance_by_responses(
                    levels, i, u, v, levels[i, table.END_X], levels[i, table.END_S]
                )
                is_half_cycle = levels[i, table.WITHIN_HALF_CYCLE] > 0.0
                is_cycle = levels[i, table.WITHIN_CYCLE] > 0.0
                if (
                    table.provably_stays_in_contact(
                        is_half_cycle, is_cycle, v, end_u + equilibrium, end_v
                    )
                    or levels[i, table.STIFFNESS] * u * u + v * (v + levels[i, table.DAMPING] * u)
                    < levels[i, table.MAX_ENERGY]
                ):
                    count = _append_arc(arcs, count, start, length, DRIVE, i, x, v)
                    x, v = end_u + equilibrium, end_v
                    continue
            else:
                t, contact, x, v, count = march_rest_of_segment(
                    pair, i, start, t, length, contact, x, v, arcs, count, max_arcs, True
                )
                if t >= length or count > max_arcs:
                    continue
                u, starts_on_line = -equilibrium, True

            # Contact and flight alternate until the segment ends.
            level = pair.high_level if i == 1 else pair.low_level
            if levels[i, table.LAST_ENTRY] == table.UNFILLED:
                table.fill_table(level, levels[i], tables[i])
            while True:
                remaining = length - t
                end_is_known = not starts_on_line
                count = _append_arc(arcs, count, start + t, remaining, DRIVE, i, u + equilibrium, v)
                if starts_on_line:
                    k = int(remaining * levels[i, table.ENTRIES_PER_TIME] + 0.5)
                    end_is_known = k <= levels[i, table.LAST_ENTRY]
                    if end_is_known:
                        end_u, end_v = table.advance_by_responses(
                            levels, i, u, v, tables[i, k, 0], tables[i, k, 1]
                        )
                        end_u, end_v = table.advance_by_series(
                            levels, i, end_u, end_v, remaining - k * levels[i, table.SPACING]
                        )
                        is_half_cycle = 2.0 * remaining < levels[i, table.CYCLE_TIME]
                        is_cycle = remaining < levels[i, table.CYCLE_TIME]
                        if table.provably_stays_in_contact(
                            is_half_cycle, is_cycle, v, end_u + equilibrium, end_v
                        ):
                            x, v = end_u + equilibrium, end_v
                            break
                k = int(memory[LOSS_ENTRIES + segment])
                loss_time, speed, k = table.first_loss_of_contact(
                    levels, tables, i, u, v, k, remaining
                )
                if loss_time < 0.0 and levels[i, table.LAST_ENTRY] > 0.0:
                    k, is_below = table.lowest_entry(levels, tables, i, u, v)
                    if is_below:
                        loss_time, speed, k = table.first_loss_of_contact(
                            levels, tables, i, u, v, k, remaining
                        )
                    elif end_is_known and table.first_minimum_is_above(levels, tables, i, u, v, k):
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
                    k = int(loss_time * levels[i, table.ENTRIES_PER_TIME] + 0.5)
                memory[LOSS_ENTRIES + segment] = k
                if count <= arcs.shape[0]:
                    arcs[count - 1, events.DURATION] = loss_time
                if speed * speed >= max_return_energy:
                    # The coast-side flank may be reached: march event by event to the next impact.
                    t += loss_time
                    flight_contact = NO_CONTACT if pair.backlash_ratio > 0.0 else COAST
                    x, v = 0.0, speed
                    t, contact, x, v, count = march_rest_of_segment(
                        pair, i, start, t, length, flight_contact, x, v, arcs, count, max_arcs, True
                    )
                    if t >= length or count > max_arcs:
                        break
                    u, starts_on_line = -equilibrium, True
                    continue
                duration, impact_speed = return_flight(pair.drag, pair.load, speed)
                t += loss_time
                count = _append_arc(
                    arcs, count, start + t, min(duration, length - t), NO_CONTACT, i, 0.0, speed
                )
                t += duration
                if t >= length:
                    contact, flight_remaining, start_speed = _RETURN_FLIGHT, t - length, speed
                    break
                if count > max_arcs:
                    break
                u, v, starts_on_line = -equilibrium, impact_speed, True
            if count > max_arcs:
                break
        if contact == _RETURN_FLIGHT:
            if flight_remaining > 0.0:
                x, v = free_flight(
                    pair.drag, pair.load, 0.0, start_speed, duration - flight_remaining
                )
            else:
                contact, x, v = DRIVE, 0.0, impact_speed
        if count > max_arcs:
            break
        row = (period + 1) % STORED_PERIODS
        states[row, 0], states[row, 1] = x, v
    memory[REMAINING] = flight_remaining if contact == _RETURN_FLIGHT else -1.0
    memory[FLIGHT_DURATION] = duration
    memory[START_SPEED], memory[IMPACT_SPEED] = start_speed, impact_speed
    return (NO_CONTACT if contact == _RETURN_FLIGHT else contact), x, v, count

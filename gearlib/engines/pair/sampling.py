"""Record of a mesh period, computed from its arcs: extrema, contact times, samples and events."""

import math

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel_part
from gearlib.engines.pair.events import CONTACT, DISPLACEMENT, DURATION, LEVEL, START, VELOCITY
from gearlib.engines.pair.motion import (
    UNDERDAMPED,
    evolve,
    free_flight,
    lowest_point_time,
    next_turning_time,
)


@kernel_part
def _update_extrema(pair, level, contact, x, summary):
    """Update the extrema in `summary` with a displacement x and the mesh force at x.

    The force is the stiffness times the deflection, which counts from x = 0 if `contact` is DRIVE
    and from x = -backlash_ratio if it is COAST; without contact it is zero. `level` has the
    stiffness, and `pair` (`PairConstants`) the backlash.
    """
    summary[orbit.X_MAX] = max(summary[orbit.X_MAX], x)
    summary[orbit.X_MIN] = min(summary[orbit.X_MIN], x)
    force = 0.0
    if contact == DRIVE:
        force = level.stiffness * x
    elif contact == COAST:
        force = level.stiffness * (x + pair.backlash_ratio)
    summary[orbit.FORCE_MAX] = max(summary[orbit.FORCE_MAX], force)
    summary[orbit.FORCE_MIN] = min(summary[orbit.FORCE_MIN], force)


@kernel_part
def add_arcs_to_summary(pair, arcs, arc_count, summary):
    """Add the extrema, the contact times and the mean force of successive arcs to `summary`.

    An arc is the motion between two events. The first `arc_count` rows of the arc table `arcs`,
    shape (n, 6), are used. `pair` holds the `PairConstants`.
    """
    for i in range(arc_count):
        contact = int(arcs[i, CONTACT])
        level = pair.high_level if arcs[i, LEVEL] == 1.0 else pair.low_level
        duration, x, v = arcs[i, DURATION], arcs[i, DISPLACEMENT], arcs[i, VELOCITY]
        _update_extrema(pair, level, contact, x, summary)
        has_next = i + 1 < arc_count
        end_x, end_v = 0.0, 0.0
        if has_next:
            end_x, end_v = arcs[i + 1, DISPLACEMENT], arcs[i + 1, VELOCITY]
        if contact == NO_CONTACT:
            summary[orbit.TIME_NO_CONTACT] += duration
            if v < 0.0 and not (has_next and end_v < 0.0):
                turning_time = lowest_point_time(pair.drag, pair.load, v)
                if turning_time < duration:
                    min_x, _ = free_flight(pair.drag, pair.load, x, v, turning_time)
                    _update_extrema(pair, level, contact, min_x, summary)
            if not has_next:
                end_x, _ = free_flight(pair.drag, pair.load, x, v, duration)
            # Rounding must not move the impact beyond a flank line.
            end_x = min(max(end_x, -pair.backlash_ratio), 0.0)
            _update_extrema(pair, level, contact, end_x, summary)
            continue
        equilibrium = (
            level.equilibrium if contact == DRIVE else level.equilibrium - pair.backlash_ratio
        )
        summary[orbit.TIME_DRIVE if contact == DRIVE else orbit.TIME_COAST] += duration
        if arcs[i, LEVEL] == 0.0:
            summary[orbit.TIME_LOW] += duration
        if not has_next:
            end_x, end_v = evolve(level, x - equilibrium, v, duration)
            end_x += equilibrium
        # The first two turning points are the extrema, because amplitudes never grow. Within
        # half an oscillation there is at most one, where the velocity changes its sign.
        if not (v * end_v > 0.0 and level.frequency * duration < math.pi):
            turning_time = next_turning_time(level, x - equilibrium, v)
            for _ in range(2):
                if not turning_time < duration:
                    break
                u, _v = evolve(level, x - equilibrium, v, turning_time)
                _update_extrema(pair, level, contact, u + equilibrium, summary)
                if level.damping_kind != UNDERDAMPED:
                    break
                turning_time += math.pi / level.frequency
        # By the equation of motion, the impulse of the mesh force is the impulse of the load minus
        # the impulse of the damping force and the change of momentum.
        momentum_change = end_v - v + 2.0 * level.decay_rate * (end_x - x)
        summary[orbit.FORCE_SUM] += duration - momentum_change / pair.load
        end_x = max(end_x, 0.0) if contact == DRIVE else min(end_x, -pair.backlash_ratio)
        _update_extrema(pair, level, contact, end_x, summary)


@kernel_part(merged=True)
def record_events(arcs, arc_count, previous_contact, period, events, event_count, summary):
    """Add the contact changes between successive arcs to `summary` and to the event table.

    An arc is the motion between two events. The first `arc_count` rows of the arc table `arcs`,
    shape (n, 6), belong to mesh period number `period`; `previous_contact` is the contact state
    before them. The first `event_count` rows of the table `events` are in use; a table without rows
    stays empty. Returns (event table, number of events, contact state of the last arc).
    """
    for i in range(arc_count):
        contact = int(arcs[i, CONTACT])
        if contact != previous_contact:
            phase, v = arcs[i, START], arcs[i, VELOCITY]
            events, event_count = orbit.record_event(
                events, event_count, period, phase, previous_contact, contact, v, summary
            )
            previous_contact = contact
    return events, event_count, previous_contact


@kernel_part(inlined=True)
def state_in_arc(pair, arc, t):
    """Return displacement, velocity, acceleration and mesh force at phase t of the mesh period.

    An arc is the motion between two events: a free flight or a linear oscillation in contact.
    `arc`, shape (6,), is the row of the arc table that contains the phase; `pair` holds the
    `PairConstants`.
    """
    contact = int(arc[CONTACT])
    level = pair.high_level if arc[LEVEL] == 1.0 else pair.low_level
    x, v, t = arc[DISPLACEMENT], arc[VELOCITY], t - arc[START]
    if contact == NO_CONTACT:
        x, v = free_flight(pair.drag, pair.load, x, v, t)
        return x, v, pair.load - 2.0 * pair.drag * v, 0.0
    # u counts from the equilibrium; the elastic deflection is u plus the static deflection.
    equilibrium = level.equilibrium if contact == DRIVE else level.equilibrium - pair.backlash_ratio
    u, v = evolve(level, x - equilibrium, v, t)
    acceleration = -2.0 * level.decay_rate * v - level.natural_squared * u
    return u + equilibrium, v, acceleration, level.stiffness * (u + level.equilibrium)


@kernel_part
def sample_arcs(pair, arcs, arc_count, samples):
    """Fill `samples`, shape (n, 6), with the motion at the phases in their column SAMPLE_PHASE.

    The first `arc_count` rows of the arc table `arcs`, each the motion between two events, are
    used; `pair` holds the `PairConstants`. A sample at a stiffness switch or a change of contact
    has the values just after it.
    """
    i = 0
    for k in range(samples.shape[0]):
        t = samples[k, orbit.SAMPLE_PHASE]
        while i + 1 < arc_count and arcs[i + 1, START] <= t:
            i += 1
        x, v, acceleration, force = state_in_arc(pair, arcs[i], t)
        samples[k, orbit.SAMPLE_X] = x
        samples[k, orbit.SAMPLE_V] = v
        samples[k, orbit.SAMPLE_A] = acceleration
        samples[k, orbit.SAMPLE_CONTACT] = arcs[i, CONTACT]
        samples[k, orbit.SAMPLE_STIFFNESS] = (
            pair.high_level if arcs[i, LEVEL] == 1.0 else pair.low_level
        ).stiffness
        samples[k, orbit.SAMPLE_FORCE] = force

"""Records of a mesh period from its arcs: extrema, contact times, samples and events."""

import math

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.orbit import (
    FORCE_MAX,
    FORCE_MIN,
    SAMPLE_A,
    SAMPLE_CONTACT,
    SAMPLE_FORCE,
    SAMPLE_PHASE,
    SAMPLE_STIFFNESS,
    SAMPLE_V,
    SAMPLE_X,
    TIME_BACKLASH,
    TIME_INVERSE,
    TIME_LOW,
    TIME_NORMAL,
    X_MAX,
    X_MIN,
    add_event,
)
from gearlib.engines.pair.events import CONTACT, DISPLACEMENT, DURATION, LEVEL, START, VELOCITY
from gearlib.engines.pair.motion import UNDERDAMPED, evolve, fly, lowest_time, turning_time


@kernel
def _add_displacement(mesh, level, contact, x, summary):
    """Update the extrema in `summary`, shape (9,), by a displacement x and its mesh force.

    The force follows from the contact code and the stiffness `Level` of the `Mesh`.
    """
    summary[X_MAX] = max(summary[X_MAX], x)
    summary[X_MIN] = min(summary[X_MIN], x)
    force = 0.0
    if contact == NORMAL:
        force = level.stiffness * x
    elif contact == INVERSE:
        force = level.stiffness * (x + mesh.gap)
    summary[FORCE_MAX] = max(summary[FORCE_MAX], force)
    summary[FORCE_MIN] = min(summary[FORCE_MIN], force)


@kernel
def add_arcs(mesh, arcs, count, summary):
    """Add extrema and contact times of arcs of a `Mesh` to `summary`, shape (9,).

    The first `count` rows of the arc table `arcs`, shape (n, 6), are used.
    """
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        level = mesh.high if arcs[i, LEVEL] == 1.0 else mesh.low
        duration, x, v = arcs[i, DURATION], arcs[i, DISPLACEMENT], arcs[i, VELOCITY]
        _add_displacement(mesh, level, contact, x, summary)
        has_next = i + 1 < count
        end, end_v = 0.0, 0.0
        if has_next:
            end, end_v = arcs[i + 1, DISPLACEMENT], arcs[i + 1, VELOCITY]
        if contact == BACKLASH:
            summary[TIME_BACKLASH] += duration
            if v < 0.0 and not (has_next and end_v < 0.0):
                t = lowest_time(mesh.drag, mesh.load, v)
                if t < duration:
                    lowest, _ = fly(mesh.drag, mesh.load, x, v, t)
                    _add_displacement(mesh, level, contact, lowest, summary)
            if not has_next:
                end, _ = fly(mesh.drag, mesh.load, x, v, duration)
            # Rounding must not move the landing beyond the line.
            end = min(max(end, -mesh.gap), 0.0)
            _add_displacement(mesh, level, contact, end, summary)
            continue
        shift = level.equilibrium if contact == NORMAL else level.equilibrium - mesh.gap
        summary[TIME_NORMAL if contact == NORMAL else TIME_INVERSE] += duration
        if arcs[i, LEVEL] == 0.0:
            summary[TIME_LOW] += duration
        if not has_next:
            end, end_v = evolve(level, x - shift, v, duration)
            end += shift
        # The first two turning points are the highest and the lowest, since amplitudes never grow.
        # Within half an oscillation there is at most one, and the velocity changes its sign.
        if not (v * end_v > 0.0 and level.w * duration < math.pi):
            t = turning_time(level, x - shift, v)
            for _ in range(2):
                if not t < duration:
                    break
                u, _v = evolve(level, x - shift, v, t)
                _add_displacement(mesh, level, contact, u + shift, summary)
                if level.kind != UNDERDAMPED:
                    break
                t += math.pi / level.w
        end = max(end, 0.0) if contact == NORMAL else min(end, -mesh.gap)
        _add_displacement(mesh, level, contact, end, summary)


@kernel
def add_events(arcs, count, previous, period, events, rows):
    """Append the changes of contact between successive arcs to the event table.

    The first `count` rows of the arc table `arcs`, shape (n, 6), belong to mesh period number
    `period`; `previous` is the contact code before them, `rows` the number of rows of `events` in
    use. Returns (events, rows in use, contact code of the last arc).
    """
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        if contact != previous:
            events, rows = add_event(
                events, rows, period, arcs[i, START], previous, contact, arcs[i, VELOCITY]
            )
            previous = contact
    return events, rows, previous


@kernel
def count_bounces(arcs, count, previous):
    """Return (number of losses of drive-side contact, contact code of the last arc).

    The first `count` rows of the arc table `arcs`, shape (n, 6), are used; `previous` is the
    contact code before them.
    """
    bounces = 0
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        if previous == NORMAL and contact != NORMAL:
            bounces += 1
        previous = contact
    return bounces, previous


@inlined
def in_arc(mesh, arc, t):
    """Return displacement, velocity, acceleration and mesh force at phase t of the mesh period.

    `arc`, shape (6,), is the row of the arc table of a `Mesh` in which the phase lies.
    """
    contact = int(arc[CONTACT])
    level = mesh.high if arc[LEVEL] == 1.0 else mesh.low
    x, v, t = arc[DISPLACEMENT], arc[VELOCITY], t - arc[START]
    if contact == BACKLASH:
        x, v = fly(mesh.drag, mesh.load, x, v, t)
        return x, v, mesh.load - 2.0 * mesh.drag * v, 0.0
    shift = level.equilibrium if contact == NORMAL else level.equilibrium - mesh.gap
    u, v = evolve(level, x - shift, v, t)
    return (
        u + shift,
        v,
        -2.0 * level.a * v - level.square * u,
        level.stiffness * (u + level.equilibrium),
    )


@kernel
def sample_arcs(mesh, arcs, count, samples):
    """Fill `samples`, shape (n, 6), with the motion at the phases in their column SAMPLE_PHASE.

    The motion of the `Mesh` is given by the first `count` rows of the arc table `arcs`. At a switch
    the state just after it is used.
    """
    i = 0
    for k in range(samples.shape[0]):
        t = samples[k, SAMPLE_PHASE]
        while i + 1 < count and arcs[i + 1, START] <= t:
            i += 1
        x, v, acceleration, force = in_arc(mesh, arcs[i], t)
        samples[k, SAMPLE_X] = x
        samples[k, SAMPLE_V] = v
        samples[k, SAMPLE_A] = acceleration
        samples[k, SAMPLE_CONTACT] = arcs[i, CONTACT]
        samples[k, SAMPLE_STIFFNESS] = (mesh.high if arcs[i, LEVEL] == 1.0 else mesh.low).stiffness
        samples[k, SAMPLE_FORCE] = force

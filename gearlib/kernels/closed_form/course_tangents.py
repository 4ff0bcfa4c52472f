"""Derivatives along a course of speed and load: a run-up is gone through again with its tangents.

Time is theta, and constants of the mesh change in units that stay, so that the motion between
switches feels nothing of the speed: where a switch or a revolution begins at a phase phi, it does
so at a theta that moves by (dphi - phi ds) / nu, s the factor of all speeds. States at the start of
each mesh period, and the events, are those of the run.
"""

import math

import numpy as np

from gearlib.kernels.closed_form.arc_tangents import (
    DECAY,
    PULL,
    SWITCH,
    carry,
    cross_line,
    flank_of,
    line_of,
    line_rate,
    switch_phase,
    switch_stiffness,
)
from gearlib.kernels.closed_form.course_waves import (
    OF_ACCELERATION,
    OF_FORCE,
    add_jump,
    add_waves,
    force_of,
)
from gearlib.kernels.closed_form.event_by_event import (
    ARC_COLUMNS,
    CONTACT,
    DISPLACEMENT,
    DURATION,
    LEVEL,
    VELOCITY,
)
from gearlib.kernels.closed_form.sensitivity import (
    consider,
    event_rates,
    event_times,
    sample,
    turning_points,
)
from gearlib.kernels.codes import BACKLASH
from gearlib.kernels.jit import inlined, kernel

# What an arc ends at.
_END, _SWITCH, _EVENT = range(3)
#: Instants closer than this, by theta, are one.
_SAME = 1e-12
#: Columns of events: number of the interval, theta in it, contact behind.
_INTERVAL, _AT, _TO = range(3)
#: Times in normal mesh, backlash, inverse mesh, and all of it.
TIMES = 4


@kernel
def _bound(m, rates, sign, contact, level, x, v, shift, tangents, slope, own):
    """Take a revolution from (sign 1) or to (-1) a bound that moves by `shift`, shape (k,).

    `own` are (extrema so far, their slopes, times, areas) of the revolution.
    """
    best, extrema, times, area = own
    force = force_of(m, contact, level, x)
    for j in range(slope.shape[0]):
        slope[j] = tangents[0, j] + v * shift[j]
        times[1 - contact, j] -= sign * shift[j]
        times[3, j] -= sign * shift[j]
        area[j] -= sign * force * shift[j]
    consider(m, rates, contact, level, x, slope, best, extrema)


@inlined
def _add_area(m, rates, mass, arc, sign, x, v, tangents, area):
    """Add to what the integral of the force changes by, for the end (1) or begin (-1) of an arc.

    The balance of momentum: the force is the load less what accelerates and what is lost.
    """
    loss = 2.0 * (m.high if arc[LEVEL] == 1.0 else m.low).a
    for j in range(tangents.shape[1]):
        gained = tangents[1, j] + 2.0 * rates[DECAY, j] * x + loss * tangents[0, j]
        area[j] -= sign * (gained + mass[j] * (v + loss * x))


@kernel
def follow_stretch(
    m, rates, mass, moves, course, intervals, start, contact, events, tangents, per, filled, waves
):
    """Take tangents, shape (2, k), through the intervals of a stretch of a run-up.

    Parameters
    ----------
    m : Mesh
        By theta, with the load of the stretch.
    rates : ndarray, shape (12, k)
        Of its constants; those of switches are filled here.
    mass : ndarray, shape (k,)
        What the reduced mass changes by, as a share.
    moves : ndarray, shape (2, k)
        What half the segment at C_max and the factor of all speeds change by.
    course : tuple
        Phase and speed at the bounds of the intervals, shape (n + 1,), theta there, acceleration.
    intervals : tuple
        Row of the revolution of each, shape (n,), and whether one begins at each bound, (n + 1,).
    start : ndarray, shape (n, 2)
        States at the start of the intervals.
    contact : int
        Contact code at the start.
    events : ndarray, shape (e, 3)
    tangents : ndarray
        Changed in place to the end.
    per : int
        Samples in each interval, at equal steps of time.
    filled : tuple
        Derivatives of samples, shape (n per, 4, k), of events, (e, 2, k); of each revolution: the
        extrema, (r, 4), theirs, (r, 4, k), of times, (r, 4, k), and of the integral of the force
        over its unit, (r, k).
    waves : Waves
        Without blocks: no integrals.

    Returns
    -------
    contact : int
        That at the end.
    grazing : bool
        Whether the motion touches a flank line.
    """
    (phase, speed, theta, acceleration), (rows, bounds) = course, intervals
    samples, met, best, extrema, times, area = filled
    k, e, grazing = tangents.shape[1], 0, False
    scratch, slope, moved = np.empty((2, k)), np.empty(k), np.empty(k)
    event, shift, arc = np.empty((2, k)), np.zeros(k), np.empty(ARC_COLUMNS)
    listen = waves.sums.shape[0] > 0
    whole = m.half_high == 0.0 or m.whole_low == 0.0
    for i in range(rows.shape[0]):
        row, x, v, t = rows[i], start[i, 0], start[i, 1], 0.0
        own = best[row], extrema[row], times[row], area[row]
        turn = 2.0 * math.pi * math.floor((phase[i] + phase[i + 1]) / (4.0 * math.pi))
        close = _SAME * max(phase[i + 1], 1.0)
        # A stiffness of one level has no switches.
        switch = 2 if whole else 0
        while switch < 2 and turn + switch_phase(m, switch) < phase[i] - close:
            switch += 1
        level = 0.0 if switch == 1 or m.half_high == 0.0 else 1.0
        total = speed[i] + speed[i + 1]
        length = 2.0 * (phase[i + 1] - phase[i]) / total if total > 0.0 else theta[i + 1] - theta[i]
        if bounds[i] and speed[i] > 0.0:
            for j in range(k):
                shift[j] = -phase[i] * moves[1, j] / speed[i]
            _bound(m, rates, 1.0, contact, level, x, v, shift, tangents, slope, own)
        taken = 0
        while True:
            until, what, rate = length, _END, 0.0
            if switch < 2 and turn + switch_phase(m, switch) < phase[i + 1] - close:
                ahead = max(turn + switch_phase(m, switch) - phase[i], 0.0)
                rate = math.sqrt(max(speed[i] * speed[i] + 2.0 * acceleration * ahead, 0.0))
                until, what = 2.0 * ahead / (speed[i] + rate) if ahead > 0.0 else 0.0, _SWITCH
            if e < events.shape[0]:
                if events[e, _INTERVAL] == i and (events[e, _AT] <= until or what == _END):
                    until, what = max(events[e, _AT], t), _EVENT
            arc[CONTACT], arc[LEVEL], arc[DISPLACEMENT], arc[VELOCITY] = contact, level, x, v
            lasts = until - t
            after = int(events[e, _TO]) if what == _EVENT else contact
            line = line_of(m, flank_of(contact, after))
            if lasts > 0.0:
                arc[DURATION] = lasts
                for j in range(k):
                    slope[j] = tangents[0, j] + v * shift[j]
                    shift[j] = 0.0
                consider(m, rates, contact, level, x, slope, best[row], extrema[row])
                touches = turning_points(
                    m, rates, arc, tangents, scratch, slope, best[row], extrema[row]
                )
                grazing = grazing or touches
                while taken < per:
                    at = length * taken / per
                    if at >= until - _SAME:
                        break
                    sample(m, rates, arc, at - t, tangents, scratch, samples[i * per + taken])
                    taken += 1
                if listen:
                    fast = speed[i] + acceleration * t
                    at = phase[i] + 0.5 * (speed[i] + fast) * t
                    add_waves(
                        m, rates, moves, arc, at, fast, acceleration, tangents, scratch, waves
                    )
                if contact != BACKLASH:
                    _add_area(m, rates, mass, arc, -1.0, x, v, tangents, area[row])
                    for j in range(k):
                        area[row, j] += lasts * (rates[PULL, j] + mass[j] * m.pull)
                x, v = carry(m, rates, arc, lasts, tangents, tangents)
                if contact != BACKLASH:
                    _add_area(m, rates, mass, arc, 1.0, x, v, tangents, area[row])
            t = until
            for j in range(k):
                shift[j] = 0.0
            if what == _EVENT:
                x = line
                lev = m.high if level == 1.0 else m.low
                slow = event_rates(m, rates, lev, contact, after, v, tangents, moved, event)
                grazing = grazing or slow
                for j in range(k):
                    met[e, 0, j], met[e, 1, j] = event[0, j], event[1, j]
                    slope[j] = line_rate(rates, j, flank_of(contact, after))
                consider(m, rates, BACKLASH, level, x, slope, best[row], extrema[row])
                if listen and waves.what == OF_ACCELERATION:
                    fast = speed[i] + acceleration * t
                    at = phase[i] + 0.5 * (speed[i] + fast) * t
                    loss = 2.0 * (lev.a - m.drag) * (abs(after) - abs(contact))
                    for j in range(k):
                        # The speed of the event cancels.
                        moved[j] = fast * (slope[j] - tangents[0, j]) + v * at * moves[1, j]
                        moved[j] *= loss
                    add_jump(at, moved, waves)
                    for j in range(k):
                        moved[j] = event[0, j]
                event_times(1.0, contact, after, moved, times[row])
                if contact != BACKLASH:
                    cross_line(m, rates, lev, contact, 1.0, tangents)
                if after != BACKLASH:
                    cross_line(m, rates, lev, after, -1.0, tangents)
                contact, e = after, e + 1
            elif what == _SWITCH:
                fall, sign = force_of(m, contact, level, x), 1.0 - 2.0 * switch
                other = 1.0 - level
                fall -= force_of(m, contact, other, x)
                place = turn + switch_phase(m, switch)
                for j in range(k):
                    shift[j] = (sign * moves[0, j] - place * moves[1, j]) / rate if rate else 0.0
                    rates[SWITCH + switch, j] = shift[j]
                    slope[j] = tangents[0, j] + v * shift[j]
                    area[row, j] += fall * shift[j]
                consider(m, rates, contact, level, x, slope, best[row], extrema[row])
                if listen and waves.what >= OF_ACCELERATION:
                    fall = fall if waves.what == OF_FORCE else -fall
                    for j in range(k):
                        moved[j] = fall * sign * moves[0, j]
                    add_jump(place, moved, waves)
                switch_stiffness(m, rates, switch, contact, x, tangents)
                level, switch = other, switch + 1
            else:
                break
        if bounds[i + 1] and speed[i + 1] > 0.0:
            for j in range(k):
                shift[j] = -phase[i + 1] * moves[1, j] / speed[i + 1]
        _bound(m, rates, -1.0, contact, level, x, v, shift, tangents, slope, own)
        for j in range(k):
            shift[j] = 0.0
    return contact, grazing

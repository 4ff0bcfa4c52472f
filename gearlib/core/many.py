"""Runs over many tunings or initial states: one after the other, or in lanes.

A cold sweep keeps all lanes busy: an orbit that is through makes room for the next one. What a
lane cannot prove, the plain march does up to the next landing; an orbit that does not bounce, or
for which that happens often, goes by `transit` for a while, for four times as long each time.
"""

import math

import numpy as np

from gearlib.core import orbit
from gearlib.core.jit import kernel
from gearlib.core.lanes import (
    COUNT,
    LANDED,
    LANES,
    PHASE,
    SPEED,
    bounce,
    new_lanes,
    set_idle,
    set_mesh,
    set_orbit,
    suits,
)
from gearlib.core.march import ARC_COLUMNS, march, next_event, within_range
from gearlib.core.mesh import BACKLASH, NORMAL, contact_of, mesh
from gearlib.core.run import EVENT_LIMIT, OK, OVERFLOW, record, run, skip, skipped
from gearlib.core.transit import transit

#: Fewer periods than this do not pay for getting into a lane and out of it.
_SHORTEST = 64
#: Arcs in one stretch that a lane may take without counting them.
_ARCS_IN_LANE = 8
#: Mesh periods within which the plain march looks for a landing, and for which an orbit is left to
#: `transit` at first.
_SEARCH, _PATIENCE = 2, 8
#: A landing by the plain march costs as much as this many bounces in a lane save.
_WORTH = 4
# Columns of the lanes' book: place of the orbit in the order, landings by the plain march since it
# came into the lane, mesh period at which it came, for how long `transit` has it when it leaves.
_PLACE, _HELPED, _SINCE, _WAIT = range(4)


@kernel
def run_many(
    ratios, tunings, order, state, carry, periods, record_periods, limit, summaries, ends, codes
):
    """Run the tunings ``tunings[order]``.

    Parameters
    ----------
    ratios : ndarray, shape (7,)
        See `gearlib.core.mesh.mesh`.
    tunings : ndarray, shape (n,)
    order : ndarray of int, shape (k,)
        Which tunings, and in which order.
    state : ndarray, shape (2,)
        Initial displacement and velocity.
    carry : bool
        Whether a run starts from the end of the one before it (after a failed one: from `state`).
    summaries, ends : ndarray, shapes (n, 9), (n, 2)
        Summary and final state of every tuning.
    codes : ndarray of int, shape (n, 2)
        Period and status of every tuning.
    """
    samples = np.empty((0, orbit.SAMPLE_COLUMNS))
    events = np.empty((0, orbit.EVENT_COLUMNS))
    starts = np.empty((order.shape[0], 3))
    statuses = np.zeros(order.shape[0], np.int64)
    unrecorded = skipped(periods, record_periods)
    # A lone tuning too: results must not depend on how a sweep is cut into windows.
    in_lanes = not carry and unrecorded >= _SHORTEST
    if in_lanes:
        states = np.empty((order.shape[0], 2))
        states[:] = state
        skip_in_lanes(ratios, tunings, order, states, unrecorded, limit, starts, statuses)
    x, v = state[0], state[1]
    for j in range(order.shape[0]):
        i = order[j]
        m = mesh(ratios, tunings[i])
        period, status = 0, statuses[j]
        if not in_lanes:
            x, v, period, _, _, status = run(
                m, x, v, periods, record_periods, samples, events, limit, summaries[i]
            )
        elif status == OK:
            contact, x, v = int(starts[j, 0]), starts[j, 1], starts[j, 2]
            x, v, period, _, _, status = record(
                m, contact, x, v, periods, record_periods, samples, events, limit, summaries[i]
            )
        if status != OK:
            summaries[i, :] = math.nan
            ends[i, :] = math.nan
        else:
            ends[i, 0], ends[i, 1] = x, v
        if status != OK or not carry:
            x, v = state[0], state[1]
        codes[i, 0], codes[i, 1] = period, status


@kernel
def skip_in_lanes(ratios, tunings, order, states, periods, limit, ends, statuses):
    """Go through the first `periods` mesh periods at the tunings ``tunings[order]``, unrecorded.

    Parameters
    ----------
    ratios, tunings, order, limit
        As of `run_many`.
    states : ndarray, shape (k, 2)
        Initial displacement and velocity of every orbit.
    periods : int
        Mesh periods from tau = 0, >= 0.
    ends : ndarray, shape (k, 3)
        Contact code, displacement and velocity at the end.
    statuses : ndarray of int, shape (k,)
    """
    no_arcs = np.empty((0, ARC_COLUMNS))
    lanes, book = new_lanes(), np.full((LANES, 4), -1)
    waiting = 0
    while True:
        busy = used = 0
        for lane in range(LANES):
            j = book[lane, _PLACE]
            rides = j >= 0 and lanes[LANDED + lane] == 1.0
            if j >= 0 and not rides:
                m = mesh(ratios, tunings[order[j]])
                at = NORMAL, 0.0, lanes[SPEED + lane]
                rides, contact, x, v, statuses[j] = _help(
                    m, lanes, lane, book, at, lanes[PHASE + lane], periods, limit, no_arcs
                )
                if not rides:
                    ends[j, 0], ends[j, 1], ends[j, 2] = contact, x, v
            # A free lane takes the next orbit that rides; those that do not end here.
            while not rides and waiting < order.shape[0]:
                j = waiting
                waiting += 1
                m = mesh(ratios, tunings[order[j]])
                rides, contact, x, v, statuses[j] = _enter(
                    m, lanes, lane, book, states[j], periods, limit, no_arcs
                )
                if not rides:
                    ends[j, 0], ends[j, 1], ends[j, 2] = contact, x, v
            book[lane, _PLACE] = j if rides else -1
            if rides:
                busy += 1
                used = lane + 1
            else:
                set_idle(lanes, lane)
        if busy == 0:
            return
        # Whole vectors of lanes, so that a few orbits do not pay for all lanes.
        used = (used + 3) // 4 * 4
        while bounce(lanes, used, periods - 2) == used - busy:
            pass


@kernel
def _enter(m, lanes, lane, book, state, periods, limit, no_arcs):
    """Start an orbit; returns as of `_help`."""
    x, v = state[0], state[1]
    contact = contact_of(m.gap, x, v)
    if not within_range(x, v):
        return False, contact, x, v, OVERFLOW
    if periods == 0:
        return False, contact, x, v, OK
    if not suits(m) or limit < _ARCS_IN_LANE or periods < 2 * _SEARCH:
        contact, x, v, status = skip(m, contact, x, v, periods, limit, no_arcs)
        return False, contact, x, v, status
    contact, x, v, count = march(m, 1, 0.0, m.half_high, contact, x, v, no_arcs, 0, limit)
    if count > limit:
        return False, contact, x, v, EVENT_LIMIT
    set_mesh(lanes, lane, m)
    lanes[COUNT + lane] = 0.0
    # `transit` first: most transients begin with irregular bounces.
    book[lane, _HELPED], book[lane, _SINCE], book[lane, _WAIT] = _PATIENCE, 0, _PATIENCE
    return _help(m, lanes, lane, book, (contact, x, v), 0.0, periods, limit, no_arcs)


@kernel
def _help(m, lanes, lane, book, at, phase, periods, limit, no_arcs):
    """Take an orbit on to where its lane can, or to the end of its `periods`.

    It is in the state `at` (contact, x, v) at `phase` of the mesh period noted in the lane.
    Returns (rides, contact, x, v, status): whether the lane has it again, else its final state.
    """
    contact, x, v = at
    count = int(lanes[COUNT + lane])
    book[lane, _HELPED] += 1
    calm = book[lane, _HELPED] * _WORTH <= count - book[lane, _SINCE] + 2 * _WORTH
    while True:
        if calm and count + _SEARCH + 1 < periods:
            landed, count, phase, contact, x, v, last, status = next_landing(
                m, count, phase, contact, x, v, count + _SEARCH, limit
            )
            if status != OK:
                return False, contact, x, v, status
            if landed:
                which, leaving, airtime = last
                set_orbit(lanes, lane, count, phase, v, which, leaving, airtime)
                return True, contact, x, v, OK
        wait = min(book[lane, _WAIT], periods - count)
        last = count + wait == periods
        contact, x, v, status, bounces, cold = _by_transit(
            m, contact, x, v, phase, wait, last, limit, no_arcs
        )
        if status != OK or last:
            return False, contact, x, v, status
        phase, count = 0.0, count + wait
        # An orbit that bounces too seldom, or not by the shortcuts there, is none for a lane.
        calm = cold * _WORTH <= wait <= 2 * bounces
        book[lane, _WAIT] *= 4
        book[lane, _HELPED], book[lane, _SINCE] = 0, count


@kernel
def _by_transit(m, contact, x, v, phase, periods, last, limit, no_arcs):
    """Go on for `periods` > 0 periods from `phase`, the last of them only to its middle if `last`.

    The middle is that of the stretch of C_max. Returns (contact, x, v, status) and the
    `bounces` and `cold` of `transit`.
    """
    low, high = m.whole_low, 2.0 * m.half_high
    left = 2 * periods - 1 if last else 2 * periods
    if phase > 0.0 and phase < low:
        contact, x, v, count = march(m, 0, 0.0, low - phase, contact, x, v, no_arcs, 0, limit)
        if count > limit:
            return contact, x, v, EVENT_LIMIT, 0, 0
        phase = low
        left -= 1
    elif phase > 0.0:
        left -= 1
    if phase > 0.0:
        if left == 0:
            # A landing in C_max of the last period is never left to here.
            return contact, x, v, OK, 0, 0
        length = low + high - phase
        contact, x, v, count = march(m, 1, 0.0, length, contact, x, v, no_arcs, 0, limit)
        if count > limit:
            return contact, x, v, EVENT_LIMIT, 0, 0
        left -= 1
    contact, x, v, done, count, bounces, cold = transit(m, contact, x, v, left, limit, no_arcs)
    if count > limit:
        return contact, x, v, EVENT_LIMIT, 0, 0
    if done < left:
        return contact, x, v, OVERFLOW, 0, 0
    if not last:
        return contact, x, v, OK, bounces, cold
    contact, x, v, count = march(m, 1, 0.0, m.half_high, contact, x, v, no_arcs, 0, limit)
    return contact, x, v, (EVENT_LIMIT if count > limit else OK), bounces, cold


@kernel
def next_landing(m, count, phase, contact, x, v, end, limit):
    """Go on by the plain march to the next landing on the normal flank.

    Parameters
    ----------
    m : Mesh
    count, phase : int, float
        Mesh period, and phase from the start of its C_min stretch.
    contact, x, v : int, float, float
        State there.
    end : int
        Mesh period at whose start the search ends.
    limit : int
        Most arcs in one stretch.

    Returns
    -------
    landed : bool
    count, phase, contact, x, v : int, float, int, float, float
        The landing, or the start of period `end`.
    last : tuple
        The bounce before it: level of the stretch in which the flank was left, time in contact
        in that stretch, length of the flight.
    status : int
    """
    which, leaving, airtime = 0, -1.0, 0.0
    high = phase >= m.whole_low
    t = phase - m.whole_low if high else phase
    while count < end:
        lev, length = (m.high, 2.0 * m.half_high) if high else (m.low, m.whole_low)
        if not within_range(x, v):
            return False, count, 0.0, contact, x, v, (which, leaving, airtime), OVERFLOW
        arcs = 0
        while t < length:
            arcs += 1
            if arcs > limit:
                return False, count, 0.0, contact, x, v, (which, leaving, airtime), EVENT_LIMIT
            before = contact
            duration, contact, x, v = next_event(m, lev, before, x, v, length - t)
            if before == BACKLASH:
                airtime += duration
            if contact == before:
                break
            t += duration
            if contact == NORMAL:
                phase = m.whole_low + t if high else t
                period = m.whole_low + 2.0 * m.half_high
                if phase >= period:
                    count, phase = count + 1, phase - period
                return True, count, phase, contact, x, v, (which, leaving, airtime), OK
            if before == NORMAL:
                which, leaving, airtime = (1 if high else 0), t, 0.0
        t = 0.0
        count += 1 if high else 0
        high = not high
    return False, count, 0.0, contact, x, v, (which, leaving, airtime), OK

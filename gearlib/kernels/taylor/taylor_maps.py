"""Small deviations of a motion in Taylor steps: maps of mesh periods, tangents, their rates.

At a flank line the damping jumps, at a break of c(tau) its value: there the columns of
`taylor_tangents` jump as in `gearlib.kernels.closed_form.deviation`.
"""

import math

import numpy as np

from gearlib.kernels.closed_form.elementary import cos_sin
from gearlib.kernels.closed_form.mesh_constants import contact_between
from gearlib.kernels.closed_form.sensitivity import SLOWEST
from gearlib.kernels.codes import BACKLASH, EVENT_LIMIT, OK, OVERFLOW, UNRESOLVED
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.overflow import within_range
from gearlib.kernels.taylor.series import (
    D1,
    D2,
    D3,
    GROUND,
    LEVEL,
    LINE,
    ORDER,
    P2,
    P3,
    ROWS,
    SLOPE,
    START,
    V,
    tables,
)
from gearlib.kernels.taylor.taylor_record import (
    consider_end,
    consider_none,
    note_event,
    samples_of,
    turning_points,
)
from gearlib.kernels.taylor.taylor_run import take_step
from gearlib.kernels.taylor.taylor_tangents import along_step, columns_at, new_columns

#: x^20 / 20! = 1e-17 at x = 1.18.
_CONVERGED = 1.18
_LEAST = 1e-300


@inlined
def _stiffest(pieces, waves):
    """Return a bound of a stiffness over its period."""
    total = 0.0
    for i in range(waves.shape[0]):
        total += math.hypot(waves[i, 1], waves[i, 2])
    # A straight piece is highest at the start of itself or of the next one.
    return total + pieces[:, 0].max()


@inlined
def _reach(row, stiffest, contact, x, v):
    """Return how far the series of a deviation at (x, x') carries.

    A deviation swings with the frequency of the contact though the motion may be slow, or rest:
    its own terms, (frequency h)^k / k!, have to fall below rounding by k = ORDER.
    """
    u = abs(x - row[LINE]) if contact != BACKLASH else 0.0
    slope = 1.0 + (2.0 * abs(row[P2]) + 3.0 * row[P3] * u) * u
    drag = row[D1] + (2.0 * row[D2] + 3.0 * row[D3] * abs(v)) * abs(v)
    return _CONVERGED / (math.sqrt(row[GROUND] + stiffest * slope) + drag)


@inlined
def _drags(row, speed):
    """Return the damping force over x', and its derivative by x', at |x'|."""
    first, second = row[D2] * speed, row[D3] * speed * speed
    return row[D1] + first + second, row[D1] + 2.0 * first + 3.0 * second


@inlined
def _shift(before, after, late, w, k, j):
    """Change the map's rates by direction j: a boundary of two parts comes `late` later.

    `before` and `after` are (stiffness, damping) of a deviation on the two sides.
    """
    if w.shape[1] > 2 + k:
        for m in range(2):
            change = (after[0] - before[0]) * w[0, m] + (after[1] - before[1]) * w[1, m]
            w[1, 2 + k + 2 * j + m] += change * late


@kernel
def saltate(before, after, moved, stiffness, v, acceleration, moving, w):
    """Take columns over a flank line, where a flank is left or met at the speed v.

    `before` and `after`: rows of constants on its sides; `moved`, shape (2, COLUMNS, k): what these
    change by; `stiffness`, shape (2,): that of a deviation on both sides; `acceleration` before;
    `moving`, shape (k,): what the line moves by.
    """
    k, speed, rates = moving.shape[0], abs(v), w.shape[1] > 2 + moving.shape[0]
    (old, own), (new, other) = _drags(before, speed), _drags(after, speed)
    jump = new - old
    for j in range(k):
        if rates:
            # The map itself is that before the line: S (1 + A- dtau), dS, then (1 - A+ dtau).
            late = (moving[j] - w[0, 2 + j]) / v if speed > 0.0 else math.nan
            rate = w[1, 2 + j] + acceleration * late
            change = moved[1, D1, j] - moved[0, D1, j]
            change += (moved[1, D2, j] - moved[0, D2, j]) * speed
            change += (moved[1, D3, j] - moved[0, D3, j]) * speed * speed
            steep = (after[D2] - before[D2]) * math.copysign(1.0, v)
            change += (steep + 2.0 * (after[D3] - before[D3]) * v) * rate
            for m in range(2):
                p, q = w[0, m], w[1, m]
                place = 2 + k + 2 * j + m
                # A- M, S A- M and A+ S M.
                first, second = q, -stiffness[0] * p - own * q
                up = second - jump * first
                kicked = q - jump * p
                down = -stiffness[1] * p - other * kicked
                w[1, place] += -jump * w[0, place] + (up - down) * late - change * p
                w[0, place] += (first - kicked) * late
        w[1, 2 + j] -= jump * (w[0, 2 + j] - moving[j])
    for m in range(2):
        w[1, m] -= jump * w[0, m]


@inlined
def _line_of(contact, before):
    """Return the contact code of the flank between two contact codes."""
    return contact if contact != BACKLASH else before


@inlined
def _stiffness(row, waves, phase):
    """Return c(tau) of a flank at a phase; `waves`: its harmonics, as of `tables`."""
    total = row[LEVEL] + row[SLOPE] * (phase - row[START])
    for i in range(waves.shape[0]):
        if waves[i, 0] == 0.0:
            break
        cosine, sine = cos_sin(waves[i, 0] * phase)
        total += waves[i, 1] * cosine + waves[i, 2] * sine
    return total


@kernel
def _cross(constants, harmonics, moved, piece, phase, before, after, v, acceleration, w):
    """Take columns from one contact to another; without a way between the flanks, over both."""
    first = before
    while first != after:
        then = after if first == BACKLASH or after == BACKLASH else BACKLASH
        i, j = first + 1, then + 1
        flank = _line_of(first, then) + 1
        ground = constants[0, 0, GROUND]
        stiff = np.array([ground, ground])
        c = _stiffness(constants[flank, piece], harmonics[flank], phase)
        stiff[0 if first != BACKLASH else 1] += c
        both = np.stack((moved[i, piece], moved[j, piece]))
        line = moved[flank, piece, LINE]
        saltate(constants[i, piece], constants[j, piece], both, stiff, v, acceleration, line, w)
        # The acceleration behind the first of two lines.
        loss, _ = _drags(constants[j, piece], abs(v))
        past, _ = _drags(constants[i, piece], abs(v))
        acceleration -= (loss - past) * v
        first = then


@kernel
def _switch(constants, moved, piece, breaks, contact, x, w, late):
    """Take columns over the break at the end of a piece; fill `late`, by what it moves.

    Returns whether c(tau) jumps there.
    """
    k, i, then = breaks.shape[1], contact + 1, (piece + 1) % constants.shape[1]
    row, next_row = constants[i, piece], constants[i, then]
    jump = row[LEVEL] + row[SLOPE] * (next_row[START] - row[START]) - next_row[LEVEL]
    u = x - row[LINE]
    force = u + (row[P2] + row[P3] * u) * u * u
    steep = 1.0 + (2.0 * row[P2] + 3.0 * row[P3] * u) * u
    for j in range(k):
        late[j] = breaks[piece + 1, j]
        if contact != BACKLASH and late[j] != 0.0:
            w[1, 2 + j] -= jump * force * late[j]
            _shift((jump * steep, 0.0), (0.0, 0.0), late[j], w, k, j)


@inlined
def _restart(matrix, w):
    """Store the map of a mesh period and begin with another."""
    for i in range(2):
        for j in range(2):
            matrix[i, j] = w[i, j]
            w[i, j] = 1.0 if i == j else 0.0


@kernel
def vary_nonlinear(
    law, to_bernstein, x, v, periods, limit, matrices, slopes, w, whole, recorded, record
):
    """Go through mesh periods from (x, v) at tau = 0 with the columns of `taylor_tangents`.

    `slopes` are those of k directions; `w`, shape (2, n), begins with an identity and is changed in
    place to the end; unless `whole`, the map of each period goes to `matrices` and the next begins
    anew. The last `recorded` periods fill the `Record`. Returns (x, v, status, recorded events,
    whether the recorded motion grazes a flank line); otherwise as of
    `gearlib.kernels.closed_form.pair_maps.vary`.
    """
    constants, harmonics = tables(law)
    moved, k = slopes.constants, slopes.breaks.shape[1]
    for contact in range(3):
        if (moved[contact, :, D2] != 0.0).any():
            # Too little to be felt, but steps end where x' changes its sign.
            for piece in range(moved.shape[1]):
                constants[contact, piece, D2] = max(constants[contact, piece, D2], _LEAST)
    columns, late, still = new_columns(k, w.shape[1] > 2 + k), np.zeros(k), np.zeros(k)
    moving, lines = np.empty(k), np.empty((2, k))
    ends = np.empty((2, w.shape[1]))
    series, isolation = np.zeros((ROWS, ORDER + 1)), np.empty((50, ORDER + 2))
    upper, lower, tuning = law.upper, law.lower, law.tuning
    pieces, found, grazing = law.pieces.shape[0], 0, False
    contact, sign = contact_between(upper, lower, x, v), math.copysign(1.0, v)
    stiffest = max(
        _stiffest(law.pieces, law.stiffness), _stiffest(law.far_pieces, law.far_stiffness)
    )
    if not within_range(x, v):
        return x, v, OVERFLOW, 0, False
    for n in range(periods):
        steps, taken, seen = 0, 0, n - (periods - recorded)
        begins = seen == 0
        for piece in range(pieces):
            phase, end = law.breaks[piece], law.breaks[piece + 1]
            late[:] = slopes.breaks[piece]
            while phase < end:
                if steps >= limit:
                    return x, v, EVENT_LIMIT, found, grazing
                steps += 1
                speed, old, before = v, sign, contact
                row = constants[contact + 1, piece]
                stop = min(end, phase + _reach(row, stiffest, contact, x, v))
                h, during, contact, sign, x, v = take_step(
                    constants,
                    harmonics,
                    still,
                    to_bernstein,
                    piece,
                    phase,
                    stop - phase,
                    contact,
                    sign,
                    x,
                    v,
                    series,
                    isolation,
                )
                if h < 0.0:
                    return x, v, UNRESOLVED, found, grazing
                # A step from rest sets out with the sign of its acceleration.
                old = math.copysign(1.0, series[V, 1]) if speed == 0.0 else old
                low = 1.0 - law.low[piece]
                if during != before:
                    _cross(constants, harmonics, moved, piece, phase, before, during, 0.0, 0.0, w)
                    if seen >= 0:
                        moving[:] = math.nan
                        found, _ = note_event(
                            before, during, low, tuning, 0.0, 0.0, w, moving, lines, found, record
                        )
                        grazing = True
                row, touches = constants[during + 1, piece], during != BACKLASH
                change = moved[during + 1, piece]
                along_step(
                    row,
                    change,
                    harmonics,
                    slopes.harmonics,
                    phase,
                    during,
                    old,
                    series,
                    w,
                    columns,
                )
                columns_at(columns.a, h, ends[0])
                columns_at(columns.b, h, ends[1])
                w[:] = ends
                if seen >= 0:
                    if not touches:
                        consider_none(record)
                    rates = slopes.tuning
                    if begins or speed == 0.0 or phase == law.breaks[piece]:
                        at = still if begins else late
                        consider_end(series, columns, tuning, rates, 0.0, at, touches, record)
                        begins = False
                    if turning_points(
                        series, columns, tuning, rates, h, touches, upper, lower, record
                    ):
                        grazing = True
                    if phase + h >= end:
                        at = slopes.breaks[piece + 1]
                        consider_end(series, columns, tuning, rates, h, at, touches, record)
                    size = record.samples.shape[0] // recorded
                    own = record.samples[seen * size : (seen + 1) * size]
                    taken = samples_of(
                        series, columns, tuning, rates, phase, h, touches, own, taken, record
                    )
                phase += h
                if not within_range(x, v):
                    return x, v, OVERFLOW, found, grazing
                if contact != during:
                    acceleration = 0.0
                    for i in range(ORDER, 0, -1):
                        acceleration = acceleration * h + i * series[V, i]
                    if seen >= 0:
                        slow = not abs(v) * tuning > SLOWEST
                        flank = during if during != BACKLASH else contact
                        for j in range(k):
                            lines[0, j] = moved[flank + 1, piece, LINE, j]
                            lines[1, j] = moved[contact + 1, piece, LINE, j]
                            gap = lines[0, j] - w[0, 2 + j]
                            moving[j] = math.nan if slow else gap / v
                        found, _ = note_event(
                            during,
                            contact,
                            low,
                            tuning,
                            v,
                            acceleration,
                            w,
                            moving,
                            lines,
                            found,
                            record,
                        )
                        grazing = grazing or slow
                    _cross(
                        constants,
                        harmonics,
                        moved,
                        piece,
                        phase,
                        during,
                        contact,
                        v,
                        acceleration,
                        w,
                    )
            if k > 0:
                _switch(constants, moved, piece, slopes.breaks, contact, x, w, late)
                if seen >= 0 and contact != BACKLASH:
                    then = law.low[(piece + 1) % pieces]
                    for j in range(k):
                        record.times[3, j] += late[j] * (law.low[piece] * 1.0 - then * 1.0)
        if not whole:
            _restart(matrices[n], w)
    return x, v, OK, found, grazing

"""Derivatives of what a run records: samples, events, extrema, shares of time.

An extremum is a turning point, the start or the end of the record or, of a force, a switch of the
stiffness: the first moves, but changes nothing by that.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.jit import kernel
from gearlib.kernels.slopes.itinerary import FROM, LEFT, MESH, TO
from gearlib.kernels.slopes.modal_turns import turn

#: A turning point this close to a flank line, in static deflections, is a grazing.
_CLOSEST = 1e-10
#: Phases closer than this are one.
_SAME_PHASE = 1e-12
#: What is higher by less than this share is not higher.
_HIGHER = 1e-12
#: Error of a cubic between two places that are looked at, as a share of the range.
_CUBIC = 1e-3
#: A turning point closer to the start of the record than this share of a place is the start.
_AT_START = 1e-9
#: Steps that place a turning point to rounding.
_STEPS = 80
#: Of the counts: samples and events so far, whether a flank is touched, whether an arc is recorded.
TAKEN, FOUND, TOUCHING, BEGUN = range(4)
#: Of the phases.
PERIOD_START, RECORD_START, SAMPLE_STEP = range(3)


class Tables(NamedTuple):
    """What is recorded, and by what: C combinations, m meshes, r functionals, k directions.

    Functionals are displacement, velocity, acceleration and force of all meshes, m each, and more.
    """

    rows: np.ndarray  #: shape (C, r, n)
    row_slopes: np.ndarray  #: shape (C, k, r, n)
    of_tangents: np.ndarray  #: of the coordinates of tangents, shape (C, r, 2 M)
    of_states: np.ndarray  #: and of those of the state, shape (C, 2 M, r k)
    curves: np.ndarray  #: displacement, distances from both flanks, m each, (C, 3 m, 2 M)
    speeds: np.ndarray  #: their rates, shape (C, 3 m, 2 M)
    rates: np.ndarray  #: rates of the distances in components, shape (2 m, n)
    codes: np.ndarray  #: contact codes, int, shape (C, m)
    stiffness: np.ndarray  #: shape (C, m)
    low: np.ndarray  #: as of `itinerary.Places`
    place: np.ndarray  #: phase between places where curves are looked at, shape (C,)
    same: bool  #: whether displacements are the distances from the near flank
    samples: np.ndarray  #: filled, shape (s, r, k)
    events: np.ndarray  #: filled with those of phase and velocity, shape (e, 2, k)
    times: np.ndarray  #: in normal mesh, backlash, inverse mesh, at lower stiffness, (4, m, k)
    best: np.ndarray  #: largest and smallest displacement and force, shape (4, m)
    extrema: np.ndarray  #: filled with their slopes, shape (4, m, k)
    apart: np.ndarray  #: bool, whether the flanks of a mesh were apart, shape (m,)
    moved: np.ndarray  #: by what the switch at the start of an arc moves, shape (m, k)
    counts: np.ndarray  #: int, shape (4,)
    phase: np.ndarray  #: of the period, of the record; step of samples, shape (3,)


@kernel
def _value(rows, y):
    total = 0.0
    for i in range(rows.shape[0]):
        total += rows[i] * y[i, 0]
    return total


@kernel
def _slope(tables, c, functional, y, q, slope):
    """Fill `slope`, shape (k,), with what a functional changes by at coordinates y."""
    k = slope.shape[0]
    slope[:] = 0.0
    for i in range(y.shape[0]):
        factor, value = tables.of_tangents[c, functional, i], y[i, 0]
        own = tables.of_states[c, i, functional * k : functional * k + k]
        for one in range(k):
            slope[one] += factor * y[i, q + one] + own[one] * value


@kernel
def _slope_at(tables, c, functional, q, w):
    """Fill the slope of `Work` with the same from its block of columns; return the functional."""
    row, total, z = tables.rows[c, functional], 0.0, w.z
    for i in range(z.shape[0]):
        total += row[i] * z[i, 0]
    for one in range(w.slope.shape[0]):
        own, w.slope[one] = tables.row_slopes[c, one, functional], 0.0
        for i in range(z.shape[0]):
            w.slope[one] += row[i] * z[i, q + one] + own[i] * z[i, 0]
    return total


@kernel
def _consider(tables, which, j, value, slope):
    """Compare a displacement (0) or a force (1) with the extrema so far."""
    high, low = tables.best[2 * which, j], tables.best[2 * which + 1, j]
    size = _HIGHER * (abs(high) + abs(low)) if high >= low else 0.0
    for place in (2 * which, 2 * which + 1):
        if value > high + size if place == 2 * which else value < low - size:
            tables.best[place, j] = value
            for one in range(slope.shape[0]):
                tables.extrema[place, j, one] = slope[one]


@kernel
def _consider_end(tables, c, j, moved, q, w):
    """Compare the end of an arc with the extrema; one of the force moves by `moved`, shape (k,)."""
    m = tables.codes.shape[1]
    value = _slope_at(tables, c, j, q, w)
    _consider(tables, 0, j, value, w.slope)
    code = tables.codes[c, j]
    if code == BACKLASH:
        return
    value, rate = _slope_at(tables, c, 3 * m + j, q, w), 0.0
    row = tables.rates[m + j if code == INVERSE else j]
    for i in range(w.z.shape[0]):
        rate += row[i] * w.z[i, 0]
    for one in range(moved.shape[0]):
        w.slope[one] += tables.stiffness[c, j] * rate * moved[one]
    _consider(tables, 1, j, value, w.slope)


@kernel
def end_record(tables, c, q, w):
    """Compare the end of the record, in combination c, and the backlash with the extrema."""
    tables.moved[:] = 0.0
    for j in range(tables.codes.shape[1]):
        _consider_end(tables, c, j, tables.moved[j], q, w)
        for place in (2, 3):
            best = tables.best[place, j]
            size = _HIGHER * (abs(tables.best[2, j]) + abs(tables.best[3, j]))
            if tables.apart[j] and (best <= size if place == 2 else best >= -size):
                tables.extrema[place, j] = 0.0


@kernel
def event_velocity(tables, c, j, q, w):
    """Fill the slope of `Work` with that of the velocity of an event of mesh j that moves."""
    m = tables.codes.shape[1]
    rate = 0.0
    for i in range(w.z.shape[0]):
        rate += tables.rows[c, 2 * m + j, i] * w.z[i, 0]
    _slope_at(tables, c, m + j, q, w)
    for one in range(w.slope.shape[0]):
        w.slope[one] += rate * w.moved[one]


@kernel
def note_crossing(tables, step, moved, velocity):
    """Note an event that moves by `moved`, its velocity by `velocity`."""
    row, j = tables.counts[FOUND], step[MESH]
    tables.counts[FOUND] = row + 1
    tables.apart[j] = True
    for one in range(moved.shape[0]):
        if row < tables.events.shape[0]:
            tables.events[row, 0, one], tables.events[row, 1, one] = moved[one], velocity[one]
        for code, sign in ((step[FROM], 1.0), (step[TO], -1.0)):
            tables.times[1 - code, j, one] += sign * moved[one]
            if code != BACKLASH and tables.low[code + 1, step[LEFT], j]:
                tables.times[3, j, one] += sign * moved[one]


@kernel
def note_switch(tables, step, c, moved, q, w):
    """Note a switch of the stiffness of a mesh in contact."""
    j = step[MESH]
    sign = 1.0 if tables.low[step[FROM] + 1, step[LEFT], j] else -1.0
    if tables.counts[BEGUN]:
        _consider_end(tables, c, j, moved, q, w)
    for one in range(moved.shape[0]):
        tables.times[3, j, one] += sign * moved[one]
        tables.moved[j, one] = moved[one]


@kernel
def begin_arc(tables, c, q, w):
    """Compare the start of an arc with the extrema."""
    for j in range(tables.codes.shape[1]):
        _consider_end(tables, c, j, tables.moved[j], q, w)
    tables.moved[:] = 0.0


@kernel
def record_arc(bases, tables, c, t, length, q, w):
    """Take what is recorded along an arc from phase t of the period, coordinates in `Work`."""
    k, r, first = w.slope.shape[0], tables.rows.shape[1], tables.phase[PERIOD_START] + t
    step, columns, out = tables.phase[SAMPLE_STEP], w.y.shape[1], w.turned
    of_tangents, of_states = tables.of_tangents[c], tables.of_states[c]
    while True:
        at = tables.phase[RECORD_START] + tables.counts[TAKEN] * step - first
        if not at < length - _SAME_PHASE:
            break
        turn(bases, c, max(at, 0.0), q, k, columns, w.y, out, w.terms)
        sample = tables.samples[tables.counts[TAKEN]].reshape(r * k)
        sample[:] = 0.0
        for i in range(out.shape[0]):
            value, own = out[i, 0], of_states[i]
            for j in range(r * k):
                sample[j] += own[j] * value
        for j in range(r):
            for i in range(out.shape[0]):
                factor = of_tangents[j, i]
                for one in range(k):
                    sample[j * k + one] += factor * out[i, q + one]
        tables.counts[TAKEN] += 1
    _turning_points(bases, tables, c, length, q, w)
    tables.counts[BEGUN] = 1


@kernel
def _turning_points(bases, tables, c, length, q, w):
    """Compare the turning points of all curves on an arc with the extrema, look for touches."""
    m = tables.codes.shape[1]
    count = max(int(math.ceil(length / tables.place[c])), 2)
    h = length / count
    old, old_speed = np.zeros(3 * m), np.zeros(3 * m)
    for place in range(count + 1):
        turn(bases, c, place * h, q, 1, 1, w.y, w.turned, w.terms)
        for curve in range(m if tables.same else 0, 3 * m):
            value = _value(tables.curves[c, curve], w.turned)
            speed = _value(tables.speeds[c, curve], w.turned)
            if place > 0 and (speed < 0.0) != (old_speed[curve] < 0.0):
                # Between two places the curve is all but a cubic.
                a, b = old_speed[curve], speed
                share = a / (a - b)
                cubic = _cubic(old[curve], a * h, value, b * h, share)
                if _matters(tables, c, curve, cubic, abs(value - old[curve]) + abs(a - b) * h):
                    begin = (place - 1) * h
                    at = _root(bases, tables.speeds[c, curve], c, begin, begin + h, a, b, q, w)
                    if tables.counts[BEGUN] or at > _AT_START * h:
                        _turning_point(bases, tables, c, curve, at, q, w)
                    turn(bases, c, place * h, q, 1, 1, w.y, w.turned, w.terms)
            old[curve], old_speed[curve] = value, speed


@kernel
def _cubic(first, slope, last, end_slope, share):
    """Return the value of a cubic at a share of its span, from values and slopes at both ends."""
    s, r = share, 1.0 - share
    own = (1.0 + 2.0 * s) * r * r * first + s * r * r * slope
    return own + s * s * (3.0 - 2.0 * s) * last - s * s * r * end_slope


@kernel
def _matters(tables, c, curve, value, range_):
    """Return whether a turning point of a curve may be an extremum or a touch."""
    m = tables.codes.shape[1]
    j, kind, code = curve % m, curve // m, tables.codes[c, curve % m]
    margin = _CUBIC * range_ + 1e-15 * abs(value)
    if kind > 0 and abs(value) < margin + 2.0 * _CLOSEST:
        return True
    if kind == 0 or (kind == 1 and tables.same):
        if value > tables.best[0, j] - margin or value < tables.best[1, j] + margin:
            return True
    if kind > 0 and code == (NORMAL if kind == 1 else INVERSE):
        force, margin = tables.stiffness[c, j] * value, tables.stiffness[c, j] * margin
        return force > tables.best[2, j] - margin or force < tables.best[3, j] + margin
    return False


@kernel
def _turning_point(bases, tables, c, curve, at, q, w):
    m, k = tables.codes.shape[1], w.slope.shape[0]
    j, kind, code = curve % m, curve // m, tables.codes[c, curve % m]
    turn(bases, c, at, q, k, q + k, w.y, w.turned, w.terms)
    if kind > 0 and abs(_value(tables.curves[c, curve], w.turned)) <= _CLOSEST:
        tables.counts[TOUCHING] = 1
    if kind == 0 or (kind == 1 and tables.same):
        _slope(tables, c, j, w.turned, q, w.slope)
        _consider(tables, 0, j, _value(tables.of_tangents[c, j], w.turned), w.slope)
    if kind > 0 and code == (NORMAL if kind == 1 else INVERSE):
        _slope(tables, c, 3 * m + j, w.turned, q, w.slope)
        _consider(tables, 1, j, _value(tables.of_tangents[c, 3 * m + j], w.turned), w.slope)


@kernel
def _root(bases, speeds, c, low, high, a, b, q, w):
    """Return where a speed is zero between two places where it is a and b: secants, halved."""
    side = 0
    for _ in range(_STEPS):
        at = (low * b - high * a) / (b - a)
        if not low < at < high:
            at = 0.5 * (low + high)
            if not low < at < high:
                break
        turn(bases, c, at, q, 1, 1, w.y, w.turned, w.terms)
        value = _value(speeds, w.turned)
        if value == 0.0:
            return at
        if (value < 0.0) == (a < 0.0):
            low, a, b, side = at, value, 0.5 * b if side < 0 else b, -1
        else:
            high, b, a, side = at, value, 0.5 * a if side > 0 else a, 1
        if high - low <= 1e-15 * max(1.0, high):
            break
    return at

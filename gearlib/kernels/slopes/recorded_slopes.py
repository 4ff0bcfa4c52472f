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
from gearlib.kernels.slopes.modal_turns import add_product, turn

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
#: Of the counts: samples and events so far, whether a flank is touched, whether an arc is recorded,
#: its combination.
TAKEN, FOUND, TOUCHING, BEGUN, LAST = range(5)
#: Of the phases.
PERIOD_START, RECORD_START, SAMPLE_STEP = range(3)


class Tables(NamedTuple):
    """What is recorded, and by what: C combinations, m meshes, r functionals, k directions.

    Functionals are displacement, velocity, acceleration and force of all meshes, m each, and more.
    """

    rows: np.ndarray  #: shape (C, r, n)
    row_slopes: np.ndarray  #: shape (C, k, r, n)
    of_tangents: np.ndarray  #: of the coordinates of tangents, shape (C, 2 M, r)
    of_states: np.ndarray  #: and of those of the state, shape (C, 2 M, k r)
    #: Displacement, distances from both flanks, m each, then their rates, shape (C, 2 M, 6 m).
    curves: np.ndarray
    velocity: np.ndarray  #: rates of displacements in components, shape (m, n)
    velocity_slopes: np.ndarray  #: shape (k, m, n)
    rates: np.ndarray  #: rates of the distances in components, shape (2 m, n)
    codes: np.ndarray  #: contact codes, int, shape (C, m)
    stiffness: np.ndarray  #: shape (C, m)
    low: np.ndarray  #: as of `itinerary.Places`
    place: float  #: phase between places where curves are looked at
    same: bool  #: whether displacements are the distances from the near flank
    samples: np.ndarray  #: filled, shape (s, k, r)
    events: np.ndarray  #: filled with those of phase and velocity, shape (e, 2, k)
    times: np.ndarray  #: in normal mesh, backlash, inverse mesh, at lower stiffness, (4, m, k)
    best: np.ndarray  #: largest and smallest displacement and force, shape (4, m)
    extrema: np.ndarray  #: filled with their slopes, shape (4, m, k)
    apart: np.ndarray  #: bool, whether the flanks of a mesh were apart, shape (m,)
    moved: np.ndarray  #: by what the switch at the start of an arc moves, shape (m, k)
    counts: np.ndarray  #: int, shape (5,)
    phase: np.ndarray  #: of the period, of the record; step of samples, shape (3,)


@kernel
def _slope(tables, c, functional, y, q, slope):
    """Fill `slope`, shape (k,), with what a functional changes by at coordinates y; return it."""
    r, total = tables.rows.shape[1], 0.0
    slope[:] = 0.0
    for i in range(y.shape[1]):
        factor = tables.of_tangents[c, i, functional]
        total += factor * y[0, i]
        for one in range(slope.shape[0]):
            slope[one] += factor * y[q + one, i]
            slope[one] += tables.of_states[c, i, one * r + functional] * y[0, i]
    return total


@kernel
def _slope_at(tables, c, functional, q, w):
    """Fill the slope of `Work` with the same from its rows; return the functional."""
    row, total, z = tables.rows[c, functional], 0.0, w.z
    for i in range(z.shape[1]):
        total += row[i] * z[0, i]
    for one in range(w.slope.shape[0]):
        own, w.slope[one] = tables.row_slopes[c, one, functional], 0.0
        for i in range(z.shape[1]):
            w.slope[one] += row[i] * z[q + one, i] + own[i] * z[0, i]
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
    for i in range(w.z.shape[1]):
        rate += row[i] * w.z[0, i]
    for one in range(moved.shape[0]):
        w.slope[one] += tables.stiffness[c, j] * rate * moved[one]
    _consider(tables, 1, j, value, w.slope)


@kernel
def end_record(tables, q, w):
    """Compare the end of the record and the backlash with the extrema."""
    tables.moved[:] = 0.0
    for j in range(tables.codes.shape[1]):
        _consider_end(tables, tables.counts[LAST], j, tables.moved[j], q, w)
        for place in (2, 3):
            best = tables.best[place, j]
            size = _HIGHER * (abs(tables.best[2, j]) + abs(tables.best[3, j]))
            if tables.apart[j] and (best <= size if place == 2 else best >= -size):
                tables.extrema[place, j] = 0.0


@kernel
def event_velocity(tables, matrix, j, q, w):
    """Fill the slope of `Work` with that of the velocity of an event of mesh j that moves.

    `matrix`, transposed, is that before the event.
    """
    z, row, rate = w.z, tables.velocity[j], 0.0
    for i in range(z.shape[1]):
        for r in range(z.shape[1]):
            rate += z[0, i] * matrix[i, r] * row[r]
    for one in range(w.slope.shape[0]):
        own, w.slope[one] = tables.velocity_slopes[one, j], rate * w.moved[one]
        for i in range(z.shape[1]):
            w.slope[one] += row[i] * z[q + one, i] + own[i] * z[0, i]


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
def note_switch(tables, step, moved, q, w):
    """Note a switch of the stiffness of a mesh in contact."""
    j = step[MESH]
    sign = 1.0 if tables.low[step[FROM] + 1, step[LEFT], j] else -1.0
    if tables.counts[BEGUN]:
        _consider_end(tables, tables.counts[LAST], j, moved, q, w)
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
    k, first, step = w.slope.shape[0], tables.phase[PERIOD_START] + t, tables.phase[SAMPLE_STEP]
    out = w.turned
    while True:
        at = tables.phase[RECORD_START] + tables.counts[TAKEN] * step - first
        if not at < length - _SAME_PHASE:
            break
        turn(bases, c, max(at, 0.0), q, k, w.y.shape[0], w.y, out, w.terms)
        sample = tables.samples[tables.counts[TAKEN]]
        sample[:] = 0.0
        add_product(out[q : q + k], tables.of_tangents[c], sample)
        add_product(out[:1], tables.of_states[c], sample.reshape(1, sample.size))
        tables.counts[TAKEN] += 1
    _turning_points(bases, tables, c, length, q, w)
    tables.counts[BEGUN], tables.counts[LAST] = 1, c


@kernel
def _turning_points(bases, tables, c, length, q, w):
    """Compare the turning points of all curves on an arc with the extrema, look for touches."""
    m, old, new = tables.codes.shape[1], w.curves[0], w.curves[1]
    count = max(int(math.ceil(length / tables.place)), 2)
    h = length / count
    for place in range(count + 1):
        _curves_at(bases, tables, c, place * h, q, w, new)
        for curve in range(m if tables.same else 0, 3 * m):
            a, b = old[3 * m + curve], new[3 * m + curve]
            if place > 0 and (a < 0.0) != (b < 0.0):
                # Between two places the curve is all but a cubic.
                cubic = _cubic(old[curve], a * h, new[curve], b * h, a / (a - b))
                range_ = abs(new[curve] - old[curve]) + abs(a - b) * h
                if _matters(tables, c, curve, cubic, range_):
                    begin = (place - 1) * h
                    at = _root(bases, tables, c, curve, begin, begin + h, a, b, q, w)
                    if tables.counts[BEGUN] or at > _AT_START * h:
                        _turning_point(bases, tables, c, curve, at, q, w)
        old, new = new, old


@kernel
def _curves_at(bases, tables, c, t, q, w, values):
    """Fill `values`, shape (6 m,), with the curves and their rates at t."""
    turn(bases, c, t, q, 1, 1, w.y, w.turned, w.terms)
    values[:] = 0.0
    add_product(w.turned[:1], tables.curves[c], values.reshape(1, values.size))


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
    """Compare a turning point of a curve with the extrema; note a touch."""
    m, k = tables.codes.shape[1], w.slope.shape[0]
    j, kind, code = curve % m, curve // m, tables.codes[c, curve % m]
    _curves_at(bases, tables, c, at, q, w, w.curves[2])
    if kind > 0 and abs(w.curves[2, curve]) <= _CLOSEST:
        tables.counts[TOUCHING] = 1
    turn(bases, c, at, q, k, q + k, w.y, w.turned, w.terms)
    if kind == 0 or (kind == 1 and tables.same):
        value = _slope(tables, c, j, w.turned, q, w.slope)
        _consider(tables, 0, j, value, w.slope)
    if kind > 0 and code == (NORMAL if kind == 1 else INVERSE):
        value = _slope(tables, c, 3 * m + j, w.turned, q, w.slope)
        _consider(tables, 1, j, value, w.slope)


@kernel
def _root(bases, tables, c, curve, low, high, a, b, q, w):
    """Return where the rate of a curve is zero between places where it is a and b."""
    place, at, side = 3 * tables.codes.shape[1] + curve, low, 0
    for _ in range(_STEPS):
        at = (low * b - high * a) / (b - a)
        if not low < at < high:
            at = 0.5 * (low + high)
            if not low < at < high:
                break
        _curves_at(bases, tables, c, at, q, w, w.curves[2])
        value = w.curves[2, place]
        if value == 0.0:
            break
        # A secant whose other end stays is bent towards it.
        if (value < 0.0) == (a < 0.0):
            low, a, b, side = at, value, 0.5 * b if side < 0 else b, -1
        else:
            high, b, a, side = at, value, 0.5 * a if side > 0 else a, 1
        if high - low <= 1e-15 * max(1.0, high):
            break
    return at

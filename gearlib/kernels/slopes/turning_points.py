"""Turning points of displacements and forces along an arc, and touches of flank lines.

Curves are sums of modes: |c y| e^(Re lambda t) bounds what each adds, so that a stretch on which no
curve comes near an extremum or a line is passed over. Elsewhere a curve lies between two places, h
apart, within h^4 / 384 max |f''''| of the cubic with the values and slopes it has there.
"""

import math

from gearlib.kernels.codes import INVERSE, NORMAL
from gearlib.kernels.jit import kernel
from gearlib.kernels.slopes.modal_turns import add_product, block_reach, turn

#: A turning point this close to a flank line, in static deflections, is a grazing.
_CLOSEST = 1e-10
#: What is higher by less than this share is not higher.
HIGHER = 1e-12
#: Distance from the cubic between two places, as a share of what a curve may move.
_CUBIC = 1e-3
#: A turning point closer to the start of the record than this phase is the start.
_AT_START = 1e-13
#: Steps that place a turning point to rounding; places within a step that is looked at again.
_STEPS, _AGAIN = 80, 8
#: Stretches with more places are halved, those with fewer doubled.
_MANY, _FEW = 16, 4
#: Rounding of a curve, as a share of its parts.
_ROUNDING = 2e-15
#: Of the counts: samples and events so far, whether a flank is touched, whether an arc is recorded,
#: its combination.
TAKEN, FOUND, TOUCHING, BEGUN, LAST = range(5)
#: Rows of the bounds of curves: centre, radius, that of the rate, fourth derivative, whether a
#: curve matters.
_CENTRE, _RADIUS, _SPEED, _FOURTH, _MATTERS = range(5)
BOUNDS = 5


@kernel
def turning_points(bases, tables, c, length, q, w):
    """Compare the turning points of all curves on an arc with the extrema, look for touches.

    Parameters are `Bases`, `Tables`, the combination of the arc, its length, the state and free
    tangents together, and `Work` with the coordinates at the start of the arc.
    """
    t, s = 0.0, tables.place
    while t < length:
        s = min(s, length - t)
        turn(bases, c, t, q, 1, 1, w.y, w.turned, w.terms)
        count = _places(bases, tables, c, s, w)
        if count > _MANY and s > tables.place:
            s *= 0.5
            continue
        if count > 0:
            _march(bases, tables, c, t, s / count, count, q, w)
        t = length if t + s >= length else t + s
        if count < _FEW:
            s *= 2.0


@kernel
def _places(bases, tables, c, s, w):
    """Fill the bounds of `Work` over a phase s; return how many places it takes, 0: none."""
    m, bounds, single = tables.codes.shape[1], w.bounds, bases.blocks[c, 0]
    half, state, curves = w.turned.shape[1] // 2, w.turned[0], tables.curves[c]
    bounds[:] = 0.0
    most = block_reach(bases, c, s, state, w.terms)
    for k in range(half):
        rate, own = bases.matrix[c, k, k], most[k]
        if k < single:
            own *= math.exp(max(rate.real * s, 0.0))
        for r in range(3 * m):
            if k >= single or abs(rate) * s < 1.0:
                # What is slow stays near where it is.
                bounds[_CENTRE, r] += (
                    curves[k, r] * state[k] + curves[half + k, r] * state[half + k]
                )
                bounds[_RADIUS, r] += s * tables.sizes[c, 1, k, r] * own
            else:
                bounds[_RADIUS, r] += tables.sizes[c, 0, k, r] * own
            bounds[_SPEED, r] += tables.sizes[c, 1, k, r] * own
            bounds[_FOURTH, r] += tables.sizes[c, 2, k, r] * own
    count = 0
    for r in range(m if tables.same else 0, 3 * m):
        centre, radius, fourth = bounds[_CENTRE, r], bounds[_RADIUS, r], bounds[_FOURTH, r]
        radius += _ROUNDING * abs(centre)
        if _matters(tables, c, r, centre - radius, centre + radius):
            bounds[_MATTERS, r] = 1.0
            share = s * math.sqrt(math.sqrt(fourth / (384.0 * _CUBIC * radius))) if fourth else 0.0
            # Comparisons with NaN fail: then the motion is beyond the range of numbers.
            count = max(count, int(math.ceil(share)) if share < 1e6 else 1000000, 1)
    return count


@kernel
def _matters(tables, c, curve, low, high):
    """Return whether an extremum or a touch may lie between two values of a curve."""
    m = tables.codes.shape[1]
    j, kind, code = curve % m, curve // m, tables.codes[c, curve % m]
    if kind > 0 and low < 2.0 * _CLOSEST and high > -2.0 * _CLOSEST:
        return True
    if kind == 0 or (kind == 1 and tables.same):
        if high > tables.best[0, j] or low < tables.best[1, j]:
            return True
    if kind > 0 and code == (NORMAL if kind == 1 else INVERSE):
        stiffness = tables.stiffness[c, j]
        return stiffness * high > tables.best[2, j] or stiffness * low < tables.best[3, j]
    return False


@kernel
def _march(bases, tables, c, begin, h, count, q, w):
    """Look at the curves that matter at places h apart."""
    m, old, new = tables.codes.shape[1], w.curves[0], w.curves[1]
    _curves_at(bases, tables, c, begin, q, w, new)
    for place in range(1, count + 1):
        old, new = new, old
        _curves_at(bases, tables, c, begin + place * h, q, w, new)
        for curve in range(3 * m):
            if w.bounds[_MATTERS, curve] > 0.0:
                first = begin + (place - 1) * h
                if _between(tables, c, curve, h, old, new, w):
                    _look_again(bases, tables, c, curve, first, h, old, q, w)
                elif w.reach[0] > 0.0:
                    a, b = old[3 * m + curve], new[3 * m + curve]
                    _turning_point(bases, tables, c, curve, first, first + h, a, b, q, w)


@kernel
def _between(tables, c, curve, h, old, new, w):
    """Return whether a curve may turn twice between two places, where it would matter.

    ``reach[0]`` of `Work` tells whether it turns once, as far as can be seen.
    """
    m = tables.codes.shape[1]
    f, g, a, b = old[curve], new[curve], old[3 * m + curve], new[3 * m + curve]
    noise = _ROUNDING * (w.bounds[_SPEED, curve] + abs(f) / tables.place)
    w.reach[0] = 0.0
    if abs(a) <= noise and abs(b) <= noise:
        # At rest: its values are those at the ends of the arc.
        return False
    # The coefficients of a cubic in Bernstein form hold it, and its rate.
    p, r, off = f + h * a / 3.0, g - h * b / 3.0, h**4 / 384.0 * w.bounds[_FOURTH, curve]
    off += _ROUNDING * (abs(f) + abs(g))
    low, high = min(f, g, p, r) - off, max(f, g, p, r) + off
    if not _matters(tables, c, curve, low, high):
        return False
    if (a < 0.0) != (b < 0.0):
        w.reach[0] = 1.0
        return False
    # The rate is that of the cubic to h^3 max |f''''| / 125.
    middle = (r - p) if a >= 0.0 else (p - r)
    return not h * min(abs(a), abs(b), 3.0 * middle / h) > 4.0 * off


@kernel
def _look_again(bases, tables, c, curve, begin, h, old, q, w):
    """Look for turning points between two places where a curve may turn twice."""
    m, step = tables.codes.shape[1], h / _AGAIN
    a = old[3 * m + curve]
    for place in range(1, _AGAIN + 1):
        _curves_at(bases, tables, c, begin + place * step, q, w, w.curves[2])
        b = w.curves[2, 3 * m + curve]
        if (a < 0.0) != (b < 0.0):
            last = begin + place * step
            _turning_point(bases, tables, c, curve, last - step, last, a, b, q, w)
        a = b


@kernel
def _curves_at(bases, tables, c, t, q, w, values):
    """Fill `values`, shape (6 m,), with the curves and their rates at t."""
    turn(bases, c, t, q, 1, 1, w.y, w.turned, w.terms)
    values[:] = 0.0
    add_product(w.turned[:1], tables.curves[c], values.reshape(1, values.size))


@kernel
def _turning_point(bases, tables, c, curve, low, high, a, b, q, w):
    """Compare a turning point of a curve with the extrema; note a touch."""
    m, k = tables.codes.shape[1], w.slope.shape[0]
    j, kind, code = curve % m, curve // m, tables.codes[c, curve % m]
    at = _root(bases, tables, c, curve, low, high, a, b, q, w)
    if not tables.counts[BEGUN] and at <= _AT_START:
        return
    _curves_at(bases, tables, c, at, q, w, w.curves[2])
    if kind > 0 and abs(w.curves[2, curve]) <= _CLOSEST:
        tables.counts[TOUCHING] = 1
    turn(bases, c, at, q, k, q + k, w.y, w.turned, w.terms)
    if kind == 0 or (kind == 1 and tables.same):
        value = _slope(tables, c, j, w.turned, q, w.slope)
        consider(tables, 0, j, value, w.slope)
    if kind > 0 and code == (NORMAL if kind == 1 else INVERSE):
        value = _slope(tables, c, 3 * m + j, w.turned, q, w.slope)
        consider(tables, 1, j, value, w.slope)


@kernel
def _root(bases, tables, c, curve, low, high, a, b, q, w):
    """Return where the rate of a curve is zero between places where it is a and b."""
    place, at, side = 3 * tables.codes.shape[1] + curve, low, 0
    for _ in range(_STEPS):
        before, at = at, (low * b - high * a) / (b - a)
        if not low < at < high:
            at = 0.5 * (low + high)
            if not low < at < high:
                break
        _curves_at(bases, tables, c, at, q, w, w.curves[2])
        value = w.curves[2, place]
        if value == 0.0 or abs(at - before) <= 1e-15 * max(1.0, high):
            break
        # A secant whose other end stays is bent towards it.
        if (value < 0.0) == (a < 0.0):
            low, a, b, side = at, value, 0.5 * b if side < 0 else b, -1
        else:
            high, b, a, side = at, value, 0.5 * a if side > 0 else a, 1
        if high - low <= 1e-15 * max(1.0, high):
            break
    return at


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
def consider(tables, which, j, value, slope):
    """Compare a displacement (0) or a force (1) with the extrema so far."""
    high, low = tables.best[2 * which, j], tables.best[2 * which + 1, j]
    size = HIGHER * (abs(high) + abs(low)) if high >= low else 0.0
    for place in (2 * which, 2 * which + 1):
        if value > high + size if place == 2 * which else value < low - size:
            tables.best[place, j] = value
            for one in range(slope.shape[0]):
                tables.extrema[place, j, one] = slope[one]

"""Tangents along a Taylor step: what its series change by with the start and with parameters.

Rows of arrays of shape (2 + k, ORDER + 1) or (2 + 3 k, ORDER + 1) are the columns of the map of
small deviations, a tangent for each of k directions and, if asked for, two for each of them by
which the map changes. Each obeys w'' + drag(t) w' + stiff(t) w = source(t), series of the step.
"""

from typing import NamedTuple

import numpy as np

from gearlib.kernels.closed_form.elementary import cos_sin
from gearlib.kernels.codes import BACKLASH
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.taylor.series import (
    D1,
    D2,
    D3,
    EXCITATION,
    GROUND,
    LEVEL,
    LINE,
    LOAD,
    ORDER,
    P2,
    P3,
    SLOPE,
    START,
    U_SQUARE,
    V_SQUARE,
    C,
    V,
    X,
)

_INVERSE = 1.0 / np.arange(1, ORDER + 2)  # of k + 1
#: Rows of `Columns.base`: deflection with its powers, g and its derivatives by it, squares and
#: cubes of x', stiffness of the mesh, damping; products of the stiffness with a row.
U, U2, U3, G, RATE, BEND, V2, V3, STIFF, DRAG, TURN, BENT, C_U, C_U2, C_U3 = range(15)


class Slopes(NamedTuple):
    """What the `tables` of a `Law` change by, for each of k directions."""

    constants: np.ndarray  #: shape (3, m, COLUMNS, k)
    harmonics: np.ndarray  #: of cosine and sine, shape (4, n, 2, k)
    breaks: np.ndarray  #: shape (m + 1, k)
    tuning: np.ndarray  #: shape (k,)


class Columns(NamedTuple):
    """Series of a step, of n columns and k directions; along the last axis ORDER + 1 terms."""

    a: np.ndarray  #: of w, shape (n, ORDER + 1)
    b: np.ndarray  #: of w', the same
    source: np.ndarray  #: the same; the terms of w'' so far while it is solved
    push: np.ndarray  #: what the mesh force changes by at fixed x, shape (k, ORDER + 1)
    waves: np.ndarray  #: what c(tau) changes by, the same
    more: np.ndarray  #: what drag and stiff change by, shape (2, k, ORDER + 1)
    base: np.ndarray  #: shape (15, ORDER + 1)


@kernel
def new_columns(k, rates):
    """Return empty `Columns` for k directions, with what the map changes by or not."""
    n = 2 + (3 * k if rates else k)
    return Columns(
        np.zeros((n, ORDER + 1)),
        np.zeros((n, ORDER + 1)),
        np.zeros((n, ORDER + 1)),
        np.zeros((k, ORDER + 1)),
        np.zeros((k, ORDER + 1)),
        np.zeros((2, k, ORDER + 1)),
        np.zeros((15, ORDER + 1)),
    )


@inlined
def _add_product(one, other, factor, target):
    """Add the product of two series to another, up to the term before the last."""
    for i in range(ORDER):
        # A stiffness without harmonics has two terms.
        if one[i] != 0.0:
            for k in range(ORDER - i):
                target[i + k] += factor * one[i] * other[k]


@inlined
def _times(one, other, target):
    """Fill a series with the product of two."""
    for k in range(ORDER):
        target[k] = 0.0
    _add_product(one, other, 1.0, target)


@inlined
def _any(moved, first, second):
    """Return whether one of two constants changes."""
    for j in range(moved.shape[1]):
        if moved[first, j] != 0.0 or moved[second, j] != 0.0:
            return True
    return False


@kernel
def _fill_base(row, moved, series, contact, sign, rates, base):
    """Fill `Columns.base` for a step; arguments as of `along_step`.

    Powers stay 0 where neither the step nor a direction asks for them.
    """
    for k in range(ORDER + 1):
        base[U, k] = series[X, k]
    base[U, 0] -= row[LINE]
    curved = row[P2] != 0.0 or row[P3] != 0.0 or _any(moved, P2, P3)
    # The map by itself asks for no product that directions alone change: the step has its squares.
    alone = moved.shape[1] == 0
    if alone:
        for k in range(ORDER):
            base[U2, k], base[V2, k] = series[U_SQUARE, k], series[V_SQUARE, k]
    elif curved:
        _times(base[U], base[U], base[U2])
        _times(base[U2], base[U], base[U3])
    if not alone and (row[D2] != 0.0 or row[D3] != 0.0 or _any(moved, D2, D3)):
        _times(series[V], series[V], base[V2])
        _times(base[V2], series[V], base[V3])
    d2, d3, p2, p3 = sign * row[D2], row[D3], row[P2], row[P3]
    for k in range(ORDER):
        base[G, k] = base[U, k] + p2 * base[U2, k] + p3 * base[U3, k]
        base[RATE, k] = 2.0 * p2 * base[U, k] + 3.0 * p3 * base[U2, k]
        base[BEND, k] = 6.0 * p3 * base[U, k]
        base[DRAG, k] = 2.0 * d2 * series[V, k] + 3.0 * d3 * base[V2, k]
        base[TURN, k] = 6.0 * d3 * series[V, k]
    base[RATE, 0] += 1.0
    base[BEND, 0] += 2.0 * p2
    base[DRAG, 0] += row[D1]
    base[TURN, 0] += 2.0 * d2
    for k in range(ORDER):
        base[STIFF, k] = 0.0
    if contact == BACKLASH:
        return
    _times(series[C], base[RATE], base[STIFF])
    if curved and not alone:
        _times(series[C], base[U], base[C_U])
        _times(series[C], base[U2], base[C_U2])
        _times(series[C], base[U3], base[C_U3])
        if rates:
            _times(series[C], base[BEND], base[BENT])


@inlined
def _add_waves(harmonics, slopes, which, phase, columns):
    """Add the series at `phase` of what harmonics change by to `columns`, shape (k, ORDER + 1)."""
    for i in range(slopes.shape[1]):
        n = harmonics[which, i, 0]
        if n == 0.0:
            break
        cosine, sine = cos_sin(n * phase)
        for j in range(slopes.shape[3]):
            one, other = slopes[which, i, 0, j], slopes[which, i, 1, j]
            if one == 0.0 and other == 0.0:
                continue
            even, odd = one * cosine + other * sine, other * cosine - one * sine
            for k in range(0, ORDER, 2):
                columns[j, k] += harmonics[which, i, 3 + k] * even
                columns[j, k + 1] += harmonics[which, i, 4 + k] * odd


@kernel
def _fill_sources(row, moved, harmonics, waves, phase, contact, sign, series, columns):
    """Fill the sources of the directions; arguments as of `along_step`."""
    base, count = columns.base, moved.shape[1]
    columns.source[:] = 0.0
    for j in range(count):
        source, push, stiff = columns.source[2 + j], columns.push[j], columns.waves[j]
        for k in range(ORDER):
            push[k] = stiff[k] = 0.0
            source[k] = (
                -moved[GROUND, j] * series[X, k]
                - moved[D1, j] * series[V, k]
                - sign * moved[D2, j] * base[V2, k]
                - moved[D3, j] * base[V3, k]
            )
        source[0] += moved[LOAD, j]
    _add_waves(harmonics, waves, EXCITATION, phase, columns.source[2:])
    if contact == BACKLASH:
        return
    _add_waves(harmonics, waves, contact + 1, phase, columns.waves)
    late = phase - row[START]
    for j in range(count):
        source, push, stiff = columns.source[2 + j], columns.push[j], columns.waves[j]
        stiff[0] += moved[LEVEL, j] + moved[SLOPE, j] * late - row[SLOPE] * moved[START, j]
        stiff[1] += moved[SLOPE, j]
        _add_product(stiff, base[G], 1.0, push)
        for k in range(ORDER):
            push[k] += moved[P2, j] * base[C_U2, k] + moved[P3, j] * base[C_U3, k]
            push[k] -= moved[LINE, j] * base[STIFF, k]
            source[k] -= push[k]


@kernel
def _fill_rates(moved, contact, sign, series, columns):
    """Fill the sources by which the map changes, its series and the tangents known."""
    a, b, source, base = columns.a, columns.b, columns.source, columns.base
    count = moved.shape[1]
    for j in range(count):
        drag, stiff = columns.more[0, j], columns.more[1, j]
        for k in range(ORDER):
            stiff[k] = 0.0
            drag[k] = 2.0 * sign * moved[D2, j] * series[V, k] + 3.0 * moved[D3, j] * base[V2, k]
        drag[0] += moved[D1, j]
        stiff[0] += moved[GROUND, j]
        _add_product(base[TURN], b[2 + j], 1.0, drag)
        if contact != BACKLASH:
            _add_product(columns.waves[j], base[RATE], 1.0, stiff)
            _add_product(base[BENT], a[2 + j], 1.0, stiff)
            for k in range(ORDER):
                stiff[k] += 2.0 * moved[P2, j] * base[C_U, k] + 3.0 * moved[P3, j] * base[C_U2, k]
                stiff[k] -= moved[LINE, j] * base[BENT, k]
        for m in range(2):
            own = source[2 + count + 2 * j + m]
            _add_product(drag, b[m], -1.0, own)
            _add_product(stiff, a[m], -1.0, own)


@kernel
def _solve(ground, columns, first, last):
    """Fill the series of some columns, whose first terms and sources are known."""
    drag, stiff = columns.base[DRAG], columns.base[STIFF]
    terms = ORDER
    while terms > 1 and drag[terms - 1] == 0.0 and stiff[terms - 1] == 0.0:
        terms -= 1
    for j in range(first, last):
        a, b, rest = columns.a[j], columns.b[j], columns.source[j]
        for k in range(ORDER):
            x, v = a[k], b[k]
            # What the terms so far count in all that follow.
            for i in range(min(terms, ORDER - k)):
                rest[k + i] -= drag[i] * v + stiff[i] * x
            a[k + 1] = v * _INVERSE[k]
            b[k + 1] = (rest[k] - ground * x) * _INVERSE[k]


@kernel
def along_step(row, moved, harmonics, waves, phase, contact, sign, series, w, columns):
    """Fill the series of all columns over a step whose own are in `series`.

    `row`, shape (COLUMNS,): constants of its contact and piece; `moved`, shape (COLUMNS, k): what
    they change by; `harmonics` as of `tables`, `waves` of `Slopes`; `w`, shape (2, n): the columns
    at its start.
    """
    k, n = moved.shape[1], w.shape[1]
    _fill_base(row, moved, series, contact, sign, n > 2 + k, columns.base)
    _fill_sources(row, moved, harmonics, waves, phase, contact, sign, series, columns)
    for j in range(n):
        columns.a[j, 0], columns.b[j, 0] = w[0, j], w[1, j]
    _solve(row[GROUND], columns, 0, 2 + k)
    if n > 2 + k:
        _fill_rates(moved, contact, sign, series, columns)
        _solve(row[GROUND], columns, 2 + k, n)


@kernel
def columns_at(columns, t, target):
    """Fill `target`, shape (n,), with the sums of the first n columns at t after the start."""
    for j in range(target.shape[0]):
        total = columns[j, ORDER]
        for k in range(ORDER - 1, -1, -1):
            total = total * t + columns[j, k]
        target[j] = total

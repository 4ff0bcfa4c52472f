"""Derivatives of what a run records: samples, events, extrema, shares of time.

An extremum is a turning point, the start or the end of the record or, of a force, a switch of the
stiffness: the first moves, but changes nothing by that.
"""

from typing import NamedTuple

import numpy as np

from gearlib.kernels.codes import BACKLASH, INVERSE
from gearlib.kernels.jit import kernel
from gearlib.kernels.slopes.itinerary import FROM, LEFT, MESH, MET, TO
from gearlib.kernels.slopes.modal_turns import add_product, turn
from gearlib.kernels.slopes.turning_points import (
    BEGUN,
    FOUND,
    HIGHER,
    LAST,
    TAKEN,
    consider,
    turning_points,
)

#: Phases closer than this are one.
_SAME_PHASE = 1e-12


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
    #: Of the shares of coordinates in the first 3 m: sizes, those of the rates and of the fourth
    #: derivatives, shape (C, 3, M, 3 m).
    sizes: np.ndarray
    velocity: np.ndarray  #: rates of displacements in components, shape (m, n)
    velocity_slopes: np.ndarray  #: shape (k, m, n)
    rates: np.ndarray  #: rates of the distances in components, shape (2 m, n)
    codes: np.ndarray  #: contact codes, int, shape (C, m)
    stiffness: np.ndarray  #: shape (C, m)
    low: np.ndarray  #: as of `itinerary.Places`
    place: float  #: shortest phase over which curves are looked at as one
    same: bool  #: whether displacements are the distances from the near flank
    samples: np.ndarray  #: filled, shape (s, k, r)
    events: np.ndarray  #: filled with those of phase and velocity, shape (e, 2, k)
    times: np.ndarray  #: in normal mesh, backlash, inverse mesh, at lower stiffness, (4, m, k)
    best: np.ndarray  #: largest and smallest displacement and force, shape (4, m)
    extrema: np.ndarray  #: filled with their slopes, shape (4, m, k)
    apart: np.ndarray  #: bool, whether the flanks of a mesh were apart, shape (m,)
    moved: np.ndarray  #: by what the switch at the start of an arc moves, shape (m, k)
    counts: np.ndarray  #: int, shape (5,)
    begin: np.ndarray  #: phase at which the present period begins, shape (1,)
    begins: np.ndarray  #: those of all periods
    when: np.ndarray  #: phases of the samples, rising, shape (s,)


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
def _consider_end(tables, c, j, moved, q, w):
    """Compare the end of an arc, which moves by `moved`, shape (k,), with the extrema."""
    m = tables.codes.shape[1]
    value, rate = _slope_at(tables, c, j, q, w), 0.0
    for i in range(w.z.shape[1]):
        rate += tables.velocity[j, i] * w.z[0, i]
    for one in range(moved.shape[0]):
        w.slope[one] += rate * moved[one]
    consider(tables, 0, j, value, w.slope)
    code = tables.codes[c, j]
    if code == BACKLASH:
        return
    value, rate = _slope_at(tables, c, 3 * m + j, q, w), 0.0
    row = tables.rates[m + j if code == INVERSE else j]
    for i in range(w.z.shape[1]):
        rate += row[i] * w.z[0, i]
    for one in range(moved.shape[0]):
        w.slope[one] += tables.stiffness[c, j] * rate * moved[one]
    consider(tables, 1, j, value, w.slope)


@kernel
def end_record(tables, q, w):
    """Compare the end of the record, which moves by `Tables.moved`, and the backlash."""
    for j in range(tables.codes.shape[1]):
        _consider_end(tables, tables.counts[LAST], j, tables.moved[j], q, w)
        for place in (2, 3):
            best = tables.best[place, j]
            size = HIGHER * (abs(tables.best[2, j]) + abs(tables.best[3, j]))
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
    low = tables.low[step[FROM] + 1, :, j]
    sign = (1.0 if low[step[LEFT]] else 0.0) - (1.0 if low[step[MET]] else 0.0)
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
    k, first, out = w.slope.shape[0], tables.begin[0] + t, w.turned
    while tables.counts[TAKEN] < tables.when.shape[0]:
        at = tables.when[tables.counts[TAKEN]] - first
        if not at < length - _SAME_PHASE:
            break
        turn(bases, c, max(at, 0.0), q, k, w.y.shape[0], w.y, out, w.terms)
        sample = tables.samples[tables.counts[TAKEN]]
        sample[:] = 0.0
        add_product(out[q : q + k], tables.of_tangents[c], sample)
        add_product(out[:1], tables.of_states[c], sample.reshape(1, sample.size))
        tables.counts[TAKEN] += 1
    turning_points(bases, tables, c, length, q, w)
    tables.counts[BEGUN], tables.counts[LAST] = 1, c

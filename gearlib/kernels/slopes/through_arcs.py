"""Tangents of a piecewise-linear motion: along arcs, over flank lines, over switches.

Between events z' = A z. A tangent w = dz/dp at fixed phase obeys w' = A w + (dA/dp) z, and so do
the columns of the map of small deviations and what these change by. Where dz/dtau jumps at a phase
that moves by dtau,

    w+ = w- + (f- - f+) dtau.

On a flank line row z = 0 the jump is as large as the speed, f- - f+ = s (row f), and the phase
moves by dtau = -(row w + (d row/dp) z) / (row f): the speed cancels. The slopes of the map M of
small deviations, a product of those of arcs and of crossings, S = 1 - s row, follow in the same
way; see `docs/theory/sensitivities.md`.

What is carried are rows: the state and f free tangents, q = 1 + f together, then what
the state changes by, for k directions, then what each free tangent changes by, if that is wanted.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels.jit import kernel
from gearlib.kernels.slopes.itinerary import ARC, CROSSING, KIND, MESH, PERIOD
from gearlib.kernels.slopes.modal_turns import add_product, turn
from gearlib.kernels.slopes.recorded_slopes import (
    begin_arc,
    event_velocity,
    note_crossing,
    note_switch,
    record_arc,
)

#: An event slower than this, in static deflections by natural time, is a grazing: see
#: `gearlib.kernels.closed_form.sensitivity`.
SLOWEST = 1e-5


class Boundaries(NamedTuple):
    """What changes where arcs meet: J crossings and switches, C combinations, n components."""

    row: np.ndarray  #: the distance from the flank line, shape (J, n)
    row_slopes: np.ndarray  #: shape (J, k, n)
    speed: np.ndarray  #: its rate, shape (J, n)
    jump: np.ndarray  #: by what dz/dtau falls, over the speed, shape (J, n)
    jump_slopes: np.ndarray  #: shape (J, k, n)
    difference: np.ndarray  #: of the matrices at a switch, transposed, shape (J, n, n)
    moved: np.ndarray  #: by what a switch moves, shape (J, k)
    course: np.ndarray  #: what the factor of all speeds of a run-up changes by, shape (k,)
    matrix: np.ndarray  #: of each combination, transposed, shape (C, n, n)
    tuning: float


class Work(NamedTuple):
    """Storage of a walk with l rows, k directions."""

    z: np.ndarray  #: the rows, shape (l, n)
    y: np.ndarray  #: their coordinates at the start of an arc, shape (l, 2 M)
    turned: np.ndarray  #: and later, the same shape
    terms: np.ndarray  #: of a series, complex, shape (2, l, M)
    reach: np.ndarray  #: shape (l,)
    moved: np.ndarray  #: by what the phase of an event moves, shape (k,)
    slope: np.ndarray  #: shape (k,)
    curves: np.ndarray  #: shape (3, 6 m)
    bounds: np.ndarray  #: of curves, shape (BOUNDS, 3 m)


@kernel
def _shifted(shift, sign, q, sources, k, z):
    """Add sign S z to what each source changes by."""
    n = z.shape[1]
    for source in range(sources):
        first = q + source * k
        slopes = z[first : first + k].reshape(k * n)
        for c in range(n):
            factor, row = sign * z[source, c], shift[c]
            if factor != 0.0:
                for i in range(k * n):
                    slopes[i] += factor * row[i]


@kernel
def _meet(bounds, j, q, w):
    """Fill `reach` of all rows at a flank line, and `moved`; return whether it is met slowly."""
    z, reach, moved, row, speed = w.z, w.reach, w.moved, bounds.row[j], 0.0
    for i in range(z.shape[1]):
        speed += bounds.speed[j, i] * z[0, i]
    for r in range(z.shape[0]):
        reach[r] = 0.0
        for i in range(z.shape[1]):
            reach[r] += row[i] * z[r, i]
    slow = not abs(speed) * bounds.tuning > SLOWEST
    for one in range(moved.shape[0]):
        for i in range(z.shape[1]):
            reach[q + one] += bounds.row_slopes[j, one, i] * z[0, i]
        moved[one] = math.nan if slow else -reach[q + one] / speed
    return slow


@kernel
def _cross(bounds, j, before, after, q, rates, w):
    """Take all rows over the flank line that `_meet` has looked at."""
    z, reach, moved, row, jump = w.z, w.reach, w.moved, bounds.row[j], bounds.jump[j]
    n, k = z.shape[1], moved.shape[0]
    for r in range(1, z.shape[0]):
        for i in range(n):
            z[r, i] -= jump[i] * reach[r]
    if not rates:
        return
    # M goes over by S: the arc before lasts longer, that behind less, and S itself changes.
    crossed = z[1:q].copy()
    first, second = np.zeros((q - 1, n)), np.zeros((q - 1, n))
    add_product(crossed, bounds.matrix[after], second)
    for r in range(q - 1):
        for i in range(n):
            crossed[r, i] += jump[i] * reach[1 + r]
    add_product(crossed, bounds.matrix[before], first)
    for r in range(q - 1):
        fall = 0.0
        for i in range(n):
            fall += row[i] * first[r, i]
        for one in range(k):
            own, slopes = z[q + (r + 1) * k + one], bounds.jump_slopes[j, one]
            for i in range(n):
                step = first[r, i] - jump[i] * fall - second[r, i]
                own[i] += moved[one] * step - slopes[i] * reach[1 + r]


@kernel
def _switch(bounds, j, q, sources, w):
    """Take all rows over a switch of the stiffness that moves as `Work` says."""
    z, k, n = w.z, w.moved.shape[0], w.z.shape[1]
    fall = np.zeros((sources, n))
    add_product(z[:sources], bounds.difference[j], fall)
    for source in range(sources):
        for one in range(k):
            own = z[q + source * k + one]
            for i in range(n):
                own[i] += fall[source, i] * w.moved[one]


@kernel
def walk(bases, bounds, states, steps, times, which, where, q, rates, w, recording, tables):
    """Take rows through steps of a motion.

    Parameters
    ----------
    bases, bounds : Bases, Boundaries
    states : ndarray, shape (periods, n)
    steps, times : ndarray
        As of `itinerary.itinerary`; of a switch of a run-up, times are what it moves by with the
        phase and with the factor of all speeds, 1 / nu and -phase / nu.
    which, where : ndarray of int
        The combination of each step, and its row of the boundaries.
    q : int
        The state and the free tangents.
    rates : bool
        Whether free tangents, an identity at the start, have slopes.
    w : Work
        Its `z` is changed in place.
    recording : bool
        Whether to fill the `recorded_slopes.Tables` too.

    Returns
    -------
    bool
        Whether a recorded event is so slow that it is a grazing.
    """
    grazing, z, y, out = False, w.z, w.y, w.turned
    k, sources = w.moved.shape[0], q if rates else 1
    for i in range(steps.shape[0]):
        kind, c, j = steps[i, KIND], which[i], where[i]
        if kind == ARC:
            if recording:
                begin_arc(tables, c, q, w)
            _shifted(bases.shift[c], 1.0, q, sources, k, z)
            y[:] = 0.0
            add_product(z, bases.into[c], y)
            if recording:
                record_arc(bases, tables, c, times[i, 0], times[i, 1], q, w)
            turn(bases, c, times[i, 1], q, k, z.shape[0], y, out, w.terms)
            z[:] = 0.0
            add_product(out, bases.out[c], z)
            _shifted(bases.shift[c], -1.0, q, sources, k, z)
        elif kind == PERIOD:
            for r in range(z.shape[1]):
                z[0, r] = states[steps[i, MESH], r]
            if recording:
                tables.begin[0] = tables.begins[steps[i, MESH]]
        elif kind == CROSSING:
            slow = _meet(bounds, j, q, w)
            if recording:
                grazing = grazing or slow
                event_velocity(tables, bounds.matrix[c], steps[i, MESH], q, w)
                note_crossing(tables, steps[i], w.moved, w.slope)
            _cross(bounds, j, c, which[i + 1] if i + 1 < which.shape[0] else c, q, rates, w)
        else:
            for one in range(k):
                w.moved[one] = times[i, 0] * bounds.moved[j, one] + times[i, 1] * bounds.course[one]
            if recording:
                note_switch(tables, steps[i], w.moved, q, w)
            _switch(bounds, j, q, sources, w)
    return grazing

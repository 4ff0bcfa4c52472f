"""Tangents of a piecewise-linear motion: along arcs, over flank lines, over switches.

Between events z' = A z. A tangent w = dz/dp at fixed phase obeys w' = A w + (dA/dp) z, and so do the
columns of the map of small deviations and what these change by. Where dz/dtau jumps at a phase that
moves by dtau,

    w+ = w- + (f- - f+) dtau.

On a flank line row z = 0 the jump is as large as the speed, f- - f+ = s (row f), and the phase
moves by dtau = -(row w + (d row/dp) z) / (row f): the speed cancels. The slopes of the map M of
small deviations, a product of those of arcs and of crossings, S = 1 - s row, follow in the same
way; see `docs/theory/sensitivities.md`.

What is carried is a block of columns: the state and f free tangents, q = 1 + f together, then what
the state changes by, for k directions, then what each free tangent changes by, if that is wanted.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels.jit import kernel
from gearlib.kernels.slopes.itinerary import ARC, CROSSING, KIND, MESH, PERIOD
from gearlib.kernels.slopes.modal_turns import multiplied, turn
from gearlib.kernels.slopes.recorded_slopes import (
    PERIOD_START,
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
    difference: np.ndarray  #: of the matrices before and after a switch, shape (J, n, n)
    moved: np.ndarray  #: by what a switch moves, shape (J, k)
    matrix: np.ndarray  #: of each combination, shape (C, n, n)
    tuning: float


class Work(NamedTuple):
    """Storage of a walk with so many columns, k directions."""

    z: np.ndarray  #: the block, shape (n, columns)
    y: np.ndarray  #: its coordinates at the start of an arc, shape (2 M, columns)
    turned: np.ndarray  #: and later, the same shape
    terms: np.ndarray  #: of a series, complex, shape (2, M, columns)
    shift: np.ndarray  #: shape (k s,)
    reach: np.ndarray  #: shape (columns,)
    moved: np.ndarray  #: by what the phase of an event moves, shape (k,)
    slope: np.ndarray  #: shape (k,)


@kernel
def _shifted(shift, sign, q, sources, k, z, work):
    """Add sign S z to what each source changes by."""
    size = shift.shape[1]
    moving = size // k if k else 0
    for source in range(sources):
        for i in range(size):
            work[i] = 0.0
        for c in range(z.shape[0]):
            factor, row = sign * z[c, source], shift[c]
            if factor != 0.0:
                for i in range(size):
                    work[i] += factor * row[i]
        first = q + source * k
        for one in range(k):
            for r in range(moving):
                z[r, first + one] += work[one * moving + r]


@kernel
def _meet(bounds, j, q, w):
    """Fill `reach` of all columns at a flank line, and `moved`; return whether it is met slowly."""
    z, reach, moved, row = w.z, w.reach, w.moved, bounds.row[j]
    n, columns = z.shape
    for c in range(columns):
        reach[c] = 0.0
    speed = 0.0
    for r in range(n):
        speed += bounds.speed[j, r] * z[r, 0]
        if row[r] != 0.0:
            for c in range(columns):
                reach[c] += row[r] * z[r, c]
    slow = not abs(speed) * bounds.tuning > SLOWEST
    for one in range(moved.shape[0]):
        for r in range(n):
            reach[q + one] += bounds.row_slopes[j, one, r] * z[r, 0]
        moved[one] = math.nan if slow else -reach[q + one] / speed
    return slow


@kernel
def _cross(bounds, j, before, after, q, rates, w):
    """Take all columns over the flank line that `_meet` has looked at."""
    z, reach, moved, row, jump = w.z, w.reach, w.moved, bounds.row[j], bounds.jump[j]
    n, columns = z.shape
    k, f = moved.shape[0], q - 1
    for c in range(1, columns):
        for r in range(n):
            z[r, c] -= jump[r] * reach[c]
    if not rates:
        return
    # M goes over by S: the arc before lasts longer, that behind less, and S itself changes.
    crossed = z[:, 1:q].copy()
    first, second = np.zeros((n, f)), np.zeros((n, f))
    multiplied(bounds.matrix[after], crossed, f, second)
    for c in range(f):
        for r in range(n):
            crossed[r, c] += jump[r] * reach[1 + c]
    multiplied(bounds.matrix[before], crossed, f, first)
    for c in range(f):
        fall = 0.0
        for r in range(n):
            fall += row[r] * first[r, c]
        for r in range(n):
            step = first[r, c] - jump[r] * fall - second[r, c]
            for one in range(k):
                change = moved[one] * step - bounds.jump_slopes[j, one, r] * reach[1 + c]
                z[r, q + (c + 1) * k + one] += change


@kernel
def _switch(bounds, j, q, sources, w):
    """Take all columns over a switch of the stiffness that moves."""
    z, k, n = w.z, w.moved.shape[0], w.z.shape[0]
    for source in range(sources):
        for r in range(n):
            total = 0.0
            for c in range(n):
                total += bounds.difference[j, r, c] * z[c, source]
            if total != 0.0:
                for one in range(k):
                    z[r, q + source * k + one] += total * bounds.moved[j, one]


@kernel
def walk(bases, bounds, states, steps, times, which, where, q, rates, w, recording, tables):
    """Take a block of columns through steps of a motion.

    Parameters
    ----------
    bases, bounds : Bases, Boundaries
    states : ndarray, shape (periods, n)
    steps, times : ndarray
        As of `itinerary.itinerary`.
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
    grazing, z, n, columns = False, w.z, w.z.shape[0], w.z.shape[1]
    k, sources = w.moved.shape[0], q if rates else 1
    for i in range(steps.shape[0]):
        kind, c, j = steps[i, KIND], which[i], where[i]
        if kind == ARC:
            if recording:
                begin_arc(tables, c, q, w)
            _shifted(bases.shift[c], 1.0, q, sources, k, z, w.shift)
            multiplied(bases.into[c], z, columns, w.y)
            if recording:
                record_arc(bases, tables, c, times[i, 0], times[i, 1], q, w)
            turn(bases, c, times[i, 1], q, k, columns, w.y, w.turned, w.terms)
            multiplied(bases.out[c], w.turned, columns, z)
            _shifted(bases.shift[c], -1.0, q, sources, k, z, w.shift)
        elif kind == PERIOD:
            for r in range(n):
                z[r, 0] = states[steps[i, MESH], r]
            if recording:
                tables.phase[PERIOD_START] = 2.0 * math.pi * steps[i, MESH]
        elif kind == CROSSING:
            slow = _meet(bounds, j, q, w)
            if recording:
                grazing = grazing or slow
                event_velocity(tables, c, steps[i, MESH], q, w)
                note_crossing(tables, steps[i], w.moved, w.slope)
            _cross(bounds, j, c, which[i + 1] if i + 1 < which.shape[0] else c, q, rates, w)
        else:
            if recording:
                note_switch(tables, steps[i], c, bounds.moved[j], q, w)
            _switch(bounds, j, q, sources, w)
    return grazing

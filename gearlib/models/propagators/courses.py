"""Runs through a course of speed and load: run-ups, run-downs, steps and ramps of torque.

Between switches of stiffness nothing depends on the speed: over theta, the time of the model, a
piece of constant acceleration has the matrices of a run at constant speed and switches at other
instants. With the mesh phase tau = tau_0 + nu_0 theta + a theta^2 / 2 the time between two switches
is 2 dtau / (nu_1 + nu_2), nu^2 = nu_0^2 + 2 a (tau - tau_0): no digits cancel, and a = 0 gives the
segments of a run at constant speed. The inertia of the acceleration and steps of the load change
the constant of the state; a ramp of the load adds a component that grows by 1 in a unit of theta.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from gearlib.kernels.codes import OK
from gearlib.kernels.several_meshes.periods import EVENT_COLUMNS
from gearlib.kernels.several_meshes.record import SUMMARY_COLUMNS
from gearlib.kernels.several_meshes.sparse_series import sparse_of
from gearlib.models.propagators import piecewise_linear, several_meshes

#: Mesh periods whose segments are made at once.
_STRETCH = 512
#: Phases closer than this share of the whole phase are one, as of `gearlib.models.trains.waves`.
_SAME_PHASE = 1e-12
#: Of a mesh period, as far from ratios of small numbers as there is: the golden section.
_INSTANT = 0.3819660112501051


class Piece(NamedTuple):
    """A piece of a course, on which speed and load are linear in theta."""

    start: float  #: theta
    length: float  #: theta
    phase: float  #: tau at its start
    speed: float  #: nu at its start
    acceleration: float  #: dnu/dtheta
    load: float  #: share of the load at its start
    slope: float  #: of that share, by theta

    def speed_at(self, phase):
        """Return nu at a phase tau of the piece (float or array)."""
        square = self.speed**2 + 2.0 * self.acceleration * (phase - self.phase)
        return np.sqrt(np.maximum(square, 0.0))

    def by(self, theta):
        """Return (nu, tau, share of the load) at theta (float or array)."""
        t = theta - self.start
        speed = np.maximum(self.speed + self.acceleration * t, 0.0)
        return speed, self.phase + 0.5 * (self.speed + speed) * t, self.load + self.slope * t


class Stretch(NamedTuple):
    """What some intervals of a run have recorded: mesh periods, cut where pieces end."""

    piece: Piece
    phase: np.ndarray  #: tau that bounds the intervals, shape (k + 1,)
    theta: np.ndarray  #: theta that bounds them
    samples: np.ndarray  #: at equal steps of time in each, columns of `orbit`, (k s, m, 6)
    states: np.ndarray  #: coordinates and their rates by theta, shape (k s, 2 N)
    block: np.ndarray  #: int, number of the block of each interval, shape (k,)
    summary: np.ndarray  #: of each block that there is, shape (b, m, 10)
    #: (theta, mesh, from, to, velocity by theta, interval, theta in it), shape (j, 7)
    events: np.ndarray
    status: int


def pieces_of(speeds, loads):
    """Return the pieces of a course.

    Parameters
    ----------
    speeds, loads : ndarray, shapes (j, 2), (k, 2)
        Rows of theta and tuning, of theta and share of the load, theta rising; two rows of loads at
        one theta are a step. The last value holds from there on; speeds end the course.
    """
    marks = np.union1d(speeds[:, 0], loads[:, 0])
    marks = marks[(marks >= speeds[0, 0]) & (marks <= speeds[-1, 0])]
    found, phase = [], 0.0
    for start, end in zip(marks[:-1].tolist(), marks[1:].tolist(), strict=True):
        (first, a), (load, slope) = _line(speeds, start), _line(loads, start)
        piece = Piece(start, end - start, phase, first, a, load, slope)
        found.append(piece)
        phase += piece.length * (first + 0.5 * a * piece.length)
    return found


def _line(rows, start):
    """Return (value, slope) of a piecewise linear course just after `start`."""
    i = int(np.searchsorted(rows[:, 0], start, side="right")) - 1
    if i < 0:
        return float(rows[0, 1]), 0.0
    if i == len(rows) - 1:
        return float(rows[-1, 1]), 0.0
    (t, value), (end, after) = rows[i : i + 2].tolist()
    slope = (after - value) / (end - t)
    return value + slope * (start - t), slope


class _Course:
    """The part of a propagator whose systems are those of stretches of a course."""

    system: Any
    grid: Any

    def ahead(self, first, done, spans):
        """As of `several_meshes.Propagator`: all segments are there."""
        return self.system, self.grid, spans[0]


class _Train(_Course, several_meshes.Propagator):
    """A train on its way."""


class _Pair(_Course, piecewise_linear.Propagator):
    """A model with one mesh on its way."""


def propagator_of(model):
    """Return the propagator, by theta, of a piecewise-linear model on its way."""
    return (_Train if model.mesh_names else _Pair)(model, 1.0)


def run_through(runner, pieces, state, samples, limit, inertia, teeth):
    """Yield a `Stretch` after the other of a run through pieces, up to one that fails.

    Parameters
    ----------
    runner : propagator_of
        Of a model without harmonics.
    pieces : list of Piece
    state : ndarray, shape (2 N,)
        At the start, rates by theta; changed in place.
    samples : int
        In each mesh period, at equal steps of time.
    limit : int
        Most events in one mesh period.
    inertia : ndarray, shape (N,)
        Accelerations of the coordinates by theta for a unit of d2tau/dtheta2.
    teeth : float
        Mesh periods of a block, of which there is one summary.
    """
    base, grid = runner.system, runner.grid
    for piece in pieces:
        system = _loaded(base, piece, inertia)
        # Tables of another number of components are of no use.
        runner.spare, runner.large = [], []
        for cut in _cuts(runner.model, base, piece):
            _set(runner, piece, system, grid, cut, teeth)
            done = _through(runner, piece, state, cut, samples, limit, teeth)
            yield done
            if done.status != OK:
                return


def _loaded(base, piece, inertia):
    """Return the system of a piece: its loads, and one component more where they change."""
    n, half = len(base.free), inertia.size
    one, rows = n - 1, slice(half, 2 * half)
    free = base.free.copy()
    load = free[rows, one].copy()
    free[rows, one] = load * piece.load + inertia * piece.acceleration
    if piece.slope == 0.0:
        return base._replace(free=free)

    def wider(array):
        return np.insert(array, one, 0.0, axis=-1)

    free = np.insert(wider(free), one, 0.0, axis=0)
    free[one, one + 1], free[rows, one] = 1.0, load * piece.slope
    lines = "near", "far", "push", "grip"
    return base._replace(free=free, **{name: wider(getattr(base, name)) for name in lines})


class _Cut(NamedTuple):
    """Intervals of a piece: its mesh periods, the first and the last cut at its ends."""

    phase: np.ndarray  #: tau from `offset` on that bounds segments, shape (p + 1,)
    offset: float
    first: np.ndarray  #: where intervals begin, shape (k + 1,)
    which: np.ndarray  #: segments of `source`, shape (p,)
    source: Any  #: the system that has their stiffness


def _cuts(model, base, piece):
    """Yield the intervals of a piece, so many at a time as a `_Cut`."""
    end = piece.phase + piece.length * (piece.speed + 0.5 * piece.acceleration * piece.length)
    tau, repeats = 2.0 * math.pi, len(base.first_segment) - 1
    close = _SAME_PHASE * max(end, 1.0)
    long = repeats > _STRETCH
    count = _STRETCH if long else _STRETCH // repeats * repeats
    first = int((piece.phase + close) / tau) // count * count
    while True:
        source = model.system(1.0, first, count) if long else base
        times, size = 1 if long else count // repeats, source.starts.size - 1
        which, turn = np.tile(np.arange(size), times), np.arange(times)
        cuts = np.append(
            (turn[:, None] * source.starts[-1] + source.starts[:-1]).ravel(), tau * count
        )
        marks = (turn[:, None] * size + source.first_segment[:-1]).ravel()
        begin, stop = piece.phase - tau * first, end - tau * first
        i = max(int(np.searchsorted(cuts, begin + close, side="right")) - 1, 0)
        j = min(int(np.searchsorted(cuts, stop - close)), which.size)
        j = max(j, i + 1)
        phase = cuts[i : j + 1].copy()
        phase[0], phase[-1] = max(phase[0], begin), max(min(phase[-1], stop), begin)
        inner = marks[(marks > i) & (marks < j)] - i
        yield _Cut(phase, tau * first, np.array([0, *inner, j - i]), which[i:j], source)
        first += count
        if tau * first >= end - close:
            return


def _set(runner, piece, system, grid, cut, teeth):
    """Give a runner the segments of a `_Cut`."""
    speed = piece.speed_at(cut.offset + cut.phase)
    total = speed[:-1] + speed[1:]
    if total.any():
        length = 2.0 * np.diff(cut.phase) / total
    else:
        length = np.array([piece.length])
    starts, tables = np.concatenate([[0.0], np.cumsum(length)]), ("effect", "stiffness", "low")
    runner.system = system._replace(
        starts=starts,
        first_segment=cut.first,
        repeats=len(cut.first) - 1,
        **{name: np.ascontiguousarray(getattr(cut.source, name)[:, cut.which]) for name in tables},
    )
    runner.grid = grid._replace(
        length=length,
        kind=np.full(length.size, -1),
        rate=system.near @ system.free,
        far_rate=system.far @ system.free,
        block=_blocks(cut, teeth) - _blocks(cut, teeth)[0],
        **sparse_of(system),
    )
    runner.components = len(system.free)


def _through(runner, piece, state, cut, samples, limit, teeth):
    """Run through the intervals of a `_Cut`; return the `Stretch`."""
    system, count = runner.system, len(cut.first) - 1
    m, half = len(system.near), state.size // 2
    raw, summary = (
        runner.raw(count * samples),
        np.empty(((runner.grid.block[-1] + 1) * m, SUMMARY_COLUMNS)),
    )
    events, spans = np.empty((4 * count * m, EVENT_COLUMNS)), (count, count)
    bounds = system.starts[cut.first] + _theta(piece, cut.offset + cut.phase[0])
    # The components between the rates and the constant, at their values.
    whole = np.append(state, bounds[0] - piece.start if piece.slope else ())
    runner.scale = np.ones(whole.size)
    _, events, found, code, _ = runner.go(whole, raw, events, limit, summary, spans)
    state[:] = whole[: state.size]
    events, columns = events[: found if code == OK else 0], np.zeros((len(raw), m, 6))
    if code == OK:
        runner.fill_meshes(raw, columns, system)
    rows_of = events[:, [1, -1, 2, 3, 4, 0, 1]]
    rows_of[:, 0] += bounds[events[:, 0].astype(int)]
    return Stretch(
        piece,
        cut.offset + cut.phase[cut.first],
        bounds,
        columns,
        raw[:, : 2 * half],
        _blocks(cut, teeth),
        summary.reshape(-1, m, SUMMARY_COLUMNS),
        rows_of,
        code,
    )


def _blocks(cut, teeth):
    """Return the numbers of the blocks of the intervals of a `_Cut`."""
    middle = (cut.phase[cut.first[:-1]] + cut.phase[cut.first[1:]]) / 2.0 + cut.offset
    # All of a mesh period belongs to one of them, that of an instant in it at which no ratio of
    # teeth lets a block begin, where rounding would decide.
    return ((np.floor(middle / (2.0 * math.pi)) + _INSTANT) / teeth).astype(int)


def _theta(piece, phase):
    """Return theta at a phase of a piece."""
    passed = phase - piece.phase
    if passed <= 0.0:
        return piece.start
    return piece.start + 2.0 * passed / (piece.speed + float(piece.speed_at(phase)))

"""Runs through a course of speed and load: run-ups, run-downs, steps and ramps of torque.

Between switches of stiffness nothing depends on the speed: over theta, the time of the model, a
piece of constant acceleration has the matrices of a run at constant speed and switches at other
instants. With the mesh phase tau = tau_0 + nu_0 theta + a theta^2 / 2 the time between two switches
is 2 dtau / (nu_1 + nu_2), nu^2 = nu_0^2 + 2 a (tau - tau_0): no digits cancel, and a = 0 gives the
segments of a run at constant speed. The inertia of the acceleration and steps of the load change
the constant of the state; a ramp of the load adds a component that grows by 1 in a unit of theta.
"""

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import OK
from gearlib.engines.linear import one_mesh, propagator
from gearlib.engines.linear.periods import EVENT_COLUMNS
from gearlib.engines.linear.record import SUMMARY_COLUMNS
from gearlib.engines.linear.sparse_series import sparse_of

#: Mesh periods whose segments are made at once.
_STRETCH = 512
#: Phases closer than this share of the whole phase are one, as of `gearlib.models.trains.waves`.
_SAME_PHASE = 1e-12
#: Of a mesh period, as far from ratios of small numbers as there is: the golden section.
_INSTANT = 0.3819660112501051
#: A price that no number of steps of the series comes to.
_NO_MODES = 2**62


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
    samples: np.ndarray  #: columns of `orbit`, shape (j, m, 6)
    states: np.ndarray  #: coordinates and their rates by theta, shape (j, 2 N)
    block: np.ndarray  #: int, number of the block of each interval, shape (k,)
    summary: np.ndarray  #: of each block that there is, shape (b, m, 10)
    #: (theta, mesh, from, to, velocity by theta, interval, theta in it), shape (j, 7)
    events: np.ndarray
    status: int


def pieces_of(model, speeds, loads):
    """Return the pieces of a course.

    Speeds, shape (j, 2), and loads, shape (k, 2), have rows of seconds and rpm, of seconds and
    share of the load; two loads at one time are a step, the last value holds from there on, and
    speeds end the course.
    """
    unit = np.array([float(model.mesh_frequency(1.0)), 1.0])
    speeds, loads = speeds * unit, loads * unit
    speeds[:, 1] = [model.tuning_at(rpm) if rpm else 0.0 for rpm in speeds[:, 1]]
    marks = np.union1d(speeds[:, 0], loads[:, 0])
    marks = marks[(marks >= speeds[0, 0]) & (marks <= speeds[-1, 0])]
    found, phase = [], 0.0
    for start, end in zip(marks[:-1].tolist(), marks[1:].tolist(), strict=True):
        (first, a), (load, slope) = _line(speeds, start), _line(loads, start)
        piece = Piece(start, end - start, phase, first, a, load, slope)
        found.append(piece)
        phase += piece.length * (first + 0.5 * a * piece.length)
    return found


def set_out(model, speeds, loads, state):
    """Return (propagator, pieces, state with rates by theta) of the begin of a course."""
    runner, pieces = propagator_of(model), pieces_of(model, speeds, loads)
    z = np.array(runner.start(state), float)
    z[z.size // 2 :] *= pieces[0].speed
    return runner, pieces, z


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


def run_through(runner, pieces, state, samples, limit, inertia, teeth):
    """Yield a `Stretch` after the other of a run through pieces, up to one that fails.

    The state, shape (2 N,), has rates by theta and changes in place; `samples` are equal steps of
    time in each mesh period, `limit` is the most events in one, `inertia`, shape (N,), has the
    accelerations by theta for a unit of d2tau/dtheta2, and a block, of which there is one summary,
    has `teeth` mesh periods.
    """
    for piece in pieces:
        runner.enter(piece, inertia)
        for cut in _cuts(runner, piece, teeth):
            done = runner.through(piece, state, cut, samples, limit)
            yield done
            if done.status != OK:
                return


class Cut(NamedTuple):
    """Intervals of a piece: its mesh periods, the first and the last cut at its ends."""

    phase: np.ndarray  #: tau from `offset` on that bounds segments, shape (p + 1,)
    offset: float
    first: np.ndarray  #: where intervals begin, shape (k + 1,)
    which: np.ndarray  #: segments of `source`, shape (p,)
    source: Any  #: the system that has their stiffness
    turn: np.ndarray  #: int, how often `source` was gone through before each, shape (p,)
    block: np.ndarray  #: int, numbers of the blocks of the intervals, shape (k,)
    begins: bool  #: whether it begins with its piece
    ends: bool

    def speeds(self, piece):
        """Return nu at the bounds of the segments, shape (p + 1,)."""
        found = piece.speed_at(self.offset + self.phase)
        # Next to rest the root of a difference has half of its digits.
        if self.begins:
            found[0] = piece.speed
        if self.ends:
            found[-1] = max(piece.speed + piece.acceleration * piece.length, 0.0)
        return found

    def lengths(self, piece):
        """Return theta of the segments, shape (p,)."""
        speed = self.speeds(piece)
        total = speed[:-1] + speed[1:]
        if total.any():
            return 2.0 * np.diff(self.phase) / total
        return np.array([piece.length])

    def within(self, length):
        """Return theta of their intervals where segments begin and end: rounding must not grow."""
        place = np.arange(length.size) - np.repeat(self.first[:-1], np.diff(self.first))
        end = length.copy()
        for k in range(1, place.max() + 1):
            later = np.flatnonzero(place == k)
            end[later] += end[later - 1]
        return np.where(place > 0, np.roll(end, 1), 0.0), end

    def bounds(self, piece, length):
        """Return theta that bounds the intervals, shape (k + 1,)."""
        start = piece.start
        if not self.begins:
            phase = self.offset + self.phase[0]
            start += 2.0 * (phase - piece.phase) / (piece.speed + float(piece.speed_at(phase)))
        return start + np.concatenate([[0.0], np.cumsum(length)])[self.first]


def _cuts(runner, piece, teeth):
    """Yield the intervals of a piece, so many at a time as a `Cut`."""
    base, long = runner.laws, runner.long
    end = piece.phase + piece.length * (piece.speed + 0.5 * piece.acceleration * piece.length)
    tau, repeats = 2.0 * math.pi, len(base.first_segment) - 1
    close = _SAME_PHASE * max(end, 1.0)
    count = _STRETCH if long else max(_STRETCH // repeats, 1) * repeats
    first, new = int((piece.phase + close) / tau) // count * count, True
    while True:
        source = runner.model.system(1.0, first, count) if long else base
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
        marks = np.array([0, *(marks[(marks > i) & (marks < j)] - i), j - i])
        middle = (phase[marks[:-1]] + phase[marks[1:]]) / 2.0 + tau * first
        # All of a mesh period belongs to one block, that of an instant in it at which no ratio of
        # teeth lets a block begin, where rounding would decide.
        block = ((np.floor(middle / tau) + _INSTANT) / teeth).astype(int)
        turns = np.arange(i, j) // size
        last = tau * (first + count) >= end - close
        where = marks, which[i:j], source, turns, block
        yield Cut(phase, tau * first, *where, new, last)
        first, new = first + count, False
        if last:
            return


class _Course:
    """The part of a propagator whose systems are those of stretches of a course."""

    system: Any
    grid: Any
    model: Any
    long: Any
    words: Any = "closed forms"
    raw: Any
    go: Any
    fill_meshes: Any

    @property
    def meshes(self):
        """How many meshes the model has."""
        return len(self.laws.near)

    def ahead(self, first, done, spans):
        """As of `propagator.Propagator`: all segments are there."""
        return self.system, self.grid, spans[0]

    def enter(self, piece, inertia):
        """Take the loads of a piece."""
        self.loaded = _loaded(self.bare, piece, inertia)
        if self.laws.harmonics.size:
            self.loaded.free[self.model.size, -1] = piece.acceleration
        # Tables of another number of components are of no use.
        self.spare, self.large = [], []

    @cached_property
    def laws(self):
        """The system that a course begins with."""
        return self.system

    @cached_property
    def bare(self):
        """The same with what its harmonics are on a course of speed, if it has any."""
        if not self.laws.harmonics.size:
            return self.laws
        first = (0, self.laws.first_segment.size - 1) if self.long else ()
        return _chirped(self.laws, self.model.system(2.0, *first), self.model.size)

    def taken(self):
        """Return tables for one run; of harmonics on a course there are no modes."""
        tables = super().taken()  # type: ignore[misc]
        if self.laws.harmonics.size:
            tables.price[0] = _NO_MODES
        return tables

    def _between(self, piece, cut, theta):
        """Return the components between the rates and the constant at the begin of a `Cut`."""
        turns = round(cut.offset / math.tau) % self.model.repeats
        found, phase = [], cut.phase[0] + math.tau * turns
        if self.laws.harmonics.size:
            nu = float(cut.speeds(piece)[0])
            found.append(nu)
            for w in self.laws.harmonics:
                c, s = math.cos(w * phase), math.sin(w * phase)
                found += [c, s, -w * nu * s, w * nu * c]
        if piece.slope:
            found.append(piece.slope * (theta - piece.start))
        return found

    def _set(self, cut, length, taken):
        """Take the segments of a `Cut`, theta of them, and where samples begin."""
        system, starts = self.loaded, np.concatenate([[0.0], np.cumsum(length)])
        tables = {
            name: np.ascontiguousarray(getattr(cut.source, name)[:, cut.which])
            for name in ("effect", "stiffness", "low")
        }
        own = {"starts": starts, "first_segment": cut.first, "repeats": len(cut.first) - 1}
        self.system = system._replace(**own, **tables)
        self.grid = self.grid._replace(
            length=length,
            kind=np.full(length.size, -1),
            rate=system.near @ system.free,
            far_rate=system.far @ system.free,
            block=cut.block - cut.block[0],
            taken=taken,
            chirp=self.laws.harmonics,
            pace=self.model.size,
            **sparse_of(system, self.laws.harmonics.size > 0),
        )
        self.components = len(system.free)

    def _add_chirps(self, raw, piece, columns):
        """Add to accelerations what the harmonics bring, whose rates no matrix has."""
        pace, rate = self.model.size, self.grid.rate
        for j, w in enumerate(self.laws.harmonics):
            i = pace + 1 + 4 * j
            c, s, c_rate, s_rate = raw[:, i : i + 4].T
            twice = -w * (piece.acceleration * s + raw[:, pace] * s_rate)
            columns[..., orbit.SAMPLE_A] += twice[:, None] * rate[:, i + 2]
            twice = w * (piece.acceleration * c + raw[:, pace] * c_rate)
            columns[..., orbit.SAMPLE_A] += twice[:, None] * rate[:, i + 3]

    def through(self, piece, state, cut, samples, limit):
        """Run through the intervals of a `Cut` from a state, changed in place; a `Stretch`."""
        length, count = cut.lengths(piece), len(cut.block)
        whole = cut.within(length)[1][cut.first[1:] - 1]
        wanted = (whole[:, None] * np.arange(samples) / max(samples, 1)).ravel()
        self._set(cut, length, samples * np.arange(count + 1))
        bounds, system, half = cut.bounds(piece, length), self.system, state.size // 2
        m = len(system.near)
        raw = self.raw(len(wanted))
        raw[:, -1] = wanted
        summary = np.empty(((self.grid.block[-1] + 1) * m, SUMMARY_COLUMNS))
        events, spans = np.empty((4 * count * m, EVENT_COLUMNS)), (count, count)
        full = np.append(state, self._between(piece, cut, bounds[0]))
        self.scale = np.ones(full.size)
        _, events, found, code, _ = self.run_system(full, raw, events, limit, summary, spans)
        state[:] = full[: state.size]
        events, columns = events[: found if code == OK else 0], np.zeros((len(raw), m, 6))
        if code == OK:
            self.fill_meshes(raw, columns, system)
            self._add_chirps(raw, piece, columns)
        rows = events[:, [1, -1, 2, 3, 4, 0, 1]]
        rows[:, 0] += bounds[events[:, 0].astype(int)]
        summary = summary.reshape(-1, m, SUMMARY_COLUMNS)
        record = columns, raw[:, : 2 * half], cut.block, summary, rows
        return Stretch(piece, cut.offset + cut.phase[cut.first], bounds, *record, code)


class _Train(_Course, propagator.Propagator):
    """A train on its way."""


class CoursePair(_Course, one_mesh.Propagator):
    """A model with one mesh on its way."""

    def start(self, state):
        """Return the state without the deviations of the flanks; see `Base.start`."""
        return super().start(state) - self.shift


def propagator_of(model):
    """Return the propagator, by theta, of a model on its way."""
    runner = (_Train if model.mesh_names else CoursePair)(model, 1.0)
    runner.words = "Taylor steps" if runner.system.harmonics.size else "closed forms"
    return runner


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
    free[one, one + 1], free[rows, one] = piece.slope, load
    lines = "near", "far", "push", "grip"
    return base._replace(free=free, **{name: wider(getattr(base, name)) for name in lines})


def _chirped(system, twice, size):
    """Return a system in whose harmonics the phase is quadratic in theta.

    Behind the coordinates and rates comes dtau/dtheta, and cosine, sine and their rates by theta of
    each harmonic: what damping makes of these is no matter of the speed then. It is what `twice`,
    the system of tuning 2, has more than that of tuning 1. The rates of the rates are those of
    `sparse_series`.
    """
    h = system.harmonics.size
    wide = size + 2 + 4 * h
    places = [size + 1 + 4 * j for j in range(h)]

    def moved(array, other):
        found = np.zeros((*array.shape[:-1], wide))
        found[..., :size], found[..., -1] = array[..., :size], array[..., size]
        for j, (i, w) in enumerate(zip(places, system.harmonics, strict=True)):
            cosine, sine = (size + 1 + 2 * j + k for k in range(2))
            rate = other - array
            found[..., i] = array[..., cosine] - rate[..., cosine]
            found[..., i + 1] = array[..., sine] - rate[..., sine]
            found[..., i + 2], found[..., i + 3] = -rate[..., sine] / w, rate[..., cosine] / w
        return found

    names = "near", "far", "push", "grip"
    lines = {name: moved(getattr(system, name), getattr(twice, name)) for name in names}
    free = np.zeros((wide, wide))
    free[:size] = moved(system.free[:size], twice.free[:size])
    for i in places:
        free[i, i + 2] = free[i + 1, i + 3] = 1.0
    return system._replace(free=free, harmonics=np.empty(0), **lines)

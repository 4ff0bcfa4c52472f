"""Periodic orbits by shooting on the map of n mesh periods, with their Floquet multipliers.

An orbit of period n is a fixed point of the map that takes the state at tau = 0 through n mesh
periods. Newton's method needs the derivative of that map by the state, which is exact: variational
equations with the saltation at flank crossings. Orbits are therefore computed to rounding, unstable
ones included. The derivative by a parameter is a central difference, which decides how fast
Newton's method converges, not where to.

At grazing the derivative depends on the side from which it is taken: an orbit that touches a flank
line says so, its multipliers are those of the side on which it was computed.
"""

import functools
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from gearlib import checks
from gearlib.analysis.orbits.followed_parameters import with_parameter
from gearlib.analysis.orbits.tracing import Lost, slope
from gearlib.data import status
from gearlib.data.motions import floats
from gearlib.data.result import result
from gearlib.data.status import CONTACT_FLAGS
from gearlib.engines import orbit as columns
from gearlib.integrators import choose
from gearlib.runs.run_arguments import MAX_EVENTS, check_tuning

#: Largest residual of an orbit, in static deflections; height times this if larger.
MAX_RESIDUAL = 1e-12
#: Mesh periods from rest after which a motion is taken as the first guess.
_SETTLING_PERIODS = 400
_MAX_NEWTON_STEPS, _MAX_HALVINGS = 60, 12
#: Most mesh periods of an orbit, whose maps are kept, and of a piece of it.
MAX_PERIODS, _MAX_PIECE_PERIODS = 100_000, 32
#: Distance of a multiplier from the unit circle that is rounding: that of a double multiplier goes
#: with the root of the map's.
_CIRCLE_TOLERANCE = 1e-7
#: An orbit may repeat after a part of its period if its state does to the first tolerance, and does
#: if the orbit of that period is as close as the second. Units of `MAX_RESIDUAL`.
_REPEAT_TOLERANCE, _SAME_ORBIT_TOLERANCE = 1e-6, 1e-9
#: Distance from a flank line at which an orbit touches it, in shares of its height.
_TOUCH_TOLERANCE = 1e-9


class NoOrbit(RuntimeError):
    """Newton's method found no orbit; the message says what to try."""


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit."""

    pair: object  #: the model
    tuning: float
    period: int  #: mesh periods, the least after which it repeats
    state: np.ndarray  #: at tau = 0, shape (n,), as of `Propagator.start`
    residual: float  #: largest difference of the states at start and end
    multipliers: np.ndarray  #: Floquet multipliers of the n periods, complex, largest first
    pattern: tuple  #: contact codes in the order met, from tau = 0
    grazing: bool  #: whether it touches a flank line: then its linearisation is one-sided

    @property
    def stable(self):
        """Whether no multiplier lies outside the unit circle; see `is_stable`."""
        return is_stable(self.multipliers)

    def dataset(self):
        """Return the orbit as a dataset: state, multipliers, pattern and what they say."""
        data = {
            "state": ("coordinate", self.state),
            "multiplier_real": ("multiplier", self.multipliers.real),
            "multiplier_imaginary": ("multiplier", self.multipliers.imag),
            "pattern": ("contact_phase", np.array(self.pattern, np.int8)),
            "stable": np.int8(self.stable),
            "grazing": np.int8(self.grazing),
            "residual": self.residual,
            "period": np.int32(self.period),
            "tuning": self.tuning,
        }
        title = "Periodic orbit of a gear mesh"
        dataset = result(title, self.pair, data, method="shooting", tuning=self.tuning)
        dataset["pattern"].attrs |= CONTACT_FLAGS
        return dataset


def check_orbit(orbit):
    """Refuse what is no orbit."""
    checks.require(isinstance(orbit, Orbit), "orbit", orbit, "an Orbit")


def periodic_orbit(pair, tuning, *, guess=None, period=1, max_events=MAX_EVENTS):
    """Find a periodic orbit near a guess.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
    tuning : float
    guess : array_like of float, shape (2,) or (n,), optional
        Displacement and dx/dtau at tau = 0, or a full state; by default where the motion from
        rest is after 400 mesh periods.
    period : int, default 1
        Mesh periods after which the orbit repeats, or a multiple of them; with run-out a multiple
        of its own. What is returned has its least period.
    max_events : int
        As of `gearlib.simulate`.

    Returns
    -------
    Orbit

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    NoOrbit
        If there is none near the guess; the message says what to try.
    """
    choose(pair, None, None)
    tuning = check_tuning("tuning", tuning)
    period = checks.integer("period", period, 1, MAX_PERIODS)
    max_events = checks.integer("max_events", max_events, 1)
    repeats = pair.repeats
    if period % repeats:
        raise ValueError(
            f"period = {period} is not allowed: it must be a multiple of the {repeats} mesh "
            "periods after which the excitation repeats"
        )
    problem = Shooting(pair, tuning, period, max_events=max_events)
    try:
        orbit = _solve(problem, problem.guess(_guess(problem, guess)))
    except Lost as error:
        raise NoOrbit(str(error)) from None
    if not orbit.small:
        raise NoOrbit(
            f"no orbit of period {period} was found near the guess at tuning = {tuning!r}, the "
            f"best residual is {orbit.residual:.2g}: guess closer, or another period"
        )
    z = orbit.state
    for part in (n for n in range(repeats, period, repeats) if period % n == 0):
        end, _, code = problem.propagator(pair, tuning).maps(z, part, max_events)
        if code != status.OK or problem.distance(end, z) > _REPEAT_TOLERANCE:
            continue
        try:
            least = periodic_orbit(pair, tuning, guess=z, period=part, max_events=max_events)
        except NoOrbit:
            continue
        # Beside a doubling the orbit of half the period is another one.
        if problem.distance(least.state, z) <= _SAME_ORBIT_TOLERANCE:
            return least
    return as_orbit(orbit)


class Shooting:
    """The equation of orbits of `period` mesh periods, over their state and parameters of a model.

    Unknowns are scaled: one unit of a parameter changes it by its scale and weighs as much as a
    static deflection. If no parameter varies, a long period is divided into pieces, so that
    deviations along an unstable orbit do not drown its end in rounding.
    """

    def __init__(self, model, tuning, period, names=(), scales=(), max_events=MAX_EVENTS):
        self.pair, self.tuning, self.period = model, tuning, period
        self.names, self.max_events = names, checks.integer("max_events", max_events, 1)
        self._propagator: Any = None
        self.reduce, self.lift = model.reduction()
        n, pieces = len(self.reduce), 1 if names else -(-period // _MAX_PIECE_PERIODS)
        #: Mesh periods at which pieces begin, and the last one ends.
        self.starts = [period * i // pieces for i in range(pieces + 1)]
        #: Free rotations of the states at the starts of pieces, shape (pieces, n), or none.
        self.rotations: Any = 0.0
        #: Number of the piece after each, and the derivative of its first state by all states.
        self.following = np.arange(1, pieces + 1) % pieces
        self.links = np.eye(pieces * n)[(np.arange(pieces * n) + n) % (pieces * n)]
        state_units = ([1.0] * (n // 2) + [1.0 / tuning] * (n // 2)) * pieces
        #: Size of one scaled unit of each unknown.
        self.units = np.array([*state_units, *scales])

    def unknowns(self, state, values):
        """Return the scaled unknowns y for a full state and the parameters."""
        return np.append(self.reduce @ state, values) / self.units

    def guess(self, state):
        """Return the scaled unknowns of the motion from a full state, with its free rotation."""
        states, propagator = [state], self.propagator(self.pair, self.tuning)
        for start, stop in zip(self.starts[:-2], self.starts[1:-1], strict=True):
            states.append(self._piece(propagator, states[-1], start, stop)[0])
        whole = np.array(states)
        reduced = whole @ self.reduce.T
        self.rotations = whole - reduced @ self.lift.T
        return reduced.ravel() / self.units

    def model(self, y):
        """Return (model, tuning, states at the starts of pieces) for unknowns, else ValueError."""
        values = y * self.units
        model, tuning, n = self.pair, self.tuning, self.units.size - len(self.names)
        for name, value in zip(self.names, values[n:], strict=True):
            model, tuning = with_parameter(model, tuning, name, float(value))
        states = values[:n].reshape(-1, len(self.reduce)) @ self.lift.T
        return model, tuning, states + self.rotations

    def propagator(self, model, tuning):
        """Return the propagator of a model; that of the last tuning hands on its tables."""
        last = self._propagator
        if last is None or last.model is not model:
            self._propagator = model.propagator(tuning)
        elif last.tuning != tuning:
            self._propagator = last.at(tuning)
        return self._propagator

    def _piece(self, propagator, state, start, stop):
        """Return (end, maps of all mesh periods) of the motion between two mesh periods."""
        first = start % self.pair.repeats
        end, maps, code = propagator.maps(state, stop - start, self.max_events, first)
        if code != status.OK:
            raise Lost(f"the motion could not go on: {status.MESSAGES[code]}")
        return end, maps

    def run(self, y):
        """Return (tuning, states, ends, maps of all mesh periods) of pieces; ValueError, Lost."""
        model, tuning, states = self.model(y)
        propagator, maps, ends = self.propagator(model, tuning), [], np.empty_like(states)
        for i, state in enumerate(states):
            ends[i], piece = self._piece(propagator, state, *self.starts[i : i + 2])
            maps.append(piece)
        return tuning, states, ends, maps

    def record(self, y, periods, samples=0):
        """Return (model, `Record` of a run over mesh periods)."""
        model, tuning, states = self.model(y)
        propagator = self.propagator(model, tuning)
        return model, propagator.record(states[0], periods, self.max_events, samples)

    def evaluate(self, y):
        """Return the `Evaluation` at scaled unknowns, else ValueError, Lost."""
        return Evaluation(self, y)

    def distance(self, first, second):
        """Return the size of the difference of two states, as of `size_of`."""
        return size_of(self.reduce @ (first - second), second, self.tuning)


class Evaluation:
    """The shooting equation at some states and parameters, in scaled unknowns."""

    def __init__(self, problem, y):
        self.problem, self.y = problem, y
        tuning, states, ends, maps = problem.run(y)
        starts = states if len(states) == 1 else states[problem.following]
        miss = (ends - starts) @ problem.reduce.T
        #: First state, and the maps of the pieces without free rotations.
        self.state = states[0]
        self.maps = [problem.reduce @ product(piece) @ problem.lift for piece in maps]
        self.miss = miss.ravel() / problem.units[: miss.size]  #: shape (n,)
        self.residual = size_of(miss, states, tuning)
        #: Whether the residual counts as none.
        self.small = self.residual <= MAX_RESIDUAL

    @cached_property
    def matrix(self):
        """Map of the whole period, without free rotations."""
        return product(self.maps)

    @cached_property
    def multipliers(self):
        """Floquet multipliers, complex, largest first."""
        return multipliers_of(self.matrix)

    @cached_property
    def jacobian(self):
        """Derivative of the residuals, shape (n, n + parameters)."""
        problem, n = self.problem, self.miss.size
        units = problem.units[:n]
        by_ends = block_diag(*self.maps) if len(self.maps) > 1 else self.maps[0]
        by_states = (by_ends - problem.links) * units / units[:, None]
        by_parameters = [
            (slope(lambda y: problem.run(y)[2], self.y, column) @ problem.reduce.T).ravel() / units
            for column in range(n, self.y.size)
        ]
        return np.column_stack([by_states, *by_parameters])


def as_orbit(evaluation):
    """Return the `Orbit` of an `Evaluation`."""
    problem, period, y = evaluation.problem, evaluation.problem.period, evaluation.y
    model, tuning, states = problem.model(y)
    record = problem.propagator(model, tuning).record(states[0], period, problem.max_events)
    pattern, grazing = _contacts(record, model.flank_lines, tuning)
    return Orbit(
        model,
        tuning,
        period,
        states[0],
        evaluation.residual,
        evaluation.multipliers,
        pattern,
        grazing,
    )


def _solve(problem, y):
    """Return the `Evaluation` where Newton's method with halved steps ends."""
    orbit = problem.evaluate(y)
    for _ in range(_MAX_NEWTON_STEPS):
        if orbit.small:
            break
        try:
            step = -np.linalg.solve(orbit.jacobian, orbit.miss)
        except np.linalg.LinAlgError:
            raise NoOrbit(
                f"the map has a multiplier 1 at tuning = {problem.tuning!r}: a fold is here; "
                "guess an orbit on one of its sides"
            ) from None
        for _ in range(_MAX_HALVINGS):
            trial = problem.evaluate(orbit.y + step)
            if trial.residual < orbit.residual:
                break
            step *= 0.5
        else:
            break
        orbit = trial
    return orbit


def _guess(problem, guess):
    """Return the full state of a user's guess, by default that of the settled motion."""
    model, n = problem.pair, problem.pair.size
    propagator = problem.propagator(model, problem.tuning)
    if guess is None:
        periods = -(-_SETTLING_PERIODS // problem.period) * problem.period
        start = propagator.start((0.0, 0.0))[None]
        ends, codes = propagator.many(start, periods, problem.max_events)
        code = int(codes[0])
        if code != status.OK:
            raise NoOrbit(f"the motion from rest could not go on: {status.MESSAGES[code]}")
        return ends[0]
    values = floats(guess)
    if values.shape not in ((2,), (n,)) or not np.isfinite(values).all():
        counts = "2" if n == 2 else f"2 or {n}"
        raise ValueError(f"guess = {guess!r} is not allowed: it must be {counts} finite numbers")
    return values if values.size == n else propagator.start(values)


def multipliers_of(matrix):
    """Return the eigenvalues of the map of all periods, complex, largest first."""
    multipliers = np.linalg.eigvals(matrix).astype(complex)
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]


def is_stable(multipliers):
    """Return whether no multiplier lies outside the unit circle.

    Without damping on its way an orbit has them on the circle, where rounding shifts them to
    either side: such an orbit counts as stable.
    """
    return bool(np.abs(multipliers).max() < 1.0 + _CIRCLE_TOLERANCE)


def product(maps):
    """Return the map of all periods from those of each, shape (periods, n, n)."""
    return functools.reduce(lambda matrix, each: each @ matrix, maps)


def size_of(miss, z, tuning):
    """Return a residual in static deflections, over the size of the state if that is larger."""
    weights = np.repeat([1.0, tuning], miss.shape[-1] // 2)
    return float(np.abs(weights * miss).max() / max(1.0, np.abs(z).max() * 1e-2))


def _contacts(record, flank_lines, tuning):
    """Return (contact codes in the order met, whether an orbit touches a flank line)."""
    events, summary = record.events, record.summary
    low, high = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
    near, far = flank_lines
    close = _TOUCH_TOLERANCE * np.maximum(1.0, high - low)
    touches = (
        min(np.min(abs(end - line) - close) for end in (low, high) for line in (near, far)) < 0
    )
    if not len(events):
        # Without a crossing every mesh stays on one side; it may still come to the line.
        return tuple(resting(low, high, near, far)), bool(touches)
    codes = events[:, columns.EVENT_TO].astype(int).tolist()
    pattern = (int(events[0, columns.EVENT_FROM]), *codes)
    speeds = np.abs(events[:, columns.EVENT_VELOCITY]) * tuning
    return pattern, bool(touches or speeds.min() < np.sqrt(close.min()))


def resting(low, high, near, far):
    """Return the contact code of every mesh, shape (m,), of an orbit that crosses no flank line."""
    return np.atleast_1d(np.where(high > near, 1, np.where(low > far, 0, -1))).tolist()

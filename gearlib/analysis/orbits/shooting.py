"""Periodic orbits by shooting on the map of n mesh periods, with their Floquet multipliers.

An orbit of period n is a fixed point of the map that takes the state at tau = 0 through n mesh
periods. Newton's method needs the derivative of that map, which `Model.propagator` has from
the variational equations and the saltation at flank crossings; its eigenvalues are the Floquet
multipliers. Nothing is differenced, so that orbits are found to rounding, unstable ones included.

At grazing the derivative depends on the side from which it is taken: an orbit that touches a flank
line says so, its multipliers are those of the side on which it was found.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from gearlib import checks
from gearlib.data import status
from gearlib.data.contact_states import FLAGS
from gearlib.data.numbers_given import floats
from gearlib.data.result import result
from gearlib.engines import orbit as columns
from gearlib.integrators import choose
from gearlib.runs.run_arguments import MAX_EVENTS, check_tuning

#: Residual of an orbit, in static deflections, that counts as none; height times this if larger.
RESIDUAL = 1e-12
#: Mesh periods from rest after which a motion is taken as the first guess.
_SETTLE = 400
_MAX_NEWTON, _MAX_HALVINGS = 60, 12
#: Most mesh periods of an orbit: their maps are kept.
MOST_PERIODS = 100_000
#: Most mesh periods that are shot over in one piece.
_LONGEST = 32
#: Rounding of a multiplier on the unit circle: that of a double one, the root of a map's.
_NEUTRAL = 1e-7
#: Points of an orbit this close are perhaps one, and are one if the orbit of the shorter period is
#: as close as the second says. Units as of `RESIDUAL`.
_ONE_POINT, _SAME_ORBIT = 1e-6, 1e-9
#: An orbit this close to a flank line, in shares of its height, touches it.
_TOUCH = 1e-9


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
        dataset["pattern"].attrs |= FLAGS
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
    period = checks.integer("period", period, 1, MOST_PERIODS)
    max_events = checks.integer("max_events", max_events, 1)
    repeats = pair.repeats
    if period % repeats:
        raise ValueError(
            f"period = {period} is not allowed: it must be a multiple of the {repeats} mesh "
            "periods after which the excitation repeats"
        )
    problem = _Shooting(pair, tuning, period, max_events)
    z, maps, size = problem.solve(_guess(pair, tuning, guess, period, max_events))
    if size > RESIDUAL:
        raise NoOrbit(
            f"no orbit of period {period} was found near the guess at tuning = {tuning!r}, the "
            f"best residual is {size:.2g}: guess closer, or another period"
        )
    for part in (n for n in range(repeats, period, repeats) if period % n == 0):
        end, _, code = problem.propagator.maps(z, part, max_events)
        if code != status.OK or problem.distance(end, z) > _ONE_POINT:
            continue
        try:
            least = periodic_orbit(pair, tuning, guess=z, period=part, max_events=max_events)
        except NoOrbit:
            continue
        # Beside a doubling the orbit of half the period is another one.
        if problem.distance(least.state, z) <= _SAME_ORBIT:
            return least
    multipliers = multipliers_of(product(np.array(maps)))
    pattern, grazing = contacts(pair, tuning, z, period, max_events)
    return Orbit(pair, tuning, period, z, float(size), multipliers, pattern, grazing)


class _Shooting:
    """Newton's method on the map of a period, a long one in several pieces.

    Deviations that grow along an unstable orbit would otherwise drown its end in rounding.
    """

    def __init__(self, model, tuning, period, max_events):
        self.model, self.max_events = model, max_events
        self.propagator = model.propagator(tuning)
        self.reduce, self.lift = model.reduction()
        pieces = -(-period // _LONGEST)
        #: Mesh periods at which pieces begin, and the last one ends.
        self.starts = [period * i // pieces for i in range(pieces + 1)]

    def distance(self, first, second):
        """Return the size of the difference of two states, as of `size_of`."""
        return size_of(self.reduce @ (first - second), second, self.propagator.tuning)

    def _go(self, z, i):
        """Return (end, map without free rotation) of one piece."""
        start, stop = self.starts[i : i + 2]
        first = start % self.model.repeats
        end, maps, code = self.propagator.maps(z, stop - start, self.max_events, first)
        if code != status.OK:
            raise NoOrbit(f"the motion could not go on: {status.MESSAGES[code]}")
        return end, self.reduce @ product(maps) @ self.lift

    def _evaluate(self, z):
        """Return (misses between pieces, maps, residual) of states at their starts."""
        ends, maps = zip(*(self._go(state, i) for i, state in enumerate(z)), strict=True)
        miss = (np.array(ends) - np.roll(z, -1, axis=0)) @ self.reduce.T
        return miss, maps, size_of(miss, z, self.propagator.tuning)

    def solve(self, guess):
        """Return (state, maps, residual) where Newton's method from a guess ends."""
        states, n = [guess], len(self.reduce)
        for i in range(len(self.starts) - 2):
            states.append(self._go(states[i], i)[0])
        z = np.array(states)
        miss, maps, size = self._evaluate(z)
        for _ in range(_MAX_NEWTON):
            if size <= RESIDUAL:
                break
            matrix = np.kron(np.roll(np.eye(len(maps)), 1, axis=1), np.eye(n)) - block_diag(*maps)
            try:
                step = np.linalg.solve(matrix, miss.ravel()).reshape(miss.shape) @ self.lift.T
            except np.linalg.LinAlgError:
                raise NoOrbit(
                    f"the map has a multiplier 1 at tuning = {self.propagator.tuning!r}: a fold is "
                    "here; guess an orbit on one of its sides"
                ) from None
            for _ in range(_MAX_HALVINGS):
                trial = self._evaluate(z + step)
                if trial[2] < size:
                    break
                step *= 0.5
            else:
                break
            z, (miss, maps, size) = z + step, trial
        return z[0], maps, size


def _guess(model, tuning, guess, period, max_events):
    if guess is None:
        propagator = model.propagator(tuning)
        periods = -(-_SETTLE // period) * period
        start = propagator.start((0.0, 0.0))[None]
        ends, codes = propagator.many(start, periods, max_events)
        code = int(codes[0])
        if code != status.OK:
            raise NoOrbit(f"the motion from rest could not go on: {status.MESSAGES[code]}")
        return ends[0]
    values, n = floats(guess), model.size
    if values.shape not in ((2,), (n,)) or not np.isfinite(values).all():
        counts = "2" if n == 2 else f"2 or {n}"
        raise ValueError(f"guess = {guess!r} is not allowed: it must be {counts} finite numbers")
    return values if values.size == n else model.propagator(tuning).start(values)


def multipliers_of(matrix):
    """Return the eigenvalues of the map of all periods, complex, largest first."""
    multipliers = np.linalg.eigvals(matrix).astype(complex)
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]


def is_stable(multipliers):
    """Return whether no multiplier lies outside the unit circle.

    Without damping on its way an orbit has them on the circle, where rounding shifts them to
    either side: such an orbit counts as stable.
    """
    return bool(np.abs(multipliers).max() < 1.0 + _NEUTRAL)


def product(maps):
    """Return the map of all periods from those of each, shape (periods, n, n)."""
    matrix = np.eye(maps.shape[1])
    for each in maps:
        matrix = each @ matrix
    return matrix


def size_of(miss, z, tuning):
    """Return a residual in static deflections, over the size of the state if that is larger."""
    weights = np.repeat([1.0, tuning], miss.shape[-1] // 2)
    return float(np.abs(weights * miss).max() / max(1.0, np.abs(z).max() * 1e-2))


def contacts(model, tuning, z, period, max_events):
    """Return (contact codes in the order met, whether the orbit touches a flank line)."""
    record = model.propagator(tuning).record(z, period, max_events)
    events, summary = record.events, record.summary
    low, high = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
    near, far = model.flank_lines
    close = _TOUCH * np.maximum(1.0, high - low)
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

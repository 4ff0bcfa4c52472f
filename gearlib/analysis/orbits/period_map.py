"""The period map of a model near its orbits: orbits at a tuning, folds, states of sweeps."""

import numpy as np

from gearlib.analysis.orbits.shooting import product
from gearlib.data import status
from gearlib.integrators import choose
from gearlib.runs.run_arguments import MAX_EVENTS, Rows, Span

#: Largest number of Newton steps, largest step, and step below which the next would be rounding.
_MAX_NEWTON, _MAX_STEP, _SMALL_STEP = 20, 3.0, 1e-8
#: Step of differences of period maps.
_DIFFERENCE = 1e-6
#: Modulus of a multiplier above which deviations grow.
_UNSTABLE = 1.0 + 1e-6
#: Distance of an orbit that is followed from tuning to tuning, as a share of the state.
_CLOSE = 0.2


class NotFound(ArithmeticError):
    """Newton's method did not find an orbit or a fold."""


class PeriodMap:
    """The map of a model through the mesh periods after which its excitation repeats."""

    def __init__(self, model):
        self.model, self.propagator = model, model.propagator(1.0)
        self.reduce, self.lift = model.reduction()
        n = len(self.reduce)
        #: Directions of state and tuning in which nothing but a free rotation stays the same.
        self.directions = np.zeros((n + 1, len(self.lift) + 1))
        self.directions[:n, :-1], self.directions[n, -1] = self.lift.T, 1.0
        self.unit = np.eye(n)

    def _propagator_at(self, tuning):
        """Return the propagator at a tuning, the last one where the tuning has not changed."""
        if tuning != self.propagator.tuning:
            self.propagator = self.propagator.at(tuning)
        return self.propagator

    def residual(self, tuning, state):
        """Return P(z) - z, shape (n,), and its derivative by z, (n, n), without free rotations."""
        if not tuning > 0.0:
            raise NotFound("no tuning is left")
        propagator = self._propagator_at(tuning)
        end, maps, code = propagator.maps(state, self.model.repeats, MAX_EVENTS)
        if code != status.OK:
            raise NotFound(status.MESSAGES[code])
        matrix = maps[0] if len(maps) == 1 else product(maps)
        return self.reduce @ (end - state), self.reduce @ matrix @ self.lift - self.unit

    def orbit(self, tuning, state):
        """Return the state of the orbit at a tuning, by Newton's method from a state nearby."""
        for _ in range(_MAX_NEWTON):
            residual, matrix = self.residual(tuning, state)
            try:
                step = -self.lift @ np.linalg.solve(matrix, residual)
            except np.linalg.LinAlgError:
                raise NotFound("a multiplier is 1") from None
            size = np.abs(step).max()
            if not size < _MAX_STEP * max(1.0, np.abs(state).max()):
                break
            state = state + step
            if size < _SMALL_STEP:
                return state
        raise NotFound("no orbit is near the guess")

    def stable_orbit(self, tuning, state):
        """Return the state of a stable orbit close to a state, None without one."""
        try:
            orbit = self.orbit(tuning, state)
        except NotFound:
            return None
        matrix = self.residual(tuning, orbit)[1]
        multipliers = np.linalg.eigvals(matrix + self.unit)
        near = np.abs(orbit - state).max() < _CLOSE * max(1.0, np.abs(state).max())
        return orbit if near and np.abs(multipliers).max() < _UNSTABLE else None

    def summary(self, tuning, state):
        """Return the summaries of all meshes over the period from a state, shape (m, columns)."""
        propagator = self._propagator_at(tuning)
        return np.atleast_2d(propagator.record(state, self.model.repeats, MAX_EVENTS)[1])

    def _fold_residual(self, point):
        residual, matrix = self.residual(point[-1], point[:-1])
        return np.append(residual, np.linalg.det(matrix))

    def fold(self, before):
        """Return the fold (state, tuning) ahead of one or two points of a branch, its guess."""
        point = before[-1]
        values = [self._fold_residual(one)[-1] for one in before]
        if len(values) == 2 and values[0] > values[1] > 0.0:
            point = point + (point - before[0]) * values[1] / (values[0] - values[1])
        for _ in range(_MAX_NEWTON):
            residual = self._fold_residual(point)
            ahead = [self._fold_residual(point + _DIFFERENCE * one) for one in self.directions]
            slopes = (np.array(ahead) - residual).T / _DIFFERENCE
            step = -np.linalg.solve(slopes, residual) @ self.directions
            size = np.abs(step).max()
            if not size < _MAX_STEP * max(1.0, np.abs(point).max()):
                break
            point = point + step
            if size < _SMALL_STEP * max(1.0, np.abs(point).max()):
                return point
        raise NotFound("no fold is near the guess")

    def turns(self, fold):
        """Return on which side of a fold in tuning its branch lies: > 0 where it is above."""
        _, matrix = self.residual(fold[-1], fold[:-1])
        left, _, right = np.linalg.svd(matrix)
        across, along = left[:, -1], self.lift @ right[-1]
        step = 1e2 * _DIFFERENCE

        def residual(state, tuning):
            return across @ self.residual(tuning, state)[0]

        z, tuning = fold[:-1], fold[-1]
        here = residual(z, tuning)
        bend = residual(z + step * along, tuning) + residual(z - step * along, tuning) - 2.0 * here
        slope = residual(z, tuning + step) - residual(z, tuning - step)
        return -bend / slope

    def lasts(self, fold):
        """Return whether the motion is stable up to a fold: no other multiplier is beyond 1.

        With one degree of freedom and damping the other one is below 1.
        """
        if self.model.size == 2:
            return True
        multipliers = np.linalg.eigvals(self.residual(fold[-1], fold[:-1])[1]) + 1.0
        others = np.delete(multipliers, np.argmin(np.abs(multipliers - 1.0)))
        return bool((np.abs(others) < _UNSTABLE).all())


def sweep_states(model, state, tunings, periods):
    """Return the last states (k, n) and summaries (k, m, columns) of runs carried along tunings.

    Summaries are of the last period. Of more than one degree of freedom states are those of the
    orbit near the end of each run.
    """
    tunings = np.asarray(tunings, float)
    if model.size > 2:
        return _sweep_of_many_coordinates(model, state, tunings, periods)
    _, module, options = choose(model, None, None)
    start = tuple(map(float, state))
    rows = Rows(
        model.bound(float(tunings.max()), start),
        np.empty((tunings.size, *model.empty_record()[2].shape)),
        np.empty((tunings.size, 2)),
        np.full((tunings.size, 2), -1),
    )
    span = Span(periods, 1, MAX_EVENTS)
    order = np.arange(tunings.size)
    module.run_many(model, tunings, order, start, True, span, rows, **options)
    return rows.ends, rows.summaries.reshape(tunings.size, 1, -1)


def _sweep_of_many_coordinates(model, state, tunings, periods):
    """Follow the stable orbit by Newton's method; where it is lost, run until one is met."""
    period_map, propagator = PeriodMap(model), model.propagator(tunings[0])
    state, states, summaries = np.array(state, float), [], []
    for tuning in tunings:
        propagator = propagator.at(tuning)
        orbit = period_map.stable_orbit(tuning, state)
        if orbit is None:
            ends, codes = state[None].copy(), np.zeros(1, np.int64)
            propagator.skip(state[None], periods * model.repeats, MAX_EVENTS, ends, codes)
            orbit = period_map.stable_orbit(tuning, ends[0])
            orbit = ends[0] if orbit is None else orbit
        state = orbit
        states.append(state)
        summaries.append(period_map.summary(tuning, state))
    return np.array(states), np.array(summaries)

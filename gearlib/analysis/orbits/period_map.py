"""The period map of a model near its orbits: orbits at a tuning, folds, orbits in full contact."""

import functools

import numpy as np
from scipy.linalg import expm

from gearlib.analysis.orbits.shooting import product
from gearlib.data import status
from gearlib.engines.linear.train_system import matrix_of, set_harmonics
from gearlib.runs.run_arguments import MAX_EVENTS

#: Largest number of Newton steps, largest step, and step below which the next would be rounding.
_MAX_NEWTON, _MAX_STEP, _SMALL_STEP = 20, 3.0, 1e-8
#: Step of differences of period maps.
_DIFFERENCE = 1e-6
#: Modulus of a multiplier above which deviations grow.
_UNSTABLE = 1.0 + 1e-6
#: Longest pieces of a period at whose ends extrema of several coordinates are looked for, rad.
_PIECE = 0.1
_DRIVE = 2  # contact code + 1


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

    def at(self, tuning):
        """Return the propagator at a tuning, the last one where the tuning has not changed."""
        if tuning != self.propagator.tuning:
            self.propagator = self.propagator.at(tuning)
        return self.propagator

    def residual(self, tuning, state):
        """Return P(z) - z, shape (n,), and its derivative by z, (n, n), without free rotations."""
        if not tuning > 0.0:
            raise NotFound("no tuning is left")
        propagator = self.at(tuning)
        end, maps, code = propagator.maps(state, self.model.repeats, MAX_EVENTS)
        if code != status.OK:
            raise NotFound(status.MESSAGES[code])
        matrix = maps[0] if len(maps) == 1 else product(maps)
        return self.reduce @ (end - state), self.reduce @ matrix @ self.lift - np.eye(
            len(self.reduce)
        )

    def orbit(self, tuning, state):
        """Return (state, derivative of P - z) of the orbit at a tuning, from a state nearby."""
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
                return state, matrix
        raise NotFound("no orbit is near the guess")

    def settled(self, tuning, state, periods):
        """Return the point (state, tuning) to which a state comes in periods of the map."""
        periods *= self.model.repeats
        ends, codes = self.at(tuning).many(state[None], periods, MAX_EVENTS)
        if codes[0] != status.OK:
            raise NotFound(status.MESSAGES[int(codes[0])])
        return np.append(ends, tuning)

    def summary(self, point):
        """Return the summaries of all meshes over the period from a point, shape (m, columns)."""
        record = self.at(point[-1]).record(point[:-1], self.model.repeats, MAX_EVENTS)
        return np.atleast_2d(record.summary)

    def _fold_residual(self, point):
        residual, matrix = self.residual(point[-1], point[:-1])
        return np.append(residual, np.linalg.det(matrix))

    def fold(self, before):
        """Return the fold (state, tuning) ahead of one or two points of a branch, its guess."""
        point = before[-1]
        values = [self._fold_residual(known)[-1] for known in before]
        if len(values) == 2 and values[0] > values[1] > 0.0:
            point = point + (point - before[0]) * values[1] / (values[0] - values[1])
        for _ in range(_MAX_NEWTON):
            residual = self._fold_residual(point)
            ahead = [
                self._fold_residual(point + _DIFFERENCE * direction)
                for direction in self.directions
            ]
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


def linear_orbit_of(model):
    """Return the function of a tuning that returns (state, (highest, least)).

    These are the largest and the least displacement over the flank line: of several meshes the
    least of all, and that plus the height of the highest.
    """
    return functools.partial(_of_system, model) if model.size > 2 else _of_pair(model)


def _of_pair(model):
    # Without backlash one flank goes on where the other ends.
    linear = model.replace(backlash=0.0)
    propagators = linear.propagator(1.0)

    def orbit(tuning):
        propagator = propagators.at(tuning)
        end, maps, _ = propagator.maps(np.zeros(2), 1, MAX_EVENTS)
        state = np.linalg.solve(np.eye(2) - maps[0], end)
        summary = propagator.record(state, 1, MAX_EVENTS).summary
        high, low = summary[0], summary[1]
        return state, (high - linear.flank_lines[0], low - linear.flank_lines[0])

    return orbit


def _of_system(model, tuning):
    system, n = model.system(tuning), model.size
    size = len(system.free)
    steps, matrix = [], np.empty((size, size))
    for i, length in enumerate(np.diff(system.starts)):
        matrix_of(system, system.effect[_DRIVE, i], matrix)
        count = int(np.ceil(length / _PIECE))
        steps += [expm(matrix * (length / count / system.tuning))] * count
    # Of six degrees of freedom segments are those of one mesh period, waves repeat after more.
    steps *= round(2.0 * np.pi * model.repeats / system.starts[-1])
    whole = np.eye(size)
    for step in steps:
        whole = step @ whole
    scale = np.repeat([1.0, tuning], n // 2)
    z = np.zeros(size)
    set_harmonics(system.harmonics, z, 0.0)
    reduce, lift = model.reduction()
    end, away = whole @ z, whole[:n, :n] * scale / scale[:, None]
    maps = np.eye(len(reduce)) - reduce @ away @ lift
    state = lift @ np.linalg.solve(maps, reduce @ (end[:n] / scale))
    z[:n] = state * scale
    places = [z]
    for step in steps:
        places.append(step @ places[-1])
    distances = np.array(places) @ system.near.T
    least = distances.min()
    return state, (least + np.ptp(distances, axis=0).max(), least)

"""Special points followed from one model to others: folds, onsets of contact loss, single orbits.

Each is the solution y of as many equations, the shooting equation and at most one more:

==========  ===============================  =====================================================
condition   unknowns y                       equations
==========  ===============================  =====================================================
`Fold`      state and tuning                 z = P(z), det(M - I) = 0
`Onset`     state and tuning                 z = P(z), the least displacement is 0
`At`        state; the speed is given        z = P(z)
==========  ===============================  =====================================================

Of one model they are solved by Newton's method, with exact derivatives. To another model the way
goes along the straight line between the parameters: the first guess by the derivatives at the
start; where Newton's method does not come to a solution near the guess, the step is halved. Where
the derivative of the equations becomes singular on the way two solutions have met: the special
point is gone.
"""

import dataclasses
import math
from typing import Any

import numpy as np

from gearlib.data import status
from gearlib.kernels import orbit as columns
from gearlib.models import derivatives
from gearlib.models.trains import train_slopes
from gearlib.runs.run_arguments import MAX_EVENTS

#: What became of a special point; `WORDS` has them in words.
FOUND, NOT_NOMINAL, VANISHED, LOST = range(4)
WORDS = ("found", "not in the nominal design", "vanished", "not followed")

#: Corrections; how far one may lead; below what the next would be rounding.
_MAX_NEWTON, _FARTHEST, _CLOSE = 12, 1.0, 1e-7
#: How far from a guess a solution may lie: so much, without derivatives for the guess so much,
#: and so much of the way from the last one.
_OFF, _UNGUIDED, _SHARE = 0.05, 2.0, 0.5
#: Shortest step, as a share of the way.
_SHORTEST = 1.0 / 256.0
#: Share of its value at the start below which the determinant of the derivatives is next to zero.
_SINGULAR = 0.3


#: Of one degree of freedom all of a state bends.
_PLAIN = np.eye(2)


class Failed(ArithmeticError):
    """The motion could not go on, or an equation has no derivative here."""


def _end(propagator, z, period):
    end, _, code = propagator.maps(z, period, MAX_EVENTS)
    if code != status.OK:
        raise Failed(status.MESSAGES[code])
    return end


def _checked(values, code):
    if code != status.OK or not np.isfinite(values).all():
        raise Failed("there are no derivatives")
    return values


class _Condition:
    """Equations over state and tuning; a free rotation stays as it is."""

    def tuning(self, model, y):
        """Return the tuning of unknowns."""
        return y[-1]

    def condition(self, propagator, z, along, tangents):
        """Return the value of the last equation and its derivatives, shape (n + 1 + k,).

        Those of the first n directions are by the state, along `tangents`, shape (n, n + 1 + k).
        """
        raise NotImplementedError

    def evaluate(self, model, y, names=(), last=None):
        """Return residuals (n,), their derivatives by y (n, n) and by parameters (n, k).

        `last` is (y, residuals, derivatives) of a point nearby, for conditions without exact ones.
        """
        z, propagator, bend = y[:-1], model.propagator(y[-1]), bent(model)
        along = propagator.directions(model, ("tuning", *names))
        matrix, moved, code = propagator.map_slopes(z, along, model.repeats, MAX_EVENTS)
        _checked(moved, code)
        every = [propagator.nowhere] * len(z) + [*along]
        tangents = np.zeros((len(z), len(every)))
        tangents[:, : len(z)] = bend
        value, row = self.condition(propagator, z, every, tangents)
        rows, n = np.empty((len(y), len(row))), len(z)
        rows[:n, :n], rows[:n, n:], rows[n] = bend @ matrix @ bend, bend @ moved, row
        rows[range(n), range(n)] -= 1.0
        miss = np.append(bend @ (_end(propagator, z, model.repeats) - z), value)
        return miss, rows[:, : len(y)], rows[:, len(y) :]


class Fold(_Condition):
    """A multiplier is 1, and the branch turns round."""

    def condition(self, propagator, z, along, tangents):
        """As of `_Condition`."""
        model, n = propagator.model, len(z)
        bend = bent(model)
        matrix, rates, code = propagator.map_rates(z, along, tangents, model.repeats, MAX_EVENTS)
        own = bend @ _checked(matrix, code) @ bend - np.eye(n)
        return _determinant_slopes(own, bend @ _checked(rates, code) @ bend)


def _determinant_slopes(matrix, rates):
    """Return det A and what it changes by with A, adj(A) : dA, also where A is singular."""
    if len(matrix) == 2:
        (a, b), (c, d) = matrix
        return a * d - b * c, np.tensordot(rates, [[d, -c], [-b, a]])
    u, sizes, v = np.linalg.svd(matrix)
    others = [np.prod(np.delete(sizes, i)) for i in range(len(sizes))]
    adjugate = np.linalg.det(u) * np.linalg.det(v) * (u * others) @ v
    return np.linalg.det(matrix), np.tensordot(rates, adjugate)


class Onset(_Condition):
    """The orbit just comes to the flank line: where contact is lost first.

    Of several meshes that of the number `mesh`, by default the one that comes nearest.
    """

    def __init__(self, mesh=None):
        self.mesh = mesh

    def condition(self, propagator, z, along, tangents):
        """As of `_Condition`."""
        model = propagator.model
        _, summary, _ = propagator.record(z, model.repeats, MAX_EVENTS)
        rows, _ = extrema_slopes(propagator, z, along, tangents, model.repeats)
        apart = np.ravel(np.atleast_2d(summary)[:, columns.X_MIN] - model.flank_lines[0])
        mesh = int(np.argmin(apart)) if self.mesh is None else self.mesh
        return apart[mesh], rows.reshape(4, apart.size, -1)[1, mesh]


class At:
    """An orbit at a speed in rpm; also of a train."""

    def __init__(self, speed, period=1):
        self.speed, self.period = speed, period

    def tuning(self, model, y):
        """As of `_Condition`."""
        return float(model.tuning_at(self.speed))

    def evaluate(self, model, y, names=(), last=None):
        """As of `_Condition`; a free rotation stays as it is."""
        tuning, bend = self.tuning(model, y), bent(model)
        propagator, unit = model.propagator(tuning), np.eye(len(y))
        end, maps, code = propagator.maps(y, self.period, MAX_EVENTS)
        _checked(maps, code)
        matrix, moved = bend, np.zeros((len(y), 0))
        for one in maps:
            matrix = one @ matrix
        if names:
            along = propagator.directions(model, ("tuning", *names))
            _, moved, code = propagator.map_slopes(y, along, self.period, MAX_EVENTS)
            _checked(moved, code)
            moved = moved[:, 1:] + np.outer(moved[:, 0], tuning_slopes(model, tuning, names))
        return bend @ (end - y), bend @ matrix - unit, bend @ moved


def bent(model):
    """Return what of a state bends the model, shape (n, n): all but its free rotation."""
    if model.size == 2:
        return _PLAIN
    reduce, lift = model.reduction()
    return lift @ reduce


def tuning_slopes(model, tuning, names):
    """Return how the tuning of a speed in rpm changes by parameters, shape (k,)."""
    rate = float(model.speed(1.0))
    return np.array([-tuning / rate * one for one in speed_slopes(model, names)])


def speed_slopes(model, names):
    """Return how the speed in rpm of tuning 1 changes by parameters, shape (k,)."""
    twins = (model.complex_step(model.direction(name)) for name in names)
    return np.array([np.imag(twin.speed(1.0) + 0j) / derivatives.STEP for twin in twins])


def extrema_slopes(propagator, z, along, tangents, period=1):
    """Return derivatives of largest and least displacement and force, (4 m, k), and the end."""
    model, k = propagator.model, len(along)
    m = max(len(model.mesh_names), 1)
    samples = model.empty_record()[0].shape[1] - m * (columns.SAMPLE_COLUMNS - 4)
    # Of trains extrema are looked for where there are samples.
    shapes = (period, samples, k), (0, 2, k), (4 * m, k), (4 * m, k)
    tables = tuple(map(np.empty, shapes))
    spans = period, period, MAX_EVENTS
    _, code, *_, ends = propagator.differentiate(z, along, tangents.copy(), spans, tables)
    return _checked(tables[2], code), ends


def solve(condition, model, guess, near=math.inf, last=None):
    """Return (y, derivatives of the equations) near a guess, None where there is no solution."""
    y = guess
    for _ in range(_MAX_NEWTON):
        try:
            miss, matrix, _ = condition.evaluate(model, y, last=last)
            step = np.linalg.solve(matrix, -miss)
        except (Failed, np.linalg.LinAlgError, ValueError):
            return None
        size = np.abs(step).max()
        if not size < _FARTHEST:
            return None
        last, y = (y, miss, matrix), y + step
        if size < _CLOSE * max(1.0, np.abs(y).max()):
            return (y, matrix) if np.abs(y - guess).max() <= near else None
        if condition.tuning(model, y) <= 0.0:
            return None
    return None


class Start:
    """A special point of one model, from which those of its neighbours are followed.

    ArithmeticError where Newton's method does not find it.
    """

    def __init__(self, condition, model, guess):
        found = solve(condition, model, np.asarray(guess, float))
        if found is None:
            raise Failed("no such point is near the guess")
        self.condition, self.model = condition, model
        self.y, self.matrix = found
        self.fields = _fields(model)
        self._slopes = self.slopes(self.fields)
        self._size = _determinant(self.matrix)

    def slopes(self, names):
        """Return the exact derivatives of y by parameters, shape (n, k)."""
        return slopes(self.condition, self.model, self.y, names)

    def at(self, model):
        """Return (y, `FOUND`) of another model; (None, code) where there is none."""
        change = np.array([_value(model, one) - _value(self.model, one) for one in self.fields])
        first = self._slopes @ np.where(np.isfinite(change), change, 0.0)
        known, h, matrix = [(0.0, self.y)], 1.0, self.matrix
        while known[-1][0] < 1.0:
            s, y = known[-1]
            share = min(1.0, s + h)
            guess = _ahead(known, first, share)
            here = model if share == 1.0 else between(self.model, model, share)
            off = _OFF if self.fields else _UNGUIDED
            near = off + _SHARE * np.abs(guess - y).max()
            found = solve(self.condition, here, guess, near, (None, None, matrix))
            if found is None or _determinant(found[1]) * self._size <= 0.0:
                h *= 0.5
                if h < _SHORTEST:
                    gone = abs(_determinant(matrix)) < _SINGULAR * abs(self._size)
                    return None, VANISHED if gone else LOST
                continue
            known.append((share, found[0]))
            matrix = found[1]
        return known[-1][1], FOUND


def slopes(condition, model, y, names):
    """Return the derivatives of the solution y of a model by parameters, shape (n, k)."""
    _, matrix, moved = condition.evaluate(model, y, tuple(names))
    return np.linalg.solve(matrix, -moved)


def _ahead(known, first, share):
    """Return the guess at a share of the way from what is known of it."""
    y0, (s, y) = known[0][1], known[-1]
    if len(known) == 1:
        return y0 + share * first
    if len(known) == 2:
        bend = (y - y0 - first * s) / s**2
        return y0 + first * share + bend * share**2
    before, last = known[-2]
    return y + (y - last) * ((share - s) / (s - before))


def _determinant(matrix):
    return np.linalg.det(matrix) / np.prod(np.linalg.norm(matrix, axis=1))


def _fields(model):
    """Return the numbers of a model by which there are derivatives, those that are not infinite."""
    found = []
    for name in model.derivatives:
        value = _value(model, name)
        if value is None or not math.isfinite(value):
            continue
        try:
            model.direction(name)
        except ValueError:
            # A switch of the stiffness that is not there.
            continue
        found.append(name)
    return tuple(found)


def _value(model, name):
    """Return the value of a field of a model or of its pair, None where it has none."""
    for one in (model, model.mesh):
        if one is not None and name in {field.name for field in dataclasses.fields(one)}:
            value = getattr(one, name)
            return float(value) if isinstance(value, (int, float)) else None
    return None


def moved(model, name, share):
    """Return (model with one parameter changed by about a share of it, by how much)."""
    if model.train is model:
        return _moved_train(model, model.direction(name), share)
    value = _value(model, name)
    step = share * (abs(value) or 1.0)
    if name in {field.name for field in dataclasses.fields(model)}:
        return _with(model, name, value + step), step
    return _with(model, "pair", _with(model.pair, name, value + step)), step


def _with(part, name, value):
    values = {one.name: getattr(part, one.name) for one in dataclasses.fields(part)}
    return derivatives.unchecked(type(part), **values | {name: value})


def _moved_train(train, slopes, share):
    """Return the same of a train, along a direction of `Model.direction`."""
    parts = {kind: dict(own) for kind, own in train_slopes.elements(train).items()}
    size = max(
        abs(value) / abs(slope)
        for (kind, label, field, *axis), slope in slopes.items()
        if slope
        for value in np.ravel(getattr(parts[kind][label], field))
    )
    # An error of assembly that is none: as a share of the static deflection.
    step = share * (size or train.static_deflection)
    for (kind, label, field, *axis), slope in slopes.items():
        old = getattr(parts[kind][label], field)
        new = (
            old + step * slope
            if not isinstance(old, tuple)
            else tuple(
                one + step * slope if not axis or i == axis[0] else one for i, one in enumerate(old)
            )
        )
        parts[kind][label] = _with(parts[kind][label], field, new)
    for field, kind in (("bodies", "body"), ("shafts", "shaft"), ("meshes", "mesh")):
        train = _with(train, field, tuple(parts[kind].values()))
    return train, step


def between(a: Any, b: Any, share):
    """Return a model, or a part of one, between two; where they do not match that of the second."""
    if dataclasses.is_dataclass(a) and type(a) is type(b):
        values = {
            one.name: between(getattr(a, one.name), getattr(b, one.name), share)
            for one in dataclasses.fields(b)
        }
        return derivatives.unchecked(type(b), **values)
    if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
        return tuple(between(x, y, share) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float) and math.isfinite(a - b):
        return a + share * (b - a)
    return b

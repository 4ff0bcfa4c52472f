"""The points of a branch of periodic orbits, and the equation that they solve.

Unknowns are the state at tau = 0, without free rotation, and the parameter. The residual and its
derivative by the state are those of shooting, exact. The derivative by the parameter is a central
difference, which decides how fast Newton's method converges, not where to.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits import shooting
from gearlib.analysis.orbits.followed_parameters import with_parameter
from gearlib.analysis.orbits.tracing import Lost
from gearlib.data import status
from gearlib.kernels import orbit as columns

#: Step of the difference by a parameter, in shares of its scale.
_DIFFERENCE = 1e-5
#: Events of several meshes closer in phase than this are simultaneous.
_AT_ONCE = 1e-9
_LETTERS = {1: "N", 0: "B", -1: "I"}


class Evaluation:
    """The shooting equation at one state and parameter, in scaled unknowns."""

    def __init__(self, problem, y, miss, residual, matrix):
        self.problem, self.y = problem, y
        self.miss = miss  #: shape (n,)
        self.residual = residual
        self.matrix = matrix  #: map of the whole period, shape (n, n)

    @property
    def small(self):
        """Whether the residual counts as none."""
        return self.residual <= shooting.RESIDUAL

    @cached_property
    def jacobian(self):
        """Derivative of the residuals, shape (n, n + parameters)."""
        n, y, units = len(self.matrix), self.y, self.problem.units
        jacobian = np.empty((n, y.size))
        jacobian[:, :n] = (self.matrix - np.eye(n)) * units[:n] / units[:n, None]
        jacobian[:, n:] = self.problem.slopes(y) / units[:n, None] * units[n:]
        return jacobian


class Shooting:
    """Orbits of `period` mesh periods of a model, over the state and one parameter or more.

    `names` are the parameters that vary, `scales` what change of each weighs as much as a static
    deflection.
    """

    def __init__(self, model, tuning, period, names, scales, max_events):
        self.pair, self.tuning, self.period = model, tuning, period
        self.names, self.max_events = names, checks.integer("max_events", max_events, 1)
        self._propagator = None
        self.reduce, self.lift = model.reduction()
        n = len(self.reduce)
        rates = np.full(n // 2, 1.0 / tuning)
        #: Size of one scaled unit of each unknown.
        self.units = np.concatenate([np.ones(n // 2), rates, scales])

    def unknowns(self, state, values):
        """Return the scaled unknowns y for a full state and the parameters."""
        return np.append(self.reduce @ state, values) / self.units

    def model(self, y):
        """Return (model, tuning, full state) for scaled unknowns, else ValueError."""
        n = len(self.reduce)
        model, tuning = self.pair, self.tuning
        for name, value in zip(self.names, (y * self.units)[n:], strict=True):
            model, tuning = with_parameter(model, tuning, name, float(value))
        return model, tuning, self.lift @ (y * self.units)[:n]

    def propagator(self, model, tuning):
        """Return the propagator of a model; that of the last tuning hands on what it can."""
        last = self._propagator
        if last is not None and last.model is model:
            self._propagator = last.at(tuning)
        else:
            self._propagator = model.propagator(tuning)
        return self._propagator

    def _end(self, y):
        model, tuning, z = self.model(y)
        end, maps, code = self.propagator(model, tuning).maps(z, self.period, self.max_events)
        if code != status.OK:
            raise Lost(f"the motion could not go on: {status.MESSAGES[code]}")
        return tuning, z, end, maps

    def evaluate(self, y):
        """Return the `Evaluation` at scaled unknowns."""
        try:
            tuning, z, end, maps = self._end(y)
        except ValueError as error:
            raise Lost(str(error)) from None
        miss = self.reduce @ (end - z)
        matrix = self.reduce @ shooting.product(maps) @ self.lift
        residual = shooting.size_of(miss, z, tuning)
        return Evaluation(self, y, miss / self.units[: miss.size], residual, matrix)

    def slopes(self, y):
        """Return the derivatives of the residuals by the parameters, shape (n, parameters)."""
        n = len(self.reduce)
        return np.column_stack([self._difference(y, column) for column in range(n, y.size)])

    def _difference(self, y, column):
        ends, steps = [], []
        for step in (-_DIFFERENCE, _DIFFERENCE):
            moved = y.copy()
            moved[column] += step
            try:
                ends.append(self._end(moved)[2])
            except ValueError:
                # On the rim of the parameter's range the difference is one-sided.
                moved[column] = y[column]
                ends.append(self._end(moved)[2])
            steps.append(moved[column])
        return self.reduce @ (ends[1] - ends[0]) / (steps[1] - steps[0]) / self.units[column]


@dataclass(frozen=True)
class BranchPoint:
    """One orbit of a branch."""

    y: np.ndarray  #: scaled unknowns
    tangent: np.ndarray  #: of the branch, unit length
    value: float  #: of the parameter
    state: np.ndarray  #: full state at tau = 0
    residual: float
    matrix: np.ndarray
    pattern: str  #: phases of contact in cyclic order, as letters
    high: float  #: largest displacement
    low: float  #: and smallest
    label: int = 0  #: of `gearlib.analysis.orbits.special_points.LABELS`

    @property
    def multipliers(self):
        """Floquet multipliers, complex, largest first."""
        return shooting.multipliers_of(self.matrix)

    @property
    def stable(self):
        """As of `gearlib.analysis.orbits.shooting.is_stable`."""
        return shooting.is_stable(self.multipliers)


def branch_point(problem, y, found, tangent):
    """Return the `BranchPoint` of a solution of a one-parameter `Shooting`."""
    model, tuning, z = problem.model(y)
    rest = problem.period, problem.max_events
    events, summary, _ = problem.propagator(model, tuning).record(z, *rest)
    return BranchPoint(
        y,
        tangent,
        float(y[-1] * problem.units[-1]),
        z,
        found.residual,
        found.matrix,
        _cyclic(events, summary, model.flank_lines),
        np.max(summary[..., columns.X_MAX]),
        np.min(summary[..., columns.X_MIN]),
    )


def as_orbit(problem, point):
    """Return the `Orbit` of a point of a branch."""
    model, tuning, z = problem.model(point.y)
    pattern, grazing = shooting.contacts(model, tuning, z, problem.period, problem.max_events)
    return shooting.Orbit(
        model, tuning, problem.period, z, point.residual, point.multipliers, pattern, grazing
    )


def _cyclic(events, summary, lines):
    """Return the phases of contact as letters, the same from wherever the orbit is looked at.

    An event that passes tau = 0 changes the order in which the phases are met, not the orbit. With
    several meshes the number of the mesh stands before the letter, and those that cross at once
    come in the order of their numbers.
    """
    if not len(events):
        middle = 0.5 * (summary[..., columns.X_MAX] + summary[..., columns.X_MIN])
        return "".join(_LETTERS[code] for code in shooting.resting(middle, middle, *lines))
    codes = events[:, columns.EVENT_TO]
    if events.shape[1] == columns.EVENT_COLUMNS and events[0, columns.EVENT_FROM] != codes[-1]:
        # It begins on a flank line to rounding: one of two events next to tau = 0 is missing.
        codes = np.append(codes, events[0, columns.EVENT_FROM])
    letters = [_LETTERS[int(code)] for code in codes]
    if events.shape[1] > columns.EVENT_COLUMNS:
        times = 2.0 * np.pi * events[:, columns.EVENT_PERIOD] + events[:, columns.EVENT_PHASE]
        at_once = np.cumsum(np.diff(times, prepend=times[0]) > _AT_ONCE)
        meshes = events[:, columns.EVENT_COLUMNS].astype(int)
        letters = [f"{meshes[i]}{letters[i]} " for i in np.lexsort((meshes, at_once))]
    # Of all beginnings the last in the alphabet: normal mesh first.
    return max("".join(letters[i:] + letters[:i]) for i in range(len(letters))).strip()

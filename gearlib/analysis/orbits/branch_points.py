"""The points of a branch of periodic orbits, and the equation that they solve.

Unknowns are the state at tau = 0, without free rotation, and the parameter. The residual and its
derivative by the state are those of shooting, exact. The derivative by the parameter is a central
difference, which decides how fast Newton's method converges, not where to.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits import shooting
from gearlib.analysis.orbits.followed_parameters import attributes, with_parameter
from gearlib.analysis.orbits.tracing import Lost, slope
from gearlib.data import status
from gearlib.data.result import result
from gearlib.engines import orbit as columns

#: Events of several meshes closer in phase than this are simultaneous.
_SIMULTANEOUS = 1e-9
_LETTERS = {1: "N", 0: "B", -1: "I"}


class Evaluation:
    """The shooting equation at one state and parameter, in scaled unknowns."""

    def __init__(self, problem, y):
        self.problem, self.y = problem, y
        tuning, self.state, end, maps = problem.run(y)
        miss = problem.reduce @ (end - self.state)
        self.miss = miss / problem.units[: miss.size]  #: shape (n,)
        self.residual = shooting.size_of(miss, self.state, tuning)
        #: Map of the whole period, shape (n, n).
        self.matrix = problem.reduce @ shooting.product(maps) @ problem.lift
        #: Whether the residual counts as none.
        self.small = self.residual <= shooting.RESIDUAL

    @cached_property
    def multipliers(self):
        """Floquet multipliers, complex, largest first."""
        return shooting.multipliers_of(self.matrix)

    @cached_property
    def jacobian(self):
        """Derivative of the residuals, shape (n, n + parameters)."""
        n, units, problem = len(self.matrix), self.problem.units, self.problem
        by_state = (self.matrix - np.eye(n)) * units[:n] / units[:n, None]
        by_parameters = [
            problem.reduce @ slope(lambda y: problem.run(y)[2], self.y, column) / units[:n]
            for column in range(n, self.y.size)
        ]
        return np.column_stack([by_state, *by_parameters])


class Shooting:
    """Orbits of `period` mesh periods of a model, over the state and one parameter or more.

    `names` are the parameters that vary, `scales` what change of each weighs as much as a static
    deflection.
    """

    def __init__(self, model, tuning, period, names, scales, max_events):
        self.pair, self.tuning, self.period = model, tuning, period
        self.names, self.max_events = names, checks.integer("max_events", max_events, 1)
        self._propagator: Any = None
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
        same = last is not None and last.model is model
        self._propagator = last.at(tuning) if same else model.propagator(tuning)
        return self._propagator

    def run(self, y):
        """Return (tuning, first state, last state, maps) of the period, else ValueError, Lost."""
        model, tuning, z = self.model(y)
        end, maps, code = self.propagator(model, tuning).maps(z, self.period, self.max_events)
        if code != status.OK:
            raise Lost(f"the motion could not go on: {status.MESSAGES[code]}")
        return tuning, z, end, maps

    def record(self, y, periods, samples=0):
        """Return (model, `Record` of a run over mesh periods)."""
        model, tuning, z = self.model(y)
        return model, self.propagator(model, tuning).record(z, periods, self.max_events, samples)

    def evaluate(self, y):
        """Return the `Evaluation` at scaled unknowns, else ValueError, Lost."""
        return Evaluation(self, y)


@dataclass(frozen=True)
class BranchPoint:
    """One orbit of a branch."""

    orbit: Evaluation
    tangent: np.ndarray  #: of the branch, unit length
    value: float  #: of the parameter
    pattern: str  #: phases of contact in cyclic order, as letters
    high: float  #: largest displacement
    low: float  #: and smallest
    label: int = 0  #: of `gearlib.analysis.orbits.special_points.LABELS`

    @property
    def y(self):
        """Scaled unknowns."""
        return self.orbit.y

    @property
    def height(self):
        """Difference of the largest and the smallest displacement."""
        return self.high - self.low


def branch_point(orbit, tangent):
    """Return the `BranchPoint` of an `Evaluation` with one parameter."""
    problem = orbit.problem
    model, record = problem.record(orbit.y, problem.period)
    events, summary = record.events, record.summary
    value = float(orbit.y[-1] * problem.units[-1])
    high, low = np.max(summary[..., columns.X_MAX]), np.min(summary[..., columns.X_MIN])
    return BranchPoint(
        orbit, tangent, value, _cyclic(events, summary, model.flank_lines), high, low
    )


def as_orbit(point):
    """Return the `Orbit` of a point of a branch."""
    orbit, problem = point.orbit, point.orbit.problem
    model, tuning, z = problem.model(orbit.y)
    pattern, grazing = shooting.contacts(model, tuning, z, problem.period, problem.max_events)
    return shooting.Orbit(
        model, tuning, problem.period, z, orbit.residual, orbit.multipliers, pattern, grazing
    )


def orbit_dataset(title, orbits, more, **asked):
    """Return a dataset of `Evaluation`s and their parameters over ``point``, and more variables."""
    problem = orbits[0].problem
    multipliers = np.array([orbit.multipliers for orbit in orbits])
    values = np.array([orbit.y * problem.units for orbit in orbits])[:, len(problem.reduce) :]
    data = {
        "state": (("point", "coordinate"), np.array([orbit.state for orbit in orbits])),
        "multiplier_real": (("point", "multiplier"), multipliers.real),
        "multiplier_imaginary": (("point", "multiplier"), multipliers.imag),
        "residual": ("point", np.array([orbit.residual for orbit in orbits])),
        "period": np.int32(problem.period),
    }
    if "tuning" not in problem.names:
        data["tuning"] = problem.tuning
    for name, column in zip(problem.names, values.T, strict=True):
        data[name] = "point", more.pop(name, column), attributes(problem.pair, name)
    asked |= {"period": problem.period, "tuning": problem.tuning}
    return result(title, problem.pair, data | more, method="pseudo-arclength on shooting", **asked)


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
        instants = np.cumsum(np.diff(times, prepend=times[0]) > _SIMULTANEOUS)
        meshes = events[:, columns.EVENT_COLUMNS].astype(int)
        letters = [f"{meshes[i]}{letters[i]} " for i in np.lexsort((meshes, instants))]
    # Of all beginnings the last in the alphabet: normal mesh first.
    return max("".join(letters[i:] + letters[:i]) for i in range(len(letters))).strip()

"""The points of a branch of periodic orbits, and their dataset."""

from dataclasses import dataclass

import numpy as np

from gearlib.analysis.orbits.followed_parameters import attributes
from gearlib.analysis.orbits.shooting import Evaluation, resting
from gearlib.data.result import result
from gearlib.engines import orbit as columns

#: Events of several meshes closer in phase than this are simultaneous.
_SIMULTANEOUS = 1e-9
_LETTERS = {1: "N", 0: "B", -1: "I"}


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
        return "".join(_LETTERS[code] for code in resting(middle, middle, *lines))
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

"""Test problems for methods: models, and runs of any method."""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gearlib import integrators
from gearlib.data import status
from gearlib.engines import orbit
from gearlib.engines.orbit import Span
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains.ready_made import split_power_reducer
from gearlib.runs.run_arguments import MAX_EVENTS

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.integrators import scipy_ivp  # noqa: F401

#: Mesh periods in which the slowest of the damped problems settles to rounding.
SETTLING = 400
#: At rest on the flank line.
START = (0.0, 0.0)


class Case(NamedTuple):
    """The changes that make a test problem of the gear pair."""

    tuning: float
    damped: tuple[bool, bool]  #: whether linear damping acts in contact and in the backlash
    kind: str = "linear"  #: or "cubic", "six_degrees", "train"
    steady: bool = True  #: whether it has an orbit of one mesh period to settle on


#: name -> `Case`. With run-out, six degrees repeat after a revolution only.
CASES = {
    "smooth": Case(0.7, (True, True)),
    "bouncing": Case(0.9, (True, True)),
    "near_fold": Case(0.815, (True, False)),
    "conservative": Case(0.9, (False, False), steady=False),
    "six_degrees": Case(0.82, (True, True), "six_degrees", False),
    "cubic": Case(0.9, (False, False), "cubic"),
    "reducer": Case(0.9, (True, True), "train", False),
}


class Problem(NamedTuple):
    """One test problem: a motion from rest on the flank line."""

    name: str
    model: Any  #: GearPair, OneDegreePair, SixDegreePair or GearTrain
    tuning: float
    periods: int
    record_periods: int
    steady: bool


class Run(NamedTuple):
    """The result of a method; NaN and no events where it stopped early."""

    state: np.ndarray  #: (x, dx/dtau) at the end
    phases: np.ndarray  #: of the events of the recorded periods, rad from the start of the run
    kinds: np.ndarray  #: contact codes (from, to) of the events, shape (n, 2)
    height: float  #: of the recorded orbit, static deflections
    evaluations: int
    code: int


def build(name, pair, six_degrees, settings):
    """Return a `Problem`.

    name: of `CASES`; pair: keyword arguments of `GearPair`, without damping; six_degrees: what
    `SixDegreePair` needs beyond the pair; settings: damping (N s/m), cubic_damping (N s^3/m^3),
    periods, conservative_periods, record_periods.
    """
    case = CASES[name]
    material, oil = (settings["damping"] if damped else 0.0 for damped in case.damped)
    model = GearPair(**pair).replace(material_damping=material, backlash_damping=oil)
    if case.kind == "six_degrees":
        model = SixDegreePair(pair=model, **six_degrees)
    elif case.kind == "cubic":
        cubic = settings["cubic_damping"]
        model = OneDegreePair(pair=model, cubic_damping=cubic, backlash_cubic_damping=cubic)
    elif case.kind == "train":
        # Three equal branches, whose meshes part and touch at once; axes fixed.
        model = split_power_reducer(model, support_stiffness=math.inf)
    # Without damping rounding errors grow with every bounce: longer runs compare nothing. Steps of
    # trains are interpreted.
    brief = name == "conservative" or case.kind == "train"
    periods = settings["conservative_periods" if brief else "periods"]
    recorded = min(settings["record_periods"], periods)
    return Problem(name, model, case.tuning, periods, recorded, case.steady)


def takes(method, model):
    """Return whether a method takes a model."""
    return integrators.METHODS[method].takes(model)


class Bound:
    """A method with its options, bound to a model at one tuning."""

    def __init__(self, model, tuning, method, options):
        _, self._module, self._options = integrators.choose(model, method, options)
        self._model, self._tuning = model, tuning

    def record(self, state, periods, record_periods=1):
        """Return the `gearlib.engines.orbit.Record` of a run."""
        span = Span(periods, record_periods, MAX_EVENTS)
        return self._module.run(self._model, self._tuning, state, span, **self._options)

    def run(self, state, periods, record_periods=1):
        """Run; return a `Run`: of a train the state of its first mesh, events mesh by mesh."""
        record = self.record(state, periods, record_periods)
        code, evaluations, rows = int(record.status), int(record.evaluations), record.events
        if code != status.OK:
            nothing = np.empty(0), np.empty((0, 2), np.int8)
            return Run(np.full(2, math.nan), *nothing, math.nan, evaluations, code)
        final = record.final
        if self._model.mesh_names:
            final = final.reshape(2, -1) @ self._model.structure.lines[0]
            # What several meshes do at once has no order.
            rows = rows[np.argsort(rows[:, orbit.EVENT_COLUMNS], kind="stable")]
        high = record.summary[..., orbit.X_MAX].max()
        low = record.summary[..., orbit.X_MIN].min()
        return Run(
            final,
            2.0 * math.pi * rows[:, orbit.EVENT_PERIOD] + rows[:, orbit.EVENT_PHASE],
            rows[:, [orbit.EVENT_FROM, orbit.EVENT_TO]].astype(np.int8),
            float(high - low),
            evaluations,
            code,
        )


def attempt(problem, method, options):
    """Return the `Run` of a method on a problem."""
    bound = Bound(problem.model, problem.tuning, method, options)
    return bound.run(START, problem.periods, problem.record_periods)


def largest_multiplier(matrix):
    """Return the largest absolute eigenvalue; NaN if the matrix holds NaN."""
    return float(np.abs(np.linalg.eigvals(matrix)).max()) if np.isfinite(matrix).all() else math.nan


def difference_map(problem, state, step, method, options):
    """Return the central differences, half width `step`, of a method's own map of one period.

    state: shape (2,), start of the period; step: static deflections, and dx/dtau.

    Shape (2, 2).
    """
    bound = Bound(problem.model, problem.tuning, method, options)
    columns = []
    for direction in step * np.eye(2):
        ends = [bound.run(tuple(state + side * direction), 1).state for side in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.transpose(columns)

"""Test problems of work and precision: models, and runs of any method."""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains.ready_made import split_power_reducer
from gearlib.runs.simulation import simulate

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.integrators import scipy_ivp  # noqa: F401


class Case(NamedTuple):
    """What makes a test problem of the gear pair."""

    tuning: float
    damped: tuple[bool, bool]  #: whether linear damping acts in contact and in the backlash
    steady: bool  #: whether it has an orbit of one mesh period to settle on


#: name -> `Case`. With run-out, six degrees repeat after a revolution only.
CASES = {
    "smooth": Case(0.7, (True, True), True),
    "bouncing": Case(0.9, (True, True), True),
    "near_fold": Case(0.815, (True, False), True),
    "conservative": Case(0.9, (False, False), False),
    "six_degrees": Case(0.82, (True, True), False),
    "cubic": Case(0.9, (False, False), True),
    "reducer": Case(0.9, (True, True), False),
}


class Problem(NamedTuple):
    """One test problem: a motion from rest on the flank line."""

    model: Any  #: GearPair, OneDegreePair, SixDegreePair or GearTrain
    tuning: float
    periods: int
    record_periods: int
    steady: bool


class Motion(NamedTuple):
    """The end of a run; NaN and no events where the run stopped early."""

    state: np.ndarray  #: displacement and dx/dtau, of a train those of its first mesh
    phases: np.ndarray  #: of the events of the recorded periods, rad from the start of the run
    codes: np.ndarray  #: contact codes (from, to) of the events, shape (n, 2)
    evaluations: int = 0  #: of the right-hand side


def build(name, pair, six_degrees, settings):
    """Return the `Problem` of a name in `CASES`.

    pair: keyword arguments of `GearPair`, without damping; six_degrees: what `SixDegreePair` needs
    beyond the pair; settings: damping (N s/m), cubic_damping (N s^3/m^3), periods,
    conservative_periods, record_periods.
    """
    case = CASES[name]
    material, oil = (settings["damping"] if damped else 0.0 for damped in case.damped)
    model = GearPair(**pair).replace(material_damping=material, backlash_damping=oil)
    if name == "six_degrees":
        model = SixDegreePair(pair=model, **six_degrees)
    elif name == "cubic":
        cubic = settings["cubic_damping"]
        model = OneDegreePair(pair=model, cubic_damping=cubic, backlash_cubic_damping=cubic)
    elif name == "reducer":
        # Three equal branches, whose meshes part and touch at once; axes fixed.
        model = split_power_reducer(model, support_stiffness=math.inf)
    # Without damping rounding errors grow with every bounce: longer runs compare nothing. Steps of
    # trains are interpreted.
    brief = name in ("conservative", "reducer")
    periods = settings["conservative_periods" if brief else "periods"]
    recorded = min(settings["record_periods"], periods)
    return Problem(model, case.tuning, periods, recorded, case.steady)


def run(problem, method=None, options=None, state=(0.0, 0.0), periods=None):
    """Return the `Motion` of a method on a problem, by default over its mesh periods from rest."""
    periods = periods or problem.periods
    data = simulate(
        problem.model,
        problem.tuning,
        periods=periods,
        record_periods=min(periods, problem.record_periods),
        samples_per_period=1,
        initial_state=tuple(state),
        method=method,
        options=options,
    )
    end, order = data.final_state.values, np.arange(data.sizes["event"])
    if problem.model.mesh_names:
        end = end.reshape(2, -1) @ problem.model.structure.lines[0]
        # What several meshes do at once has no order.
        order = np.argsort(data.event_mesh.values, kind="stable")
    codes = np.column_stack([data.event_from.values, data.event_to.values])
    return Motion(end, data.event_phase.values[order], codes[order], int(data.evaluations))


def difference_map(period_map, state, step):
    """Return the derivative (2, 2) of a map of states by central differences of half width step."""
    columns = [
        (period_map(state + shift) - period_map(state - shift)) / (2 * step)
        for shift in step * np.eye(2, dtype=int)
    ]
    return np.column_stack(columns).astype(float)


def largest_multiplier(matrix):
    """Return the largest |eigenvalue|; NaN if the matrix holds NaN."""
    return float(np.abs(np.linalg.eigvals(matrix)).max()) if np.isfinite(matrix).all() else math.nan

"""Define the test problems of the work-precision study, and run methods on them."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains.ready_made import split_power_reducer
from gearlib.runs.simulation import simulate


class Case(NamedTuple):
    """Tuning, damping and kind of motion of a test problem."""

    tuning: float
    damped_in_contact: bool  #: whether linear damping acts in contact
    damped_in_backlash: bool  #: whether linear damping acts in free flight
    settles: bool  #: whether the motion settles on an orbit of one mesh period


#: Name -> `Case`. The six-degree model has run-out, so it only repeats after a revolution.
CASES = {
    "smooth": Case(0.7, True, True, settles=True),
    "bouncing": Case(0.9, True, True, settles=True),
    "near_fold": Case(0.815, True, False, settles=True),
    "conservative": Case(0.9, False, False, settles=False),
    "six_degrees": Case(0.82, True, True, settles=False),
    "cubic": Case(0.9, False, False, settles=True),
    "reducer": Case(0.9, True, True, settles=False),
}


class Problem(NamedTuple):
    """A test problem: a motion from rest where drive-side contact begins."""

    model: Any  #: GearPair, OneDegreePair, SixDegreePair or GearTrain
    tuning: float
    periods: int
    record_periods: int
    settles: bool  #: whether the motion settles on an orbit of one mesh period


class Motion(NamedTuple):
    """Final state and contact events of a run; NaN and no events if the run stopped early."""

    state: np.ndarray  #: final displacement and dx/dtau; for a train, of its first mesh
    phases: np.ndarray  #: phases of the contact events in the record, rad from the start of the run
    codes: np.ndarray  #: contact states (from, to) of the events, shape (n, 2)
    evaluations: int = 0  #: of the right-hand side


def build_problem(name: str, pair: GearPair, six_degrees: dict, settings: dict) -> Problem:
    """Build the test problem called `name`, one of `CASES`.

    `pair` is undamped, and `six_degrees` has further arguments of `SixDegreePair`. `settings` has
    the keys damping (N s/m), cubic_damping (N s^3/m^3), periods (number of mesh periods),
    conservative_periods (number of mesh periods of short runs) and record_periods (number of mesh
    periods recorded at the end).
    """
    case = CASES[name]
    damping = settings["damping"]
    model: Any = pair.replace(
        material_damping=damping if case.damped_in_contact else 0.0,
        backlash_damping=damping if case.damped_in_backlash else 0.0,
    )
    if name == "six_degrees":
        model = SixDegreePair(pair=model, **six_degrees)
    elif name == "cubic":
        cubic = settings["cubic_damping"]
        model = OneDegreePair(pair=model, cubic_damping=cubic, backlash_cubic_damping=cubic)
    elif name == "reducer":
        # The meshes of three equal branches on fixed axes lose contact simultaneously.
        model = split_power_reducer(model, support_stiffness=math.inf)
    # Without damping, rounding errors grow with every bounce. Runs of trains are slow.
    is_short = name in ("conservative", "reducer")
    periods = settings["conservative_periods" if is_short else "periods"]
    record_periods = min(settings["record_periods"], periods)
    return Problem(model, case.tuning, periods, record_periods, case.settles)


def run_problem(
    problem: Problem, method=None, options=None, state: Sequence[float] = (0.0, 0.0), periods=None
) -> Motion:
    """Run a method with options on a test problem; return final state and contact events.

    If `method` is None, the automatic method is used. The motion starts from `state` (displacement
    and its derivative with respect to the mesh phase) and lasts `periods` mesh periods, by default
    `problem.periods`.
    """
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
    final_state = data.final_state.values
    event_order = np.arange(data.sizes["event"])
    if problem.model.mesh_names:
        # Convert the state of the train to displacement and velocity of the first mesh.
        final_state = final_state.reshape(2, -1) @ problem.model.structure.mesh_jacobian[0]
        # Simultaneous events of several meshes have no unique order, so they are sorted by mesh.
        event_order = np.argsort(data.event_mesh.values, kind="stable")
    phases = data.event_phase.values[event_order]
    codes = np.column_stack([data.event_from.values, data.event_to.values])[event_order]
    return Motion(final_state, phases, codes, int(data.evaluations))


def period_map_jacobian(period_map: Callable, state: np.ndarray, step: Any) -> np.ndarray:
    """Return the Jacobian (monodromy matrix), shape (2, 2), of the map over one mesh period.

    It is approximated at `state`, shape (2,), by central differences with the half width `step`, a
    float or a `Decimal`. Its eigenvalues are the Floquet multipliers.
    """
    columns = []
    for shift in step * np.eye(2, dtype=int):
        columns.append((period_map(state + shift) - period_map(state - shift)) / (2 * step))
    return np.column_stack(columns).astype(float)


def largest_multiplier(matrix: np.ndarray) -> float:
    """Return the largest absolute eigenvalue of a matrix, NaN if the matrix is not finite."""
    if not np.isfinite(matrix).all():
        return math.nan
    return float(np.abs(np.linalg.eigvals(matrix)).max())

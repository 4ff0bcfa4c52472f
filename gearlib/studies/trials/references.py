"""Compute the reference motions of the test problems in 50 or more digits.

A run is repeated with more digits until two runs agree far below the last digit of a float, so that
no method is measured by another method or by itself. The reference of a gear train is an exact run,
which a test confirms with two other codes to `TRAIN_ACCURACY`.
"""

import math
from collections.abc import Sequence
from decimal import Decimal, localcontext
from itertools import pairwise

import numpy as np
import xarray as xr

from gearlib.data.result import result_of_many, stacked
from gearlib.models.pair import GearPair
from gearlib.studies.trials import high_precision, problems

#: Digits of the runs; each run is checked by the next one until two agree.
DIGITS = (30, 50, 100, 200, 400)
#: Limit on the difference of two runs: 1e-4 of the spacing of floats at 1.
AGREEMENT = Decimal("1e-20")
#: Accuracy of the references of gear trains.
TRAIN_ACCURACY = 1e-11
#: Mesh periods in which the slowest of the damped problems settles to rounding.
SETTLING_PERIODS = 400
#: Half width of central differences: truncation and rounding errors are of equal size.
DIFFERENCE = Decimal("1e-17")
#: Limit on the difference of the states at start and end of a mesh period of an orbit.
MAX_RESIDUAL = 1e-9


def reference(problem: problems.Problem) -> problems.Motion:
    """Return the motion of a test problem, correct to the last digit of a float.

    The number of digits is increased until two runs agree; a gear train is run by method "exact".
    """
    if problem.model.mesh_names:
        return problems.run(problem, "exact")
    arguments = problem.model, problem.tuning, problem.periods
    runs = (high_precision.run(*arguments, digits) for digits in DIGITS)
    for (last_state, last_phases, last_codes), (state, phases, codes) in pairwise(runs):
        if not np.array_equal(codes, last_codes):
            continue
        differences = np.concatenate([state - last_state, phases - last_phases])
        if (np.abs(differences) <= AGREEMENT).all():
            record_start = 2.0 * math.pi * (problem.periods - problem.record_periods)
            is_recorded = np.array(phases >= record_start, bool)
            event_phases = phases[is_recorded].astype(float)
            return problems.Motion(state.astype(float), event_phases, codes[is_recorded])
    raise ValueError(
        f"periods = {problem.periods} are not allowed for this {type(problem.model).__name__}: "
        f"its motion must be computable with {DIGITS[-1]} digits"
    )


def settled_orbit(problem: problems.Problem) -> tuple[np.ndarray, float]:
    """Return the state and the largest absolute Floquet multiplier of the orbit of a problem.

    The final state of a long run is corrected by a Newton step in 50 digits. Both are NaN if the
    problem does not settle on an orbit of one mesh period.
    """

    def period_map(start: np.ndarray) -> np.ndarray:
        return high_precision.run(problem.model, problem.tuning, 1, DIGITS[1], start)[0]

    state = problems.run(problem, periods=SETTLING_PERIODS).state
    if problem.settles and np.isfinite(state).all():
        with localcontext(prec=DIGITS[1]):
            start = high_precision.decimals(state)
            residual = (period_map(start) - start).astype(float)
            if np.abs(residual).max() < MAX_RESIDUAL:
                matrix = problems.period_map_jacobian(period_map, start, DIFFERENCE)
                orbit = state + np.linalg.solve(np.eye(2) - matrix, residual)
                return orbit, problems.largest_multiplier(matrix)
    return np.full(2, math.nan), math.nan


def compute(names: Sequence[str], pair: GearPair, six_degrees: dict, settings: dict) -> xr.Dataset:
    """Return the reference motions, orbits and multipliers of the test problems of these names.

    The other arguments are those of `problems.build`. Orbit and multiplier are NaN for problems
    without an orbit of one mesh period.
    """
    built = {name: problems.build(name, pair, six_degrees, settings) for name in names}
    motions = {name: reference(problem) for name, problem in built.items()}

    def orbit_data(name: str) -> dict:
        orbit, multiplier = settled_orbit(built[name])
        state = motions[name].state
        return {"final_state": state, "orbit_state": orbit, "largest_multiplier": multiplier}

    axes = {"problem": list(names)}
    phases = [motion.phases for motion in motions.values()]
    codes = np.concatenate([motion.codes for motion in motions.values()])
    data = stacked(axes, orbit_data, "component") | {
        "event_problem": ("event", np.repeat(names, [*map(len, phases)])),
        "event_phase": ("event", np.concatenate(phases)),
        "event_from": ("event", codes[:, 0]),
        "event_to": ("event", codes[:, 1]),
    }
    title = "References of the test problems, from 50 digits or more"
    parameters = {"settings": settings, "six_degrees": six_degrees}
    origin = {
        "references": GearPair.references,
        "gear_pair": pair.as_dict(),
        "parameters": parameters,
    }
    return result_of_many(title, data, axes, **origin)


def motion_of(dataset: xr.Dataset, name: str) -> problems.Motion:
    """Return the reference motion of the problem `name` from a dataset of `compute`."""
    events = dataset.isel(event=np.flatnonzero(dataset.event_problem.values == name))
    state, codes = dataset.final_state.sel(problem=name), (events.event_from, events.event_to)
    return problems.Motion(state.values, events.event_phase.values, np.column_stack(codes))

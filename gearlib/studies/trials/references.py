"""References that methods are measured by: the test problems in 50 digits, whatever the parameters.

How many of the digits are right is not guessed: a run is repeated with more until two runs agree
far below the last place of a float. So no method is measured by another, nor by itself. Gear trains
have no such digits: theirs is an exact run, which two other codes confirm to `TRAINS` in a test,
and no error below that is told.
"""

import math
from decimal import Decimal, localcontext
from itertools import pairwise

import numpy as np

from gearlib.data.result import result_of_many, stacked
from gearlib.models.pair import GearPair
from gearlib.studies.trials import high_precision, problems

#: Digits of the runs; the first is the check of the second, and so on while they differ.
DIGITS = (30, 50, 100, 200, 400)
#: What two runs may differ by: 1e-4 of the last place of a float of 1.
AGREEMENT = Decimal("1e-20")
#: What the reference of a gear train is known to.
TRAINS = 1e-11
#: Mesh periods in which the slowest of the damped problems settles to rounding.
SETTLING = 400
#: Half width of central differences: its square and the last of 50 digits over it are alike.
DIFFERENCE = Decimal("1e-17")
#: How far an orbit of one mesh period may be from where it started.
CLOSED = 1e-9


def reference(problem):
    """Return the `Motion` of a problem, right to the last place of a float."""
    if problem.model.mesh_names:
        return problems.run(problem, "exact")
    arguments = problem.model, problem.tuning, problem.periods
    runs = (high_precision.run(*arguments, digits) for digits in DIGITS)
    for (rough_state, rough_phases, rough_codes), (state, phases, codes) in pairwise(runs):
        if np.array_equal(codes, rough_codes):
            apart = np.abs(np.concatenate([state - rough_state, phases - rough_phases]))
            if (apart <= AGREEMENT).all():
                first = 2.0 * math.pi * (problem.periods - problem.record_periods)
                late = np.array(phases >= first, bool)
                return problems.Motion(state.astype(float), phases[late].astype(float), codes[late])
    raise ValueError(
        f"periods = {problem.periods} are not allowed for this {type(problem.model).__name__}: "
        f"{DIGITS[-1]} digits must follow its motion"
    )


def settled(problem):
    """Return (state at tau = 0, largest |Floquet multiplier|) of the orbit of one mesh period.

    A Newton step in 50 digits goes on from the end of a long run. NaN where that is no such orbit.
    """

    def period_map(start):
        return high_precision.run(problem.model, problem.tuning, 1, DIGITS[1], start)[0]

    state = problems.run(problem, periods=SETTLING).state
    if problem.steady and np.isfinite(state).all():
        with localcontext(prec=DIGITS[1]):
            start = high_precision.decimals(state)
            gap = (period_map(start) - start).astype(float)
            if np.abs(gap).max() < CLOSED:
                matrix = problems.difference_map(period_map, start, DIFFERENCE)
                orbit = state + np.linalg.solve(np.eye(2) - matrix, gap)
                return orbit, problems.largest_multiplier(matrix)
    return np.full(2, math.nan), math.nan


def compute(names, pair, six_degrees, settings):
    """Return the references of problems as one dataset; arguments as in `problems.build`.

    Orbit and multiplier are NaN where a problem has no orbit of one mesh period.
    """
    built = {name: problems.build(name, pair, six_degrees, settings) for name in names}
    motions = {name: reference(problem) for name, problem in built.items()}

    def facts(name):
        orbit, multiplier = settled(built[name])
        state = motions[name].state
        return {"final_state": state, "orbit_state": orbit, "largest_multiplier": multiplier}

    axes, (_, phases, codes, _) = {"problem": list(names)}, zip(*motions.values(), strict=True)
    data = stacked(axes, facts, "component") | {
        "event_problem": ("event", np.repeat(names, [*map(len, phases)])),
        "event_phase": ("event", np.concatenate(phases)),
        "event_from": ("event", np.concatenate(codes)[:, 0]),
        "event_to": ("event", np.concatenate(codes)[:, 1]),
    }
    title = "References of the test problems, from 50 digits or more"
    parameters = {"settings": settings, "six_degrees": six_degrees}
    origin = {"references": GearPair.references, "gear_pair": pair, "parameters": parameters}
    return result_of_many(title, data, axes, **origin)


def motion_of(dataset, name):
    """Return the `Motion` of a problem from a dataset of `compute`."""
    events = dataset.isel(event=np.flatnonzero(dataset.event_problem.values == name))
    state, codes = dataset.final_state.sel(problem=name), (events.event_from, events.event_to)
    return problems.Motion(state.values, events.event_phase.values, np.column_stack(codes))

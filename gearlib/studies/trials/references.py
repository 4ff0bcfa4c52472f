"""References that methods are measured by: the test problems in 50 digits, whatever the parameters.

How many of the digits are right is not guessed: a run is repeated with more until two runs agree
far below the last place of a float. So no method is measured by another, nor by itself. Gear trains
have no such digits: theirs is an exact run, which two other codes confirm to `TRAINS` in a test,
and no error below that is told.
"""

import math
from decimal import Decimal, localcontext

import numpy as np

from gearlib.data import status
from gearlib.data.result import result_of_many, stacked
from gearlib.models.pair import GearPair
from gearlib.studies.trials import high_precision, problems
from gearlib.studies.trials.high_precision import Unresolved

#: Digits of the runs; the first is the check of the second, and so on while they differ.
DIGITS = (30, 50, 100, 200, 400)
#: What the reference of a gear train is known to.
TRAINS = 1e-11
#: What two runs may differ by: 1e-4 of the last place of a float of 1.
_AGREEMENT = Decimal("1e-20")
#: Half width of central differences: its square and the last of 50 digits over it are alike.
_WIDTH = Decimal("1e-17")
#: Distance in which Newton's method has to end, and how far it may go from where a run settles.
_CLOSED, _NEAR = Decimal("1e-30"), 1e-6


def reference(problem):
    """Return the `gearlib.studies.trials.problems.Run` of a problem, right to the last place.

    ValueError if 400 digits do not follow the motion.
    """
    if problem.model.mesh_names:
        return problems.attempt(problem, "exact", {})
    last = None
    for digits in DIGITS:
        try:
            motion = high_precision.run(problem.model, problem.tuning, problem.periods, digits)
        except Unresolved:
            continue
        if last is not None and _agree(last, motion):
            first = 2.0 * math.pi * (problem.periods - problem.record_periods)
            return _rounded(motion, first)
        last = motion
    raise ValueError(
        f"periods = {problem.periods} is not allowed for the problem {problem.name!r} of this gear "
        f"pair: {DIGITS[-1]} digits must follow its motion"
    )


def _agree(one, other):
    kinds = [[event[1:] for event in motion.events] for motion in (one, other)]
    values = [[*motion.state, *(event.phase for event in motion.events)] for motion in (one, other)]
    return kinds[0] == kinds[1] and all(
        abs(a - b) <= _AGREEMENT for a, b in zip(*values, strict=True)
    )


def _rounded(motion, first):
    """Return a motion as a `Run` with the events from a phase on."""
    events = [event for event in motion.events if event.phase >= first]
    return problems.Run(
        np.array([float(value) for value in motion.state]),
        np.array([float(event.phase) for event in events]),
        np.array([event[1:] for event in events], np.int8).reshape(-1, 2),
        math.nan,
        0,
        status.OK,
    )


def settled(problem):
    """Return the orbit of one mesh period that a problem settles on.

    Where a long run of the library ends, Newton's method in 50 digits goes on, with maps from
    central differences; no variational equation is needed.

    run: one period; its state is that at tau = 0. NaN if the motion settles on no such orbit;
    multiplier: largest |Floquet multiplier|.
    """
    model, nu = problem.model, problem.tuning
    guess = problems.Bound(model, nu, None, {}).run(problems.START, problems.SETTLING).state
    nothing = problems.Run(
        np.full(2, math.nan), np.empty(0), np.empty((0, 2), np.int8), math.nan, 0, status.OK
    )
    if not np.isfinite(guess).all():
        return nothing, math.nan
    start = [Decimal(value) for value in guess.tolist()]
    with localcontext(prec=60):
        # From 1e-15 or so two steps lead to the end.
        for _ in range(6):
            if max(abs(float(z) - g) for z, g in zip(start, guess, strict=True)) > _NEAR:
                break
            motion = high_precision.run(model, nu, 1, state=start)
            (a, c), (b, d) = (_difference(model, nu, start, i) for i in range(2))
            gap = [end - z for end, z in zip(motion.state, start, strict=True)]
            if max(map(abs, gap)) < _CLOSED:
                matrix = np.array([[float(a), float(b)], [float(c), float(d)]])
                return _rounded(motion, 0.0), problems.largest_multiplier(matrix)
            a, d = a - 1, d - 1
            determinant = a * d - b * c
            start[0] -= (d * gap[0] - b * gap[1]) / determinant
            start[1] -= (a * gap[1] - c * gap[0]) / determinant
    return nothing, math.nan


def _difference(model, nu, start, i):
    """Return column i of the derivative of the state after a period by that before it."""
    ends = []
    for side in (1, -1):
        state = list(start)
        state[i] += side * _WIDTH
        ends.append(high_precision.run(model, nu, 1, state=state).state)
    return [(high - low) / (2 * _WIDTH) for high, low in zip(*ends, strict=True)]


def compute(names, pair, six_degrees, settings):
    """Return the references of problems as one dataset.

    names: of `gearlib.studies.trials.problems.CASES`; pair, six_degrees, settings: as of
    `gearlib.studies.trials.problems.build`.

    Orbit and multiplier are NaN where a problem has no orbit of one mesh period.
    """
    runs = []

    def facts(name):
        problem = problems.build(name, pair, six_degrees, settings)
        runs.append(reference(problem))
        orbit, multiplier = np.full(2, math.nan), math.nan
        if problem.steady:
            found, multiplier = settled(problem)
            orbit = found.state
        state = runs[-1].state
        return {"final_state": state, "orbit_state": orbit, "largest_multiplier": multiplier}

    data = stacked({"problem": list(names)}, facts, "component")
    kinds = np.concatenate([run.kinds for run in runs])
    data |= {
        "event_problem": ("event", np.repeat(list(names), [run.phases.size for run in runs])),
        "event_phase": ("event", np.concatenate([run.phases for run in runs])),
        "event_from": ("event", kinds[:, 0]),
        "event_to": ("event", kinds[:, 1]),
    }
    said = {
        "references": GearPair.references,
        "gear_pair": pair,
        "parameters": {"settings": settings, "six_degrees": six_degrees},
    }
    title = "References of the test problems, from 50 digits or more"
    return result_of_many(title, data, {"problem": list(names)}, **said)


def run_of(dataset, name):
    """Return the `Run` of a problem from a dataset of `compute`."""
    events = dataset.isel(event=np.flatnonzero(dataset.event_problem.values == name))
    return problems.Run(
        dataset.final_state.sel(problem=name).values,
        events.event_phase.values,
        np.column_stack([events.event_from.values, events.event_to.values]),
        math.nan,
        0,
        status.OK,
    )


def orbit_of(dataset, name):
    """Return (start, largest |Floquet multiplier|) of the settled orbit of a problem, or NaN."""
    one = dataset.sel(problem=name)
    return one.orbit_state.values, float(one.largest_multiplier)

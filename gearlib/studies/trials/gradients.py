"""Derivatives of the final state by parameters: ways to get them, on ten difficult problems.

==================  ============================================================================
way                 what it is
==================  ============================================================================
exact               `simulate(..., sensitivities=...)`
differences         central differences of scipy's `solve_ivp` as it comes, steps of 1e-6
differences-1e-9    the same with DOP853 at a tolerance of 1e-9
smoothed            those of contact smoothed by tanh, at a tolerance of 1e-12
diffrax             automatic differentiation of the steps of a solver in JAX, forwards
heyoka              its variational equations, from event to event
==================  ============================================================================

The last two as their manuals have it: the right-hand side chooses by the state, and nothing tells
them what an event that moves does to a derivative. The judge is the central difference of Taylor
steps to rounding, which share nothing with method "exact" but the model. Derivatives are by the
logarithm of a parameter. The error is the largest of all parameters, each over the size of its
derivative; the first rule that holds gives the verdict:

==================  ============================================================================
verdict             rule
==================  ============================================================================
said so             a derivative is NaN or infinite, or the run did not end
right               the error is at most `RIGHT`
inaccurate          it is at most `ROUGH`
silently wrong      none of these
==================  ============================================================================
"""

import importlib
import math
from typing import TYPE_CHECKING

import numpy as np

from gearlib.data.result import result_of_many, stacked
from gearlib.data.status import flags_of
from gearlib.runs.simulation import simulate
from gearlib.studies.trials.difficult_problems import problems

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.integrators import scipy_ivp, smoothed, taylor_steps  # noqa: F401
    from gearlib.integrators.peers import diffrax_gradients, heyoka_gradients  # noqa: F401

VERDICTS = ("right", "inaccurate", "silently_wrong", "said_so")
RIGHT, ROUGH = 1e-4, 0.1
PROBLEMS = (
    "graze_short_6",
    "graze_past_6",
    "tiny_bounce",
    "rest_near",
    "no_backlash",
    "endless_backlash",
    "overdamped",
    "double_crossing",
    "fast",
    "fold_above",
)
#: Step of the judge: short of the next grazing, and rounding of the runs over it far below `RIGHT`.
_FINE = 1e-8
#: Most mesh periods: steps of scipy are interpreted.
_LONGEST = 48
_TIGHT = {"solver": "DOP853", "rtol": 1e-9, "atol": 1e-9}
#: way -> (method, options, step) of differences
_DIFFERENCES = {
    "differences": ("scipy", {}, 1e-6),
    "differences-1e-9": ("scipy", _TIGHT, 1e-6),
    "smoothed": ("smoothed", {"rtol": 1e-12}, 1e-6),
}
#: way -> module of `gearlib.integrators.peers` with ``derivatives(pair, tuning, state, periods)``,
#: of the final state by `GearPair.RATIOS` and the tuning, shape (6, 2)
_PEERS = {"diffrax": "diffrax_gradients", "heyoka": "heyoka_gradients"}


def parameters(pair):
    """Return by which parameters the motion of a pair is differentiated."""
    third = "material_damping" if pair.material_damping else "stiffness_ratio"
    return ["contact_ratio", third, "tuning"]


def _value(problem, name):
    return problem.tuning if name == "tuning" else getattr(problem.model, name)


def _run(problem, **more):
    given = {"periods": problem.periods, "initial_state": problem.state, "samples_per_period": 1}
    return simulate(problem.model, problem.tuning, **given, **more)


def differences(problem, names, method, options, step):
    """Return central differences of the final state, shape (k, 2); `step` is relative."""
    found = []
    for name in names:
        ends, value = [], _value(problem, name)
        values = [value * (1.0 + step), value * (1.0 - step)]
        for moved in values:
            pair, tuning = problem.model, problem.tuning
            if name == "tuning":
                tuning = moved
            else:
                pair = pair.replace(**{name: moved})
            run = _run(problem._replace(model=pair, tuning=tuning), method=method, options=options)
            ends.append(run.final_state.values)
        found.append(value * (ends[0] - ends[1]) / (values[0] - values[1]))
    return np.array(found)


def _exact(problem, names):
    run = _run(problem, sensitivities=names)
    return np.array(
        [_value(problem, name) * run[f"d_final_state_d_{name}"].values for name in names]
    )


def _peer(way, problem, names):
    module = importlib.import_module(f"gearlib.integrators.peers.{_PEERS[way]}")
    pair, tuning = problem.model, problem.tuning
    by_ratios = module.derivatives(pair, tuning, problem.state, problem.periods)
    slopes = [
        [0.0] * 5 + [1.0] if name == "tuning" else [*pair.ratio_slopes(name), 0.0] for name in names
    ]
    values = np.array([[_value(problem, name)] for name in names])
    return values * (np.array(slopes) @ by_ratios)


def derivatives(way, problem, names):
    """Return the derivatives of the final state by parameters in one of the ways, shape (k, 2)."""
    if way == "exact":
        return _exact(problem, names)
    if way in _PEERS:
        return _peer(way, problem, names)
    return differences(problem, names, *_DIFFERENCES[way])


def decide(found, expected, tuning):
    """Return (verdict, error) of derivatives, shape (k, 2), by the rules of the module."""
    if not np.isfinite(found).all():
        return "said_so", math.nan
    weights = np.array([1.0, tuning])
    off = np.abs(weights * (found - expected)).max(axis=1)
    error = float((off / np.abs(weights * expected).max(axis=1)).max())
    for verdict, most in (("right", RIGHT), ("inaccurate", ROUGH)):
        if error <= most:
            return verdict, error
    return "silently_wrong", error


def compute(ways, chosen=PROBLEMS):
    """Return the verdicts on ways to differentiate.

    ways: of the table above; chosen: names of difficult problems of a `GearPair`.

    Over (problem, way): verdict (flags), error.
    """
    known = {
        name: problem._replace(periods=min(problem.periods, _LONGEST))
        for name, problem in problems().items()
    }
    expected = {
        name: differences(known[name], parameters(known[name].model), "taylor", {}, _FINE)
        for name in chosen
    }

    def judged(name, way):
        problem = known[name]
        found = derivatives(way, problem, parameters(problem.model))
        verdict, error = decide(found, expected[name], problem.tuning)
        return {"verdict": np.int8(VERDICTS.index(verdict)), "error": error}

    axes = {"problem": list(chosen), "way": list(ways)}
    title = "Verdicts on ways to differentiate by difficult problems"
    dataset = result_of_many(title, stacked(axes, judged), axes)
    dataset["verdict"].attrs |= flags_of(VERDICTS)
    return dataset

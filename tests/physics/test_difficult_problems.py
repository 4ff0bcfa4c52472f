"""Difficult problems: their references against 50 digits, and the library's own solvers on them."""

import numpy as np
import pytest

from gearlib import integrators, simulate
from gearlib.models.pair import GearPair
from gearlib.studies.trials import difficult_problems, failures
from tests.references import of_pair

PROBLEMS = difficult_problems.problems()
#: Those of the linear one-degree mesh that 50 digits finish in seconds.
LINEAR = [
    name
    for name, problem in PROBLEMS.items()
    if isinstance(problem.model, GearPair) and problem.periods <= 60
]


@pytest.mark.parametrize("method", ["exact", "taylor"])
@pytest.mark.parametrize("name", LINEAR)
def test_references_have_the_digits_and_the_events(name, method):
    problem = PROBLEMS[name]
    x, v, events = of_pair(problem.model, problem.tuning, problem.periods, problem.state)
    run = simulate(
        problem.model,
        problem.tuning,
        periods=problem.periods,
        record_periods=problem.periods,
        initial_state=problem.state,
        method=method,
    )
    height = max(1.0, float(run.displacement_max - run.displacement_min))
    off = np.abs(run.final_state.values - [float(x), float(v)]) * [1.0, problem.tuning] / height
    # Rounding of up to 60 mesh periods.
    assert off.max() < 2e-12
    contacts = zip(run.event_from.values.tolist(), run.event_to.values.tolist(), strict=True)
    assert list(contacts) == [(before, after) for _, before, after, _ in events]
    for found, (phase, _, _, velocity) in zip(run.event_phase.values, events, strict=True):
        # A phase is known as well as the rounding of the displacement, 1e-14 of the height
        # after up to 60 mesh periods, and the speed allow.
        assert abs(found - phase) < 1e-11 + 1e-14 * height / abs(velocity)


@pytest.mark.parametrize("method", ["exact", "taylor"])
def test_own_solvers_are_right_wherever_they_take_the_model(method):
    column = failures.compute(method, method, {})
    for i, (name, problem) in enumerate(PROBLEMS.items()):
        cell = column.isel(problem=i, trial=0)
        verdict = failures.VERDICTS[int(cell.verdict)]
        if integrators.METHODS[method].supports(problem.model):
            assert verdict == "right", name
            # Far below the tolerance, which is made for others; chaos has no common state.
            assert float(cell.error) < (problem.tolerance if name == "chaos" else 1e-6), name
        else:
            assert verdict == "refused", name
            assert cell.message.item().startswith(f"method = '{method}' is not allowed for this")
            assert "it takes" in cell.message.item()


def verdict(problem, options):
    return failures.VERDICTS[failures.try_method(problem, "scipy", options)["verdict"]]


def test_no_tolerance_helps_a_sign_test_at_step_ends():
    problem = PROBLEMS["double_crossing"]
    for rtol in (1e-3, 1e-6, 1e-9, 1e-12):
        options = {"solver": "DOP853", "rtol": rtol, "atol": rtol}
        assert verdict(problem, options) == "missed_event"
    # Nor a terminal event, whose sign is looked at where steps end; a looser tolerance may help.
    split = {"solver": "DOP853", "events": True}
    assert verdict(problem, {**split, "rtol": 1e-12, "atol": 1e-12}) == "missed_event"


TRAINS = [name for name in PROBLEMS if name.startswith("planets")]

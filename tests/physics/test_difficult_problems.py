"""Difficult problems: the library's own solvers on them, against 50 digits, and others."""

import numpy as np
import pytest

from gearlib import integrators, simulate
from gearlib.models.pair import GearPair
from gearlib.studies.trials import difficult_problems, failures
from tests.references import propagate_pair

PROBLEMS = difficult_problems.problems()
#: Problems of the linear one-degree mesh that take little time in 50 digits.
LINEAR = [
    name
    for name, problem in PROBLEMS.items()
    if isinstance(problem.model, GearPair) and problem.periods <= 20 and problem.tuning > 0.1
]


@pytest.mark.parametrize("name", LINEAR)
def test_state_and_events_of_both_exact_methods_match_50_digits(name):
    model, tuning = PROBLEMS[name].model, PROBLEMS[name].tuning
    periods, state = PROBLEMS[name].periods, PROBLEMS[name].state
    (x, v), *events = propagate_pair(model, tuning, periods, state)
    settings = {"periods": periods, "record_periods": periods, "initial_state": state}
    for method in ("exact", "taylor"):
        run = simulate(model, tuning, method=method, **settings)
        span = max(1.0, float(run.displacement_max - run.displacement_min))
        error = np.abs(run.final_state.values - [float(x), float(v)]) * [1.0, tuning] / span
        # Rounding of up to 20 mesh periods.
        assert error.max() < 2e-12
        contacts = zip(run.event_from.values.tolist(), run.event_to.values.tolist(), strict=True)
        assert list(contacts) == [(before, after) for _, before, after, _ in events]
        for phase, (expected, _, _, velocity) in zip(run.event_phase.values, events, strict=True):
            # A phase is known as well as the rounding of the displacement, 1e-14 of its range
            # after these mesh periods, and the speed allow.
            assert abs(phase - expected) < 1e-11 + 1e-14 * span / abs(velocity)


def test_taylor_steps_are_right_where_the_exact_method_refuses_the_model():
    # On all other problems golden data compare the two methods.
    exact = integrators.METHODS["exact"]
    problems = [problem for problem in PROBLEMS.values() if not exact.supports(problem.model)]
    assert len(problems) == 3
    for problem in problems:
        row = failures.try_method(problem, "taylor", {})
        assert failures.VERDICTS[row["verdict"]] == "right" and row["error"] < 1e-6
        row = failures.try_method(problem, "exact", {})
        assert failures.VERDICTS[row["verdict"]] == "refused"
        assert row["message"].startswith("method = 'exact' is not allowed for this")


@pytest.mark.parametrize(("rtol", "events"), [(1e-3, False), (1e-12, False), (1e-12, True)])
def test_scipy_misses_a_double_crossing_within_a_step_at_any_tolerance(rtol, events):
    # A terminal event does not help either: its sign is evaluated at the ends of steps.
    options = {"solver": "DOP853", "rtol": rtol, "atol": rtol, "events": events}
    row = failures.try_method(PROBLEMS["double_crossing"], "scipy", options)
    assert failures.VERDICTS[row["verdict"]] == "missed_event"

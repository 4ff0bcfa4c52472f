"""Difficult problems: the solvers of gearlib against 50 digits, and failures of scipy."""

import numpy as np
import pytest

from gearlib import integrators, simulate
from gearlib.models.pair import GearPair
from gearlib.studies.trials import difficult_problems, failures
from tests.references import propagate_pair

PROBLEMS = difficult_problems.build_problems()
#: Problems of linear gear pairs that are quickly solved in 50 digits.
LINEAR = [
    name
    for name, problem in PROBLEMS.items()
    if isinstance(problem.model, GearPair) and problem.periods <= 20 and problem.tuning > 0.1
]


@pytest.mark.parametrize("name", LINEAR)
def test_state_and_events_of_both_exact_methods_match_50_digits(name):
    """Compare final states, the order of contacts and the phases of events with 50 digits."""
    model, tuning = PROBLEMS[name].model, PROBLEMS[name].tuning
    periods, state = PROBLEMS[name].periods, PROBLEMS[name].state
    (x, v), *events = propagate_pair(model, tuning, periods, state)
    settings = {"periods": periods, "record_periods": periods, "initial_state": state}
    for method in ("exact", "taylor"):
        run = simulate(model, tuning, method=method, **settings)
        displacement_range = max(1.0, float(run.displacement_max - run.displacement_min))
        error = (
            np.abs(run.final_state.values - [float(x), float(v)])
            * [1.0, tuning]
            / displacement_range
        )
        # The bound allows for the rounding of up to 20 mesh periods.
        assert error.max() < 2e-12
        contacts = zip(run.event_from.values.tolist(), run.event_to.values.tolist(), strict=True)
        assert list(contacts) == [(before, after) for _, before, after, _ in events]
        for phase, (reference_phase, _, _, velocity) in zip(
            run.event_phase.values, events, strict=True
        ):
            # Rounding of the displacement, 1e-14 of its range after these mesh periods, divided by
            # the velocity shifts the phase of a crossing.
            assert abs(phase - reference_phase) < 1e-11 + 1e-14 * displacement_range / abs(velocity)


def test_taylor_steps_are_right_where_the_exact_method_refuses_the_model():
    """Taylor steps must solve the difficult problems with models the exact method does not take."""
    # Golden data compare the two methods on all other problems.
    exact = integrators.METHODS["exact"]
    problems = [problem for problem in PROBLEMS.values() if not exact.supports(problem.model)]
    assert len(problems) == 3
    for problem in problems:
        outcome = failures.judge_run(problem, "taylor", {})
        assert failures.VERDICTS[outcome["verdict"]] == "right" and outcome["error"] < 1e-6
        outcome = failures.judge_run(problem, "exact", {})
        assert failures.VERDICTS[outcome["verdict"]] == "refused"
        assert outcome["message"].startswith("method = 'exact' is not allowed for this")


@pytest.mark.parametrize(("rtol", "events"), [(1e-3, False), (1e-12, False), (1e-12, True)])
def test_scipy_misses_a_double_crossing_within_a_step_at_any_tolerance(rtol, events):
    """A flank line that is crossed twice within one step of scipy must give a missed event."""
    # A terminal event does not help either: its sign is evaluated at the ends of steps.
    options = {"solver": "DOP853", "rtol": rtol, "atol": rtol, "events": events}
    outcome = failures.judge_run(PROBLEMS["double_crossing"], "scipy", options)
    assert failures.VERDICTS[outcome["verdict"]] == "missed_event"

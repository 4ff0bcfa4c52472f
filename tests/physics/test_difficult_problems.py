"""Compare the solvers in difficult problems with 50 digits, and show failures of scipy."""

import numpy as np
import pytest

from gearlib import integrators, simulate
from gearlib.models.pair import GearPair
from gearlib.studies.trials import difficult_problems, failures
from tests.references import propagate_pair

PROBLEMS = difficult_problems.build_problems()
#: Names of problems with linear gear pairs that are solved quickly in 50 digits.
SHORT_LINEAR_PROBLEMS = [
    name
    for name, problem in PROBLEMS.items()
    if isinstance(problem.model, GearPair) and problem.periods <= 20 and problem.tuning > 0.1
]


@pytest.mark.parametrize("name", SHORT_LINEAR_PROBLEMS)
def test_state_and_events_of_both_exact_methods_match_50_digits(name):
    """Final states, and contacts and phases of all events, must agree with 50 digits."""
    model, tuning = PROBLEMS[name].model, PROBLEMS[name].tuning
    periods, state = PROBLEMS[name].periods, PROBLEMS[name].state
    (x, v), *events = propagate_pair(model, tuning, periods, state)
    run_options = {"periods": periods, "record_periods": periods, "initial_state": state}
    for method in ("exact", "taylor"):
        run = simulate(model, tuning, method=method, **run_options)
        displacement_range = max(1.0, float(run.displacement_max - run.displacement_min))
        # A velocity times the tuning has the scale of a displacement.
        difference = np.abs(run.final_state.values - [float(x), float(v)]) * [1.0, tuning]
        # The bound allows for the rounding errors of up to 20 mesh periods.
        assert difference.max() < 2e-12 * displacement_range
        contacts = zip(run.event_from.values.tolist(), run.event_to.values.tolist(), strict=True)
        assert list(contacts) == [(before, after) for _, before, after, _ in events]
        phases = run.event_phase.values
        for phase, (reference_phase, _, _, velocity) in zip(phases, events, strict=True):
            # A rounding error of the displacement, 1e-14 of its range, shifts the phase of a
            # crossing by this error divided by the velocity.
            shift_by_rounding = 1e-14 * displacement_range / abs(velocity)
            assert abs(phase - reference_phase) < 1e-11 + shift_by_rounding


def test_taylor_steps_are_right_where_the_exact_method_refuses_the_model():
    """Taylor steps must solve the three problems whose models the exact method does not support.

    Golden data compare both methods in all other problems.
    """
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
    """Scipy must miss two crossings of a flank line within one step, even with event location.

    Its events are located by a change of sign between the ends of a step.
    """
    options = {"solver": "DOP853", "rtol": rtol, "atol": rtol, "events": events}
    outcome = failures.judge_run(PROBLEMS["double_crossing"], "scipy", options)
    assert failures.VERDICTS[outcome["verdict"]] == "missed_event"

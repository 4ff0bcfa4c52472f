"""Difficult problems: their references against 50 digits, and the library's own solvers on them."""

import math

import numpy as np
import pytest

from gearlib import integrators, simulate
from gearlib.analysis.tongues import meissner
from gearlib.engines.pair.stiffness import levels
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


def test_most_problems_have_a_reference_of_50_digits():
    assert len(LINEAR) >= 20


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


@pytest.mark.parametrize("name", [n for n in PROBLEMS if n.startswith(("tongue", "edge"))])
def test_tongues_grow_by_their_multiplier_and_edges_do_not(name):
    problem = PROBLEMS[name]
    outcome = failures.run(problem, "exact", {}, problem.periods)
    assert outcome.low > 0.0, "contact must not be lost"
    growth = failures.energy_or_deviation(problem, outcome) / 1e-6
    half = abs(np.trace(meissner.period_map(problem.model, problem.tuning)[0])) / 2.0
    if name.startswith("edge"):
        assert half < 1.0 and growth < 100.0
    else:
        # Of the two multipliers, whose product is 1, the larger one; the start has a share in it.
        expected = (half + math.sqrt(half * half - 1.0)) ** problem.periods
        assert expected > 50.0 and 0.1 < growth / expected < 10.0


@pytest.mark.parametrize("depth", [1e-6, 1e-10])
def test_grazing_problems_graze(depth):
    short, past = (PROBLEMS[f"graze_{s}_{-round(math.log10(depth))}"] for s in ("short", "past"))
    counts = [len(of_pair(one.model, one.tuning, 1, one.state)[2]) for one in (short, past)]
    assert counts[1] == counts[0] + 2
    # The first arc alone, which turns at phase 0.9.
    for problem, x in ((short, depth), (past, -depth)):
        high = levels(problem.model.contact_ratio, problem.model.stiffness_ratio)[0]
        turned = meissner.state_after(problem.state, high, 0.0, problem.tuning, 0.9)
        np.testing.assert_allclose(turned, (x, 0.0), rtol=0, atol=1e-15)


def test_long_runs_keep_their_energy():
    problem = PROBLEMS["conservative"]
    start = failures.Outcome(0, problem.state)
    for method in ("exact", "taylor"):
        outcome = failures.run(problem, method, {}, problem.periods)
        gained = (
            failures.energy_or_deviation(problem, outcome)
            / failures.energy_or_deviation(problem, start)
            - 1.0
        )
        assert abs(gained) < 1e-10


@pytest.mark.parametrize("side", ["below", "above"])
def test_the_fold_lies_between_its_two_problems(side):
    problem = PROBLEMS[f"fold_{side}"]
    outcome = failures.run(problem, "exact", {}, problem.periods)
    assert outcome.period == 1
    assert outcome.height == pytest.approx({"below": 2.422, "above": 5.068}[side], abs=1e-3)


def test_chaos_is_chaos():
    problem = PROBLEMS["chaos"]
    outcome = failures.run(problem, "exact", {}, problem.periods)
    assert outcome.period == 0
    near = problem._replace(state=(1e-10, 0.0))
    ends = [np.array(failures.run(p, "exact", {}, 200).state) for p in (problem, near)]
    assert abs(ends[0] - ends[1]).max() > 0.1


@pytest.mark.parametrize("method", ["exact", "taylor"])
def test_own_solvers_are_right_wherever_they_take_the_model(method):
    column = failures.compute(method, method, {})
    for i, (name, problem) in enumerate(PROBLEMS.items()):
        cell = column.isel(problem=i, trial=0)
        verdict = failures.VERDICTS[int(cell.verdict)]
        if integrators.METHODS[method].takes(problem.model):
            assert verdict == "right", name
            # Far below the tolerance, which is made for others; chaos has no common state.
            assert float(cell.error) < (problem.tolerance if name == "chaos" else 1e-6), name
        else:
            assert verdict == "refused", name
            assert cell.message.item().startswith(f"method = '{method}' is not allowed for this")
            assert "it takes" in cell.message.item()


@pytest.mark.parametrize("name", ["cubic_damping", "terms_2", "stiff_bearings"])
def test_references_without_50_digits_agree_with_split_runs(name):
    problem = PROBLEMS[name]
    judge, options = failures.SPLIT_REFERENCE
    reference = failures.run(problem, *failures.reference_method(problem, "rk4"), problem.periods)
    split = failures.run(problem, judge, options, problem.periods)
    assert failures.error(problem, split, reference) < 1e-10
    assert split.contacts == reference.contacts


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


def test_planets_part_at_once_or_next_to_that():
    phases = {}
    for name in TRAINS:
        problem = PROBLEMS[name]
        run = simulate(
            problem.model,
            problem.tuning,
            periods=problem.periods,
            record_periods=problem.periods,
            initial_state=problem.state,
        )
        at = run.event_phase.values.reshape(-1, 3)
        phases[name] = at.max(axis=1) - at.min(axis=1)
        assert len(at) >= 6
    for name in ("planets_at_once", "planets_alike"):
        # The rounding of a distance over its speed.
        assert phases[name].max() < 1e-12, name
    assert 2e-13 < np.median(phases["planets_apart"]) < 5e-12

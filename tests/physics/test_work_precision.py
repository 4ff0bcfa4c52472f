"""Work and precision: the references against 50 digits and scipy, and what errors must do."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from gearlib import OneDegreePair
from gearlib.trials import problems
from gearlib.trials import work_precision as wp
from tests.physics.high_precision import propagate

PAPER = yaml.safe_load((Path(__file__).parents[2] / "config.yaml").read_text(encoding="utf-8"))
PAIR, SETTINGS = PAPER["gear_pair"], PAPER["work_precision"]
ONE_DEGREE = ("smooth", "bouncing", "near_fold", "conservative")
#: Rounding of a hundred arcs; without damping it grows with every bounce, tenfold at most.
STATE, PHASE = 1e-13, 1e-12


def build(name):
    return problems.build(name, PAIR, PAPER["six_degrees"], SETTINGS)


def fifty_digits(problem):
    """Return the `Run` of a linear problem of one degree, from 50 digits."""
    pair = problem.model
    x, v, events = propagate(
        pair.contact_ratio,
        pair.stiffness_ratio,
        pair.damping_ratio,
        pair.backlash_damping_ratio,
        pair.backlash_ratio,
        problem.tuning,
        problem.periods,
    )
    first = 2.0 * math.pi * (problem.periods - problem.record_periods)
    last = [event for event in events if event[0] >= first]
    return problems.Run(
        np.array([float(x), float(v)]),
        np.array([float(event[0]) for event in last]),
        np.array([event[1:3] for event in last], np.int8).reshape(-1, 2),
        math.nan,
        0,
        0,
    )


@pytest.mark.parametrize("name", ONE_DEGREE)
def test_references_of_one_degree_against_50_digits(name):
    problem = build(name)
    expected = fifty_digits(problem)
    # The exact propagator, and what the exact propagator itself is measured by.
    for method in (None, "exact"):
        found = problems.reference(problem, method)
        assert wp.state_error(found, expected) < STATE
        assert found.kinds.tolist() == expected.kinds.tolist()
        if expected.phases.size:
            assert wp.event_error(found, expected) < PHASE


@pytest.mark.parametrize("name", ["cubic", "six_degrees"])
def test_references_without_50_digits_against_scipy(name):
    problem = build(name)
    found = problems.reference(problem)
    method = "taylor" if name == "cubic" else "exact"
    expected = problems.reference(problem, method)
    # scipy's own error at a tolerance of 1e-13, over 20 periods of bouncing.
    assert 0.0 < wp.state_error(found, expected) < 2e-10
    assert wp.event_error(found, expected) < 5e-10


def test_the_linear_problem_as_a_nonlinear_one_against_50_digits():
    # Taylor steps, the reference where damping is nonlinear, on a problem that has 50 digits.
    problem = build("bouncing")
    taylor = problem._replace(model=OneDegreePair(pair=problem.model))
    found = problems.attempt(taylor, "taylor", {})
    assert wp.state_error(found, fifty_digits(problem)) < STATE


@pytest.mark.parametrize("method", ["exact", "taylor"])
def test_errors_at_rounding(method):
    data = wp.errors(method, ONE_DEGREE, PAIR, {}, SETTINGS)
    finest = data.isel(rung=-1)
    assert (finest.state_error < STATE).all()
    assert (finest.event_error.dropna("problem") < PHASE).all()
    # Central differences: rounding over their width.
    assert (finest.multiplier_error.dropna("problem") < 1e-8).all()
    assert finest.multiplier_error.notnull().sum() == 3


def errors_of_rk4(steps):
    problem = build("smooth")
    expected = problems.reference(problem)
    runs = [problems.attempt(problem, "rk4", {"steps_per_period": n}) for n in steps]
    evaluations = np.array([one.evaluations for one in runs], float)
    return evaluations, np.array([wp.state_error(one, expected) for one in runs])


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


def test_rk4_is_of_first_order_where_steps_go_over_switches():
    # Of one step over a switch the force is wrong for a share of the step.
    steps = wp.LADDERS["rk4"][0].values
    evaluations, error = errors_of_rk4(steps)
    assert (evaluations == 4.0 * 20 * np.array(steps)).all()
    assert slope(evaluations, error) == pytest.approx(-1.0, abs=0.25)


def test_rk4_is_of_fourth_order_between_switches():
    # Stretches of C_max of 0.25 periods: every switch is the end of a step.
    problem = build("smooth")
    problem = problem._replace(model=problem.model.replace(contact_ratio=1.5))
    expected = problems.reference(problem)
    steps = np.array([16, 32, 64, 128, 256])
    error = [
        wp.state_error(problems.attempt(problem, "rk4", {"steps_per_period": int(n)}), expected)
        for n in steps
    ]
    assert slope(steps, error) == pytest.approx(-4.0, abs=0.25)


def test_control_of_steps_follows_its_tolerance():
    data = wp.errors("rk45", ["smooth", "bouncing", "cubic"], PAIR, {}, SETTINGS)
    rtol = np.array(wp.LADDERS["rk45"][0].values)
    for name in data.problem.values:
        one = data.sel(problem=name)
        assert slope(rtol, one.state_error.values) == pytest.approx(1.0, abs=0.2)
        assert (np.diff(one.period_evaluations.values) > 0.0).all()


def test_smoothed_contact_approaches_the_sharp_law():
    data = wp.errors("smoothed", ["bouncing"], PAIR, {}, SETTINGS)
    sharpness = np.array(wp.LADDERS["smoothed"][0].values)
    # An impulse of the order of 1 / sharpness^2 at every crossing.
    assert slope(sharpness, data.state_error.values[0]) == pytest.approx(-2.0, abs=0.2)


def test_errors_and_evaluations_are_the_same_in_every_run():
    for method in ("exact", "newmark", "rk45"):
        one, two = (wp.errors(method, ["near_fold"], PAIR, {}, SETTINGS) for _ in range(2))
        assert one.identical(two)


@pytest.mark.parametrize("name", ["smooth", "bouncing", "near_fold", "cubic"])
def test_the_steady_orbit_repeats(name):
    problem = build(name)
    start, multiplier = problems.steady_orbit(problem)
    method, options = problems.judge(problem.model)
    end = problems.Bound(problem.model, problem.tuning, method, options).run(tuple(start), 1)
    np.testing.assert_allclose(end.state, start, atol=1e-13)
    assert 0.0 < multiplier < 1.0
    # Linear damping all along: Liouville's formula gives the product of the pair.
    if name in ("smooth", "bouncing"):
        rate = 2.0 * problem.model.damping_ratio / problem.tuning
        assert multiplier == pytest.approx(math.exp(-rate * math.pi), rel=1e-9)

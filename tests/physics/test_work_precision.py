"""Work and precision: what errors must do, down to their floors."""

import math

import numpy as np
import pytest

from gearlib import integrators
from gearlib.config import load
from gearlib.studies import jump
from gearlib.studies.trials import high_precision, problems, references
from gearlib.studies.trials import work_precision as wp
from tests.paper import CONFIG

PAIR, SIX = CONFIG["gear_pair"], CONFIG["six_degrees"]
SETTINGS = load(CONFIG).model_dump()["work_precision"]
#: Rounding of a hundred arcs; without damping it grows with every bounce, tenfold at most. In six
#: degrees the bearings lie 33 static deflections off, where the last place is 7e-15: bearings up to
#: 0.7 % stiffer leave 1e-14 to 9e-13 in the state, and as much over the speed, 0.3, in phases.
STATE, PHASE, SIX_STATE, SIX_PHASE = 1e-13, 1e-12, 1e-12, 3e-12


def build(name):
    return problems.build(name, PAIR, SIX, SETTINGS)


@pytest.fixture(scope="module")
def known():
    return references.compute(list(problems.CASES), PAIR, SIX, SETTINGS)


@pytest.mark.parametrize("method", ["exact", "taylor"])
def test_errors_at_rounding(known, method):
    finest = wp.errors(method, known, PAIR, SIX, SETTINGS).isel(rung=-1)
    takes = integrators.METHODS[method].takes
    taken = [takes(build(name).model) for name in known.problem.values]
    assert finest.state_error.notnull().values.tolist() == taken
    finest = finest.isel(problem=finest.problem.values != "reducer")
    six = finest.problem == "six_degrees"
    assert (finest.state_error.where(~six).dropna("problem") < STATE).all()
    assert (finest.state_error.where(six).dropna("problem") < SIX_STATE).all()
    assert (finest.event_error.where(~six).dropna("problem") < PHASE).all()
    assert (finest.event_error.where(six).dropna("problem") < SIX_PHASE).all()
    # Central differences: rounding over their width.
    assert (finest.multiplier_error.dropna("problem") < 1e-8).all()
    assert finest.multiplier_error.notnull().sum() == 4 - (method == "exact")


def errors_of_rk4(steps):
    problem = build("smooth")
    expected = references.reference(problem)
    runs = [problems.run(problem, "rk4", {"steps_per_period": n}) for n in steps]
    evaluations = np.array([one.evaluations for one in runs], float)
    return evaluations, np.array([wp.state_error(one, expected) for one in runs])


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


def test_rk4_is_of_first_order_where_steps_go_over_switches():
    # Of one step over a switch the force is wrong for a share of the step.
    steps = wp.LINES[2].values
    evaluations, error = errors_of_rk4(steps)
    assert (evaluations == 4.0 * 20 * np.array(steps)).all()
    assert slope(evaluations, error) == pytest.approx(-1.0, abs=0.25)


def test_control_of_steps_follows_its_tolerance(known):
    chosen = known.sel(problem=["smooth", "bouncing", "cubic"])
    data = wp.errors("rk45", chosen, PAIR, SIX, SETTINGS)
    rtol = np.array([options["rtol"] for _, _, options in wp.rungs("rk45")])
    for name in data.problem.values:
        one = data.sel(problem=name)
        assert slope(rtol, one.state_error.values) == pytest.approx(1.0, abs=0.2)
        assert (np.diff(one.period_evaluations.values) > 0.0).all()


@pytest.mark.parametrize("name", ["smooth", "bouncing", "near_fold", "cubic"])
def test_the_settled_orbit(known, name):
    problem = build(name)
    start = known.orbit_state.sel(problem=name).values
    multiplier = float(known.largest_multiplier.sel(problem=name))
    end, maps, _ = problem.model.propagator(problem.tuning).maps(start, 1, 100)
    # It repeats, and its multiplier is that of the variational equations: rounding of a period.
    np.testing.assert_allclose(end, start, rtol=0, atol=1e-14)
    assert multiplier == pytest.approx(problems.largest_multiplier(maps[0]), rel=1e-12)
    assert 0.0 < multiplier < 1.0
    # Linear damping all along: Liouville's formula gives the product of the pair.
    if name in ("smooth", "bouncing"):
        rate = 2.0 * problem.model.damping_ratio / problem.tuning
        assert multiplier == pytest.approx(math.exp(-rate * math.pi), rel=1e-14)


def test_a_problem_that_settles_on_no_orbit_of_one_period_has_none():
    # Without damping, and so on nothing at all.
    problem = build("conservative")
    orbit, multiplier = references.settled_orbit(problem)
    assert np.isnan(orbit).all() and math.isnan(multiplier)


def test_the_exact_jump_lies_where_30_digits_have_it():
    problem = build("near_fold")
    pair = problem.model
    run = {"periods": 120, "record_periods": 24, "initial_state": (0.0, 0.0)}
    nu = jump.find(pair, [0.815, 0.816], 1e-8, **run).tuning
    beside = nu - 2e-8, nu + 2e-8
    digits = [float(high_precision.run(pair, tuning, 120, 30)[0][0]) for tuning in beside]
    found = [
        problems.run(problem._replace(tuning=tuning), "exact", periods=120).state[0]
        for tuning in beside
    ]
    assert abs(found[1] - found[0]) > 0.1
    np.testing.assert_allclose(digits, found, rtol=0, atol=1e-6)

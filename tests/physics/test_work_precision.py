"""Work and precision: what errors must do, down to their floors."""

import numpy as np
import pytest

from gearlib import integrators
from gearlib.config import load
from gearlib.studies.trials import problems, references, work_precision
from tests.paper import CONFIG, PAPER

PAIR, SIX = PAPER, CONFIG["six_degrees"]
SETTINGS = load(CONFIG).model_dump()["work_precision"]
SETTINGS |= {"periods": 4, "record_periods": 3}
#: Rounding of a hundred arcs; without damping it grows with every bounce, tenfold at most. In six
#: degrees the bearings lie 33 static deflections off, where the last place is 7e-15: bearings up to
#: 0.7 % stiffer leave 1e-14 to 9e-13 in the state, and as much over the speed, 0.3, in phases.
STATE, PHASE, SIX_STATE, SIX_PHASE = 1e-13, 1e-12, 1e-12, 3e-12


@pytest.fixture(scope="module")
def reference_data():
    """The reference solutions of all test problems."""
    return references.compute(list(problems.CASES), PAIR, SIX, SETTINGS)


@pytest.mark.parametrize("method", ["exact", "taylor"])
def test_errors_of_exact_methods_are_rounding_errors(reference_data, method):
    finest = work_precision.errors(method, reference_data, PAIR, SIX, SETTINGS).isel(rung=-1)
    built = [problems.build(name, PAIR, SIX, SETTINGS) for name in problems.CASES]
    supported = [integrators.METHODS[method].supports(problem.model) for problem in built]
    assert finest.state_error.notnull().values.tolist() == supported
    finest = finest.isel(problem=finest.problem.values != "reducer")
    six = finest.problem == "six_degrees"
    for name, bound, bound_of_six in (
        ("state_error", STATE, SIX_STATE),
        ("event_error", PHASE, SIX_PHASE),
    ):
        assert (finest[name].where(~six).dropna("problem") < bound).all()
        assert (finest[name].where(six).dropna("problem") < bound_of_six).all()
    # Multipliers, of the four problems that settle, come from central differences: rounding over
    # their width. The exact method cannot run one of the four, with cubic damping.
    assert (finest.multiplier_error.dropna("problem") < 1e-8).all()
    assert finest.multiplier_error.notnull().sum() == 4 - (method == "exact")


def test_the_error_of_rk45_is_proportional_to_its_tolerance(reference_data):
    bouncing_and_cubic = reference_data.sel(problem=["bouncing", "cubic"])
    data = work_precision.errors("rk45", bouncing_and_cubic, PAIR, SIX, SETTINGS)
    rtol = np.array([options["rtol"] for _, _, options in work_precision.method_settings("rk45")])
    for name in data.problem.values:
        by_tolerance = data.sel(problem=name)
        slope = np.polyfit(np.log(rtol), np.log(by_tolerance.state_error.values), 1)[0]
        assert slope == pytest.approx(1.0, abs=0.2)
        assert (np.diff(by_tolerance.period_evaluations.values) > 0.0).all()

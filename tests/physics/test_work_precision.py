"""Work and precision: how errors fall with the tolerance, down to rounding."""

import numpy as np
import pytest

from gearlib import integrators
from gearlib.config import load
from gearlib.studies.trials import problems, references, work_precision
from tests.paper import CONFIG, PAPER_PAIR

PAIR, SIX = PAPER_PAIR, CONFIG["six_degrees"]
SETTINGS = load(CONFIG).model_dump()["work_precision"]
SETTINGS |= {"periods": 4, "record_periods": 3}
#: Bounds of errors of states and of phases of events. They allow for the rounding of a hundred
#: arcs,
#: which without damping grows at most tenfold with every bounce.
STATE, PHASE = 1e-13, 1e-12
#: Bounds for six degrees of freedom. Their bearings are displaced by 33 static deflections, where
#: the last digit is 7e-15. Bearings up to 0.7 % stiffer change the state by 1e-14 to 9e-13, and the
#: phases by this divided by the speed, 0.3.
SIX_STATE, SIX_PHASE = 1e-12, 3e-12


@pytest.fixture(scope="module")
def reference_data():
    """Return the reference solutions of all test problems."""
    return references.compute_references(list(problems.CASES), PAIR, SIX, SETTINGS)


@pytest.mark.parametrize("method", ["exact", "taylor"])
def test_errors_of_exact_methods_are_rounding_errors(reference_data, method):
    """At their finest settings exact methods must err by rounding only, problem by problem."""
    finest_errors = work_precision.compute_errors(method, reference_data, PAIR, SIX, SETTINGS).isel(rung=-1)
    built_problems = [problems.build_problem(name, PAIR, SIX, SETTINGS) for name in problems.CASES]
    supported = [integrators.METHODS[method].supports(problem.model) for problem in built_problems]
    assert finest_errors.state_error.notnull().values.tolist() == supported
    finest_errors = finest_errors.isel(problem=finest_errors.problem.values != "reducer")
    is_six_degrees = finest_errors.problem == "six_degrees"
    for name, bound, bound_of_six in (
        ("state_error", STATE, SIX_STATE),
        ("event_error", PHASE, SIX_PHASE),
    ):
        assert (finest_errors[name].where(~is_six_degrees).dropna("problem") < bound).all()
        assert (finest_errors[name].where(is_six_degrees).dropna("problem") < bound_of_six).all()
    # Multipliers exist for the four problems that settle. Central differences amplify rounding. The
    # exact method refuses one of the four, which has cubic damping.
    assert (finest_errors.multiplier_error.dropna("problem") < 1e-8).all()
    assert finest_errors.multiplier_error.notnull().sum() == 4 - (method == "exact")


def test_the_error_of_rk45_is_proportional_to_its_tolerance(reference_data):
    """On a logarithmic scale the error over the tolerance must have the slope 1."""
    bouncing_and_cubic = reference_data.sel(problem=["bouncing", "cubic"])
    data = work_precision.compute_errors("rk45", bouncing_and_cubic, PAIR, SIX, SETTINGS)
    rtol = np.array([options["rtol"] for _, _, options in work_precision.method_settings("rk45")])
    for name in data.problem.values:
        by_tolerance = data.sel(problem=name)
        slope = np.polyfit(np.log(rtol), np.log(by_tolerance.state_error.values), 1)[0]
        assert slope == pytest.approx(1.0, abs=0.2)
        assert (np.diff(by_tolerance.period_evaluations.values) > 0.0).all()

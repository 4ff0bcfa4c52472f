"""Check work-precision data: errors decrease with the tolerance, down to rounding errors."""

import numpy as np
import pytest

from gearlib import integrators
from gearlib.config import load
from gearlib.studies.trials import problems, references, work_precision
from tests.paper import CONFIG, PAPER_PAIR

PAIR, SIX_DEGREE_FIELDS = PAPER_PAIR, CONFIG["six_degrees"]
SETTINGS = load(CONFIG).model_dump()["work_precision"]
SETTINGS |= {"periods": 4, "record_periods": 3}
#: Bounds for errors of states and of event phases. They allow for the rounding errors of a hundred
#: motions between events, which each bounce amplifies at most tenfold.
STATE_BOUND, PHASE_BOUND = 1e-13, 1e-12
#: Bounds for six degrees of freedom. Bearings are displaced by 33 static deflections, which have a
#: rounding error of 7e-15. For bearings up to 0.7 % stiffer, errors of the state vary from 1e-14 to
#: 9e-13, and errors of phases are these divided by the velocity, 0.3.
SIX_DEGREE_STATE_BOUND, SIX_DEGREE_PHASE_BOUND = 1e-12, 3e-12


@pytest.fixture(scope="module")
def reference_data():
    """Return the reference solutions of all test problems."""
    return references.compute_references(list(problems.CASES), PAIR, SIX_DEGREE_FIELDS, SETTINGS)


@pytest.mark.parametrize("method", ["exact", "taylor"])
def test_errors_of_exact_methods_are_rounding_errors(reference_data, method):
    """At the finest settings, errors of exact methods must be rounding errors in all problems."""
    finest_errors = work_precision.compute_errors(
        method, reference_data, PAIR, SIX_DEGREE_FIELDS, SETTINGS
    ).isel(rung=-1)
    built_problems = [
        problems.build_problem(name, PAIR, SIX_DEGREE_FIELDS, SETTINGS) for name in problems.CASES
    ]
    supported = [integrators.METHODS[method].supports(problem.model) for problem in built_problems]
    assert finest_errors.state_error.notnull().values.tolist() == supported
    finest_errors = finest_errors.isel(problem=finest_errors.problem.values != "reducer")
    is_six_degrees = finest_errors.problem == "six_degrees"
    for name, bound, six_degree_bound in (
        ("state_error", STATE_BOUND, SIX_DEGREE_STATE_BOUND),
        ("event_error", PHASE_BOUND, SIX_DEGREE_PHASE_BOUND),
    ):
        errors = finest_errors[name]
        assert (errors.where(~is_six_degrees).dropna("problem") < bound).all()
        assert (errors.where(is_six_degrees).dropna("problem") < six_degree_bound).all()
    # Multipliers exist for the four problems with a periodic motion. They are computed by central
    # differences, which amplify rounding errors. One of the four has cubic damping, which the exact
    # method does not support.
    assert (finest_errors.multiplier_error.dropna("problem") < 1e-8).all()
    assert finest_errors.multiplier_error.notnull().sum() == 4 - (method == "exact")


def test_the_error_of_rk45_is_proportional_to_its_tolerance(reference_data):
    """On logarithmic scales, the error over the tolerance must have the slope 1.

    The number of evaluations must increase from each setting to the next finer one.
    """
    bouncing_and_cubic = reference_data.sel(problem=["bouncing", "cubic"])
    data = work_precision.compute_errors(
        "rk45", bouncing_and_cubic, PAIR, SIX_DEGREE_FIELDS, SETTINGS
    )
    rtol = np.array([options["rtol"] for _, _, options in work_precision.method_settings("rk45")])
    for name in data.problem.values:
        by_tolerance = data.sel(problem=name)
        slope = np.polyfit(np.log(rtol), np.log(by_tolerance.state_error.values), 1)[0]
        assert slope == pytest.approx(1.0, abs=0.2)
        assert (np.diff(by_tolerance.period_evaluations.values) > 0.0).all()

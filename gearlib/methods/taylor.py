"""Taylor steps of order 20 that end at events: for every model of one degree of freedom."""

from functools import partial

from gearlib import checks
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.taylor.run import run_nonlinear
from gearlib.kernels.taylor.series import ORDER
from gearlib.methods.each import run_each
from gearlib.methods.option import Option
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.oscillator import OneDegree
from gearlib.models.pair import GearPair

EVENTS = "steps end at switches and crossings, which are isolated in Bernstein form"
MODELS = "one degree of freedom, any damping, stiffness and excitation"
OPTIONS = {
    "tolerance": Option(
        1e-16,
        checks.finite_positive,
        "truncation error of a step, static deflections; by default that of rounding",
    )
}
_TO_BERNSTEIN = bernstein_matrix(ORDER)


def takes(pair):
    """Return whether the model has one degree of freedom."""
    return isinstance(pair, (GearPair, OneDegree))


def run(pair, tuning, state, *arguments, tolerance):
    """Run one tuning; see `gearlib.methods`."""
    if isinstance(pair, GearPair):
        pair = OneDegreePair(pair=pair)
    *result, steps = run_nonlinear(pair.law(tuning, tolerance), _TO_BERNSTEIN, *state, *arguments)
    # Each coefficient of the series takes what an evaluation of the right-hand side takes.
    return *result, steps * ORDER


def run_many(pair, *arguments, tolerance):
    """Run many tunings; see `gearlib.methods`."""
    run_each(partial(run, pair, tolerance=tolerance), *arguments)

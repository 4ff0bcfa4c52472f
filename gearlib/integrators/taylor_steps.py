"""Taylor steps of order 20 that end at events: for every model of one degree of freedom."""

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.models.propagators.stable_repeats import proven
from gearlib.models.propagators.taylor import ORDER, TOLERANCE

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "run", "run_many", "takes"]

EVENTS = "steps end at switches and crossings, which are isolated in Bernstein form"
MODELS = "one degree of freedom, any damping, stiffness and excitation"
OPTIONS = {
    "tolerance": Option(
        TOLERANCE,
        checks.finite_positive,
        "truncation error of a step, static deflections; by default that of rounding",
    )
}


def takes(pair):
    """Return whether the model has one degree of freedom."""
    return "taylor" in pair.propagators


def run(pair, tuning, state, *arguments, tolerance):
    """Run one tuning; see `gearlib.integrators`."""
    propagator = pair.propagator(tuning, "taylor", tolerance=tolerance)
    return propagator.run(propagator.start(state), *arguments)


def run_many(pair, *arguments, tolerance):
    """Run many tunings; see `gearlib.integrators`."""

    def run_one(tuning, state, *arguments):
        propagator = pair.propagator(tuning, "taylor", tolerance=tolerance)
        z = propagator.start(state)
        done = propagator.run(z, *arguments)
        return *done[:2], proven(propagator, z, done[2], arguments[4]), *done[3:]

    run_each(run_one, *arguments)

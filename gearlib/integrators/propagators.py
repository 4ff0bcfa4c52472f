"""The methods that are chosen where none is named: closed forms, and Taylor steps to events.

See `gearlib.engines`. One degree of freedom goes by scalar closed forms, with harmonic
excitation, and six degrees of freedom, by matrix exponentials.
"""

from gearlib import checks
from gearlib.engines.stable_repeats import proven
from gearlib.integrators.method import Integrator, Option, run_each


class Exact(Integrator):
    """Closed forms between events: linear damping and rectangular stiffness."""

    EVENTS = "phases end at switches and crossings, which are isolated by proof"
    MODELS = "linear damping with rectangular stiffness, one or six degrees of freedom"

    def takes(self, model):
        """Return whether the phases of a model have closed forms."""
        return "exact" in model.propagators

    def run(self, model, tuning, state, *record):
        """Run one tuning; see `Integrator.run`."""
        propagator = model.propagator(tuning, "exact")
        return propagator.run(propagator.start(state), *record)

    def run_many(self, model, *arguments, **options):
        """Run many tunings, in one call where the propagator can; see `Integrator.run_many`."""
        kind, propagator, z, first = model.kind("exact"), None, None, 0
        if kind.run_many is not None:
            return kind.run_many(model, *arguments)
        state = arguments[2]

        def run_next(tuning, current, periods, *rest):
            nonlocal propagator, z, first
            propagator = propagator.at(tuning) if propagator else model.propagator(tuning, "exact")
            # All coordinates are carried along, not only the two of the final state, and the gears
            # stay where they have turned to.
            if current is state:
                z, first = propagator.start(state), 0
            start, first = first, (first + periods) % model.repeats
            done = propagator.run(z, periods, *rest, first=start)
            return *done[:2], proven(propagator, z, done[2], rest[3], first), *done[3:]

        run_each(run_next, *arguments)


class Taylor(Integrator):
    """Taylor steps of order 20 that end at events: every model of one degree of freedom."""

    # Order and tolerance of `gearlib.engines.taylor.propagator`, which is loaded where it runs.
    ORDER = 20
    EVENTS = "steps end at switches and crossings, which are isolated in Bernstein form"
    OPTIONS = {
        "tolerance": Option(
            1e-16,
            checks.finite_positive,
            "truncation error of a step, static deflections; by default that of rounding",
        )
    }

    def takes(self, model):
        """Return whether the model has one degree of freedom."""
        return "taylor" in model.propagators

    def run(self, model, tuning, state, *record, tolerance):
        """Run one tuning; see `Integrator.run`."""
        propagator = model.propagator(tuning, "taylor", tolerance=tolerance)
        return propagator.run(propagator.start(state), *record)

    def run_many(self, model, *arguments, **options):
        """Run many tunings, whose periods are proven; see `Integrator.run_many`."""

        def run_next(tuning, state, *record):
            propagator = model.propagator(tuning, "taylor", **options)
            z = propagator.start(state)
            done = propagator.run(z, *record)
            return *done[:2], proven(propagator, z, done[2], record[4]), *done[3:]

        run_each(run_next, *arguments)


METHODS = {"exact": Exact(), "taylor": Taylor()}

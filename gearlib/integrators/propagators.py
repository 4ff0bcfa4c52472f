"""The methods that are chosen where none is named: the engines of `gearlib.engines`."""

from gearlib import checks
from gearlib.integrators.method import Integrator, Option


class Exact(Integrator):
    """Closed forms between events: linear damping and rectangular stiffness."""

    NAME = "exact"
    EVENTS = "phases end at switches and crossings, which are isolated by proof"
    MODELS = "linear damping with rectangular stiffness, one or six degrees of freedom"

    def takes(self, model):
        """Return whether a model has an engine for the method."""
        return self.NAME in model.propagators

    def run(self, model, tuning, state, span, samples=0, keep_events=True, **options):
        """Run one tuning; see `Integrator.run`."""
        engine = model.propagator(tuning, self.NAME, **options)
        return engine.run(engine.start(state), span, samples, keep_events=keep_events)

    def sweep(self, model, tunings, *arguments, **options):
        """Run many tunings; see `gearlib.engines.protocol.Base.sweep`."""
        model.propagator(tunings[0], self.NAME, **options).sweep(tunings, *arguments)


class Taylor(Exact):
    """Taylor steps of order 20 that end at events: every model of one degree of freedom."""

    NAME = "taylor"
    # Order and tolerance of `gearlib.engines.taylor.propagator`, which is loaded where it runs.
    ORDER = 20
    EVENTS = "steps end at switches and crossings, which are isolated in Bernstein form"
    MODELS = Integrator.MODELS
    OPTIONS = {
        "tolerance": Option(
            1e-16,
            checks.finite_positive,
            "truncation error of a step, static deflections; by default that of rounding",
        )
    }


METHODS = {"exact": Exact(), "taylor": Taylor()}

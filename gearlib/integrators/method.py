"""Base class of the methods of integration, and the default methods "exact" and "taylor"."""

from importlib.util import find_spec
from typing import Annotated, Any, ClassVar, NamedTuple

from gearlib.engines.orbit import Record, Rows, Span
from gearlib.engines.protocol import run_all_tunings
from gearlib.parameters import Parameter, Positive, described


def option(default: Any, value_type: Any, meaning: str) -> Parameter:
    """Return the declaration of an option of a method."""
    return Parameter(Annotated[value_type, described(meaning)], default)


class MissingPackage(ImportError, ValueError):
    """The error that a method needs a package that is not installed."""


class Package(NamedTuple):
    """A package that a method needs."""

    module: str  #: name for its import
    distribution: str  #: name for its installation

    def available(self) -> bool:
        """Return whether the package is installed, without importing it."""
        return find_spec(self.module) is not None

    def note(self) -> str:
        """Return the command that installs the package."""
        return f"pip install {self.distribution}"


#: Options that several methods have.
RELATIVE_TOLERANCE = option(1e-3, Positive, "relative tolerance of a step")
ABSOLUTE_TOLERANCE = option(1e-6, Positive, "absolute tolerance, static deflections and dx/dtau")


class Integrator:
    """Base class of methods of integration for models of one degree of freedom.

    Subclasses define `create_run` and, if they can run other models, `supports`.
    """

    #: Order of the steps; None for closed forms and for solvers of several orders.
    ORDER: ClassVar[int | None] = None
    #: Descriptions of the treatment of events and of the models that the method can run.
    EVENTS: ClassVar[str] = ""
    MODELS: ClassVar[str] = "one degree of freedom, any damping, stiffness and excitation"
    #: Option name -> `Parameter`.
    OPTIONS: ClassVar[dict] = {}
    #: Package that the method needs in addition to the requirements of the library, or None.
    PACKAGE: ClassVar[Package | None] = None

    #: ``create_run(model, tuning, **options)`` returns a `gearlib.integrators.run.Run`.
    create_run: Any

    def run(
        self, model, tuning: float, state, span: Span, samples=0, keep_events=True, **options
    ) -> Record:
        """Run a model at one tuning (mesh frequency / natural frequency); return its `Record`.

        The run starts from the initial `state` of the model and lasts a `Span` of mesh periods. The
        record has `samples` samples per recorded period, and events only if `keep_events`.
        `options` are the options of the method, such as tolerances.
        """
        # One row in the event table only means that events are kept; the run replaces the table.
        tables = model.empty_record(span.recorded * samples, int(keep_events))
        return self.create_run(model, tuning, **options).run(state, span, *tables)

    def supports(self, model) -> bool:
        """Return whether the method can run a model, by default one with one degree of freedom."""
        return model.has_pair_equation

    def sweep(self, model, tunings, order, state, warm_start, span, rows: Rows, **options) -> None:
        """Run a model at many tunings, shape (n,), over a span of mesh periods; fill `rows`.

        A tuning is mesh frequency / natural frequency. `rows` holds result tables with a row for
        each tuning. `order` holds the indices of the tunings in the order of the runs. With
        `warm_start` each run starts from the final state of the previous run, else from `state`.
        `options` are the options of the method, such as tolerances.
        """

        def run(tuning, previous_record):
            """Run at a tuning from the end of the previous run if given, else from `state`."""
            initial_state = tuple(previous_record.final) if previous_record else state
            return self.run(model, tuning, initial_state, span, keep_events=False, **options)

        run_all_tunings(run, tunings, order, warm_start, rows)


class Exact(Integrator):
    """Closed forms between events: linear damping and rectangular stiffness."""

    NAME = "exact"
    EVENTS = "arcs end at switches and crossings, which are isolated by proof"
    MODELS = "linear damping with rectangular stiffness, one or six degrees of freedom"

    def supports(self, model) -> bool:
        """Return whether the model has an engine for this method."""
        return self.NAME in model.propagators

    def run(self, model, tuning, state, span, samples=0, keep_events=True, **options) -> Record:
        """Run a model at one tuning (mesh frequency / natural frequency); return its `Record`.

        The run starts from the initial `state` of the model and lasts a `Span` of mesh periods. The
        record has `samples` samples per recorded period, and events only if `keep_events`.
        `options` are the options of the method.
        """
        # The engine that computes the exact motion of this model at this tuning.
        propagator = model.propagator(tuning, self.NAME, **options)
        converted_state = propagator.initial_state(state)
        return propagator.run(converted_state, span, samples, keep_events=keep_events)

    def sweep(self, model, tunings, order, state, warm_start, span, rows, **options) -> None:
        """Run a model at many tunings, shape (n,), over a span of mesh periods; fill `rows`.

        A tuning is mesh frequency / natural frequency. `rows` holds result tables with a row for
        each tuning. `order` holds the indices of the tunings in the order of the runs. With
        `warm_start` each run starts from the final state of the previous run, else from `state`.
        `options` are the options of the method.
        """
        # Any propagator of the model can sweep; it creates a propagator for each tuning.
        propagator = model.propagator(tunings[0], self.NAME, **options)
        propagator.sweep(tunings, order, state, warm_start, span, rows)


class Taylor(Exact):
    """Taylor steps of order 20 that end at events: every model of one degree of freedom."""

    NAME = "taylor"
    # Order and tolerance of `gearlib.engines.taylor.propagator`, which is loaded where it runs.
    ORDER = 20
    EVENTS = "steps end at switches and crossings, which are isolated in Bernstein form"
    MODELS = Integrator.MODELS
    OPTIONS = {
        "tolerance": option(
            1e-16,
            Positive,
            "truncation error of a step, static deflections; by default as small as rounding",
        )
    }


METHODS = {"exact": Exact(), "taylor": Taylor()}

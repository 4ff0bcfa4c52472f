"""Base class of the integration methods, and the default methods "exact" and "taylor"."""

from importlib.util import find_spec
from typing import Annotated, Any, ClassVar, NamedTuple

from gearlib.engines.orbit import Record, Span, SweepTables
from gearlib.engines.protocol import run_all_tunings
from gearlib.parameters import Parameter, Positive, described


def option(default: Any, value_type: Any, meaning: str) -> Parameter:
    """Return the declaration of an option of a method."""
    return Parameter(Annotated[value_type, described(meaning)], default)


class MissingPackage(ImportError, ValueError):
    """Raised if a method requires a package that is not installed."""


class Package(NamedTuple):
    """A package that is required by a method."""

    module: str  #: name of the module to import
    distribution: str  #: name of the distribution to install

    def available(self) -> bool:
        """Return whether the package is installed, without importing it."""
        return find_spec(self.module) is not None

    def note(self) -> str:
        """Return the command that installs the package."""
        return f"pip install {self.distribution}"


#: Options of several methods.
RELATIVE_TOLERANCE = option(1e-3, Positive, "relative tolerance of a step")
ABSOLUTE_TOLERANCE = option(1e-6, Positive, "absolute tolerance, static deflections and dx/dtau")


class Integrator:
    """Base class of integration methods, by default for models with one degree of freedom.

    Subclasses define `create_run` and, if they support other models, `supports`.
    """

    #: Order of accuracy; None for closed forms and for a choice of solvers.
    ORDER: ClassVar[int | None] = None
    #: Descriptions of the treatment of events and of the supported models.
    EVENTS: ClassVar[str] = ""
    MODELS: ClassVar[str] = "one degree of freedom, any damping, stiffness and excitation"
    #: Option name -> `Parameter`.
    OPTIONS: ClassVar[dict] = {}
    #: Package that the method requires in addition to those of the library, or None.
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
        # A table with one row indicates that events are kept; the run replaces this table.
        tables = model.empty_record(span.recorded * samples, int(keep_events))
        return self.create_run(model, tuning, **options).run(state, span, *tables)

    def supports(self, model) -> bool:
        """Return whether the method supports a model, by default with one degree of freedom."""
        return model.has_pair_equation

    def sweep(
        self, model, tunings, order, state, warm_start, span, rows: SweepTables, **options
    ) -> None:
        """Run a model at many tunings, shape (n,), over a span of mesh periods; fill `rows`.

        A tuning is mesh frequency / natural frequency. `rows` holds result tables with a row for
        each tuning. `order` holds the indices of the tunings in the order of the runs. With
        `warm_start` each run starts from the final state of the previous run, else from `state`.
        `options` are the options of the method, such as tolerances.
        """

        def run(tuning, previous_record):
            """Run the model from the end of the previous run, or from `state` if it is None."""
            initial_state = tuple(previous_record.final) if previous_record else state
            return self.run(model, tuning, initial_state, span, keep_events=False, **options)

        run_all_tunings(run, tunings, order, warm_start, rows)


class Exact(Integrator):
    """Closed-form solutions between events, for linear damping and rectangular stiffness."""

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
        # The propagator at any tuning can run a sweep; it creates a propagator for each tuning.
        propagator = model.propagator(tunings[0], self.NAME, **options)
        propagator.sweep(tunings, order, state, warm_start, span, rows)


class Taylor(Exact):
    """Taylor steps of order 20 that end at events, for all models with one degree of freedom."""

    NAME = "taylor"
    # These are the order and the tolerance of `gearlib.engines.taylor.propagator`, which is slow to
    # load.
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

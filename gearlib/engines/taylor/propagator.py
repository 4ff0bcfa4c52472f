"""Taylor steps that end at events, for one degree of freedom with nonlinear forces."""

import numpy as np

from gearlib.engines.orbit import Record, Span
from gearlib.engines.polynomial import bernstein_matrix
from gearlib.engines.protocol import Base
from gearlib.engines.taylor.series import ORDER
from gearlib.engines.taylor.taylor_run import run_nonlinear

#: Truncation error of a step, in static deflections. It is as large as rounding.
TOLERANCE = 1e-16
TO_BERNSTEIN = bernstein_matrix(ORDER)


class Propagator(Base):
    """A model with one degree of freedom at one tuning."""

    description = "Taylor steps"

    def __init__(self, model, tuning: float, tolerance: float = TOLERANCE):
        """Set the constants of a model at a tuning, for a truncation error of each step."""
        super().__init__(model, tuning)
        self.tolerance = tolerance
        self.mesh = model.nonlinear_mesh(tuning, tolerance)

    def at(self, tuning: float) -> "Propagator":
        """Return the propagator of the same model at another tuning."""
        return type(self)(self.model, tuning, self.tolerance)

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z over a span and fill the tables; return the `Record`.

        The excitation starts with its mesh period `first_period`.
        """
        tables = samples, events, summary, np.empty((0, 2, 2))
        return self._integrate_from(z, span, *tables, first_period)

    def fill_maps(self, z, periods, max_events, maps, first_period):
        """Fill the period maps, shape (periods, 2, 2), of a run from z; return its status.

        z becomes the final state; the excitation starts with its mesh period `first_period`.
        """
        span, tables = Span(periods, 0, max_events), self.model.empty_record(events=0)
        return self._integrate_from(z, span, *tables, maps, first_period).status

    def _integrate_from(self, z, span, samples, events, summary, maps, first_period) -> Record:
        """Run from the state z, in place, and fill the tables and period maps; return the `Record`.

        Maps have the shape (periods, 2, 2) or (0, 2, 2); the excitation starts with `first_period`.
        """
        tables = samples, events, span.max_events, summary, maps
        result = self.run_kernel(*z, span.periods, span.recorded, tables, first_period)
        *z[:], period, events, event_count, status, steps = result
        # A coefficient of the series costs about one evaluation of the right-hand side.
        return Record(z, z, period, samples, events[:event_count], summary, status, steps * ORDER)

    def run_kernel(self, x, v, periods, recorded, tables, first_period):
        """Run from displacement x and velocity v; return what `run_nonlinear` returns.

        `tables` are its last five arguments, samples to period maps. `first_period` has no effect,
        because the excitation of a nonlinear mesh repeats after each period.
        """
        return run_nonlinear(self.mesh, TO_BERNSTEIN, x, v, periods, recorded, *tables)

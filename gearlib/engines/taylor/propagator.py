"""Taylor steps that end at events, for one degree of freedom and nonlinear laws."""

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
        """Set the law of a model at a tuning, for a truncation error of each step."""
        super().__init__(model, tuning)
        self.tolerance = tolerance
        self.law = model.law(tuning, tolerance)

    def at(self, tuning: float) -> "Propagator":
        """Return the propagator of the same model at another tuning."""
        return type(self)(self.model, tuning, self.tolerance)

    def fill_record(self, z, span, samples, events, summary, first):
        """Run from the state z over a span and fill the tables; return the `Record`.

        The excitation starts with its mesh period `first`.
        """
        return self._integrate_from(z, span, samples, events, summary, np.empty((0, 2, 2)), first)

    def fill_maps(self, z, periods, max_events, maps, first):
        """Fill the period maps, shape (periods, 2, 2), of a run from z; return its status.

        z becomes the final state; the excitation starts with its mesh period `first`.
        """
        tables = self.model.empty_record(events=0)
        return self._integrate_from(z, Span(periods, 0, max_events), *tables, maps, first).status

    def _integrate_from(self, z, span, samples, events, summary, maps, first) -> Record:
        """Run from the state z, in place, and fill the tables and period maps; return the `Record`.

        Maps have the shape (periods, 2, 2) or (0, 2, 2); the excitation starts with period `first`.
        """
        tables = samples, events, span.max_events, summary, maps, first
        result = self.integrate(*z, span.periods, span.recorded, *tables)
        *z[:], period, events, count, code, steps = result
        # A coefficient of the series costs about one evaluation of the right-hand side.
        return Record(z, z, period, samples, events[:count], summary, code, steps * ORDER)

    def integrate(self, *arguments):
        """Run the kernel `run_nonlinear` with all arguments but the last one, the first period.

        The excitation of a nonlinear mesh repeats after each period.
        """
        return run_nonlinear(self.law, TO_BERNSTEIN, *arguments[:-1])

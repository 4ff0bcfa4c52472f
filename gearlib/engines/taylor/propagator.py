"""Taylor steps that end at events: one degree of freedom, any damping, stiffness and excitation."""

import numpy as np

from gearlib.engines.orbit import Record, Span
from gearlib.engines.polynomial import bernstein_matrix
from gearlib.engines.protocol import Base
from gearlib.engines.taylor.series import ORDER
from gearlib.engines.taylor.taylor_run import run_nonlinear

#: Truncation error of a step, static deflections: that of rounding.
TOLERANCE = 1e-16
TO_BERNSTEIN = bernstein_matrix(ORDER)


class Propagator(Base):
    """A model with one degree of freedom at one tuning."""

    words = "Taylor steps"

    def __init__(self, model, tuning, tolerance=TOLERANCE):
        super().__init__(model, tuning)
        self.tolerance = tolerance
        self.law = model.law(tuning, tolerance)

    def at(self, tuning):
        """Return the engine at another tuning; see `Base.at`."""
        return type(self)(self.model, tuning, self.tolerance)

    def go(self, z, span, samples, events, summary, first):
        """Run from z; see `Base.go`."""
        return self._go(z, span, samples, events, summary, np.empty((0, 2, 2)), first)

    def fill_maps(self, z, periods, max_events, maps, first):
        """Fill the maps; see `Base.fill_maps`."""
        tables = self.model.empty_record(events=0)
        return self._go(z, Span(periods, 0, max_events), *tables, maps, first).status

    def _go(self, z, span, samples, events, summary, maps, first) -> Record:
        """Run from z, and fill the maps if there are any."""
        tables = samples, events, span.max_events, summary, maps, first
        done = self.integrate(*z, span.periods, span.recorded, *tables)
        *z[:], period, events, count, code, steps = done
        # A coefficient of the series costs as much as an evaluation of the right-hand side.
        return Record(z, z, period, samples, events[:count], summary, code, steps * ORDER)

    def integrate(self, *arguments):
        """Call the kernel; `run_nonlinear` needs no first period, which repeats after each."""
        return run_nonlinear(self.law, TO_BERNSTEIN, *arguments[:-1])

"""Taylor steps that end at events: one degree of freedom, any damping, stiffness and excitation."""

from gearlib.engines.orbit import Record
from gearlib.engines.polynomial import bernstein_matrix
from gearlib.engines.protocol import Base
from gearlib.engines.taylor.series import ORDER
from gearlib.engines.taylor.taylor_maps import vary_nonlinear
from gearlib.engines.taylor.taylor_run import run_nonlinear, steady_course

#: Truncation error of a step, static deflections: that of rounding.
TOLERANCE = 1e-16
TO_BERNSTEIN = bernstein_matrix(ORDER)


class Propagator(Base):
    """A model with one degree of freedom at one tuning."""

    words = "Taylor steps"

    def __init__(self, model, tuning, tolerance=TOLERANCE):
        super().__init__(model, tuning)
        self.tuning, self.tolerance = tuning, tolerance
        self.law = model.law(tuning, tolerance)

    def at(self, tuning):
        """Return the engine at another tuning; see `Base.at`."""
        return type(self)(self.model, tuning, self.tolerance)

    def go(self, z, span, samples, events, summary, first):
        """Run from z; see `Base.go`."""
        system = self.law, TO_BERNSTEIN, steady_course(self.law)
        tables = samples, events, span.max_events, summary[None]
        done = run_nonlinear(*system, *z, span.periods, span.recorded, *tables)
        *z[:], period, events, count, code, steps = done
        # A coefficient of the series costs as much as an evaluation of the right-hand side.
        return Record(z, z, period, samples, events[:count], summary, code, steps * ORDER)

    def fill_maps(self, z, periods, max_events, maps, first):
        """Fill the maps; see `Base.fill_maps`."""
        *z[:], code = vary_nonlinear(self.law, TO_BERNSTEIN, *z, periods, max_events, maps)
        return code

"""Taylor steps that end at events: one degree of freedom, any damping, stiffness and excitation."""

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

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        *rest, summary = arguments
        course = steady_course(self.law)
        done = run_nonlinear(self.law, TO_BERNSTEIN, course, *z, *rest, summary[None])
        *z[:], period, events, found, code, steps = done
        # Each coefficient of the series takes what an evaluation of the right-hand side takes.
        return *z, period, events, found, code, steps * ORDER

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        *z[:], code = vary_nonlinear(self.law, TO_BERNSTEIN, *z, periods, limit, maps)
        return code

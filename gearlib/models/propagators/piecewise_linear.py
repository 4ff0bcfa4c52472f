"""Matrix exponentials between events: piecewise-linear models with any number of coordinates."""

import numpy as np

from gearlib.kernels.piecewise_linear.run import run_linear
from gearlib.kernels.piecewise_linear.system import ORDER
from gearlib.kernels.piecewise_linear.variation import vary_linear
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.models.propagators.base import Base

_TO_BERNSTEIN = bernstein_matrix(ORDER)


class Propagator(Base):
    """A piecewise-linear model at one tuning."""

    def __init__(self, model, tuning):
        super().__init__(model, tuning)
        self.system, self.outputs = model.system(tuning)
        self.part = model.part(self.system)
        self.components, self.pieces = self.system.near.size, int(self.system.substeps.sum())

    def start(self, state):
        """Return the state z; see `Base.start`."""
        return self.model.initial(self.system, state)[: self.model.size]

    def _full(self, z):
        """Return z with room for the constant and the harmonics, which the kernels fill in."""
        full = np.zeros(self.components)
        full[: z.size] = z
        return full

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        full, system = self._full(z), self.system._replace(first=first)
        done = run_linear(system, self.part, self.outputs, _TO_BERNSTEIN, full, *arguments)
        z[:] = full[: z.size]
        # Matrix exponentials evaluate no right-hand side: 0.
        return *done, 0

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        full, system = self._full(z), self.system._replace(first=first)
        code = vary_linear(system, _TO_BERNSTEIN, full, z.size, periods, limit, maps)
        z[:] = full[: z.size]
        return code

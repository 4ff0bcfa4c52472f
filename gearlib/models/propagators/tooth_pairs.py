"""A mesh whose pairs of teeth touch one by one: Taylor steps between the events of all pairs."""

import numpy as np

from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.taylor.series import ORDER
from gearlib.kernels.tooth_pairs.tooth_pairs_run import run_pairs
from gearlib.models.propagators.base import Base

_TO_BERNSTEIN = bernstein_matrix(ORDER)


class Propagator(Base):
    """A `LoadSharingPair` at one tuning."""

    words = "Taylor steps"

    def __init__(self, model, tuning):
        super().__init__(model, tuning)
        self.system = model.system(tuning)

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        done = run_pairs(self.system, _TO_BERNSTEIN, *z, *arguments, np.empty((0, 2, 2)), first)
        *z[:], period, events, found, code, steps = done
        return *z, period, events, found, code, steps * ORDER

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        samples, events, summary = self.model.empty_record(events=0)
        more = periods, 0, samples, events, limit, summary, maps, first
        *z[:], _, _, _, code, _ = run_pairs(self.system, _TO_BERNSTEIN, *z, *more)
        return code

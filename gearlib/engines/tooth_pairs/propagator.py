"""A mesh whose pairs of teeth touch one by one: Taylor steps between the events of all pairs."""

import numpy as np

from gearlib.engines.protocol import Base
from gearlib.engines.taylor.propagator import TO_BERNSTEIN
from gearlib.engines.taylor.series import ORDER
from gearlib.engines.taylor.taylor_run import Course
from gearlib.engines.tooth_pairs.tooth_pairs_run import run_pairs


class Propagator(Base):
    """A `LoadSharingPair` at one tuning."""

    words = "Taylor steps"

    def __init__(self, model, tuning):
        super().__init__(model, tuning)
        self.system = system = model.system(tuning)
        ends = system.starts[:-1].copy(), system.starts[1:].copy()
        size, repeats = ends[0].size, np.zeros(system.repeats, np.int64)
        none = np.zeros(1, np.int64)
        rest = (
            np.ones(size),
            np.ones(size),
            np.array([1.0, 0.0, 1.0, 0.0, 0.0]),
            np.empty((0, 3)),
            True,
        )
        where = system.first_segment, repeats, none, np.arange(size), np.zeros(size)
        self.course = Course(*ends, *where, *rest)

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        *more, summary = arguments
        more += summary[None], np.empty((0, 2, 2)), first
        done = run_pairs(self.system, self.course, TO_BERNSTEIN, *z, *more)
        *z[:], period, events, found, code, steps = done
        return *z, period, events, found, code, steps * ORDER

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        samples, events, summary = self.model.empty_record(events=0)
        more = periods, 0, samples, events, limit, summary[None], maps, first
        *z[:], _, _, _, code, _ = run_pairs(self.system, self.course, TO_BERNSTEIN, *z, *more)
        return code

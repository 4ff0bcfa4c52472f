"""A mesh whose pairs of teeth touch one by one: Taylor steps between the events of all pairs."""

import numpy as np

from gearlib.engines.orbit import Record, Span
from gearlib.engines.protocol import Base
from gearlib.engines.taylor.propagator import TO_BERNSTEIN
from gearlib.engines.taylor.series import ORDER
from gearlib.engines.tooth_pairs.tooth_pairs_run import run_pairs


class Propagator(Base):
    """A `LoadSharingPair` at one tuning."""

    words = "Taylor steps"

    def __init__(self, model, tuning):
        super().__init__(model, tuning)
        self.system = model.system(tuning)

    def go(self, z, span, samples, events, summary, first):
        """Run from z; see `Base.go`."""
        return self._go(z, span, samples, events, summary, first, np.empty((0, 2, 2)))

    def fill_maps(self, z, periods, max_events, maps, first):
        """Fill the maps; see `Base.fill_maps`."""
        tables = self.model.empty_record(events=0)
        return self._go(z, Span(periods, 0, max_events), *tables, first, maps).status

    def _go(self, z, span, samples, events, summary, first, maps) -> Record:
        """Run from z, and fill the maps if there are any."""
        tables = samples, events, span.max_events, summary, maps, first
        spans = span.periods, span.recorded
        done = run_pairs(self.system, TO_BERNSTEIN, *z, *spans, *tables)
        *z[:], period, events, count, code, steps = done
        return Record(z, z, period, samples, events[:count], summary, code, steps * ORDER)

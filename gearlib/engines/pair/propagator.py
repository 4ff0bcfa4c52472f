"""Scalar closed forms between events: a `GearPair`."""

import numpy as np

from gearlib.engines.pair import many_runs, pair_run, sections
from gearlib.engines.pair.mesh_constants import mesh
from gearlib.engines.pair.pair_maps import vary
from gearlib.engines.pair.stiffness import levels, segment_lengths
from gearlib.engines.protocol import Base


def ratios(pair):
    """Return the dimensionless ratios of a `GearPair`, shape (7,), in the order of `mesh`.

    Of a pair whose numbers are arrays of shape (k,), shape (7, k).
    """
    return np.array(
        [
            *levels(pair.contact_ratio, pair.stiffness_ratio),
            *segment_lengths(pair.contact_ratio),
            pair.damping_ratio,
            pair.backlash_damping_ratio,
            pair.backlash_ratio,
        ]
    )


class Propagator(Base):
    """A `GearPair` at one tuning."""

    chunk, proves_periods = 2048, True

    def __init__(self, model, tuning, other=None):
        super().__init__(model, tuning)
        self.ratios = other.ratios if other else ratios(model)
        self.mesh = mesh(self.ratios, tuning)

    def at(self, tuning):
        """Return the propagator of another tuning; see `Base.at`."""
        return type(self)(self.model, tuning, self)

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        *z[:], period, events, found, code = pair_run.run(self.mesh, *z, *arguments)
        # Closed forms evaluate no right-hand side: 0.
        return *z, period, events, found, code, 0

    @staticmethod
    def run_many(model, tunings, order, state, carry, span, rows):
        """Run many tunings in one call of the kernel."""
        begin = np.array(state), carry
        many_runs.run_many(ratios(model), tunings, order, *begin, *span, *rows)

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        *z[:], code = vary(self.mesh, *z, periods, limit, maps)
        return code

    def skip(self, states, periods, limit, ends, codes):
        """Take many states on; see `Base.skip`."""
        many_runs.skip_many(self.mesh, np.ascontiguousarray(states), periods, limit, ends, codes)

    def sections(self, *arguments):
        """Fill the states at one phase of every period."""
        sections.section(self.mesh, *arguments)

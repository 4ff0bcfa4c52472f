"""Exact runs of a `GearPair`: closed forms between events."""

import numpy as np

from gearlib.engines.orbit import Record
from gearlib.engines.pair import pair_run
from gearlib.engines.pair.maps import fill_period_maps
from gearlib.engines.pair.motion import mesh_at_tuning
from gearlib.engines.pair.stiffness import segment_lengths, stiffness_levels
from gearlib.engines.protocol import Base


def ratios(pair):
    """Return the seven dimensionless ratios of a `GearPair` that `mesh_at_tuning` takes.

    They are both stiffnesses over their mean, the phase lengths of both stiffness segments, both
    damping ratios and the backlash. The shape is (7,), or (7, k) for parameters that are arrays of
    shape (k,).
    """
    return np.array(
        [
            *stiffness_levels(pair.contact_ratio, pair.stiffness_ratio),
            *segment_lengths(pair.contact_ratio),
            pair.damping_ratio,
            pair.backlash_damping_ratio,
            pair.backlash_ratio,
        ]
    )


class Propagator(Base):
    """Runs a `GearPair` at one tuning by closed forms."""

    chunk_size, proves_periods = 2048, True

    def __init__(self, model, tuning, other=None):
        """Compute the constants of a `GearPair` at a tuning, mesh frequency / natural frequency.

        `other` is a propagator of the same pair whose dimensionless ratios are reused, or None.
        """
        super().__init__(model, tuning)
        self.ratios = other.ratios if other else ratios(model)
        self.mesh = mesh_at_tuning(self.ratios, tuning)

    def at(self, tuning):
        """Return the propagator of the same pair at another tuning."""
        return type(self)(self.model, tuning, self)

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z, shape (2,), fill the tables and return the `Record` of the run.

        z, displacement and velocity, becomes the final state. `span` has the numbers of all and of
        recorded mesh periods and the largest number of events in one. The tables are `samples`,
        `events` and `summary` (extrema and contact times). `first_period` has no effect, as all
        mesh periods are equal.
        """
        tables = samples, events, span.max_events, summary
        result = pair_run.run(self.mesh, *z, span.periods, span.recorded, *tables)
        *z[:], period, events, arc_count, status = result
        return Record(z, z, period, samples, events[:arc_count], summary, status)

    def sweep(self, tunings, order, state, warm_start, span, rows):
        """Run the pair at the tunings ``tunings[order]`` and fill their result `rows`.

        A tuning is mesh frequency over natural frequency. Each run starts from `state`, or with
        `warm_start` from the end of the previous run. `span` gives the numbers of mesh periods.
        `rows`, a `Rows`, has the largest allowed displacement and tables with a row for each
        tuning: summaries, final states, periods with statuses. If `order` is an array, one call of
        the kernel does all runs.
        """
        if not isinstance(order, np.ndarray):
            return super().sweep(tunings, order, state, warm_start, span, rows)
        pair_run.run_many(self.ratios, tunings, order, np.array(state), warm_start, span, *rows)

    def fill_maps(self, z, periods, max_events, maps, first_period):
        """Fill `maps`, shape (periods, 2, 2), with the Jacobian matrix of each mesh period.

        The state z, shape (2,), becomes the final state; the status of the run is returned. A
        period has at most `max_events` arcs (parts of the motion between two events);
        `first_period` has no effect, as all mesh periods are equal.
        """
        *z[:], status = fill_period_maps(self.mesh, *z, periods, max_events, maps)
        return status

    def propagate_many(self, states, periods, max_events):
        """Return (final states, statuses) of runs from `states`, shape (k, 2).

        Each run lasts `periods` mesh periods. More than `max_events` arcs (parts of the motion
        between two events) in a period end a run.
        """
        states = np.ascontiguousarray(states)
        ends, statuses = np.empty(states.shape), np.empty(len(states), np.int64)
        pair_run.run_many_states(self.mesh, states, periods, max_events, ends, statuses)
        return ends, statuses

    def sections(self, *arguments):
        """Fill a table with states at one phase of each mesh period; see `Base.sections`."""
        pair_run.fill_sections(self.mesh, *arguments)

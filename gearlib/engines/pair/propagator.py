"""Exact runs of a `GearPair` by closed forms between events."""

import numpy as np

from gearlib.engines.codes import OK
from gearlib.engines.orbit import Record, repeat_record
from gearlib.engines.pair import pair_run
from gearlib.engines.pair.maps import fill_period_maps
from gearlib.engines.pair.motion import pair_constants_at_tuning
from gearlib.engines.pair.stiffness import segment_lengths, stiffness_levels
from gearlib.engines.pair.whole_periods import allocate_workspace
from gearlib.engines.protocol import Engine


def dimensionless_parameters(pair):
    """Return the seven dimensionless parameters of a `GearPair` for `pair_constants_at_tuning`.

    They are both stiffnesses over their mean, the lengths of half a C_max segment and of a C_min
    segment, both damping ratios and the backlash ratio. The shape is (7,), or (7, k) for parameters
    that are arrays of shape (k,).
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


class Propagator(Engine):
    """Runs a `GearPair` at one tuning by closed forms."""

    chunk_size, proves_periods = 2048, True

    def __init__(self, model, tuning, other=None):
        """Compute the constants of a `GearPair` at a tuning, mesh frequency / natural frequency.

        If `other`, a propagator of the same pair, is given, its dimensionless parameters are
        reused.
        """
        super().__init__(model, tuning)
        self.parameters = other.parameters if other else dimensionless_parameters(model)
        self.pair = pair_constants_at_tuning(self.parameters, tuning)

    def at(self, tuning):
        """Return the propagator of the same pair at another tuning."""
        return type(self)(self.model, tuning, self)

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z, shape (2,), fill the tables and return the `Record` of the run.

        z, displacement and velocity, becomes the final state. `span` has the number of mesh
        periods, the number of recorded periods and the largest number of events per period. The
        empty tables are `samples`, `events` and `summary` (extrema and contact times).
        `first_period` has no effect, because all mesh periods are equal.
        """
        tables = samples, events, span.max_events, summary
        result = pair_run.run(
            self.pair, allocate_workspace(), *z, span.periods, span.recorded, *tables
        )
        *z[:], period, computed_periods, events, event_count, status = result
        events = events[:event_count]
        if status == OK:
            events = repeat_record(samples, events, computed_periods, span.recorded)
        return Record(z, z, period, samples, events, summary, status)

    def sweep(self, tunings, order, state, warm_start, span, result_tables):
        """Run the pair at the tunings ``tunings[order]`` and fill the `result_tables`.

        A tuning is the mesh frequency over the natural frequency. Each run starts from `state` or,
        with `warm_start`, from the end of the previous run. `span` has the numbers of mesh periods.
        The `SweepTables` have one row per tuning. If `order` is an array, one call of the kernel
        does all runs.
        """
        if not isinstance(order, np.ndarray):
            return super().sweep(tunings, order, state, warm_start, span, result_tables)
        pair_run.run_many(
            self.parameters,
            allocate_workspace(),
            tunings,
            order,
            np.array(state),
            warm_start,
            span,
            *result_tables,
        )

    def fill_maps(self, z, periods, max_events, maps, first_period):
        """Fill `maps`, shape (periods, 2, 2), with the Jacobian matrix of each mesh period.

        The state z, shape (2,), becomes the final state; the status of the run is returned. A
        period has at most `max_events` arcs (parts of the motion between two events);
        `first_period` has no effect, because all mesh periods are equal.
        """
        *z[:], status = fill_period_maps(self.pair, *z, periods, max_events, maps)
        return status

    def propagate_many(self, states, periods, max_events):
        """Return (final states, statuses) of runs from `states`, shape (k, 2).

        Each run lasts `periods` mesh periods. More than `max_events` arcs (parts of the motion
        between two events) in a period end a run.
        """
        states = np.ascontiguousarray(states)
        final_states, statuses = np.empty(states.shape), np.empty(len(states), np.int64)
        pair_run.run_many_states(
            self.pair, allocate_workspace(), states, periods, max_events, final_states, statuses
        )
        return final_states, statuses

    def sections(self, *arguments):
        """Fill a table with the states at one phase of each mesh period; see `Engine.sections`."""
        pair_run.fill_sections(self.pair, allocate_workspace(), *arguments)

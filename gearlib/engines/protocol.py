"""Common interface of all engines: one run, many runs, period maps.

A state z, shape (size,), holds the displacements of the model in units of the static deflection,
followed by their derivatives by mesh phase. Runs start at the start of a mesh period and end with a
status of `codes`. A run is aborted if a mesh period has more than `max_events` events.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from gearlib.engines.codes import OK, OVERFLOW
from gearlib.engines.orbit import SAMPLE_V, SAMPLE_X, X_MAX, X_MIN, Record, Span, SweepTables
from gearlib.engines.stable_repeats import prove_period

#: Number of rows of a new event table.
_FIRST_EVENT_ROWS = 64
#: Largest number of samples per mesh period in `Engine.sections`.
_MAX_SECTION_SAMPLES = 360


class Engine:
    """Base class of the engines of models at one tuning.

    Subclasses define `fill_record` and `fill_maps`.
    """

    #: Description of the motion between events.
    description = "closed forms"
    #: Number of initial states that a thread integrates at a time.
    chunk_size = 16
    #: Numbers of state components and of segments of a mesh period, which determine the cost.
    components, segment_count = 2, 0
    #: Whether `run` returns proven periods, so that `stable_repeats` does not have to prove them.
    proves_periods = False

    def __init__(self, model: Any, tuning: float):
        """Store the model and its tuning."""
        self.model, self.tuning = model, tuning

    def at(self, tuning: float) -> "Engine":
        """Return the engine of the same model at another tuning."""
        return type(self)(self.model, tuning)

    def initial_state(self, state: Any) -> np.ndarray:
        """Return the state z at tau = 0 for a `state` (displacement, dx/dtau)."""
        return np.array(state, float)

    def run(
        self, z, span: Span, samples: int = 0, first_period: int = 0, keep_events: bool = True
    ) -> Record:
        """Return the `Record` of a run from the state z over a span of mesh periods.

        `span` is a `Span` (number of periods, number of recorded periods, largest number of events
        per period). `samples` is the number of samples in each recorded period. The run starts in
        mesh period `first_period` of the excitation period. Events (changes of contact) are
        recorded unless `keep_events` is False. z is not changed.
        """
        event_rows = _FIRST_EVENT_ROWS if keep_events else 0
        tables = self.model.empty_record(span.recorded * samples, event_rows)
        return self.fill_record(np.array(z, float), span, *tables, first_period)

    def record(self, z, periods: int, max_events: int, samples: int = 0) -> Record:
        """Run from the state z, record all `periods` mesh periods and return the `Record`.

        A run with more than `max_events` changes of contact in a period is aborted with the status
        EVENT_LIMIT; `samples` is the number of samples per period.
        """
        return self.run(z, Span(periods, periods, max_events), samples)

    def fill_record(self, z, span: Span, samples, events, summary, first_period: int) -> Record:
        """Run from the state z, which may change, and fill the tables; return the `Record`.

        `span` is the `Span` of mesh periods, and the run starts in mesh period `first_period` of
        the excitation period. `samples`, `events` and `summary` are empty tables with the columns
        of `Record`. Subclasses define this method.
        """
        raise NotImplementedError

    def maps(self, z, periods: int, max_events: int, first_period: int = 0) -> tuple:
        """Return (final state, period maps, status) of a run from the state z.

        Period maps, shape (periods, size, size), are the derivatives of the state after each mesh
        period with respect to the state before it. They are exact, because saltation matrices
        account for the time shift of each change of contact. They are NaN if the status is not OK.
        A period has at most `max_events` events; the run starts in mesh period `first_period` of
        the excitation period.
        """
        z = np.array(z, float)
        maps = np.empty((periods, z.size, z.size))
        status = self.fill_maps(z, periods, max_events, maps, first_period)
        if status != OK:
            maps[:] = np.nan
        return z, maps, status

    def fill_maps(self, z, periods: int, max_events: int, maps, first_period: int) -> int:
        """Fill the period maps of a run from the state z and return the status of the run.

        z becomes the final state. `maps`, shape (periods, size, size), is filled with the
        derivatives of the state after each mesh period with respect to the state before it. A
        period has at most `max_events` events; the run starts in mesh period `first_period` of the
        excitation period. Subclasses define this method.
        """
        raise NotImplementedError

    def propagate_many(self, states, periods: int, max_events: int) -> tuple:
        """Return (final states, statuses) of runs from k initial states, shape (k, size).

        Each run lasts `periods` mesh periods with at most `max_events` changes of contact each.
        """
        span = Span(periods, 1, max_events)
        records = [self.run(z, span, keep_events=False) for z in states]
        statuses = np.array([record.status for record in records], np.int64)
        return np.array([record.state for record in records]).reshape(np.shape(states)), statuses

    def sections(
        self,
        states,
        settle_periods: int,
        phase: float,
        max_events: int,
        table,
        final_states,
        statuses,
    ) -> None:
        """Fill `table` with the Poincare sections of n motions: (x, x') once per mesh period.

        `table` has the shape (n, periods, 2). The motions start from `states`, shape (n, 2), and
        run `settle_periods` mesh periods before the first entry. The `phase`, in rad, is a multiple
        of one degree; a period has at most `max_events` events. `final_states`, shape (n, 2), and
        `statuses`, shape (n,), are also filled.
        """
        period_fraction = Fraction(phase / (2.0 * math.pi)).limit_denominator(_MAX_SECTION_SAMPLES)
        if abs(period_fraction - phase / (2.0 * math.pi)) > 1e-12:
            raise ValueError(
                f"phase = {phase!r} is not allowed for a {type(self.model).__name__}: it must be a "
                "multiple of one degree, pi / 180"
            )
        # The samples are equally spaced, and one of them is at the phase.
        periods, samples = table.shape[1], period_fraction.denominator
        span = Span(settle_periods + periods, periods, max_events)
        for i, state in enumerate(states):
            record = self.run(self.initial_state(state), span, samples, keep_events=False)
            final_states[i], statuses[i] = record.final[:2], record.status
            if record.status == OK:
                table[i] = record.samples[
                    period_fraction.numerator :: samples, [SAMPLE_X, SAMPLE_V]
                ]

    def sweep(
        self, tunings, order, state, warm_start: bool, span: Span, result_tables: SweepTables
    ) -> None:
        """Run the model at all `tunings` over a `Span` of mesh periods and fill result tables.

        A tuning is the mesh frequency over the natural frequency; `order` holds the indices of the
        tunings in the order of the runs. With `warm_start` a run continues from the end of the
        previous run, otherwise it starts from `state`. The `result_tables` have one row per tuning.
        """
        engine, next_period = self, 0

        def run(tuning: float, previous: Record | None) -> Record:
            """Return the `Record` of a run at a tuning, with the proven period of the motion.

            The run starts from the end of the `previous` run or, if that is None, from `state`.
            """
            nonlocal engine, next_period
            engine, first_period = engine.at(tuning), next_period if previous else 0
            z = previous.state if previous else engine.initial_state(state)
            record = engine.run(z, span, first_period=first_period, keep_events=False)
            # The next run continues in this mesh period of the excitation period.
            next_period = (first_period + span.periods) % self.model.repeats
            arguments = record.state, record.period, span.max_events, next_period
            return record._replace(period=prove_period(engine, *arguments))

        run_all_tunings(run, tunings, order, warm_start, result_tables)


def run_all_tunings(
    run: Callable, tunings, order, warm_start: bool, result_tables: SweepTables
) -> None:
    """Run a model at all `tunings` and fill the rows of the result tables.

    ``run(tuning, previous)`` runs the model and returns its `Record`. With `warm_start`, `previous`
    is the record of the previous run; it is None in the first run, after a failed run and without
    `warm_start`. `order` holds the indices of the tunings in the order of the runs. In
    `result_tables`, failed runs are NaN; a displacement above ``result_tables.max_displacement``
    counts as overflow.
    """
    previous = None
    for i in order:
        record = run(float(tunings[i]), previous)
        max_displacement = np.abs(record.summary[..., [X_MAX, X_MIN]]).max()
        status = record.status
        if status == OK and max_displacement > result_tables.max_displacement:
            status = OVERFLOW
        result_tables.outcomes[i] = record.period, status
        if status == OK:
            result_tables.summaries[i], result_tables.final_states[i] = record.summary, record.final
        else:
            result_tables.summaries[i], result_tables.final_states[i] = np.nan, np.nan
        previous = record if warm_start and status == OK else None

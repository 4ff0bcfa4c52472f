"""The protocol of all engines: one run, many runs, maps of mesh periods.

A state z has the shape (size,) of the model: coordinates in static deflections, then their rates by
mesh phase. Runs begin at the start of a mesh period. They end with a status of `codes`, and give
up after so many events in one mesh period.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from gearlib.engines.codes import OK, OVERFLOW
from gearlib.engines.orbit import SAMPLE_V, SAMPLE_X, X_MAX, X_MIN, Record, Rows, Span
from gearlib.engines.stable_repeats import proven_period

#: Number of rows of a new event table.
_FIRST_EVENT_ROWS = 64
#: Largest number of equal steps in which `Base.sections` samples a mesh period.
_MAX_SECTION_SAMPLES = 360


class Base:
    """A model at one tuning; subclasses ``Propagator`` define `fill_record` and `fill_maps`."""

    #: Description of the motion between events.
    description = "closed forms"
    #: Number of states that a thread takes at a time.
    chunk_size = 16
    #: Numbers of state components and of pieces of a mesh period, which determine the cost.
    components, pieces = 2, 0
    #: Whether `run` returns proven periods, which `stable_repeats` need not prove.
    proves_periods = False

    def __init__(self, model: Any, tuning: float):
        self.model, self.tuning = model, tuning

    def at(self, tuning: float) -> "Base":
        """Return the engine of the same model at another tuning."""
        return type(self)(self.model, tuning)

    def start(self, state: Any) -> np.ndarray:
        """Return the state z for a displacement and dx/dtau at tau = 0."""
        return np.array(state, float)

    def run(self, z, span: Span, samples=0, first=0, keep_events=True) -> Record:
        """Return the `Record` of a run from z, with `samples` samples in each recorded period.

        `first` is the mesh period of the excitation, which may repeat after several, in which the
        run begins. Events are recorded unless `keep_events` is False. z is not changed.
        """
        event_rows = _FIRST_EVENT_ROWS if keep_events else 0
        tables = self.model.empty_record(span.recorded * samples, event_rows)
        return self.fill_record(np.array(z, float), span, *tables, first)

    def record(self, z, periods: int, max_events: int, samples=0) -> Record:
        """Return the `Record` of a run from z, all periods of which are recorded."""
        return self.run(z, Span(periods, periods, max_events), samples)

    def fill_record(self, z, span: Span, samples, events, summary, first: int) -> Record:
        """Run from z, which may change, and fill the tables; return the `Record`."""
        raise NotImplementedError

    def maps(self, z, periods: int, max_events: int, first=0) -> tuple:
        """Return (end, maps, status): maps, (periods, size, size), linearise each mesh period.

        They are exact: flank crossings enter by saltation matrices, see
        `gearlib.engines.pair.maps`. They are NaN if the status is not OK.
        """
        z = np.array(z, float)
        maps = np.empty((periods, z.size, z.size))
        code = self.fill_maps(z, periods, max_events, maps, first)
        if code != OK:
            maps[:] = np.nan
        return z, maps, code

    def fill_maps(self, z, periods: int, max_events: int, maps, first: int) -> int:
        """Fill the maps of mesh periods and move z to the end; return the status."""
        raise NotImplementedError

    def many(self, states, periods: int, max_events: int) -> tuple:
        """Return (ends, statuses) of runs from states, shape (k, size), through mesh periods."""
        span = Span(periods, 1, max_events)
        records = [self.run(z, span, keep_events=False) for z in states]
        codes = np.array([record.status for record in records], np.int64)
        return np.array([record.state for record in records]).reshape(np.shape(states)), codes

    def sections(self, states, settle, phase, max_events: int, table, ends, codes) -> None:
        """Fill a table, shape (n, periods, 2), with the states of n orbits at a phase.

        The orbits start in `states`, shape (n, 2), and settle for `settle` periods before. `ends`,
        shape (n, 2), get the last states, `codes`, shape (n,), the statuses. `phase` is a multiple
        of one degree.
        """
        share = Fraction(phase / (2.0 * math.pi)).limit_denominator(_MAX_SECTION_SAMPLES)
        if abs(share - phase / (2.0 * math.pi)) > 1e-12:
            raise ValueError(
                f"phase = {phase!r} is not allowed for this {type(self.model).__name__}: it must "
                "be a multiple of one degree, pi / 180"
            )
        periods, samples = table.shape[1], share.denominator
        span = Span(settle + periods, periods, max_events)
        for i, state in enumerate(states):
            record = self.run(self.start(state), span, samples, keep_events=False)
            ends[i], codes[i] = record.final[:2], record.status
            if record.status == OK:
                table[i] = record.samples[share.numerator :: samples, [SAMPLE_X, SAMPLE_V]]

    def sweep(self, tunings, order, state, carry: bool, span: Span, rows: Rows) -> None:
        """Run all tunings in an `order` and fill their rows.

        With `carry` each run starts at the end of the one before, with all coordinates; otherwise
        from `state`.
        """
        engine, repeats, next_period = self, self.model.repeats, 0

        def run(tuning: float, before: Record | None) -> Record:
            nonlocal engine, next_period
            engine, first = engine.at(tuning), next_period if before else 0
            z = before.state if before else engine.start(state)
            record = engine.run(z, span, first=first, keep_events=False)
            next_period = (first + span.periods) % repeats
            period = proven_period(
                engine, record.state, record.period, span.max_events, next_period
            )
            return record._replace(period=period)

        run_each(run, tunings, order, carry, rows)


def run_each(run: Callable, tunings, order, carry: bool, rows: Rows) -> None:
    """Fill the rows of ``tunings[order]`` with the records of ``run(tuning, record)``.

    The argument `record` is that of the tuning before, or None for a new start. With `carry` only
    failed runs lead to a new start.
    """
    previous = None
    for i in order:
        record = run(float(tunings[i]), previous)
        largest = np.abs(record.summary[..., [X_MAX, X_MIN]]).max()
        code = OVERFLOW if record.status == OK and largest > rows.bound else record.status
        rows.codes[i] = record.period, code
        if code == OK:
            rows.summaries[i], rows.ends[i] = record.summary, record.final
        else:
            rows.summaries[i], rows.ends[i] = np.nan, np.nan
        previous = record if carry and code == OK else None

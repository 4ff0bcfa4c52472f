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
from gearlib.engines.stable_repeats import proven

#: Events for which a record has room before it grows.
_FIRST_EVENTS = 64
#: Most equal steps in which `Base.sections` samples a mesh period.
_MAX_SECTION_SAMPLES = 360


class Base:
    """A model at one tuning; a subclass, named ``Propagator``, gives `go` and `fill_maps`."""

    #: Description of the motion between events.
    words = "closed forms"
    #: States that a thread takes at a time: many hide the hand-over, few share out slow runs.
    chunk = 16
    #: Components of the state, and pieces of a mesh period beside its phases of contact.
    components, pieces = 2, 0
    #: Whether periods of `run` are proven; else `stable_repeats` proves them.
    proves_periods = False

    def __init__(self, model: Any, tuning: float):
        self.model, self.tuning = model, tuning

    def at(self, tuning: float) -> "Base":
        """Return the engine at another tuning."""
        return type(self)(self.model, tuning)

    def start(self, state: Any) -> np.ndarray:
        """Return the state z for a displacement and dx/dtau at tau = 0."""
        return np.array(state, float)

    def run(self, z, span: Span, samples=0, first=0, keep_events=True) -> Record:
        """Run from z with so many samples in each recorded period; z stays.

        `first` is the mesh period of the excitation, which may repeat after several, in which the
        run begins. Events are recorded unless `keep_events` is False.
        """
        room = _FIRST_EVENTS if keep_events else 0
        tables = self.model.empty_record(span.recorded * samples, room)
        return self.go(np.array(z, float), span, *tables, first)

    def record(self, z, periods: int, max_events: int, samples=0) -> Record:
        """Run from z through mesh periods and record all of them."""
        return self.run(z, Span(periods, periods, max_events), samples)

    def go(self, z, span: Span, samples, events, summary, first: int) -> Record:
        """Run from z, which may change, and fill the tables."""
        raise NotImplementedError

    def maps(self, z, periods: int, max_events: int, first=0) -> tuple:
        """Return (end, maps, status): maps, (periods, size, size), linearise each mesh period.

        They are exact: phases of contact by their motion, flank crossings by saltation matrices,
        see `gearlib.engines.pair.maps`. If the status is not OK, they are NaN.
        """
        z = np.array(z, float)
        maps = np.empty((periods, z.size, z.size))
        code = self.fill_maps(z, periods, max_events, maps, first)
        if code != OK:
            maps[:] = np.nan
        return z, maps, code

    def fill_maps(self, z, periods: int, max_events: int, maps, first: int) -> int:
        """Fill the maps and take z to the end; return the status."""
        raise NotImplementedError

    def many(self, states, periods: int, max_events: int) -> tuple:
        """Take states, shape (k, size), through mesh periods; return their ends and statuses."""
        span = Span(periods, 1, max_events)
        records = [self.run(z, span, keep_events=False) for z in states]
        codes = np.array([record.status for record in records], np.int64)
        return np.array([record.state for record in records]).reshape(np.shape(states)), codes

    def sections(self, states, settle, phase, max_events: int, table, ends, codes) -> None:
        """Fill a table, shape (n, periods, 2), with states at one phase of every period.

        The n orbits start in `states`, shape (n, 2), and run `settle` periods before; `ends`, shape
        (n, 2), are their states after all periods. Here `phase` is a multiple of one degree.
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
        """Run ``tunings[order]`` and fill their rows, with `carry` from the state before each.

        All coordinates are carried, and the gears stay where they have turned to.
        """
        engine, repeats, passed = self, self.model.repeats, 0

        def run(tuning: float, before: Record | None) -> Record:
            nonlocal engine, passed
            engine, first = engine.at(tuning), passed if before else 0
            z = before.state if before else engine.start(state)
            record = engine.run(z, span, first=first, keep_events=False)
            passed = (first + span.periods) % repeats
            period = proven(engine, record.state, record.period, span.max_events, passed)
            return record._replace(period=period)

        run_each(run, tunings, order, carry, rows)


def run_each(run: Callable, tunings, order, carry: bool, rows: Rows) -> None:
    """Fill the rows of ``tunings[order]`` by ``run(tuning, record)``, a `Record`.

    The argument is the record before it, or None where a run begins anew.
    """
    before = None
    for i in order:
        record = run(float(tunings[i]), before)
        reach = np.abs(record.summary[..., [X_MAX, X_MIN]]).max()
        code = OVERFLOW if record.status == OK and reach > rows.bound else record.status
        rows.codes[i] = record.period, code
        if code == OK:
            rows.summaries[i], rows.ends[i] = record.summary, record.final
        else:
            rows.summaries[i], rows.ends[i] = np.nan, np.nan
        before = record if carry and code == OK else None

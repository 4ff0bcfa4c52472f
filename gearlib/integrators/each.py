"""Many tunings for a method that runs one: a loop, with or without the state carried along."""

import math

import numpy as np

from gearlib.data import status, summary
from gearlib.kernels import orbit


def run_each(run, tunings, order, state, carry, span, rows):
    """Run the tunings ``tunings[order]`` one after the other; see `gearlib.integrators`.

    ``run(tuning, state, periods, record_periods, samples, events, limit, summary)`` is one run of
    a method.
    """
    samples, events = np.empty((0, orbit.SAMPLE_COLUMNS)), np.empty((0, orbit.EVENT_COLUMNS))
    bound, summaries, ends, codes = rows
    current = state
    for i in order:
        x, v, period, _, _, code, _ = run(
            float(tunings[i]),
            current,
            span.periods,
            span.recorded,
            samples,
            events,
            span.limit,
            summaries[i],
        )
        if code == status.OK and summary.reach(summaries[i]) > bound:
            code = status.OVERFLOW
        ok = code == status.OK
        if not ok:
            summaries[i] = math.nan
        ends[i] = np.ravel([x, v]) if ok else math.nan
        codes[i] = period, code
        current = (x, v) if ok and carry else state

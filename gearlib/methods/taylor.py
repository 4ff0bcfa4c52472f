"""Taylor steps of order 20 that end at events: for every model of one degree of freedom."""

import math

import numpy as np

from gearlib import status
from gearlib.core import orbit
from gearlib.core.nonlinear import run_nonlinear
from gearlib.core.polynomial import bernstein_matrix
from gearlib.core.series import ORDER
from gearlib.models.one_degree import OneDegreePair
from gearlib.pair import GearPair

#: Truncation error of a step, in static deflections: that of rounding.
TOLERANCE = 1e-16
_TO_BERNSTEIN = bernstein_matrix(ORDER)


def takes(pair):
    """Return whether the model has one degree of freedom."""
    return isinstance(pair, (GearPair, OneDegreePair))


def run(pair, tuning, state, *arguments):
    """Run one tuning; see `gearlib.methods`."""
    if isinstance(pair, GearPair):
        pair = OneDegreePair(pair=pair)
    *result, _steps = run_nonlinear(pair.law(tuning, TOLERANCE), _TO_BERNSTEIN, *state, *arguments)
    return result


def run_many(
    pair, tunings, order, state, carry, periods, record_periods, limit, summaries, ends, codes
):
    """Run many tunings; see `gearlib.methods`."""
    samples, events = np.empty((0, orbit.SAMPLE_COLUMNS)), np.empty((0, orbit.EVENT_COLUMNS))
    current = state
    for i in order:
        x, v, period, _, _, code = run(
            pair,
            float(tunings[i]),
            current,
            periods,
            record_periods,
            samples,
            events,
            limit,
            summaries[i],
        )
        ok = code == status.OK
        if not ok:
            summaries[i] = math.nan
        ends[i] = (x, v) if ok else math.nan
        codes[i] = period, code
        current = (x, v) if ok and carry else state

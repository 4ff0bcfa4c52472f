"""Methods behind the one ``method=`` name: each says which models it takes, and runs them.

============  ==========================================================================
method        responsibility
============  ==========================================================================
``exact``     closed forms between events: linear damping, rectangular stiffness, one or
              six degrees of freedom
``taylor``    Taylor steps of order 20 that end at events: any model of one degree
============  ==========================================================================

A method module offers ``takes(pair)`` and

``run(pair, tuning, state, periods, record_periods, samples, events, limit, summary)``
    one run, arguments and returns as of `gearlib.core.run.run`;
``run_many(pair, tunings, order, state, carry, periods, record_periods, limit, summaries, ends,
codes)``
    many, as of `gearlib.core.many.run_many`.
"""

from gearlib import checks
from gearlib.methods import exact, taylor

METHODS = {"exact": exact, "taylor": taylor}


def choose(pair, method):
    """Return (name, module) of the method for a pair: the one named, or the first that takes it.

    Raises
    ------
    ValueError
        If the method is unknown or does not take the model.
    """
    able = [name for name, module in METHODS.items() if module.takes(pair)]
    if not able:
        raise ValueError(
            f"pair = {pair!r} is not allowed: it must be a GearPair, OneDegreePair or SixDegreePair"
        )
    if method is None:
        return able[0], METHODS[able[0]]
    checks.one_of("method", method, tuple(METHODS))
    if method not in able:
        raise ValueError(
            f"method = {method!r} is not allowed for a {type(pair).__name__}: it must be one of "
            f"{', '.join(map(repr, able))}"
        )
    return method, METHODS[method]

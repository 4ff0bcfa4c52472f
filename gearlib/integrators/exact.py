"""The exact propagator: closed forms between events, for linear damping and rectangular stiffness.

One degree of freedom goes by scalar closed forms; with harmonic excitation, and six degrees of
freedom, by matrix exponentials: see `gearlib.models.propagators`.
"""

from gearlib.integrators.each import run_each
from gearlib.models.propagators.stable_repeats import proven

ORDER = None
EVENTS = "phases end at switches and crossings, which are isolated by proof"
MODELS = "linear damping with rectangular stiffness, one or six degrees of freedom"
OPTIONS: dict = {}


def takes(pair):
    """Return whether the phases of a model have closed forms."""
    return "exact" in pair.propagators


def run(pair, tuning, state, *arguments):
    """Run one tuning; see `gearlib.integrators`."""
    propagator = pair.propagator(tuning, "exact")
    return propagator.run(propagator.start(state), *arguments)


def run_many(pair, tunings, order, state, *arguments):
    """Run many tunings; see `gearlib.integrators`."""
    kind, propagator, z, first = pair.kind("exact"), None, None, 0
    if kind.run_many is not None:
        return kind.run_many(pair, tunings, order, state, *arguments)

    def run_one(tuning, current, periods, *rest):
        nonlocal propagator, z, first
        propagator = propagator.at(tuning) if propagator else pair.propagator(tuning, "exact")
        # All coordinates are carried along, not only the two of the final state, and the gears stay
        # where they have turned to.
        if current is state:
            z, first = propagator.start(state), 0
        start, first = first, (first + periods) % pair.repeats
        done = propagator.run(z, periods, *rest, first=start)
        return *done[:2], proven(propagator, z, done[2], rest[3], first), *done[3:]

    run_each(run_one, tunings, order, state, *arguments)

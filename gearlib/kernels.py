"""From a checked gear pair to the arguments of the kernels."""

import numpy as np

from gearlib import checks
from gearlib.stiffness import levels, stretches

#: Most arcs (phases of contact and flights) in one mesh period before a run gives up.
MAX_EVENTS = 1_000_000

METHODS = ("exact",)


def ratios(pair):
    """Return the dimensionless ratios of a `GearPair`, shape (7,), in the order of `mesh`."""
    return np.array(
        [
            *levels(pair.contact_ratio, pair.stiffness_ratio),
            *stretches(pair.contact_ratio),
            pair.damping_ratio,
            pair.backlash_damping_ratio,
            pair.backlash_ratio,
        ]
    )


def check_tuning(name, value):
    """Return a tuning nu as float: finite and > 0."""
    return checks.finite_positive(name, value)


def check_run(periods, record_periods, initial_state, method, max_events):
    """Return the checked arguments that all runs share, in the same order.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    periods = checks.integer("periods", periods, 1)
    return (
        periods,
        checks.integer("record_periods", record_periods, 1, periods),
        checks.state("initial_state", initial_state),
        checks.one_of("method", method, METHODS),
        checks.integer("max_events", max_events, 1),
    )

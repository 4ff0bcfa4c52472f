"""Arguments that all runs share, checked."""

from gearlib import checks, integrators

#: Most arcs (phases of contact and flights; Taylor steps) in one mesh period before a run gives up.
MAX_EVENTS = 1_000_000


def check_tuning(name, value):
    """Return a tuning nu as float: finite and > 0."""
    return checks.finite_positive(name, value)


def check_run(pair, periods, record_periods, initial_state, method, options, max_events):
    """Return periods, record_periods, state, method name, module and options, max_events, checked.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    chosen = integrators.choose(pair, method, options)
    periods = checks.integer("periods", periods, 1)
    return (
        periods,
        checks.integer("record_periods", record_periods, 1, periods),
        pair.check_state(initial_state),
        *chosen,
        checks.integer("max_events", max_events, 1),
    )

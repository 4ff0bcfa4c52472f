"""Arguments that all runs share, checked."""

from gearlib import checks, integrators

#: Most arcs (phases of contact and flights; Taylor steps) in one mesh period before a run gives up.
MAX_EVENTS = 1_000_000


def check_tuning(name, value):
    """Return a tuning nu as float: finite and > 0."""
    return checks.finite_positive(name, value)


def tuning_of(model, tuning, speed):
    """Return the tuning of a run that is given by it or by a speed in rpm, one of both."""
    check_either(model, "tuning", tuning, "speed", speed)
    if speed is None:
        return check_tuning("tuning", tuning)
    return float(model.tuning_at(checks.finite_positive("speed", speed)))


def check_either(model, name, tuning, speed_name, speed):
    """Refuse neither and both of tunings and speeds, and speeds where nothing turns."""
    if (tuning is None) == (speed is None):
        raise ValueError(
            f"{name} = {tuning!r} with {speed_name} = {speed!r} is not allowed: it must be one of "
            "the two"
        )
    if speed is not None and model.speed is None:
        raise ValueError(
            f"{speed_name} = {speed!r} is not allowed: nothing turns in this model, so it must be "
            f"{name}"
        )


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

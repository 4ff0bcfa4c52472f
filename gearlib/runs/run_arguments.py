"""Arguments that all runs share, checked."""

from typing import Any, NamedTuple

from gearlib import checks, integrators
from gearlib.engines.orbit import Rows, Span

#: Most arcs (phases of contact and flights; Taylor steps) in one mesh period before a run gives up.
MAX_EVENTS = 1_000_000
#: Tunings beyond these have no motion that rounding leaves anything of.
LEAST_TUNING, MOST_TUNING = 1e-12, 1e5
#: Memory that the record of a run, or the rows of a sweep, may take at most, bytes.
MOST_MEMORY = 2_000_000_000


def check_tuning(name, value):
    """Return a tuning nu as float: finite, > 0, within what rounding leaves."""
    tuning = checks.finite_positive(name, value)
    return checks.number(name, tuning, f"from {LEAST_TUNING:g} to {MOST_TUNING:g}", allowed)


def allowed(tuning):
    """Return whether a tuning is within what rounding leaves, of a float or array; NaN is not."""
    return (tuning >= LEAST_TUNING) & (tuning <= MOST_TUNING)


def tuning_of(model, tuning, speed):
    """Return the tuning of a run that is given by it or by a speed in rpm, one of both."""
    check_either(model, "tuning", tuning, "speed", speed)
    if speed is None:
        return check_tuning("tuning", tuning)
    return check_speed(model, "speed", speed)


def check_speed(model, name, speed):
    """Return the tuning at a speed in rpm, which is refused where its tuning is not allowed."""
    return float(model.tuning_at(checks.speed(name, speed, float(model.speed(1.0)))))


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
    # The units of `GearPair.from_ratios`.
    if speed is not None and model.static_deflection == model.mesh_frequency(1.0) == 1.0:
        raise ValueError(
            f"{speed_name} = {speed!r} is not allowed: the model is dimensionless, without a scale "
            f"of time, so it must be {name}"
        )


def check_memory(words, count, numbers, unit):
    """Refuse so many rows of numbers that they take too much memory; `words` say what asks them."""
    most = MOST_MEMORY // (8 * numbers)
    if count > most:
        raise ValueError(
            f"{words} is not allowed: it must be <= {most:,} {unit} to stay within "
            f"{MOST_MEMORY / 1e9:g} GB of memory"
        )


def check_rows(model, words, count):
    """Refuse so many tunings that a sweep of a model takes too much memory."""
    numbers = model.empty_record()[2].size + len(model.components) + len(Rows._fields)
    check_memory(words, count, numbers, "tunings")


class Asked(NamedTuple):
    """What is asked of a run, checked."""

    span: Span
    state: tuple
    method: str
    module: Any
    options: dict

    def attributes(self):
        """Return what a dataset says of it."""
        periods, recorded, _ = self.span
        said = {"method": self.method, "options": self.options, "initial_state": self.state}
        return said | {"periods": periods, "record_periods": recorded}


def check_run(
    model, periods, record_periods, initial_state, method=None, options=None, max_events=MAX_EVENTS
):
    """Return the arguments of a run as `Asked`; ValueError names argument, value and range."""
    chosen = integrators.choose(model, method, options)
    periods = checks.integer("periods", periods, 1)
    recorded = checks.integer("record_periods", record_periods, 1, periods)
    state = model.check_state(initial_state)
    span = Span(periods, recorded, checks.integer("max_events", max_events, 1))
    return Asked(span, state, *chosen)

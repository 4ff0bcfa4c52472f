"""Arguments that all runs share, checked."""

from typing import Any, NamedTuple

from gearlib import checks, integrators
from gearlib.engines.orbit import Rows, Span

#: Default limit of arcs (phases of contact, flights, Taylor steps) in one mesh period.
MAX_EVENTS = 1_000_000
#: Range of tunings: rounding spoils all digits of motions beyond it.
MIN_TUNING, MAX_TUNING = 1e-12, 1e5
#: Largest memory of the record of a run or of the rows of a sweep, bytes.
MAX_MEMORY = 2_000_000_000


def check_tuning(name, value):
    """Return a tuning nu as float, or raise ValueError if it is out of range."""
    tuning = checks.finite_positive(name, value)
    return checks.number(name, tuning, f"from {MIN_TUNING:g} to {MAX_TUNING:g}", allowed)


def allowed(tuning):
    """Return whether tunings, a float or an array, are in the allowed range; NaN is not."""
    return (tuning >= MIN_TUNING) & (tuning <= MAX_TUNING)


def tuning_of(model, tuning, speed):
    """Return the tuning of a run from the argument `tuning` or the argument `speed`, rpm."""
    check_either(model, "tuning", tuning, "speed", speed)
    if speed is None:
        return check_tuning("tuning", tuning)
    return check_speed(model, "speed", speed)


def check_speed(model, name, speed):
    """Return the tuning at a speed in rpm, or raise ValueError if it is out of range."""
    return float(model.tuning_at(checks.speed(name, speed, float(model.speed(1.0)))))


def check_either(model, name, tuning, speed_name, speed):
    """Raise ValueError unless one of tunings and speeds is given and the model has speeds."""
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


def check_memory(argument, count, numbers, unit):
    """Raise ValueError if `count` rows with so many numbers each need too much memory.

    `argument` describes the argument that causes them, `unit` is the name of a row.
    """
    max_rows = MAX_MEMORY // (8 * numbers)
    if count > max_rows:
        raise ValueError(
            f"{argument} is not allowed: it must be <= {max_rows:,} {unit} to stay within "
            f"{MAX_MEMORY / 1e9:g} GB of memory"
        )


def check_rows(model, argument, count):
    """Raise ValueError if a sweep of a model over so many tunings needs too much memory."""
    numbers = model.empty_record()[2].size + len(model.components) + len(Rows._fields)
    check_memory(argument, count, numbers, "tunings")


class RunArguments(NamedTuple):
    """Checked arguments of a run."""

    span: Span
    state: tuple
    method: str
    module: Any
    options: dict

    def attributes(self):
        """Return the arguments as attributes of a dataset."""
        periods, recorded, _ = self.span
        return {
            "method": self.method,
            "options": self.options,
            "initial_state": self.state,
            "periods": periods,
            "record_periods": recorded,
        }


def check_run(
    model, periods, record_periods, initial_state, method=None, options=None, max_events=MAX_EVENTS
):
    """Return the checked arguments of a run, or raise ValueError with the name and the range."""
    chosen = integrators.choose(model, method, options)
    periods = checks.integer("periods", periods, 1)
    recorded = checks.integer("record_periods", record_periods, 1, periods)
    state = model.check_state(initial_state)
    span = Span(periods, recorded, checks.integer("max_events", max_events, 1))
    return RunArguments(span, state, *chosen)

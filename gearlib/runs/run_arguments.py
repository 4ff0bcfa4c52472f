"""Types and checks of the arguments that all runs share."""

from typing import Annotated, Any, Literal, NamedTuple, get_args

from annotated_types import Ge, Le

from gearlib import checks, integrators, parameters
from gearlib.engines.orbit import Rows, Span
from gearlib.models.model import is_model
from gearlib.parameters import CHOICE, Count, Positive, Speed, Unit

#: Default limit of arcs (phases of contact, flights, Taylor steps) in one mesh period.
MAX_EVENTS = 1_000_000
#: Range of tunings: outside it rounding errors are as large as the motion.
MIN_TUNING, MAX_TUNING = 1e-12, 1e5
#: Largest memory of the record of a run or of the rows of a sweep, bytes.
MAX_MEMORY = 2_000_000_000

Tuning = Annotated[float, Ge(MIN_TUNING), Le(MAX_TUNING), Unit("1")]
#: How each run of a sweep starts: from the same state, or from the end of the run before.
Direction = Annotated[Literal["cold", "up", "down"], CHOICE]
DIRECTIONS = get_args(get_args(Direction)[0])
Threads = Count | None
MaxSeconds = Positive | None


def check_tuning(name: str, value: float) -> float:
    """Return the tuning given as argument `name`; raise ValueError if it is out of range."""
    return parameters.check(name, value, Tuning)


def is_valid_tuning(tuning):
    """Return whether a tuning, or each tuning of an array, lies in the allowed range."""
    return (tuning >= MIN_TUNING) & (tuning <= MAX_TUNING)


def tuning_of(model, tuning: float | None, speed: float | None) -> float:
    """Return the checked tuning of a run for a tuning or a speed in rpm; the other one is None."""
    check_either(model, "tuning", tuning, "speed", speed)
    return tuning_at_speed(model, "speed", speed) if tuning is None else tuning


def tuning_at_speed(model, name: str, speed: float) -> float:
    """Return the tuning of a model at a speed in rpm; raise ValueError if the speed is invalid.

    `name` is the name of the argument in the error message.
    """
    speed_at_resonance = float(model.speed(1.0))
    speed = parameters.check(name, speed, Speed)
    return float(model.tuning_at(checks.checked_speed(name, speed, speed_at_resonance)))


def check_either(model, tuning_name: str, tuning, speed_name: str, speed):
    """Raise ValueError unless exactly one of a tuning and a speed is given (the other is None).

    `tuning_name` and `speed_name` are the names of these arguments in the error message. A speed is
    refused for a model without rotating bodies or without a time scale.
    """
    checks.require(is_model(model), "model", model, "a model such as GearPair")
    checks.exactly_one(tuning_name, tuning, speed_name, speed)
    if speed is not None:
        allowed = f"{tuning_name}, because nothing turns in this model"
        checks.require(model.speed is not None, speed_name, speed, allowed)
        # These are the scales of a pair made by `GearPair.from_ratios`.
        has_time = not model.static_deflection == model.mesh_frequency(1.0) == 1.0
        allowed = f"{tuning_name}, because the model is dimensionless, without a scale of time"
        checks.require(has_time, speed_name, speed, allowed)


def check_memory(argument: str, row_count: int, numbers_per_row: int, row_name: str):
    """Raise ValueError if a table of `row_count` rows needs more than `MAX_MEMORY` bytes.

    In the message, `argument` describes the argument that determines the size of the table, and
    `row_name` is the name of its rows, such as "samples".
    """
    max_rows = MAX_MEMORY // (8 * numbers_per_row)
    if row_count > max_rows:
        raise ValueError(
            f"{argument} is not allowed: it must be <= {max_rows:,} {row_name} to stay within "
            f"{MAX_MEMORY / 1e9:g} GB of memory"
        )


def check_rows(model, argument: str, tuning_count: int):
    """Raise ValueError if the results of a sweep over `tuning_count` tunings need too much memory.

    `argument` describes the sweep in the error message.
    """
    _, _, summary = model.empty_record()
    # A row also has the final state, and at most one number for each field of `Rows`.
    numbers_per_tuning = summary.size + len(model.components) + len(Rows._fields)
    check_memory(argument, tuning_count, numbers_per_tuning, "tunings")


class RunArguments(NamedTuple):
    """Validated arguments of a run."""

    span: Span  #: mesh periods of the run, of its record, and the limit of arcs per mesh period
    state: tuple  #: initial state
    method: str
    module: Any  #: module of `gearlib.integrators` that implements the method
    options: dict  #: options of the method

    def attributes(self) -> dict:
        """Return the arguments as attributes of a dataset, a dict of name to value."""
        periods, recorded, _max_events = self.span
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
    """Validate the arguments of `simulate` for a model and return them as `RunArguments`."""
    method_name, module, options = integrators.choose_method(model, method, options)
    allowed = f"an integer from 1 to {periods}"
    checks.require(record_periods <= periods, "record_periods", record_periods, allowed)
    state = model.check_state(initial_state)
    span = Span(periods, record_periods, max_events)
    return RunArguments(span, state, method_name, module, options)

"""Types and checks of the arguments shared by `simulate`, `sweep` and other functions."""

from typing import Annotated, Any, Literal, NamedTuple, get_args

from annotated_types import Ge, Le

from gearlib import checks, integrators, parameters
from gearlib.engines.orbit import Span, SweepTables
from gearlib.models.model import is_model
from gearlib.parameters import CHOICE, Count, Positive, Speed, Unit

#: Default limit of the number of arcs (intervals of contact or free flight, Taylor steps) in one
#: mesh period.
MAX_EVENTS = 1_000_000
#: Range of tunings; outside this range rounding errors are as large as the motion.
MIN_TUNING, MAX_TUNING = 1e-12, 1e5
#: Largest memory for the record of a run or the rows of a sweep in bytes.
MAX_MEMORY = 2_000_000_000

Tuning = Annotated[float, Ge(MIN_TUNING), Le(MAX_TUNING), Unit("1")]
#: Initial state of each run of a sweep: a common state ("cold"), or the final state of the previous
#: run for increasing ("up") or decreasing ("down") values.
Direction = Annotated[Literal["cold", "up", "down"], CHOICE]
DIRECTIONS = get_args(get_args(Direction)[0])
Threads = Count | None
MaxSeconds = Positive | None


def check_tuning(name: str, value: float) -> float:
    """Return a tuning as a float, or raise ValueError if it is out of range.

    `name` is the name of the argument in the error message.
    """
    return parameters.check(name, value, Tuning)


def is_valid_tuning(tuning):
    """Return whether a tuning, or each tuning in an array, lies in the allowed range."""
    return (tuning >= MIN_TUNING) & (tuning <= MAX_TUNING)


def tuning_of(model, tuning: float | None, speed: float | None) -> float:
    """Return the tuning of a run that is given either as a tuning or as a speed in rpm.

    The tuning is the ratio of mesh frequency to natural frequency of the model. The other argument
    must be None; otherwise, or if the speed is invalid, raise ValueError.
    """
    require_tuning_or_speed(model, "tuning", tuning, "speed", speed)
    return tuning_at_speed(model, "speed", speed) if tuning is None else tuning


def tuning_at_speed(model, name: str, speed: float) -> float:
    """Convert a speed in rpm to the tuning of a model, or raise ValueError if it is invalid.

    The tuning is the ratio of mesh frequency to natural frequency, 1 at the resonance speed. `name`
    is the name of the argument in the error message.
    """
    resonance_speed = float(model.speed(1.0))
    speed = parameters.check(name, speed, Speed)
    speed = checks.check_speed(name, speed, resonance_speed)
    return float(model.tuning_at(speed))


def require_tuning_or_speed(model, tuning_name: str, tuning, speed_name: str, speed):
    """Raise ValueError unless either a tuning or a speed is given and the other one is None.

    The tuning is the ratio of mesh frequency to natural frequency, and the speed is in rpm; both
    may be numbers or arrays. `tuning_name` and `speed_name` are their names in the error message. A
    speed is not allowed for a model without rotating bodies or for a dimensionless model, which has
    no time scale.
    """
    checks.require(is_model(model), "model", model, "a model such as GearPair")
    checks.require_exactly_one(tuning_name, tuning, speed_name, speed)
    if speed is not None:
        allowed = f"None (use {tuning_name}), because this model has no rotating bodies"
        checks.require(model.speed is not None, speed_name, speed, allowed)
        # `GearPair.from_ratios` creates a dimensionless model, whose scales are 1.
        is_dimensionless = model.static_deflection == model.mesh_frequency(1.0) == 1.0
        allowed = (
            f"None (use {tuning_name}), because the model is dimensionless, without time scale"
        )
        checks.require(not is_dimensionless, speed_name, speed, allowed)


def check_memory(argument: str, row_count: int, numbers_per_row: int, row_name: str):
    """Raise ValueError if a table of floats needs more than `MAX_MEMORY` bytes.

    The table has `row_count` rows of `numbers_per_row` floats. In the message, `argument` describes
    the argument that determines the number of rows, e.g. "samples = 1000", and `row_name` is the
    plural name of the rows, e.g. "samples".
    """
    max_rows = MAX_MEMORY // (8 * numbers_per_row)
    if row_count > max_rows:
        raise ValueError(
            f"{argument} is too large: at most {max_rows:,} {row_name} are allowed, to stay within "
            f"{MAX_MEMORY / 1e9:g} GB of memory"
        )


def check_sweep_memory(model, argument: str, tuning_count: int):
    """Raise ValueError if the results of a sweep over `tuning_count` tunings need too much memory.

    The results have one row of numbers per tuning. `argument` describes the sweep in the error
    message, e.g. "a sweep of 1000 tunings".
    """
    _, _, summary_table = model.empty_record()
    # A row also contains the final state, and at most one number for each field of `SweepTables`.
    numbers_per_tuning = summary_table.size + len(model.components) + len(SweepTables._fields)
    check_memory(argument, tuning_count, numbers_per_tuning, "tunings")


class RunArguments(NamedTuple):
    """Validated arguments of a run."""

    span: Span  #: mesh periods of the run and of its record, and largest number of arcs per period
    state: tuple  #: initial state
    method: str  #: name of the method, one of `gearlib.methods`
    module: Any  #: module of `gearlib.integrators` that implements the method
    options: dict  #: options of the method

    def attributes(self) -> dict:
        """Return the arguments as attributes of a dataset, {name: value}, without max_events."""
        periods, record_periods, _max_events = self.span
        return {
            "method": self.method,
            "options": self.options,
            "initial_state": self.state,
            "periods": periods,
            "record_periods": record_periods,
        }


def check_run_arguments(
    model, periods, record_periods, initial_state, method=None, options=None, max_events=MAX_EVENTS
):
    """Validate the arguments of a run of a model and return them as `RunArguments`.

    A run has `periods` mesh periods, of which the last `record_periods` are recorded, and starts
    from `initial_state`, a tuple of displacement and velocity or the name of a state. `method` is
    the name of an integration method, or None for the default method of the model, and `options`
    are its options or None. A mesh period may have at most `max_events` contact events. Raise
    ValueError if an argument is invalid.
    """
    method_name, module, options = integrators.choose_method(model, method, options)
    allowed = f"an integer from 1 to {periods}"
    checks.require(record_periods <= periods, "record_periods", record_periods, allowed)
    state = model.check_state(initial_state)
    span = Span(periods, record_periods, max_events)
    return RunArguments(span, state, method_name, module, options)

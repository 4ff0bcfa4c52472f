"""Checks of values, and the error that says which value is wrong and what it must be."""

import math
from collections.abc import Hashable, Mapping
from contextlib import contextmanager
from numbers import Integral, Real

#: Tunings of the slowest and the fastest allowed speed, as in the configuration.
MIN_SPEED_TUNING, MAX_SPEED_TUNING = 1e-12, 100.0
#: Largest integer of numpy and of compiled code.
_MAX_INTEGER = 2**63 - 1


class InputError(ValueError):
    """A wrong value; its text is one sentence that names place, value and what is allowed.

    `path` is the place of the value, such as "wheel.tip_relief.length"; `requirement` says what the
    value must be, as in "a finite number > 0". A `problem` such as "is missing: it must be given"
    replaces the words about the value. `owner` is the part that has the value, such as "body sun".
    """

    def __init__(self, path, value=None, requirement="", problem="", owner=""):
        super().__init__(path, value, requirement, problem, owner)
        self.path, self.value, self.requirement = path, value, requirement
        self.problem, self.owner = problem, owner

    def __str__(self):
        place = f"{self.path} of {self.owner}" if self.owner else self.path
        return f"{place} {self.problem or problem_of(repr(self.value), self.requirement)}"


def problem_of(value_text, requirement):
    """Return the end of a sentence about a wrong value, after its place."""
    return f"= {value_text} is not allowed: it must be {requirement}"


@contextmanager
def below(section, owner="", **names):
    """Return a context that puts the paths of errors below a section such as "gears.wheel".

    `names` maps paths or their first names to places of their own; values without such a name are
    those of `owner`, if it is given.
    """
    try:
        yield
    except InputError as error:
        first, dot, rest = error.path.partition(".")
        owner = owner or error.owner
        if error.path in names:
            path, owner = names[error.path], ""
        elif first in names:
            path, owner = f"{names[first]}{dot}{rest}", ""
        else:
            path = f"{section}{'.' if section and error.path[:1] != '[' else ''}{error.path}"
        raise InputError(path, error.value, error.requirement, error.problem, owner) from None


def refusal(name, value, allowed, owner=""):
    """Return the error for a wrong value; the text `allowed` says what it must be."""
    return InputError(name, value, allowed, owner=owner)


def require(condition, name, value, allowed, owner=""):
    """Raise the error of `refusal` unless the condition holds."""
    if not condition:
        raise refusal(name, value, allowed, owner)


def exactly_one(first_name, first, second_name, second):
    """Raise an error unless one of two values is None, and the other is not."""
    if first is None and second is None:
        problem = f"and {second_name} are missing: one of the two must be given"
        raise InputError(first_name, problem=problem)
    if first is not None and second is not None:
        values = f"= {first!r} with {second_name} = {second!r}"
        problem = f"{values} is not allowed: it must be one of the two"
        raise InputError(first_name, first, problem=problem)


def number(name, value, allowed, accept):
    """Return `value` as float if it is real and accepted by `accept`, else raise ValueError.

    The function `accept` is not called with NaN; the text `allowed` says what it accepts.
    """
    # numpy's scalars are Real; booleans are, too, but True is no stiffness.
    if isinstance(value, Real) and not isinstance(value, bool):
        try:
            result = float(value)
        except OverflowError:
            result = math.nan
        if not math.isnan(result) and accept(result):
            return result
    raise refusal(name, value, allowed)


def finite_positive(name, value):
    """Return `value` as float if it is finite and > 0, else raise ValueError."""
    return number(name, value, "a finite number > 0", lambda v: 0.0 < v < math.inf)


def finite_nonnegative(name, value):
    """Return `value` as float if it is finite and >= 0, else raise ValueError."""
    return number(name, value, "a finite number >= 0", lambda v: 0.0 <= v < math.inf)


def checked_speed(name, value, resonance_speed):
    """Return a speed in rpm as float if its tuning, speed / `resonance_speed`, is allowed."""
    low, high = MIN_SPEED_TUNING * resonance_speed, MAX_SPEED_TUNING * resonance_speed
    limits = f"from {low:.3g} to {high:.3g} rpm, a tuning of at most {MAX_SPEED_TUNING:g}"
    allowed = f"a finite number > 0, {limits}"
    return number(name, value, allowed, lambda v: low <= v <= high)


def require_damping(value, owner=""):
    """Return the damping in contact, or raise ValueError if it is None; `owner` is " of mesh a"."""
    if value is None:
        raise ValueError(
            f"damping_ratio{owner} is missing: it must be a finite number >= 0 and < 1 where gears "
            "move, or logarithmic_decrement or material_damping in its place"
        )
    return value


def integers(low, high=None):
    """Return a description of the integers from `low` to `high`, both included."""
    return f"an integer >= {low}" if high is None else f"an integer from {low} to {high}"


def integer(name, value, low, high=None):
    """Return `value` as int if it is an integer from `low` to `high`, else raise ValueError."""
    limit = _MAX_INTEGER if high is None else high
    # The largest integer of the computer is named only where it is exceeded.
    is_integer = isinstance(value, Integral) and not isinstance(value, bool)
    if is_integer and low <= value <= limit:
        return int(value)
    raise refusal(name, value, integers(low, limit if is_integer and value > limit else high))


def is_one_of(value, choices):
    """Return whether `value` is one of `choices`; tables, whose == gives no bool, are none."""
    return isinstance(value, Hashable) and value in tuple(choices)


def one_of(name, value, choices):
    """Return `value` if it is one of `choices`, else raise ValueError."""
    require(is_one_of(value, choices), name, value, f"one of {', '.join(map(repr, choices))}")
    return value


def finite(name, values):
    """Return a sequence of finite numbers as a tuple of floats, else raise ValueError."""
    items = enumerate(sequence(name, values))
    return tuple(number(f"{name}[{i}]", value, "finite", math.isfinite) for i, value in items)


def sequence(name, values, length=None, allowed="a sequence of numbers"):
    """Return an iterable as a list, or raise ValueError if it has not this length."""
    allowed = allowed if length is None else f"{length} values"
    # Their entries are letters, names or in no order.
    if isinstance(values, str | bytes | Mapping | set | frozenset):
        raise refusal(name, values, allowed)
    try:
        items = list(values)
    except TypeError:
        raise refusal(name, values, allowed) from None
    require(length in (None, len(items)), name, values, allowed)
    return items


def numbers(name, values, length):
    """Return `length` real numbers, which may be infinite, as a list, else raise ValueError."""
    items = enumerate(sequence(name, values, length))
    return [number(f"{name}[{i}]", value, "a number", lambda v: True) for i, value in items]


def options(value):
    """Return options, a mapping or None, as a dict, else raise ValueError."""
    require(isinstance(value, Mapping | None), "options", value, "a mapping of names")
    return dict(value or {})


def gear_stage(value, name="stage", alternative=""):
    """Return a `gearlib.geometry.GearStage`, else raise ValueError; `alternative` is " or a
    dict"."""
    allowed = f"a gearlib.geometry.GearStage{alternative}"
    # The class itself would load the numerical stack.
    require(hasattr(value, "pair_parameters"), name, value, allowed)
    return value


def check_known_parameters(owner, names, known_names):
    """Raise ValueError unless all `names` are among the `known_names` of parameters of `owner`."""
    for name in names:
        if name not in known_names:
            problem = f"is not allowed: the parameters of a {owner} are {', '.join(known_names)}"
            raise InputError(name, problem=problem)


def state(name, value):
    """Return an initial state as a tuple of two finite floats, else raise ValueError."""
    try:
        return finite(name, sequence(name, value, 2))
    except ValueError:
        allowed = "two finite numbers (displacement in static deflections, dx/dtau)"
        raise refusal(name, value, allowed) from None

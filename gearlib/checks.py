"""Checks of values, and the error that says which value is wrong and what it must be."""

from collections.abc import Hashable, Mapping
from contextlib import contextmanager

#: Tunings of the slowest and the fastest allowed speed, as in the configuration.
MIN_SPEED_TUNING, MAX_SPEED_TUNING = 1e-12, 100.0


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


def checked_speed(name, value, resonance_speed):
    """Return a finite speed in rpm, or raise an error unless its tuning is allowed."""
    low, high = MIN_SPEED_TUNING * resonance_speed, MAX_SPEED_TUNING * resonance_speed
    limits = f"from {low:.3g} to {high:.3g} rpm, a tuning of at most {MAX_SPEED_TUNING:g}"
    allowed = f"a finite number > 0, {limits}"
    require(low <= value <= high, name, value, allowed)
    return value


def require_damping(value, owner=""):
    """Return the damping in contact, or raise ValueError if it is None; `owner` is " of mesh a"."""
    if value is None:
        raise ValueError(
            f"damping_ratio{owner} is missing: it must be a finite number >= 0 and < 1 where gears "
            "move, or logarithmic_decrement or material_damping in its place"
        )
    return value


def is_one_of(value, choices):
    """Return whether `value` is one of `choices`; tables, whose == gives no bool, are none."""
    return isinstance(value, Hashable) and value in tuple(choices)


def one_of(name, value, choices):
    """Return `value` if it is one of `choices`, else raise ValueError."""
    require(is_one_of(value, choices), name, value, f"one of {', '.join(map(repr, choices))}")
    return value


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


def train_of(model):
    """Return the `GearTrain` of a train or of a pair in six degrees, else raise ValueError."""
    train = getattr(model, "train", None)
    if train is None:
        allowed = "a GearTrain, because it needs bodies with torques and angles"
        problem = f"of type {type(model).__name__} is not allowed: it must be {allowed}"
        raise InputError("model", problem=problem)
    return train


def check_known_parameters(owner, names, known_names):
    """Raise ValueError unless all `names` are among the `known_names` of parameters of `owner`."""
    for name in names:
        if name not in known_names:
            problem = f"is not allowed: the parameters of a {owner} are {', '.join(known_names)}"
            raise InputError(name, problem=problem)

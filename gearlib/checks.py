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
    """Return the end of a sentence about a wrong value, which begins with the name of the value.

    `value_text` is the value as text, `requirement` says which values are allowed.
    """
    return f"= {value_text} is not allowed: it must be {requirement}"


@contextmanager
def below(section, owner="", **names):
    """Return a context in which paths of `InputError`s are completed by a section.

    In the section "gears.wheel", an error of "module" becomes an error of "gears.wheel.module".
    `names` maps paths, or first names of paths, to complete places, which replace them. `owner` is
    the part, such as "body sun", that has the other values.
    """
    try:
        yield
    except InputError as error:
        path, owner = error.path, owner or error.owner
        for name, place in names.items():
            if path == name or path.startswith(f"{name}."):
                path, owner = place + path[len(name) :], ""
                break
        else:
            path = f"{section}{'.' if section and path[:1] != '[' else ''}{path}"
        raise InputError(path, error.value, error.requirement, error.problem, owner) from None


def refusal(name, value, allowed, owner=""):
    """Return the `InputError` for a wrong value.

    `name` is the place of the value, the text `allowed` says what it must be, `owner` is the part
    that has it.
    """
    return InputError(name, value, allowed, owner=owner)


def require(condition, name, value, allowed, owner=""):
    """Raise the `InputError` of a wrong value unless the condition holds, see `refusal`."""
    if not condition:
        raise refusal(name, value, allowed, owner)


def exactly_one(name, value, other_name, other_value):
    """Raise an error unless exactly one of two values is given, the other being None.

    The message names them `name` and `other_name`.
    """
    if value is None and other_value is None:
        problem = f"and {other_name} are missing: one of the two must be given"
        raise InputError(name, problem=problem)
    if value is not None and other_value is not None:
        values = f"= {value!r} with {other_name} = {other_value!r}"
        problem = f"{values} is not allowed: it must be one of the two"
        raise InputError(name, value, problem=problem)


def checked_speed(name, value, resonance_speed):
    """Return the speed `value`, rpm, or raise an error unless its tuning is allowed.

    The tuning is the ratio of the speed to `resonance_speed`, rpm.
    """
    low, high = MIN_SPEED_TUNING * resonance_speed, MAX_SPEED_TUNING * resonance_speed
    limits = f"from {low:.3g} to {high:.3g} rpm, a tuning of at most {MAX_SPEED_TUNING:g}"
    allowed = f"a finite number > 0, {limits}"
    require(low <= value <= high, name, value, allowed)
    return value


def require_damping(value, owner=""):
    """Return the damping in contact, `value`, or raise ValueError if it is None.

    `owner` is the end of its name in the message, such as " of mesh a".
    """
    if value is None:
        raise ValueError(
            f"damping_ratio{owner} is missing: it must be a finite number >= 0 and < 1 where gears "
            "move, or logarithmic_decrement or material_damping in its place"
        )
    return value


def is_one_of(value, choices):
    """Return whether `value` is one of `choices`, False if it is not hashable.

    Arrays and tables, for example, are not hashable, and their == returns no bool.
    """
    return isinstance(value, Hashable) and value in tuple(choices)


def one_of(name, value, choices):
    """Return `value` if it is one of `choices`, else raise ValueError."""
    require(is_one_of(value, choices), name, value, f"one of {', '.join(map(repr, choices))}")
    return value


def sequence(name, values, length=None, allowed="a sequence of numbers"):
    """Return an iterable as a list, or raise ValueError if it is not a sequence of this length.

    `name` is the place of `values`. With None as `length` any length is allowed, and `allowed` says
    in the message what the values must be.
    """
    allowed = allowed if length is None else f"{length} values"
    # Entries of these types are letters, names or unordered.
    if isinstance(values, str | bytes | Mapping | set | frozenset):
        raise refusal(name, values, allowed)
    try:
        items = list(values)
    except TypeError:
        raise refusal(name, values, allowed) from None
    require(length in (None, len(items)), name, values, allowed)
    return items


def options(value):
    """Return `value`, a mapping of options or None, as a dict, else raise ValueError."""
    require(isinstance(value, Mapping | None), "options", value, "a mapping of names")
    return dict(value or {})


def gear_stage(value, name="stage", alternative=""):
    """Return `value` if it is a `gearlib.geometry.GearStage`, else raise ValueError.

    `alternative` is a text such as " or a dict", for callers that also take other values.
    """
    allowed = f"a gearlib.geometry.GearStage{alternative}"
    # An import of the class would load the numerical stack.
    require(hasattr(value, "pair_parameters"), name, value, allowed)
    return value


def train_of(model):
    """Return the `GearTrain` of a model, or raise ValueError.

    Models that have one are trains and pairs in six degrees of freedom.
    """
    train = getattr(model, "train", None)
    if train is None:
        allowed = "a GearTrain, because it needs bodies with torques and angles"
        problem = f"of type {type(model).__name__} is not allowed: it must be {allowed}"
        raise InputError("model", problem=problem)
    return train


def check_known_parameters(owner, names, known_names):
    """Raise ValueError unless all `names` are parameters of the type `owner`, its `known_names`."""
    for name in names:
        if name not in known_names:
            problem = f"is not allowed: the parameters of a {owner} are {', '.join(known_names)}"
            raise InputError(name, problem=problem)

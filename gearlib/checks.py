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
        """Store the wrong value, its place `path`, and what it must be.

        The docstring of the class describes the arguments.
        """
        super().__init__(path, value, requirement, problem, owner)
        self.path, self.value, self.requirement = path, value, requirement
        self.problem, self.owner = problem, owner

    def __str__(self):
        """Return the error as a sentence: place and owner, then `problem` or value and rule."""
        place = f"{self.path} of {self.owner}" if self.owner else self.path
        return f"{place} {self.problem or problem_of(repr(self.value), self.requirement)}"


def problem_of(value_text, requirement):
    """Return the end of an error message, "= VALUE is not allowed: it must be REQUIREMENT".

    The caller writes the name of the value before this text. `value_text` is the value as text,
    such as "-1"; `requirement` says which values are allowed, such as "a finite number > 0".
    """
    return f"= {value_text} is not allowed: it must be {requirement}"


@contextmanager
def below(section, owner="", **names):
    """Return a context that completes the place (`path`) in each `InputError` raised inside it.

    The name `section` is put before the path: in the section "gears.wheel" the path "module"
    becomes "gears.wheel.module". Each keyword in `names` is a path, or the first name of paths,
    that is replaced by its complete place instead. `owner` is the part, such as "body sun", to
    which the message attributes the other values.
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
    """Return the `InputError` for a wrong value; the caller raises it.

    `name` is the place of the value, such as "wheel.module"; the string `allowed` says what it must
    be, such as "a number > 0"; `owner` is the part that has the value, such as "body sun".
    """
    return InputError(name, value, allowed, owner=owner)


def require(condition, name, value, allowed, owner=""):
    """Raise an `InputError` for `value` unless `condition` is true.

    `name` is the place of the value, such as "wheel.module"; the string `allowed` says what it must
    be, such as "a number > 0"; `owner` is the part that has the value, such as "body sun".
    """
    if not condition:
        raise refusal(name, value, allowed, owner)


def exactly_one(name, value, other_name, other_value):
    """Raise an `InputError` unless exactly one of two alternative values is given (is not None).

    `name` and `other_name` are the names of `value` and `other_value` in the message.
    """
    if value is None and other_value is None:
        problem = f"and {other_name} are missing: one of the two must be given"
        raise InputError(name, problem=problem)
    if value is not None and other_value is not None:
        values = f"= {value!r} with {other_name} = {other_value!r}"
        problem = f"{values} is not allowed: it must be one of the two"
        raise InputError(name, value, problem=problem)


def checked_speed(name, value, resonance_speed):
    """Return the speed `value` (rpm), or raise an `InputError` if it is far too low or too high.

    The ratio of the speed to `resonance_speed` (rpm), which is called tuning, must lie between the
    constants `MIN_SPEED_TUNING` and `MAX_SPEED_TUNING`. `name` is the place of the value, which the
    message states.
    """
    low, high = MIN_SPEED_TUNING * resonance_speed, MAX_SPEED_TUNING * resonance_speed
    limits = f"from {low:.3g} to {high:.3g} rpm, a tuning of at most {MAX_SPEED_TUNING:g}"
    allowed = f"a finite number > 0, {limits}"
    require(low <= value <= high, name, value, allowed)
    return value


def require_damping(value, owner=""):
    """Return the damping `value` of gears in contact, or raise ValueError if it is None.

    `owner` is text that follows the name of the parameter in the message, such as " of mesh a".
    """
    if value is None:
        raise ValueError(
            f"damping_ratio{owner} is missing: it must be a finite number >= 0 and < 1 where gears "
            "move, or logarithmic_decrement or material_damping in its place"
        )
    return value


def is_one_of(value, choices):
    """Return whether `value` is one of `choices`; False for values that are not hashable.

    Unhashable values such as arrays and tables must not be compared, because their == does not
    return a bool.
    """
    return isinstance(value, Hashable) and value in tuple(choices)


def one_of(name, value, choices):
    """Return `value` if it is one of `choices`, else raise an `InputError` for the place `name`."""
    require(is_one_of(value, choices), name, value, f"one of {', '.join(map(repr, choices))}")
    return value


def sequence(name, values, length=None, allowed="a sequence of numbers"):
    """Return an iterable as a list, or raise an `InputError` if it is no sequence of this length.

    `name` is the place of `values`, which the message states. With None as `length` any length is
    allowed, and the string `allowed` says in the message what the values must be.
    """
    allowed = allowed if length is None else f"{length} values"
    # These types are iterable, too, but their entries are single letters, names or unordered.
    if isinstance(values, str | bytes | Mapping | set | frozenset):
        raise refusal(name, values, allowed)
    try:
        items = list(values)
    except TypeError:
        raise refusal(name, values, allowed) from None
    require(length in (None, len(items)), name, values, allowed)
    return items


def options(value):
    """Return a mapping of options as a dict, {} for None; else raise an `InputError`."""
    require(isinstance(value, Mapping | None), "options", value, "a mapping of names")
    return dict(value or {})


def gear_stage(value, name="stage", alternative=""):
    """Return `value` if it is a `GearStage` of gearlib.geometry, else raise an `InputError`.

    `name` is the name of the argument in the message. `alternative` is text such as " or a dict",
    for callers that also take other values.
    """
    allowed = f"a gearlib.geometry.GearStage{alternative}"
    # The class is recognized by a method, because its import would load NumPy and numba.
    require(hasattr(value, "pair_parameters"), name, value, allowed)
    return value


def train_of(model):
    """Return the `GearTrain` (bodies joined by meshes) of a model, or raise an `InputError`.

    Gear trains themselves and pairs with six degrees of freedom have the attribute `train`.
    """
    train = getattr(model, "train", None)
    if train is None:
        allowed = "a GearTrain, because it needs bodies with torques and angles"
        problem = f"of type {type(model).__name__} is not allowed: it must be {allowed}"
        raise InputError("model", problem=problem)
    return train


def check_known_parameters(owner, names, known_names):
    """Raise an `InputError` for the first of `names` that is not among `known_names`.

    `owner` is the name of the type, such as "GearPair", whose parameters are `known_names`.
    """
    for name in names:
        if name not in known_names:
            problem = f"is not allowed: the parameters of a {owner} are {', '.join(known_names)}"
            raise InputError(name, problem=problem)

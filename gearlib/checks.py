"""Checks of input values, and the error that names an invalid value and what is allowed."""

from collections.abc import Hashable, Mapping
from contextlib import contextmanager

#: Tunings at the lowest and the highest allowed speed, as in the configuration.
MIN_SPEED_TUNING, MAX_SPEED_TUNING = 1e-12, 100.0


class InputError(ValueError):
    """Error for an invalid input; its text is one sentence: parameter, value and what is allowed.

    `path` is the full name of the parameter, such as "wheel.tip_relief.length". `requirement` is a
    noun phrase for the allowed values, such as "a finite number > 0". If `problem` is given, such
    as "is missing: it must be given", it replaces the text about value and requirement. `owner` is
    the part to which the parameter belongs, such as "body sun".
    """

    def __init__(self, path, value=None, requirement="", problem="", owner=""):
        """Store the arguments, which the docstring of the class describes."""
        super().__init__(path, value, requirement, problem, owner)
        self.path, self.value, self.requirement = path, value, requirement
        self.problem, self.owner = problem, owner

    def __str__(self):
        """Return the message: the parameter and its owner, then the problem."""
        name = f"{self.path} of {self.owner}" if self.owner else self.path
        return f"{name} {self.problem or describe_violation(repr(self.value), self.requirement)}"


def describe_violation(value_text, requirement):
    """Return the end of an error message, "= VALUE is not allowed: it must be REQUIREMENT".

    The caller writes the parameter name before this text. `value_text` is the value as text, such
    as "-1"; `requirement` is a noun phrase for the allowed values, such as "a finite number > 0".
    """
    return f"= {value_text} is not allowed: it must be {requirement}"


@contextmanager
def prefix_error_paths(prefix, owner="", **full_paths):
    """Return a context that prepends `prefix` to the path of each `InputError` raised inside it.

    With the prefix "gears.wheel", for example, the path "module" becomes "gears.wheel.module".
    `full_paths` maps parameter names to full paths: in a path that starts with one of these names,
    the name is replaced by the full path, and no prefix is added. All other paths are attributed to
    `owner`, if given, such as "body sun".
    """
    try:
        yield
    except InputError as error:
        path, owner = error.path, owner or error.owner
        for name, full_path in full_paths.items():
            if path == name or path.startswith(f"{name}."):
                path, owner = full_path + path[len(name) :], ""
                break
        else:
            separator = "." if prefix and path[:1] != "[" else ""
            path = f"{prefix}{separator}{path}"
        raise InputError(path, error.value, error.requirement, error.problem, owner) from None


def require(condition, name, value, allowed, owner=""):
    """Raise an `InputError` for `value` unless `condition` is true.

    `name` is the parameter, such as "wheel.module"; `allowed` is a noun phrase for the allowed
    values, such as "a number > 0"; `owner` is the part to which the parameter belongs, such as
    "body sun".
    """
    if not condition:
        raise InputError(name, value, allowed, owner=owner)


def require_exactly_one(name, value, other_name, other_value):
    """Raise an `InputError` unless exactly one of two values is given, i.e. is not None.

    `name` and `other_name` are the names of `value` and `other_value` in the message.
    """
    if value is None and other_value is None:
        problem = f"and {other_name} are missing: one of the two must be given"
        raise InputError(name, problem=problem)
    if value is not None and other_value is not None:
        values = f"= {value!r} with {other_name} = {other_value!r}"
        problem = f"{values} is not allowed: it must be one of the two"
        raise InputError(name, value, problem=problem)


def check_speed(name, value, resonance_speed):
    """Return the speed `value`, or raise an `InputError` if it is far too low or too high.

    The tuning, i.e. the ratio of `value` to `resonance_speed` (both in rpm), must lie between
    `MIN_SPEED_TUNING` and `MAX_SPEED_TUNING`. `name` is the parameter name in the message.
    """
    low, high = MIN_SPEED_TUNING * resonance_speed, MAX_SPEED_TUNING * resonance_speed
    limits = f"from {low:.3g} to {high:.3g} rpm, a tuning of at most {MAX_SPEED_TUNING:g}"
    allowed = f"a finite number > 0, {limits}"
    require(low <= value <= high, name, value, allowed)
    return value


def require_damping(value, owner=""):
    """Return the damping `value` of gears in contact, or raise ValueError if it is None.

    `owner` follows the parameter name in the message, e.g. " of mesh a".
    """
    if value is None:
        raise ValueError(
            f"damping_ratio{owner} is missing: it must be a finite number >= 0 and < 1 where gears "
            "move, or logarithmic_decrement or material_damping in its place"
        )
    return value


def is_one_of(value, choices):
    """Return whether `value` is one of `choices`; return False if it is not hashable.

    Unhashable values, such as arrays and tables, are not compared, because their == does not
    return a bool.
    """
    return isinstance(value, Hashable) and value in tuple(choices)


def check_choice(name, value, choices):
    """Return `value` if it is one of `choices`, else raise an `InputError` for parameter `name`."""
    require(is_one_of(value, choices), name, value, f"one of {', '.join(map(repr, choices))}")
    return value


def check_sequence(name, values, length=None, allowed="a sequence of numbers"):
    """Return `values` as a list, or raise an `InputError` if it is not a sequence of this length.

    If `length` is None, any length is allowed. `name` is the parameter name in the message;
    `allowed` describes the allowed values there if `length` is None.
    """
    allowed = allowed if length is None else f"{length} values"
    # These types are iterable, too, but iterating over them gives single characters, keys, or
    # values in no fixed order.
    if isinstance(values, str | bytes | Mapping | set | frozenset):
        raise InputError(name, values, allowed)
    try:
        items = list(values)
    except TypeError:
        raise InputError(name, values, allowed) from None
    require(length in (None, len(items)), name, values, allowed)
    return items


def check_options(options):
    """Return `options` as a dict, {} for None; raise an `InputError` if it is not a mapping."""
    require(isinstance(options, Mapping | None), "options", options, "a mapping of names")
    return dict(options or {})


def check_gear_stage(value, name="stage", alternative=""):
    """Return `value` if it is a `GearStage` of gearlib.geometry, else raise an `InputError`.

    `name` is the parameter name in the message. `alternative` names further types that the caller
    accepts, e.g. " or a dict".
    """
    allowed = f"a gearlib.geometry.GearStage{alternative}"
    # The class is recognized by a method, because importing it would load NumPy and numba.
    require(hasattr(value, "pair_parameters"), name, value, allowed)
    return value


def require_train(model):
    """Return the `GearTrain` (bodies joined by meshes) of a model, or raise an `InputError`.

    Gear trains and gear pairs with six degrees of freedom have the attribute `train`; other
    models have no bodies with torques and angles.
    """
    train = getattr(model, "train", None)
    if train is None:
        allowed = "a GearTrain, because it needs bodies with torques and angles"
        problem = f"of type {type(model).__name__} is not allowed: it must be {allowed}"
        raise InputError("model", problem=problem)
    return train


def check_parameter_names(owner, names, known_names):
    """Raise an `InputError` for the first of `names` that is not among `known_names`.

    `owner` is the type whose parameters are `known_names`, such as "GearPair".
    """
    for name in names:
        if name not in known_names:
            problem = f"is not allowed: the parameters of a {owner} are {', '.join(known_names)}"
            raise InputError(name, problem=problem)

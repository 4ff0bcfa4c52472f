"""Checks of single values: one clear sentence naming the key, the value and the range."""

import math
from collections.abc import Mapping
from numbers import Integral, Real

#: Tunings at the slowest and the fastest speed that are allowed, as in a configuration.
MIN_SPEED_TUNING, MAX_SPEED_TUNING = 1e-12, 100.0
#: Of the integers of numpy and of the kernels.
_LARGEST = 2**63 - 1


def refusal(name, value, allowed):
    """Return the ValueError that refuses a value; `allowed` are the words for what it must be."""
    return ValueError(f"{name} = {value!r} is not allowed: it must be {allowed}")


def require(fits, name, value, allowed):
    """Refuse a value unless it fits with others."""
    if not fits:
        raise refusal(name, value, allowed)


def number(name, value, allowed, accept):
    """Return `value` as float if it is a real number that `accept` admits, else ValueError.

    `accept` is never called with NaN; `allowed` are the words for what it admits.
    """
    # numpy's scalars register as Real; bool does too, but True is no stiffness.
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


def speed(name, value, resonance):
    """Return a speed in rpm as float if its tuning is allowed; `resonance` is the speed at 1."""
    least, most = MIN_SPEED_TUNING * resonance, MAX_SPEED_TUNING * resonance
    allowed = f"a finite number > 0, from {least:.3g} to {most:.3g} rpm, a tuning of at most 100"
    return number(name, value, allowed, lambda v: least <= v <= most)


def known_damping(value, whose=""):
    """Return the damping in contact of a motion, else raise ValueError: None is unknown."""
    if value is None:
        raise ValueError(
            f"damping_ratio{whose} is missing: it must be a finite number >= 0 and < 1 where gears "
            "move, or logarithmic_decrement or material_damping in its place"
        )
    return value


def integers(low, high=None):
    """Return the words for the integers in ``low ... high``."""
    return f"an integer >= {low}" if high is None else f"an integer from {low} to {high}"


def integer(name, value, low, high=None):
    """Return `value` as int if it is an integer in ``low ... high``, else raise ValueError."""
    limit = _LARGEST if high is None else high
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if whole and low <= value <= limit:
        return int(value)
    raise refusal(name, value, integers(low, limit if whole and value > limit else high))


def one_of(name, value, choices):
    """Return `value` if it is one of `choices`, else raise ValueError."""
    require(value in choices, name, value, f"one of {', '.join(map(repr, choices))}")
    return value


def finite(name, values):
    """Return a sequence of finite numbers as a tuple of float, else raise ValueError."""
    entries = enumerate(many(name, values))
    return tuple(number(f"{name}[{i}]", value, "finite", math.isfinite) for i, value in entries)


def many(name, values, count=None):
    """Return values, so many if there is a `count`, as a list, else raise ValueError."""
    allowed = "a sequence of numbers" if count is None else f"{count} values"
    try:
        entries = list(values)
    except TypeError:
        raise refusal(name, values, allowed) from None
    require(count in (None, len(entries)), name, values, allowed)
    return entries


def numbers(name, values, count):
    """Return so many real numbers, infinite ones too, as a list of float, else raise ValueError."""
    entries = enumerate(many(name, values, count))
    return [number(f"{name}[{i}]", value, "a number", lambda v: True) for i, value in entries]


def options(value):
    """Return options, a mapping or None, as a dict, else raise ValueError."""
    require(isinstance(value, Mapping | None), "options", value, "a mapping of names")
    return dict(value or {})


def drawn_mesh(value, name="mesh", other=""):
    """Return a `gearlib.geometry.Mesh`, else raise ValueError; `other` says what else may be."""
    require(hasattr(value, "pair_parameters"), name, value, f"a gearlib.geometry.Mesh{other}")
    return value


def known(owner, names, allowed):
    """Raise ValueError unless every name of a parameter is one that the owner has."""
    for name in names:
        if name not in allowed:
            raise ValueError(
                f"{name} is not allowed: the parameters of a {owner} are {', '.join(allowed)}"
            )


def state(name, value):
    """Return an initial state as two finite floats, else raise ValueError."""
    try:
        return finite(name, many(name, value, 2))
    except ValueError:
        words = "two finite numbers (displacement in static deflections, dx/dtau)"
        raise refusal(name, value, words) from None

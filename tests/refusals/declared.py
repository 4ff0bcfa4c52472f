"""What lies outside and inside a declaration, by the words of its requirement."""

import math
import re
from typing import Annotated, Literal, get_args, get_origin

from annotated_types import MaxLen, MinLen
from pydantic import BaseModel

from gearlib.parameters import Values, is_union, parts, requirement

#: A name that a user may choose in a mapping; it is also a damping of the paper's configuration.
NAME = "k1"
_BOUND = re.compile(r"(>=|>|<=|<|from|to) (-?pi / [234]|2 pi|-?\d[\d.e+-]*)")
_PI = {"2 pi": math.tau} | {f"pi / {n}": math.pi / n for n in (2, 3, 4)}
_PI |= {f"-{text}": -value for text, value in _PI.items()}


def _bounds(words):
    """Return (bound, whether it is allowed, sign of the direction outward) of a range in words."""
    number = int if "integer" in words else float
    return [
        (_PI.get(text) or number(text), sign not in "<>", -1 if sign in (">", ">=", "from") else 1)
        for sign, text in _BOUND.findall(words)
    ]


def _next(bound, sign):
    """Return the number above or below a bound; beside 0 one whose square is not 0."""
    if isinstance(bound, int):
        return bound + sign
    return sign * 1e-12 if bound == 0.0 else math.nextafter(bound, sign * math.inf)


def is_number(annotation):
    return parts(annotation)[0] in (int, float)


def outside(words):
    """Return the numbers just outside a range in words, and those that no such range has."""
    wrong = [math.nan] + [1.5, 20.0] * ("integer" in words) + [-math.inf] * ("-inf" not in words)
    wrong += [] if "infin" in words or ".inf" in words else [math.inf]
    return wrong + [_next(b, sign) if allowed else b for b, allowed, sign in _bounds(words)]


def inside(words):
    """Return the allowed numbers next to the bounds of a range in words, 1 if it has none."""
    return [b if allowed else _next(b, -sign) for b, allowed, sign in _bounds(words)] or [1]


def count_of(annotation):
    """Return (least, largest number of entries) of a list."""
    _, metadata = parts(annotation)
    exact = next((x.count for x in metadata if isinstance(x, Values)), None)
    least = [x.min_length for x in metadata if isinstance(x, MinLen)]
    most = [x.max_length for x in metadata if isinstance(x, MaxLen)]
    return (exact, exact) if exact else (max(least, default=0), min(most, default=None))


def children(annotation):
    """Return key -> annotation of a section, or `NAME` -> annotation of the values of a mapping."""
    base, _ = parts(annotation)
    if get_origin(base) is dict:
        return {NAME: get_args(base)[1]}
    fields = getattr(base, "__pydantic_fields__", {}).items()
    return {key: Annotated[(x.annotation, *x.metadata, x)] for key, x in fields}


def valid(annotation, sections=None):
    """Return an allowed value; `sections` has the contents of some classes of sections."""
    base, _ = parts(annotation)
    base = get_args(base)[0] if is_union(base) else base
    if base in (sections or {}):
        return sections[base]
    if get_origin(base) is Literal:
        return get_args(base)[0]
    if get_origin(base) in (list, tuple):
        return [valid(get_args(base)[0], sections)] * max(1, count_of(annotation)[0])
    if get_origin(base) is dict:
        return {NAME: valid(get_args(base)[1], sections)}
    if isinstance(base, type) and issubclass(base, BaseModel):
        required = [key for key, field in base.__pydantic_fields__.items() if field.is_required()]
        return {key: valid(children(base)[key], sections) for key in required}
    if not is_number(annotation):
        return True if base is bool else NAME
    limits = {sign: bound for bound, _, sign in _bounds(requirement(annotation))}
    low, high = limits.get(-1, -math.inf), limits.get(1, math.inf)
    return next(n for n in (1, low + 1, (low + high) / 2, high - 1) if low < n < high)


def wrong(annotation, in_file=False):
    """Yield (value, path of the wrong part in it, words of what is allowed there)."""
    (base, metadata), words = parts(annotation), requirement(annotation, in_file)
    origin = get_origin(base)
    if origin in (list, tuple):
        item, (least, most) = get_args(base)[0], count_of(annotation)
        entry = valid(item)
        values = [[]] * bool(least) + [[entry] * ((most or 0) + 1)] * bool(most)
        values += [] if "one value or" in words else [7, "text", {}]
        if in_file or not hasattr(item, "__dataclass_fields__"):
            index = max(least - 1, 0)
            for value, path, inner in wrong(item, in_file):
                yield [*[entry] * index, value], (index, *path), inner
    elif is_number(annotation):
        values = ["fast", True, [1.0], {}, *outside(words)]
        values += ["3 mol", *[".inf"] * (".inf" not in words)] if in_file else ["1.0"]
    elif base is str:
        values = [3.5, ["a"], {}]
        values += ["no such ~ text" for x in metadata if getattr(x, "pattern", None)]
        values += ["x" * (x.max_length + 1) for x in metadata if isinstance(x, MaxLen)]
        values += ["" for x in metadata if isinstance(x, MinLen)]
    elif base is bool:
        values = [1, "yes", 0.0]
    elif origin is Literal:
        values = [3.5, True, ["a"], {}, "no such ~ text"]
    elif words.startswith("a mapping"):
        values = [7, "text", [], *[{}] * ("at least" in words)]
    else:  # options, whose method checks them, and parts of models
        values = [[1.0], {}, math.nan] if in_file else ["wrong", *[7] * (not is_union(base))]
    yield from ((value, (), words) for value in values)

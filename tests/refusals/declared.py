"""What lies just outside and just inside of a declaration, by the words of its requirement."""

import math
import re
from typing import Annotated, Literal, get_args, get_origin

from annotated_types import MaxLen, MinLen
from pydantic import BaseModel

from gearlib.parameters import Values, is_union, parts, requirement

#: A name that a user may choose in a mapping; it is also a damping of the paper's configuration.
NAME = "k1"
_BOUND = re.compile(r"(>=|>|<=|<|from|to) (-?)(pi / [234]|2 pi|\d[\d.e+-]*)")
_PI = {"2 pi": math.tau} | {f"pi / {n}": math.pi / n for n in (2, 3, 4)}


def numbers(words):
    """Return (numbers just outside a range in words and those of no range, numbers just inside)."""
    number = int if "integer" in words else float
    outside = [math.nan, *[1.5] * (number is int), *[-math.inf] * ("-inf" not in words)]
    outside += [] if "infin" in words or ".inf" in words else [math.inf]
    inside = []
    for sign, minus, text in _BOUND.findall(words):
        bound = (_PI.get(text) or number(text)) * (-1 if minus else 1)
        outward = -1 if sign in (">", ">=", "from") else 1
        step = (
            1 if number is int else max(1e-12, abs(bound) * 1e-12)
        )  # of which the square is not 0
        is_allowed = sign not in "<>"
        outside.append(bound + outward * step if is_allowed else bound)
        inside.append(bound if is_allowed else bound - outward * step)
    return outside, inside or [1]


def children(annotation):
    """Return key -> annotation of a section, or `NAME` -> annotation of the values of a mapping."""
    base, _ = parts(annotation)
    if get_origin(base) is dict:
        return {NAME: get_args(base)[1]}
    fields = getattr(base, "__pydantic_fields__", {}).items()
    return {key: Annotated[(x.annotation, *x.metadata, x)] for key, x in fields}


def lengths(annotation):
    """Return (least, largest number of entries) of a list, 0 without a limit."""
    _, metadata = parts(annotation)
    count = max([x.count or 0 for x in metadata if isinstance(x, Values)], default=0)
    least = max([x.min_length for x in metadata if isinstance(x, MinLen)], default=count)
    return least, max([x.max_length for x in metadata if isinstance(x, MaxLen)], default=count)


def valid(annotation, contents=None):
    """Return an allowed value; `contents` has those of some classes of sections."""
    base, _ = parts(annotation)
    base = get_args(base)[0] if is_union(base) else base
    if base in (contents or {}):
        return contents[base]
    if base in (int, float):
        inside = numbers(requirement(annotation))[1]
        return 1 if min(inside) <= 1 <= max(inside) else base(sum(inside) / len(inside))
    if get_origin(base) in (list, tuple):
        return [valid(get_args(base)[0], contents)] * max(1, lengths(annotation)[0])
    if get_origin(base) is dict:
        return {key: valid(child, contents) for key, child in children(base).items()}
    if isinstance(base, type) and issubclass(base, BaseModel):
        fields = base.__pydantic_fields__.items()
        return {k: valid(children(base)[k], contents) for k, x in fields if x.is_required()}
    return get_args(base)[0] if get_origin(base) is Literal else True if base is bool else NAME


def wrong(annotation, in_file=False):
    """Yield (value, path of the wrong part in it, words of what is allowed there)."""
    (base, metadata), words = parts(annotation), requirement(annotation, in_file)
    if get_origin(base) in (list, tuple):
        item, (least, most) = get_args(base)[0], lengths(annotation)
        values = [[]] * bool(least) + [[valid(item)] * (most + 1)] * bool(most)
        values += [] if "one value or" in words else [7, "text", {}]
        for value, path, inner in wrong(item, in_file) if in_file or "a list of" in words else ():
            yield [*[valid(item)] * (least - 1), value], (max(least - 1, 0), *path), inner
    elif base in (int, float):
        values = ["fast", True, [1.0], {}, *numbers(words)[0]]
        values += ["3 mol", *[".inf"] * (".inf" not in words)] if in_file else ["1.0"]
    elif base is str:
        values = [3.5, ["a"], {}, *["~ text" for x in metadata if getattr(x, "pattern", None)]]
        values += ["x" * (x.max_length + 1) for x in metadata if isinstance(x, MaxLen)]
        values += ["" for x in metadata if isinstance(x, MinLen)]
    elif base is bool:
        values = [1, "yes", 0.0]
    elif get_origin(base) is Literal:
        values = [3.5, True, ["a"], {}, "no such text"]
    elif words.startswith("a mapping"):
        values = [7, "text", [], *[{}] * ("at least" in words)]
    else:  # options, whose method checks them, and parts of models
        values = [[1.0], {}, math.nan] if in_file else ["wrong", *[7] * (not is_union(base))]
    yield from ((value, (), words) for value in values)

"""Values just outside and just inside the range of a declaration, see `gearlib.parameters`.

The numbers to try are read from the words of the requirement.
"""

import math
import re
from typing import Annotated, Literal, get_args, get_origin

import gearlib
from gearlib import geometry
from gearlib import parameters as p
from gearlib.config import validation
from gearlib.config.configuration import Config
from gearlib.config.gear_pair_section import Damping
from gearlib.config.train_section import GearboxSection
from tests.geometry.stages import fzg_c
from tests.paper import CONFIG, PAPER_PAIR

#: A name that a user may choose in a mapping; it is also a damping of the paper's configuration.
NAME = "k1"
BODY = gearlib.Body(name="a", inertia=0.01, base_radius=0.1, teeth=20, torque=100.0)
MESH = gearlib.Mesh(
    pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5
)
#: Class -> a value of it, where more is required than the declarations say.
EXAMPLES = {
    type(x): x for x in (BODY, MESH, PAPER_PAIR, fzg_c(), fzg_c().pinion, gearlib.Harmonics())
}
EXAMPLES[Damping] = CONFIG["dampings"][NAME]
EXAMPLES[GearboxSection] = {"file": "box.rexs"}
EXAMPLES[Config] = {key: CONFIG[key] for key in ("gear_pair", "dampings")}
PUBLIC = {name: getattr(module, name) for module in (gearlib, geometry) for name in module.__all__}
#: Public classes and functions, and methods with declared parameters; not the results of functions.
CALLS = {call for call in PUBLIC.values() if callable(call)}
CALLS -= {geometry.DynamicFactor, geometry.IsoStiffness, geometry.MeshStiffness}
CALLS |= {
    gearlib.GearPair.from_ratios,
    gearlib.Harmonics.from_table,
    geometry.SpurGear.thickness_at,
}
CALLS |= {gearlib.LoadSharingPair.from_geometry, geometry.GearStage.transmission_error}
_BOUND = re.compile(r"(>=|>|<=|<|from|to) (-?)(pi / [234]|2 pi|\d[\d.e+-]*)")
_PI = {"2 pi": math.tau} | {f"pi / {n}": math.pi / n for n in (2, 3, 4)}


def numbers(words):
    """Return (numbers just outside a range, numbers just inside) for a range in words.

    The first list also has numbers that are outside any range.
    """
    number = int if "integer" in words else float
    outside = [math.nan, *[1.5] * (number is int), *[-math.inf] * ("-inf" not in words)]
    outside += [] if "infin" in words or ".inf" in words else [math.inf]
    inside = []
    for sign, minus, text in _BOUND.findall(words):
        bound = (_PI.get(text) or number(text)) * (-1 if minus else 1)
        # The smallest step is one whose square is not 0.
        step = 1 if number is int else max(1e-12, abs(bound) * 1e-12)
        step *= -1 if sign in (">", ">=", "from") else 1
        outside.append(bound if sign in "<>" else bound + step)
        inside.append(bound - step if sign in "<>" else bound)
    return outside, inside or [0]


def children(annotation):
    """Return the annotations of the keys of a section, or of a mapping's values under `NAME`."""
    base, _ = p.parts(annotation)
    if get_origin(base) is dict:
        return {NAME: get_args(base)[1]}
    fields = getattr(base, "__pydantic_fields__", {}).items()
    return {key: Annotated[(x.annotation, *x.metadata, x)] for key, x in fields}


def valid(annotation):
    """Return an allowed value; a section gets its required keys only."""
    base, words = p.parts(annotation)[0], p.requirement(annotation)
    if p.is_union(base):
        return valid(get_args(base)[0])
    if base in (int, float):
        inside = numbers(words)[1]
        return 1 if min(inside) <= 1 <= max(inside) else base(sum(inside) / len(inside))
    if get_origin(base) in (list, tuple):
        count = re.match(r"(one value or )?a list of (\d+)", words)
        return [valid(get_args(base)[0])] * (int(count[2]) if count else 1)
    if base in EXAMPLES:
        return EXAMPLES[base]
    if keys := children(base):
        fields = getattr(base, "__pydantic_fields__", {})
        required = {key for key in keys if key not in fields or fields[key].is_required()}
        return {key: valid(child) for key, child in keys.items() if key in required}
    return get_args(base)[0] if get_origin(base) is Literal else True if base is bool else NAME


def wrong(annotation, text_of):
    """Yield (value, index of the wrong entry, problem) of wrong values of an annotation.

    `text_of` converts a value to its text in messages, which differs between files and calls.
    """
    in_file = text_of is validation.as_text
    (base, metadata), words = p.parts(annotation), p.requirement(annotation, in_file)
    if get_origin(base) in (list, tuple):
        entries, values = valid(annotation), [[]] * ("least one" in words)
        values += [] if "one value or" in words else [7, "text", {}]
        has_count = re.match(r"(one value or )?a list of \d", words)
        values += [[*entries, entries[0]]] * bool(has_count)
        for value, index, problem in wrong(get_args(base)[0], text_of) if "a list" in words else ():
            yield [*entries[1:], value], f"[{len(entries) - 1}]{index}", problem
        if any("uniqueItems" in (getattr(x, "json_schema_extra", 0) or ()) for x in metadata):
            yield 2 * entries, "", "lists "
    elif base in (int, float):
        values = ["fast", True, [1.0], {}, *numbers(words)[0]]
        values += ["3 mol", *["1e400", ".inf"] * (".inf" not in words)] if in_file else ["1.0"]
    elif base is str:
        values = [3.5, ["a"], {}, *["~ text" for x in metadata if getattr(x, "pattern", None)]]
        values += ["x" * (int(most) + 1) for most in re.findall(r"to (\d+) characters", words)]
    elif base is bool or get_origin(base) is Literal:
        values = [3.5, ["a"], {}, "no such text"]
    elif words.startswith("a mapping"):
        values = [7, "text", [], *[{}] * ("at least" in words)]
    else:  # options, whose method checks them, and parts of models
        values = [[1.0], {}, math.nan] if in_file else ["wrong"]
    yield from ((x, "", f"= {text_of(x)} is not allowed: it must be {words}") for x in values)


def inside(annotation, in_file):
    """Yield numbers just inside the range of an annotation, with units, as entries of lists."""
    base, metadata = p.parts(annotation)
    if base in (int, float):
        yield from numbers(p.requirement(annotation))[1]
        yield from (x.example for x in metadata if isinstance(x, p.Unit) and x.example and in_file)
    elif get_origin(base) in (list, tuple):
        yield from ([x] * len(valid(annotation)) for x in inside(get_args(base)[0], in_file))


def sections(annotation, place, path=()):
    """Yield (path, annotation, function) of all sections below an annotation.

    The function puts the content of a section into a file.
    """
    base, _ = p.parts(annotation)
    if p.is_union(base):
        for option in get_args(base):
            yield from sections(option, place, path)
    elif get_origin(base) is list:
        yield from sections(get_args(base)[0], lambda value: place([value]), (*path, 0))
    elif keys := children(annotation):
        yield path, annotation, place
        content = valid(annotation)
        for key, child in keys.items():
            yield from sections(child, lambda x, k=key: place(content | {k: x}), (*path, key))

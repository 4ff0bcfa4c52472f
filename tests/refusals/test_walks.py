"""A walk over the parameters of the library and the keys of files: just outside, just inside.

What is allowed is said by the annotation; the numbers to try are read from its words.
"""

import inspect
import math
import re
from fractions import Fraction
from typing import Annotated, Literal, get_args, get_origin

import numpy as np
import pytest
import xarray as xr
from pydantic import BaseModel, ValidationError

import gearlib
import gearlib.geometry as drawn
from gearlib import parameters as p
from gearlib.config import ConfigError, load, validation
from gearlib.config.configuration import Config
from gearlib.config.gear_pair_section import Damping
from gearlib.config.measured_description import Description
from tests.geometry.drawings import fzg_c
from tests.paper import CONFIG, PAPER

STAGE, GEAR = fzg_c(quality=5), drawn.SpurGear(teeth=20, module=4e-3, width=0.02)
BODY = gearlib.Body(name="a", inertia=1, base_radius=0.1, teeth=20, torque=1)
MESH = gearlib.Mesh(pinion="a", wheel="b", max_stiffness=1, stiffness_ratio=0.6, contact_ratio=1.5)
#: Class -> a value of it, where more is required than the declared parameters say.
EXAMPLES = {gearlib.GearPair: PAPER, drawn.GearStage: STAGE, drawn.SpurGear: GEAR}
EXAMPLES |= {gearlib.Harmonics: gearlib.Harmonics(), gearlib.Body: BODY, gearlib.Mesh: MESH}
EXAMPLES |= {Damping: CONFIG["dampings"]["k1"]}
EXAMPLES |= {Config: {key: CONFIG[key] for key in ("gear_pair", "dampings")}}
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
        step = (
            1 if number is int else max(1e-12, abs(bound) * 1e-12)
        )  # of which the square is not 0
        step *= -1 if sign in (">", ">=", "from") else 1
        outside.append(bound if sign in "<>" else bound + step)
        inside.append(bound - step if sign in "<>" else bound)
    return outside, inside or [0]


def children(annotation):
    """Return key -> annotation of a section, or `NAME` -> annotation of the values of a mapping."""
    base, _ = p.parts(annotation)
    if get_origin(base) is dict:
        return {NAME: get_args(base)[1]}
    fields = getattr(base, "__pydantic_fields__", {}).items()
    return {key: Annotated[(x.annotation, *x.metadata, x)] for key, x in fields}


def _count(words):
    """Return the number of entries that a list has in words, 0 if it has any."""
    match = re.match(r"(one value or )?a list of (\d+)", words)
    return int(match[2]) if match else 0


def valid(annotation):
    """Return an allowed value; of a section the one with the required keys only."""
    base, words = p.parts(annotation)[0], p.requirement(annotation)
    if p.is_union(base):
        return valid(get_args(base)[0])
    if base in (int, float):
        inside = numbers(words)[1]
        return 1 if min(inside) <= 1 <= max(inside) else base(sum(inside) / len(inside))
    if get_origin(base) in (list, tuple):
        return [valid(get_args(base)[0])] * (_count(words) or 1)
    if isinstance(base, type) and issubclass(base, BaseModel) and base not in EXAMPLES:
        required = [key for key, x in base.__pydantic_fields__.items() if x.is_required()]
        return {key: valid(children(base)[key]) for key in required}
    if get_origin(base) is dict:
        return {NAME: valid(children(base)[NAME])}
    default = get_args(base)[0] if get_origin(base) is Literal else True if base is bool else NAME
    return EXAMPLES.get(base, default)


def wrong(annotation, in_file):
    """Yield (value, path of the wrong part in it, words of what is allowed there)."""
    (base, metadata), words = p.parts(annotation), p.requirement(annotation, in_file)
    if get_origin(base) in (list, tuple):
        values = [[]] * ("least one" in words) + (
            [] if "one value or" in words else [7, "text", {}]
        )
        entries = valid(annotation)
        values += [[*entries, entries[0]]] * (_count(words) > 0)
        for value, path, inner in wrong(get_args(base)[0], in_file) if "a list of" in words else ():
            yield [*entries[1:], value], (len(entries) - 1, *path), inner
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
    yield from ((value, (), words) for value in values)


def inside(annotation, in_file):
    """Yield numbers just inside the range of an annotation, with a unit, as entries of a list."""
    base, metadata = p.parts(annotation)
    if base in (int, float):
        yield from numbers(p.requirement(annotation))[1]
        yield from (x.example for x in metadata if isinstance(x, p.Unit) and x.example and in_file)
    elif get_origin(base) in (list, tuple):
        yield from ([x] * len(valid(annotation)) for x in inside(get_args(base)[0], in_file))


CALLS = {getattr(module, x) for module in (gearlib, drawn) for x in module.__all__ if x != "RACKS"}
CALLS |= {gearlib.GearPair.from_ratios, gearlib.Harmonics.from_table, drawn.SpurGear.thickness_at}
CALLS |= {gearlib.LoadSharingPair.from_geometry, drawn.GearStage.transmission_error}
CALLS -= {drawn.DynamicFactor, drawn.IsoStiffness, drawn.MeshStiffness}  # results of functions
DECLARED = {call: p.declared_parameters(call) for call in sorted(CALLS, key=str)}


def refusals_of_call(call, name):
    """Return a function of a value of a parameter that returns the sentences about it."""
    # Functions check what is declared before they miss an argument; `self` makes them do so.
    required = {} if inspect.isroutine(call) else DECLARED[call].items()
    needed = {k: valid(x.annotation) for k, x in dict(required).items() if x.default is p.MISSING}

    def refusals(value):
        try:
            call(**needed | {name: value})
        except TypeError:
            pass
        except ValueError as error:
            return [str(error)]
        return []

    return refusals


def sections(annotation, place, path=()):
    """Yield (path, annotation, function that places a content in a file) of all sections."""
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


def refusals_of_file(place, content):
    """Return the sentences about a file with a content at its place."""
    root, content = place(content)
    try:
        if root is Description:
            Description.model_validate(content)
        else:  # gears take the place of a gear pair
            load({k: v for k, v in content.items() if k != "gear_pair" or "gears" not in content})
    except ValidationError as error:
        return validation.sentences(error, Description, content)
    except ConfigError as error:
        return str(error).splitlines()
    return []


SECTIONS = {
    str(p.parts(annotation)[0]): pytest.param(path, annotation, place, id=f"{root.__name__} {path}")
    for root in (Description, Config)
    for path, annotation, place in sections(root, lambda value, root=root: (root, value))
}
CASES = [
    pytest.param(
        x.annotation, (name,), refusals_of_call(call, name), repr, id=f"{call.__qualname__}.{name}"
    )
    for call, declared in DECLARED.items()
    for name, x in declared.items()
]
CASES += [
    pytest.param(
        child,
        (*path, key),
        lambda x, c=valid(section), k=key, place=place: refusals_of_file(place, c | {k: x}),
        validation.as_text,
        id=p.dotted((*path, key)),
    )
    for path, section, place in (case.values for case in SECTIONS.values())
    for key, child in children(section).items()
    if (path, key) != (("profile",), "kind")
]


@pytest.mark.parametrize(("annotation", "place", "refusals", "text_of"), CASES)
def test_each_wrong_value_is_refused_in_one_sentence(annotation, place, refusals, text_of):
    for value, path, words in wrong(annotation, in_file=text_of is not repr):
        (text,), shown = refusals(value), value
        for index in path:
            shown = shown[index]
        begin, _, end = text.partition(" is not allowed: it must be ")
        assert begin.startswith(p.dotted((*place, *path))) and begin.endswith(
            f" = {text_of(shown)}"
        ), text
        assert end.startswith(words) and "\n" not in end and len(end) < 1200, (text, words)


@pytest.mark.parametrize(("annotation", "place", "refusals", "text_of"), CASES)
def test_values_just_inside_are_not_refused_for_their_range(annotation, place, refusals, text_of):
    words = p.requirement(annotation, in_file=text_of is not repr).rpartition("each ")[2]
    for value in inside(annotation, in_file=text_of is not repr):
        # Other sentences are allowed: values of several parameters may not go together.
        pattern = re.escape(p.dotted(place)) + r"\S* = .* must be " + re.escape(words)
        assert not [text for text in refusals(value) if re.match(pattern, text)]


@pytest.mark.parametrize(("path", "section", "place"), SECTIONS.values())
def test_unknown_missing_and_repeated_entries_and_wrong_names_are_refused(path, section, place):
    content, keys, base = valid(section), children(section), p.parts(section)[0]
    name, last = p.dotted(path) or "the configuration", [*keys][-1]
    problems = [(f"{last}~", 1, f"= 1 is not a known key: did you mean {last}?")]
    allowed = f"{name} must be {p.requirement(section, in_file=True)}"
    problems.append(("no_such_key", 1, f"= 1 is not a known key: {allowed}"))
    if get_origin(base) is dict:  # columns of measured tables may have any name
        allowed = p.requirement(get_args(base)[0], in_file=True)
        problems = [("~", content[NAME], f"is not allowed as a name: it must be {allowed}")]
        keys, problems = {}, problems * (place({})[0] is Config)
    for key, child in keys.items():
        if any(
            "uniqueItems" in (getattr(x, "json_schema_extra", 0) or ()) for x in p.parts(child)[1]
        ):
            problems.append((key, 2 * valid(child)[:1], "lists "))
        if base.__pydantic_fields__[key].is_required() and (path, key) != (("profile",), "kind"):
            problems.append(
                (key, None, f"is missing: it must be {p.requirement(child, in_file=True)}")
            )
    for key, value, problem in problems:
        changed = {k: v for k, v in (content | {key: value}).items() if v is not None}
        begin = f"{p.dotted((*path, key))} {problem}"
        assert any(text.startswith(begin) for text in refusals_of_file(place, changed)), begin


def test_numbers_of_other_types_are_numbers():
    for number in (np.float32(0.5), Fraction(1, 2)):
        assert p.check("name", number, p.Positive) == 0.5


DAMPED = PAPER.replace(material_damping=4e3)
ORBIT = gearlib.periodic_orbit(DAMPED, 0.9)
BRANCH = gearlib.continue_orbit(ORBIT, to=0.91, max_points=3)
BRANCH.label[0] = 2  # so that a search may start here: the label of a period doubling
#: Values of undeclared parameters that calls need.
TAKEN = dict(
    model=DAMPED, stage=STAGE, gears=STAGE, self=STAGE, pair=PAPER, orbit=ORBIT, branch=BRANCH
)
TAKEN |= dict(run=gearlib.simulate(DAMPED, 0.9, periods=24, record_periods=24), path="", rpm=100.0)
TAKEN |= dict(data=xr.Dataset({"jump_up": ((), 3300.0, {"units": "min-1", "noise_std": 1.0})}))
TAKEN |= {
    name: drawn.SpurGear(teeth=z, module=3e-3, width=0.025)
    for name, z in (("sun", 27), ("planet", 36))
}
TAKEN |= dict(
    ring=drawn.SpurGear(teeth=99, module=3e-3, width=0.025, internal=True, outer_diameter=0.34)
)
TAKEN |= dict(grid=([0], [0]), region=((-1, 1), (-1, 1)), tunings=[0.9], values=[0.9], torque=300.0)
TAKEN |= dict(
    states=[(0, 0)], parameter="damping", method="energy", phase=np.arange(3) * math.tau / 3
)
TAKEN |= dict(call=lambda model: model.load, parameters=("load",), quantities=("force",))
TAKEN |= dict(tolerances={"load": {"std": "1 %"}}, free={"reduced_mass": (3, 3.2)})
#: Parameters that are given although they have a default; arguments that are handed on.
GIVEN = (
    "simulate.tuning sweep.tunings scatter.tunings mesh_stiffness.method sobol_indices.quantities"
)
FURTHER = {"run_up": dict(start=1e3, stop=1.1e3, duration=0.1), "from_geometry": dict(torque=1.0)}
FURTHER |= {"duty_point": dict(torque=1.0, damping_ratio=0.1), "locus": dict(to=0.1)}
FURTHER |= {
    "sobol_indices": dict(speed=3e3, n=2),
    "scatter": dict(n=2),
    "duty_point": dict(torque=1, damping_ratio=0.1),
}
#: What no parameter takes: other types, nested and unhashable values, tables of other contents.
TAKEN_BY_NONE = [object(), 1j, {"a": []}, [["a"]], np.array([["a"], [1]]), xr.Dataset({"a": 1})]
UNDECLARED = [
    pytest.param(call, name, id=f"{call.__qualname__}.{name}")
    for call, declared in DECLARED.items()
    for name, x in inspect.signature(call).parameters.items()
    if name not in {*declared, "self"} and x.kind != x.VAR_KEYWORD
]


@pytest.mark.parametrize(("call", "name"), UNDECLARED)
def test_what_no_parameter_takes_is_refused_by_its_name(call, name):
    needed = {}
    for other, x in inspect.signature(call).parameters.items():
        if (
            x.default is x.empty
            and x.kind != x.VAR_KEYWORD
            or f"{call.__name__}.{other}" in GIVEN.split()
        ):
            known = DECLARED[call].get(other)
            needed[other] = valid(known.annotation) if other not in TAKEN else TAKEN[other]
    needed |= FURTHER.get(call.__name__, {})
    needed.pop({"speeds": "tunings"}.get(name), None)
    for value in TAKEN_BY_NONE:
        with pytest.raises(ValueError, match="not allowed") as refusal:
            call(**needed | {name: value})
        # Options are named by their keys, such as that of {"a": []}; a method is handed on.
        text = str(refusal.value)
        assert name in text or text.startswith("a ") or "stiffness" in text, text

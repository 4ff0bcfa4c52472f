"""Walks over all parameters of the library and all keys of files: just outside and just inside.

What is allowed is said by the annotation of a parameter or key; the numbers to try are read from
its requirement in words.
"""

import inspect
import math
import re
from fractions import Fraction
from itertools import zip_longest
from typing import Annotated, Literal, get_args, get_origin

import numpy as np
import pytest
import xarray as xr
from annotated_types import MaxLen, MinLen
from pydantic import BaseModel, ValidationError

import gearlib
import gearlib.geometry as drawn
from gearlib import parameters
from gearlib.config import ConfigError, load, validation
from gearlib.config.configuration import Config
from gearlib.config.gear_pair_section import Damping
from gearlib.config.measured_description import Description
from gearlib.parameters import Unit, Values, dotted, parts, requirement
from tests.geometry.drawings import fzg_c
from tests.paper import CONFIG, PAPER, PARAMETERS

#: A name that a user may choose in a mapping; it is also a damping of the paper's configuration.
NAME = "k1"
#: Contents of sections in which more is required than the keys without a default.
CONTENTS = {Config: {key: CONFIG[key] for key in ("gear_pair", "dampings")}}
CONTENTS[Damping] = CONFIG["dampings"][NAME]
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


def valid(annotation):
    """Return an allowed value."""
    base, _ = parts(annotation)
    base = get_args(base)[0] if parameters.is_union(base) else base
    if base in (int, float):
        inside = numbers(requirement(annotation))[1]
        return 1 if min(inside) <= 1 <= max(inside) else base(sum(inside) / len(inside))
    if get_origin(base) in (list, tuple):
        return [valid(get_args(base)[0])] * max(1, lengths(annotation)[0])
    if get_origin(base) is dict:
        return {key: valid(child) for key, child in children(base).items()}
    if isinstance(base, type) and issubclass(base, BaseModel):
        fields = base.__pydantic_fields__.items()
        content = {key: valid(children(base)[key]) for key, x in fields if x.is_required()}
        return CONTENTS.get(base, content)
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
        values += ["3 mol", *["1e400", ".inf"] * (".inf" not in words)] if in_file else ["1.0"]
    elif base is str:
        values = [3.5, ["a"], {}, *["~ text" for x in metadata if getattr(x, "pattern", None)]]
        values += ["x" * (x.max_length + 1) for x in metadata if isinstance(x, MaxLen)]
        values += ["" for x in metadata if isinstance(x, MinLen)]
    elif base is bool or get_origin(base) is Literal:
        values = [3.5, ["a"], {}, "no such text"]
    elif words.startswith("a mapping"):
        values = [7, "text", [], *[{}] * ("at least" in words)]
    else:  # options, whose method checks them, and parts of models
        values = [[1.0], {}, math.nan] if in_file else ["wrong"]
    yield from ((value, (), words) for value in values)


# The library.

DAMPED, STAGE = PAPER.replace(material_damping=4e3), fzg_c(quality=5)
ORBIT = gearlib.periodic_orbit(DAMPED, 0.9)
BRANCH = gearlib.continue_orbit(ORBIT, to=0.91, max_points=3)
BRANCH.label[0] = 2  # so that a search may start here: the label of a period doubling
RECORD = gearlib.simulate(DAMPED, 0.9, periods=24, record_periods=24)
JUMP = xr.Dataset({"jump_up": ((), 3300.0, {"units": "min-1", "noise_std": 1.0})})
BODIES = [gearlib.Body(name=x, inertia=1, base_radius=0.1, teeth=20, torque=1) for x in "ab"]
MESH = gearlib.Mesh(pinion="a", wheel="b", max_stiffness=1, stiffness_ratio=0.6, contact_ratio=1.5)
GEAR = drawn.SpurGear(teeth=20, module=4e-3, width=0.02)
SUN, PLANET = (drawn.SpurGear(teeth=z, module=3e-3, width=0.025) for z in (27, 36))
RING = drawn.SpurGear(teeth=99, module=3e-3, width=0.025, internal=True, outer_diameter=0.34)
#: Name of a parameter, or of its owner and of it -> a value that is taken.
TAKEN = PARAMETERS | dict(pair=PAPER, model=DAMPED, stage=STAGE, gears=STAGE, self=STAGE)
TAKEN |= dict(orbit=ORBIT, branch=BRANCH, point=0, run=RECORD, data=JUMP, sun=SUN, planet=PLANET)
TAKEN |= dict(ring=RING, tuning=0.9, tunings=[0.9], speed=3e3, periods=60, record_periods=1)
TAKEN |= dict(start=1e3, stop=1.1e3, duration=0.05, grid=([0], [0]), region=((-1, 1), (-1, 1)))
TAKEN |= dict(values=[0.9], states=[(0, 0)], to=0.91, parameter="damping", path="", torque=300.0)
TAKEN |= dict(call=lambda model: model.load, parameters=("load",), n=2, quantities=("force",))
TAKEN |= dict(tolerances={"load": {"std": "1 %"}}, free={"reduced_mass": (3, 3.2)}, rpm=100.0)
TAKEN |= dict(base_radii=(0.1, 0.1), inertias=(1, 1), masses=(9, 9), bearing_stiffness=(1e8,) * 4)
TAKEN |= dict(upper_stiffness=1, name="a", inertia=1, base_radius=0.1, teeth=20, bodies=("a", "b"))
TAKEN |= dict(stiffness=(1, 2), phase=(0, 1), harmonics=3, mean=1, thickness=0.01, amount=1e-5)
TAKEN |= dict(rim_diameter=0.06, hub_diameter=0.04, length=1e-3, position=(0,), value=(0,))
TAKEN |= dict(module=4e-3, width=0.02, pinion="a", wheel="b", diameter=0.1, method="energy")
TAKEN |= {"GearStage.pinion": GEAR, "GearStage.wheel": GEAR, "Shaft.stiffness": 1.0}
TAKEN |= {"GearTrain.bodies": BODIES, "GearTrain.meshes": [MESH], "locus.to": 0.1}
TAKEN |= {"thickness_at.self": GEAR, "Series.harmonics": gearlib.Harmonics()}
TAKEN |= {"from_table.phase": np.arange(3) * math.tau / 3, "from_table.values": (0, 1, 2)}
#: Parameters that are given although they have a default; arguments that are handed on.
GIVEN = (
    "simulate.tuning sweep.tunings scatter.tunings scatter.n sobol_indices.n sobol_indices.speed"
)
GIVEN += " sobol_indices.quantities run_up.start run_up.stop run_up.duration mesh_stiffness.method"
FURTHER = {"from_geometry": {"torque": 1.0}, "duty_point": {"torque": 1.0, "damping_ratio": 0.1}}
#: What no parameter takes: other types, nested and unhashable values, tables of other contents.
TAKEN_BY_NONE = [object(), 1j, {"a": []}, [["a"]], np.array([["a"], [1]]), xr.Dataset({"a": 1})]
CALLS = {getattr(module, x) for module in (gearlib, drawn) for x in module.__all__ if x != "RACKS"}
CALLS |= {gearlib.GearPair.from_ratios, gearlib.Harmonics.from_table, drawn.SpurGear.thickness_at}
CALLS |= {gearlib.LoadSharingPair.from_geometry, drawn.GearStage.transmission_error}
CALLS -= {drawn.DynamicFactor, drawn.IsoStiffness, drawn.MeshStiffness}  # results of functions
PARAMETERS_OF_CALLS = [
    pytest.param(call, name, id=f"{call.__qualname__}.{name}")
    for call in sorted(CALLS, key=lambda call: call.__qualname__)
    for name, parameter in inspect.signature(call).parameters.items()
    if parameter.kind != parameter.VAR_KEYWORD and name != "self"
]
library = pytest.mark.parametrize(("call", "name"), PARAMETERS_OF_CALLS)


def make(call, name, value):
    """Make a call with a value of a parameter, and the values that the call needs beside it."""
    needed = {}
    for other, parameter in inspect.signature(call).parameters.items():
        key, required = f"{call.__name__}.{other}", parameter.default is parameter.empty
        if (required or key in GIVEN.split()) and parameter.kind != parameter.VAR_KEYWORD:
            needed[other] = TAKEN.get(key, TAKEN.get(other))
    needed.pop({"speed": "tuning", "speeds": "tunings"}.get(name), None)
    return call(**needed | FURTHER.get(call.__name__, {}) | {name: value})


def refusal_of(call, name, value):
    """Return the text of the ValueError for a value of a parameter."""
    with pytest.raises(ValueError) as refusal:
        make(call, name, value)
    return str(refusal.value)


@library
def test_what_no_parameter_takes_is_refused_by_its_name(call, name):
    for text in (refusal_of(call, name, value) for value in TAKEN_BY_NONE):
        # Options are named by their keys, such as that of {"a": []}; a method is handed on.
        is_named = name in text or text.startswith("a ") or "stiffness" in text
        assert is_named and "not allowed" in text, text


@library
def test_each_wrong_value_is_refused_in_one_sentence(call, name):
    if parameter := parameters.declared_parameters(call).get(name):
        required = [(None, (), parameter.allowed)] * (parameter.default is parameters.MISSING)
        for value, path, words in [*required, *wrong(parameter.annotation)]:
            text, shown = refusal_of(call, name, value), value
            for index in path:
                shown = shown[index]
            begin, _, end = text.partition(" is not allowed: it must be ")
            assert begin.startswith(dotted((name, *path))) and begin.endswith(f" = {shown!r}"), text
            assert end.startswith(words) and "\n" not in end and len(end) < 500, (text, words)


@library
def test_values_just_inside_are_not_refused_for_their_range(call, name):
    parameter = parameters.declared_parameters(call).get(name)
    if parameter and parts(parameter.annotation)[0] in (int, float):
        for value in numbers(parameter.allowed)[1]:
            types = (np.array, Fraction) if parameter.number else (np.array,)
            assert {
                parameter.check(name, number(value)[()] if number is np.array else number(value))
                for number in types
            } == {value}
            try:  # functions may run for long
                make(call, name, value) if isinstance(
                    call, type
                ) or "planet" in call.__name__ else 0
            except ValueError as refusal:
                # Another sentence may say that the value does not go with the other arguments.
                assert not str(refusal).endswith(parameter.allowed), str(refusal)


# Files.


def sections(annotation, place, path=()):
    """Yield (path, annotation, function that places a content in a file) of all sections."""
    base, _ = parts(annotation)
    if parameters.is_union(base):
        for option in get_args(base):
            yield from sections(option, place, path)
    elif get_origin(base) is list:
        yield from sections(get_args(base)[0], lambda value: place([value]), (*path, 0))
    elif keys := children(annotation):
        yield path, annotation, place
        content = valid(annotation)
        for key, child in keys.items():
            yield from sections(child, lambda x, k=key: place(content | {k: x}), (*path, key))


def refusals(place, value):
    """Return the sentences about a file with a value at its place."""
    root, content = place(value)
    try:
        if root is Description:
            Description.model_validate(content)
        else:  # gears take the place of a gear pair
            load({k: v for k, v in content.items() if k != "gear_pair" or "gears" not in content})
    except ValidationError as error:
        return validation.sentences(error, Description, content)
    except ConfigError as refusal:
        return str(refusal).splitlines()
    return []


def at_once(candidates):
    """Yield dicts with the first candidate of every key, then the second one where there is one."""
    for row in zip_longest(*candidates.values()):
        yield {key: x for key, x in zip(candidates, row, strict=True) if x is not None}


#: Of a class one section of each top level key, and those near the top.
SECTIONS = {}
for root in (Description, Config):
    for path, annotation, place in sections(root, lambda value, root=root: (root, value)):
        key = str(parts(annotation)[0]), path[:1] if len(path) < 3 else ()
        case = pytest.param(path, annotation, place, id=f"{root.__name__} {dotted(path)}")
        SECTIONS.setdefault(key, case)
files = pytest.mark.parametrize(("path", "annotation", "place"), SECTIONS.values())


@files
def test_each_wrong_value_of_a_section_gets_one_sentence(path, annotation, place):
    # Gears and a gear pair exclude each other, and another kind has other keys.
    left_out = {*["gears"] * (not path), *["kind"] * ("profile" in path)}
    keys = {key: child for key, child in children(annotation).items() if key not in left_out}
    for broken in at_once({key: [*wrong(child, in_file=True)] for key, child in keys.items()}):
        values = {key: value for key, (value, *_) in broken.items()}
        sentences = refusals(place, valid(annotation) | values)
        for key, (value, rest, words) in broken.items():
            for index in rest:
                value = value[index]
            begin = f"{dotted((*path, key, *rest))} = {validation.as_text(value)} is not allowed: "
            own = [text for text in sentences if text.startswith(f"{begin}it must be {words}")]
            assert len(own) == 1 and len(own[0]) < 1200, (begin, words, sentences)
        assert len(sentences) == len(broken), sentences


@files
def test_unknown_missing_and_repeated_entries_and_invalid_names_are_refused(
    path, annotation, place
):
    content, keys, base = valid(annotation), children(annotation), parts(annotation)[0]
    name, last = dotted(path) or "the configuration", [*keys][-1]
    problems = [
        (
            "no_such_key",
            1,
            f"= 1 is not a known key: {name} must be {requirement(annotation, True)}",
        ),
        (f"{last}~", 1, f"= 1 is not a known key: did you mean {last}?"),
    ]
    if get_origin(base) is dict:  # columns of tables may have any name
        allowed = requirement(get_args(base)[0], in_file=True)
        problems = [("~", content[NAME], f"is not allowed as a name: it must be {allowed}")]
        problems = problems if place({})[0] is Config else []
    for key, child in keys.items() if base is not dict else ():
        if any(
            "uniqueItems" in (getattr(x, "json_schema_extra", 0) or ()) for x in parts(child)[1]
        ):
            problems.append((key, 2 * valid(child)[:1], "lists "))
        if key in content and (key, *path) != ("kind", "profile") and get_origin(base) is not dict:
            problems.append((key, None, f"is missing: it must be {requirement(child, True)}"))
    for key, value, problem in problems:
        changed = {k: v for k, v in (content | {key: value}).items() if v is not None}
        begin = f"{dotted((*path, key))} {problem}"
        assert any(text.startswith(begin) for text in refusals(place, changed)), begin


@files
def test_values_just_inside_are_not_refused_for_the_range_of_their_key(path, annotation, place):
    candidates, ranges = {}, {}
    for key, child in children(annotation).items():
        is_list = get_origin(parts(child)[0]) is list
        item = get_args(parts(child)[0])[0] if is_list else child
        if parts(item)[0] in (int, float):
            ranges[key] = re.escape(requirement(item, in_file=True))
            examples = [x.example for x in parts(item)[1] if isinstance(x, Unit) and x.example]
            values = numbers(requirement(item))[1] + examples
            candidates[key] = [[x] * len(valid(child)) for x in values] if is_list else values
    for values in at_once(candidates):
        for text in refusals(place, valid(annotation) | values):
            for key in values:
                # Other sentences are allowed: values of several keys may not go together.
                begin = re.escape(dotted((*path, key)))
                assert not re.fullmatch(rf"{begin}\S* = .* must be {ranges[key]}(; did .*)?", text)

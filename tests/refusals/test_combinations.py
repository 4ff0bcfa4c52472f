"""Inconsistent values, by the rows of `combinations.yaml`, are refused in one sentence."""

import ast
import inspect
import json
import math
import re
from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml

import gearlib as g
from gearlib import geometry
from gearlib.config import load
from gearlib.parameters import declared_parameters
from tests.declarations import EXAMPLE_BODY, EXAMPLE_MESH, PUBLIC_OBJECTS
from tests.geometry.stages import fzg_c
from tests.paper import CONFIG, PAPER_PAIR
from tests.properties import known_models
from tests.properties.known_models import DAMPED
from tests.sentences import assert_sentence
from tests.unit.test_gears_section import FZG_CONFIG
from tests.unit.test_train_section import PLANETARY_SET_SECTION, TRAIN_SECTION

ROWS = yaml.safe_load(Path(__file__).with_name("combinations.yaml").read_text(encoding="utf-8"))
TWENTY = {"pinion": {"teeth": 20, "module": "4 mm", "width": "20 mm"}, "wheel": {"teeth": 40}}
Z20_20 = {"pinion": TWENTY["pinion"], "wheel": {"teeth": 20}, "torque": 500.0}
TRIALS = [{"name": name, "method": "rk4"} for name in ("rk4-64", "rk4-200")]
FILES = {
    "paper": CONFIG
    | {"mesh_stiffness": {"pairs": {"z20-20": Z20_20, "FZG-C": FZG_CONFIG["gears"]}}}
    | {"harris_map": {"gears": FZG_CONFIG["gears"]}, "failures": {"trials": TRIALS}}
    | {"labels": {"start": 0.5, "stop": 1.4, "step": 0.01}},
    "fzg": FZG_CONFIG,
    "twenty": FZG_CONFIG | {"gears": TWENTY | {"torque": 100.0}},
    "planetary_set": CONFIG
    | {"train": {"kind": "planetary_set", "planetary_set": PLANETARY_SET_SECTION}},
    "own": CONFIG | {"train": {"kind": "own", "own": TRAIN_SECTION}},
}
A, AB = EXAMPLE_BODY, EXAMPLE_MESH
B = replace(A, name="b", inertia=0.02, base_radius=0.2, teeth=40, torque=200.0)
C = replace(B, name="c", torque=0.0)
paper, stage = PAPER_PAIR.replace, fzg_c()
a, b, ab = (partial(replace, element) for element in (A, B, AB))
shaft, train = partial(g.Shaft, stiffness=1.0), partial(g.GearTrain, bodies=(A, B), meshes=(AB,))
gear = partial(geometry.SpurGear, teeth=20, module=4e-3, width=0.02)
web = partial(geometry.Web, thickness=0.01, rim_diameter=0.06, hub_diameter=0.04)
planet = partial(geometry.SpurGear, module=3e-3, width=0.025)
ring = partial(planet, internal=True, outer_diameter=0.34)
SET_GEARS = planet(teeth=27), planet(teeth=36), ring(teeth=99)
geometry_set = partial(geometry.planetary_set, *SET_GEARS, torque=1.0)
pair = partial(g.GearPair.from_geometry, stage)
sharing = partial(g.LoadSharingPair, pair=pair(torque=1.0), stage=stage)
factor = partial(geometry.dynamic_factor, stage, 302.0, rpm=100.0)
error = partial(stage.transmission_error, torque=300.0)
simulate, sweep = partial(g.simulate, periods=2), partial(g.sweep, periods=2, record_periods=1)
CHAIN = [f"g{i}" for i in range(202)]
MESHES = [ab(pinion=pinion, wheel=wheel, name=pinion) for pinion, wheel in pairwise(CHAIN)]
ORBIT = g.periodic_orbit(DAMPED, 0.9)
BRANCH = g.continue_orbit(ORBIT, to=0.91, max_points=3)
BRANCH.label[0] = 2  # so that a search may start here: the label of a period doubling
RUN = g.simulate(DAMPED, 0.9, periods=24, record_periods=24)
SPREAD, FREE = {"load": {"std": "1 %"}}, {"reduced_mass": (3.0, 3.2)}
JUMP = xr.Dataset({"jump_up": ((), 3300.0, {"units": "min-1", "noise_std": 1.0})})
#: Values that no parameter accepts: other types, nested and unhashable values, other tables.
VALUES_OF_WRONG_TYPES = [
    object(),
    1j,
    {"a": []},
    [["a"]],
    np.array([["a"], [1]]),
    xr.Dataset({"a": 1}),
]
NAMES = PUBLIC_OBJECTS | vars(math) | vars(known_models) | globals()


def set_at_path(content, path, value):
    """Set a value at a path such as `scenes.k1.cases[0].tuning` in place; None deletes the key."""
    if isinstance(path, str):
        # Keys are separated by dots, and indices are in brackets.
        parts = re.findall(r"([^.[\]]+)(?!\])|\[(\d+)\]", path)
        *parents, key = [int(index) if index else name for name, index in parts]
    else:  # a number is a key of the whole content
        parents, key = [], path
    for parent in parents:
        content = content[parent] if isinstance(parent, int) else content.setdefault(parent, {})
    if value is None:
        del content[key]
    else:
        content[key] = value


def changes_and_sentences(section):
    """Return (change or call, sentence) for each row of a section of `combinations.yaml`."""
    return [row.split(" | ") for row in ROWS[section].splitlines()]


def parse_undeclared_arguments(call):
    """Parse a call and return (function, arguments, names of undeclared arguments).

    An argument is undeclared if no annotation states its type and range.
    """
    tree = ast.parse(call, mode="eval").body
    function = eval(ast.unparse(tree.func), NAMES)  # noqa: S307
    values = [eval(ast.unparse(node), NAMES) for node in tree.args]  # noqa: S307
    arguments = dict(zip(inspect.signature(function).parameters, values, strict=False))
    for keyword in tree.keywords:
        arguments[keyword.arg] = eval(ast.unparse(keyword.value), NAMES)  # noqa: S307
    declared = declared_parameters(getattr(function, "func", function))
    return function, arguments, [name for name in arguments if name not in declared]


@pytest.mark.parametrize(
    ("base", "change", "sentence"),
    [(base, *row) for base in FILES for row in changes_and_sentences(base)],
)
def test_inconsistent_files_are_refused_in_one_sentence(base, change, sentence):
    """Each change of a valid configuration must be refused with the sentence of its row."""
    # A copy by JSON shares no object between two keys.
    content, changes = json.loads(json.dumps(FILES[base])), yaml.safe_load(change)
    for path, value in changes.items() if isinstance(changes, dict) else [(changes, None)]:
        set_at_path(content, path, value)
    with pytest.raises(ValueError) as refusal:
        load(content)
    # Sentences that start with "=" or "is" are preceded by the path of the key.
    if sentence.startswith(("= ", "is ")):
        sentence = f"{path} {sentence}"
    assert_sentence(refusal.value, sentence)


@pytest.mark.parametrize(("call", "sentence"), changes_and_sentences("library"))
def test_inconsistent_calls_are_refused_in_one_sentence(call, sentence):
    with pytest.raises(ValueError) as refusal:
        eval(call, NAMES)  # noqa: S307
    assert_sentence(refusal.value, sentence)


@pytest.mark.parametrize("call", ROWS["undeclared"].splitlines())
def test_values_of_a_wrong_type_are_refused_with_the_parameter_name(call):
    """Values that no parameter accepts must be refused, so that none causes an obscure error."""
    function, arguments, names = parse_undeclared_arguments(call)
    assert names
    for name, value in product(names, VALUES_OF_WRONG_TYPES):
        with pytest.raises(ValueError, match="not allowed") as refusal:
            function(**arguments | {name: value})
        # The value {"a": []} may be taken for options, and is then refused by its key.
        message = str(refusal.value)
        assert name in message or message.startswith("a "), message


@pytest.mark.parametrize("call", ROWS["allowed"].splitlines())
def test_values_just_inside_the_limits_are_allowed(call):
    assert eval(call, NAMES)  # noqa: S307

"""The rows of `combinations.yaml`: what is refused in one sentence, and what no argument may be."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml

from gearlib.config import load
from tests.paper import CONFIG
from tests.properties import known_models
from tests.refusals import expressions
from tests.unit.test_drawn_gears import FZG
from tests.unit.test_drawn_trains import OWN, SET

ROWS = yaml.safe_load(Path(__file__).with_name("combinations.yaml").read_text(encoding="utf-8"))
TWENTY = {"pinion": {"teeth": 20, "module": "4 mm", "width": "20 mm"}, "wheel": {"teeth": 40}}
Z20_20 = {"pinion": TWENTY["pinion"], "wheel": {"teeth": 20}, "torque": 500.0}
TRIALS = [{"name": name, "method": "rk4"} for name in ("rk4-64", "rk4-200")]
FILES = {
    "paper": CONFIG
    | {"mesh_stiffness": {"pairs": {"z20-20": Z20_20, "FZG-C": FZG["gears"]}}}
    | {"harris_map": {"gears": FZG["gears"]}, "failures": {"trials": TRIALS}}
    | {"labels": {"start": 0.5, "stop": 1.4, "step": 0.01}},
    "fzg": FZG,
    "twenty": FZG | {"gears": TWENTY | {"torque": 100.0}},
    "planetary_set": CONFIG | {"train": {"kind": "planetary_set", "planetary_set": SET}},
    "own": CONFIG | {"train": {"kind": "own", "own": OWN}},
}
NAMES = expressions.PUBLIC | vars(math) | vars(known_models) | vars(expressions)
#: What no parameter takes: other types, nested and unhashable values, tables of other contents.
TAKEN_BY_NONE = [object(), 1j, {"a": []}, [["a"]], np.array([["a"], [1]]), xr.Dataset({"a": 1})]


def pairs(base):
    """Yield (base, what is wrong, sentence) for the rows of a base."""
    for row in ROWS[base].splitlines():
        cells = row.split(" | ")
        for wrong, sentence in zip(cells[::2], cells[1::2], strict=True):
            yield pytest.param(base, wrong, sentence, id=f"{base}: {wrong}")


def set_at_path(content, path, value):
    """Set a value at a path such as `scenes.k1.cases[0].tuning`, in place; None removes the key."""
    # Keys are separated by dots, indices stand in brackets; a number as a key has no path below it.
    parts = re.findall(r"([^.[\]]+)(?!\])|\[(\d+)\]", path) if isinstance(path, str) else []
    *parents, key = [int(index) if index else name for name, index in parts] or [path]
    for part in parents:
        content = content[part] if isinstance(part, int) else content.setdefault(part, {})
    content.pop(key) if value is None else content.__setitem__(key, value)


def is_said(text, sentence):
    """Return whether a text is one sentence that begins so; `...` stands for anything."""
    pattern = ".*".join(map(re.escape, re.split(r"\s*\.\.\.\s*", sentence)))
    return re.match(pattern, text) and "\n" not in text and ". " not in text and len(text) < 500


@pytest.mark.parametrize(("base", "change", "sentence"), [x for name in FILES for x in pairs(name)])
def test_inconsistent_files_are_refused_in_one_sentence(base, change, sentence):
    # A copy in which no two parts are the same object.
    content, changes = json.loads(json.dumps(FILES[base])), yaml.safe_load(change)
    for path, value in changes.items() if isinstance(changes, dict) else [(changes, None)]:
        set_at_path(content, path, value)
    with pytest.raises(ValueError) as refusal:
        load(content)
    key = f"{path} " if sentence.startswith(("= ", "is ")) else ""
    assert is_said(str(refusal.value), key + sentence), refusal.value


@pytest.mark.parametrize(("base", "call", "sentence"), pairs("library"))
def test_impossible_models_and_calls_are_refused_in_one_sentence(base, call, sentence):
    with pytest.raises(ValueError) as refusal:
        eval(call, NAMES)  # noqa: S307
    assert is_said(str(refusal.value), sentence), refusal.value


@pytest.mark.parametrize(("base", "call", "name"), pairs("undeclared"))
def test_what_no_parameter_takes_is_refused_by_its_name(base, call, name):
    for value in TAKEN_BY_NONE:
        with pytest.raises(ValueError, match="not allowed") as refusal:
            eval(call, NAMES, {"X": value})  # noqa: S307
        # Options are named by their keys, such as that of {"a": []}.
        assert name in str(refusal.value) or str(refusal.value).startswith("a "), refusal.value


@pytest.mark.parametrize("call", ROWS["allowed"].splitlines())
def test_values_just_inside_the_limits_are_allowed(call):
    assert eval(call, NAMES)  # noqa: S307

"""The rows of `combinations.yaml`: what is refused in one sentence, and why."""

import json
import re
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import inf, nan, pi  # noqa: F401 (names of the rows)
from pathlib import Path

import pytest
import yaml

import gearlib as g
import gearlib.geometry as d
from gearlib import Tabulated, planetary  # noqa: F401
from gearlib.config import ConfigError, load
from tests.geometry.drawings import fzg_c
from tests.paper import CONFIG, PAPER
from tests.properties.known_models import DAMPED, GEARS, OSCILLATOR  # noqa: F401
from tests.unit.test_drawn_gears import FZG
from tests.unit.test_drawn_trains import OWN, SET

TWENTY = {"pinion": {"teeth": 20, "module": "4 mm", "width": "20 mm"}, "wheel": {"teeth": 40}}
Z20_20 = {"pinion": TWENTY["pinion"], "wheel": {"teeth": 20}, "torque": 500.0}
FURTHER = {
    "mesh_stiffness": {"pairs": {"z20-20": Z20_20, "FZG-C": FZG["gears"]}},
    "harris_map": {"gears": FZG["gears"]},
    "failures": {"trials": [{"name": name, "method": "rk4"} for name in ("rk4-64", "rk4-200")]},
    "labels": {"start": 0.5, "stop": 1.4, "step": 0.01},
}
BASES = {
    "paper": CONFIG | FURTHER,
    "fzg": FZG,
    "twenty": FZG | {"gears": TWENTY | {"torque": 100.0}},
    "planetary_set": CONFIG | {"train": {"kind": "planetary_set", "planetary_set": SET}},
    "own": CONFIG | {"train": {"kind": "own", "own": OWN}},
}
A = g.Body(name="a", inertia=0.01, base_radius=0.1, teeth=20, torque=100.0)
B = g.Body(name="b", inertia=0.02, base_radius=0.2, teeth=40, torque=200.0)
C = replace(B, name="c", torque=0.0)
AB = g.Mesh(pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5)
paper, stage = PAPER.replace, fzg_c()
a, b, ab = (partial(replace, element) for element in (A, B, AB))
shaft = partial(g.Shaft, stiffness=1.0)
gear = partial(d.SpurGear, teeth=20, module=4e-3, width=0.02)
planet = partial(d.SpurGear, module=3e-3, width=0.025)
web = partial(d.Web, thickness=0.01, rim_diameter=0.06, hub_diameter=0.04)
pair = partial(g.GearPair.from_geometry, stage)
factor = partial(d.dynamic_factor, stage, 302.0, rpm=100.0)
error = partial(stage.transmission_error, torque=300.0)
sharing = partial(g.LoadSharingPair, pair=pair(torque=1.0), stage=stage)
sweep = partial(g.sweep, PAPER, periods=2, record_periods=1)
GEARS_202 = [f"g{i}" for i in range(202)]
MESHES_201 = [ab(pinion=pinion, wheel=wheel, name=pinion) for pinion, wheel in pairwise(GEARS_202)]


def planets(z_sun=27, z_planet=36, z_ring=99, distance=None, ring_module=3e-3, **options):
    ring = planet(teeth=z_ring, internal=True, outer_diameter=0.34, module=ring_module)
    gears = planet(teeth=z_sun), planet(teeth=z_planet), ring
    return d.planetary_set(*gears, centre_distance=distance, torque=100.0, **options)


def train(bodies=(A, B), meshes=(AB,), **more):
    return g.GearTrain(bodies=bodies, meshes=meshes, **more)


def simulate(tuning=0.8, model=PAPER, **options):
    return g.simulate(model, tuning, **{"periods": 2} | options)


def run_up(*speeds, model=PAPER, **options):
    return g.run_up(model, *speeds, **options)


def set_at_path(content, path, value):
    """Set a value at a path such as `scenes.k1.cases[0].tuning`, in place; None removes the key."""
    # Keys are separated by dots, indices stand in brackets; a number as a key has no path below it.
    parts = re.findall(r"([^.[\]]+)(?!\])|\[(\d+)\]", path) if isinstance(path, str) else []
    *parents, key = [int(index) if index else name for name, index in parts] or [path]
    for part in parents:
        content = content[part] if isinstance(part, int) else content.setdefault(part, {})
    content.pop(key) if value is None else content.__setitem__(key, value)


ROWS = [
    pytest.param(base, *pair, id=f"{base}: {pair[0]}")
    for base, rows in yaml.safe_load(
        Path(__file__).with_name("combinations.yaml").read_text()
    ).items()
    for row in rows.splitlines()
    if not row.startswith("#")
    for pair in zip(*[iter(row.split(" | "))] * 2, strict=True)
]


@pytest.mark.parametrize(("base", "wrong", "sentence"), ROWS)
def test_what_does_not_go_together_is_refused_in_one_sentence(base, wrong, sentence):
    with pytest.raises(ValueError) as refusal:
        if base == "library":
            eval(wrong)  # noqa: S307
        # A copy in which no two parts are the same object.
        content, changes = json.loads(json.dumps(BASES[base])), yaml.safe_load(wrong)
        for path, value in changes.items() if isinstance(changes, dict) else [(changes, None)]:
            set_at_path(content, path, value)
        load(content)
    pattern = f"{path} {sentence}" if sentence.startswith(("= ", "is ")) else sentence
    text = str(refusal.value)
    assert re.match(".*".join(map(re.escape, re.split(r"\s*\.\.\.\s*", pattern))), text), text
    assert "\n" not in text and ". " not in text and len(text) < 500, text


def test_values_just_inside_the_limits_are_allowed():
    # 17 teeth are the fewest that are not undercut without a shift.
    assert gear(teeth=17).shift == 0.0
    # 0.12 m is the centre distance without backlash.
    assert d.GearStage(gear(), gear(teeth=40), 0.1204).backlash > 0.0
    assert (
        len(train([a(name=x, torque=0.0) for x in GEARS_202[:-1]], MESHES_201[:-1]).meshes) == 200
    )

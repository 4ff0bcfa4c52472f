"""What single values do not tell: drawings that cannot be, trains that are locked, grids.

Each is refused in one sentence that names the key, the value and what is allowed.
"""

import json
import math
import re
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import inf
from pathlib import Path

import pytest
import yaml

import gearlib
from gearlib import Body, GearPair, GearTrain, LoadSharingPair, Shaft, Tabulated, planetary
from gearlib.config import ConfigError, load
from gearlib.geometry import GearStage, PathTable, SpurGear, Web, dynamic_factor, planetary_set
from tests.geometry.drawings import fzg_c
from tests.paper import CONFIG, PAPER
from tests.properties.known_models import DAMPED, GEARS, OSCILLATOR
from tests.unit.test_drawn_gears import FZG
from tests.unit.test_drawn_trains import OWN, SET

FOUR = {"teeth": 20, "module": "4 mm", "width": "20 mm"}
PAIRS = {
    "z20-20": {
        "pinion": {"teeth": 20, "module": "10 mm", "width": "30 mm"},
        "wheel": {"teeth": 20},
        "backlash": "50 um",
        "torque": "500 N m",
    },
    "FZG-C": FZG["gears"],
}
BASES = {
    "paper": CONFIG
    | {
        "mesh_stiffness": {"pairs": PAIRS},
        "harris_map": {"gears": FZG["gears"]},
        "failures": {"trials": [{"name": name, "method": "rk4"} for name in ("rk4-64", "rk4-200")]},
        "labels": {"start": 0.5, "stop": 1.4, "step": 0.01},
    },
    "fzg": FZG,
    "twenty": FZG | {"gears": {"pinion": FOUR, "wheel": {"teeth": 40}, "torque": 100.0}},
    "planetary_set": CONFIG | {"train": {"kind": "planetary_set", "planetary_set": SET}},
    "own": CONFIG | {"train": {"kind": "own", "own": OWN}},
}
TEXT = Path(__file__).with_name("combinations.yaml").read_text(encoding="utf-8")
ROWS = [
    pytest.param(base, *row.split(" | "), id=f"{base}: {row.split(' | ')[0]}")
    for base, rows in yaml.safe_load(TEXT).items()
    for row in rows.splitlines()
]


def says(text, pattern):
    """Return whether a sentence begins with a pattern whose dots stand for anything."""
    parts = re.split(r"\s*\.\.\.\s*", pattern)
    return re.match(".*".join(map(re.escape, parts)), text) is not None


def set_at_path(settings, path, value):
    """Set a value at a path such as `scenes.k1.cases[0].tuning`, in place; None removes the key."""
    # Keys are separated by dots, indices stand in brackets; a number as a key has no path below it.
    parts = re.findall(r"([^.[\]]+)(?!\])|\[(\d+)\]", path) if isinstance(path, str) else []
    *parents, key = [int(index) if index else name for name, index in parts] or [path]
    for part in parents:
        settings = settings[part] if isinstance(part, int) else settings.setdefault(part, {})
    if value is None:
        del settings[key]
    else:
        settings[key] = value


@pytest.mark.parametrize(("base", "change", "sentence"), ROWS)
def test_inconsistent_settings_are_refused_in_one_sentence(base, change, sentence):
    # A copy in which no two parts are the same object.
    settings, changes = json.loads(json.dumps(BASES[base])), yaml.safe_load(change)
    # A row with nothing but a path removes its key.
    for path, value in changes.items() if isinstance(changes, dict) else [(changes, None)]:
        set_at_path(settings, path, value)
    with pytest.raises(ConfigError) as refusal:
        load(settings)
    (text,) = str(refusal.value).splitlines()
    key = f"{path} " if sentence.startswith(("= ", "is ")) else ""
    assert says(text, key + sentence) and ". " not in text and len(text) < 500, text


A = Body(name="a", inertia=0.01, base_radius=0.1, teeth=20, torque=100.0)
B = Body(name="b", inertia=0.02, base_radius=0.2, teeth=40, torque=200.0)
C = Body(name="c", inertia=0.02, base_radius=0.2, teeth=40)
AB = gearlib.Mesh(pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5)
CA = replace(AB, pinion="c", wheel="a", name="c-a")
BC = replace(AB, pinion="b", wheel="c", name="b-c")
LARGE = Body(name="r", inertia=0.5, base_radius=0.3, teeth=60)

#: Copies of the pair of the paper, of the bodies a and b and of their mesh with other values.
paper = PAPER.replace
a, b, ab = (partial(replace, element) for element in (A, B, AB))
shaft = partial(Shaft, stiffness=1.0)
gear = partial(SpurGear, teeth=20, module=4e-3, width=0.02)
planet = partial(SpurGear, module=3e-3, width=0.025)
web = partial(Web, thickness=0.01, rim_diameter=0.06, hub_diameter=0.04)
pair = partial(GearPair.from_geometry, fzg_c())
factor = partial(dynamic_factor, fzg_c(), 302.0, rpm=100.0)
error = partial(fzg_c().transmission_error, torque=300.0)
sharing = partial(LoadSharingPair, pair=pair(torque=1.0), stage=fzg_c())
sweep = partial(gearlib.sweep, PAPER, periods=2, record_periods=1)
reducer = partial(gearlib.split_power_reducer, PAPER)


def planets(z_sun=27, z_planet=36, z_ring=99, distance=None, ring_module=3e-3, **options):
    ring = planet(teeth=z_ring, internal=True, outer_diameter=0.34, module=ring_module)
    gears = planet(teeth=z_sun), planet(teeth=z_planet), ring
    return planetary_set(*gears, centre_distance=distance, torque=100.0, **options)


def train(bodies=(A, B), meshes=(AB,), **more):
    return GearTrain(bodies=bodies, meshes=meshes, **more)


def simulate(tuning=0.8, model=PAPER, **options):
    return gearlib.simulate(model, tuning, **{"periods": 2} | options)


def run_up(*speeds, model=PAPER, **options):
    return gearlib.run_up(model, *speeds, **options)


#: Sentence of the refusal, `...` for what is left out -> the refused call.
LIBRARY = {
    # Numbers beyond those of a machine.
    "load = 1000000 ... > 0": lambda: paper(load=10**320),
    "max_stiffness = 1e-200 ... from 1e-30 to 1e+30": lambda: paper(max_stiffness=1e-200),
    "material_damping = 1e+200 ... a damping ratio of 1e+30": lambda: paper(material_damping=1e200),
    "samples_per_period = 1000000000 with record_periods = 1 ... 2 GB": lambda: simulate(
        samples_per_period=10**9
    ),
    "strobes = 1000000000 at 1 values ... 2 GB": lambda: gearlib.bifurcation_diagram(
        PAPER, [0.8], strobes=10**9
    ),
    "count = 1000000000 ... from 1 to 1000": lambda: planetary().campbell(10**9),
    f"teeth = {2**63} ... from 1 to 10000": lambda: paper(teeth=2**63),
    # One gear.
    "tip_diameter = 0.069 ... above 0.07": lambda: gear(tip_diameter=0.069),
    "web.rim_diameter = 0.08 ... 0.07 m": lambda: gear(web=web(rim_diameter=0.08)),
    "web.hub_diameter = 0.04 ... 0.05": lambda: gear(bore=0.05, web=web()),
    "position = (1.0, 1.0) ... increasing": lambda: PathTable((1.0, 1.0), (0.0, 0.0)),
    "a table of 1 positions and 0 values ... many": lambda: PathTable((1.0,), ()),
    # Two gears.
    "pinion.internal = True ... False": lambda: GearStage(gear(teeth=60, internal=True), gear()),
    # Stiffness and load.
    "hertz ... torque": lambda: fzg_c().stiffness(
        Tabulated((0.0, 1.0), (1e8, 2e8)), hertz="constant"
    ),
    "torque = None ... > 0": lambda: fzg_c().stiffness("energy", hertz="logarithmic"),
    "speed is missing ... where power": lambda: pair(power=1e3),
    "material_damping = 1000000.0 ... < ": lambda: pair(torque=1.0, material_damping=1e6),
    "damping_ratio is missing": lambda: simulate(model=pair(torque=1.0)),
    "speed = 3000.0 ... dimensionless": lambda: simulate(
        None, GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.6), speed=3e3
    ),
    "tunings out of order ... increasing": lambda: sweep([0.7, 0.5], direction="up"),
    "damping_ratio = -0.1 ... >= 0": lambda: pair(torque=1.0, damping_ratio=-0.1),
    "logarithmic_decrement = inf ... >= 0": lambda: pair(torque=1.0, logarithmic_decrement=inf),
    "quality = None ... deviations": factor,
    "rpm = [100.0, -1.0] ... > 0": lambda: factor(rpm=[100.0, -1.0]),
    "rpm = [] ": lambda: factor(pitch_deviation=0.0, form_deviation=0.0, rpm=[]),
    "rpm = 'fast' ... > 0": lambda: factor(rpm="fast"),
    "torque = [] ... at least one": lambda: error(torque=[]),
    "coupling = 1.5 ... from 0 to 1": lambda: error(coupling=1.5),
    "stiffness = 0 N/m ... > 0 all along": lambda: error(stiffness=PathTable((0.0,), (0.0,))),
    "pitch_errors = 1e-06 ... a sequence": lambda: error(pitch_errors=1e-6),
    "pitch_errors = (0.0, 1e-06) ... one value": lambda: sharing(pitch_errors=(0, 1e-6)).at_load(),
    # Trains.
    "mass of body a = None ... where the support is elastic": lambda: a(support_stiffness=1e8),
    "support_stiffness[1] of body a = -1.0 ... >= 0 (inf": lambda: a(support_stiffness=(1e8, -1.0)),
    "support_stiffness of body a = ... one value or a list of 2": lambda: a(
        support_stiffness=(1e8,) * 3
    ),
    "eccentricity of body a = 1e-06 ... 0 for a body without teeth": lambda: a(
        teeth=None, eccentricity=1e-6
    ),
    "bodies of a shaft = ('a', 'a') ... two bodies": lambda: shaft(bodies=("a", "a")),
    "line_of_action of mesh a-b = 1.0 ... left out where position": lambda: ab(
        position=0.0, line_of_action=1.0
    ),
    "bodies[1] = 'b' ... a Body": lambda: train(bodies=[A, "b"]),
    "meshes = [] ... at least one entry, each a GearStage": lambda: train(meshes=[]),
    "bodies = ... the name 'a' must occur once": lambda: train(bodies=(A, A)),
    "wheel of mesh a-b = 'x' ... one of 'a', 'b'": lambda: train(meshes=[ab(wheel="x")]),
    "bodies of a shaft = 'x' ... one of 'a', 'b'": lambda: train(shafts=[shaft(bodies=("a", "x"))]),
    "carrier of body b = 'x' ... one of 'a', 'b'": lambda: train((A, b(carrier="x"))),
    "carrier of body b = 'b' ... which no carrier carries": lambda: train((A, b(carrier="b"))),
    "driving of mesh a-b = 'x' ... one of 'a', 'b'": lambda: ab(driving="x"),
    "wheel of mesh a-b = 'a' ... another body than the pinion": lambda: train(
        meshes=[ab(wheel="a")]
    ),
    "teeth of body b = None ... in mesh a-b": lambda: train((A, b(teeth=None))),
    "base_radius of body b = 0.21 ... 0.2 to have the base pitch": lambda: train(
        (A, b(base_radius=0.21))
    ),
    "teeth of body a = 20 ... more than the 40 of b": lambda: train(
        meshes=[ab(pinion="b", wheel="a", internal=True)]
    ),
    "teeth of body ... the train is locked": lambda: train((A, B, C), (AB, BC, CA)),
    "mesh c-r ... connected with the reference mesh a-b": lambda: train(
        (A, B, C, LARGE), (AB, ab(pinion="c", wheel="r", name="c-r"))
    ),
    "torque of bodies a, b ... must balance ... with 200 N m on b": lambda: train(
        (A, b(torque=-200.0))
    ),
    "support_stiffness of body a = ... the same along x and y in a turning frame": lambda: train(
        (a(mass=1.0, support_stiffness=(1e8, 2e8)), B), gyroscopic=True
    ),
    "... at least one of them must be able to move": lambda: train(
        (a(torsional_stiffness=inf), b(torsional_stiffness=inf))
    ),
    "planets = 4 ... (z_s + z_r) / N = (27 + 99) / 4 ... an integer": lambda: planetary(planets=4),
    "position of mesh ring 2 = 2.0 ... (z_s + z_r) / N an integer": lambda: planetary(
        positions=[0.0, 2.0, 4.0]
    ),
    "teeth = (27, 98) ... an even number": lambda: planetary(teeth=(27, 98)),
    "planet_teeth = 80 ... fit into the ring": lambda: planetary(planet_teeth=80),
    "teeth = ... one centre distance, ... 0.12 m in the first, 0.128 m": lambda: reducer(
        teeth=(24, 36, 24, 40)
    ),
    "backlashes[0] = 1e-05 ... 2 entries": lambda: reducer(backlashes=(1e-5,) * 3),
    "gear = 'a' ... a gearlib.geometry.SpurGear": lambda: Body.from_gear("a", "b"),
    "mesh = None ... a gearlib.geometry.GearStage": lambda: gearlib.Mesh.from_geometry(
        None, "a", "b"
    ),
    "initial_state = ... 'static'": lambda: planetary().check_state(("a", "b")),
    "phase = nan ... finite": lambda: planetary().static(phase=math.nan),
    # Planetary sets of drawn gears.
    "ring.internal = False ... True": lambda: planetary_set(*[planet(teeth=36)] * 3, torque=1.0),
    "contact_ratio of the ring mesh = 0.99 ... >= 1": lambda: planets(27, 34, 97, 0.092),
    # A centre distance makes up for two teeth, but the tips of the ring begin too far inside.
    "ring.tip_diameter = 0.291 ... begins 0.0102": lambda: planets(27, 37, 99, 0.096),
    "planets = 3 ... axes are": lambda: planets(positions=[0.0, math.tau * 10 / 126, math.pi]),
    "ring.module = 0.002 ... 0.003": lambda: planets(ring_module=2e-3),
    # Calls.
    "initial_state = (inf, 0.0) ... must be": lambda: simulate(initial_state=(inf, 0.0)),
    "tuning and speed are missing ... one of the two": lambda: simulate(None),
    "tuning = 0.7 with speed = 3000.0 ... one of the two": lambda: simulate(0.7, speed=3000.0),
    "support_stiffness ... 20,000 times": lambda: simulate(0.5, reducer(support_stiffness=1e18)),
    "speed = 10.0 ... nothing turns": lambda: simulate(None, OSCILLATOR, speed=10.0),
    "tunings = [] ... must be": lambda: sweep([]),
    "tunings contains 0.8 twice": lambda: sweep([0.8, 0.8]),
    "upper_stiffness = 0.0 and lower_stiffness": lambda: gearlib.DeadZoneOscillator(
        upper_stiffness=0.0, lower_stiffness=0.0, lower_edge=-1.0
    ),
    "... the stiffness falls to -0.25": lambda: gearlib.Series(1.0, gearlib.Harmonics((1.25,))),
    "to = 0.9 ": lambda: gearlib.continue_orbit(gearlib.periodic_orbit(DAMPED, 0.9), to=0.9),
    "... must be after 0.0 s": lambda: run_up(speed=[(0.0, 5.0), (0.0, 6.0)]),
    "duration and acceleration are missing": lambda: run_up(10.0, 20.0),
    "... base_radius = None": lambda: run_up(1.0, 2.0, duration=1.0, driven_mass=1.0),
    "... <= 6,250,000 mesh periods": lambda: run_up(0.0, 2e3, duration=15_700.0),
    "... must be piecewise linear": lambda: run_up(
        10.0, 20.0, model=gearlib.OneDegreePair(pair=PAPER, cubic_damping=1.0), duration=1.0
    ),
    "... gyroscopic": lambda: run_up(
        10.0, 20.0, model=planetary(turning=True, gyroscopic=True), duration=1.0
    ),
    "... without any damping": lambda: gearlib.basins(PAPER, 0.75, ([0.0], [0.0])),
    "... memory": lambda: gearlib.basins(DAMPED, 0.75, ((0.0, 1.0, 40_000),) * 2),
    "method = 'rk4' ... one degree of freedom": lambda: simulate(model=GEARS, method="rk4"),
    "values = [0.5] ... left out where parameter is None": lambda: gearlib.tongues(
        PAPER, values=[0.5]
    ),
    "states = ('x', 0.0) ... 2 numbers, or": lambda: gearlib.lyapunov_exponents(
        PAPER, [0.8], states=("x", 0.0)
    ),
}


@pytest.mark.parametrize("sentence", LIBRARY)
def test_impossible_models_and_calls_are_refused_in_one_sentence(sentence):
    with pytest.raises(ValueError) as refusal:
        LIBRARY[sentence]()
    text = str(refusal.value)
    assert says(text, sentence), text
    assert "\n" not in text and ". " not in text and len(text) < 500, text


def test_values_just_inside_the_limits_are_allowed():
    # 17 teeth are the fewest that are not undercut without a shift.
    assert gear(teeth=17).shift == 0.0
    # 0.12 m is the centre distance without backlash.
    assert GearStage(gear(), gear(teeth=40), 0.1204).backlash > 0.0


def test_trains_have_at_most_200_meshes():
    names = [f"g{i}" for i in range(202)]
    bodies = [a(name=name, torque=0.0) for name in names]
    meshes = [ab(pinion=pinion, wheel=wheel, name=pinion) for pinion, wheel in pairwise(names)]
    assert len(train(bodies[:-1], meshes[:-1]).meshes) == 200
    with pytest.raises(ValueError, match="at most 200"):
        train(bodies, meshes)

"""What single values do not tell: drawings that cannot be, trains that are locked, grids.

Each is refused in one sentence that names the key, the value and what is allowed.
"""

import json
import math
import re
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path

import pytest
import yaml

import gearlib
from gearlib import Body, GearPair, GearTrain, LoadSharingPair, Shaft, Tabulated, planetary
from gearlib.config import ConfigError, load
from gearlib.geometry import Mesh, PathTable, Rack, SpurGear, TipRelief, Web, dynamic_factor
from tests.geometry.drawings import fzg_c, gears_of_20_teeth, ring
from tests.paper import CONFIG, PAPER
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
    assert says(text, key + sentence), text


GEAR = {"teeth": 20, "module": 4e-3, "width": 0.02}
PLANETS = {"module": 3e-3, "width": 0.025}
A = Body(name="a", inertia=0.01, base_radius=0.1, teeth=20, torque=100.0)
B = Body(name="b", inertia=0.02, base_radius=0.2, teeth=40, torque=200.0)
C = Body(name="c", inertia=0.02, base_radius=0.2, teeth=40)
AB = gearlib.Mesh(pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5)
CA = replace(AB, pinion="c", wheel="a", name="c-a")
BC = replace(AB, pinion="b", wheel="c", name="b-c")
LARGE = Body(name="r", inertia=0.5, base_radius=0.3, teeth=60)

gear = partial(SpurGear, **GEAR)
inner = partial(SpurGear, **GEAR | {"teeth": 60, "internal": True})
ring_of_planets = partial(SpurGear, **PLANETS, teeth=99, internal=True)
web = partial(Web, thickness=0.01, rim_diameter=0.06, hub_diameter=0.04)
energy = partial(gears_of_20_teeth().stiffness, "energy")
pair = partial(GearPair.from_geometry, fzg_c())
factor = partial(dynamic_factor, fzg_c(), 302.0, rpm=100.0)
error = partial(fzg_c().transmission_error, torque=300.0)
sharing = partial(LoadSharingPair, pair=pair(torque=1.0), drawing=fzg_c())
sweep = partial(gearlib.sweep, PAPER, periods=2, record_periods=1)
split_power_reducer = partial(gearlib.split_power_reducer, PAPER)


def mesh(distance=None, backlash=None, wheel=None, **changes):
    return Mesh(gear(), wheel or gear(**{"teeth": 40} | changes), distance, backlash)


def planets(teeth=(27, 36, 99), ring=None, **options):
    sun, planet = (SpurGear(teeth=z, **PLANETS) for z in teeth[:2])
    ring = ring or ring_of_planets(teeth=teeth[2], outer_diameter=0.34)
    return gearlib.geometry.planetary_set(sun, planet, ring, **{"torque": 100.0} | options)


def train(bodies=(A, B), meshes=(AB,), **more):
    return GearTrain(bodies=bodies, meshes=meshes, **more)


def simulate(tuning=0.8, **options):
    return gearlib.simulate(PAPER, tuning, **{"periods": 2} | options)


DAMPED = PAPER.replace(material_damping=4e3)
SIX_DEGREES = gearlib.SixDegreePair(
    **{"pair": PAPER, "base_radii": (0.1, 0.1), "inertias": (0.06, 0.06)},
    **{"masses": (17.0, 17.0), "bearing_stiffness": (1e8,) * 4},
)
OSCILLATOR = gearlib.DeadZoneOscillator(lower_edge=-1.0, upper_stiffness=2.0, damping=0.1)
#: Sentence of the refusal, `...` for what is left out -> the refused call.
LIBRARY = {
    # Numbers beyond those of a machine.
    "load = 1000000 ... > 0": lambda: PAPER.replace(load=10**320),
    "max_stiffness = 1e-200 ... from 1e-30 to 1e+30": lambda: PAPER.replace(max_stiffness=1e-200),
    "material_damping = 1e+200 ... a damping ratio of 1e+30": lambda: PAPER.replace(
        material_damping=1e200
    ),
    "samples_per_period = 1000000000 with record_periods = 1 ... 2 GB": lambda: simulate(
        samples_per_period=10**9
    ),
    "strobes = 1000000000 at 1 values ... 2 GB": lambda: gearlib.bifurcation_diagram(
        PAPER, [0.8], strobes=10**9
    ),
    "count = 1000000000 ... from 1 to 1000": lambda: planetary().campbell(10**9),
    f"teeth = {2**63} ... from 1 to {2**63 - 1}": lambda: PAPER.replace(teeth=2**63),
    # One gear.
    "shift = 0.0 ... undercuts": lambda: gear(teeth=12),
    "tip_diameter = 0.0992 ... pointed": lambda: gear(shift=1.4),
    "tip_diameter = 0.069 ... above 0.07": lambda: gear(tip_diameter=0.069),
    "tip_diameter = 0.22 ... from 0.225526 to 0.25 m": lambda: inner(tip_diameter=0.22),
    "teeth of the ring gear = 25 ... larger": lambda: inner(teeth=25),
    "bore = 0.075 ... < 0.07 m": lambda: gear(bore=0.075),
    "bore = 0.1 ... 0 for a ring": lambda: inner(bore=0.1),
    "outer_diameter = 0.24 ... above the root circle": lambda: inner(outer_diameter=0.24),
    "outer_diameter = 0.1 ... only a ring gear": lambda: gear(outer_diameter=0.1),
    "outer_diameter = None ... above": lambda: inner().inertia,
    "thickness of the web = 0.03 ... 0.02": lambda: gear(web=web(thickness=0.03)),
    "rim_diameter of the web = 0.08 ... 0.07 m": lambda: gear(web=web(rim_diameter=0.08)),
    "hub_diameter of the web = 0.04 ... 0.05": lambda: gear(bore=0.05, web=web()),
    "rim_diameter of a web = 0.06 ... 0.07": lambda: web(hub_diameter=0.07),
    "tip_radius of a rack = 1.3 ... 1.25": lambda: Rack(tip_radius=1.3),
    "dedendum of a rack = 2.3 ... <= 2.158": lambda: gear(teeth=40, rack=Rack(dedendum=2.3)),
    "amount of a tip relief = 0.02 ... 0.00139": lambda: gear(
        tip_relief=TipRelief(amount=0.02, length=1e-3)
    ),
    "pitch_errors = (1e-06,) ... 20 numbers, one for each tooth": lambda: gear(
        pitch_errors=(1e-6,)
    ),
    "position = (1.0, 1.0) ... increase": lambda: PathTable((1.0, 1.0), (0.0, 0.0)),
    "a table of 1 positions and 0 values ... many": lambda: PathTable((1.0,), ()),
    # Two gears.
    "internal of the pinion = True ... False": lambda: Mesh(inner(), gear()),
    "module of the wheel = 0.005 ... 0.004": lambda: mesh(module=5e-3),
    f"pressure_angle of the wheel = 0.4 ... {math.radians(20.0)!r}": lambda: mesh(
        pressure_angle=0.4
    ),
    "helix_angle of the wheel = 0.2 ... 0.0": lambda: mesh(helix_angle=0.2),
    "teeth of the ring gear = 60 ... >= 71": lambda: Mesh(gear(teeth=70), inner()),
    "centre_distance = 0.112 ... > 0.112763 m": lambda: mesh(0.112),
    "contact_ratio = 0. ... >= 1": lambda: mesh(0.1245),
    "backlash = -6 ... centre_distance": lambda: mesh(0.1199),
    "tip_diameter of the wheel = 0.172 ... interference": lambda: mesh(tip_diameter=0.172),
    "tip_diameter of the pinion = 0.088 ... clearance": lambda: mesh(
        teeth=80, rack=Rack(addendum=0.9, dedendum=0.99, tip_radius=0.0)
    ),
    "teeth of the ring gear = 60 ... tip interference": lambda: Mesh(
        gear(teeth=56), inner(tip_diameter=0.2362)
    ),
    "length of the tip relief of the wheel = 0.006 ... <= 0.0058125 m": lambda: replace(
        fzg_c(), wheel=replace(fzg_c().wheel, tip_relief=TipRelief(amount=1e-5, length=6e-3))
    ),
    # Stiffness and load.
    "coupling ... torque": lambda: gears_of_20_teeth().stiffness("iso", coupling=1.0),
    "hertz ... torque": lambda: gears_of_20_teeth().stiffness(
        Tabulated((0.0, 1.0), (1e8, 2e8)), hertz="constant"
    ),
    "coupling = 2 ... from 0 to 1": lambda: energy(coupling=2),
    "hertz = 'log' ... 'logarithmic'": lambda: energy(hertz="log"),
    "torque = None ... > 0": lambda: energy(hertz="logarithmic"),
    "bore of the pinion = 0.15 ... 0.125": lambda: gears_of_20_teeth(bore=0.15).stiffness("energy"),
    "options = [1] ... a mapping": lambda: pair(torque=1.0, options=[1]),
    "torque is missing ... power and speed": pair,
    "speed is missing ... where power": lambda: pair(power=1e3),
    "torque = 210000.0 ... at most": lambda: pair(torque=2.1e5),
    "speed = 1000000000.0 ... rpm": lambda: pair(power=1e3, speed=1e9),
    "damping_ratio = 5 ... < 1": lambda: pair(torque=1.0, damping_ratio=5),
    "material_damping = 1000000.0 ... < ": lambda: pair(torque=1.0, material_damping=1e6),
    "damping_ratio is missing": lambda: gearlib.simulate(pair(torque=1.0), 0.5, periods=1),
    "speed = 3000.0 ... dimensionless": lambda: gearlib.simulate(
        GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.6), speed=3e3, periods=1
    ),
    "tunings out of order ... increasing": lambda: sweep([0.7, 0.5], direction="up"),
    "speed = 0.0 ... > 0": lambda: pair(power=1e3, speed=0.0),
    "torque = -1.0 ... > 0": lambda: pair(torque=-1.0),
    "damping_ratio and material_damping ... one of them": lambda: pair(
        torque=1.0, damping_ratio=0.1, material_damping=1.0
    ),
    "damping_ratio = -0.1 ... >= 0": lambda: pair(torque=1.0, damping_ratio=-0.1),
    "logarithmic_decrement = inf ... >= 0": lambda: pair(torque=1.0, logarithmic_decrement=inf),
    "quality = None ... deviations": factor,
    "rpm = [100.0, -1.0] ... > 0": lambda: factor(rpm=[100.0, -1.0]),
    "rpm = [] ": lambda: dynamic_factor(gears_of_20_teeth(quality=5), 300.0, []),
    "rpm = 'fast' ... > 0": lambda: factor(rpm="fast"),
    "torque = -1.0 ... >= 0": lambda: error(torque=[1.0, -1.0]),
    "torque = [] ... at least one": lambda: error(torque=[]),
    "stiffness = 'fem' ... 'energy'": lambda: error(stiffness="fem"),
    "coupling = 1.5 ... from 0 to 1": lambda: error(coupling=1.5),
    "stiffness = 0 N/m ... > 0 all along": lambda: error(stiffness=PathTable((0.0,), (0.0,))),
    "deviation = 1e-05 ... a PathTable": lambda: error(deviation=1e-5),
    "pitch_errors[0] = inf ... finite": lambda: error(pitch_errors=[inf]),
    "pitch_errors = 1e-06 ... a sequence": lambda: error(pitch_errors=1e-6),
    "stiffness = PathTable ... one of 'energy', 'iso'": lambda: LoadSharingPair.from_geometry(
        fzg_c(), torque=1.0, stiffness=PathTable((0.0,), (1e8,))
    ),
    "pitch_errors = (0.0, 1e-06) ... one value": lambda: sharing(
        pitch_errors=(0.0, 1e-6)
    ).at_load(),
    # Trains.
    "mass of body a = None ... where the support is elastic": lambda: replace(
        A, support_stiffness=1e8
    ),
    "support_stiffness of body a, y = -1.0 ... >= 0 (infinity: rigid)": lambda: replace(
        A, support_stiffness=(1e8, -1.0)
    ),
    "support_stiffness of body a = ... one or two numbers": lambda: replace(
        A, support_stiffness=(1e8, 1e8, 1e8)
    ),
    "eccentricity of body a = 1e-06 ... 0 for a body without teeth": lambda: replace(
        A, teeth=None, eccentricity=1e-6
    ),
    "bodies of a shaft = ('a', 'a') ... two bodies": lambda: Shaft(
        bodies=("a", "a"), stiffness=1.0
    ),
    "line_of_action of mesh a-b = 1.0 ... left out where position": lambda: replace(
        AB, position=0.0, line_of_action=1.0
    ),
    "bodies = ... a sequence of Body": lambda: train(bodies=[A, "b"]),
    "meshes = [] ... a sequence of Mesh": lambda: train(meshes=[]),
    "bodies = ... the name 'a' must occur once": lambda: train(bodies=(A, A)),
    "wheel of mesh a-b = 'x' ... one of 'a', 'b'": lambda: train(meshes=[replace(AB, wheel="x")]),
    "bodies of a shaft = 'x' ... one of 'a', 'b'": lambda: train(
        shafts=[Shaft(bodies=("a", "x"), stiffness=1.0)]
    ),
    "carrier of body b = 'x' ... one of 'a', 'b'": lambda: train((A, replace(B, carrier="x"))),
    "carrier of body b = 'b' ... which no carrier carries": lambda: train(
        (A, replace(B, carrier="b"))
    ),
    "driving of mesh a-b = 'x' ... one of 'a', 'b'": lambda: replace(AB, driving="x"),
    "wheel of mesh a-b = 'a' ... another body than the pinion": lambda: train(
        meshes=[replace(AB, wheel="a")]
    ),
    "teeth of body b = None ... in mesh a-b": lambda: train(bodies=(A, replace(B, teeth=None))),
    "base_radius of body b = 0.21 ... 0.2 to have the base pitch": lambda: train(
        (A, replace(B, base_radius=0.21))
    ),
    "teeth of body a = 20 ... more than the 40 of b": lambda: train(
        meshes=[replace(AB, pinion="b", wheel="a", internal=True)]
    ),
    "teeth of body ... the train is locked": lambda: train((A, B, C), (AB, BC, CA)),
    "mesh c-r ... connected with the reference mesh a-b": lambda: train(
        (A, B, C, LARGE), (AB, replace(AB, pinion="c", wheel="r", name="c-r"))
    ),
    "torque of bodies a, b ... must balance on the free rotation": lambda: train(
        (A, replace(B, torque=0.0))
    ),
    "torque of bodies a, b ... must balance": lambda: train(bodies=(A, replace(B, torque=-200.0))),
    "support_stiffness of body a = ... the same along x and y in a turning frame": lambda: train(
        (replace(A, mass=1.0, support_stiffness=(1e8, 2e8)), B), gyroscopic=True
    ),
    "... at least one of them must be able to move": lambda: train(
        [replace(body, torsional_stiffness=inf) for body in (A, B)]
    ),
    "planets = 4 ... (z_s + z_r) / N = (27 + 99) / 4 ... an integer": lambda: planetary(planets=4),
    "position of mesh ring 2 = 2.0 ... (z_s + z_r) / N an integer": lambda: planetary(
        positions=[0.0, 2.0, 4.0]
    ),
    "teeth = (27, 98) ... an even number": lambda: planetary(teeth=(27, 98)),
    "planet_teeth = 80 ... fit into the ring": lambda: planetary(planet_teeth=80),
    "teeth = ... one centre distance, ... 0.12 m in the first, 0.128 m": lambda: (
        split_power_reducer(teeth=(24, 36, 24, 40))
    ),
    "backlashes[0] = 1e-05 ... 2 values": lambda: split_power_reducer(backlashes=(1e-5,) * 3),
    "gear = 'a' ... a gearlib.geometry.SpurGear": lambda: Body.from_gear("a", "b"),
    "mesh = None ... a gearlib.geometry.Mesh": lambda: gearlib.Mesh.from_geometry(None, "a", "b"),
    "mesh = 'gears' ... Mesh": lambda: GearPair.from_geometry("gears", torque=1.0),
    "initial_state = ... 'static'": lambda: planetary().check_state(("a", "b")),
    "phase = nan ... finite": lambda: planetary().static(phase=math.nan),
    # Planetary sets of drawn gears.
    "internal of the ring = False ... True": lambda: planets(ring=SpurGear(teeth=36, **PLANETS)),
    "teeth of the ring = 36 ... z_s + 2 z_p = 27 + 2 * 36 = 99, or": lambda: planets(
        ring=ring_of_planets(teeth=36)
    ),
    "teeth of the ring = 99 ... 27 + 2 * 96 = 219, or": lambda: planets(
        (27, 96, 99), centre_distance=0.1845
    ),
    "contact_ratio of the ring mesh = 0.99 ... >= 1": lambda: planets(
        (27, 34, 97), centre_distance=0.092
    ),
    # A centre distance makes up for two teeth, but the tips of the ring begin too far inside.
    "tip_diameter of the ring = 0.291 ... begins 0.0102": lambda: planets(
        (27, 37, 99), centre_distance=0.096
    ),
    "teeth of the ring = 99 ... 27 + 2 * 33 = 93, or": lambda: planets((27, 33, 99)),
    "teeth of the ring = 99 ... 27 + 2 * 37 = 101, or": lambda: planets((27, 37, 99)),
    "planets = 4 ... (27 + 99) / 4": lambda: planets(planets=4),
    "planets = 6 ... axes are": lambda: planets(planets=6),
    "planets = 3 ... axes are": lambda: planets(positions=[0.0, math.tau * 10 / 126, math.pi]),
    "positions[1] = 2.0 ... 0.0498666": lambda: planets(positions=[0.0, 2.0, 4.0]),
    "positions = (0.0, 1.0) ... 3 values": lambda: planets(positions=[0.0, 1.0]),
    "module of the ring = 0.002 ... 0.003": lambda: planets(ring=ring_of_planets(module=2e-3)),
    "outer_diameter = None ... ring gear": lambda: planets(ring=ring_of_planets()),
    "backlashes[1] = -1 ... >= 0": lambda: planets(backlashes=(1e-5, -1e-5)),
    "damping_ratio and material_damping ... one of": lambda: planets(
        damping_ratio=0.1, material_damping=1.0
    ),
    # Calls.
    "initial_state = (0.0,) ... must be": lambda: simulate(initial_state=(0.0,)),
    "initial_state = (inf, 0.0) ... must be": lambda: simulate(initial_state=(inf, 0.0)),
    "tuning = None with speed = None ... one of the": lambda: simulate(None),
    "tuning = 0.7 with speed = 3000.0 ... one of the two": lambda: simulate(0.7, speed=3000.0),
    "support_stiffness ... 20,000 times": lambda: gearlib.simulate(
        split_power_reducer(support_stiffness=1e18), 0.5, periods=1
    ),
    "speed = 10.0 ... nothing turns": lambda: gearlib.simulate(OSCILLATOR, speed=10.0, periods=1),
    "tunings = [] ... must be": lambda: sweep([]),
    "tunings[1] = -1.0 ... must be": lambda: sweep([0.8, -1.0]),
    "tunings[0] = -0.8 ... must be": lambda: sweep([-0.8, -1.0]),
    "tunings contains 0.8 twice": lambda: sweep([0.8, 0.8]),
    "tunings = [0.7] with speeds = [3000.0] ": lambda: sweep([0.7], speeds=[3000.0]),
    "speeds[1] = -1.0 ... > 0": lambda: sweep(speeds=[3000.0, -1.0]),
    "speeds contains 10.0 twice": lambda: sweep(speeds=[10.0, 10.0]),
    "upper_stiffness = 0.0 and lower_stiffness": lambda: gearlib.DeadZoneOscillator(
        upper_stiffness=0.0, lower_stiffness=0.0, lower_edge=-1.0
    ),
    "... the stiffness falls to -0.25": lambda: gearlib.Series(1.0, gearlib.Harmonics((1.25,))),
    "to = 0.9 ": lambda: gearlib.continue_orbit(gearlib.periodic_orbit(DAMPED, 0.9), to=0.9),
    "... must be after 0.0 s": lambda: gearlib.run_up(PAPER, speed=[(0.0, 5.0), (0.0, 6.0)]),
    "... one of the two": lambda: gearlib.run_up(PAPER, 10.0, 20.0),
    "... base_radius = None": lambda: gearlib.run_up(
        PAPER, 1.0, 2.0, duration=1.0, driven_mass=1.0
    ),
    "... <= 6,250,000 mesh periods": lambda: gearlib.run_up(PAPER, 0.0, 2e3, duration=15_700.0),
    "... must be piecewise linear": lambda: gearlib.run_up(
        gearlib.OneDegreePair(pair=PAPER, cubic_damping=1.0), 10.0, 20.0, duration=1.0
    ),
    "... gyroscopic": lambda: gearlib.run_up(
        planetary(turning=True, gyroscopic=True), 10.0, 20.0, duration=1.0
    ),
    "... without any damping": lambda: gearlib.basins(PAPER, 0.75, ([0.0], [0.0])),
    "... memory": lambda: gearlib.basins(DAMPED, 0.75, ((0.0, 1.0, 40_000),) * 2),
    "method = 'rk4' ... one degree of freedom": lambda: gearlib.simulate(
        SIX_DEGREES, 0.9, periods=1, method="rk4"
    ),
    "values = [0.5] ... left out where parameter is None": lambda: gearlib.tongues(
        PAPER, values=[0.5]
    ),
    "states = ('x', 0.0) ... 2 numbers, or": lambda: gearlib.lyapunov_exponents(
        PAPER, [0.8], states=("x", 0.0)
    ),
    "pair = 'x' ... one degree of freedom": lambda: gearlib.schmidt("x", 0.8),
}


@pytest.mark.parametrize("sentence", LIBRARY)
def test_impossible_models_and_calls_are_refused_in_one_sentence(sentence):
    with pytest.raises(ValueError) as refusal:
        LIBRARY[sentence]()
    text = str(refusal.value)
    assert says(text, sentence), text
    assert "\n" not in text and ". " not in text and len(text) < 500, text


def test_models_just_inside_the_limits_are_allowed():
    # 17 teeth are the fewest that are not undercut without a shift.
    assert gear(teeth=17).shift == 0.0
    assert ring().contact_ratio > 1.8
    # 0.12 m is the centre distance without backlash.
    assert mesh(0.1204).backlash > 0.0
    assert train().phases == {"a-b": 0.0}
    # Planets stand at whole multiples of 2 pi / (27 + 99), here 42 and 90 of them.
    assert planetary(positions=[math.tau * steps / 126 for steps in (0, 42, 90)]).size == 36


def test_trains_have_at_most_200_meshes():
    count = 200
    # Torques at the ends of the allowed chain balance; neighbours turn in opposite directions.
    torques = {0: 100.0, count: 100.0 * (-1.0) ** (count + 1)}
    bodies = [replace(A, name=f"g{i}", torque=torques.get(i, 0.0)) for i in range(count + 2)]
    meshes = [
        replace(AB, pinion=f"g{i}", wheel=f"g{i + 1}", name=f"mesh {i}") for i in range(count + 1)
    ]
    assert len(train(bodies[:-1], meshes[:-1]).meshes) == count
    with pytest.raises(ValueError, match=f"at most {count}"):
        train(bodies, meshes)

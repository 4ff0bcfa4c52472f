"""Drawings that cannot be: each refused in one sentence with key, value and what is allowed."""

import math

import pytest

from gearlib import GearPair, Harmonics, Tabulated
from gearlib.geometry import Material, Mesh, Rack, SpurGear, Web, dynamic_factor, mesh_stiffness
from tests.geometry.drawings import fzg_c, ring, twenty

GEAR = {"teeth": 20, "module": 4e-3, "width": 0.02}
RING = {"teeth": 60, "module": 4e-3, "width": 0.02, "internal": True}


def gear(**changes):
    return SpurGear(**GEAR | changes)


def mesh(distance=None, backlash=None, wheel=None, **changes):
    return Mesh(gear(), wheel or gear(**{"teeth": 40} | changes), distance, backlash)


def web(**changes):
    return Web(**{"thickness": 0.01, "rim_diameter": 0.06, "hub_diameter": 0.04} | changes)


def energy(**options):
    return twenty().stiffness("energy", **options)


def pair(**options):
    return GearPair.from_geometry(fzg_c(), **options)


def factor(rpm=100.0, **options):
    return dynamic_factor(fzg_c(), 302.0, rpm, **options)


REFUSED = {
    # One gear.
    "teeth": (lambda: gear(teeth=2), "teeth = 2 ", ">= 3"),
    "half a tooth": (lambda: gear(teeth=20.5), "teeth = 20.5 ", "integer"),
    "module": (lambda: gear(module=0.0), "module = 0.0 ", "> 0"),
    "width": (lambda: gear(width=-0.02), "width = -0.02 ", "> 0"),
    "shift": (lambda: gear(shift=4), "shift = 4 ", "from -3 to 3"),
    "degrees": (lambda: gear(pressure_angle=20), "pressure_angle = 20 ", "< pi / 4"),
    "helix": (lambda: gear(helix_angle=-0.1), "helix_angle = -0.1 ", ">= 0"),
    "thicker": (
        lambda: gear(thickness_allowance=1e-5),
        "thickness_allowance = 1e-05 ",
        "<= 0",
    ),
    "internal": (lambda: gear(internal="yes"), "internal = 'yes' ", "one of False, True"),
    "no options": (lambda: pair(torque=1.0, options=[1]), "options = [1] ", "a mapping"),
    "mesh of a stiffness": (
        lambda: mesh_stiffness(None),
        "mesh = None ",
        "a gearlib.geometry.Mesh",
    ),
    "no table": (lambda: Tabulated(None, 1.0), "phase = None ", "a sequence of numbers"),
    "no harmonics": (lambda: Harmonics(1.0), "cosines = 1.0 ", "a sequence of numbers"),
    "rack": (lambda: gear(rack="E"), "rack = 'E' ", "one of 'A', 'B', 'C', 'D'"),
    "material": (lambda: gear(material="steel"), "material = 'steel' ", "a Material"),
    "undercut": (lambda: gear(teeth=12), "shift = 0.0 ", "undercuts"),
    "pointed": (lambda: gear(shift=1.4), "tip_diameter = 0.0992 ", "pointed"),
    "tip below root": (lambda: gear(tip_diameter=0.069), "tip_diameter = 0.069 ", "above 0.07"),
    "ring tip below its base": (
        lambda: SpurGear(**RING | {"tip_diameter": 0.22}),
        "tip_diameter = 0.22 ",
        "from 0.225526 to 0.25 m",
    ),
    "small ring": (
        lambda: SpurGear(**RING | {"teeth": 25}),
        "tip_diameter = 0.092 ",
        "base and root",
    ),
    "bore": (lambda: gear(bore=0.075), "bore = 0.075 ", "< 0.07 m"),
    "bore of a ring": (lambda: SpurGear(**RING | {"bore": 0.1}), "bore = 0.1 ", "0 for a ring"),
    "rim of a ring": (
        lambda: SpurGear(**RING | {"outer_diameter": 0.24}),
        "outer_diameter = 0.24 ",
        "above the root circle",
    ),
    "rim of a gear": (
        lambda: gear(outer_diameter=0.1),
        "outer_diameter = 0.1 ",
        "only a ring gear",
    ),
    "inertia of a ring": (lambda: SpurGear(**RING).inertia, "outer_diameter = None ", "above"),
    "thick web": (lambda: gear(web=web(thickness=0.03)), "thickness of the web = 0.03 ", "0.02"),
    "web in the teeth": (
        lambda: gear(web=web(rim_diameter=0.08)),
        "rim_diameter of the web = 0.08 ",
        "0.07 m",
    ),
    "web in the bore": (
        lambda: gear(bore=0.05, web=web()),
        "hub_diameter of the web = 0.04 ",
        "0.05",
    ),
    "no web": (lambda: gear(web=0.01), "web = 0.01 ", "a Web"),
    "hub beyond rim": (lambda: web(hub_diameter=0.07), "rim_diameter of a web = 0.06 ", "0.07"),
    "young": (lambda: Material(young=0), "young of a material = 0 ", "> 0"),
    "poisson": (lambda: Material(poisson=0.5), "poisson of a material = 0.5 ", "< 0.5"),
    "dedendum": (lambda: Rack(dedendum=-1), "dedendum of a rack = -1 ", "> 0"),
    "tip round": (lambda: Rack(tip_radius=1.3), "tip_radius of a rack = 1.3 ", "1.25"),
    "pointed rack": (
        lambda: gear(teeth=40, rack=Rack(dedendum=2.3)),
        "dedendum of a rack = 2.3 ",
        "<= 2.158",
    ),
    # Two gears.
    "no gear": (lambda: mesh(wheel="wheel"), "wheel = 'wheel' ", "a SpurGear"),
    "ring as pinion": (
        lambda: Mesh(SpurGear(**RING), gear()),
        "internal of the pinion = True ",
        "False",
    ),
    "modules": (lambda: mesh(module=5e-3), "module of the wheel = 0.005 ", "0.004"),
    "pressure angles": (
        lambda: mesh(pressure_angle=0.4),
        "pressure_angle of the wheel = 0.4 ",
        repr(math.radians(20.0)),
    ),
    "helices": (lambda: mesh(helix_angle=0.2), "helix_angle of the wheel = 0.2 ", "0.0"),
    "ring smaller than pinion": (
        lambda: Mesh(SpurGear(**GEAR | {"teeth": 70}), SpurGear(**RING)),
        "teeth of the ring gear = 60 ",
        ">= 71",
    ),
    "too close": (lambda: mesh(0.112), "centre_distance = 0.112 ", "> 0.112763 m"),
    "contact ratio": (lambda: mesh(0.1245), "contact_ratio = 0.", ">= 1"),
    "negative backlash": (lambda: mesh(0.1199), "backlash = -6", "centre_distance"),
    "given backlash": (lambda: mesh(backlash=-1e-5), "backlash = -1e-05 ", ">= 0"),
    "interference": (
        lambda: mesh(wheel=gear(teeth=40, tip_diameter=0.172)),
        "tip_diameter of the wheel = 0.172 ",
        "interference",
    ),
    "tip in the root": (
        lambda: mesh(teeth=80, rack=Rack(addendum=0.9, dedendum=0.99, tip_radius=0.0)),
        "tip_diameter of the pinion = 0.088 ",
        "clearance",
    ),
    "tips of ring and pinion": (
        lambda: Mesh(gear(teeth=56), SpurGear(**RING | {"tip_diameter": 0.2362})),
        "teeth of the ring gear = 60 ",
        "tip interference",
    ),
    # Stiffness.
    "method": (lambda: twenty().stiffness("fem"), "stiffness = 'fem' ", "'energy'"),
    "option": (lambda: twenty().stiffness("iso", coupling=1.0), "coupling ", "torque"),
    "option of a table": (
        lambda: twenty().stiffness(Tabulated((0.0, 1.0), (1e8, 2e8)), hertz="constant"),
        "hertz ",
        "torque",
    ),
    "coupling": (lambda: energy(coupling=2), "coupling = 2 ", "from 0 to 1"),
    "hertz": (lambda: energy(hertz="log"), "hertz = 'log' ", "'logarithmic'"),
    "hertz without load": (lambda: energy(hertz="logarithmic"), "torque = None ", "> 0"),
    "samples": (lambda: energy(samples=4), "samples = 4 ", ">= 8"),
    "large bore": (
        lambda: twenty(bore=0.15).stiffness("energy"),
        "bore of the pinion = 0.15 ",
        "0.125",
    ),
    "application factor": (
        lambda: twenty().stiffness("iso", application_factor=0.0),
        "application_factor = 0.0 ",
        "> 0",
    ),
    # The dynamic factor.
    "class": (lambda: gear(quality=12), "quality = 12 ", "from 1 to 11"),
    "half a class": (lambda: gear(quality=5.5), "quality = 5.5 ", "integer"),
    "no class": (lambda: factor(), "quality = None ", "deviations"),
    "rpm": (lambda: factor([100.0, -1.0]), "rpm = [100.0, -1.0] ", "> 0"),
    "rpm in words": (lambda: factor("fast"), "rpm = 'fast' ", "> 0"),
    "pitch deviation": (
        lambda: factor(pitch_deviation=-1e-6),
        "pitch_deviation = -1e-06 ",
        ">= 0",
    ),
    "form deviation": (
        lambda: factor(pitch_deviation=0.0, form_deviation=math.nan),
        "form_deviation = nan ",
        ">= 0",
    ),
    "tip relief": (
        lambda: factor(pitch_deviation=0.0, form_deviation=0.0, tip_relief=-1e-6),
        "tip_relief = -1e-06 ",
        ">= 0",
    ),
    "torque of the factor": (
        lambda: dynamic_factor(fzg_c(quality=5), 0.0, 100.0),
        "torque = 0.0 ",
        "> 0",
    ),
    "no torque of the factor": (
        lambda: dynamic_factor(fzg_c(quality=5), None, 100.0),
        "torque = None ",
        "> 0",
    ),
    # The pair.
    "no mesh": (lambda: GearPair.from_geometry("gears", torque=1.0), "mesh = 'gears' ", "Mesh"),
    "torque": (lambda: pair(torque=-1.0), "torque = -1.0 ", "> 0"),
    "no load": (lambda: pair(), "torque = None ", "either torque"),
    "power without speed": (
        lambda: pair(power=1e3),
        "torque = None with power = 1000.0 ",
        "power and speed",
    ),
    "speed": (lambda: pair(power=1e3, speed=0.0), "speed = 0.0 ", "> 0"),
    "two dampings": (
        lambda: pair(torque=1.0, damping_ratio=0.1, material_damping=1.0),
        "damping_ratio and material_damping ",
        "one of them",
    ),
    "damping": (lambda: pair(torque=1.0, damping_ratio=-0.1), "damping_ratio = -0.1 ", ">= 0"),
    "decrement": (
        lambda: pair(torque=1.0, logarithmic_decrement=math.inf),
        "logarithmic_decrement = inf ",
        ">= 0",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_one_sentence_with_key_value_and_range(case):
    call, key, allowed = REFUSED[case]
    with pytest.raises(ValueError) as error:
        call()
    message = str(error.value)
    assert message.startswith(key), message
    assert allowed in message and "not allowed" in message, message
    assert "\n" not in message and ". " not in message, message


def test_what_is_just_allowed():
    assert gear(teeth=17).shift == 0.0
    assert ring().contact_ratio > 1.8
    assert mesh(0.1204).backlash > 0.0


def test_bounds_that_belong_to_a_range_are_taken():
    assert Material(poisson=0.0).poisson == 0.0


@pytest.mark.parametrize("kind", [Material, Rack, SpurGear, Web])
def test_parts_of_a_drawing_take_their_values_by_name(kind):
    with pytest.raises(TypeError, match="positional"):
        kind(0.01, 0.06, 0.04)

"""Drawn gears in the section `train`: what the library makes of them, and what is refused."""

import inspect
import math

import pytest

import gearlib
from gearlib import Body, GearTrain, Shaft
from gearlib.config import load, train_section
from gearlib.geometry import Mesh, SpurGear, planetary_set
from gearlib.models.from_values import train_from_description
from tests.paper import CONFIG

SET = {
    "sun": {"teeth": 24, "module": "3 mm", "width": "25 mm", "shift": 0.3, "bore": "20 mm"},
    "planet": {"teeth": 37, "shift": 0.25},
    "ring": {"teeth": 99, "shift": -0.55, "outer_diameter": "340 mm"},
    "planets": 3,
    "torque": "200 N m",
    "backlashes": ["60 um", "80 um"],
    "damping_ratio": 0.05,
    "backlash_damping_ratio": 0.01,
    "support_stiffness": [1e8, ".inf", 1e8, 1e8],
    "torsional_stiffness": [0.0, 1e9, 0.0],
    "structural_damping": "1 us",
    "carrier_mass": 5.0,
    "carrier_inertia": 0.05,
    "centre_distance": "93.132 mm",
    "positions": [0.0, "120 deg", "240 deg"],
    "pin_errors": [[0.0, "10 um"], [0.0, 0.0], [0.0, 0.0]],
    "turning": True,
    "driving": "ring",
    "gyroscopic": True,
}
OWN = {
    "bodies": [
        {"name": "motor", "inertia": 0.02, "base_radius": 0.05, "torque": 90.0},
        {
            "name": "pinion",
            "gear": {"teeth": 21, "module": "4 mm", "width": "30 mm", "shift": 0.2},
        },
        {
            "name": "idler",
            "gear": {"teeth": 37, "module": "4 mm", "width": "30 mm"},
            "support_stiffness": [5e8, 5e8],
        },
        {
            "name": "wheel",
            "gear": {"teeth": 42, "module": "4 mm", "width": "30 mm"},
            "torque": -180.0,
        },
    ],
    "shafts": [{"bodies": ["motor", "pinion"], "stiffness": "200 kN m/rad"}],
    "meshes": [
        {
            "pinion": "pinion",
            "wheel": "idler",
            "position": 0.0,
            "damping_ratio": 0.05,
            "torque": 90.0,
            "centre_distance": "117 mm",
        },
        {
            "pinion": "idler",
            "wheel": "wheel",
            "direction": -1,
            "stiffness": "energy",
            "stiffness_options": {"coupling": 0.5},
            "material_damping": 1500.0,
            "backlash": "50 um",
        },
    ],
}


def read(kind, section):
    settings = load({**CONFIG, "train": {"kind": kind, kind: section}})
    return train_from_description(**settings.train_parameters("k1"))


def test_a_planetary_set_is_that_of_the_library():
    missing = set(train_section.PlanetarySet.model_fields) - set(SET)
    one_of = {"power", "speed", "logarithmic_decrement", "material_damping"}
    assert missing == one_of | {"stiffness", "stiffness_options"}
    arguments = set(inspect.signature(planetary_set).parameters) - {"options", "more"}
    assert arguments == set(train_section.PlanetarySet.model_fields) - {
        "power",
        "speed",
        "stiffness_options",
    }
    common = {"module": 3e-3, "width": 0.025}
    expected = planetary_set(
        SpurGear(teeth=24, shift=0.3, bore=0.02, **common),
        SpurGear(teeth=37, shift=0.25, **common),
        SpurGear(teeth=99, shift=-0.55, outer_diameter=0.34, internal=True, **common),
        torque=200.0,
        backlashes=(60e-6, 80e-6),
        damping_ratio=0.05,
        backlash_damping_ratio=0.01,
        support_stiffness=(1e8, math.inf, 1e8, 1e8),
        torsional_stiffness=(0.0, 1e9, 0.0),
        structural_damping=1e-6,
        carrier_mass=5.0,
        carrier_inertia=0.05,
        centre_distance=93.132e-3,
        # 120 and 240 degrees, rounded once.
        positions=[0.0, 2.0943951023931957, 4.188790204786391],
        pin_errors=[(0.0, 10e-6), (0.0, 0.0), (0.0, 0.0)],
        driving="ring",
        gyroscopic=True,
    )
    assert read("planetary_set", SET) == expected
    power = {key: value for key, value in SET.items() if key != "torque"}
    # 200 N m at 3000 / pi rpm, to the 12 digits that are kept.
    power |= {"power": "20 kW", "speed": "100 rad/s"}
    found = read("planetary_set", power)
    assert found.by_name["sun"].torque == pytest.approx(expected.by_name["sun"].torque, rel=1e-11)


def test_a_train_of_ones_own_of_drawn_gears():
    common = {"module": 4e-3, "width": 0.03}
    pinion, idler, wheel = (
        SpurGear(teeth=z, shift=x, **common) for z, x in ((21, 0.2), (37, 0.0), (42, 0.0))
    )
    expected = GearTrain(
        bodies=[
            Body(name="motor", inertia=0.02, base_radius=0.05, torque=90.0),
            Body.from_gear(pinion, "pinion"),
            Body.from_gear(idler, "idler", support_stiffness=5e8),
            Body.from_gear(wheel, "wheel", torque=-180.0),
        ],
        shafts=[Shaft(bodies=("motor", "pinion"), stiffness=2e5)],
        meshes=[
            gearlib.Mesh.from_geometry(
                Mesh(pinion, idler, 0.117),
                "pinion",
                "idler",
                position=0.0,
                damping_ratio=0.05,
                torque=90.0,
            ),
            gearlib.Mesh.from_geometry(
                Mesh(idler, wheel),
                "idler",
                "wheel",
                direction=-1,
                stiffness="energy",
                options={"coupling": 0.5},
                material_damping=1500.0,
                backlash=50e-6,
            ),
        ],
    )
    assert read("own", OWN) == expected


def test_motions_ask_for_a_damping_and_rest_does_not():
    section = {key: value for key, value in SET.items() if "damping_ratio" not in key}
    train = {"kind": "planetary_set", "planetary_set": section}
    settings = load(CONFIG | {"train": train, "targets": ["train_sweep"]})
    assert "train.planetary_set.damping_ratio is missing" in settings.missing_train_damping()[0]
    undamped = train_from_description(**settings.train_parameters("k1"))
    assert undamped.modes().mode.size and undamped.campbell(1).mode.size
    assert not undamped.static(0.0).status
    with pytest.raises(ValueError, match="damping_ratio of mesh sun 1 is missing"):
        gearlib.simulate(undamped, 0.5, periods=1)

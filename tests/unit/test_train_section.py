"""The section `train` of a configuration: it says all that the library takes, and builds that."""

import inspect
from dataclasses import replace
from pathlib import Path

import pint
import pytest
import yaml

import gearlib
from gearlib import Body, GearTrain, Shaft
from gearlib.config import load, train_section
from gearlib.geometry import GearStage, SpurGear, planetary_set
from gearlib.models.from_values import build_model
from tests.paper import CONFIG

REGISTRY = pint.UnitRegistry()
EVERY = yaml.safe_load(Path("tests/every_train.yaml").read_text(encoding="utf-8"))
SET = yaml.safe_load("""
{sun: {teeth: 24, module: 3 mm, width: 25 mm, shift: 0.3, bore: 20 mm},
 planet: {teeth: 37, shift: 0.25}, ring: {teeth: 99, shift: -0.55, outer_diameter: 340 mm},
 planets: 3, torque: 200 N m, backlashes: [60 um, 80 um], centre_distance: 93.132 mm,
 damping_ratio: 0.05, backlash_damping_ratio: 0.01, structural_damping: 1 us,
 support_stiffness: [100000000.0, .inf, 100000000.0, 100000000.0],
 torsional_stiffness: [0.0, 1000000000.0, 0.0], carrier_mass: 5.0, carrier_inertia: 0.05,
 positions: [0.0, 120 deg, 240 deg], pin_errors: [[0.0, 10 um], [0.0, 0.0], [0.0, 0.0]],
 turning: true, driving: ring, gyroscopic: true, model: rectangle}
""")
OWN = yaml.safe_load("""
bodies:
- {name: motor, inertia: 0.02, base_radius: 0.05, torque: 90.0}
- {name: pinion, gear: {teeth: 21, module: 4 mm, width: 30 mm, shift: 0.2, bore: 25 mm}}
- name: idler
  gear: {teeth: 37, module: 4 mm, width: 30 mm}
  support_stiffness: [500000000.0, 500000000.0]
- {name: wheel, gear: {teeth: 42, module: 4 mm, width: 30 mm}, torque: -180.0}
shafts:
- {bodies: [motor, pinion], stiffness: 200 kN m/rad}
meshes:
- {pinion: pinion, wheel: idler, position: 0.0, damping_ratio: 0.05, torque: 90.0,
   centre_distance: 117 mm}
- {pinion: idler, wheel: wheel, direction: -1, stiffness: energy,
   stiffness_options: {coupling: 0.5}, material_damping: 1500.0, backlash: 50 um}
""")


def assert_values_match_texts(text, value):
    """Assert that the values of a section equal its texts with units, entry by entry."""
    if isinstance(text, (dict, list)):
        assert len(text) == len(value)
        for key in text if isinstance(text, dict) else range(len(text)):
            assert_values_match_texts(text[key], value[key])
    elif isinstance(value, float) and isinstance(text, str):
        # The base units of pint are SI units; conversion factors are rounded.
        expected = REGISTRY.Quantity(text).to_base_units().magnitude
        assert value == pytest.approx(expected, rel=1e-14), text


def read(kind, section):
    """Return the train of a configuration section of some kind."""
    settings = load(CONFIG | {"train": {"kind": kind, kind: section}})
    return build_model(settings.model_description("k1", "train"))


@pytest.mark.parametrize("kind", ["split_power_reducer", "planetary", "idler", "two_stage"])
def test_a_predefined_train_matches_the_library(kind):
    settings = load(CONFIG | {"train": EVERY | {"kind": kind}})
    section = getattr(settings.train, kind)
    assert section.model_dump().keys() == EVERY[kind].keys() == type(section).model_fields.keys()
    pair = () if kind == "planetary" else (build_model(settings.pair("k1")),)
    assert read(kind, EVERY[kind]) == getattr(gearlib, kind)(*pair, **section.model_dump())


def test_texts_are_read_in_si_units():
    assert_values_match_texts(EVERY, load(CONFIG | {"train": EVERY}).train.model_dump())
    # The example has all keys of parts except the keys of gear geometry, which OWN has.
    geometry = {"gear", "line_of_action", *train_section.GEOMETRY_KEYS} - {"material_damping"}
    for part, keys in (("Body", "bodies"), ("Shaft", "shafts"), ("Mesh", "meshes")):
        fields = getattr(train_section, f"{part}Part").model_fields
        assert fields.keys() - EVERY["own"][keys][0].keys() <= geometry


def test_a_configured_planetary_set_matches_the_library():
    """A section with every key must give the train of `planetary_set` with these arguments."""
    keys = set(train_section.PlanetarySet.model_fields)
    instead = {"power", "speed", "logarithmic_decrement", "material_damping"}
    assert keys - set(SET) == instead | {"stiffness", "stiffness_options", "stages"}
    arguments = set(inspect.signature(planetary_set).parameters) - {"options", "train_options"}
    assert arguments == keys - {"power", "speed", "stiffness_options"}
    values = load(CONFIG | {"train": {"planetary_set": SET}}).train.planetary_set.model_dump()
    gears = {name: values.pop(name) for name in ("sun", "planet", "ring")}
    assert not values.pop("stages")
    assert_values_match_texts({key: text for key, text in SET.items() if key not in gears}, values)
    common = {"module": 3e-3, "width": 0.025}
    sun = SpurGear(teeth=24, shift=0.3, bore=0.02, **common)
    planet = SpurGear(teeth=37, shift=0.25, **common)
    ring = SpurGear(teeth=99, shift=-0.55, internal=True, outer_diameter=0.34, **common)
    expected = planetary_set(sun, planet, ring, **values)
    assert read("planetary_set", SET) == expected
    # 20 kW at 100 rad/s are 200 N m, to the 12 digits that the configuration keeps.
    power = {key: value for key, value in SET.items() if key != "torque"}
    train = read("planetary_set", power | {"power": "20 kW", "speed": "100 rad/s"})
    assert train.by_name["sun"].torque == pytest.approx(expected.by_name["sun"].torque, rel=1e-11)


def test_a_configured_train_of_gear_geometry_matches_the_library():
    """Bodies, shafts and meshes of a section must match those built from the same geometry."""
    pinion, idler, wheel = (
        SpurGear(teeth=z, shift=x, module=4e-3, width=0.03, bore=bore)
        for z, x, bore in ((21, 0.2, 0.025), (37, 0.0, 0.0), (42, 0.0, 0.0))
    )
    bodies = [
        Body(name="motor", inertia=0.02, base_radius=0.05, torque=90.0),
        Body.from_gear(pinion, "pinion"),
        Body.from_gear(idler, "idler", support_stiffness=5e8),
        Body.from_gear(wheel, "wheel", torque=-180.0),
    ]
    # The twist of the pinion is part of its shaft.
    first = {"position": 0.0, "damping_ratio": 0.05, "torque": 90.0}
    first["options"] = {"twist": (False, True)}
    second = {"stiffness": "energy", "options": {"coupling": 0.5}, "material_damping": 1500.0}
    second |= {"direction": -1, "backlash": 50e-6, "torque": 90.0 * 37 / 21}
    make = gearlib.Mesh.from_geometry
    meshes = [
        make(GearStage(pinion, idler, 0.117), "pinion", "idler", **first),
        make(GearStage(idler, wheel), "idler", "wheel", **second),
    ]
    shafts = [Shaft(bodies=("motor", "pinion"), stiffness=2e5)]
    library_train, configured_train = (
        GearTrain(bodies=bodies, shafts=shafts, meshes=meshes),
        read("own", OWN),
    )
    # The torque of the second mesh follows from statics, which changes its rounding.
    for name in ("cosines", "sines"):
        coefficients = getattr(library_train.meshes[1].transmission_error, name)
        configured = getattr(configured_train.meshes[1].transmission_error, name)
        assert configured == pytest.approx(coefficients, rel=1e-9, abs=1e-15)
    second = replace(configured_train.meshes[1], transmission_error=meshes[1].transmission_error)
    assert configured_train.replace(meshes=(configured_train.meshes[0], second)) == library_train


def test_tooth_pairs_without_a_load_need_a_torque():
    gear = {"teeth": 30, "module": "3 mm", "width": "20 mm"}
    bodies = [{"name": name, "gear": gear} for name in "ab"]
    with pytest.raises(ValueError, match=r"^torque of mesh a-b is missing: .* do not load"):
        read("own", {"bodies": bodies, "meshes": [{"pinion": "a", "wheel": "b"}]})


def test_simulations_need_a_damping_and_modes_and_statics_do_not():
    section = {key: value for key, value in SET.items() if "damping_ratio" not in key}
    train = {"kind": "planetary_set", "planetary_set": section}
    (error,) = load(CONFIG | {"train": train, "targets": ["train_sweep"]}).train_damping_errors()
    assert error.startswith("train.planetary_set.damping_ratio is missing")
    undamped = read("planetary_set", section)
    assert undamped.modes().mode.size and undamped.campbell(1).mode.size
    assert not undamped.static(0.0).status
    with pytest.raises(ValueError, match="damping_ratio of mesh sun 1 is missing"):
        gearlib.simulate(undamped, 0.5, periods=1)

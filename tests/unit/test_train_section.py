"""Check that the section `train` of a configuration gives the same trains as the library."""

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

UNIT_REGISTRY = pint.UnitRegistry()
EVERY_TRAIN_KEY = yaml.safe_load(Path("tests/every_train.yaml").read_text(encoding="utf-8"))
PLANETARY_SET_SECTION = yaml.safe_load("""
{sun: {teeth: 24, module: 3 mm, width: 25 mm, shift: 0.3, bore: 20 mm},
 planet: {teeth: 37, shift: 0.25}, ring: {teeth: 99, shift: -0.55, outer_diameter: 340 mm},
 planets: 3, torque: 200 N m, backlashes: [60 um, 80 um], centre_distance: 93.132 mm,
 damping_ratio: 0.05, backlash_damping_ratio: 0.01, structural_damping: 1 us,
 support_stiffness: [100000000.0, .inf, 100000000.0, 100000000.0],
 torsional_stiffness: [0.0, 1000000000.0, 0.0], carrier_mass: 5.0, carrier_inertia: 0.05,
 positions: [0.0, 120 deg, 240 deg], pin_errors: [[0.0, 10 um], [0.0, 0.0], [0.0, 0.0]],
 turning: true, driving: ring, gyroscopic: true, model: rectangle}
""")
TRAIN_SECTION = yaml.safe_load("""
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


def assert_converted_to_si(section, converted_section):
    """Assert that each string with a unit in a section has been converted to SI units."""
    if isinstance(section, (dict, list)):
        assert len(section) == len(converted_section)
        for key in section if isinstance(section, dict) else range(len(section)):
            assert_converted_to_si(section[key], converted_section[key])
    elif isinstance(converted_section, float) and isinstance(section, str):
        # The base units of pint are SI units. Its conversion factors are rounded.
        expected = UNIT_REGISTRY.Quantity(section).to_base_units().magnitude
        assert converted_section == pytest.approx(expected, rel=1e-14), section


def train_of_section(kind, section):
    """Return the train that a configuration describes in the section of a kind of train."""
    settings = load(CONFIG | {"train": {"kind": kind, kind: section}})
    return build_model(settings.model_description("k1", "train"))


@pytest.mark.parametrize("kind", ["split_power_reducer", "planetary", "idler", "two_stage"])
def test_a_predefined_train_matches_the_library(kind):
    """A section with every key must give the train that the function of the library returns."""
    settings = load(CONFIG | {"train": EVERY_TRAIN_KEY | {"kind": kind}})
    section = getattr(settings.train, kind)
    assert (
        section.model_dump().keys()
        == EVERY_TRAIN_KEY[kind].keys()
        == type(section).model_fields.keys()
    )
    pair = () if kind == "planetary" else (build_model(settings.pair_description("k1")),)
    assert train_of_section(kind, EVERY_TRAIN_KEY[kind]) == getattr(gearlib, kind)(
        *pair, **section.model_dump()
    )


def test_strings_with_units_are_converted_to_si():
    """Each string in an example with every key of the section `train` must be converted."""
    assert_converted_to_si(
        EVERY_TRAIN_KEY, load(CONFIG | {"train": EVERY_TRAIN_KEY}).train.model_dump()
    )
    # The example must have all keys of bodies, shafts and meshes except those of gear geometry.
    geometry = {"gear", "line_of_action", *train_section.GEOMETRY_KEYS} - {"material_damping"}
    for part, keys in (("Body", "bodies"), ("Shaft", "shafts"), ("Mesh", "meshes")):
        fields = getattr(train_section, f"{part}Part").model_fields
        assert fields.keys() - EVERY_TRAIN_KEY["own"][keys][0].keys() <= geometry


def test_a_configured_planetary_set_matches_the_library():
    """A section with every key must give the train that `planetary_set` returns."""
    keys = set(train_section.PlanetarySet.model_fields)
    alternatives = {"power", "speed", "logarithmic_decrement", "material_damping"}
    assert keys - set(PLANETARY_SET_SECTION) == alternatives | {
        "stiffness",
        "stiffness_options",
        "stages",
    }
    arguments = set(inspect.signature(planetary_set).parameters) - {"options", "train_options"}
    assert arguments == keys - {"power", "speed", "stiffness_options"}
    values = load(
        CONFIG | {"train": {"planetary_set": PLANETARY_SET_SECTION}}
    ).train.planetary_set.model_dump()
    gears = {name: values.pop(name) for name in ("sun", "planet", "ring")}
    assert not values.pop("stages")
    section_without_gears = {
        key: value for key, value in PLANETARY_SET_SECTION.items() if key not in gears
    }
    assert_converted_to_si(section_without_gears, values)
    common = {"module": 3e-3, "width": 0.025}
    sun = SpurGear(teeth=24, shift=0.3, bore=0.02, **common)
    planet = SpurGear(teeth=37, shift=0.25, **common)
    ring = SpurGear(teeth=99, shift=-0.55, internal=True, outer_diameter=0.34, **common)
    expected = planetary_set(sun, planet, ring, **values)
    assert train_of_section("planetary_set", PLANETARY_SET_SECTION) == expected
    # A power of 20 kW at 100 rad/s is equivalent to 200 N m, up to the 12 digits of configurations.
    section_without_torque = {
        key: value for key, value in PLANETARY_SET_SECTION.items() if key != "torque"
    }
    section = section_without_torque | {"power": "20 kW", "speed": "100 rad/s"}
    train = train_of_section("planetary_set", section)
    assert train.by_name["sun"].torque == pytest.approx(expected.by_name["sun"].torque, rel=1e-11)


def test_a_configured_train_of_gear_geometry_matches_the_library():
    """Bodies, shafts and meshes of a section must match those computed from the same geometry."""
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
    # The twist of the pinion's body is not part of the mesh stiffness, but of its shaft.
    first_mesh = gearlib.Mesh.from_geometry(
        GearStage(pinion, idler, 0.117),
        "pinion",
        "idler",
        position=0.0,
        damping_ratio=0.05,
        torque=90.0,
        options={"twist": (False, True)},
    )
    second_mesh = gearlib.Mesh.from_geometry(
        GearStage(idler, wheel),
        "idler",
        "wheel",
        stiffness="energy",
        options={"coupling": 0.5},
        material_damping=1500.0,
        direction=-1,
        backlash=50e-6,
        torque=90.0 * 37 / 21,
    )
    meshes = [first_mesh, second_mesh]
    shafts = [Shaft(bodies=("motor", "pinion"), stiffness=2e5)]
    library_train = GearTrain(bodies=bodies, shafts=shafts, meshes=meshes)
    configured_train = train_of_section("own", TRAIN_SECTION)
    # The configuration gets the torque of the second mesh from statics, with other rounding errors.
    for name in ("cosines", "sines"):
        expected = getattr(library_train.meshes[1].transmission_error, name)
        coefficients = getattr(configured_train.meshes[1].transmission_error, name)
        assert coefficients == pytest.approx(expected, rel=1e-9, abs=1e-15)
    first_configured, second_configured = configured_train.meshes
    second_configured = replace(
        second_configured, transmission_error=second_mesh.transmission_error
    )
    assert configured_train.replace(meshes=(first_configured, second_configured)) == library_train


def test_tooth_pairs_without_a_load_need_a_torque():
    """If the bodies do not load a mesh of tooth pairs, the error must ask for its torque."""
    gear = {"teeth": 30, "module": "3 mm", "width": "20 mm"}
    bodies = [{"name": name, "gear": gear} for name in "ab"]
    with pytest.raises(ValueError, match=r"^torque of mesh a-b is missing: .* do not load"):
        train_of_section("own", {"bodies": bodies, "meshes": [{"pinion": "a", "wheel": "b"}]})


def test_simulations_need_damping_but_modes_and_statics_do_not():
    """Without a damping ratio, simulations must be refused, but modes and statics computed."""
    section = {
        key: value for key, value in PLANETARY_SET_SECTION.items() if "damping_ratio" not in key
    }
    train = {"kind": "planetary_set", "planetary_set": section}
    (error,) = load(CONFIG | {"train": train, "targets": ["train_sweep"]}).train_damping_errors()
    assert error.startswith("train.planetary_set.damping_ratio is missing")
    undamped = train_of_section("planetary_set", section)
    assert undamped.modes().mode.size and undamped.campbell(1).mode.size
    assert not undamped.static(0.0).status
    with pytest.raises(ValueError, match="damping_ratio of mesh sun 1 is missing"):
        gearlib.simulate(undamped, 0.5, periods=1)

"""Whose gears: own ones reach every study that can take them, and all say which they show."""

import pytest
import yaml

from gearlib.config import ConfigError, gear_names, load, overlay, overlay_gears
from gearlib.config.targets import TRAIN_TARGETS
from tests.paper import CONFIG

OWN = yaml.safe_load("""
gears:
  pinion: {teeth: 23, module: 2.5 mm, width: 18 mm}
  wheel: {teeth: 61}
  torque: 85 N m
  backlash: 80 um
dampings:
  light: {damping_ratio: 0.03, backlash_damping_ratio: 0.0}
""")
NAME = "gear pair z 23/61, m 2.5 mm"
PLANETS = yaml.safe_load("""
train:
  kind: planetary_set
  planetary_set:
    sun: {teeth: 27, module: 2 mm, width: 20 mm}
    planet: {teeth: 36}
    ring: {teeth: 99, outer_diameter: 240 mm}
    torque: 100 N m
""")


def relieved():
    """Return the configuration with 8 um of tip relief on both gears."""
    relief = {"tip_relief": {"amount": "8 um", "length": "2 mm"}}
    return overlay(OWN, {"gears": {"pinion": relief, "wheel": relief}})


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("scenes", "scenes = {} is not allowed"),
        ("claims", "gears is not allowed: its statements are about the paper's pair"),
        ("failures", "gears is not allowed: its problems have gears of their own"),
        ("reducer", "reducer.teeth is missing"),
        ("campbell", "reducer.teeth is missing"),
        ("train_sweep", "train.split_power_reducer.teeth is missing"),
    ],
)
def test_targets_that_do_not_support_gear_geometry_are_refused(target, words):
    with pytest.raises(ConfigError) as refusal:
        load(OWN | {"targets": [target]})
    assert str(refusal.value).startswith(words) and target in str(refusal.value)
    # Without an explicit request these targets are left out.
    assert target not in load(OWN).computed_targets()


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("harris_map", "harris_map.gears"),
        ("mesh_stiffness", "mesh_stiffness.pairs"),
        ("claims", "gear_pair is not allowed"),
        ("scenes", "scenes = {} is not allowed"),
        ("models", "scenes = {} is not allowed"),
    ],
)
def test_targets_of_gear_geometry_or_of_the_paper_are_refused_for_another_pair(target, words):
    other_pair = overlay_gears(CONFIG, {"gear_pair": {"max_stiffness": "3e8 N/m"}})
    (error,) = load(other_pair | {"targets": [target]}).target_errors()
    assert words in error and error.endswith(f"for the target {target}")
    # Default targets are not requested explicitly, and so are left out without an error.
    assert (
        load(other_pair).target_errors() == [] and target not in load(other_pair).computed_targets()
    )
    # A pair with another load still counts as the paper's pair.
    heavier = overlay_gears(CONFIG, {"gear_pair": {"load": 1e4}})
    assert target in load(heavier).computed_targets()


def test_default_targets_of_a_train_given_by_geometry_with_and_without_a_pair():
    train_alone = load(overlay_gears(overlay(CONFIG, PLANETS), PLANETS))
    assert train_alone.computed_targets() == [*TRAIN_TARGETS]
    train_and_pair = PLANETS | {"gear_pair": {"load": 1e3}}
    targets = load(
        overlay_gears(overlay(CONFIG, train_and_pair), train_and_pair)
    ).computed_targets()
    assert {*TRAIN_TARGETS, "resonance"} <= {*targets} and "reducer" not in targets
    # The target "reducer" is refused if it is requested.
    (words,) = load(CONFIG | PLANETS | {"targets": ["reducer", "campbell"]}).target_errors()
    assert words.startswith("train.kind = 'planetary_set' is not allowed: it must be split_")
    assert words.endswith(", for the target reducer")


def test_descriptions_of_gears_name_their_geometry():
    """Check descriptions of pairs, reducers and trains with helix, relief or neither."""
    helical = overlay(OWN, {"gears": {"pinion": {"helix_angle": "15 deg"}}})
    pairs = (OWN, NAME), (helical, f"{NAME}, β 15°"), (relieved(), f"{NAME}, tip relief")
    for settings, name in pairs:
        assert gear_names.gear_pair_name(load(settings)) == name
    left_out = gear_names.gear_pair_name(load(relieved()), modified=False)
    assert left_out == f"{NAME}, tip relief left out"
    reducer = load(OWN | {"reducer": {"teeth": [23, 61, 23, 61]}, "targets": ["reducer"]})
    assert gear_names.reducer_name(reducer) == f"reducer z 23/61/23/61, every mesh: {NAME}"
    idler = {"kind": "idler", "idler": {"teeth": [23, 61, 40]}}
    planetary = {"kind": "planetary", "planetary": {"planets": 4, "teeth": [28, 100]}}
    for train, name in (
        (PLANETS["train"], "planetary set z 27/36/99, m 2 mm"),
        (idler, f"idler train z 23/61/40, both meshes: {NAME}"),
        (planetary, "user-defined planetary set"),
    ):
        settings = load(OWN | {"train": train, "targets": ["train_sweep", "campbell"]})
        assert gear_names.train_name(settings) == name

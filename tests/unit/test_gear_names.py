"""Check which targets of the workflow support which gears, and the descriptions of gears."""

import pytest
import yaml

from gearlib.config import ConfigError, gear_names, load, overlay, overlay_gears
from gearlib.config.targets import TRAIN_TARGETS
from tests.paper import CONFIG

#: Configuration of a gear pair given by geometry.
GEOMETRY_CONFIG = yaml.safe_load("""
gears:
  pinion: {teeth: 23, module: 2.5 mm, width: 18 mm}
  wheel: {teeth: 61}
  torque: 85 N m
  backlash: 80 um
dampings:
  light: {damping_ratio: 0.03, backlash_damping_ratio: 0.0}
""")
#: Description of this gear pair.
PAIR_NAME = "gear pair z 23/61, m 2.5 mm"
PLANETARY_SET_CONFIG = yaml.safe_load("""
train:
  kind: planetary_set
  planetary_set:
    sun: {teeth: 27, module: 2 mm, width: 20 mm}
    planet: {teeth: 36}
    ring: {teeth: 99, outer_diameter: 240 mm}
    torque: 100 N m
""")


def config_with_tip_relief():
    """Return the configuration of the gears with a tip relief of 8 um on both."""
    relief = {"tip_relief": {"amount": "8 um", "length": "2 mm"}}
    return overlay(GEOMETRY_CONFIG, {"gears": {"pinion": relief, "wheel": relief}})


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("scenes", "scenes = {} is not allowed"),
        ("claims", "gears is not allowed: the claims concern the paper's pair"),
        ("failures", "gears is not allowed: the test problems have their own gears"),
        ("reducer", "reducer.teeth is missing"),
        ("campbell", "reducer.teeth is missing"),
        ("train_sweep", "train.split_power_reducer.teeth is missing"),
    ],
)
def test_targets_that_do_not_support_gear_geometry_are_refused(target, message):
    """A requested target must be refused by name if it cannot use gears given by geometry."""
    with pytest.raises(ConfigError) as refusal:
        load(GEOMETRY_CONFIG | {"targets": [target]})
    assert str(refusal.value).startswith(message) and target in str(refusal.value)
    # If they are not requested, these targets are omitted without an error.
    assert target not in load(GEOMETRY_CONFIG).computed_targets()


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("harris_map", "harris_map.gears"),
        ("mesh_stiffness", "mesh_stiffness.pairs"),
        ("claims", "gear_pair is not allowed"),
        ("scenes", "scenes = {} is not allowed"),
        ("models", "scenes = {} is not allowed"),
    ],
)
def test_targets_of_gear_geometry_or_of_the_paper_are_refused_for_another_pair(target, message):
    """For another pair given by parameters, these targets must be refused or omitted."""
    other_pair = overlay_gears(CONFIG, {"gear_pair": {"max_stiffness": "3e8 N/m"}})
    (error,) = load(other_pair | {"targets": [target]}).target_errors()
    assert message in error and error.endswith(f"for the target {target}")
    # If they are not requested, these targets are omitted without an error.
    assert load(other_pair).target_errors() == []
    assert target not in load(other_pair).computed_targets()
    # The paper's pair with another load still counts as the paper's pair.
    paper_pair_with_other_load = overlay_gears(CONFIG, {"gear_pair": {"load": 1e4}})
    assert target in load(paper_pair_with_other_load).computed_targets()


def test_default_targets_of_a_train_given_by_geometry_with_and_without_a_pair():
    """A train alone must have the targets of trains; with a pair, targets of pairs are added."""
    train_alone = load(overlay_gears(overlay(CONFIG, PLANETARY_SET_CONFIG), PLANETARY_SET_CONFIG))
    assert train_alone.computed_targets() == [*TRAIN_TARGETS]
    changes = PLANETARY_SET_CONFIG | {"gear_pair": {"load": 1e3}}
    train_and_pair = load(overlay_gears(overlay(CONFIG, changes), changes))
    targets = train_and_pair.computed_targets()
    assert {*TRAIN_TARGETS, "resonance"} <= {*targets} and "reducer" not in targets
    # The target "reducer" needs a split-power reducer.
    (error,) = load(
        CONFIG | PLANETARY_SET_CONFIG | {"targets": ["reducer", "campbell"]}
    ).target_errors()
    assert error.startswith("train.kind = 'planetary_set' is not allowed: it must be split_")
    assert error.endswith(", for the target reducer")


def test_descriptions_of_gears_name_their_geometry():
    """Descriptions of gears must state teeth and module, and a helix angle or a relief if any."""
    helical = overlay(GEOMETRY_CONFIG, {"gears": {"pinion": {"helix_angle": "15 deg"}}})
    for configuration, description in (
        (GEOMETRY_CONFIG, PAIR_NAME),
        (helical, f"{PAIR_NAME}, β 15°"),
        (config_with_tip_relief(), f"{PAIR_NAME}, tip relief"),
    ):
        assert gear_names.gear_pair_name(load(configuration)) == description
    # A model without flank modifications leaves out the relief.
    description = gear_names.gear_pair_name(load(config_with_tip_relief()), modified=False)
    assert description == f"{PAIR_NAME}, tip relief left out"
    reducer = load(
        GEOMETRY_CONFIG | {"reducer": {"teeth": [23, 61, 23, 61]}, "targets": ["reducer"]}
    )
    assert gear_names.reducer_name(reducer) == f"reducer z 23/61/23/61, every mesh: {PAIR_NAME}"
    idler = {"kind": "idler", "idler": {"teeth": [23, 61, 40]}}
    planetary = {"kind": "planetary", "planetary": {"planets": 4, "teeth": [28, 100]}}
    for train_section, description in (
        (PLANETARY_SET_CONFIG["train"], "planetary set z 27/36/99, m 2 mm"),
        (idler, f"idler train z 23/61/40, both meshes: {PAIR_NAME}"),
        (planetary, "user-defined planetary set"),
    ):
        targets = ["train_sweep", "campbell"]
        settings = load(GEOMETRY_CONFIG | {"train": train_section, "targets": targets})
        assert gear_names.train_name(settings) == description

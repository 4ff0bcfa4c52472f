"""Whose gears: own ones reach every study that can take them, and all say which they show."""

import json

import pytest
import yaml
from click.testing import CliRunner

from gearlib.cli import main
from gearlib.config import ConfigError, gear_names, load, overlay, overlay_gears
from gearlib.config.targets import TRAIN_TARGETS
from tests.workflow.project import ROOT

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


def test_a_helical_pair_is_no_spur_pair_of_the_same_teeth():
    helical = load(overlay(OWN, {"gears": {"pinion": {"helix_angle": "15 deg"}}}))
    assert gear_names.of_pair(load(OWN)) == NAME
    assert gear_names.of_pair(helical) == f"{NAME}, β 15°"


@pytest.mark.parametrize(
    ("target", "change", "words"),
    [
        ("harris_map", {"helix_angle": "12 deg"}, "gears.pinion.helix_angle is not allowed"),
        ("scenes", {}, "scenes = {} is not allowed"),
        ("claims", {}, "gears is not allowed: its statements are about the paper's pair"),
        ("failures", {}, "gears is not allowed: its problems have gears of their own"),
        ("reducer", {}, "reducer.teeth is missing"),
        ("campbell", {}, "reducer.teeth is missing"),
        ("train_sweep", {}, "train.split_power_reducer.teeth is missing"),
    ],
)
def test_targets_that_cannot_take_them_are_refused(target, change, words):
    gears = OWN["gears"] | {"pinion": OWN["gears"]["pinion"] | change}
    with pytest.raises(ConfigError) as refused:
        load(OWN | {"gears": gears, "targets": [target]})
    assert str(refused.value).startswith(words) and "\n" not in str(refused.value)
    assert target in str(refused.value)
    # Asked for nothing in particular, these are left out.
    assert target not in load(OWN | {"gears": gears}).wanted()


def test_trains_take_own_teeth_or_are_left_out():
    paper = yaml.safe_load((ROOT / "config.yaml").read_text(encoding="utf-8"))
    assert load(overlay_gears(overlay(paper, PLANETS), PLANETS)).wanted() == [*TRAIN_TARGETS]
    both = PLANETS | {"gear_pair": {"load": 1e3}}
    c = load(overlay_gears(overlay(paper, both), both))
    assert {*TRAIN_TARGETS, "resonance"} <= {*c.wanted()}
    assert "reducer" not in c.wanted()
    assert gear_names.of_train(c) == "planetary set z 27/36/99, m 2 mm"
    # Chosen by name it is refused.
    (words,) = load(paper | PLANETS | {"targets": ["reducer", "campbell"]}).refusals()
    assert words.startswith("train.kind = 'planetary_set' is not allowed: it must be split_")
    assert words.endswith(", for the target reducer")

    teeth = {"reducer": {"teeth": [23, 61, 23, 61]}}
    reducer = gear_names.of_reducer(load(OWN | teeth | {"targets": ["reducer"]}))
    assert reducer == f"reducer z 23/61/23/61, every mesh: {NAME}"
    idler = {"kind": "idler", "idler": {"teeth": [23, 61, 40]}}
    planetary = {"kind": "planetary", "planetary": {"planets": 4, "teeth": [28, 100]}}
    for train, words in [
        (idler, f"idler train z 23/61/40, both meshes: {NAME}"),
        (planetary, "user-defined planetary set"),
    ]:
        c = load(OWN | {"train": train, "targets": ["train_sweep", "campbell"]})
        assert gear_names.of_train(c) == words


@pytest.mark.parametrize(
    ("command", "mapping", "first"),
    [
        ("modes", PLANETS, "planetary set z 27/36/99, m 2 mm"),
        ("campbell", PLANETS, "planetary set z 27/36/99, m 2 mm"),
        ("static", {"train": {"kind": "planetary"}}, "Lin and Parker's planetary set"),
        ("phasing", OWN | {"train": {}}, f"paper's reducer (Fig. 1 a), every mesh: {NAME}"),
        ("gears", OWN, NAME),
    ],
)
def test_commands_say_first_whose_gears_they_are_about(tmp_path, command, mapping, first):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(mapping), encoding="utf-8")
    done = CliRunner().invoke(main, [command, "--config", str(path)])
    assert done.exit_code == 0, done.output
    assert done.output.splitlines()[0] == first
    if mapping is PLANETS:
        done = CliRunner().invoke(main, ["simulate", "--config", str(path), "--tuning", "1"])
        assert done.exit_code == 2 and "gears is missing" in done.output


def test_other_numbers_are_not_the_papers_pair():
    assert gear_names.of_numbers(gear_names.PAPER) == "paper's pair"
    assert "4.1e+08" in gear_names.of_numbers(gear_names.PAPER | {"max_stiffness": 4.1e8})


def relieved(**more):
    """Return the configuration with 8 um of tip relief at both gears."""
    own = json.loads(json.dumps(OWN))
    own["gears"] |= more
    for gear in ("pinion", "wheel"):
        own["gears"][gear]["tip_relief"] = {"amount": "8 um", "length": "2 mm"}
    return own


def test_targets_take_the_rectangle_of_relieved_gears_and_say_so():
    c, bare = load(relieved()), load(OWN)
    assert set(c.wanted()) == set(bare.wanted()) >= {"resonance", "basins", "tolerances"}
    assert c.pair_parameters("light") == bare.pair_parameters("light")
    assert gear_names.of_pair(c) == f"{NAME}, tip relief"

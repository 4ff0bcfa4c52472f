"""Whose gears: own ones reach every study that can take them, and all say which they show."""

import json

import pytest
import yaml
from click.testing import CliRunner

from gearlib.cli import main
from gearlib.config import OF_ANY_TRAIN, ConfigError, chosen, gear_names, load
from gearlib.config.laying import laid_over
from gearlib.config.studies import STUDIES
from gearlib.config.studies.study import text_of
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


def jobs_of(c, name):
    """Return what the jobs of a study get, as one text."""
    return repr([job.params(c) for job in STUDIES[name].jobs])


@pytest.mark.parametrize("name", ["mesh_stiffness", "harris_map"])
def test_own_gears_reach_the_studies_of_drawings(name):
    quality = {"pinion": {**OWN["gears"]["pinion"], "quality": 6}}
    quality["wheel"] = {"teeth": 61, "quality": 6}
    c = load(OWN | {"gears": OWN["gears"] | quality, "targets": [name]})
    assert "'teeth': 23" in jobs_of(c, name) and "'torque': 85.0" in jobs_of(c, name)
    assert "'teeth': 16" not in jobs_of(c, name) and STUDIES[name].gears(c) == NAME
    # Those that a section draws itself stay, and are named.
    paper = load(yaml.safe_load((ROOT / "config.yaml").read_text(encoding="utf-8")))
    assert "'teeth': 16" in jobs_of(paper, name) and "FZG type C" in STUDIES[name].gears(paper)


def test_every_study_names_its_gears_and_has_captions():
    c = load(OWN)
    for study in STUDIES.values():
        assert study.gears(c)
        for one in [*study.tables, *study.drawings]:
            assert text_of(one.caption, c)
    assert STUDIES["resonance"].gears(c) == NAME and NAME in STUDIES["reducer"].gears(c)
    # A helical pair is no spur pair of the same teeth.
    helical = load(laid_over(OWN, {"gears": {"pinion": {"helix_angle": "15 deg"}}}))
    assert STUDIES["resonance"].gears(helical) == f"{NAME}, β 15°"


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
    assert load(chosen(laid_over(paper, PLANETS), PLANETS)).wanted() == [*OF_ANY_TRAIN]
    both = PLANETS | {"gear_pair": {"load": 1e3}}
    c = load(chosen(laid_over(paper, both), both))
    assert {*OF_ANY_TRAIN, "resonance"} <= {*c.wanted()}
    assert "reducer" not in c.wanted()
    for name in OF_ANY_TRAIN:
        assert STUDIES[name].gears(c) == "planetary set z 27/36/99, m 2 mm"
        assert "'teeth': 99" in jobs_of(c, name) and "[24, 36, 24, 36]" not in jobs_of(c, name)
    assert "planetary set" in text_of(STUDIES["campbell"].drawings[0].caption, c)
    # Chosen by name it is refused.
    (words,) = load(paper | PLANETS | {"targets": ["reducer", "campbell"]}).refused()
    assert words.startswith("train.kind = 'planetary_set' is not allowed: it must be split_")
    assert words.endswith(", for the target reducer")

    teeth = {"reducer": {"teeth": [23, 61, 23, 61]}}
    own = {"train": {"kind": "idler", "idler": {"teeth": [23, 61, 40]}}}
    for name, given, words in [
        ("reducer", teeth, f"reducer z 23/61/23/61, every mesh: {NAME}"),
        ("campbell", teeth, f"reducer z 23/61/23/61, every mesh: {NAME}"),
        ("train_sweep", own, f"idler train z 23/61/40, both meshes: {NAME}"),
        ("campbell", own, f"idler train z 23/61/40, both meshes: {NAME}"),
        (
            "train_sweep",
            {"train": {"kind": "planetary", "planetary": {"planets": 4, "teeth": [28, 100]}}},
            "planetary set of own numbers",
        ),
    ]:
        c = load(OWN | given | {"targets": [name]})
        assert STUDIES[name].gears(c) == words


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
    assert STUDIES["resonance"].gears(c) == f"{NAME}, tip relief"
    for name in ("resonance", "run_ups", "tolerances"):
        caption = text_of(STUDIES[name].drawings[0].caption, c)
        assert f"jumps by 1/kappa = {1.0 / c.gear_pair.stiffness_ratio:.4g}" in caption
        assert "not a K_v" in caption
    assert "without tip relief" in text_of(STUDIES["mesh_stiffness"].drawings[0].caption, c)

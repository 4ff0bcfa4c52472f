"""The gallery: its cases are accepted, and give the numbers that are published of their gears."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from gearlib import GearPair, sweep
from gearlib.config import cases, load, overlay_gears
from gearlib.geometry import Material, Mesh
from gearlib.models.from_values import described
from gearlib.studies.trains import over_speed
from gearlib.tunings import grid
from tests.geometry.drawings import fzg_c, iso_example, twenty
from tests.paper import CONFIG

GALLERY = yaml.safe_load(Path("gallery.yaml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module", name="gallery")
def loaded():
    """Return name -> checked configuration."""
    return {name: load(mapping) for name, mapping in cases(GALLERY).items()}


def test_there_are_four_light_cases(gallery):
    assert list(gallery) == ["fzg_c", "iso_example_1", "twenty", "planetary"]
    assert {target for case in gallery.values() for target in case.targets} == {
        "resonance",
        "train_sweep",
    }
    assert overlay_gears(CONFIG | GALLERY, GALLERY) == GALLERY
    for case in gallery.values():
        pair = GearPair(**case.pair_parameters("damped"))
        assert pair.damping_ratio == pytest.approx(0.06, rel=1e-10)


@pytest.mark.parametrize(
    ("name", "drawn"),
    [("fzg_c", fzg_c()), ("iso_example_1", iso_example()), ("twenty", twenty(material=Material()))],
)
def test_gears_are_those_whose_numbers_are_published(gallery, name, drawn):
    # tests/geometry has these numbers.
    case, mesh = gallery[name], gallery[name].gears.mesh()
    assert (mesh.pinion, mesh.wheel) == (drawn.pinion, drawn.wheel)
    assert mesh.centre_distance == pytest.approx(drawn.centre_distance, rel=1e-12)
    assert case.gear_pair.teeth == drawn.pinion.teeth
    if name == "fzg_c":
        assert case.gear_pair.backlash == pytest.approx(mesh.recommended_backlash)


def test_planetary(gallery):
    case = gallery["planetary"]
    mesh = case.gears.mesh()
    # The test run of LECAD prints diameters and base tangent lengths in mm, over 3 and 5 teeth.
    printed = {"pinion": (36.75, 3, 13.9546), "wheel": (75.25, 5, 24.353)}
    for name, (diameter, teeth, length) in printed.items():
        gear = getattr(mesh, name)
        assert 1e3 * gear.reference_diameter == pytest.approx(diameter, abs=5e-5)
        across = (teeth - 1) * mesh.base_pitch + gear.thickness_at(gear.base_diameter)
        # Half a digit of the length, and of the shift times 2 m sin(alpha).
        assert 1e3 * across == pytest.approx(length, abs=5e-5 + 6e-5)
    # Shifts are printed to four digits, and the distance to one.
    assert 1e3 * Mesh(mesh.pinion, mesh.wheel).centre_distance == pytest.approx(56.8, abs=1e-3)
    train = described(**case.train_parameters("damped"))
    ratio = -train.by_name["carrier"].torque / train.by_name["sun"].torque
    assert ratio == pytest.approx(6.14286, abs=5e-6)
    assert len(train.meshes) == 6 and train.by_name["ring"].base_radius > 0.088
    # 21 and 108 are multiples of 3: planets in phase.
    assert len(set(train.phases.values())) == 2


def test_the_planetary_set_over_speed(gallery):
    case = gallery["planetary"]
    tunings = grid(0.78, 0.9, 0.02)
    run = {"periods": 100, "record_periods": 12}
    starts = {"starts": 3, "first_starts": 2, "seed": 1, "spread": 1e-3}
    found = over_speed(case.train_parameters("damped"), tunings, run | starts)
    train = described(**case.train_parameters("damped"))
    for direction in ("up", "down"):
        swept = sweep(train, tunings, direction=direction, initial_state="static", **run)
        # Going down planets cease to move alike at 0.84; behind it the sweep begins from rest.
        there = found.tuning.values > 0.85
        assert (found.settled.sel(direction=direction) == 1).values.tolist()[4:] == [True] * 3
        for name in ("dynamic_factor", "fraction_normal", "load_sharing"):
            # Orbits are found to rounding, what a run comes to is a little beside.
            ours = found[name].sel(direction=direction)[there]
            np.testing.assert_allclose(ours, swept[name][there], rtol=0.01)
    assert found.settled.sel(direction="down").values.tolist() == [1, 1, 1, 0, 1, 1, 1]
    # Planets in phase that move alike to rounding.
    sun = found.dynamic_factor.sel(mesh=["sun 1", "sun 2", "sun 3"])[..., there, :]
    carried = sun.sel(direction=["up", "down"])
    assert float((carried.max("mesh") / carried.min("mesh")).max()) < 1.0 + 1e-9
    assert found.speed.values[0] == pytest.approx(train.speed_scales(0.78)["speed"], rel=1e-12)

"""The gallery: its cases are accepted, and give the numbers that are published of their gears."""

from pathlib import Path

import pytest
import yaml

from gearlib.config import cases, load
from gearlib.geometry import Material, Mesh
from gearlib.models.from_values import train_from_description
from tests.geometry.drawings import fzg_c, iso_example, twenty

GALLERY = yaml.safe_load(Path("gallery.yaml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module", name="gallery")
def loaded():
    """Return name -> checked configuration."""
    return {name: load(mapping) for name, mapping in cases(GALLERY).items()}


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


def test_the_planetary_set_has_the_published_numbers(gallery):
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
    train = train_from_description(**case.train_parameters("damped"))
    ratio = -train.by_name["carrier"].torque / train.by_name["sun"].torque
    assert ratio == pytest.approx(6.14286, abs=5e-6)
    assert len(train.meshes) == 6 and train.by_name["ring"].base_radius > 0.088
    # 21 and 108 are multiples of 3: planets in phase.
    assert len(set(train.phases.values())) == 2

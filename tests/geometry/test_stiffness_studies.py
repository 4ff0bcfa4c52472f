"""The study of drawn gears: their stiffness by every method."""

import math

import numpy as np
import pytest

from gearlib.config import load
from gearlib.models.geometry import drawings
from gearlib.models.geometry.mesh_stiffness import energy_stiffness
from gearlib.studies import drawn_gears
from tests.geometry.drawings import fzg_c, twenty
from tests.paper import CONFIG as PROJECT
from tests.tables import read_back

CONFIG = load(PROJECT)
PAIRS = CONFIG.mesh_stiffness.model_dump()["pairs"]


@pytest.fixture(scope="module")
def stiffness():
    return drawn_gears.mesh_stiffness(PAIRS, 64)


def test_the_pairs_of_the_configuration_are_those_of_the_literature():
    for name, expected in (("z20-20", twenty()), ("FZG-C", fzg_c(quality=5))):
        mesh = drawings.mesh(PAIRS[name])
        assert mesh.backlash == PAIRS[name]["backlash"]
        assert mesh.contact_ratio == pytest.approx(expected.contact_ratio, rel=1e-12)
        for ours, theirs in ((mesh.pinion, expected.pinion), (mesh.wheel, expected.wheel)):
            assert ours == theirs


def test_courses_and_means_are_those_of_the_methods(stiffness):
    mesh, own = twenty(), stiffness.sel(pair="z20-20")
    phase = own.stiffness_phase.values
    single, double = (mesh.stiffness("iso").max_stiffness * k for k in (4.0 / 7.0, 1.0))
    inside = np.abs(phase) < math.pi * (mesh.contact_ratio - 1.0)
    iso = own.mesh_stiffness.sel(stiffness_method="iso").values
    assert iso == pytest.approx(np.where(inside, double, single), rel=1e-12)
    # Both ends of double contact are there, from both sides.
    steps = np.diff(iso)[np.diff(phase) < 1e-4]
    assert steps == pytest.approx([double - single, single - double], rel=1e-12)
    for name, coupling in (("energy", 1.0), ("energy_twice", 0.0)):
        found = own.mesh_stiffness.sel(stiffness_method=name).values
        pitches = phase / math.tau + (mesh.contact_ratio - 1.0) / 2.0
        for k in (5, 30, 33, 60):
            count = 2 if inside[k] else 1
            direct = energy_stiffness(mesh, np.array([pitches[k] % 1.0]), count, coupling=coupling)
            # Straight lines between 64 samples.
            assert found[k] == pytest.approx(direct[0], rel=2e-4)
    for name in own.stiffness_method.values:
        one = own.sel(stiffness_method=name)
        mean = np.trapezoid(one.mesh_stiffness, phase) / math.tau
        assert mean == pytest.approx(float(one.mean_mesh_stiffness), rel=1e-3)
    assert list(stiffness.published.values) == ["ISO", "thumb"]
    assert list(stiffness.published_stiffness.values) == [4.9e8, 5.2e8]


def test_the_table_of_the_means(stiffness, tmp_path):
    table = read_back(drawn_gears.stiffness_rows(stiffness), tmp_path)
    rows = {(row["pair"], row["stiffness_method"]): row for row in table}
    assert rows["z20-20", "energy"]["from_reference"] == "+0.0000"
    # 4.743 and 4.9 over 5.461.
    assert rows["z20-20", "iso"]["from_reference"] == "-0.1314"
    assert rows["z20-20", "published: ISO"]["from_reference"] == "-0.1027"

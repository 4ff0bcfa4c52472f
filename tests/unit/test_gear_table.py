"""The table of drawn gears: its numbers, and the command that prints it."""

import json

import pytest
import yaml
from click.testing import CliRunner

from gearlib import GearPair
from gearlib.cli import main
from gearlib.geometry import Mesh, SpurGear, iso_stiffness
from gearlib.studies import gear_table
from tests.geometry.drawings import fzg_c
from tests.unit.test_drawn_gears import FZG


def values(rows):
    """Return name -> values of a table."""
    return {row["name"]: row["values"] for row in rows}


def test_published_numbers_stand_in_the_table():
    drawn = fzg_c()
    mesh = Mesh(drawn.pinion, drawn.wheel, drawn.centre_distance, backlash=160.5e-6)
    table = values([row._asdict() for row in gear_table.gear_quantities(mesh, torque=302.0)])
    # docs/worked_example.md has the sources.
    assert table["working_pressure_angle"]["mesh"] == pytest.approx(22.44, abs=5e-3)
    assert table["transverse_contact_ratio"]["mesh"] == pytest.approx(1.44, abs=5e-3)
    assert table["tip_diameter"] == pytest.approx({"pinion": 82.46, "wheel": 118.36}, rel=1e-12)
    # a - (d_a1 + d_f2) / 2, by hand from the drawing: d_f = m (z + 2 x - 2.5).
    roots = 4.5 * (24 + 2 * 0.1715 - 2.5), 4.5 * (16 + 2 * 0.1817 - 2.5)
    gaps = [91.5 - (tip + root) / 2 for tip, root in zip((82.46, 118.36), roots, strict=True)]
    assert list(table["clearance"].values()) == pytest.approx(gaps, rel=1e-9)
    stiffness = 1e9 * 0.014 * iso_stiffness(mesh, torque=302.0).mean
    assert table["mean_stiffness"]["iso"] == pytest.approx(stiffness, rel=1e-12)
    for method in gear_table.METHODS:
        pair = GearPair.from_geometry(mesh, torque=302.0, stiffness=method)
        assert table["max_stiffness"][method] == pair.max_stiffness
        assert table["resonance_speed"][method] == pair.speed(1.0)


def test_a_body_that_the_energy_method_does_not_take_has_no_values_of_it():
    gear = SpurGear(teeth=20, module=0.01, width=0.03, bore=0.15)
    assert list(gear_table.gear_quantities(Mesh(gear, gear), torque=100.0)[-1].values) == ["iso"]


def test_command_line_options_override_the_configuration(tmp_path):
    (tmp_path / "fzg.yaml").write_text(yaml.safe_dump(FZG), encoding="utf-8")

    def call(*options):
        return CliRunner().invoke(main, ["gears", "--config", str(tmp_path / "fzg.yaml"), *options])

    assert "working_pressure_angle 22.4388 deg alpha_wt" in " ".join(call().output.split())
    options = ("--torque", "100 N m", "--damping-ratio", "0.1")
    for changes, torque, damping in (((), 302.0, 0.06), (options, 100.0, 0.1)):
        table = values(json.loads(call("--format", "json", *changes).output))
        assert table["backlash"]["mesh"] == pytest.approx(160.5, rel=1e-12)
        assert table["damping_ratio"]["iso"] == pytest.approx(damping, rel=1e-10)
        assert table["torque"]["mesh"] == pytest.approx(torque, rel=1e-12)

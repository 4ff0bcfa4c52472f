"""The table of drawn gears: its numbers, and the command that prints it."""

import csv
import io
import json

import pytest
import yaml
from click.testing import CliRunner

from gearlib import GearPair
from gearlib.cli import main
from gearlib.geometry import Mesh, iso_stiffness
from gearlib.studies import gear_table
from tests.geometry.drawings import fzg_c, iso_example
from tests.unit.test_drawn_gears import FZG

ISO_EXAMPLE = [
    *("--teeth", "17", "103", "--module", "8 mm", "--helix-angle", "15.8 deg", "--rack", "D"),
    *("--width", "100 mm", "--shift", "0.145", "0", "--tip-diameter", "159.66 mm", "872.35 mm"),
    *("--centre-distance", "500 mm", "--torque", "9 kN m"),
]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Call the command beside a configuration with FZG type C."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fzg.yaml").write_text(yaml.safe_dump(FZG), encoding="utf-8")
    return lambda *arguments, command="gears": CliRunner().invoke(main, [command, *arguments])


def values(rows):
    return {row["name"]: row["values"] for row in rows}


def test_published_numbers_stand_in_the_table():
    drawn = fzg_c()
    mesh = Mesh(drawn.pinion, drawn.wheel, drawn.centre_distance, backlash=160.5e-6)
    found = values(row._asdict() for row in gear_table.compute(mesh, torque=302.0))
    # docs/worked_example.md has the sources.
    assert found["working_pressure_angle"]["mesh"] == pytest.approx(22.44, abs=5e-3)
    assert found["transverse_contact_ratio"]["mesh"] == pytest.approx(1.44, abs=5e-3)
    assert found["tip_diameter"] == pytest.approx({"pinion": 82.46, "wheel": 118.36}, rel=1e-12)
    # a - (d_a1 + d_f2) / 2, by hand from the drawing: d_f = m (z + 2 x - 2.5).
    roots = 4.5 * (24 + 2 * 0.1715 - 2.5), 4.5 * (16 + 2 * 0.1817 - 2.5)
    gaps = [91.5 - (tip + root) / 2 for tip, root in zip((82.46, 118.36), roots, strict=True)]
    assert list(found["clearance"].values()) == pytest.approx(gaps, rel=1e-9)
    stiffness = 1e9 * 0.014 * iso_stiffness(mesh, torque=302.0).mean
    assert found["mean_stiffness"]["iso"] == pytest.approx(stiffness, rel=1e-12)
    for method in gear_table.METHODS:
        pair = GearPair.from_geometry(mesh, torque=302.0, stiffness=method)
        assert found["max_stiffness"][method] == pair.max_stiffness
        assert found["resonance_speed"][method] == pair.speed(1.0)


def test_the_command_prints_the_table_of_a_configuration(run):
    done = run("--config", "fzg.yaml", "--format", "json")
    assert done.exit_code == 0, done.output
    found = values(json.loads(done.output))
    assert found["backlash"]["mesh"] == pytest.approx(160.5, rel=1e-12)
    assert found["damping_ratio"]["iso"] == pytest.approx(0.06, rel=1e-10)
    assert found["torque"]["mesh"] == pytest.approx(302.0, rel=1e-12)
    text = run("--config", "fzg.yaml").output
    assert "working_pressure_angle 22.4388 deg alpha_wt" in " ".join(text.split())
    # Options come first.
    done = run(
        "--config", "fzg.yaml", "--torque", "100 N m", "--damping-ratio", "0.1", "--format", "json"
    )
    found = values(json.loads(done.output))
    assert found["torque"]["mesh"] == pytest.approx(100.0, rel=1e-12)
    assert found["damping_ratio"]["iso"] == pytest.approx(0.1, rel=1e-10)


def test_options_alone_draw_gears(run):
    done = run(*ISO_EXAMPLE, "--format", "csv")
    assert done.exit_code == 0, done.output
    rows = list(csv.DictReader(io.StringIO(done.output)))
    found = {(row["name"], row["of"]): float(row["value"]) for row in rows}
    pair = GearPair.from_geometry(iso_example(), torque=9000.0)
    assert found["mean_stiffness", "iso"] == pytest.approx(pair.mean_stiffness, rel=1e-12)
    assert found["overlap_ratio", "mesh"] == iso_example().overlap_ratio


def test_the_dampings_of_another_pair_count_by_name_only(run, tmp_path):
    dampings = {"k1": {"material_damping": 4e3, "backlash_damping": 0.0}}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump({"dampings": dampings}), encoding="utf-8")
    for more, damping in (([], 0.0), (["--damping", "k1"], 4e3)):
        done = run(*ISO_EXAMPLE, "--format", "json", *more)
        assert values(json.loads(done.output))["material_damping"]["iso"] == damping


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["--config", "fzg.yaml", "--shift", "-1", "0"], "gears.pinion.shift = -1"),
        (["--config", "fzg.yaml", "--damping", "k9"], "damping = 'k9' is not allowed"),
        (["--teeth", "20", "20", "--width", "1 cm"], "gears.pinion.module is missing"),
        (["--config", "pair.yaml"], "gears is missing"),
        (["--config", "empty.yaml"], "empty.yaml is empty: it must be a mapping"),
        ([*ISO_EXAMPLE, "--damping", "k1"], "--damping need a configuration"),
    ],
)
def test_wrong_input_ends_with_code_2(run, tmp_path, arguments, fault):
    (tmp_path / "pair.yaml").write_text("gear_pair: {}", encoding="utf-8")
    (tmp_path / "empty.yaml").touch()
    done = run(*arguments)
    assert done.exit_code == 2
    assert fault in done.output

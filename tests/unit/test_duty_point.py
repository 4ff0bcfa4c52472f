"""The duty point of drawn gears, models and trains, and the commands that tell it."""

import json
import math

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from gearlib import GearPair, LoadSharingPair, SixDegreePair, duty_point, simulate, two_stage
from gearlib.cli import main
from gearlib.geometry import Mesh, SpurGear, TipRelief, dynamic_factor
from tests.geometry.drawings import own

MESH = own(quality=5)
RELIEF = TipRelief(amount=8e-6, length=2e-3)
SECTION = {
    "gears": {
        "pinion": {"teeth": 23, "module": "2.5mm", "width": "18 mm", "quality": 5},
        "wheel": {"teeth": 61, "quality": 5},
        "torque": "85 Nm",
        "backlash": "80µm",
    },
    "dampings": {"ratio": {"damping_ratio": 0.05, "backlash_damping_ratio": 0.0}},
}


def command(tmp_path, *arguments, relief=False):
    section = json.loads(json.dumps(SECTION))
    if relief:
        for gear in ("pinion", "wheel"):
            section["gears"][gear]["tip_relief"] = {"amount": "8 um", "length": "2 mm"}
    path = tmp_path / "own.yaml"
    path.write_text(yaml.safe_dump(section), encoding="utf-8")
    return CliRunner().invoke(main, [*arguments, "--config", str(path)])


def test_it_is_the_settled_run_in_units_of_machines():
    found = duty_point(MESH, 6000.0, torque=85.0, damping_ratio=0.05)
    pair = LoadSharingPair.from_geometry(MESH, torque=85.0, damping_ratio=0.05)
    run = simulate(pair, speed=6000.0, periods=1000)
    assert found.mesh_frequency_hertz == pytest.approx(6000.0 / 60.0 * 23, rel=1e-12)
    assert found.static_force == pytest.approx(85.0 / (MESH.pinion.base_diameter / 2), rel=1e-12)
    assert found.dynamic_factor == pytest.approx(float(run.dynamic_force_max), rel=1e-9)
    assert found.mesh_force_max == pytest.approx(found.dynamic_factor * found.static_force)
    height = float(run.displacement_max - run.displacement_min) * pair.static_deflection
    assert found.error_peak_to_peak == pytest.approx(height, rel=1e-9)
    power = (found.mesh_order_error.values**2).sum() / 2.0
    assert found.error_rms.item() ** 2 == pytest.approx(power, rel=1e-4)
    assert found.iso_dynamic_factor == dynamic_factor(MESH, 85.0, 6000.0).factor
    assert found.settled == 1 and found.lost_share == pytest.approx(0.0, abs=1e-12)
    assert all({"units", "long_name"} <= one.attrs.keys() for one in found.data_vars.values())


def test_relief_is_carried_by_pairs_of_teeth():
    mesh = MESH.with_reliefs(RELIEF, RELIEF)
    found = duty_point(mesh, 3000.0, torque=85.0, damping_ratio=0.1, stiffness="energy")
    pairs = LoadSharingPair.from_geometry(mesh, torque=85.0, damping_ratio=0.1)
    # Another model, with the stiffness and the deviation of the load: exact at this load only.
    both = duty_point(pairs.at_load(), 3000.0)
    assert found.error_peak_to_peak == pytest.approx(both.error_peak_to_peak.item(), rel=0.05)
    assert found.mesh_order_error[0] == pytest.approx(both.mesh_order_error[0].item(), rel=0.05)
    bare = duty_point(MESH, 3000.0, torque=85.0, damping_ratio=0.1)
    assert abs(found.dynamic_factor / bare.dynamic_factor - 1.0) > 0.02


def test_free_vibrations_hide_orders():
    """Without damping they are too fast for the samples: those orders are nan, nothing else."""
    mesh = Mesh(*(SpurGear(teeth=z, module=4e-3, width=0.032) for z in (19, 47)))
    hidden = []
    for speed in np.linspace(300.0, 900.0, 8):
        found = duty_point(mesh, speed, torque=210.0, damping_ratio=0.0)
        assert found.settled == 0 and found.dynamic_factor > 1.5
        hidden.append(np.isnan(found.mesh_order_force.values))
    assert 0 < np.sum(hidden) < 20


def test_of_teeth_that_meet_again_late_the_first_stand_for_all():
    rng = np.random.default_rng(1)
    gears = [
        SpurGear(teeth=z, module=4e-3, width=0.032, pitch_errors=tuple(rng.normal(0.0, 1e-6, z)))
        for z in (29, 97)
    ]
    whole = LoadSharingPair.from_geometry(Mesh(*gears), torque=210.0, damping_ratio=0.05)
    assert whole.repeats == 29 * 97
    found = duty_point(Mesh(*gears), 4000.0, torque=210.0, damping_ratio=0.05)
    expected = duty_point(whole, 4000.0)
    assert found.settled == 0
    assert found.error_rms == pytest.approx(expected.error_rms.item(), rel=0.05)


def test_bearings_of_six_degrees_and_trains_carry_the_load():
    pair = GearPair.from_geometry(MESH, torque=85.0, damping_ratio=0.05)
    six = SixDegreePair(
        pair=pair.replace(contact_ratio=2.0),
        base_radii=(0.027, 0.0716),
        inertias=(1e-4, 5e-3),
        masses=(0.4, 2.5),
        bearing_stiffness=(1e8,) * 4,
        bearing_damping=(500.0,) * 4,
    )
    # Constant stiffness: the bearings carry the static mesh force.
    found = duty_point(six, 3000.0)
    assert found.bearing_force_max.values == pytest.approx([pair.load] * 2, rel=1e-6)
    train = duty_point(two_stage(pair), 3000.0)
    assert train.mesh_force_max.dims == ("mesh",) and train.bearing_force_max.dims == ("body",)


def test_wrong_input_is_refused():
    pair = GearPair.from_geometry(MESH, torque=85.0)
    for call, words in (
        (lambda: duty_point(pair, 3e3, torque=1.0), "torque = 1.0"),
        (lambda: duty_point(MESH, 3e3), "torque is missing"),
    ):
        with pytest.raises(ValueError, match=words):
            call()


def test_the_table_of_gears_has_it_with_a_speed(tmp_path):
    without = json.loads(command(tmp_path, "gears", "--format", "json").output)
    done = command(tmp_path, "gears", "--format", "json", "--speed", "6000 rpm")
    rows = {row["name"]: row for row in json.loads(done.stdout) if row not in without}
    found = duty_point(MESH, 6000.0, torque=85.0, damping_ratio=0.05)
    assert "dynamic_factor" not in {row["name"] for row in without}
    assert rows["error_rms"]["unit"] == "um"
    for name, scale in (("dynamic_factor", 1.0), ("mesh_force_max", 1.0), ("error_rms", 1e6)):
        value = rows[name]["values"]["duty point"]
        assert value == pytest.approx(scale * found[name].item(), rel=1e-9)


def test_relief_of_a_drawing_enters_a_run_of_the_command(tmp_path):
    asked = ("simulate", "--speed", "6000")
    bare, own = (command(tmp_path, *asked, relief=relief).output for relief in (False, True))
    mesh = MESH.with_reliefs(RELIEF, RELIEF)
    model = LoadSharingPair.from_geometry(mesh, torque=85.0, stiffness="iso", damping_ratio=0.05)
    run = simulate(model, speed=6000.0, periods=200)
    assert bare != own and math.isfinite(run.displacement_max)
    told = next(line for line in own.splitlines() if line.startswith("displacement_max")).split()
    assert np.isclose(float(told[1]), float(run.displacement_max), rtol=1e-6)
    swept = command(tmp_path, "sweep", "--points", "3", relief=True).output
    assert "1/kappa = " in swept and "is not a K_v" in " ".join(swept.split())

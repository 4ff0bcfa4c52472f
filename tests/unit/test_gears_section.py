"""Gears given by geometry: models that a configuration derives, and the table of quantities."""

import json
import math

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from gearlib import GearPair, LoadSharingPair, duty_point
from gearlib.cli import main
from gearlib.config import load, overlay, overlay_gears
from gearlib.config.gears_section import PinionSection, StageSection
from gearlib.geometry import GearStage, Material, Rack, SpurGear, TipRelief, Web, iso_stiffness
from gearlib.models.from_values import build_model
from gearlib.models.geometry import from_values as geometry
from gearlib.studies import gear_table
from gearlib.studies.gear_geometry import harris_map
from tests.geometry.stages import fzg_c, ring
from tests.paper import CONFIG

FZG = yaml.safe_load("""
gears:
  pinion:
    {teeth: 16, module: 4.5 mm, width: 14 mm, shift: 0.1817, tip_diameter: 82.46 mm, bore: 30 mm}
  wheel: {teeth: 24, shift: 0.1715, tip_diameter: 118.36 mm, bore: 30 mm}
  centre_distance: 91.5 mm
  backlash: 160.5 um
  torque: 302 N m
dampings:
  k: {damping_ratio: 0.06, backlash_damping: 0.0}
""")
EVERY_KEY = yaml.safe_load("""
{teeth: 40, module: 4 mm, width: 30 mm, shift: 0.1, pressure_angle: 22 deg, helix_angle: 5 deg,
 tip_diameter: 168.5 mm, rack: C, addendum: 0.9, dedendum: 1.3, fillet_radius: 0.2,
 thickness_allowance: -40 um, bore: 40 mm,
 web: {thickness: 10 mm, rim_diameter: 130 mm, hub_diameter: 60 mm},
 material: {young: 200 GPa, poisson: 0.29, density: 7.8 g/cm^3}, quality: 6,
 tip_relief: {amount: 20 um, length: 3 mm, shape: parabolic}}
""") | {"pitch_errors": ["5 um"] + [0.0] * 39}


def fzg():
    """Return the FZG type C stage with the backlash of the documentation."""
    gears = fzg_c()
    return GearStage(gears.pinion, gears.wheel, gears.centre_distance, backlash=160.5e-6)


def test_the_pair_of_the_configuration_matches_the_library():
    gears = {key: value for key, value in FZG["gears"].items() if key != "torque"}
    gears |= {"power": "60 kW", "speed": "2170 rpm", "stiffness": "energy"}
    gears["stiffness_options"] = {"hertz": "logarithmic"}
    energy = {"stiffness": "energy", "options": gears["stiffness_options"]}
    for settings, arguments in (
        (FZG, {"torque": 302.0}),
        (FZG | {"gears": gears}, {"power": 60e3, "speed": 2170.0, **energy}),
    ):
        expected = GearPair.from_geometry(fzg(), damping_ratio=0.06, **arguments).as_dict()
        # The configuration keeps 12 digits.
        pair = build_model(load(settings).pair("k")).as_dict()
        assert pair == pytest.approx(expected, rel=1e-11)


def test_every_key_is_passed_to_the_gear():
    """A section with every key must give the gear with all these fields."""
    assert EVERY_KEY.keys() == PinionSection.model_fields.keys()
    angles = {"pressure_angle": math.radians(22.0), "helix_angle": math.radians(5.0)}
    rack = Rack(addendum=0.9, dedendum=1.3, tip_radius=0.2)
    material = Material(young=200e9, poisson=0.29, density=7800.0)
    common = {"module": 4e-3, "width": 0.03, "rack": rack, "material": material, **angles}
    # The section accepts all keys together, although no model simulates helical gears with relief.
    mesh = StageSection.model_validate(
        {"pinion": EVERY_KEY, "wheel": {"teeth": 50}, "torque": 50.0}
    ).mesh()
    pinion_fields = {
        "teeth": 40,
        "shift": 0.1,
        "tip_diameter": 0.1685,
        "thickness_allowance": -4e-5,
    }
    pinion_fields |= {
        "bore": 0.04,
        "web": Web(thickness=0.01, rim_diameter=0.13, hub_diameter=0.06),
    }
    pinion_fields |= {"quality": 6, "pitch_errors": (5e-6,) + (0.0,) * 39}
    pinion_fields["tip_relief"] = TipRelief(amount=2e-5, length=3e-3, shape="parabolic")
    assert mesh.pinion == SpurGear(**pinion_fields, **common)
    # The wheel inherits the properties that mating gears share, but no bore and no web.
    assert mesh.wheel == SpurGear(teeth=50, **common)
    wheel = {"teeth": 99, "internal": True, "outer_diameter": "440 mm"}
    pinion = {"teeth": 36, "module": "4 mm", "width": "30 mm"}
    values = {"pinion": pinion, "wheel": wheel, "torque": 100.0}
    assert StageSection.model_validate(values).mesh() == ring()


def test_a_configuration_is_updated_with_another_one():
    smaller_load = {"gears": {"torque": 100.0}}
    assert load(overlay(FZG, smaller_load)).gear_pair.load < load(FZG).gear_pair.load
    # A section of gears replaces the other section that sets the same quantity.
    assert "gear_pair" not in overlay(CONFIG, FZG) and "gears" not in overlay(FZG, CONFIG)
    damping = overlay(FZG, {"dampings": {"k": {"material_damping": 1.0}}})["dampings"]["k"]
    assert damping == {"material_damping": 1.0, "backlash_damping": 0.0}
    # `overlay_gears` also drops sections of config.yaml that belong to the paper's gears.
    assert overlay_gears({**CONFIG, **FZG}, FZG) == FZG
    for base, changes in ((CONFIG, {"gear_pair": {"load": 1.0}}), (FZG, smaller_load)):
        assert overlay_gears(overlay(base, changes), changes) == overlay(base, changes)


def values(rows):
    """Return the values of each row of a table by its name."""
    return {row["name"]: row["values"] for row in rows}


def test_the_table_shows_published_numbers():
    """Compare with the numbers whose sources docs/worked_example.md names."""
    mesh = fzg()
    table = values([row._asdict() for row in gear_table.gear_quantities(mesh, torque=302.0)])
    assert table["working_pressure_angle"]["mesh"] == pytest.approx(22.44, abs=5e-3)
    assert table["transverse_contact_ratio"]["mesh"] == pytest.approx(1.44, abs=5e-3)
    assert table["tip_diameter"] == pytest.approx({"pinion": 82.46, "wheel": 118.36}, rel=1e-12)
    # The clearance is a - (d_a1 + d_f2) / 2 with the root diameter d_f = m (z + 2 x - 2.5).
    roots = 4.5 * (24 + 2 * 0.1715 - 2.5), 4.5 * (16 + 2 * 0.1817 - 2.5)
    gaps = [91.5 - (tip + root) / 2 for tip, root in zip((82.46, 118.36), roots, strict=True)]
    assert list(table["clearance"].values()) == pytest.approx(gaps, rel=1e-9)
    stiffness = 1e9 * 0.014 * iso_stiffness(mesh, torque=302.0).mean
    assert table["mean_stiffness"]["iso"] == pytest.approx(stiffness, rel=1e-12)
    for method in gear_table.METHODS:
        pair = GearPair.from_geometry(mesh, torque=302.0, stiffness=method)
        assert table["max_stiffness"][method] == pair.max_stiffness
        assert table["resonance_speed"][method] == pair.speed(1.0)


def test_a_gear_body_unsuitable_for_the_energy_method_has_no_energy_values():
    gear = SpurGear(teeth=20, module=0.01, width=0.03, bore=0.15)
    assert list(gear_table.gear_quantities(GearStage(gear, gear), torque=100.0)[-1].values) == [
        "iso"
    ]


def test_command_line_options_override_the_configuration(tmp_path):
    (tmp_path / "fzg.yaml").write_text(yaml.safe_dump(FZG), encoding="utf-8")

    def call(*options):
        return CliRunner().invoke(main, ["gears", "--config", str(tmp_path / "fzg.yaml"), *options])

    assert "working_pressure_angle 22.4388 deg alpha_wt" in " ".join(call().output.split())
    options = ("--torque", "100 N m", "--damping-ratio", "0.1")
    for changes, torque, damping in (((), 302.0, 0.06), (options, 100.0, 0.1)):
        table = values(json.loads(call("--format", "json", *changes).output))
        assert table["backlash"]["mesh"] == pytest.approx(160.5, rel=1e-12)
        # A damping ratio given by the user applies to every method.
        assert table["damping_ratio"] == pytest.approx(dict.fromkeys(table["uncertainty"], damping))
        assert table["torque"]["mesh"] == pytest.approx(torque, rel=1e-12)


@pytest.mark.parametrize("damping", [{"damping_ratio": 0.05}, {"material_damping": 800.0}])
def test_the_table_shows_the_duty_point_of_the_load_sharing_model(damping):
    """The table must list the dynamic factor and the orders above 5 % of the largest one."""
    mesh, load = fzg(), {"torque": 302.0, **damping}
    model = LoadSharingPair.from_geometry(mesh, **load)
    rows = gear_table.duty_point_rows(model, 2170.0, 302.0, model.stiffness_model)
    table = values([row._asdict() for row in rows])
    point = duty_point(mesh, 2170.0, **load)
    factor = pytest.approx(point.dynamic_factor.item(), rel=1e-9)
    assert table["dynamic_factor"]["duty point"] == factor
    curves = [point.mesh_order_force.values, point.mesh_order_error.values]
    is_large = np.any([curve > 0.05 * curve.max() for curve in curves], axis=0)
    large = [f"order {n + 1}" for n in np.flatnonzero(is_large)]
    assert list(table["mesh_order_force"]) == list(table["mesh_order_error"]) == large
    assert 0 < len(large) < is_large.size


@pytest.mark.parametrize("helix_angle", [0.0, 0.3])
def test_the_harris_map_shows_the_relief_of_the_gears_without_pitch_errors(helix_angle):
    """The entry "own" must be the transmission error of the gears with their relief alone."""
    gear = {"teeth": 24, "module": 4e-3, "width": 0.03, "helix_angle": helix_angle}
    relief = {"amount": 1e-5, "length": 2e-3}
    gears = {
        "pinion": gear | {"pitch_errors": (1e-6,) * 24},
        "wheel": gear | {"tip_relief": relief},
    }
    dataset = harris_map(gears | {"torque": 200.0}, [0.5, 1.0], "iso", 32)
    assert dataset.relief.values.tolist() == ["none", "own", "short", "long"]
    mesh = geometry.stage({"pinion": gear, "wheel": gear | {"tip_relief": relief}})
    error = mesh.transmission_error(200.0, phases=32, stiffness="iso").transmission_error[0]
    own_relief = dataset.sel(relief="own")
    np.testing.assert_array_equal(own_relief.transmission_error[1], error)
    assert own_relief.relief_amount.values.tolist() == [0.0, 1e-5]
    peaks = dataset.peak_to_peak_error.sel(torque=200.0)
    assert peaks.sel(relief="long") < 0.2 * peaks.sel(relief="none")

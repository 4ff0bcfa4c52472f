"""Check gears that a configuration gives by geometry, and the table of gear quantities."""

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
from tests.geometry.stages import fzg_c, ring_stage
from tests.paper import CONFIG

FZG_CONFIG = yaml.safe_load("""
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
PINION_WITH_EVERY_KEY = yaml.safe_load("""
{teeth: 40, module: 4 mm, width: 30 mm, shift: 0.1, pressure_angle: 22 deg, helix_angle: 5 deg,
 tip_diameter: 168.5 mm, rack: C, addendum: 0.9, dedendum: 1.3, fillet_radius: 0.2,
 thickness_allowance: -40 um, bore: 40 mm,
 web: {thickness: 10 mm, rim_diameter: 130 mm, hub_diameter: 60 mm},
 material: {young: 200 GPa, poisson: 0.29, density: 7.8 g/cm^3}, quality: 6,
 tip_relief: {amount: 20 um, length: 3 mm, shape: parabolic}}
""") | {"pitch_errors": ["5 um"] + [0.0] * 39}


def fzg_stage():
    """Return the FZG type C gear stage with a backlash of 160.5 um, as in the documentation."""
    gears = fzg_c()
    return GearStage(gears.pinion, gears.wheel, gears.centre_distance, backlash=160.5e-6)


def test_the_pair_of_the_configuration_matches_the_library():
    """A load given as torque or as power must lead to the pair of `GearPair.from_geometry`."""
    gears = {key: value for key, value in FZG_CONFIG["gears"].items() if key != "torque"}
    gears |= {"power": "60 kW", "speed": "2170 rpm", "stiffness": "energy"}
    gears["stiffness_options"] = {"hertz": "logarithmic"}
    energy_method = {"stiffness": "energy", "options": gears["stiffness_options"]}
    for settings, arguments in (
        (FZG_CONFIG, {"torque": 302.0}),
        (FZG_CONFIG | {"gears": gears}, {"power": 60e3, "speed": 2170.0, **energy_method}),
    ):
        expected = GearPair.from_geometry(fzg_stage(), damping_ratio=0.06, **arguments).as_dict()
        # The configuration rounds derived values to 12 digits.
        pair = build_model(load(settings).pair_description("k")).as_dict()
        assert pair == pytest.approx(expected, rel=1e-11)


def test_every_key_is_passed_to_the_gear():
    """Every key of a section must set the field of the gear that has its name, in SI units."""
    assert PINION_WITH_EVERY_KEY.keys() == PinionSection.model_fields.keys()
    angles = {"pressure_angle": math.radians(22.0), "helix_angle": math.radians(5.0)}
    rack = Rack(addendum=0.9, dedendum=1.3, tip_radius=0.2)
    material = Material(young=200e9, poisson=0.29, density=7800.0)
    common = {"module": 4e-3, "width": 0.03, "rack": rack, "material": material, **angles}
    # The section accepts all keys together, although no model simulates helical gears with relief.
    section = {"pinion": PINION_WITH_EVERY_KEY, "wheel": {"teeth": 50}, "torque": 50.0}
    stage = StageSection.model_validate(section).gear_stage()
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
    assert stage.pinion == SpurGear(**pinion_fields, **common)
    # The wheel inherits the properties that mating gears share, but neither bore nor web.
    assert stage.wheel == SpurGear(teeth=50, **common)
    wheel = {"teeth": 99, "internal": True, "outer_diameter": "440 mm"}
    pinion = {"teeth": 36, "module": "4 mm", "width": "30 mm"}
    section = {"pinion": pinion, "wheel": wheel, "torque": 100.0}
    assert StageSection.model_validate(section).gear_stage() == ring_stage()


def test_a_configuration_is_updated_with_another_one():
    """`overlay` must merge sections, but replace one that gives the same quantity otherwise."""
    smaller_load = {"gears": {"torque": 100.0}}
    assert load(overlay(FZG_CONFIG, smaller_load)).gear_pair.load < load(FZG_CONFIG).gear_pair.load
    # The sections `gear_pair` and `gears` replace each other, because both describe the gears.
    assert "gear_pair" not in overlay(CONFIG, FZG_CONFIG) and "gears" not in overlay(
        FZG_CONFIG, CONFIG
    )
    damping = overlay(FZG_CONFIG, {"dampings": {"k": {"material_damping": 1.0}}})["dampings"]["k"]
    assert damping == {"material_damping": 1.0, "backlash_damping": 0.0}
    # `overlay_gears` also removes sections of config.yaml that concern the paper's gears.
    assert overlay_gears({**CONFIG, **FZG_CONFIG}, FZG_CONFIG) == FZG_CONFIG
    for base, changes in ((CONFIG, {"gear_pair": {"load": 1.0}}), (FZG_CONFIG, smaller_load)):
        assert overlay_gears(overlay(base, changes), changes) == overlay(base, changes)


def values_by_name(rows):
    """Return a dict that maps the name of each table row to its values."""
    return {row["name"]: row["values"] for row in rows}


def test_the_table_shows_published_numbers():
    """Table values must match published numbers, whose sources docs/worked_example.md names."""
    stage = fzg_stage()
    table = values_by_name(
        [row._asdict() for row in gear_table.gear_quantities(stage, torque=302.0)]
    )
    assert table["working_pressure_angle"]["mesh"] == pytest.approx(22.44, abs=5e-3)
    assert table["transverse_contact_ratio"]["mesh"] == pytest.approx(1.44, abs=5e-3)
    assert table["tip_diameter"] == pytest.approx({"pinion": 82.46, "wheel": 118.36}, rel=1e-12)
    # The clearance is a - (d_a1 + d_f2) / 2 with the root diameter d_f = m (z + 2 x - 2.5).
    tip_diameters = 82.46, 118.36
    mating_root_diameters = 4.5 * (24 + 2 * 0.1715 - 2.5), 4.5 * (16 + 2 * 0.1817 - 2.5)
    clearances = [
        91.5 - (tip_diameter + root_diameter) / 2
        for tip_diameter, root_diameter in zip(tip_diameters, mating_root_diameters, strict=True)
    ]
    assert list(table["clearance"].values()) == pytest.approx(clearances, rel=1e-9)
    # The stiffness per width, N/(mm um), is converted to N/m for a width of 14 mm.
    stiffness = 1e9 * 0.014 * iso_stiffness(stage, torque=302.0).mean
    assert table["mean_stiffness"]["iso"] == pytest.approx(stiffness, rel=1e-12)
    for method in gear_table.METHODS:
        pair = GearPair.from_geometry(stage, torque=302.0, stiffness=method)
        assert table["max_stiffness"][method] == pair.max_stiffness
        assert table["resonance_speed"][method] == pair.speed(1.0)


def test_the_energy_method_has_no_values_for_a_rim_that_is_too_thin():
    """For a bore close to the root circle the table must have values of the ISO method only."""
    gear = SpurGear(teeth=20, module=0.01, width=0.03, bore=0.15)
    quantities = gear_table.gear_quantities(GearStage(gear, gear), torque=100.0)
    assert list(quantities[-1].values) == ["iso"]


def test_command_line_options_override_the_configuration(tmp_path):
    """Torque and damping ratio in the table must be those of the options if given."""
    (tmp_path / "fzg.yaml").write_text(yaml.safe_dump(FZG_CONFIG), encoding="utf-8")

    def run_gears(*options):
        """Return the output of `gearlib gears` for the configuration and further options."""
        arguments = ["gears", "--config", str(tmp_path / "fzg.yaml"), *options]
        return CliRunner().invoke(main, arguments).output

    assert "working_pressure_angle 22.4388 deg alpha_wt" in " ".join(run_gears().split())
    overriding_options = ("--torque", "100 N m", "--damping-ratio", "0.1")
    for options, torque, damping_ratio in (
        ((), 302.0, 0.06),
        (overriding_options, 100.0, 0.1),
    ):
        table = values_by_name(json.loads(run_gears("--format", "json", *options)))
        assert table["backlash"]["mesh"] == pytest.approx(160.5, rel=1e-12)
        # The damping ratio is the same for all methods that compute the stiffness.
        expected = dict.fromkeys(table["uncertainty"], damping_ratio)
        assert table["damping_ratio"] == pytest.approx(expected)
        assert table["torque"]["mesh"] == pytest.approx(torque, rel=1e-12)


@pytest.mark.parametrize("damping", [{"damping_ratio": 0.05}, {"material_damping": 800.0}])
def test_the_table_shows_the_duty_point_of_the_load_sharing_model(damping):
    """The table must list the dynamic factor, and orders above 5 % of the largest amplitude."""
    stage, load = fzg_stage(), {"torque": 302.0, **damping}
    model = LoadSharingPair.from_geometry(stage, **load)
    rows = gear_table.duty_point_rows(model, 2170.0, 302.0, model.stiffness_model)
    table = values_by_name([row._asdict() for row in rows])
    point = duty_point(stage, 2170.0, **load)
    dynamic_factor = table["dynamic_factor"]["duty point"]
    assert dynamic_factor == pytest.approx(point.dynamic_factor.item(), rel=1e-9)
    # An order is listed if its force or its transmission error is large.
    amplitudes = [point.mesh_order_force.values, point.mesh_order_error.values]
    is_large = np.any([values > 0.05 * values.max() for values in amplitudes], axis=0)
    large_orders = [f"order {index + 1}" for index in np.flatnonzero(is_large)]
    assert list(table["mesh_order_force"]) == list(table["mesh_order_error"]) == large_orders
    assert 0 < len(large_orders) < is_large.size


@pytest.mark.parametrize("helix_angle", [0.0, 0.3])
def test_the_harris_map_shows_the_relief_of_the_gears_without_pitch_errors(helix_angle):
    """The entry "own" must be the transmission error with the relief, but without pitch errors."""
    gear = {"teeth": 24, "module": 4e-3, "width": 0.03, "helix_angle": helix_angle}
    relief = {"amount": 1e-5, "length": 2e-3}
    gears = {
        "pinion": gear | {"pitch_errors": (1e-6,) * 24},
        "wheel": gear | {"tip_relief": relief},
    }
    torque, phase_count = 200.0, 32
    relative_loads = [0.5, 1.0]
    dataset = harris_map(gears | {"torque": torque}, relative_loads, "iso", phase_count)
    assert dataset.relief.values.tolist() == ["none", "own", "short", "long"]
    stage = geometry.build_stage({"pinion": gear, "wheel": gear | {"tip_relief": relief}})
    curve = stage.transmission_error(torque, phases=phase_count, stiffness="iso")
    own_relief = dataset.sel(relief="own")
    np.testing.assert_array_equal(own_relief.transmission_error[1], curve.transmission_error[0])
    assert own_relief.relief_amount.values.tolist() == [0.0, 1e-5]
    # Long relief, chosen for this torque, must reduce the transmission error considerably.
    amplitudes = dataset.peak_to_peak_error.sel(torque=torque)
    assert amplitudes.sel(relief="long") < 0.2 * amplitudes.sel(relief="none")

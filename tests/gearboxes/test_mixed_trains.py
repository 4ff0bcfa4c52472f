"""Planetary sets with parallel stages, characteristic frequencies, trains in files, commands."""

import math

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

import gearlib
from gearlib import config
from gearlib.cli import gearbox_report, main
from gearlib.geometry import GearStage, ParallelStage, SpurGear, planetary_set
from gearlib.models.from_values import build_model
from gearlib.studies import gearboxes

from .rexs_files import planetary_file, two_stage_file

SUN, PLANET = (SpurGear(teeth=z, module=0.004, width=0.05) for z in (17, 22))
RING = SpurGear(teeth=61, module=0.004, width=0.05, internal=True, outer_diameter=0.28)
SUN_STAGE, CARRIER_STAGE = (
    GearStage(*(SpurGear(teeth=z, module=m, width=0.03) for z in teeth))
    for m, teeth in ((0.003, (23, 67)), (0.006, (20, 41)))
)


def mixed_train(**options):
    """Return a planetary set with a stage on its sun and another stage on its carrier."""
    stages = [
        ParallelStage(stage=SUN_STAGE, on="sun", gear="wheel", shaft_stiffness=1e5, position=1.0),
        ParallelStage(stage=CARRIER_STAGE, on="carrier", shaft_stiffness=1e6, position=2.0),
    ]
    options = {"damping_ratio": 0.05, "model": "rectangle", "stages": stages} | options
    return planetary_set(SUN, PLANET, RING, torque=300.0, **options)


def test_speeds_and_mesh_frequencies_satisfy_willis_equation():
    """With 17 and 61 teeth and a fixed ring the carrier turns 17 / 78 times as fast as the sun."""
    train = mixed_train()
    in_housing = {name: float(speed) for name, speed in train.speeds.in_housing.items()}
    sun = in_housing["sun"]
    assert in_housing["carrier"] / sun == pytest.approx(17 / 78, rel=1e-12)
    assert in_housing["ring"] == 0.0
    assert in_housing["pinion 1"] / sun == pytest.approx(-67 / 23, rel=1e-12)
    assert in_housing["wheel 2"] / sun == pytest.approx(-17 / 78 * 20 / 41, rel=1e-12)
    frequency_table = gearlib.characteristic_frequencies(train, 1200.0)
    frequencies = dict(
        zip(frequency_table.mesh.values, frequency_table.mesh_frequency_hertz.values, strict=True)
    )
    assert frequencies["sun 1"] == pytest.approx(20.0 * 17 * (1 - 17 / 78))
    assert frequencies["stage 1"] == pytest.approx(20.0 * 67)
    assert frequencies["stage 2"] == pytest.approx(20.0 * 17 / 78 * 20)
    assert float(train.layout().misfit) < 1e-12


def test_the_reference_mesh_may_be_one_in_the_housing():
    """A change of the reference mesh must only rescale all frequency ratios and speeds."""
    train = mixed_train()
    speeds = train.speeds.in_housing
    ratio = speeds["carrier"] / (speeds["pinion 1"] - speeds["carrier"])
    changed_train = train.replace(reference="stage 1", carrier_ratio=float(ratio))
    before, after = (np.array(x.frequency_ratios, float) for x in (train, changed_train))
    np.testing.assert_allclose(after, before / before[-2], rtol=1e-12)
    scale = changed_train.speeds.in_housing["sun"] / speeds["sun"]
    for name, speed in speeds.items():
        assert float(changed_train.speeds.in_housing[name]) == pytest.approx(float(scale * speed))
    # In one period of the reference mesh its pinion turns by one tooth.
    assert abs(changed_train.speeds.in_housing["pinion 1"]) == pytest.approx(1 / 23)


def test_torques_balance_and_press_the_drive_sides():
    """Static mesh forces must be positive and follow from 300 N m and the numbers of teeth."""
    # Torques follow from the input torque of 300 N m and the numbers of teeth.
    train = mixed_train()
    forces = train.static().mesh_force.values
    assert forces.min() > 0.0
    assert forces[:3] == pytest.approx(forces[3:6])
    torque = forces[-2] * SUN_STAGE.pinion.base_diameter / 2.0
    assert torque == pytest.approx(300.0 * 23 / 67)
    assert forces[-1] * CARRIER_STAGE.pinion.base_diameter / 2.0 == pytest.approx(300.0 * 78 / 17)


def test_a_moving_axis_in_the_housing_beside_a_turning_carrier_is_refused():
    """An elastic support in the housing has no constant stiffness in the carrier frame."""
    train = mixed_train()
    bodies = [
        body
        if body.name != "wheel 2"
        else gearlib.Body(**{**vars(body), "support_stiffness": (1e9, 1e9)})
        for body in train.bodies
    ]
    with pytest.raises(ValueError, match="support_stiffness of body wheel 2"):
        train.replace(bodies=bodies)


def test_a_configuration_gives_the_same_train_as_python():
    """Natural frequencies must equal the ones of `mixed_train`, which is built in Python."""
    gear = {"module": 0.004, "width": 0.05}
    section = {
        "kind": "planetary_set",
        "planetary_set": {
            "sun": gear | {"teeth": 17},
            "planet": gear | {"teeth": 22},
            "ring": gear | {"teeth": 61, "outer_diameter": 0.28},
            "torque": 300.0,
            "damping_ratio": 0.05,
            "model": "rectangle",
            "stages": [
                {
                    "on": "sun",
                    "gear": "wheel",
                    "shaft_stiffness": 1e5,
                    "position": 1.0,
                    "pinion": {"teeth": 23, "module": 0.003, "width": 0.03},
                    "wheel": {"teeth": 67},
                },
                {
                    "on": "carrier",
                    "shaft_stiffness": "1e6 N m/rad",
                    "position": 2.0,
                    "pinion": {"teeth": 20, "module": 0.006, "width": 0.03},
                    "wheel": {"teeth": 41},
                },
            ],
        },
    }
    with open("config.yaml", encoding="utf-8") as file:
        settings = config.load(config.overlay(yaml.safe_load(file), {"train": section}))
    train = build_model(settings.model_description(next(iter(settings.dampings)), "train"))
    expected = mixed_train()
    assert train.mesh_names == expected.mesh_names
    np.testing.assert_allclose(
        train.modes().natural_frequency.values[1:],
        expected.modes().natural_frequency.values[1:],
        rtol=1e-12,
    )


def test_characteristic_frequencies_of_a_stage_match_hand_calculation():
    """With 24 teeth at 600 rpm the mesh frequency is 240 Hz; equal teeth meet after 72 meshes."""
    stage = GearStage(*(SpurGear(teeth=z, module=0.003, width=0.03) for z in (24, 36)))
    frequencies = gearlib.characteristic_frequencies(stage, 600.0)
    assert float(frequencies.mesh_frequency_hertz[0]) == pytest.approx(240.0)
    assert float(frequencies.hunting_tooth_frequency[0]) == pytest.approx(240.0 / 72)
    assert float(frequencies.assembly_phase_frequency[0]) == pytest.approx(20.0)
    np.testing.assert_allclose(frequencies.sideband_spacing.values, [[10.0, 20.0 / 3.0]])
    assert np.isnan(frequencies.planet_passing_frequency).all()


def test_planet_passing_frequencies_match_the_speed_of_the_carrier():
    """Three planets pass the fixed ring at three times the speed of the carrier."""
    frequencies = gearlib.characteristic_frequencies(mixed_train(stages=()), 780.0)
    passing_frequencies = dict(
        zip(frequencies.body.values, frequencies.planet_passing_frequency.values, strict=True)
    )
    carrier = 13.0 * 17 / 78
    assert passing_frequencies["ring"] == pytest.approx(3 * carrier)
    assert passing_frequencies["sun"] == pytest.approx(3 * (13.0 - carrier))
    assert math.isnan(passing_frequencies["carrier"])


@pytest.mark.parametrize("suffix", [".yaml", ".nc"])
def test_a_train_read_from_a_file_equals_the_one_written(suffix, tmp_path):
    """A train must survive writing to and reading from YAML and netCDF unchanged."""
    force = gearlib.HarmonicForce(body="sun", amplitude=3.0, order=2, of="sun", phase=0.1)
    train = mixed_train(model="teeth").replace(forces=[force], modal_damping=[0.02])
    gearlib.write_train(train, tmp_path / f"train{suffix}")
    assert gearlib.read_train(tmp_path / f"train{suffix}") == train


def test_a_wrong_value_in_a_train_file_is_named(tmp_path):
    """A negative inertia and a file without a train must be refused with the path of the value."""
    path = tmp_path / "train.yaml"
    gearlib.write_train(mixed_train(), path)
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    content["train"]["own"]["bodies"][0]["inertia"] = -1.0
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(ValueError, match=r"train.own.bodies\[0\].inertia = -1.0 is not allowed"):
        gearlib.read_train(path)
    path.write_text("gears: {}\n", encoding="utf-8")
    with pytest.raises(ValueError, match="train is missing"):
        gearlib.read_train(path)


def test_the_command_prints_a_gearbox_and_starts_a_project(tmp_path):
    """The new project must compute the gearbox; an existing folder and a bad file are refused."""
    path = two_stage_file().write(tmp_path / "box.rexs")
    printed = CliRunner().invoke(main, ["gearbox", str(path)])
    assert printed.exit_code == 0 and "Stufe 2  19/39" in printed.output
    init_result = CliRunner().invoke(main, ["init", str(tmp_path / "new"), "--gearbox", str(path)])
    assert init_result.exit_code == 0
    settings = config.load(yaml.safe_load((tmp_path / "new/config.yaml").read_text("utf-8")))
    assert settings.gearbox.file == "box.rexs" and settings.computed_targets() == ["gearbox"]
    second_init_result = CliRunner().invoke(
        main, ["init", str(tmp_path / "new"), "--gearbox", str(path)]
    )
    assert second_init_result.exit_code == 2 and "exists" in second_init_result.output
    (tmp_path / "none.rexs").write_text("<model/>")
    refused_result = CliRunner().invoke(main, ["gearbox", str(tmp_path / "none.rexs")])
    assert refused_result.exit_code == 2 and "version" in refused_result.output


def test_studies_cover_both_load_cases_of_a_gearbox(tmp_path):
    """Tables must have rows for each load case and the largest factors in the summary."""
    path = str(two_stage_file().write(tmp_path / "box.rexs"))
    stages, boxes, reasons = gearboxes.list_computations(path)
    assert len(stages) == 4 and boxes == ["1", "2"] and not reasons
    curves = [gearboxes.sweep_stage(path, *job, 0.05, 5) for job in stages]
    assert float(curves[0].operating_speed) in curves[0].speed.values
    header, *rows = gearboxes.stage_rows(curves, path)
    assert [row[1] for row in rows] == ["1", "1", "2", "2", "all", "all"]
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    factors = list(map(float, columns["dynamic_factor"]))
    assert factors[4] == max(factors[0], factors[2]) and factors[5] == max(factors[1], factors[3])
    box = gearboxes.analyse_gearbox(path, "1", 0.05, 2)
    energies = box.mode_strain_energy.sum("mesh") + box.mode_shaft_energy.sum("shaft")
    np.testing.assert_allclose(energies.values[1:], 1.0, rtol=1e-9)
    rows = list(gearboxes.gearbox_rows([box]))
    assert ["1", "Stufe 1", "mesh frequency, order 21", "525", "Hz"] in rows


def test_equal_meshes_of_planets_are_computed_once(tmp_path):
    """Three equal planets must give one sun mesh and one ring mesh besides the parallel stage."""
    path = str(planetary_file().write(tmp_path / "box.rexsj"))
    names = [name for name, _ in gearboxes.list_computations(path)[0]]
    assert names == ["Sonne-Planet 0", "Planet-Hohlrad 0", "Stirnradstufe"]


def test_the_page_of_a_gearbox_has_its_pictures_and_tables():
    """The HTML page of a gearbox with two load cases must contain six pictures and three tables."""
    page = gearbox_report.page("gallery/two_stage.rexs", "", points=3, orders=1, revolutions=3)
    # The pictures are the view, the stages, and modes and order map in each of two load cases.
    assert page.count("<img ") == 6 and page.count("<table") == 3


def test_the_summary_row_lists_all_jumps_and_the_speed_of_the_largest_factor():
    """Replace factors and jump speeds of both load cases by made-up ones."""
    path, stages = "gallery/two_stage.rexs", []
    for case, factor, jumps in (("1", 2.0, [900.0, 1100.0]), ("2", 3.0, [1000.0])):
        data = gearboxes.sweep_stage(path, "Stufe 1", case, 0.05, 3)
        made_up_values = {"dynamic_factor": data.dynamic_factor * 0.0 + 1.0}
        made_up_values["dynamic_factor"][dict(tuning=0 if case == "2" else -1)] = factor
        made_up_values["jump_up_speed"] = "jump", jumps
        data = data.drop_vars(["jump_up_speed", "jump_down_speed"])
        made_up_values["jump_down_speed"] = "jump", [math.nan] * len(jumps)
        stages.append(data.assign(made_up_values))
    header, *rows = gearboxes.stage_rows(stages, path)
    row = dict(zip(header, next(row for row in rows if row[1] == "all"), strict=True))
    assert row["jumps_rpm"] == "900 1000 1100"
    assert row["at_speed_rpm"] == f"{float(stages[1].speed[0]):.6g}"

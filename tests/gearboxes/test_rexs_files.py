"""Files of every version and form, load cases, flanks, and files with holes and slips."""

import math

import numpy as np
import pytest

import gearlib
from gearlib.geometry import TipRelief

from .rexs_files import add_gear, add_stage, planetary_file, two_stage_file


def read_rexs_file(file, tmp_path, name="box.rexs"):
    """Write a `RexsFile` and return its gearbox."""
    return gearlib.read_gearbox(file.write(tmp_path / name))


@pytest.mark.parametrize("version", [f"1.{i}" for i in range(8)])
def test_every_rexs_version_is_read(version, tmp_path):
    """Each version must give the same duration fractions and the load transformed by 48 / 21."""
    box = read_rexs_file(two_stage_file(version), tmp_path)
    assert box.load_cases == {"1": 0.75, "2": 0.25}
    assert box.load("Stufe 2") == pytest.approx(
        {"torque": 40.0 * 48 / 21, "speed": 1500.0 * 21 / 48}
    )


@pytest.mark.parametrize("suffix", [".rexsj", ".rexsz", ".rexs.zip"])
def test_every_file_format_gives_the_same_gearbox(suffix, tmp_path):
    """JSON and archives must give the same gearbox as the XML file of the same model."""
    boxes = [read_rexs_file(planetary_file(), tmp_path, f"box{x}") for x in (".rexs", suffix)]
    assert str(boxes[0]) == str(boxes[1])


def test_the_table_shows_the_known_data_of_the_gearbox(tmp_path):
    """Compare the row of the second stage with its numbers of teeth and the input."""
    box = read_rexs_file(two_stage_file(), tmp_path)
    header, first, second = box.rows()
    row = dict(zip(header, second, strict=True))
    assert row["teeth"] == "19/39"
    ratio = 48 / 21
    expected = {"m_n (mm)": 4.0, "a (mm)": 120.0, "b (mm)": 38.0, "ratio": 39 / 19}
    expected |= {"n_1 (rpm)": 1500.0 / ratio, "T_2 (N m)": 40.0 * ratio * 39 / 19}
    expected |= {"f_mesh (Hz)": 1500.0 / ratio * 19 / 60}
    assert {name: row[name] for name in expected} == pytest.approx(expected)
    assert "load case 2, 25 % of the duration" in str(box)


def test_speeds_of_a_planetary_set_satisfy_willis_equation(tmp_path):
    """With a fixed ring of 60 teeth and a sun of 18 the ratio is 1 + 60 / 18."""
    loads = read_rexs_file(planetary_file(), tmp_path).loads()
    ids = {
        part.name: key
        for key, part in read_rexs_file(planetary_file(), tmp_path).model.components.items()
    }
    speed = 1200.0 / (1.0 + 60 / 18)
    assert loads.speeds[ids["Steg"]] == pytest.approx(speed)
    assert loads.speeds[ids["Abtrieb"]] == pytest.approx(-speed * 24 / 30)
    assert loads.speeds[ids["Hohlradwelle"]] == 0.0
    assert loads.torques[str(ids["Last"])] == pytest.approx(60.0 * (1.0 + 60 / 18) * 30 / 24)
    # Three planets share the torque of the sun.
    assert loads.pinion_torques["Sonne-Planet 1"] == pytest.approx(20.0)


def test_mesh_frequencies_of_a_planetary_train_match_its_load_case(tmp_path):
    """Mesh frequencies follow from relative speed and teeth, and forces from the torque."""
    box = read_rexs_file(planetary_file(), tmp_path)
    train = box.train(model="rectangle", stiffness="iso")
    frequency_table = gearlib.characteristic_frequencies(train, 1200.0)
    for stage, frequency in zip(
        box.stages, frequency_table.mesh_frequency_hertz.values, strict=True
    ):
        teeth = box.stage(stage).pinion.teeth
        assert frequency == pytest.approx(box.load(stage)["speed"] / 60.0 * teeth, rel=1e-12)
    force = box.stage("Stirnradstufe").load(box.load("Stirnradstufe")["torque"])
    assert train.static().mesh_force.sel(mesh="Stirnradstufe") == pytest.approx(force, rel=1e-9)
    assert float(train.layout().misfit) < 1e-9


def test_a_reversed_torque_loads_the_other_flank_with_its_relief(tmp_path):
    """The two load cases have opposite torques, and each flank its own relief."""
    file = two_stage_file()
    for side, depth in (("left", 0.02), ("right", 0.03)):
        file.add(
            "tip_relief",
            f"{side} relief",
            tip_relief_depth=(depth, "mm"),
            tip_relief_datum_length=(2.0, "mm"),
            shape_of_relief="parabolic",
        )
        file.relate("reference", origin=f"z1 {side}", referenced=f"{side} relief")
    box = read_rexs_file(file, tmp_path)
    reliefs = [box.stage("Stufe 1", case).pinion.tip_relief for case in box.load_cases]
    # A positive torque acts counterclockwise and so loads the right flanks, seen along the axis.
    expected = [TipRelief(amount=x, length=0.002, shape="parabolic") for x in (3e-5, 2e-5)]
    assert reliefs == expected
    assert box.stage("Stufe 1").wheel.tip_relief is None


def test_relief_length_follows_from_the_start_diameter(tmp_path):
    """The length of tip relief must be the difference of the roll lengths at both diameters."""
    file = two_stage_file()
    gear = read_rexs_file(file, tmp_path).stage("Stufe 1").pinion
    start = gear.tip_diameter - 0.002
    file.add(
        "tip_relief",
        "relief",
        tip_relief_depth=(20.0, "mum"),
        tip_relief_datum_diameter=(1e3 * start, "mm"),
    )
    file.relate("reference", origin="z1 right", referenced="relief")
    relief = read_rexs_file(file, tmp_path).stage("Stufe 1").pinion.tip_relief
    # The length is the difference of two roll lengths on the involute.
    length = (math.sqrt(gear.tip_diameter**2 - gear.base_diameter**2)) / 2.0
    length -= math.sqrt(start**2 - gear.base_diameter**2) / 2.0
    assert relief.length == pytest.approx(length, rel=1e-9)
    assert relief.amount == pytest.approx(2e-5)


def test_gear_coordinates_mean_the_start_in_version_1_0_and_the_middle_later(tmp_path):
    """A face of 26 mm around 80 mm must be read from its start, 67 mm, and from its middle."""
    faces = []
    for version, coordinate in (("1.0", 67.0), ("1.1", 80.0)):
        file = two_stage_file(version)
        file.change("z1", support_vector=None, u_coordinate_on_shaft=(coordinate, "mm"))
        box = read_rexs_file(file, tmp_path)
        faces.append(box.face(box.stages["Stufe 1"].pinion))
    np.testing.assert_allclose(faces, [(0.067, 0.093)] * 2, rtol=1e-12)


def test_contradictory_positions_are_noted(tmp_path):
    """A wrong centre distance and a wrong angle of a stage must each cause a note."""
    file = two_stage_file()
    file.change(
        "Stufe 1", rotating_angle_around_neg_u_axis=(30.0, "deg"), center_distance=(90.1, "mm")
    )
    box = read_rexs_file(file, tmp_path)
    box.train(model="rectangle", stiffness="iso")
    notes = "\n".join(box.notes)
    assert "center_distance of cylindrical_stage Stufe 1 is 90.1 mm" in notes
    assert "rotating_angle_around_neg_u_axis of cylindrical_stage Stufe 1 puts the wheel" in notes


REFUSED_STAGES = [
    ("z1", {"face_width": None}, "face_width of cylindrical_gear z1 is missing"),
    ("z1", {"normal_module": None}, "normal_module of cylindrical_gear z1 is missing"),
    ("z1", {"tip_diameter": (1.0, "mm")}, "tip_diameter of cylindrical_gear z1 = 0.001"),
    ("z1", {"face_width": (24.0, "Ellen")}, "face_width of cylindrical_gear z1 = '24.0 Ellen'"),
    ("z1", {"normal_module": (2.5, "kg")}, "normal_module of cylindrical_gear z1 = '2.5 kg'"),
    (
        "z1 right",
        {"addendum_modification_coefficient": None},
        "addendum_modification_coefficient of cylindrical_gear z1 is missing",
    ),
    ("Stufe 1", {"center_distance": (80.0, "mm")}, "80.0"),
]


@pytest.mark.parametrize("name, changes, message", REFUSED_STAGES, ids=lambda x: str(x)[:40])
def test_a_refused_stage_leaves_the_other_stage_in_the_table(name, changes, message, tmp_path):
    """The table gives the reason for the first stage; only a train of both stages is refused."""
    file = two_stage_file()
    file.change(name, **changes)
    box = read_rexs_file(file, tmp_path)
    assert message.partition("80.0")[0] in box.refused["Stufe 1"]
    assert box.stage("Stufe 2").pinion.teeth == 19
    assert box.refused["Stufe 1"] in " ".join(str(box).split())
    with pytest.raises(ValueError, match="stage Stufe 1 is refused"):
        box.train()


@pytest.mark.parametrize("kind", ["worm", "bevel"])
def test_unsupported_kinds_of_stages_are_refused_by_name(kind, tmp_path):
    """Worm and bevel stages must be refused, and a gearbox of such stages alone as well."""
    file = two_stage_file()
    file.add(f"{kind}_stage", "Schneckenstufe")
    reason = read_rexs_file(file, tmp_path).refused["Schneckenstufe"]
    assert reason.startswith(f"{kind}_stage Schneckenstufe is not allowed")
    stages = [x for x in file.components if x["type"] == "cylindrical_stage"]
    for stage in stages:
        stage["type"] = f"{kind}_stage"
    with pytest.raises(ValueError, match=f"stages are missing.*{kind}_stage Stufe 1"):
        read_rexs_file(file, tmp_path)


@pytest.mark.parametrize(
    "content", [b"PK\x03\x04 broken", b"<model", b"{", b"", b"<other/>", b"[1]"]
)
def test_damaged_files_are_refused(content, tmp_path):
    """Truncated archives, XML or JSON and other documents must raise the same clear error."""
    path = tmp_path / "box.rexs"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="damaged or not a REXS file"):
        gearlib.read_gearbox(path)


@pytest.mark.parametrize("version", ["2.0.0", "0.9", "", "new"])
def test_unsupported_versions_are_refused_by_number(version, tmp_path):
    with pytest.raises(ValueError, match="version"):
        read_rexs_file(two_stage_file(version), tmp_path)


def test_missing_torques_are_reported_by_name(tmp_path):
    """Without load cases the missing torque of the motor must be named in errors and the table."""
    file = two_stage_file()
    file.cases = []
    box = read_rexs_file(file, tmp_path)
    with pytest.raises(ValueError, match="torque_around_u_axis of external_load Motor is missing"):
        box.load("Stufe 1")
    assert "torque_around_u_axis of external_load Motor is missing" in str(box)
    with pytest.raises(ValueError, match="torque_around_u_axis"):
        box.train()


def test_torques_are_read_without_a_speed(tmp_path):
    """A torque alone must be transformed by the ratio 48 / 21 and determine the driving gears."""
    file = two_stage_file()
    file.cases = []
    file.change("Motor", torque_around_u_axis=(40.0, "N m"))
    box = read_rexs_file(file, tmp_path)
    assert box.load("Stufe 2") == {"torque": pytest.approx(40.0 * 48 / 21)}
    train = box.train(model="rectangle", stiffness="iso")
    assert [mesh.driving for mesh in train.meshes] == ["z1", "z3"]


def test_stated_torques_are_balanced(tmp_path):
    """By the ratio (48 / 21) (39 / 19) 40 N m balance 187.669 N m, not the stated 150 N m."""
    file = two_stage_file()
    file.cases = []
    file.change("Motor", torque_around_u_axis=(40.0, "N m"), defines_torque=True)
    file.change("Last", torque_around_u_axis=(-150.0, "N m"))
    box = read_rexs_file(file, tmp_path)
    box.train(model="rectangle", stiffness="iso")
    assert "torque of external_load Last is -150 N m, but by balance -187.669 N m" in box.notes


def test_a_loop_of_stages_with_contradictory_ratios_is_refused(tmp_path):
    """Two stages of ratios 48 / 21 and 52 / 20 between the same shafts would lock."""
    file = two_stage_file()
    add_gear(file, "z5", "Antrieb", (95.0, 0.0, 0.0), 20, 2.5, 0.0, 8.0, 0.0)
    add_gear(file, "z6", "Zwischenwelle", (95.0, 0.0, 90.0), 52, 2.5, 0.0, 8.0, 0.0)
    add_stage(file, "loop", "z5", "z6", 90.0)
    with pytest.raises(ValueError, match="locked"):
        read_rexs_file(file, tmp_path)

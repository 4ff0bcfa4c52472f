"""How rows of a measured table are brought into order."""

import numpy as np
import pytest

from gearlib import read_measured
from gearlib.studies import measured_comparison
from gearlib.uncertainty import measured_tables
from gearlib.uncertainty.measured_tables import in_order


@pytest.mark.parametrize(
    ("time", "group", "order"),
    [
        ([0.0, 1.0, 2.0], [0, 0, 0], None),
        ([0.0, 2.0, 1.0], [0, 0, 0], [0, 2, 1]),
        ([0.0, 1.0, 0.0, 1.0], [5, 5, 2, 2], None),
        # Two conditions row by row, each of which rises: they become two blocks, in their order.
        ([0.0, 0.0, 1.0, 1.0, 2.0, 2.0], [5, 2, 5, 2, 5, 2], [0, 2, 4, 1, 3, 5]),
        # One condition in two parts.
        ([0.0, 0.0, 1.0], [5, 2, 5], [0, 2, 1]),
    ],
)
def test_conditions_become_blocks_in_which_time_rises(time, group, order):
    found = in_order("t", np.array(time), np.array(group))
    assert order == (None if found is None else found.tolist())


def test_a_speed_at_which_the_motion_changes_is_measured_once(tmp_path):
    table = "observableId,measurement,time\njump_up,47,0\njump_up,48,1\nx,1,0\n"
    (tmp_path / "rig.csv").write_text(table)
    channels = "{jump_up: {unit: Hz}, x: {observableId: displacement, unit: um}}"
    said = f"{{data: rig.csv, source: synthetic, licence: own data, channels: {channels}}}"
    (tmp_path / "rig.yaml").write_text(said)
    with pytest.raises(ValueError, match="'jump_up' of rig.csv is there 2 times: it must be once"):
        read_measured(tmp_path / "rig.yaml")


def test_a_file_that_another_package_cannot_read_is_named(tmp_path, monkeypatch):
    def damaged(*_):
        raise KeyError("no such block")

    monkeypatch.setitem(measured_tables._READERS, ".csv", damaged)
    (tmp_path / "rig.csv").write_text("x\n1\n")
    channels = "{x: {observableId: displacement, unit: um}}"
    said = f"{{data: rig.csv, source: synthetic, licence: own data, channels: {channels}}}"
    (tmp_path / "rig.yaml").write_text(said)
    with pytest.raises(ValueError, match=r"data = 'rig\.csv' .* can be read \('no such block'\)"):
        read_measured(tmp_path / "rig.yaml")


def test_a_course_of_few_straight_lines_is_the_measured_speed():
    time = np.linspace(0.0, 10.0, 5001)
    speed = np.interp(time, [0.0, 4.0, 10.0], [1000.0, 3000.0, 500.0])
    course = np.array(measured_comparison._knots(time, speed))
    # A mean of samples is taken where the lines meet.
    assert np.abs(np.interp(time, *course.T) - speed).max() < 15.0
    assert 3 <= len(course) <= 6

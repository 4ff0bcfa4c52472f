"""Campbell diagrams of trains: speeds, orders, modes, and the reducer's lost contact."""

import numpy as np
import pytest
import xarray as xr

from gearlib import planetary, split_power_reducer
from gearlib.studies import trains
from tests.paper import PAPER
from tests.tables import read_back

SETTINGS = {
    "teeth": (24, 36, 24, 36),
    "modules": (4e-3, 4e-3),
    "shaft_stiffness": 1e6,
    "support_stiffness": 1e9,
    "damping_ratio": 0.03,
}


TRAINS = [split_power_reducer(PAPER), planetary(turning=True, stiffness_ratio=(0.7, 0.7))]


@pytest.mark.parametrize("train", TRAINS, ids=["reducer", "planetary"])
def test_mesh_frequencies_meet_natural_ones_at_critical_speeds(train):
    result = train.campbell(2)
    assert result.stiffness_order.size > 1
    assert result.excites.any() == any(mesh.varies for mesh in train.meshes)
    modes = train.modes().natural_frequency
    pinion = train.reference_pinion
    for order in result.stiffness_order.values:
        for mode in result.mode.values:
            speed = float(result.critical_speed.sel(stiffness_order=order, mode=mode))
            # Teeth per second that pass the mesh, seen from the carrier.
            passing = speed / 60.0 / (1.0 + train.carrier_ratio) * pinion.teeth
            frequency = float(modes.sel(mode=mode))
            assert order * passing == pytest.approx(frequency, rel=1e-12)
    # Orders of both mesh frequencies of the reducer, 2 to 3.
    if train.carrier_ratio == 0.0:
        expected = [2.0 / 3.0, 1.0, 4.0 / 3.0, 2.0]
        np.testing.assert_allclose(result.stiffness_order, expected, rtol=1e-12)


@pytest.fixture(scope="module")
def diagram():
    """The Campbell diagram of a reducer of which one mesh loses contact, at tuning 1.

    Its sweeps are made up: at tunings 0.8, 1 and 1.2 all other meshes keep contact all the time.
    """
    train = trains.reducer_train(PAPER, SETTINGS)
    tunings = np.array([0.8, 1.0, 1.2])
    normal = np.ones((1, 3, tunings.size, len(train.meshes)))
    # Of case 0, direction 2 (down), tuning 1.0 and mesh 4.
    normal[0, 2, 1, 4] = 0.9
    characteristics = xr.Dataset(
        {
            "fraction_normal_high": (("case", "direction", "tuning", "mesh"), normal),
            "settled": (("case", "direction", "tuning"), np.ones(normal.shape[:3], np.int8)),
            "speed": ("tuning", train.speed(tunings)),
        },
        {
            "case": ["alike"],
            "direction": ["cold", "up", "down"],
            "tuning": tunings,
            "mesh": list(train.mesh_names),
        },
    )
    return trains.campbell(characteristics, orders=2, pair=PAPER.as_dict(), settings=SETTINGS)


def test_the_table_has_every_intersection_once(diagram, tmp_path):
    rows = read_back(trains.campbell_rows(diagram), tmp_path)
    speeds = [int(row["critical_speed_rpm"]) for row in rows]
    last = float(diagram.speed[-1])
    assert speeds == sorted(speeds) and max(speeds) <= last
    # Modes of one frequency share their intersections.
    frequencies = diagram.natural_frequency.values.round(3)
    intersections = {
        (order, frequency)
        for order, critical_speeds in enumerate(diagram.critical_speed.values)
        for speed, frequency in zip(critical_speeds, frequencies, strict=True)
        if speed <= last
    }
    assert len(rows) == len(intersections)
    # Below the slowest speed of the sweeps the cell is empty.
    contact_lost = {"0.8": "no", "1": "yes", "1.2": "no"}
    for row, speed in zip(rows, speeds, strict=True):
        tuning = diagram.tuning.values[np.abs(diagram.speed.values - speed).argmin()]
        below = speed < float(diagram.speed[0])
        expected = "" if below else contact_lost[f"{tuning:g}"]
        assert row["contact_lost_at_the_nearest_speed_swept"] == expected
        assert row["excited"] == ("yes" if row["mode_kind"] == "rotational" else "no")

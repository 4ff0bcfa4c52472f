"""Studies of the reducer: critical speeds, motions from many starts, tables."""

import numpy as np
import pytest
import xarray as xr

from gearlib import periodic_orbit, planetary, simulate
from gearlib.config import load
from gearlib.models.from_values import build_model
from gearlib.studies import many_starts, trains
from tests.paper import CONFIG as PROJECT
from tests.tables import read_back

CONFIG = load(PROJECT)
PAIR = build_model(CONFIG.pair_description(CONFIG.reducer.damping))
REDUCER = CONFIG.reducer.model_dump() | {"starts": 4, "first_starts": 2}
TRAIN = trains.build_reducer(PAIR, REDUCER)
START_OPTIONS = {"periods": 120, "record_periods": 12, "starts": 5, "first_starts": 2, "seed": 3}
START_OPTIONS |= {"spread": 0.02}


@pytest.mark.parametrize(
    ("train", "orders"),
    [
        # The mesh frequencies of the reducer have the ratio 2 to 3.
        (TRAIN, [2.0 / 3.0, 1.0, 4.0 / 3.0, 2.0]),
        (planetary(turning=True, stiffness_ratio=(0.7, 0.7)), [1.0, 2.0]),
    ],
)
def test_mesh_frequencies_equal_natural_frequencies_at_critical_speeds(train, orders):
    """Orders times mesh frequency must equal natural frequencies at each critical speed."""
    result = train.campbell(2)
    np.testing.assert_allclose(result.stiffness_order, orders, rtol=1e-12)
    assert result.excites.any()
    # The mesh frequency counts the teeth that pass per second, seen from the carrier.
    mesh_frequency = result.critical_speed / 60.0 / (1.0 + train.carrier_ratio)
    mesh_frequency *= train.reference_pinion.teeth
    excitation_frequency, natural_frequency = xr.broadcast(
        result.stiffness_order * mesh_frequency, result.natural_frequency
    )
    np.testing.assert_allclose(excitation_frequency, natural_frequency, rtol=1e-12)


def test_the_table_lists_each_critical_speed_once(tmp_path):
    """The table must list critical speeds in order, with contact loss at the nearest speed."""
    # In these made-up sweeps contact is lost only at tuning 1.0, on the way down, in mesh 4.
    tunings = np.array([0.8, 1.0, 1.2])
    lost = np.zeros((1, 3, 3, len(TRAIN.meshes)))
    lost[0, 2, 1, 4] = 0.1
    dims = ("case", "direction", "tuning", "mesh")
    sweeps = xr.Dataset(
        {
            "contact_loss_fraction_high": (dims, lost),
            "settled": (dims[:3], np.ones((1, 3, 3), np.int8)),
            "speed": ("tuning", TRAIN.speed(tunings)),
        },
        {"case": ["alike"], "tuning": tunings, "mesh": list(TRAIN.mesh_names)},
    )
    diagram = trains.compute_campbell_diagram(sweeps, orders=2, pair=PAIR, settings=REDUCER)
    rows = read_back(trains.campbell_rows(diagram), tmp_path)
    speeds = [int(row["critical_speed_rpm"]) for row in rows]
    swept = diagram.speed.values
    assert speeds == sorted(speeds) and speeds[0] < swept[0] and speeds[-1] <= swept[-1]
    # Modes of equal frequency have common intersections.
    frequencies = np.unique(diagram.natural_frequency.values.round(3), return_index=True)[1]
    assert len(rows) == (diagram.critical_speed[:, frequencies] <= swept[-1]).sum()
    for row, speed in zip(rows, speeds, strict=True):
        # Below the slowest speed of the sweeps the cell is empty.
        lost = ["no", "yes", "no"][np.abs(swept - speed).argmin()] if speed >= swept[0] else ""
        assert row["contact_lost_at_the_nearest_speed_swept"] == lost
        assert row["excited"] == ("yes" if row["mode_kind"] == "rotational" else "no")


def test_the_table_of_the_reducer_holds_a_row_for_each_mesh(tmp_path):
    """The table must have one row per case, direction and mesh, with tunings of contact loss."""
    settings = REDUCER | {"periods": 84, "record_periods": 42}
    sweeps = trains.sweep_reducer(PAIR, [0.84, 0.96], settings)
    rows = read_back(trains.reducer_rows(sweeps), tmp_path)
    cases, directions, meshes = 3, 3, 6
    assert len(rows) == cases * directions * meshes
    for row in rows:
        # At 0.84 only branch 1 loses contact, and only with its pin error; at 0.96 all branches do.
        error = row["case"] == "pin_error" and row["mesh"] in ("first 1", "second 1")
        assert row["contact_lost_in_its_branch_only_at"] == ("0.84" if error else "")


def test_settled_motions_match_the_periodic_orbit():
    """All starts must settle on the orbit that shooting finds."""
    (result,) = many_starts.find_motions_from_equilibrium(TRAIN, [1.2], START_OPTIONS)
    assert result.settled and (result.period == TRAIN.repeats).all()
    orbit = periodic_orbit(TRAIN, 1.2, guess=result.state[0], period=TRAIN.repeats)
    exact = simulate(TRAIN, 1.2, periods=12, record_periods=12, initial_state=tuple(orbit.state))
    summary = many_starts.build_motion_dataset(TRAIN, [result], START_OPTIONS, ["peak_force_ratio"])
    factors = summary.peak_force_ratio.isel(tuning=0)
    np.testing.assert_allclose(
        factors, [exact.peak_force_ratio] * START_OPTIONS["starts"], rtol=1e-11
    )
    assert float(summary.settled_share[0]) == float(summary.largest_share[0]) == 1.0


def test_motions_that_do_not_settle_are_summarised_by_a_range():
    """Motions that do not settle must have period 0 and a range of peak forces."""
    # At this tuning motions in which all branches move alike are unstable.
    (result,) = many_starts.find_motions_from_equilibrium(TRAIN, [1.6], START_OPTIONS)
    summary = many_starts.build_motion_dataset(TRAIN, [result], START_OPTIONS, ["peak_force_ratio"])
    assert not result.settled and int(summary.settled[0]) == 0 and int(summary.period[0]) == 0
    # The orbit -1 stands for a motion that has not settled.
    unsettled = result.orbit < 0
    assert unsettled.any() and not result.period[unsettled].any()
    ranges = many_starts.median_and_range(summary, ["peak_force_ratio"])
    assert (ranges["peak_force_ratio_high"] > 1.1 * ranges["peak_force_ratio_low"]).all()


def test_shares_of_motions_match_the_counts_of_starts_that_lead_to_them():
    """One start of four leads to the motion with contact loss, the others keep contact."""
    # Between the two jumps of the main resonance one motion keeps contact, another loses it.
    keeps, loses = (simulate(PAIR, nu, periods=400, record_periods=1) for nu in (0.80, 0.82))
    assert float(keeps.fraction_drive) == 1.0 > float(loses.fraction_drive)
    contact_state, loss_state = keeps.final_state.values, loses.final_state.values
    states = np.array([contact_state, loss_state, contact_state, contact_state])
    result = many_starts.find_final_motions(PAIR, 0.81, states, START_OPTIONS | {"first_starts": 4})
    summary = many_starts.build_motion_dataset(PAIR, [result], START_OPTIONS, ["displacement_max"])
    assert result.orbit.tolist() == [0, 1, 0, 0]
    assert float(summary.largest_share[0]) == 0.75 and int(summary.motion_count[0]) == 2
    assert float(summary.settled_share[0]) == 1.0 and int(summary.settled[0]) == 0
    # A start on the boundary of the basins, up to rounding, leads to neither motion in time.
    for _ in range(60):
        middle = 0.5 * (contact_state + loss_state)
        motions = many_starts.find_final_motions(PAIR, 0.81, [states[0], middle], START_OPTIONS)
        contact_state, loss_state = (
            (middle, loss_state) if motions.orbit[1] == 0 else (contact_state, middle)
        )
    result = many_starts.find_final_motions(
        PAIR, 0.81, [*states[:2], contact_state], START_OPTIONS | {"first_starts": 3}
    )
    assert result.orbit.tolist() == [0, 1, -1] and result.period[2] == 0

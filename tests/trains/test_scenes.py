"""The reducer over speed: symmetry, closed forms, other routes."""

import dataclasses
import math

import numpy as np
import pytest

from gearlib import GearPair, periodic_orbit, simulate, sweep
from gearlib.config import load
from gearlib.studies import trains
from tests.paper import CONFIG as PROJECT
from tests.tables import read_back

CONFIG = load(PROJECT)
PAIR = GearPair(**CONFIG.pair_parameters(CONFIG.reducer.damping))
FEW = {"starts": 4, "first_starts": 2}
SETTINGS = CONFIG.reducer.model_dump() | {"periods": 84, "record_periods": 42} | FEW
TRAIN = trains.reducer_of(PAIR, SETTINGS)
#: Both stages bounce, the first alone, none.
BOUNCING = [0.96, 1.4, 1.2]


@pytest.fixture(scope="module")
def scene():
    return trains.reducer(PAIR.as_dict(), [0.84, *BOUNCING], SETTINGS)


def test_alike_branches_carry_a_third_each(scene):
    alike = scene.sel(case="alike", direction="cold", tuning=BOUNCING)
    assert (alike.fraction_normal_high < 1.0).any("tuning").all() and (alike.settled == 1).all()
    # On one stable orbit, although they start apart.
    assert abs(alike.load_sharing - 1.0).max() < 1e-9
    assert not alike.lost_alone_share.any() and not alike.struck_alone_share.any()
    by_stage = alike.dynamic_factor.groupby(alike.mesh_stage)
    assert (by_stage.max() - by_stage.min()).max() < 1e-9
    for name in ("dynamic_factor", "load_sharing", "fraction_normal"):
        assert (alike[f"{name}_low"] == alike[f"{name}_high"]).all()


def test_a_displaced_axis_takes_load_off_its_branch(scene):
    errors = trains.displaced_pins(SETTINGS)
    at_rest = trains.reducer_of(PAIR, SETTINGS, pin_errors=errors).static().load_sharing
    # Where contact lasts, motion shares the load as rest does, but for the changing stiffness.
    moving = scene.load_sharing.sel(case="pin_error", direction="cold", tuning=1.2)
    assert at_rest[0] < 0.95 < 1.02 < at_rest[1]
    np.testing.assert_allclose(moving.values, at_rest.values, atol=0.02)
    one = scene.lost_alone_share.sel(case="pin_error", direction="cold", tuning=0.84)
    assert one.values.tolist() == [1.0, 0.0, 0.0]


def test_contact_lost_in_one_branch_only_is_seen_in_the_events(scene):
    train = trains.reducer_of(PAIR, SETTINGS, pin_errors=trains.displaced_pins(SETTINGS))
    run = {"periods": 210, "record_periods": 21, "samples_per_period": 8}
    record = simulate(train, 0.84, initial_state="static", **run)
    names = {train.mesh_names[j] for j in np.unique(record.event_mesh.values)}
    assert names == {"first 1"}


def test_alone_is_one_branch_in_any_of_its_meshes():
    starts = [[0, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 1, 0, 0, 1], [1, 0, 0, 0, 1, 0]]
    happens = np.array(starts, bool)[:, None]
    shares = trains.single_branch_share(happens, np.array([1, 2, 3, 1, 2, 3]))
    assert shares.tolist() == [[0.0, 0.25, 0.25]]


def test_speed_is_that_of_the_input(scene):
    # One mesh period per tooth of the input, at the eigenfrequency of the pair.
    frequency = math.sqrt(PAIR.mean_stiffness / PAIR.reduced_mass) / (2.0 * math.pi)
    expected = 60.0 * frequency * scene.tuning / SETTINGS["teeth"][0]
    np.testing.assert_allclose(scene.speed, expected, rtol=1e-12)


def in_phase(train):
    """Return the train of equal branches in phase as one branch, with two meshes.

    While all branches move alike the central gears stay on their axes, and each branch moves its
    share of them.
    """
    central = {
        name: dataclasses.replace(
            train.by_name[name],
            inertia=train.by_name[name].inertia / trains.BRANCHES,
            torque=train.by_name[name].torque / trains.BRANCHES,
            support_stiffness=math.inf,
            support_damping=0.0,
        )
        for name in ("input", "output")
    }
    satellite = ("satellite 1 a", "satellite 1 b")
    return dataclasses.replace(
        train,
        bodies=[*central.values(), *(train.by_name[name] for name in satellite)],
        meshes=[mesh for mesh in train.meshes if mesh.name in ("first 1", "second 1")],
        shafts=[shaft for shaft in train.shafts if shaft.bodies == satellite],
    )


def test_the_reduced_train_is_the_whole_one_while_branches_move_alike():
    reduced = in_phase(TRAIN)
    run = {"periods": 60, "record_periods": 21, "initial_state": "static"}
    whole, small = sweep(TRAIN, BOUNCING, **run), sweep(reduced, BOUNCING, **run)
    assert (small.fraction_normal < 1.0).any("tuning").all()
    for name in ("dynamic_factor", "displacement_min", "fraction_normal", "bounces"):
        for mesh in small.mesh.values:
            # As above: grown rounding.
            ours, theirs = small[name].sel(mesh=mesh), whole[name].sel(mesh=mesh)
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-11)


def test_the_reduced_train_has_modes_of_the_whole_one():
    whole, small = TRAIN.modes(), in_phase(TRAIN).modes()
    found = [abs(whole.natural_frequency - f).min() for f in small.natural_frequency]
    assert max(found) < 1e-6 * float(small.natural_frequency.max())
    assert (small.mode_kind == "rigid").sum() == 1
    there = whole.natural_frequency.where(whole.mode_kind == "rotational", drop=True)
    assert all(abs(small.natural_frequency - f).min() < 1e-6 * f for f in there)


def test_motion_alike_is_unstable_where_the_reduced_train_calls_it_stable():
    largest = []
    for train in (in_phase(TRAIN), TRAIN):
        run = sweep(train, [1.6], periods=210, record_periods=3, initial_state="static")
        orbit = periodic_orbit(train, 1.6, guess=run.final_state.values[0], period=3)
        largest.append(np.abs(orbit.multipliers).max())
    # 0.848 and 1.178 in three mesh periods.
    assert largest[0] < 0.9 and largest[1] > 1.1


def test_the_table_holds_a_row_for_each_mesh(scene, tmp_path):
    branches = read_back(trains.reducer_rows(scene), tmp_path)
    assert len(branches) == 3 * 3 * 6
    alone = [row["mesh"] for row in branches if "0.84" in row[_LOST].split()]
    assert set(alone) == {"first 1", "second 1"}


_LOST = "contact_lost_in_its_branch_only_at"

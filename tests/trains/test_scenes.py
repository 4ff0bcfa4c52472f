"""The reducer over speed, and what stands for it: symmetry, closed forms, other routes."""

import math

import numpy as np
import pytest

from gearlib import GearPair, periodic_orbit, simulate, sweep
from gearlib.config import load
from gearlib.studies.claims import machine
from gearlib.studies.claims.data import NoData
from gearlib.studies.trains import one_mesh, reducer
from tests.paper import CONFIG as PROJECT
from tests.tables import read_back

CONFIG = load(PROJECT)
PAIR = GearPair(**CONFIG.pair_parameters(CONFIG.reducer.damping))
FEW = {"starts": 4, "first_starts": 2}
SETTINGS = CONFIG.reducer.model_dump() | {"periods": 84, "record_periods": 42} | FEW
CHANGES = CONFIG.one_mesh.model_dump() | FEW
TRAIN = reducer.train_of(PAIR, SETTINGS)
#: Both stages bounce, the first alone, none.
BOUNCING = [0.96, 1.4, 1.2]


@pytest.fixture(scope="module")
def scene():
    return reducer.compute(PAIR.as_dict(), [0.84, *BOUNCING], SETTINGS)


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
    errors = reducer.displaced(SETTINGS)
    at_rest = reducer.train_of(PAIR, SETTINGS, pin_errors=errors).static().load_sharing
    # Where contact lasts, motion shares the load as rest does, but for the changing stiffness.
    moving = scene.load_sharing.sel(case="pin_error", direction="cold", tuning=1.2)
    assert at_rest[0] < 0.95 < 1.02 < at_rest[1]
    np.testing.assert_allclose(moving.values, at_rest.values, atol=0.02)
    one = scene.lost_alone_share.sel(case="pin_error", direction="cold", tuning=0.84)
    assert one.values.tolist() == [1.0, 0.0, 0.0]


def test_contact_lost_in_one_branch_only_is_seen_in_the_events(scene):
    train = reducer.train_of(PAIR, SETTINGS, pin_errors=reducer.displaced(SETTINGS))
    run = {"periods": 210, "record_periods": 21, "samples_per_period": 8}
    record = simulate(train, 0.84, initial_state="static", **run)
    names = {train.mesh_names[j] for j in np.unique(record.event_mesh.values)}
    assert names == {"first 1"}


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ([0, 0, 0, 0, 0, 0], 0),
        ([0, 1, 0, 0, 0, 0], 2),
        ([0, 0, 1, 0, 0, 1], 3),
        ([1, 0, 0, 0, 1, 0], 0),
        ([1, 1, 1, 1, 1, 1], 0),
    ],
)
def test_alone_is_one_branch_in_any_of_its_meshes(where, expected):
    assert reducer.alone(np.array(where, bool), np.array([1, 2, 3, 1, 2, 3])) == expected


def test_speed_is_that_of_the_input(scene):
    # One mesh period per tooth of the input, at the eigenfrequency of the pair.
    frequency = math.sqrt(PAIR.mean_stiffness / PAIR.reduced_mass) / (2.0 * math.pi)
    expected = 60.0 * frequency * scene.tuning / SETTINGS["teeth"][0]
    np.testing.assert_allclose(scene.speed, expected, rtol=1e-12)


def test_the_reduced_train_is_the_whole_one_while_branches_move_alike():
    reduced = one_mesh.in_phase(TRAIN)
    run = {"periods": 60, "record_periods": 21, "initial_state": "static"}
    whole, small = sweep(TRAIN, BOUNCING, **run), sweep(reduced, BOUNCING, **run)
    assert (small.fraction_normal < 1.0).any("tuning").all()
    for name in ("dynamic_factor", "displacement_min", "fraction_normal", "bounces"):
        for mesh in small.mesh.values:
            # As above: grown rounding.
            ours, theirs = small[name].sel(mesh=mesh), whole[name].sel(mesh=mesh)
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-11)


def test_the_reduced_train_has_modes_of_the_whole_one():
    whole, small = TRAIN.modes(), one_mesh.in_phase(TRAIN).modes()
    found = [abs(whole.natural_frequency - f).min() for f in small.natural_frequency]
    assert max(found) < 1e-6 * float(small.natural_frequency.max())
    assert (small.mode_kind == "rigid").sum() == 1
    there = whole.natural_frequency.where(whole.mode_kind == "rotational", drop=True)
    assert all(abs(small.natural_frequency - f).min() < 1e-6 * f for f in there)


def test_the_pair_with_its_share_resonates_as_the_first_stage_alone():
    # Shafts so soft, a millionth of a mesh, that the second stage stays at rest; rigid axes.
    soft = SETTINGS | {"shaft_stiffness": 1.0, "support_stiffness": math.inf}
    modes = reducer.train_of(PAIR, soft).modes()
    first = modes.strain_energy.isel(mesh=slice(0, 3))
    # Of the mode in which all three first meshes bend alike.
    alike = (first.min("mesh") > 0.3).values
    (frequency,) = modes.natural_frequency.values[alike & (modes.mode_kind == "rotational").values]
    share = one_mesh.models(PAIR, SETTINGS, "in_phase", CHANGES)["pair_in_train"]
    expected = math.sqrt(share.mean_stiffness / share.reduced_mass) / (2.0 * math.pi)
    assert frequency == pytest.approx(expected, rel=1e-6)


def test_motion_alike_is_unstable_where_the_reduced_train_calls_it_stable():
    largest = []
    for train in (one_mesh.in_phase(TRAIN), TRAIN):
        run = sweep(train, [1.6], periods=210, record_periods=3, initial_state="static")
        orbit = periodic_orbit(train, 1.6, guess=run.final_state.values[0], period=3)
        largest.append(np.abs(orbit.multipliers).max())
    # 0.848 and 1.178 in three mesh periods.
    assert largest[0] < 0.9 and largest[1] > 1.1


@pytest.fixture(scope="module")
def comparison():
    return one_mesh.compute(PAIR.as_dict(), [0.82, 0.96, 1.38, 1.6], SETTINGS, CHANGES)


def test_the_smallest_sufficient_model_follows_from_the_changes(comparison):
    within = (comparison.answer_change <= CHANGES["tolerance"]).all("observable")
    for case in comparison.case.values:
        enough = [m for m in comparison.model.values if within.sel(case=case, model=m)]
        assert comparison.sufficient.sel(case=case).item() == enough[0]
    assert comparison.sufficient.sel(case="in_phase") == "two_meshes"
    # The resonance of the pair alone lies where the train has none, the other way round at 1.38.
    factor = comparison.dynamic_factor.sel(case="in_phase")
    assert factor.sel(model="pair", tuning=0.82) > 1.4 * factor.sel(model="whole", tuning=0.82)
    assert factor.sel(model="whole", tuning=1.38) > 1.5 * factor.sel(model="pair", tuning=1.38)


def test_without_tolerance_only_the_same_motion_suffices():
    short = {"periods": 6, "record_periods": 3, "starts": 1, "first_starts": 1}
    exact = CHANGES | short | {"tolerance": 0.0}
    found = one_mesh.compute(PAIR.as_dict(), [0.82, 0.96], SETTINGS | short, exact)
    # Alike, all branches move as one exactly.
    assert found.sufficient.values.tolist() == ["two_meshes"] + ["whole"] * 4


def test_only_in_its_own_case_an_axis_is_displaced():
    errors = {"pin_errors": reducer.displaced(SETTINGS)}
    for case, given in (("disturbed", {}), ("pin_error", errors)):
        assert one_mesh.models(PAIR, SETTINGS, case, CHANGES)["whole"] == reducer.train_of(
            PAIR, SETTINGS, **given
        )
    assert TRAIN != reducer.train_of(PAIR, SETTINGS, **errors)


def test_changes_are_relative_and_a_jump_that_one_lacks_counts():
    values = np.array(
        [[0.9, np.nan, 0.0, np.nan], [1.1, 1.2, 0.1, np.nan], [1.0, 1.2, 0.0, np.nan]]
    )
    expected = [[0.1, np.inf, 0.0, 0.0], [0.1, 0.0, np.inf, 0.0], [0.0] * 4]
    np.testing.assert_allclose(one_mesh.relative_changes(values), expected)


def test_a_jump_is_the_largest_step_of_the_characteristic():
    flat = np.zeros(4)
    found = one_mesh.observe([0.7, 0.8, 0.9, 1.0], np.array([1.0, 1.2, 3.0, 2.9]), flat, flat)
    np.testing.assert_allclose(found[:3], [0.9, 3.0, 0.85])
    smooth = one_mesh.observe([0.7, 0.8], np.array([1.0, 1.4]), flat, flat)
    assert math.isnan(smooth[2])


def test_answers_that_hang_on_what_rounding_decides_are_found():
    # Three starts at five tunings; rounding decides the motions at the fourth.
    firm = np.array([True, True, True, False, True])
    flat = np.ones((3, 5))
    factor = np.array([[1.0, 3.0, 2.9, 2.0 + d, 1.0] for d in (0.0, 0.1, 0.2)])
    # peak tuning, peak factor, jump, contact loss, load sharing
    assert one_mesh.certain(factor, flat, firm).all(axis=0).tolist() == [1, 1, 1, 0, 1]
    # Widened by itself its range reaches the peak, and the step behind it may be the largest.
    factor[:, 3] += [0.2, 0.4, 0.6]
    assert one_mesh.certain(factor, flat, firm).all(axis=0).tolist() == [0, 0, 0, 0, 1]
    # Only the step before it may be.
    factor[:, 3] = [0.9, 1.0, 1.1]
    assert one_mesh.certain(factor, flat, firm).all(axis=0).tolist() == [1, 1, 0, 0, 1]
    # It is the peak, of a height that is another one from start to start.
    factor[:, 3] = [6.0, 6.1, 6.2]
    assert one_mesh.certain(factor, flat, firm).all(axis=0).tolist() == [1, 0, 1, 0, 1]
    flat[:, 3] = [1.1, 1.2, 1.3]
    assert not one_mesh.certain(factor, flat, firm)[:, 4].any()
    assert one_mesh.certain(factor, flat, np.ones(5, bool)).all()
    # No step that counts as a jump, whatever the motions in doubt are.
    assert one_mesh.certain(1.0 + 0.01 * factor, flat, firm)[:, 2].all()


def test_the_verdict_on_one_mesh_follows_the_data(comparison):
    holds, words = machine.one_mesh(comparison)
    assert not holds and "held alike: the two meshes of one branch" in words
    other = comparison.copy(deep=True)
    other["sufficient"] = ("case", ["pair"] * other.sizes["case"])
    assert machine.one_mesh(other)[0]
    other.dynamic_factor[0, 0, 0] = np.nan
    with pytest.raises(NoData):
        machine.one_mesh(other)


def test_tables_hold_a_row_for_each_mesh_and_model(scene, comparison, tmp_path):
    branches = read_back(reducer.rows(scene), tmp_path)
    models = read_back(one_mesh.rows(comparison), tmp_path)
    assert len(branches) == 3 * 3 * 6 and len(models) == 5 * 5
    alone = [row["mesh"] for row in branches if "0.84" in row[_LOST].split()]
    assert set(alone) == {"first 1", "second 1"}
    chosen = [row for row in models if row["smallest_that_suffices"] == "yes"]
    assert [row["model"] for row in chosen] == comparison.sufficient.values.tolist()


_LOST = "contact_lost_in_its_branch_only_at"

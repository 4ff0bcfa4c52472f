"""Load sharing of trains: equilibrium, hand calculation and Willis' equation."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib import idler, planetary, simulate, split_power_reducer
from gearlib.models.trains.statics import equilibrium
from tests.independent.systems import describe, system_of
from tests.paper import PAPER_PAIR
from tests.trains.random_trains import chain_train, planetary_train, reducer_train


def check_equilibrium(train):
    """Assert that the static forces of a train balance, and return its contacts at phase 0.

    The equilibrium is unique, because springs that can only push have a convex energy.
    """
    result, system = equilibrium(train), system_of(describe(train), 1.0)
    assert not result.both_flanks_touch.any()
    # The forces of a rotating frame are not part of the static equilibrium.
    stiffness, load = system.stiffness_and_load_at_rest
    balance = load - stiffness @ result.q
    force_scale = np.abs(load) + np.abs(stiffness) @ np.abs(result.q)
    for contact, force, contact_state in zip(
        system.contacts, result.force, result.contact, strict=True
    ):
        drive, coast = (system.distance(side, result.q, 0.0) for side in contact["sides"])
        # Distances are rounded by 1e-17 m, so that a flank that just touches may count as open.
        is_consistent = {
            1: drive >= -1e-17,
            -1: coast <= 1e-17,
            0: drive < 1e-17 and coast > -1e-17,
        }
        assert is_consistent[contact_state]
        side, distance = (
            contact["sides"][int(contact_state < 0)],
            drive if contact_state >= 0 else coast,
        )
        elastic_force = system.level(contact, side, 1e-12) * distance if contact_state else 0.0
        # The distance is a small difference of displacements, whose rounding limits the force.
        assert force == pytest.approx(elastic_force, abs=1e-12 * force_scale.max())
        balance, force_scale = balance - force * side["row"], force_scale + abs(force * side["row"])
    np.testing.assert_allclose(balance, 0.0, rtol=0, atol=1e-12 * force_scale.max())
    return result.contact


def test_forces_of_random_trains_are_in_balance_where_flanks_touch():
    """Random errors, backlashes and loads must leave meshes open or in contact on either side."""
    contact_states = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        train = (planetary_train, reducer_train, chain_train)[seed % 3](rng)
        # Errors of several deflections, so that meshes stay open or touch on the coast side.
        meshes = [
            replace(mesh, error=rng.normal(0.0, 40e-6), backlash=rng.uniform(5e-6, 50e-6))
            for mesh in train.meshes
        ]
        load_factor = rng.choice([1.0, 0.2, -1.0])
        bodies = [replace(body, torque=load_factor * body.torque) for body in train.bodies]
        train = train.replace(meshes=meshes, bodies=bodies, gyroscopic=False)
        contact_states.append(check_equilibrium(train))
    assert sum(0 in states for states in contact_states) > 10
    assert sum(-1 in states for states in contact_states) > 8


@pytest.mark.parametrize("internal", [False, True])
def test_load_sharing_with_a_displaced_pin_matches_hand_calculation(internal):
    """Each of three branches is two meshes and a shaft in series, and one pin is displaced."""
    pair, pin_error, shaft_stiffness = PAPER_PAIR.replace(backlash=math.inf), 10e-6, 1e6
    train = split_power_reducer(
        pair,
        internal=internal,
        support_stiffness=math.inf,
        shaft_stiffness=shaft_stiffness,
        pin_errors=[(0.0, pin_error), (0.0, 0.0), (0.0, 0.0)],
    )
    r_a, r_b = (train.by_name[f"satellite 1 {x}"].base_radius for x in "ab")
    ratio, pressure_angle = r_a / r_b, math.radians(20.0)
    # At phase 0 the first meshes are at the upper level and the second ones at the lower level.
    assert train.phases["second 1"] == pytest.approx(7 / 12, abs=1e-12)
    compliance = 1.0 / pair.max_stiffness + r_a**2 / shaft_stiffness + ratio**2 / pair.min_stiffness
    approach = -pin_error * math.cos(pressure_angle) * (1.0 + ratio if internal else 1.0 - ratio)
    force = pair.load + np.array([2.0, -1.0, -1.0]) / 3.0 * approach / compliance
    force = force if force.min() > 0.0 else np.array([0.0, 1.5, 1.5]) * pair.load
    static_state, forces = train.static(), np.concatenate([force, ratio * force])
    np.testing.assert_allclose(static_state.mesh_force, forces, rtol=1e-11, atol=1e-8)
    np.testing.assert_allclose(static_state.load_sharing, np.tile(force / pair.load, 2), atol=1e-11)


def test_torques_and_speeds_of_a_planetary_train_satisfy_willis_equation():
    """With fixed ring and carrier T_r = T_s z_r / z_s and T_c = -T_s (1 + z_r / z_s)."""
    train, ratio = planetary(torsional_stiffness=(0.0, 1e9, 2e9)), 99 / 27
    static, torque = train.static(), train.by_name["sun"].torque
    for name, stiffness, torque_ratio in (("ring", 1e9, ratio), ("carrier", 2e9, -(1.0 + ratio))):
        body = train.by_name[name]
        rotation = float(static.body_displacement.sel(body=name, axis="rotation"))
        assert body.torque == 0.0
        assert -stiffness * rotation * body.base_radius == pytest.approx(
            torque * torque_ratio, rel=1e-10
        )
    # Free members get the balancing torques by default; otherwise the train would be refused.
    for stiffnesses in ((0.0, 1e9, 0.0), (0.0, 0.0, 1e9), (0.0, 0.0, 0.0)):
        static = planetary(torsional_stiffness=stiffnesses).static()
        np.testing.assert_allclose(static.mesh_force, 2000.0, rtol=1e-10)
    # With the ring at rest the sun turns 1 + z_r / z_s times as fast as the carrier.
    train = planetary(turning=True)
    revolutions = train.mesh_frequency(1.0) / math.tau / 27
    assert train.speed_scales(1.0)["speed"] == pytest.approx(
        60.0 * revolutions * (1.0 + 1.0 / ratio)
    )
    assert (1.0 + train.carrier_ratio) / train.carrier_ratio == pytest.approx(1.0 + ratio)


def test_a_load_on_missing_coast_sides_is_refused():
    """With infinite backlash a reversed torque meets no flank, so that there is no equilibrium."""
    train = idler(PAPER_PAIR.replace(backlash=math.inf))
    bodies = [replace(body, torque=-body.torque) for body in train.bodies]
    with pytest.raises(ValueError, match="no static equilibrium"):
        train.replace(bodies=bodies).static()
    result = idler(PAPER_PAIR).replace(bodies=bodies).static()
    assert list(result.contact.values) == [-1, -1]
    np.testing.assert_allclose(result.mesh_force, -PAPER_PAIR.load, rtol=1e-12)


@pytest.mark.parametrize("load", [2000.0, -2000.0])
def test_a_static_start_stays_at_rest_on_coast_sides_that_move_with_the_supports(load):
    """A run from the static state must stay there under either sign of the load."""
    train = planetary(load=load)
    changes = {"moving_backlash": True, "backlash": 6e-6}
    train = train.replace(meshes=[replace(mesh, **changes) for mesh in train.meshes])
    assert set(train.static().contact.values) == {1 if load > 0.0 else -1}
    run = simulate(train, 0.7, periods=3, record_periods=3, initial_state="static")
    assert np.ptp(run.displacement.values, axis=0).max() < 1e-9
    # Rigid-body rotation of the train must not change any distance of flanks.
    assert np.abs(train.coast_lines @ train.free_motions).max() < 1e-12

"""Forces of the turning frame: a Lagrangian of finite rotations, symmetry, balances, rotors."""

import math
from dataclasses import replace

import numpy as np
import pytest

import gearlib
from gearlib import planetary, simulate


def turning(rng=None, planets=3, **options):
    """Return a turning planetary train; with `rng` one without any symmetry."""
    settings = dict(planets=planets, turning=True, gyroscopic=True)
    if rng is not None:
        teeth = ((27, 99), (28, 98), (30, 90))[rng.integers(3)]
        whole = rng.permutation(sum(teeth) // 9)[:planets] * 9
        settings |= dict(
            teeth=teeth,
            positions=[2.0 * math.pi * k / sum(teeth) for k in whole],
            masses=tuple(rng.uniform(0.5, 6.0, 4)),
            reduced_inertias=tuple(rng.uniform(0.5, 6.0, 4)),
            support_stiffness=tuple(10.0 ** rng.uniform(7.0, 9.0, 4)),
            torsional_stiffness=(0.0, 10.0 ** rng.uniform(7.0, 9.0), 0.0),
            load=rng.uniform(-3000.0, 3000.0),
        )
    return planetary(**(settings | options))


def turned(train):
    """Return the coordinates of a turn of the whole train about its axis by 1 rad, m."""
    q = np.zeros(train.size // 2)
    for i, (name, axis) in enumerate(train.structure.coordinates):
        body = train.by_name[name]
        if axis == "u":
            q[i] = body.base_radius
        elif axis == "y" and body.carrier:
            q[i] = train.by_name[body.carrier].base_radius
    return q


@pytest.mark.parametrize("tuning", [0.01, 30.0])
def test_a_turn_of_the_whole_train_costs_nothing(tuning):
    for seed in range(3):
        torsional = dict(torsional_stiffness=(0.0, 0.0, 0.0))
        train = turning(np.random.default_rng(seed), planets=seed + 1, **torsional)
        rigid, n = turned(train), train.size // 2
        system = train.system(tuning)
        forces = train.structure.mass @ system.base_matrix[n : 2 * n, :n]
        assert np.abs(forces @ rigid).max() < 1e-13 * (np.abs(forces) @ np.abs(rigid)).max()
        rows = np.concatenate([system.drive_lines[:, :n], system.coast_lines[:, :n]])
        assert np.abs(rows @ rigid).max() < 1e-12 * np.abs(rigid).max()


def test_angular_momentum_is_kept_through_bounces():
    """Without a torsional support all torques are in balance, and no support has a moment.

    With the energy in the turning frame (tests/properties/test_energy.py), whose balance is
    that of the fixed frame less the speed of the frame times this, power in the fixed frame closes.
    """
    train = turning(torsional_stiffness=(0.0, 0.0, 0.0), stiffness_ratio=(0.5, 0.5), backlash=2e-6)
    tuning, length = 1.0, train.static_deflection
    start = train.start_state("static")
    start[:3] += 20.0
    run = simulate(train, tuning, periods=40, record_periods=40, initial_state=tuple(start))
    assert {-1, 0, 1} >= set(run.event_to.values.tolist()) >= {0, 1}
    mesh_speed = tuning * train.reference_angular_frequency
    frame = train.carrier_ratio * float(train.speeds["sun"]) * mesh_speed

    def momentum(state):
        """Return the angular momentum and the sum of sizes of its parts, a scale of rounding."""
        parts, n = [], train.size // 2
        for i, (name, axis) in enumerate(train.structure.coordinates):
            body = train.by_name[name]
            q, v = length * state[i], length * mesh_speed * state[n + i]
            if axis == "u":
                parts.append(body.inertia / body.base_radius * v)
            elif body.carrier:
                # m (r + zeta)^2 W + m r eta', to first order.
                r = train.by_name[body.carrier].base_radius
                parts.append(body.mass * r * (v if axis == "y" else 2.0 * frame * q))
        return sum(parts), np.abs(parts).sum()

    (before, _), (after, scale) = momentum(start), momentum(run.final_state.values)
    assert abs(after - before) < 1e-9 * scale


def whirl(stiffness, outer, shaft, inner, speed):
    """Return the eigenvalues of the sun as a Jeffcott rotor, in the frame that turns at `speed`.

    Its support, which stands still, has `stiffness` and the damping `outer`. A shaft with the
    bending stiffness `shaft` and the damping `inner` connects it to a plate that turns with the
    frame. All meshes are in their backlash.
    """
    train = planetary(turning=True, gyroscopic=True, backlash_damping=0.0, load=0.0)
    bodies = [
        replace(body, mass=2.0, support_stiffness=stiffness, support_damping=outer)
        if body.name == "sun"
        else replace(body, support_stiffness=math.inf)
        if body.name == "carrier"
        else body
        for body in train.bodies
    ]
    plate = gearlib.Body(name="plate", inertia=1.0, base_radius=0.1)
    bent = gearlib.Shaft(
        bodies=("sun", "plate"), stiffness=1.0, bending_stiffness=shaft, bending_damping=inner
    )
    train = train.replace(bodies=[*bodies, plate], shafts=[bent])
    frequency = train.reference_angular_frequency
    frame_speed_at_tuning_1 = float(train.speeds["sun"]) * train.carrier_ratio * frequency
    system, n = train.system(speed / frame_speed_at_tuning_1), train.size // 2
    sun = [train.structure.coordinates.index(("sun", axis)) for axis in "xy"]
    sun += [n + i for i in sun]
    values = np.linalg.eigvals(system.base_matrix[np.ix_(sun, sun)]) * frequency
    return values[np.argsort(values.imag)]


def test_an_undamped_jeffcott_rotor_whirls_at_one_frequency_of_the_fixed_frame():
    natural = math.sqrt(1e8 / 2.0)
    for speed in (0.1 * natural, 0.9 * natural, 1.1 * natural, 5.0 * natural):
        values = whirl(1e8, 0.0, 0.0, 0.0, speed)
        # Forward and backward whirl at +-w0, seen from a frame that turns by W.
        expected = sorted(s * natural - c * speed for s in (1, -1) for c in (1, -1))
        np.testing.assert_allclose(values.imag, expected, rtol=0, atol=1e-9 * (natural + speed))
        np.testing.assert_allclose(values.real, 0.0, atol=1e-7 * natural)


def test_rotating_damping_destabilises_a_rotor_above_its_critical_speed():
    """Damping of a support that stands still raises the limit to w0 (1 + c_outer / c_inner)."""
    natural = math.sqrt((6e7 + 4e7) / 2.0)
    for outer, inner in ((500.0, 400.0), (200.0, 400.0), (0.0, 300.0), (300.0, 0.0)):
        limit = natural * (1.0 + outer / inner) if inner else math.inf
        near_limit = (0.999 * limit, 1.001 * limit) if inner else ()
        for speed in (0.5 * natural, *near_limit, 3.5 * natural):
            values = whirl(6e7, outer, 4e7, inner, speed)
            assert (values.real.max() > 0.0) == (speed > limit)

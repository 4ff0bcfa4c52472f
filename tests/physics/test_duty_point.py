"""Duty points: what is left out before the record, and how long the record is."""

import math

import numpy as np
import pytest

from gearlib import Body, GearTrain, LoadSharingPair, Mesh, Shaft, duty_point, planetary, simulate
from gearlib import geometry as g
from tests.paper import PAPER

STAGES = ((23, 71), (19, 73), (17, 67))


def three_stages(damping):
    """Return three stages with coprime teeth, whose excitation repeats after 71 * 73 periods."""
    bodies = [Body(name="motor", inertia=0.05, base_radius=0.1, torque=150.0)]
    meshes, shafts, torque = [], [], 150.0
    for i, teeth in enumerate(STAGES):
        radii = [(1.0 + i) * 1.4e-3 * z for z in teeth]
        for name, z, radius in zip("pw", teeth, radii, strict=True):
            inertia = 50.0 * (1.0 + i) * radius**4 * 7.85
            bodies.append(Body(name=f"{name}{i}", teeth=z, base_radius=radius, inertia=inertia))
        mesh = {"max_stiffness": 3e8 * (1 + i), "stiffness_ratio": 0.7, "contact_ratio": 1.6}
        mesh |= {"backlash": 1e-4, "material_damping": damping}
        meshes.append(Mesh(pinion=f"p{i}", wheel=f"w{i}", **mesh))
        torque *= radii[1] / radii[0]
    bodies.append(Body(name="load", inertia=2.0, base_radius=0.2, torque=torque))
    ends = ("motor", "p0"), ("w0", "p1"), ("w1", "p2"), ("w2", "load")
    for names, stiffness in zip(ends, (4e4, 3e5, 1.5e6, 2e6), strict=True):
        shafts.append(Shaft(bodies=names, stiffness=stiffness, damping=1e-4 * stiffness))
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts, reference="p0-w0")


def test_a_duty_point_of_coprime_stages_records_one_cycle_after_the_transient():
    train = three_stages(damping=3e4)
    assert train.repeats == 71 * 73
    duty = duty_point(train, 1500.0)
    settings = {"periods": 3 * train.repeats, "record_periods": train.repeats}
    run = simulate(train, speed=1500.0, samples_per_period=1, **settings)
    np.testing.assert_allclose(duty.peak_force_ratio, run.peak_force_ratio, rtol=1e-6)
    assert duty.settled == 1 and duty.record_periods == train.repeats <= duty.transient_periods
    # The second stage drives on its coast side.
    assert duty.static_force[1] < 0.0 and (duty.contact_loss_fraction == 0.0).all()


def test_a_truncated_transient_is_reported_with_its_remaining_amplitude():
    train = three_stages(damping=3e4)
    shafts = [
        Shaft(bodies=s.bodies, stiffness=s.stiffness, damping=1e-9 * s.stiffness)
        for s in train.shafts
    ]
    duty = duty_point(train.replace(shafts=shafts), 15000.0)
    assert "10000 mesh periods" in duty.comment and "decayed to" in duty.comment
    assert duty.settled == 0


def stage(*teeth, rms=3e-6):
    """Return a stage with random pitch errors on both gears."""
    draw = np.random.default_rng(3).normal
    gears = [
        g.SpurGear(teeth=z, module=3e-3, width=20e-3, pitch_errors=tuple(draw(0.0, rms, z)))
        for z in teeth
    ]
    return g.GearStage(*gears, backlash=80e-6)


def test_pitch_errors_of_both_gears_are_recorded_until_the_same_teeth_meet_again():
    mesh, load = stage(23, 61), {"torque": 85.0, "damping_ratio": 0.05}
    duty = duty_point(mesh, 6000.0, **load)
    pair, cycle = LoadSharingPair.from_geometry(mesh, **load), 23 * 61
    settings = {"periods": 3 * cycle, "record_periods": cycle, "samples_per_period": 1}
    run = simulate(pair, speed=6000.0, **settings)
    assert duty.dynamic_factor == pytest.approx(float(run.dynamic_force_max), rel=1e-6)
    height = float(run.displacement_max - run.displacement_min) * pair.static_deflection
    assert duty.error_peak_to_peak == pytest.approx(height, rel=1e-6)
    assert duty.settled == 1 and duty.record_periods == cycle and str(cycle) in duty.comment


def test_a_cycle_too_long_to_compute_is_sampled_with_a_comment():
    duty = duty_point(stage(89, 131), 6000.0, torque=300.0, damping_ratio=0.05)
    assert duty.settled == 0 and "sample" in duty.comment and str(89 * 131) in duty.comment


def test_motions_start_from_static_equilibrium():
    # Without damping, a mesh of constant stiffness stays there.
    duty = duty_point(PAPER.replace(stiffness_ratio=1.0, material_damping=0.0), 3000.0)
    assert duty.peak_force_ratio == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("planets", [1, 3])
def test_pins_of_planets_carry_the_forces_of_both_their_meshes(planets):
    # With one planet the axis of the carrier gives way.
    train, angle = planetary(planets=planets), 0.4293509959906051
    duty = duty_point(train, 200.0)
    expected = 2.0 * 2000.0 * math.cos(angle)
    assert duty.bearing_force_max[3:].values == pytest.approx([expected] * planets, rel=1e-6)

"""Duty points: the length of the transient before the record and of the record itself."""

import math

import numpy as np
import pytest

from gearlib import Body, GearTrain, LoadSharingPair, Mesh, Shaft, duty_point, planetary, simulate
from gearlib import geometry as g
from tests.paper import PAPER_PAIR

STAGES = ((23, 71), (19, 73), (17, 67))


def three_stages(damping):
    """Return a train of three stages whose coprime teeth repeat after 71 * 73 mesh periods.

    `damping` is the damping coefficient of each mesh, Ns/m.
    """
    bodies = [Body(name="motor", inertia=0.05, base_radius=0.1, torque=150.0)]
    meshes, shafts, torque = [], [], 150.0
    for stage_index, teeth in enumerate(STAGES):
        radii = [(1.0 + stage_index) * 1.4e-3 * tooth_count for tooth_count in teeth]
        for name, tooth_count, radius in zip("pw", teeth, radii, strict=True):
            inertia = 50.0 * (1.0 + stage_index) * radius**4 * 7.85
            bodies.append(
                Body(
                    name=f"{name}{stage_index}",
                    teeth=tooth_count,
                    base_radius=radius,
                    inertia=inertia,
                )
            )
        mesh = {
            "max_stiffness": 3e8 * (1 + stage_index),
            "stiffness_ratio": 0.7,
            "contact_ratio": 1.6,
        }
        mesh |= {"backlash": 1e-4, "material_damping": damping}
        meshes.append(Mesh(pinion=f"p{stage_index}", wheel=f"w{stage_index}", **mesh))
        torque *= radii[1] / radii[0]
    bodies.append(Body(name="load", inertia=2.0, base_radius=0.2, torque=torque))
    ends = ("motor", "p0"), ("w0", "p1"), ("w1", "p2"), ("w2", "load")
    for names, stiffness in zip(ends, (4e4, 3e5, 1.5e6, 2e6), strict=True):
        shafts.append(Shaft(bodies=names, stiffness=stiffness, damping=1e-4 * stiffness))
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts, reference="p0-w0")


def test_a_duty_point_of_coprime_stages_records_one_cycle_after_the_transient():
    """Compare the peak forces with a plain run over three whole cycles, the last one recorded."""
    train = three_stages(damping=3e4)
    assert train.repeats == 71 * 73
    point = duty_point(train, 1500.0)
    settings = {"periods": 3 * train.repeats, "record_periods": train.repeats}
    run = simulate(train, speed=1500.0, samples_per_period=1, **settings)
    np.testing.assert_allclose(point.peak_force_ratio, run.peak_force_ratio, rtol=1e-6)
    assert point.settled == 1 and point.record_periods == train.repeats <= point.transient_periods
    # The second stage drives on its coast side.
    assert point.static_force[1] < 0.0 and (point.contact_loss_fraction == 0.0).all()


def test_a_truncated_transient_is_reported_with_its_remaining_amplitude():
    """The comment on an operating point must say that its transient was cut off."""
    train = three_stages(damping=3e4)
    # Shafts of so little damping let free vibrations last longer than the longest transient.
    shafts = [
        Shaft(bodies=shaft.bodies, stiffness=shaft.stiffness, damping=1e-9 * shaft.stiffness)
        for shaft in train.shafts
    ]
    point = duty_point(train.replace(shafts=shafts), 15000.0)
    assert "10000 mesh periods" in point.comment and "decayed to" in point.comment
    assert point.settled == 0


def stage_with_pitch_errors(*teeth, rms=3e-6):
    """Return a gear stage with given numbers of teeth and random pitch errors on both gears.

    `rms` is the standard deviation of the pitch errors, m.
    """
    normal_deviate = np.random.default_rng(3).normal
    gears = [
        g.SpurGear(
            teeth=tooth_count,
            module=3e-3,
            width=20e-3,
            pitch_errors=tuple(normal_deviate(0.0, rms, tooth_count)),
        )
        for tooth_count in teeth
    ]
    return g.GearStage(*gears, backlash=80e-6)


def test_pitch_errors_of_both_gears_are_recorded_until_the_same_teeth_meet_again():
    """Compare the duty point with a plain run: the same teeth meet after 23 * 61 mesh periods."""
    gear_stage, load = stage_with_pitch_errors(23, 61), {"torque": 85.0, "damping_ratio": 0.05}
    point = duty_point(gear_stage, 6000.0, **load)
    pair, cycle = LoadSharingPair.from_geometry(gear_stage, **load), 23 * 61
    settings = {"periods": 3 * cycle, "record_periods": cycle, "samples_per_period": 1}
    run = simulate(pair, speed=6000.0, **settings)
    assert point.dynamic_factor == pytest.approx(float(run.dynamic_force_max), rel=1e-6)
    peak_to_peak = float(run.displacement_max - run.displacement_min) * pair.static_deflection
    assert point.error_peak_to_peak == pytest.approx(peak_to_peak, rel=1e-6)
    assert point.settled == 1 and point.record_periods == cycle and str(cycle) in point.comment


def test_a_cycle_too_long_to_compute_is_sampled_with_a_comment():
    point = duty_point(stage_with_pitch_errors(89, 131), 6000.0, torque=300.0, damping_ratio=0.05)
    assert point.settled == 0 and "sample" in point.comment and str(89 * 131) in point.comment


def test_motions_start_from_static_equilibrium():
    # An undamped mesh of constant stiffness stays in its equilibrium only if it starts there.
    point = duty_point(PAPER_PAIR.replace(stiffness_ratio=1.0, material_damping=0.0), 3000.0)
    assert point.peak_force_ratio == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("planets", [1, 3])
def test_pins_of_planets_carry_the_forces_of_both_their_meshes(planets):
    """The forces of both meshes act on a pin in the direction of the pressure angle, `angle`."""
    # With a single planet the support of the carrier is displaced too.
    train, angle = planetary(planets=planets), 0.4293509959906051
    point = duty_point(train, 200.0)
    pin_force = 2.0 * 2000.0 * math.cos(angle)
    assert point.bearing_force_max[3:].values == pytest.approx([pin_force] * planets, rel=1e-6)

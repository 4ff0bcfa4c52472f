"""Check how long the transient and the record of a duty point (a steady operating point) are."""

import math

import numpy as np
import pytest

from gearlib import Body, GearTrain, LoadSharingPair, Mesh, Shaft, duty_point, planetary, simulate
from gearlib.geometry import GearStage, SpurGear
from tests.paper import PAPER_PAIR

TEETH_OF_STAGES = ((23, 71), (19, 73), (17, 67))


def train_of_three_stages(damping):
    """Return a train of three stages whose positions repeat after 71 * 73 mesh periods.

    The tooth numbers are coprime. `damping` is the damping coefficient of each mesh, N s/m.
    """
    bodies = [Body(name="motor", inertia=0.05, base_radius=0.1, torque=150.0)]
    meshes, shafts, torque = [], [], 150.0
    for index, teeth in enumerate(TEETH_OF_STAGES):
        # Modules, widths and mesh stiffnesses increase from stage to stage.
        size = 1.0 + index
        pinion_radius, wheel_radius = (size * 1.4e-3 * tooth_count for tooth_count in teeth)
        for prefix, tooth_count, radius in zip(
            "pw", teeth, (pinion_radius, wheel_radius), strict=True
        ):
            # The inertia of a steel disk is proportional to the fourth power of its radius.
            inertia = 50.0 * size * radius**4 * 7.85
            fields = {"teeth": tooth_count, "base_radius": radius, "inertia": inertia}
            bodies.append(Body(name=f"{prefix}{index}", **fields))
        fields = {"max_stiffness": 3e8 * size, "stiffness_ratio": 0.7, "contact_ratio": 1.6}
        fields |= {"backlash": 1e-4, "material_damping": damping}
        meshes.append(Mesh(pinion=f"p{index}", wheel=f"w{index}", **fields))
        torque *= wheel_radius / pinion_radius
    bodies.append(Body(name="load", inertia=2.0, base_radius=0.2, torque=torque))
    ends = ("motor", "p0"), ("w0", "p1"), ("w1", "p2"), ("w2", "load")
    for names, stiffness in zip(ends, (4e4, 3e5, 1.5e6, 2e6), strict=True):
        shafts.append(Shaft(bodies=names, stiffness=stiffness, damping=1e-4 * stiffness))
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts, reference="p0-w0")


def test_a_duty_point_of_coprime_stages_records_one_cycle_after_the_transient():
    """Peak forces must equal those of a run over three cycles, of which the last is recorded."""
    train, speed = train_of_three_stages(damping=3e4), 1500.0
    cycle = 71 * 73
    assert train.repeats == cycle
    point = duty_point(train, speed)
    run_options = {"periods": 3 * cycle, "record_periods": cycle, "samples_per_period": 1}
    run = simulate(train, speed=speed, **run_options)
    np.testing.assert_allclose(point.peak_force_ratio, run.peak_force_ratio, rtol=1e-6)
    assert point.settled == 1 and point.record_periods == cycle <= point.transient_periods
    # The second stage carries its load on the coast side.
    assert point.static_force[1] < 0.0 and (point.contact_loss_fraction == 0.0).all()


def test_a_truncated_transient_is_reported_with_its_remaining_amplitude():
    """The comment must state how far a free vibration has decayed when the transient is cut off."""
    train = train_of_three_stages(damping=3e4)
    # With this damping of the shafts, free vibrations last longer than the longest transient.
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
    rng, gears = np.random.default_rng(3), []
    for tooth_count in teeth:
        pitch_errors = tuple(rng.normal(0.0, rms, tooth_count))
        gears.append(
            SpurGear(teeth=tooth_count, module=3e-3, width=20e-3, pitch_errors=pitch_errors)
        )
    return GearStage(*gears, backlash=80e-6)


def test_pitch_errors_of_both_gears_are_recorded_until_the_same_teeth_meet_again():
    """The record must have 23 * 61 mesh periods, after which the same pair of teeth meets again.

    Its results must equal those of a run over three such cycles, of which the last is recorded.
    """
    gear_stage, load = stage_with_pitch_errors(23, 61), {"torque": 85.0, "damping_ratio": 0.05}
    speed, cycle = 6000.0, 23 * 61
    point = duty_point(gear_stage, speed, **load)
    pair = LoadSharingPair.from_geometry(gear_stage, **load)
    run_options = {"periods": 3 * cycle, "record_periods": cycle, "samples_per_period": 1}
    run = simulate(pair, speed=speed, **run_options)
    assert point.dynamic_factor == pytest.approx(float(run.dynamic_force_max), rel=1e-6)
    peak_to_peak = float(run.displacement_max - run.displacement_min) * pair.static_deflection
    assert point.error_peak_to_peak == pytest.approx(peak_to_peak, rel=1e-6)
    assert point.settled == 1 and point.record_periods == cycle and str(cycle) in point.comment


def test_a_cycle_that_is_too_long_is_sampled_with_a_comment():
    point = duty_point(stage_with_pitch_errors(89, 131), 6000.0, torque=300.0, damping_ratio=0.05)
    assert point.settled == 0 and "sample" in point.comment and str(89 * 131) in point.comment


def test_motions_start_from_static_equilibrium():
    # An undamped mesh of constant stiffness stays in its equilibrium only if it starts there.
    point = duty_point(PAPER_PAIR.replace(stiffness_ratio=1.0, material_damping=0.0), 3000.0)
    assert point.peak_force_ratio == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("planets", [1, 3])
def test_pins_of_planets_carry_the_forces_of_both_their_meshes(planets):
    """Each pin must carry both mesh forces, which are inclined by the pressure angle."""
    # A single planet also loads the bearings of the carrier, and so displaces it.
    train, pressure_angle, mesh_force = planetary(planets=planets), math.radians(24.6), 2000.0
    point = duty_point(train, 200.0)
    pin_force = 2.0 * mesh_force * math.cos(pressure_angle)
    assert point.bearing_force_max[3:].values == pytest.approx([pin_force] * planets, rel=1e-6)

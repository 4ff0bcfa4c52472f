"""Models with all loads reversed: gears with equal flanks move alike on their coast sides.

The motion of the reversed model is -x - backlash. Meshes have the same stiffness phase and no
deviation on both flanks, so that both motions are equal up to rounding.
"""

from dataclasses import replace

import numpy as np
import pytest

import gearlib
from gearlib import plot
from gearlib.analysis.duty_point import duty_point
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.data.motions import largest_force
from gearlib.uncertainty.designs import DesignQuantities
from tests.paper import PAPER_PAIR
from tests.properties.known_models import CHAIN, gears_on_bearings

PLANETS = {"stiffness_ratio": (0.7, 0.7), "reference_frequency": 1475.7}
TURNING = PLANETS | {"turning": True, "gyroscopic": True}
TRAINS = {
    "chain": CHAIN,
    "planetary": gearlib.planetary(**PLANETS),
    "turning": gearlib.planetary(**TURNING),
    "two stages": gearlib.two_stage(PAPER_PAIR.replace(material_damping=3e3)),
}
SIX_DEGREE_PAIR = gears_on_bearings(
    5e8, material_damping=4.5e3, backlash_damping=300.0, moving_backlash=False
)


def equalize_flanks(train):
    """Return a train whose coast sides have the phase of the drive sides, without mesh errors."""
    meshes = [
        replace(mesh, phase=train.phases[mesh.name], coast_phase=train.phases[mesh.name], error=0.0)
        for mesh in train.meshes
    ]
    return train.replace(meshes=meshes)


def reverse_loads(model):
    """Return a model with all torques reversed."""
    is_train = bool(model.mesh_names)
    if is_train:
        bodies = [replace(body, torque=-body.torque) for body in model.bodies]
        return model.replace(bodies=bodies)
    return model.replace(torques=tuple(-torque for torque in model.torques))


MODELS = {name: equalize_flanks(train) for name, train in TRAINS.items()} | {
    "six degrees": SIX_DEGREE_PAIR
}


#: Tunings at which contact is lost, except in the chain, whose motions would be chaotic there.
TUNINGS = {"chain": 0.5, "planetary": 1.0, "turning": 1.0, "two stages": 0.5, "six degrees": 1.3}


@pytest.mark.parametrize("name", MODELS)
def test_reversed_loads_have_the_same_duty_point_on_the_coast_side(name):
    """Reversing the load must only change the sign of forces, because both flanks are equal."""
    model = MODELS[name]
    speed = float(model.speed(TUNINGS[name]))
    original, reversed_result = duty_point(model, speed), duty_point(reverse_loads(model), speed)
    assert original.settled == 1 and np.isfinite(original.peak_force_ratio).all()
    # The comparison includes motions with contact loss, except for the chain.
    assert (original.contact_loss_fraction.max() > 0.05) == (name != "chain")
    variables = ["peak_force_ratio", "error_peak_to_peak", "contact_loss_fraction"]
    # Rigid bearings report no forces, and pins of a turning carrier also bear centrifugal forces.
    variables += ["bearing_force_max"] if name in ("planetary", "six degrees") else []
    # Rounding errors differ, because -x - backlash is rounded.
    for variable in variables:
        expected = original[variable].values
        atol = 1e-9 * np.abs(expected).max()
        np.testing.assert_allclose(reversed_result[variable], expected, rtol=1e-7, atol=atol)
    np.testing.assert_allclose(reversed_result.static_force, -original.static_force, rtol=1e-9)
    np.testing.assert_allclose(reversed_result.mesh_force_min, -original.mesh_force_max, rtol=1e-7)


@pytest.mark.parametrize("name", ["chain", "six degrees"])
def test_reversed_loads_have_the_same_main_resonance(name):
    """Reversing the load must not change the speeds of onset and jump, because flanks are equal."""
    quantities = ("onset", "jump_up")
    original = main_resonance(MODELS[name], quantities)
    reversed_result = main_resonance(reverse_loads(MODELS[name]), quantities)
    assert np.isfinite(original.onset) and not reversed_result.failed
    assert reversed_result.onset == pytest.approx(original.onset, rel=1e-9)
    # NaN means that neither model has a jump.
    assert reversed_result.jump_up == pytest.approx(original.jump_up, rel=1e-9, nan_ok=True)


def test_reversed_loads_give_the_same_design_quantities():
    """Reversing the load must not change design quantities, because both flanks are equal."""
    names = ("peak_force_ratio", "force", "transmission_error", "contact_margin")
    for model in (MODELS["chain"], SIX_DEGREE_PAIR):
        speed = float(model.speed(0.6))
        original = DesignQuantities(model, names, speed=speed).nominal
        reversed_result = DesignQuantities(reverse_loads(model), names, speed=speed).nominal
        np.testing.assert_allclose(reversed_result, original, rtol=1e-7)


def test_tongues_and_phasing_use_the_phases_of_loaded_coast_sides():
    """Under a reversed load, the coast-side phase must act as the drive-side phase did before."""
    train = equalize_flanks(gearlib.idler(PAPER_PAIR.replace(material_damping=100.0)))
    first_mesh, second_mesh = train.meshes
    phases = replace(second_mesh, phase=0.1, coast_phase=0.35)
    exchanged_phases = replace(second_mesh, phase=0.35, coast_phase=0.1)
    coast_side_train = reverse_loads(train.replace(meshes=[first_mesh, phases]))
    drive_side_train = train.replace(meshes=[first_mesh, exchanged_phases])
    np.testing.assert_allclose(
        coast_side_train.phasing().modal_force,
        drive_side_train.phasing().modal_force,
        rtol=1e-9,
        atol=1e-30,
    )
    coast_side_tongues, drive_side_tongues = (
        gearlib.tongues(loaded_train, start=0.9, stop=2.2, step=0.02)
        for loaded_train in (coast_side_train, drive_side_train)
    )
    assert coast_side_tongues.sizes["tongue"] > 0
    np.testing.assert_allclose(
        coast_side_tongues.tuning_from, drive_side_tongues.tuning_from, rtol=1e-9
    )


def test_run_up_with_reversed_loads_reports_and_plots_the_same_largest_forces():
    """Largest absolute forces on coast sides must equal those on drive sides of equal flanks."""
    train = MODELS["planetary"]
    # The speed (rpm) is nearly constant, because the inertia forces of a fast run-up would load the
    # drive sides of both trains.
    start_speed, end_speed = 2000.0, 2000.0001
    original = gearlib.run_up(train, start_speed, end_speed, duration=0.1)
    reversed_result = gearlib.run_up(reverse_loads(train), start_speed, end_speed, duration=0.1)
    expected = original.dynamic_force_max.values
    np.testing.assert_allclose(largest_force(reversed_result), expected, rtol=1e-6)
    first_curve = plot.run_up(reversed_result).lines[0]
    assert np.nanmax(first_curve.get_ydata()) == pytest.approx(expected[:, 0].max(), rel=1e-6)

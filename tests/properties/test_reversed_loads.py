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
SIX = gears_on_bearings(5e8, material_damping=4.5e3, backlash_damping=300.0, moving_backlash=False)


def with_equal_flanks(train):
    """Return a train without errors whose coast sides have the stiffness phases of drive sides."""
    meshes = [
        replace(mesh, phase=train.phases[mesh.name], coast_phase=train.phases[mesh.name], error=0.0)
        for mesh in train.meshes
    ]
    return train.replace(meshes=meshes)


def reversed_loads(model):
    """Return a model with all torques reversed."""
    if model.mesh_names:
        bodies = [replace(body, torque=-body.torque) for body in model.bodies]
        return model.replace(bodies=bodies)
    return model.replace(torques=tuple(-torque for torque in model.torques))


MODELS = {name: with_equal_flanks(train) for name, train in TRAINS.items()} | {"six degrees": SIX}


#: At these tunings contact is lost, except in the chain, whose motions would be chaotic.
TUNINGS = {"chain": 0.5, "planetary": 1.0, "turning": 1.0, "two stages": 0.5, "six degrees": 1.3}


@pytest.mark.parametrize("name", MODELS)
def test_reversed_loads_have_the_same_duty_point_on_the_coast_side(name):
    """Forces must change their sign only, and all absolute quantities must stay."""
    model = MODELS[name]
    speed = float(model.speed(TUNINGS[name]))
    drive, coast = duty_point(model, speed), duty_point(reversed_loads(model), speed)
    assert drive.settled == 1 and np.isfinite(drive.peak_force_ratio).all()
    assert (drive.contact_loss_fraction.max() > 0.05) == (name != "chain")
    variables = ["peak_force_ratio", "error_peak_to_peak", "contact_loss_fraction"]
    # Rigid bearings report no forces, and pins of a turning carrier also bear centrifugal forces.
    variables += ["bearing_force_max"] if name in ("planetary", "six degrees") else []
    for variable in variables:
        expected, scale = drive[variable].values, np.abs(drive[variable].values).max()
        np.testing.assert_allclose(coast[variable], expected, rtol=1e-7, atol=1e-9 * scale)
    np.testing.assert_allclose(coast.static_force, -drive.static_force, rtol=1e-9)
    np.testing.assert_allclose(coast.mesh_force_min, -drive.mesh_force_max, rtol=1e-7)


@pytest.mark.parametrize("name", ["chain", "six degrees"])
def test_reversed_loads_have_the_same_main_resonance(name):
    """A reversed load must give the resonance speeds of the original, by mirror symmetry."""
    quantities = ("onset", "jump_up")
    drive = main_resonance(MODELS[name], quantities)
    coast = main_resonance(reversed_loads(MODELS[name]), quantities)
    assert np.isfinite(drive.onset) and not coast.failed
    assert coast.onset == pytest.approx(drive.onset, rel=1e-9)
    assert coast.jump_up == pytest.approx(drive.jump_up, rel=1e-9, nan_ok=True)


def test_reversed_loads_have_the_same_quantities_of_designs():
    """Quantities of designs must not change if the load is reversed, by mirror symmetry."""
    names = ("peak_force_ratio", "force", "transmission_error", "contact_margin")
    for model in (MODELS["chain"], SIX):
        speed = float(model.speed(0.6))
        drive = DesignQuantities(model, names, speed=speed).nominal
        coast = DesignQuantities(reversed_loads(model), names, speed=speed).nominal
        np.testing.assert_allclose(coast, drive, rtol=1e-7)


def test_tongues_and_phasing_use_the_phases_of_loaded_coast_sides():
    """Reversed loads must give the results of a train whose flanks have exchanged phases."""
    train = with_equal_flanks(gearlib.idler(PAPER_PAIR.replace(material_damping=100.0)))
    shift = {"phase": 0.1, "coast_phase": 0.35}
    meshes = [train.meshes[0], replace(train.meshes[1], **shift)]
    exchanged = [train.meshes[0], replace(meshes[1], phase=0.35, coast_phase=0.1)]
    coast, drive = reversed_loads(train.replace(meshes=meshes)), train.replace(meshes=exchanged)
    np.testing.assert_allclose(
        coast.phasing().modal_force, drive.phasing().modal_force, rtol=1e-9, atol=1e-30
    )
    widths = [
        gearlib.tongues(train_model, start=0.9, stop=2.2, step=0.02)
        for train_model in (coast, drive)
    ]
    assert widths[0].sizes["tongue"] > 0
    np.testing.assert_allclose(widths[0].tuning_from, widths[1].tuning_from, rtol=1e-9)


def test_a_run_up_on_the_coast_side_reports_its_largest_forces():
    """Largest forces on coast sides, also in the plot, must equal the ones on drive sides."""
    train = MODELS["planetary"]
    # The speed is nearly constant, because inertia forces of a fast run-up would load the drive
    # side
    # in both trains.
    drive = gearlib.run_up(train, 2000.0, 2000.0001, duration=0.1)
    coast = gearlib.run_up(reversed_loads(train), 2000.0, 2000.0001, duration=0.1)
    expected = drive.dynamic_force_max.values
    np.testing.assert_allclose(largest_force(coast), expected, rtol=1e-6)
    (line, *_) = plot.run_up(coast).lines
    assert np.nanmax(line.get_ydata()) == pytest.approx(expected[:, 0].max(), rel=1e-6)

"""The duty point of drawn gears, models and trains."""

import numpy as np
import pytest

from gearlib import GearPair, LoadSharingPair, SixDegreePair, duty_point, simulate, two_stage
from gearlib.geometry import Mesh, SpurGear, TipRelief, dynamic_factor
from tests.geometry.drawings import own

MESH = own(quality=5)


def test_a_duty_point_is_the_settled_run_in_si_units():
    duty = duty_point(MESH, 6000.0, torque=85.0, damping_ratio=0.05)
    pair = LoadSharingPair.from_geometry(MESH, torque=85.0, damping_ratio=0.05)
    run = simulate(pair, speed=6000.0, periods=1000)
    assert duty.mesh_frequency_hertz == pytest.approx(6000.0 / 60.0 * 23, rel=1e-12)
    assert duty.static_force == pytest.approx(85.0 / (MESH.pinion.base_diameter / 2), rel=1e-12)
    assert duty.dynamic_factor == pytest.approx(float(run.dynamic_force_max), rel=1e-9)
    assert duty.mesh_force_max == pytest.approx(duty.dynamic_factor * duty.static_force)
    height = float(run.displacement_max - run.displacement_min) * pair.static_deflection
    assert duty.error_peak_to_peak == pytest.approx(height, rel=1e-9)
    power = (duty.mesh_order_error.values**2).sum() / 2.0
    assert duty.error_rms.item() ** 2 == pytest.approx(power, rel=1e-4)
    assert duty.iso_dynamic_factor == dynamic_factor(MESH, 85.0, 6000.0).factor
    # The motion repeats and is never without drive-side contact.
    assert duty.settled == 1 and duty.lost_share == pytest.approx(0.0, abs=1e-12)
    assert all({"units", "long_name"} <= value.attrs.keys() for value in duty.data_vars.values())


def test_gears_with_tip_relief_are_computed_by_load_sharing():
    relief, options = TipRelief(amount=8e-6, length=2e-3), {"torque": 85.0, "damping_ratio": 0.1}
    mesh = MESH.with_reliefs(relief, relief)
    relieved = duty_point(mesh, 3000.0, stiffness="energy", **options)
    expected = duty_point(LoadSharingPair.from_geometry(mesh, **options), 3000.0)
    for name in ("dynamic_factor", "error_peak_to_peak", "mesh_order_error"):
        np.testing.assert_allclose(relieved[name], expected[name], rtol=1e-12)
    # The relief matters: its effect is larger than 2 %.
    plain = duty_point(MESH, 3000.0, **options)
    assert abs(relieved.dynamic_factor / plain.dynamic_factor - 1.0) > 0.02


def test_mesh_orders_that_cannot_be_told_from_free_vibrations_are_nan():
    # Undamped free vibrations go on; at low speeds they are too fast for the samples of a period.
    mesh = Mesh(*(SpurGear(teeth=z, module=4e-3, width=0.032) for z in (19, 47)))
    duty = duty_point(mesh, 700.0, torque=210.0, damping_ratio=0.0)
    assert duty.settled == 0 and duty.dynamic_factor > 1.5
    # The other orders have values.
    assert 0 < np.isnan(duty.mesh_order_force.values).sum() < 3


def test_bearings_of_six_degrees_and_trains_carry_the_load():
    pair = GearPair.from_geometry(MESH, torque=85.0, damping_ratio=0.05)
    bodies = {"base_radii": (0.027, 0.0716), "inertias": (1e-4, 5e-3), "masses": (0.4, 2.5)}
    bearings = {"bearing_stiffness": (1e8,) * 4, "bearing_damping": (500.0,) * 4}
    six_degrees = SixDegreePair(pair=pair.replace(contact_ratio=2.0), **bodies, **bearings)
    # Constant stiffness: the bearings carry the static mesh force.
    forces = duty_point(six_degrees, 3000.0).bearing_force_max.values
    assert forces == pytest.approx([pair.load] * 2, rel=1e-6)
    train = duty_point(two_stage(pair), 3000.0)
    assert train.mesh_force_max.dims == ("mesh",) and train.bearing_force_max.dims == ("body",)
    # A model has its load, a drawing needs a torque.
    with pytest.raises(ValueError, match="torque = 1"):
        duty_point(pair, 3000.0, torque=1.0)
    with pytest.raises(ValueError, match="torque is missing"):
        duty_point(MESH, 3000.0)

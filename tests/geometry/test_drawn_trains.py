"""Trains of drawn gears: the numbers of their drawings; phases are in test_phases_by_teeth.py."""

import numpy as np
import pytest

import gearlib
from gearlib import Body, GearPair, GearTrain
from gearlib.geometry import Mesh, SpurGear, planetary_set
from tests.geometry.drawings import fzg_c

COMMON = {"module": 3e-3, "width": 0.025}


def test_a_planetary_set_has_the_numbers_of_its_drawing():
    sun, planet = (SpurGear(teeth=z, **COMMON) for z in (27, 36))
    ring = SpurGear(teeth=99, internal=True, outer_diameter=0.34, **COMMON)
    train = planetary_set(sun, planet, ring, torque=300.0, damping_ratio=0.05, carrier_mass=4.0)
    centre = 3e-3 * (27 + 36) / 2.0
    assert train.by_name["carrier"].base_radius == pytest.approx(centre, rel=1e-12)
    assert train.by_name["carrier"].mass == 4.0
    for name, gear in (("sun", sun), ("ring", ring), ("planet 2", planet)):
        body = train.by_name[name]
        assert body.inertia == pytest.approx(gear.inertia, rel=1e-12)
        assert body.base_radius == pytest.approx(gear.base_diameter / 2.0, rel=1e-12)
        assert body.mass == gear.mass
    found = train.static()
    # A third of the torque on each sun mesh; the planets pass the force on.
    expected = 100.0 / (sun.base_diameter / 2.0)
    np.testing.assert_allclose(found.mesh_force, expected, rtol=1e-9)
    pair = GearPair.from_geometry(Mesh(sun, planet), torque=100.0, damping_ratio=0.05)
    mesh = train.meshes[0]
    for name in ("max_stiffness", "stiffness_ratio", "contact_ratio", "material_damping"):
        assert getattr(mesh, name) == pytest.approx(getattr(pair, name), rel=1e-12), name
    inner = Mesh(planet, ring).stiffness("iso", torque=100.0 * 36 / 27)
    assert train.meshes[-1].mean_stiffness == pytest.approx(inner.mean_stiffness, rel=1e-12)
    assert train.meshes[-1].internal and not mesh.internal
    # Steady state by Willis: the torque of the carrier is the sun's times 1 + z_r / z_s.
    assert train.by_name["carrier"].torque == pytest.approx(-300.0 * (1 + 99 / 27), rel=1e-12)


def test_a_pair_as_a_train_of_drawn_gears():
    drawn = fzg_c()
    mesh = Mesh(drawn.pinion, drawn.wheel, drawn.centre_distance, backlash=1e-4)
    options = {"torque": 302.0, "damping_ratio": 0.06, "backlash_damping_ratio": 0.01}
    pair = GearPair.from_geometry(mesh, **options)
    pinion = Body.from_gear(mesh.pinion, "pinion", torque=302.0)
    wheel = Body.from_gear(mesh.wheel, "wheel", torque=302.0 * 24 / 16)
    meshes = [gearlib.Mesh.from_geometry(mesh, "pinion", "wheel", **options)]
    train = GearTrain(bodies=[pinion, wheel], meshes=meshes)
    run, expected = (gearlib.simulate(m, 0.7, periods=20, record_periods=1) for m in (train, pair))
    # A train goes by matrices, a pair by scalar closed forms: rounding of 20 periods.
    np.testing.assert_allclose(
        run.displacement.values[:, 0], expected.displacement.values, rtol=0, atol=1e-9
    )
    light = Body.from_gear(mesh.pinion, "pinion", inertia=1e-4)
    assert light.inertia == 1e-4 and light.mass == mesh.pinion.mass

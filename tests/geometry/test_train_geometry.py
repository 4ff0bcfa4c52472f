"""Trains of gears given by geometry; phases are in test_phases_by_teeth.py."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import Body, GearPair, GearTrain
from gearlib.geometry import GearStage, SpurGear, TipRelief, iso_stiffness, planetary_set
from gearlib.models.geometry.gear import inv

GEAR_VALUES = {"module": 3e-3, "width": 0.025}


def test_a_planetary_set_takes_its_parameters_from_its_gears():
    """Masses, radii, stiffness, damping and torques must follow from the geometry of the gears."""
    sun, planet = (SpurGear(teeth=z, **GEAR_VALUES) for z in (27, 36))
    ring = SpurGear(teeth=99, internal=True, outer_diameter=0.34, **GEAR_VALUES)
    damping = {"damping_ratio": 0.05, "backlash_damping_ratio": 0.01}
    options = {"torque": 300.0, "carrier_mass": 4.0, "model": "rectangle"}
    train = planetary_set(sun, planet, ring, **options, **damping)
    centre = 3e-3 * (27 + 36) / 2.0
    assert train.by_name["carrier"].base_radius == pytest.approx(centre, rel=1e-12)
    assert train.by_name["carrier"].mass == 4.0
    for name, gear in (("sun", sun), ("ring", ring), ("planet 2", planet)):
        body = train.by_name[name]
        assert body.inertia == pytest.approx(gear.inertia, rel=1e-12)
        assert body.base_radius == pytest.approx(gear.base_diameter / 2.0, rel=1e-12)
        assert body.mass == gear.mass
    light = Body.from_gear(sun, "sun", inertia=1e-4)
    assert light.inertia == 1e-4 and light.mass == sun.mass
    static_state = train.static()
    # Each sun mesh carries a third of the torque, and planets transmit the force.
    tooth_force = 100.0 / (sun.base_diameter / 2.0)
    np.testing.assert_allclose(static_state.mesh_force, tooth_force, rtol=1e-9)
    pair = GearPair.from_geometry(GearStage(sun, planet), torque=100.0, **damping)
    mesh = train.meshes[0]
    names = "max_stiffness stiffness_ratio contact_ratio material_damping backlash_damping backlash"
    for name in names.split():
        assert getattr(mesh, name) == pytest.approx(getattr(pair, name), rel=1e-12), name
    inner = GearStage(planet, ring).stiffness("iso", torque=100.0 * 36 / 27)
    assert train.meshes[-1].mean_stiffness == pytest.approx(inner.mean_stiffness, rel=1e-12)
    assert train.meshes[-1].internal and not mesh.internal
    # By Willis' equation the torque of the carrier is 1 + z_r / z_s times the torque of the sun.
    assert train.by_name["carrier"].torque == pytest.approx(-300.0 * (1 + 99 / 27), rel=1e-12)


def two_gear_train(gears, torque=85.0, centre_distance=None, driving=None, **options):
    """Return the train of two gears given by their geometry, with a damping ratio of 0.05.

    `torque` acts on the first gear; `options` are passed to `Mesh.from_geometry`.
    """
    names = "pinion", "wheel"
    mesh = GearStage(*gears, centre_distance, backlash=80e-6)
    sign = -1.0 if mesh.wheel.internal else 1.0
    torques = torque, sign * torque * gears[1].teeth / gears[0].teeth
    meshes = gearlib.Mesh.from_geometry(
        mesh, *names, torque=torque, damping_ratio=0.05, driving=driving, **options
    )
    values = zip(gears, names, torques, strict=True)
    return GearTrain(
        bodies=[Body.from_gear(gear, name, torque=t) for gear, name, t in values], meshes=[meshes]
    )


def spur(*teeth, **changes):
    """Return spur gears with a module of 2.5 mm and a width of 18 mm."""
    return [SpurGear(teeth=z, **{"module": 2.5e-3, "width": 0.018} | changes) for z in teeth]


def planetary_train(teeth=(27, 36, 99), **options):
    """Return a planetary set with six meshes; by default its planets are in phase."""
    sun, planet = (SpurGear(teeth=z, **GEAR_VALUES) for z in teeth[:2])
    ring = SpurGear(teeth=teeth[2], internal=True, outer_diameter=0.34, **GEAR_VALUES)
    return planetary_set(sun, planet, ring, **{"torque": 300.0, "damping_ratio": 0.05} | options)


RING_GEAR = SpurGear(teeth=99, module=2.5e-3, width=0.018, internal=True, outer_diameter=0.3)
LOW_SPEED_TRAINS = {
    "pair": lambda: two_gear_train(spur(23, 61)),
    "iso": lambda: two_gear_train(spur(23, 61), stiffness="iso"),
    "helical": lambda: two_gear_train(spur(23, 61, helix_angle=0.3)),
    "relief": lambda: two_gear_train(spur(23, 61, tip_relief=TipRelief(amount=20e-6, length=2e-3))),
    "internal": lambda: two_gear_train([*spur(36), RING_GEAR]),
    "reversed": lambda: two_gear_train(spur(23, 61), -85.0),
    "planetary": planetary_train,
    "reversed planetary": lambda: planetary_train(torque=-300.0),
}


@pytest.mark.parametrize("name", LOW_SPEED_TRAINS)
def test_the_mesh_force_at_low_speed_is_the_static_force(name):
    """At 10 rpm inertia is negligible, so that all dynamic factors must be 1 within 0.2 %."""
    factors = gearlib.duty_point(LOW_SPEED_TRAINS[name](), 10.0).dynamic_factor
    np.testing.assert_allclose(factors, 1.0, atol=0.002)


def test_the_mesh_force_of_rectangular_stiffness_jumps_at_any_speed():
    """At low speed the force must jump by 1 / stiffness ratio when a pair leaves contact."""
    train = two_gear_train(spur(23, 61), model="rectangle")
    assert train.meshes[0].transmission_error == gearlib.Harmonics()
    factor = gearlib.duty_point(train, 10.0).peak_force_ratio
    assert factor == pytest.approx(1.0 / train.meshes[0].stiffness_ratio, rel=0.05)


def test_the_transmission_error_matches_a_separate_sum_over_tooth_pairs():
    """Distribute the load over tooth pairs as separate springs with gaps of relief and corners.

    With the stiffness of ISO 6336 for n pairs, each pair adds the same spring.
    """
    relief, load = TipRelief(amount=12e-6, length=1.5e-3), 3000.0
    pinion, wheel = spur(23, tip_relief=relief)[0], spur(61)[0]
    mesh = GearStage(pinion, wheel)
    train = two_gear_train((pinion, wheel), load * pinion.base_diameter / 2.0, stiffness="iso")
    # A pair without the compliance of the body, 1/7 of the whole, is stiffer by 7/6.
    stiffness = iso_stiffness(mesh).single * 1e9 * mesh.width * 7.0 / 6.0
    start, end = mesh.path
    phases = np.arange(256) / 256.0
    pitches = phases[:, None] + np.arange(-1, 3) + mesh.contact_ratio % 1.0 / 2.0
    positions = start + pitches * mesh.base_pitch
    gaps = np.maximum(0.0, relief.amount * (1.0 - (end - np.minimum(positions, end)) / 1.5e-3))
    # Tip corners touch beyond the path of contact, by formulas of docs/theory/geometry.md.
    a, alpha = mesh.centre_distance, mesh.working_pressure_angle
    for flank, corner, angle in (
        (pinion, wheel, np.minimum(positions - start, 0.0) + start - mesh.pitch_point),
        (wheel, pinion, mesh.pitch_point - end - np.maximum(positions - end, 0.0)),
    ):
        r_flank, r_tip = flank.base_diameter / 2.0, corner.tip_diameter / 2.0
        phi = angle / r_flank
        tip_alpha = math.acos(corner.base_diameter / corner.tip_diameter)
        psi = -phi * flank.teeth / corner.teeth + inv(alpha) - inv(tip_alpha)
        x, y = a - r_tip * np.cos(psi), -r_tip * np.sin(psi)
        pressure = np.arccos(r_flank / np.hypot(x, y))
        gap = r_flank * (np.arctan2(y, x) - (phi + inv(alpha) - (np.tan(pressure) - pressure)))
        gaps = gaps + np.where(np.abs(gap) > 1e-12, gap, 0.0)
    gaps.sort(axis=1)
    counts = np.arange(1, gaps.shape[1] + 1)
    # Of all numbers of loaded pairs, the true one gives the least displacement.
    error = ((load / stiffness + gaps.cumsum(axis=1)) / counts).min(axis=1)
    expected = gearlib.Harmonics.from_table(math.tau * phases, error, 32)
    transmission_error = train.meshes[0].transmission_error
    for name in ("cosines", "sines"):
        values = getattr(transmission_error, name)
        np.testing.assert_allclose(values, getattr(expected, name)[: len(values)], atol=1e-11)


@pytest.mark.parametrize("torque", [85.0, -85.0])
def test_gears_at_rest_follow_the_transmission_error_of_pairs_of_teeth(torque):
    """Static displacements of a train over a mesh period must follow load over stiffness."""
    gears = spur(23, 61)
    mesh = GearStage(*gears, backlash=80e-6)
    pair = gearlib.LoadSharingPair.from_geometry(mesh, torque=85.0, damping_ratio=0.05).at_load()
    # Without relief there is no error without a load.
    table = pair.load / np.array(pair.profile.stiffness)
    train, name = two_gear_train(gears, torque), "pinion-wheel"
    # On the coast side the wheel drives, and the tooth pairs move in the opposite direction.
    sign, phase_lag = (1.0, train.phases) if torque > 0.0 else (-1.0, train.coast_phases)
    phases = np.linspace(0.0, math.tau, 24, endpoint=False)
    approach = [
        sign * float(train.static(phase).body_displacement.sel(axis="rotation").sum())
        for phase in phases
    ]
    expected = np.interp(
        sign * (phases - math.tau * phase_lag[name]), pair.profile.phase, table, period=math.tau
    )
    np.testing.assert_allclose(
        approach - np.mean(approach), expected - expected.mean(), atol=0.03 * np.ptp(expected)
    )


def test_teeth_driven_by_the_wheel_match_exchanged_gears():
    """Driving by the wheel, a reversed torque and exchanged gears must give equal factors."""
    gears = spur(23, 61)
    trains = [
        two_gear_train(gears, driving="wheel"),
        two_gear_train(gears, -85.0),
        two_gear_train(gears[::-1], 85.0 * 61 / 23),
    ]
    factors = [
        gearlib.duty_point(train, 2000.0 * s).dynamic_factor.item()
        for train, s in zip(trains, (1.0, 1.0, 23 / 61), strict=True)
    ]
    assert factors == pytest.approx([factors[0]] * 3, rel=1e-6)
    driven = gearlib.duty_point(two_gear_train(gears), 2000.0).dynamic_factor.item()
    assert abs(driven / factors[0] - 1.0) > 0.01
    # At this small torque the stiffness of ISO 6336 depends on the load, but not on its sign.
    light = [two_gear_train(gears, torque).meshes for torque in (20.0, -20.0)]
    assert light[0] == light[1]
    # For equal gears it does not matter which one drives.
    equal_gear_results = [
        gearlib.duty_point(two_gear_train(spur(30, 30), t), 2000.0) for t in (85.0, -85.0)
    ]
    assert equal_gear_results[0].dynamic_factor.item() == pytest.approx(
        equal_gear_results[1].dynamic_factor.item(), rel=1e-9
    )


def test_a_mirror_image_of_two_meshes_has_the_same_dynamic_factors():
    """Coast sides under a reversed torque are the drive sides of the mirror image."""
    gears = [*spur(23, shift=0.3), *spur(37), *spur(61, shift=-0.2)]

    def factors(torque, driving):
        """Return the dynamic factors of two meshes under a torque, with a given driving gear."""
        torques = torque, 0.0, -torque * 61 / 23
        names = "a", "b", "c"
        meshes = [
            gearlib.Mesh.from_geometry(
                GearStage(*gears[i : i + 2], backlash=80e-6),
                *names[i : i + 2],
                torque=torque * gears[i].teeth / 23,
                damping_ratio=0.05,
                position=0.0,
                direction=(-1) ** i,
                driving=driving if i == 0 else None,
            )
            for i in range(2)
        ]
        values = zip(gears, names, torques, strict=True)
        bodies = [Body.from_gear(gear, name, torque=t) for gear, name, t in values]
        train = GearTrain(bodies=bodies, meshes=meshes)
        return gearlib.duty_point(train, 3000.0).dynamic_factor.values

    np.testing.assert_allclose(factors(-85.0, "a"), factors(85.0, "b"), rtol=1e-7)
    assert not np.allclose(factors(85.0, "a"), factors(85.0, "b"), rtol=1e-2)


def test_phasing_follows_the_transmission_error():
    """Modal forces must follow the error, and excited mode types Parker's rule (2000)."""
    error = two_gear_train(spur(23, 61)).meshes[0].transmission_error
    amplitudes = np.hypot(error.cosines, error.sines)[:12]
    forces = two_gear_train(spur(23, 61)).phasing(12).modal_force.values[:, 0]
    np.testing.assert_allclose(forces / forces[0], amplitudes / amplitudes[0], rtol=1e-9)
    # Planets in phase excite rotational modes only; (order z_s) mod 3 decides on others.
    supports = {"support_stiffness": (1e8, 1e8, 1e8, 1e8), "torsional_stiffness": (0.0, 1e9, 0.0)}
    for sun_teeth, kind in ((27, "rotational"), (28, "translational")):
        teeth = (sun_teeth, 63 - sun_teeth, 126 - sun_teeth)
        phasing = planetary_train(teeth, **supports).phasing(1).sel(stiffness_order=1.0)
        assert {*phasing.mode_kind.values[phasing.excites.values]} == {kind}


def test_tooth_pairs_without_a_torque_are_refused():
    """Without a torque the deflection of the tooth pairs is unknown and the mesh is refused."""
    with pytest.raises(ValueError, match=r"^torque is missing: it must be given in N m for the"):
        gearlib.Mesh.from_geometry(GearStage(*spur(23, 61)), "pinion", "wheel")

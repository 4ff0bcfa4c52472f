"""Two gearboxes whose masses, inertias, stiffnesses and natural frequencies are computed by hand.

A gear is a cylinder of its reference diameter around its shaft, a ring gear a ring from there to
its rim. Springs run between facing faces; half of their inertia goes to each end.
"""

import math

import numpy as np
import pytest
from scipy import integrate, linalg

import gearlib

from .rexs_files import planetary_file, two_stage_file

DENSITY, SHEAR_MODULUS = 7850.0, 210e9 / 2.6
RELATIVE_TOLERANCE = {"rel": 1e-9}


def cylinder_inertia(length, outer, inner=0.0):
    """Return the moment of inertia of a steel cylinder, kg m^2."""
    return math.pi / 32.0 * DENSITY * length * (outer**4 - inner**4)


def cylinder_mass(length, outer, inner=0.0):
    """Return the mass of a steel cylinder, kg."""
    return math.pi / 4.0 * DENSITY * length * (outer**2 - inner**2)


def integrate_function(function, start, stop):
    """Integrate a function by scipy."""
    return integrate.quad(function, start, stop, epsabs=0.0, epsrel=1e-13)[0]


def reference_diameter(teeth, module, degrees):
    """Return the reference diameter of a helical gear, m."""
    return teeth * module / math.cos(math.radians(degrees))


@pytest.fixture(scope="module")
def gearbox(tmp_path_factory):
    """Return the gearbox of two stages."""
    path = two_stage_file().write(tmp_path_factory.mktemp("box") / "box.rexs")
    return gearlib.read_gearbox(path)


@pytest.fixture(scope="module")
def train(gearbox):
    """Return the train of the gearbox with rectangular stiffness after ISO 6336."""
    return gearbox.train(model="rectangle", stiffness="iso", structural_damping=0.0)


def test_inertias_of_gears_and_conical_shafts_match_hand_calculation(train):
    """Integrate cones and cylinders; half of the shaft between two nodes belongs to each."""

    # The face of z1 extends from 67 to 93 mm, where the shaft diameter grows from 34.5 to 38.833
    # mm.
    def diameter(u):
        return 0.030 + 0.010 * (u - 0.040) / 0.060

    cone = [
        integrate_function(lambda u: diameter(u) ** 4, *ends)
        for ends in ((0.067, 0.1), (0.04, 0.067))
    ]
    polar = math.pi / 32.0 * DENSITY
    d1 = reference_diameter(21, 0.0025, 15.0)
    gear = polar * (0.026 * d1**4 - integrate_function(lambda u: diameter(u) ** 4, 0.067, 0.093))
    # This part of the shaft extends from the load at 5 mm to the face.
    spring = polar * (0.030**4 * 0.035 + cone[1])
    assert train.by_name["z1"].inertia == pytest.approx(
        gear + polar * cone[0] + spring / 2.0, **RELATIVE_TOLERANCE
    )
    motor = polar * 0.030**4 * 0.005 + spring / 2.0
    assert train.by_name["Motor"].inertia == pytest.approx(motor, **RELATIVE_TOLERANCE)
    # Faces on the hollow shaft extend from 18 to 42 and from 55 to 95 mm.
    d2, d3 = reference_diameter(48, 0.0025, 15.0), reference_diameter(19, 0.004, 12.0)
    gap = cylinder_inertia(0.013, 0.035, 0.010)
    expected = (
        cylinder_inertia(0.024, d2, 0.035) + cylinder_inertia(0.042, 0.035, 0.010) + gap / 2.0
    )
    assert train.by_name["z2"].inertia == pytest.approx(expected, **RELATIVE_TOLERANCE)
    expected = (
        cylinder_inertia(0.040, d3, 0.035) + cylinder_inertia(0.055, 0.035, 0.010) + gap / 2.0
    )
    assert train.by_name["z3"].inertia == pytest.approx(expected, **RELATIVE_TOLERANCE)
    masses = (
        cylinder_mass(0.040, d3, 0.035)
        + cylinder_mass(0.055, 0.035, 0.010)
        + cylinder_mass(0.013, 0.035, 0.010) / 2.0
    )
    assert train.by_name["z3"].mass == pytest.approx(masses, **RELATIVE_TOLERANCE)


def test_torsional_stiffness_of_conical_and_hollow_shafts_matches_hand_calculation(train):
    """The compliance of a shaft is the integral of 1 / (G I_p) over its length."""
    stiffness = {shaft.bodies: shaft.stiffness for shaft in train.shafts}
    polar = math.pi / 32.0

    def outer(u):
        return 0.030 if u < 0.040 else 0.030 + 0.010 * (u - 0.040) / 0.060

    compliance = sum(
        integrate_function(lambda u: outer(u) ** -4, *x) for x in ((0.005, 0.04), (0.04, 0.067))
    )
    assert stiffness["Motor", "z1"] == pytest.approx(
        SHEAR_MODULUS * polar / compliance, **RELATIVE_TOLERANCE
    )
    hollow = SHEAR_MODULUS * polar * (0.035**4 - 0.010**4) / 0.013
    assert stiffness["z2", "z3"] == pytest.approx(hollow, **RELATIVE_TOLERANCE)

    def bore(u):
        return 0.020 + 0.010 * u / 0.120

    compliance = integrate_function(lambda u: 1.0 / (0.050**4 - bore(u) ** 4), 0.044, 0.115)
    ends = "z4", "Kupplung, Abtrieb"
    assert stiffness[ends] == pytest.approx(
        SHEAR_MODULUS * polar / compliance, **RELATIVE_TOLERANCE
    )
    assert stiffness["Kupplung, Abtrieb", "Kupplung, Flansch"] == pytest.approx(
        2e4, **RELATIVE_TOLERANCE
    )


def test_natural_frequencies_of_two_stages_match_hand_calculation(gearbox, train):
    """Assemble the torsional model of eight bodies by hand and solve its eigenvalue problem."""
    names = ["Motor", "z1", "z2", "z3", "z4", "Kupplung, Abtrieb", "Kupplung, Flansch", "Last"]
    assert [body.name for body in train.bodies] == names
    inertias = np.diag([body.inertia for body in train.bodies])
    stiffness = np.zeros((8, 8))
    for shaft in train.shafts:
        row = np.zeros(8)
        row[[names.index(name) for name in shaft.bodies]] = 1.0, -1.0
        stiffness += shaft.stiffness * np.outer(row, row)
    for name, first, second in (("Stufe 1", 1, 2), ("Stufe 2", 3, 4)):
        stage, row = gearbox.stage(name), np.zeros(8)
        row[[first, second]] = stage.pinion.base_diameter / 2.0, stage.wheel.base_diameter / 2.0
        mean = next(mesh for mesh in train.meshes if mesh.name == name).mean_stiffness
        stiffness += mean * np.outer(row, row)
    squared_frequencies = linalg.eigh(stiffness, inertias, eigvals_only=True)
    expected = np.sqrt(squared_frequencies[1:]) / math.tau
    np.testing.assert_allclose(train.modes().natural_frequency.values[1:], expected, rtol=1e-9)


def test_a_planetary_set_with_fixed_ring_and_a_stage_match_hand_calculation(tmp_path):
    """Inertias and natural frequencies must match a torsional model assembled by hand."""
    gearbox = gearlib.read_gearbox(planetary_file().write(tmp_path / "box.rexsz"))
    train = gearbox.train(model="rectangle", stiffness="iso", structural_damping=0.0)
    radius, bodies = 0.0585, train.by_name
    # The carrier is two plates, three eccentric pins and half of the shaft up to the pinion.
    pins = 3.0 * (cylinder_inertia(0.052, 0.012) + cylinder_mass(0.052, 0.012) * radius**2)
    plates = 2.0 * cylinder_inertia(0.008, 0.170, 0.070)
    shaft_part = cylinder_inertia(0.005, 0.060, 0.020) + cylinder_inertia(0.035, 0.060, 0.020) / 2.0
    carrier = bodies["Planetenträger"]
    assert carrier.inertia == pytest.approx(pins + plates + shaft_part, **RELATIVE_TOLERANCE)
    ring = cylinder_inertia(0.034, 0.206, 0.180) + cylinder_inertia(0.040, 0.220, 0.206)
    assert bodies["Hohlrad"].inertia == pytest.approx(ring, **RELATIVE_TOLERANCE)
    assert bodies["Hohlrad"].torsional_stiffness == math.inf
    planet = cylinder_inertia(0.035, 0.063, 0.020) + cylinder_inertia(0.036, 0.020, 0.012)
    assert bodies["Planet 1"].inertia == pytest.approx(planet, **RELATIVE_TOLERANCE)
    planet_mass = cylinder_mass(0.035, 0.063, 0.020) + cylinder_mass(0.036, 0.020, 0.012)
    # The coordinates are the rotations of these bodies. The load acts within the face of the wheel.
    names = ["Motor", "Sonne", "Planetenträger", "Ritzel", "Rad"] + [
        f"Planet {i}" for i in range(3)
    ]
    assert bodies["Rad"].torque == pytest.approx(325.0)
    inertias = np.array([bodies[name].inertia for name in names])
    inertias[2] += 3.0 * planet_mass * radius**2
    stiffness = np.zeros((8, 8))
    for shaft in train.shafts:
        row = np.zeros(8)
        row[[names.index(name) for name in shaft.bodies]] = 1.0, -1.0
        stiffness += shaft.stiffness * np.outer(row, row)
    means = {mesh.name: mesh.mean_stiffness for mesh in train.meshes}
    sun, pinion, ring = (
        teeth * 0.003 * math.cos(math.radians(20.0)) / 2.0 for teeth in (18, 21, 60)
    )
    for i in range(3):
        # Sun and planet approach each other; the pin moves with the carrier.
        row = np.zeros(8)
        row[[1, 2, 5 + i]] = sun, -(sun + pinion), pinion
        stiffness += means[f"Sonne-Planet {i}"] * np.outer(row, row)
        row = np.zeros(8)
        row[[2, 5 + i]] = ring - pinion, pinion
        stiffness += means[f"Planet-Hohlrad {i}"] * np.outer(row, row)
    row = np.zeros(8)
    row[[3, 4]] = (
        24 * 0.002 * math.cos(math.radians(20.0)),
        30 * 0.002 * math.cos(math.radians(20.0)),
    )
    stiffness += means["Stirnradstufe"] * np.outer(row, row)
    squared_frequencies = linalg.eigh(stiffness, np.diag(inertias), eigvals_only=True)
    expected = np.sqrt(squared_frequencies[1:]) / math.tau
    np.testing.assert_allclose(train.modes().natural_frequency.values[1:], expected, rtol=1e-9)


def test_bearings_with_a_finite_stiffness_move(tmp_path):
    """A bearing of finite stiffness supports the shaft, while z2 and z3 are then free to move."""
    file = two_stage_file()
    bearing = {
        "radial_stiffness": (2e8, "N / m"),
        "u_coordinate_on_shaft_inner_side": (110.0, "mm"),
    }
    file.add("concept_bearing", "Lager", u_coordinate_on_shaft_outer_side=(0.0, "mm"), **bearing)
    file.relate("side", assembly="Lager", inner_part="Zwischenwelle", outer_part="Gehäuse")
    gearbox = gearlib.read_gearbox(file.write(tmp_path / "box.rexs"))
    train = gearbox.train(model="rectangle", stiffness="iso")
    supports = {body.name: body.support_stiffness for body in train.bodies}
    assert supports["Lager, Zwischenwelle"] == (2e8, 2e8)
    assert supports["z2"] == supports["z3"] == (0.0, 0.0)
    assert supports["z1"] == (math.inf, math.inf)
    shaft = next(x for x in train.shafts if x.bodies == ("z2", "z3"))
    bending = 12.0 * 210e9 * math.pi / 64.0 * (0.035**4 - 0.010**4) / 0.013**3
    assert shaft.bending_stiffness == pytest.approx(bending, **RELATIVE_TOLERANCE)
    train_on_soft_bearings = gearbox.train(
        model="rectangle", stiffness="iso", bearing_stiffness=1e7
    )
    assert train_on_soft_bearings.by_name["Lager, Zwischenwelle"].support_stiffness == (1e7, 1e7)

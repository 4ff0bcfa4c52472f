"""Mesh stiffness: the printed example, quadrature of the energies, averages over the face."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from gearlib import GearPair, OneDegreePair
from gearlib.geometry import Mesh, SpurGear, Web, iso_stiffness
from gearlib.models.geometry.mesh_stiffness import PairCompliance, Tooth, energy_stiffness
from tests.geometry.drawings import fzg_c, gears_of_20_teeth, iso_example, ring


def test_iso_example_1_to_its_printed_digits():
    found = iso_stiffness(iso_example(), torque=9000.0)
    assert found.theoretical == pytest.approx(17.85584, abs=5e-6)
    assert found.single == pytest.approx(12.37047, abs=5e-6)
    assert found.mean == pytest.approx(17.46485, abs=5e-6)
    assert found.rack_factor == pytest.approx(0.9, rel=1e-12)


def test_iso_coefficients():
    """q' of the standard, written out once more, with each shift by itself and a ring gear."""
    for x1, x2 in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.3, 0.4)):
        gears = [
            SpurGear(teeth=z, module=3e-3, width=0.02, shift=x) for z, x in ((25, x1), (40, x2))
        ]
        q = 0.04723 + 0.15551 / 25 + 0.25791 / 40 - 0.00635 * x1 - 0.11654 * x1 / 25
        q += -0.00193 * x2 - 0.24188 * x2 / 40 + 0.00529 * x1**2 + 0.00182 * x2**2
        assert iso_stiffness(Mesh(*gears)).theoretical == pytest.approx(1.0 / q, rel=1e-12)
    ring_mesh = ring()
    q = 0.04723 + 0.15551 / 36
    assert iso_stiffness(ring_mesh).theoretical == pytest.approx(1.0 / q, rel=1e-12)


def test_iso_of_fzg_c_as_in_the_worked_example():
    found = iso_stiffness(fzg_c(), torque=302.0)
    assert found.rack_factor == pytest.approx(0.975, rel=1e-12)
    assert found.theoretical == pytest.approx(15.78, abs=5e-3)
    assert found.single == pytest.approx(12.31, abs=5e-3)


def test_iso_at_low_load_and_with_a_web():
    mesh = fzg_c()
    full = iso_stiffness(mesh).single
    # 25 N/mm at the reference circle: a fourth of the limit.
    torque = 25.0 * 14.0 * mesh.pinion.reference_diameter / 2.0
    assert iso_stiffness(mesh, torque).single == pytest.approx(full / math.sqrt(2.0), rel=1e-12)
    raised = iso_stiffness(mesh, torque, application_factor=4.0).single
    assert raised == pytest.approx(full, rel=1e-12)
    web = Web(thickness=0.009, rim_diameter=0.16, hub_diameter=0.06)
    gear = SpurGear(teeth=50, module=4e-3, width=0.03, web=web)
    solid = SpurGear(teeth=50, module=4e-3, width=0.03)
    ratio = iso_stiffness(Mesh(gear, solid)).single / iso_stiffness(Mesh(solid, solid)).single
    rim = (0.19 - 0.16) / 2.0 / 4e-3
    assert ratio == pytest.approx(1.0 + math.log(0.3) / 5.0 / math.exp(rim / 5.0), rel=1e-9)


def compliance_by_quadrature(tooth, phi):
    """Return the compliance of a tooth under a force at the roll angle `phi` of its flank."""
    gear, sign = tooth.gear, tooth.sign
    material = gear.material
    shear = material.young / 2.0 / (1.0 + material.poisson)
    x_f, y_f, b = tooth.flank(phi)

    def integrand(x, y):
        area, inertia = 2.0 * x * tooth.width, 2.0 / 3.0 * x**3 * tooth.width
        moment = math.cos(b) * sign * (y_f - y) - x_f * math.sin(b)
        return (
            moment**2 / (material.young * inertia)
            + 1.2 * math.cos(b) ** 2 / (shear * area)
            + math.sin(b) ** 2 / (material.young * area)
        )

    def half(radius):
        """Return half the thickness and y on the flank, by the thickness of ISO 21771."""
        angle = gear.thickness_at(2.0 * radius) / (2.0 * radius)
        return radius * math.sin(angle), radius * math.cos(angle)

    def on_flank(radius):
        step = 1e-6 * radius
        x, y = half(radius)
        slope = (half(radius + step)[1] - half(radius - step)[1]) / 2.0 / step
        return integrand(x, y) * slope

    base = tooth.base_radius
    low, high = sorted((base * math.hypot(1.0, tooth.form_phi), base * math.hypot(1.0, phi)))
    total = quad(on_flank, low, high, epsrel=1e-10)[0]
    if not gear.internal:

        def on_fillet(gamma):
            step = 1e-6
            slope = (tooth.fillet(gamma + step)[1] - tooth.fillet(gamma - step)[1]) / 2.0 / step
            return integrand(*tooth.fillet(gamma)[:2]) * abs(slope)

        total += quad(on_fillet, gear.transverse_pressure_angle, math.pi / 2.0, epsrel=1e-10)[0]
    return total


@pytest.mark.parametrize("share", [0.05, 0.5, 1.0])
@pytest.mark.parametrize("mesh", [iso_example(), fzg_c(), gears_of_20_teeth(), ring()])
def test_the_energy_method_against_quadrature(mesh, share):
    start, end = mesh.path
    position = start + share * (end - start)
    rolls = (position, mesh.wheel_roll_length(position))
    for gear, roll in zip((mesh.pinion, mesh.wheel), rolls, strict=True):
        tooth = Tooth(gear, mesh.width)
        if roll < gear.form_roll_length:
            continue  # the ring's tip reaches 0.03 modules into the fillet
        phi = roll / tooth.base_radius
        # Slopes by differences have 8 digits.
        assert tooth.compliance(phi) == pytest.approx(
            compliance_by_quadrature(tooth, phi), rel=1e-7
        )


def test_the_body_after_sainsot():
    """The formula of the paper, written out once more for one point."""
    mesh = fzg_c()
    tooth = Tooth(mesh.pinion, mesh.width)
    theta, h = tooth.body_shape
    assert h == pytest.approx(mesh.pinion.root_diameter / 0.03, rel=1e-12)
    phi = mesh.pitch_point / tooth.base_radius
    x, y, b = tooth.flank(phi)
    # The force meets the centre line x tan(b) below its point.
    u = y - x * math.tan(b) - tooth.root_radius
    s = 2.0 * tooth.root_radius * theta

    def shape(a, b_, c, d, e, f):
        return a / theta**2 + b_ * h**2 + c * h / theta + d / theta + e * h + f

    L = shape(-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045)
    M = shape(60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086)
    P = shape(-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236)
    Q = shape(-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904)
    expected = L * (u / s) ** 2 + M * u / s + P * (1.0 + Q * math.tan(b) ** 2)
    expected *= math.cos(b) ** 2 / (206e9 * 0.014)
    assert tooth.body_compliance(phi) == pytest.approx(expected, rel=1e-10)


def test_hertz_contact_logarithmic_in_the_load():
    mesh = gears_of_20_teeth()
    pair = PairCompliance(mesh, "logarithmic")
    position = np.array([mesh.pitch_point])
    # Weber & Banaschek, equal gears at the pitch point: 4 (1 - nu^2) / (pi E b)
    # (ln(2 h / a) - nu / (2 (1 - nu))), a^2 = 8 F rho (1 - nu^2) / (pi E b), rho = r_b tan / 2.
    force, soft = 5000.0, 0.91 / (math.pi * 200e9 * 0.03)
    a = math.sqrt(8.0 * force * mesh.pitch_point / 2.0 * soft)
    x, _, b = Tooth(mesh.pinion, 0.03).flank(math.tan(math.radians(20.0)))
    law = 4.0 * soft * (math.log(2.0 * x / math.cos(b) / a) - 0.3 / 1.4)
    assert pair.contact_compliance(position, force)[0] == pytest.approx(law, rel=1e-12)
    stiff = [
        mesh.stiffness("energy", hertz="logarithmic", torque=t).mean_stiffness
        for t in (50.0, 500.0, 5000.0)
    ]
    assert stiff[0] < stiff[1] < stiff[2]


def spur_stiffness(mesh, pitches, method):
    """Return the stiffness of a mesh as if spur, at base pitches behind the path's start."""
    pitches, fewer_pairs = np.mod(pitches, 1.0), math.floor(mesh.contact_ratio)
    more = pitches < mesh.contact_ratio - fewer_pairs
    if method == "iso":
        single = iso_stiffness(mesh).single * 1e9 * mesh.width
        return single * (0.25 + 0.75 * np.where(more, fewer_pairs + 1, fewer_pairs))
    stiffness = np.empty(pitches.shape)
    for mask, count in ((more, fewer_pairs + 1), (~more, fewer_pairs)):
        stiffness[mask] = energy_stiffness(mesh, pitches[mask], count)
    return stiffness


@pytest.mark.parametrize("width", [0.02, 0.25])
@pytest.mark.parametrize("method", ["iso", "energy"])
def test_helical_stiffness_is_the_average_over_the_face(method, width):
    mesh = iso_example(width=width)
    table = mesh.stiffness(method).profile
    # The middles of slices of the face: each step of the stiffness leaves one slice in error.
    count = 200_000 if method == "iso" else 4000
    slices = (np.arange(count) + 0.5) / count - 0.5
    fraction = mesh.contact_ratio - 1.0
    rows = list(zip(table.phase, table.stiffness, strict=True))
    for phase, value in rows[:: max(len(rows) // 6, 1)]:
        pitches = phase / math.tau + fraction / 2.0
        mean = spur_stiffness(mesh, pitches + mesh.overlap_ratio * slices, method).mean()
        # Energy: straight lines between 64 samples instead of the stiffness itself.
        assert value == pytest.approx(mean, rel=2e-5 if method == "iso" else 2e-4)
    if method == "iso":
        assert len(table.phase) == 4


def test_stiffness_table_of_a_spur_mesh():
    mesh = fzg_c()
    found = mesh.stiffness("energy", samples=200)
    table = found.profile
    stretch = mesh.contact_ratio - 1.0
    for turn in (-0.99, -0.5, 0.0, 0.5, 0.99, 1.2):
        phase = turn * math.pi * stretch
        value = np.interp(phase, table.phase, table.stiffness, period=2.0 * math.pi)
        expected = spur_stiffness(mesh, np.array([phase / math.tau + stretch / 2.0]), "energy")[0]
        assert value == pytest.approx(expected, rel=1e-4)
    # Same mean as the rectangle, up to the ramps of 1e-7 of a pitch.
    assert table.mean() == pytest.approx(found.mean_stiffness, rel=1e-6)
    pair = GearPair.from_geometry(mesh, torque=302.0, stiffness="energy", damping_ratio=0.0)
    model = OneDegreePair(pair=pair, profile=table)
    assert model.equation.drive_stiffness.breaks[-1] == 2.0 * math.pi


def test_from_geometry():
    mesh = fzg_c()
    pair = GearPair.from_geometry(
        mesh, torque=302.0, damping_ratio=0.06, backlash_damping_ratio=0.01
    )
    assert pair.damping_ratio == pytest.approx(0.06, rel=1e-12)
    assert pair.backlash_damping_ratio == pytest.approx(0.01, rel=1e-12)
    assert pair.load == pytest.approx(8927.3, abs=0.05)
    assert pair.reduced_mass == pytest.approx(0.17495, abs=5e-6)
    assert pair.teeth == 16 and pair.backlash == 0.0
    # n_E1 of ISO 6336-1, m_red in kg per mm.
    gamma = iso_stiffness(mesh).mean
    resonance = 30000.0 * math.sqrt(gamma / (pair.reduced_mass / 14.0)) / (math.pi * 16)
    assert pair.speed(1.0) == pytest.approx(resonance, rel=1e-12)
    assert pair.tuning_at(pair.speed(0.7)) == pytest.approx(0.7, rel=1e-12)
    # A free vibration falls by the factor exp(delta) in a period.
    decrement = 2.0 * math.pi * 0.06 / math.sqrt(1.0 - 0.06**2)
    again = GearPair.from_geometry(mesh, torque=302.0, logarithmic_decrement=decrement)
    assert again.damping_ratio == pytest.approx(0.06, rel=1e-12)
    coefficient = GearPair.from_geometry(mesh, torque=302.0, material_damping=500.0)
    assert coefficient.material_damping == 500.0
    power = 302.0 * 2000.0 * 2.0 * math.pi / 60.0
    by_power = GearPair.from_geometry(mesh, power=power, speed=2000.0)
    assert by_power.load == pytest.approx(pair.load, rel=1e-12)
    helical = GearPair.from_geometry(
        Mesh(iso_example().pinion, iso_example().wheel, 0.5, backlash=1e-4), torque=9000.0
    )
    assert helical.backlash > 1e-4

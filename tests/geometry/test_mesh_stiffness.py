"""Mesh stiffness: quadrature of the energies, averages over the face; the pair of gear geometry."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from gearlib import GearPair
from gearlib.geometry import GearStage, SpurGear, iso_stiffness, mesh_stiffness
from gearlib.models.geometry.mesh_stiffness import PairCompliance, Tooth, energy_stiffness
from tests.geometry.stages import (
    fzg_c,
    gears_of_20_teeth,
    iso_example,
    ring_stage,
    short_tooth_stage,
)


def compliance_by_quadrature(tooth, phi):
    """Integrate the strain energy of a tooth loaded at the roll angle `phi` of its flank."""
    gear, sign = tooth.gear, tooth.sign
    material = gear.material
    shear = material.young / 2.0 / (1.0 + material.poisson)
    x_f, y_f, b = tooth.flank(phi)

    def integrand(x, y):
        """Return the energies of bending, shear and compression per length for a unit force."""
        area, inertia = 2.0 * x * tooth.width, 2.0 / 3.0 * x**3 * tooth.width
        moment = math.cos(b) * sign * (y_f - y) - x_f * math.sin(b)
        return (
            moment**2 / (material.young * inertia)
            + 1.2 * math.cos(b) ** 2 / (shear * area)
            + math.sin(b) ** 2 / (material.young * area)
        )

    def flank_point(radius):
        """Return half the thickness and the height on the flank, by the thickness of ISO 21771."""
        angle = gear.thickness_at(2.0 * radius) / (2.0 * radius)
        return radius * math.sin(angle), radius * math.cos(angle)

    def flank_integrand(radius):
        """Return the integrand over the radius of the involute."""
        step = 1e-6 * radius
        x, y = flank_point(radius)
        slope = (flank_point(radius + step)[1] - flank_point(radius - step)[1]) / 2.0 / step
        return integrand(x, y) * slope

    def fillet_integrand(gamma):
        """Return the integrand over the parameter of the fillet."""
        step = 1e-6
        slope = (tooth.fillet(gamma + step)[1] - tooth.fillet(gamma - step)[1]) / 2.0 / step
        return integrand(*tooth.fillet(gamma)[:2]) * abs(slope)

    low, high = sorted(tooth.base_radius * np.hypot(1.0, [tooth.form_phi, phi]))
    total = quad(flank_integrand, low, high, epsrel=1e-10)[0]
    if not gear.internal:
        total += quad(
            fillet_integrand, gear.transverse_pressure_angle, math.pi / 2.0, epsrel=1e-10
        )[0]
    return total


@pytest.mark.parametrize("mesh", [iso_example(), fzg_c(), gears_of_20_teeth(), ring_stage()])
def test_tooth_compliance_matches_quadrature_of_the_strain_energy(mesh):
    """Compare tooth compliance with numerical integration of the strain energy."""
    for position in np.interp([0.05, 0.5, 1.0], [0.0, 1.0], mesh.path):
        rolls = (position, mesh.wheel_roll_length(position))
        for gear, roll in zip((mesh.pinion, mesh.wheel), rolls, strict=True):
            if roll < gear.form_roll_length:
                # The tip of the ring gear reaches 0.03 modules into the fillet.
                continue
            tooth = Tooth(gear, mesh.width)
            phi = roll / tooth.base_radius
            # Slopes by differences are accurate to 8 digits.
            expected = compliance_by_quadrature(tooth, phi)
            assert tooth.compliance(phi) == pytest.approx(expected, rel=1e-7)


def test_hertzian_deflection_is_logarithmic_in_the_load():
    """Compare the contact compliance of equal gears at the pitch point with Weber & Banaschek.

    It is 4 (1 - nu^2) / (pi E b) (ln(2 h / a) - nu / (2 (1 - nu))), with half the width of contact
    by a^2 = 8 F rho (1 - nu^2) / (pi E b) and rho = r_b tan(alpha) / 2.
    """
    mesh = gears_of_20_teeth()
    force, plane_strain_compliance = 5000.0, 0.91 / (math.pi * 200e9 * 0.03)
    a = math.sqrt(8.0 * force * mesh.pitch_point / 2.0 * plane_strain_compliance)
    x, _, b = Tooth(mesh.pinion, 0.03).flank(math.tan(math.radians(20.0)))
    closed_form = 4.0 * plane_strain_compliance * (math.log(2.0 * x / math.cos(b) / a) - 0.3 / 1.4)
    pair = PairCompliance(mesh, "logarithmic")
    compliance = pair.contact_compliance(np.array([mesh.pitch_point]), force)
    np.testing.assert_allclose(compliance, closed_form, rtol=1e-12)


def spur_stiffness(mesh, pitches, method):
    """Return the spur-gear stiffness of a mesh at positions in base pitches from the path start."""
    pitches, fewer_pairs = np.mod(pitches, 1.0), math.floor(mesh.contact_ratio)
    has_more_pairs = pitches < mesh.contact_ratio - fewer_pairs
    if method == "iso":
        single = iso_stiffness(mesh).single * 1e9 * mesh.width
        return single * (0.25 + 0.75 * np.where(has_more_pairs, fewer_pairs + 1, fewer_pairs))
    stiffness = np.empty(pitches.shape)
    for mask, count in ((has_more_pairs, fewer_pairs + 1), (~has_more_pairs, fewer_pairs)):
        stiffness[mask] = energy_stiffness(mesh, pitches[mask], count)
    return stiffness


@pytest.mark.parametrize("width", [0.02, 0.25])
@pytest.mark.parametrize(
    ("method", "slices", "accuracy"),
    # Each step of the stiffness costs the error of one slice; 64 samples are joined by lines.
    [("iso", 200_000, 2e-5), ("energy", 2000, 2e-4)],
)
def test_helical_stiffness_is_the_average_over_the_face(method, slices, accuracy, width):
    """Average the spur-gear stiffness of many slices of the face."""
    mesh = iso_example(width=width)
    stiffness_of_stage = mesh.stiffness(method)
    phases, stiffnesses = np.array(
        [stiffness_of_stage.profile.phase, stiffness_of_stage.profile.stiffness]
    )
    middles = (np.arange(slices) + 0.5) / slices - 0.5
    selected_phases = slice(None, None, max(phases.size // 6, 1))
    for phase, value in zip(phases[selected_phases], stiffnesses[selected_phases], strict=True):
        pitches = phase / math.tau + (mesh.contact_ratio - 1.0) / 2.0
        mean = spur_stiffness(mesh, pitches + mesh.overlap_ratio * middles, method).mean()
        assert value == pytest.approx(mean, rel=accuracy)
    assert phases.size == 4 or method == "energy"
    # The rectangle has the extrema and the mean of the table.
    assert [*stiffness_of_stage.ratios().values()] == pytest.approx(
        stiffness_of_stage.profile.ratios(), rel=1e-9
    )


def test_below_a_contact_ratio_of_1_a_slice_has_one_pair_or_none():
    """With a contact ratio below 1 the mean stiffness must be that of one pair while it touches."""
    mesh = short_tooth_stage()
    pitches = mesh.contact_ratio * (np.arange(1000) + 0.5) / 1000
    mean = mesh.contact_ratio * energy_stiffness(mesh, pitches, 1).mean()
    # The 64 samples are joined by straight lines.
    assert mesh.stiffness("energy").mean_stiffness == pytest.approx(mean, rel=1e-4)
    with pytest.raises(ValueError, match=r"^contact_ratio = 0\.82.* >= 1 .* ISO 6336-1"):
        mesh.stiffness("iso")


def test_a_pair_from_a_stage_keeps_load_and_damping():
    """Check load, damping and backlash of pairs; docs/worked_example.md prints some of them."""
    mesh = fzg_c()

    def pair(**options):
        """Return the pair of the stage with given load and damping."""
        return GearPair.from_geometry(mesh, **options)

    power = 302.0 * 2000.0 * 2.0 * math.pi / 60.0
    assert pair(power=power, speed=2000.0).load == pytest.approx(8927.3, abs=0.05)
    # A free vibration falls by the factor exp(delta) in a period.
    decrement = 2.0 * math.pi * 0.06 / math.sqrt(1.0 - 0.06**2)
    damped = pair(torque=302.0, logarithmic_decrement=decrement, backlash_damping_ratio=0.01)
    assert damped.damping_ratio == pytest.approx(0.06, rel=1e-12)
    assert damped.backlash_damping_ratio == pytest.approx(0.01, rel=1e-12)
    assert pair(torque=302.0, material_damping=500.0).material_damping == 500.0
    assert damped.teeth == 16
    assert damped.tuning_at(damped.speed(0.7)) == pytest.approx(0.7, rel=1e-12)
    helical = iso_example(thickness_allowance=-5e-5)
    cosine = math.cos(helical.pinion.base_helix_angle)
    backlash = GearPair.from_geometry(helical, torque=9000.0).backlash
    assert backlash == pytest.approx(helical.backlash / cosine, rel=1e-12)


@pytest.mark.parametrize(
    ("teeth", "module", "bores", "expected", "without_twist"),
    [
        ((21, 58), 3.5e-3, (20e-3, 50e-3), 0.779, 0.708),
        ((55, 75), 2e-3, (35.2e-3, 35.2e-3), 0.791, 0.732),
        ((50, 50), 3e-3, (50e-3, 50e-3), 0.758, 0.718),
        ((42, 62), 3e-3, (40e-3, 40e-3), 0.794, 0.724),
    ],
)
def test_compliance_coupling_through_the_body_matches_finite_elements(
    teeth, module, bores, expected, without_twist
):
    """Compare the ratio of the stiffness of one and of two pairs with finite elements."""
    gears = (
        SpurGear(teeth=z, module=module, width=0.02, bore=bore)
        for z, bore in zip(teeth, bores, strict=True)
    )
    mesh = GearStage(*gears)
    stiffness = mesh_stiffness(mesh, "energy", coupling=None)
    assert stiffness.stiffness_ratio == pytest.approx(expected, abs=0.002)
    # The beam model of the tooth is too compliant, which matters more without the twist.
    rigid = mesh_stiffness(mesh, "energy", coupling=None, twist=False)
    assert without_twist - 0.025 < rigid.stiffness_ratio < without_twist
    # Twist is a spring in series, which adds the same compliance to one pair and to two.
    added_to_two_pairs = 1.0 / stiffness.max_stiffness - 1.0 / rigid.max_stiffness
    added_to_one_pair = 1.0 / stiffness.max_stiffness / stiffness.stiffness_ratio
    added_to_one_pair -= 1.0 / rigid.max_stiffness / rigid.stiffness_ratio
    assert added_to_one_pair == pytest.approx(added_to_two_pairs, rel=1e-3)


def test_coupling_of_tooth_pairs_decreases_with_their_distance():
    """Compliance shared by two tooth pairs must be positive and fall with their distance.

    `shared_compliances(3)` returns the values (m/N) of pairs one and two base pitches apart.
    """
    pair = PairCompliance(short_tooth_stage())
    near, far = pair.shared_compliances(3)
    assert 0.0 < far < near
    # The coupling cannot exceed the compliance of the bodies themselves.
    ends = pair.body_compliances(np.array(short_tooth_stage().path))
    assert near <= ends.min(axis=1).sum() * (1.0 + 1e-12)


def test_torsional_compliances_of_both_gears_add_up():
    """Twist must lower the stiffness only for a gear with a bore, about which it can twist."""
    gears = [SpurGear(teeth=z, module=3e-3, width=0.02, bore=b) for z, b in ((30, 0.03), (40, 0.0))]
    pinion_twist, no_twist, wheel_twist, both_twist = (
        mesh_stiffness(GearStage(*gears), "energy", twist=twist).mean_stiffness
        for twist in ((True, False), (False, False), (False, True), True)
    )
    # The wheel has no bore about which it could twist.
    assert pinion_twist == both_twist < no_twist == wheel_twist
    with pytest.raises(ValueError, match="^twist = .* must be one of False, True, or two of them"):
        mesh_stiffness(GearStage(*gears), "energy", twist=(True,))

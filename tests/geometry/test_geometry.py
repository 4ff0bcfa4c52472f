"""Geometry of drawn gears: published numbers, identities, constructions point by point."""

import math

import pytest
from scipy.integrate import quad

from gearlib.geometry import Mesh, SpurGear, Web
from gearlib.models.geometry.mesh_stiffness import Tooth
from tests.geometry.drawings import fzg_c, gears_of_20_teeth, iso_example, ring


def test_iso_example_1_to_its_printed_digits():
    mesh = iso_example()
    assert mesh.pinion.virtual_teeth == pytest.approx(18.905, abs=5e-4)
    assert mesh.wheel.virtual_teeth == pytest.approx(114.543, abs=5e-4)
    assert mesh.tangential_force(9000.0) == pytest.approx(127352.0, abs=0.5)
    assert mesh.pitch_line_velocity(360.0) == pytest.approx(2.664, abs=5e-4)
    assert mesh.contact_ratio == pytest.approx(1.54909, abs=5e-6)


def test_backlash_by_thickness_allowances_and_distance():
    allowance = -5e-5
    tight = gears_of_20_teeth()
    loose = gears_of_20_teeth(thickness_allowance=allowance)
    # Two allowances, seen along the line of action.
    assert loose.backlash == pytest.approx(
        -2.0 * allowance * math.cos(math.radians(20.0)), rel=1e-9
    )
    wide = Mesh(tight.pinion, tight.wheel, tight.centre_distance + 1e-6)
    # A small larger distance opens 2 da tan(alpha) on the pitch circle, 2 da sin(alpha) normally.
    expected = 2e-6 * math.sin(math.radians(20.0))
    assert wide.backlash == pytest.approx(expected, rel=1e-4)
    assert tight.backlash == 0.0 and Mesh(tight.pinion, tight.wheel, backlash=3e-5).backlash == 3e-5
    helical = iso_example(thickness_allowance=allowance)
    gain = helical.backlash - iso_example().backlash
    # Normal thickness along the normal: cos(alpha_n), with the working circle 0.2 % larger.
    assert gain == pytest.approx(-2.0 * allowance * math.cos(math.radians(20.0)), rel=5e-3)
    inner = ring(thickness_allowance=allowance).backlash
    assert inner == pytest.approx(-allowance * math.cos(math.radians(20.0)), rel=1e-9)


@pytest.mark.parametrize("shifts", [(0.0, 0.0), (0.2, -0.2)])
def test_clearance_of_teeth_at_their_reference_distance(shifts):
    # The dedendum, 1.25 m, is a quarter of the module more than the addendum.
    pinion, wheel = (
        SpurGear(teeth=z, module=4e-3, width=20e-3, shift=x)
        for z, x in zip((25, 60), shifts, strict=True)
    )
    assert Mesh(pinion, wheel).clearances == pytest.approx((1e-3, 1e-3), abs=1e-15)


def test_clearance_in_a_ring_gear():
    mesh = ring()
    pinion, wheel, distance = mesh.pinion, mesh.wheel, 4e-3 * (99 - 36) / 2.0
    root = wheel.root_diameter / 2.0 - distance - pinion.tip_diameter / 2.0
    tip = wheel.tip_diameter / 2.0 - distance - pinion.root_diameter / 2.0
    assert root == pytest.approx(1e-3, abs=1e-12)
    assert mesh.clearances == pytest.approx((root, tip), abs=1e-12)


def test_pitch_phase_of_equal_gears():
    mesh = gears_of_20_teeth()
    # By symmetry the pitch point is the middle of single contact, half a period from phase 0.
    assert mesh.pitch_phase == pytest.approx(math.pi, abs=1e-9)
    middle_of_double_contact = mesh.path[0] + (mesh.contact_ratio - 1.0) / 2.0 * mesh.base_pitch
    assert mesh.phase_of(middle_of_double_contact) == pytest.approx(0.0, abs=1e-9)


def test_recommended_backlash_of_the_worked_example():
    assert fzg_c().recommended_backlash == pytest.approx(160.5e-6, rel=1e-12)


@pytest.mark.parametrize("mesh", [iso_example(), fzg_c(), gears_of_20_teeth(), ring()])
def test_thickness_is_that_of_the_outline(mesh):
    for gear in (mesh.pinion, mesh.wheel):
        radius = gear.tip_diameter / 2.0
        tooth = Tooth(gear, 1.0)
        x, y, _ = tooth.flank(gear.tip_roll_length / tooth.base_radius)
        assert math.hypot(x, y) == pytest.approx(radius, rel=1e-12)
        expected = gear.thickness_at(gear.tip_diameter)
        assert 2.0 * radius * math.atan2(x, y) == pytest.approx(expected, rel=1e-9)


def test_inertia_against_integration():
    web = Web(thickness=0.01, rim_diameter=0.15, hub_diameter=0.08)
    gear = SpurGear(teeth=50, module=4e-3, width=0.03, bore=0.04, web=web)

    def width(radius):
        inside = web.hub_diameter < 2.0 * radius < web.rim_diameter
        return web.thickness if inside else gear.width

    edges = [gear.bore, web.hub_diameter, web.rim_diameter, gear.mean_diameter]
    for power, found in ((1, gear.mass), (3, gear.inertia)):
        total = sum(
            quad(lambda r, n=power: 2.0 * math.pi * 7850.0 * r**n * width(r), a / 2.0, b / 2.0)[0]
            for a, b in zip(edges, edges[1:], strict=False)
        )
        assert found == pytest.approx(total, rel=1e-9)
    rim = ring().wheel
    assert rim.inertia == pytest.approx(
        7850.0 * 0.03 * math.pi / 32.0 * (0.44**4 - rim.mean_diameter**4), rel=1e-12
    )


def test_helical_quantities():
    mesh = iso_example()
    gear = mesh.pinion
    # On the base cylinder the lead is the same: tan(beta_b) / tan(beta) = d_b / d.
    assert math.tan(gear.base_helix_angle) / math.tan(gear.helix_angle) == pytest.approx(
        gear.base_diameter / gear.reference_diameter, rel=1e-12
    )
    # The face covers eps_beta base pitches along the base cylinder.
    shift = mesh.width * math.tan(gear.base_helix_angle) / mesh.base_pitch
    assert mesh.overlap_ratio == pytest.approx(shift, rel=1e-12)
    assert mesh.total_contact_ratio == mesh.contact_ratio + mesh.overlap_ratio

"""Geometry of gears given by geometry: backlash, clearances, masses."""

import math

import numpy as np
import pytest

from gearlib import LoadSharingPair
from gearlib.geometry import GearStage, SpurGear, Web
from tests.geometry.stages import gears_of_20_teeth, ring_stage, short_tooth_stage

COS_PRESSURE_ANGLE = math.cos(math.radians(20.0))


def test_thickness_allowances_open_backlash_along_the_line_of_action():
    """Allowances of both teeth must add up to the backlash, times the cosine of pressure angle."""
    gears_without_allowance = gears_of_20_teeth()
    # Gears without allowances get the backlash 2/3 (0.06 + 0.1 + 0.3) mm of ISO/TR 10064-2.
    assert gears_without_allowance.has_recommended_backlash
    assert gears_without_allowance.backlash == pytest.approx(0.46e-3 / 1.5, rel=1e-12)
    assert (
        GearStage(
            gears_without_allowance.pinion, gears_without_allowance.wheel, backlash=0.0
        ).backlash
        == 0.0
    )
    gears_with_allowance = gears_of_20_teeth(thickness_allowance=-5e-5)
    assert gears_with_allowance.backlash == pytest.approx(2.0 * 5e-5 * COS_PRESSURE_ANGLE, rel=1e-9)
    assert (
        GearStage(gears_with_allowance.pinion, gears_with_allowance.wheel, backlash=3e-5).backlash
        == 3e-5
    )
    assert ring_stage(thickness_allowance=-5e-5).backlash == pytest.approx(
        5e-5 * COS_PRESSURE_ANGLE, rel=1e-9
    )


def test_clearances_are_gaps_between_tip_and_root():
    """Clearances must equal the gap from each tip to the root of the mate, in m."""
    # The dedendum exceeds the addendum by a quarter of the module, 1 mm.
    gears = (
        SpurGear(teeth=z, module=4e-3, width=0.02, shift=x) for z, x in ((25, 0.2), (60, -0.2))
    )
    assert GearStage(*gears).clearances == pytest.approx((1e-3, 1e-3), abs=1e-15)
    mesh = ring_stage()
    tip = (mesh.wheel.tip_diameter - mesh.pinion.root_diameter) / 2.0 - mesh.centre_distance
    assert mesh.clearances == pytest.approx((1e-3, tip), abs=1e-12)


GEAR = SpurGear(
    teeth=50,
    module=4e-3,
    width=0.03,
    bore=0.04,
    web=Web(thickness=0.01, rim_diameter=0.15, hub_diameter=0.08),
)
RING = ring_stage().wheel


@pytest.mark.parametrize(
    ("gear", "diameters", "widths"),
    [
        (GEAR, [0.04, 0.08, 0.15, GEAR.mean_diameter], [0.03, 0.01, 0.03]),
        (RING, [RING.mean_diameter, 0.44], [0.03]),
    ],
)
def test_mass_and_inertia_add_up_hub_web_and_rim(gear, diameters, widths):
    """Mass and inertia must be sums over steel rings, 7850 kg/m^3, of given size."""
    mass, inertia = (np.diff(np.power(diameters, n)) @ widths for n in (2, 4))
    assert gear.mass == pytest.approx(7850.0 * math.pi / 4.0 * mass, rel=1e-12)
    assert gear.inertia == pytest.approx(7850.0 * math.pi / 32.0 * inertia, rel=1e-12)


@pytest.mark.parametrize("helix_hands", [(-1, -1), (1, -1), (-1, 1)])
def test_mirrored_gears_have_the_same_motion(helix_hands):
    """Opposite hands of the helices must not change the equations of motion."""
    systems = [
        LoadSharingPair.from_geometry(
            short_tooth_stage(signs), torque=300.0, stiffness="energy", damping_ratio=0.05
        ).system(0.7)
        for signs in ((1, 1), helix_hands)
    ]
    for value, mirrored in zip(*systems, strict=True):
        np.testing.assert_array_equal(value, mirrored)


@pytest.mark.parametrize(("angles", "internal"), [((0.3, -0.2), False), ((0.3, -0.3), True)])
def test_helices_that_contradict_each_other_are_refused(angles, internal):
    """A wheel whose helix angle does not fit that of the pinion must be refused."""
    pinion, wheel = (
        SpurGear(teeth=z, module=3e-3, width=0.02, helix_angle=angle, internal=z > 50 and internal)
        for z, angle in zip((25, 80), angles, strict=True)
    )
    with pytest.raises(ValueError, match=rf"^wheel.helix_angle = {angles[1]} .* pinion, 0\.3"):
        GearStage(pinion, wheel)


def test_a_total_contact_ratio_below_1_is_refused():
    """A face of 4 mm makes the total contact ratio 0.9, so that contact would be interrupted."""
    with pytest.raises(ValueError, match=r"^total_contact_ratio = 0\.9\d* .* > 1"):
        short_tooth_stage(width=4e-3)

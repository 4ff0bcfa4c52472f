"""Geometry of drawn gears: backlash, clearances, masses."""

import math

import numpy as np
import pytest

from gearlib.geometry import Mesh, SpurGear, Web
from tests.geometry.drawings import gears_of_20_teeth, ring

COSINE = math.cos(math.radians(20.0))


def test_thickness_allowances_open_backlash_along_the_line_of_action():
    assert gears_of_20_teeth().backlash == 0.0
    loose = gears_of_20_teeth(thickness_allowance=-5e-5)
    assert loose.backlash == pytest.approx(2.0 * 5e-5 * COSINE, rel=1e-9)
    assert Mesh(loose.pinion, loose.wheel, backlash=3e-5).backlash == 3e-5
    assert ring(thickness_allowance=-5e-5).backlash == pytest.approx(5e-5 * COSINE, rel=1e-9)


def test_clearances_are_gaps_between_tip_and_root():
    # The dedendum, 1.25 m, is a quarter of the module more than the addendum.
    gears = (
        SpurGear(teeth=z, module=4e-3, width=0.02, shift=x) for z, x in ((25, 0.2), (60, -0.2))
    )
    assert Mesh(*gears).clearances == pytest.approx((1e-3, 1e-3), abs=1e-15)
    mesh = ring()
    tip = (mesh.wheel.tip_diameter - mesh.pinion.root_diameter) / 2.0 - mesh.centre_distance
    assert mesh.clearances == pytest.approx((1e-3, tip), abs=1e-12)


GEAR = SpurGear(
    teeth=50,
    module=4e-3,
    width=0.03,
    bore=0.04,
    web=Web(thickness=0.01, rim_diameter=0.15, hub_diameter=0.08),
)
RING = ring().wheel


@pytest.mark.parametrize(
    ("gear", "diameters", "widths"),
    [
        (GEAR, [0.04, 0.08, 0.15, GEAR.mean_diameter], [0.03, 0.01, 0.03]),
        (RING, [RING.mean_diameter, 0.44], [0.03]),
    ],
)
def test_mass_and_inertia_are_those_of_hub_web_and_rim(gear, diameters, widths):
    mass, inertia = (np.diff(np.power(diameters, n)) @ widths for n in (2, 4))
    assert gear.mass == pytest.approx(7850.0 * math.pi / 4.0 * mass, rel=1e-12)
    assert gear.inertia == pytest.approx(7850.0 * math.pi / 32.0 * inertia, rel=1e-12)

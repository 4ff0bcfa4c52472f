"""Harris maps: what the data say."""

import numpy as np
import pytest

from gearlib.config import load
from gearlib.models.geometry import drawings
from gearlib.studies import drawn_gears
from tests.geometry.drawings import fzg_c
from tests.unit.test_defaults import GEARS

CONFIG = load(
    {"gear_pair": GEARS, "dampings": {"oil": {"material_damping": 0.0, "backlash_damping": 20.0}}}
)
DRAWING = CONFIG.harris_map.gears.model_dump()
TORQUE = DRAWING["torque"]


def test_the_default_gears_are_fzg_c():
    mesh = drawings.mesh(DRAWING)
    drawn = fzg_c(quality=5)
    assert mesh.contact_ratio == drawn.contact_ratio and mesh.backlash == 160e-6
    assert (mesh.pinion, mesh.wheel) == (drawn.pinion, drawn.wheel)


def test_harris_map_of_constant_stiffness():
    """c' of ISO 6336-1: long relief leaves nothing at the design load, short the half of F / c'."""
    found = drawn_gears.harris_map(DRAWING, [0.0, 0.5, 1.0, 1.5], "iso", 64)
    mesh = drawings.mesh(DRAWING)
    stiffness = mesh.stiffness("iso")
    lowest = stiffness.max_stiffness * stiffness.stiffness_ratio
    deflection = mesh.load(TORQUE) * (1.0 / lowest - 1.0 / stiffness.max_stiffness)
    at = found.peak_to_peak_error.sel(torque=TORQUE)
    np.testing.assert_allclose(at, [deflection, deflection, 0.0], atol=1e-12 * deflection)
    own = found.peak_to_peak_error.values
    # Without load short relief has none either, long relief half of its amount in the middle.
    assert own[0, 0] == own[1, 0] == 0.0
    assert own[2, 0] == pytest.approx(found.relief_amount.values[2, 0] / 2.0, rel=1e-9)
    np.testing.assert_array_equal(found.relief_amount[1], found.relief_amount[2])

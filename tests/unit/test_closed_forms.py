"""Kernels on their own: closed forms against matrix exponentials, first crossings against looks.

A look is a fine grid of the closed form: it proves no crossing, but no proof may contradict it.
"""

import math

import numpy as np
import pytest

from gearlib.kernels.closed_form.arc_tangents import RATES, enter
from gearlib.kernels.closed_form.mesh_constants import contact_of, mesh
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.orbit import orbit_period
from gearlib.kernels.overflow import within_range
from gearlib.models.propagators.closed_form import ratios
from tests.paper import PAPER


def test_contact_of_a_state_on_a_line_is_that_just_after():
    on_near = [contact_of(2.0, 0.0, v) for v in (1.0, 0.0, -1.0)]
    assert on_near == [NORMAL, NORMAL, BACKLASH]
    on_far = [contact_of(2.0, -2.0, v) for v in (1.0, 0.0, -1.0)]
    assert on_far == [BACKLASH, BACKLASH, INVERSE]
    assert [contact_of(2.0, x, 0.0) for x in (0.1, -1.0, -2.1)] == [NORMAL, BACKLASH, INVERSE]


@pytest.mark.parametrize("component", [0, 1])
@pytest.mark.parametrize("period", [1, 2, 3, 5, 16])
def test_a_period_takes_both_components(component, period):
    strobes = np.zeros((32, 2))
    strobes[:, component] = np.arange(32) % period
    assert orbit_period(strobes, 0.9, 1.0) == period
    strobes[:, component] += np.arange(32)
    assert orbit_period(strobes, 0.9, 1.0) == 0


def test_an_arc_in_the_contact_before_changes_no_tangent():
    m = mesh(ratios(PAPER.replace(material_damping=3953.7, backlash_damping=800.0)), 0.8)
    for contact in (NORMAL, BACKLASH, INVERSE):
        tangents = np.random.default_rng(2).normal(size=(2, 40))
        kept = tangents.copy()
        arc = np.array([0.1, 0.2, contact, 1.0, 0.0, -1.0])
        assert enter(m, np.ones((RATES, 40)), arc, contact, 2, tangents) == 2
        # To the last bit: what a flank takes away and gives back again would leave a rounding.
        np.testing.assert_array_equal(tangents, kept)


def test_states_have_room_for_their_squares():
    below = np.nextafter(1e150, 0.0)
    for x, v in ((1e150, 0.0), (0.0, -1e150), (math.nan, 0.0), (0.0, math.inf)):
        assert not within_range(x, v)
    assert within_range(below, -below)

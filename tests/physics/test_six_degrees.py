"""Six degrees of freedom: a backlash that moves with bearings and run-out, and orbits."""

import numpy as np
import pytest

from tests.properties.known_models import gears

LIMIT = 2000


def touching(model, speed):
    """Return a state on the far line, with bearings that pass each other, and (y - s)' given."""
    z = np.zeros(12)
    z[:2] = -model.pair.backlash_ratio / 2.0
    z[2], z[4] = -0.05, 0.05
    z[6], z[8], z[10] = speed, 3.0, -3.0
    return z


@pytest.mark.parametrize(("material", "oil"), [(0.0, 4e4), (3953.7, 4e4), (4e4, 0.0)])
def test_the_far_flank_is_grazed_without_chatter(material, oil):
    # Oil that damps far more than the material: y' then drives the flanks together.
    model = gears(1e9, material, oil, backlash=200e-6)
    ends = {}
    for speed in (-1e-6, 0.0, 1e-6):
        state = touching(model, speed)
        events = model.propagator(0.9).record(state, 1, LIMIT).events
        assert len(events) <= 2
        ends[speed] = model.propagator(0.9).maps(state, 1, LIMIT)
        assert ends[speed][2] == 0
    # A microscopic difference stays one; the map of a touch is one of the two sides, and no spike.
    for speed in (-1e-6, 1e-6):
        assert abs(ends[speed][0] - ends[0.0][0]).max() < 1e-4
    assert max(abs(end[1]).max() for end in ends.values()) < 10.0

"""Six degrees of freedom: a backlash that moves with bearings and run-out, and orbits."""

import numpy as np
import pytest

from tests.properties.known_models import gears

#: Largest number of events in a mesh period.
MAX_EVENTS = 2000


def state_on_far_flank(model, speed):
    """Return a state on the coast-side flank, (12,), with a speed of the first rotation.

    Both bearings are displaced, and move, in opposite directions along the line of action.
    """
    coordinates, rates = np.zeros(6), np.zeros(6)
    # Two rotations, then both bearings along (2, 4) and across (3, 5) the line of action.
    coordinates[:2] = -model.pair.backlash_ratio / 2.0
    coordinates[[2, 4]] = -0.05, 0.05
    rates[[0, 2, 4]] = speed, 3.0, -3.0
    return np.concatenate([coordinates, rates])


@pytest.mark.parametrize(("material", "oil"), [(0.0, 4e4), (3953.7, 4e4), (4e4, 0.0)])
def test_the_coast_flank_is_grazed_without_chatter(material, oil):
    # If oil damps far more than the material, it drives the flanks together.
    model = gears(1e9, material, oil, backlash=200e-6)
    ends = []
    for speed in (0.0, -1e-6, 1e-6):
        state = state_on_far_flank(model, speed)
        assert len(model.propagator(0.9).record(state, 1, MAX_EVENTS).events) <= 2
        end, period_maps, status = model.propagator(0.9).maps(state, 1, MAX_EVENTS)
        # The derivatives stay bounded where the flank is just touched.
        assert status == 0 and abs(period_maps).max() < 10.0
        ends.append(end)
    # A microscopic difference of the speed stays one.
    for end in ends[1:]:
        assert abs(end - ends[0]).max() < 1e-4

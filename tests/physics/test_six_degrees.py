"""Six degrees of freedom: a backlash that moves with the bearings."""

import numpy as np
import pytest

from tests.properties.known_models import gears

#: Largest number of events in a mesh period.
MAX_EVENTS = 2000


def state_on_coast_flank(model, speed):
    """Return a state on the coast-side flank line, (12,), in which the pinion turns at `speed`.

    Both bearings are displaced, and move, in opposite directions along the line of action.
    """
    coordinates, rates = np.zeros(6), np.zeros(6)
    # The coordinates are two rotations, then both bearings along (2, 4) and across (3, 5) the line
    # of action.
    coordinates[:2] = -model.pair.backlash_ratio / 2.0
    coordinates[[2, 4]] = -0.05, 0.05
    rates[[0, 2, 4]] = speed, 3.0, -3.0
    return np.concatenate([coordinates, rates])


@pytest.mark.parametrize(("material", "oil"), [(0.0, 4e4), (3953.7, 4e4), (4e4, 0.0)])
def test_the_coast_flank_is_grazed_without_chatter(material, oil):
    """A motion that just touches the coast flank must have few events and bounded derivatives."""
    # If oil damping is far larger than material damping, it drives the flanks together.
    model = gears(1e9, material, oil, backlash=200e-6)
    final_states = []
    for speed in (0.0, -1e-6, 1e-6):
        state = state_on_coast_flank(model, speed)
        assert len(model.propagator(0.9).record(state, 1, MAX_EVENTS).events) <= 2
        final_state, period_maps, status = model.propagator(0.9).maps(state, 1, MAX_EVENTS)
        # The derivatives stay bounded where the flank is just touched.
        assert status == 0 and abs(period_maps).max() < 10.0
        final_states.append(final_state)
    # A difference of the speed of 1e-6 must stay small.
    for final_state in final_states[1:]:
        assert abs(final_state - final_states[0]).max() < 1e-4

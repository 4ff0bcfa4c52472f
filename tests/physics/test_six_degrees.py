"""Check gears with six degrees of freedom, whose backlash moves with the bearings."""

import numpy as np
import pytest

from tests.properties.known_models import gears_on_bearings

#: Largest number of events in a mesh period.
MAX_EVENTS = 2000


def state_on_coast_flank(model, speed):
    """Return a state of shape (12,) in which the coast flanks just touch.

    `speed` is the velocity of the pinion's rotation. Both bearings are displaced, and move, in
    opposite directions along the line of action.
    """
    # The coordinates are the rotations of both gears (0, 1), and the displacements of pinion and
    # wheel along (2, 4) and across (3, 5) the line of action.
    coordinates, rates = np.zeros(6), np.zeros(6)
    coordinates[:2] = -model.pair.backlash_ratio / 2.0
    coordinates[[2, 4]] = -0.05, 0.05
    rates[[0, 2, 4]] = speed, 3.0, -3.0
    return np.concatenate([coordinates, rates])


@pytest.mark.parametrize(
    ("contact_damping", "free_flight_damping"), [(0.0, 4e4), (3953.7, 4e4), (4e4, 0.0)]
)
def test_the_coast_flank_is_grazed_without_chatter(contact_damping, free_flight_damping):
    """A motion that just touches the coast flank must have few events and bounded derivatives.

    Damping in free flight that is far larger than in contact drives the flanks together. Initial
    speeds that differ by 1e-6 must lead to nearly equal final states.
    """
    model = gears_on_bearings(1e9, contact_damping, free_flight_damping, backlash=200e-6)
    propagator, final_states = model.propagator(0.9), []
    for speed in (0.0, -1e-6, 1e-6):
        state = state_on_coast_flank(model, speed)
        assert len(propagator.record(state, 1, MAX_EVENTS).events) <= 2
        final_state, period_maps, status = propagator.maps(state, 1, MAX_EVENTS)
        assert status == 0 and abs(period_maps).max() < 10.0
        final_states.append(final_state)
    for final_state in final_states[1:]:
        assert abs(final_state - final_states[0]).max() < 1e-4

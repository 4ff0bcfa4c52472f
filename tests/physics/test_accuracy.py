"""The exact propagator against 50 digits: final states and event phases."""

import numpy as np
import pytest

from gearlib import GearPair, simulate
from tests.references import Stored, from_rest

REFERENCES = Stored("accuracy")

EPS, KAPPA = 1.569, 0.5879
#: Rounding of a few hundred arcs, each a few units in the last place of states of order one.
DAMPED_STATE = 1e-11
#: Phases of order 1000 carry 1e-13; a bounce that leaves at speed v amplifies by 1 / v.
EVENT_PHASE = 1e-10
#: Without damping rounding grows with every bounce, by up to 1e5 in 20 periods.
UNDAMPED_STATE = 1e-9


def run_that_matches(
    damping, backlash_damping, backlash, tuning, periods, state_tolerance, *, state=(0.0, 0.0)
):
    """Return a run whose events, one by one, and final state are asserted to be the reference's."""
    ratios = EPS, KAPPA, damping, backlash_damping, backlash
    x, v, expected = REFERENCES.propagate(*ratios, tuning, periods, state)
    names = ("contact_ratio", "stiffness_ratio", "damping", "backlash_damping", "backlash")
    pair = GearPair.from_ratios(**dict(zip(names, ratios, strict=True)))
    recorded = simulate(pair, tuning, periods=periods, record_periods=periods, initial_state=state)
    assert recorded.event_from.values.tolist() == [event[1] for event in expected]
    assert recorded.event_to.values.tolist() == [event[2] for event in expected]
    phases = np.array([float(event[0]) for event in expected])
    # The rounding of the displacement, of order one, divided by the speed is an error of phase.
    speeds = np.maximum(np.abs(recorded.event_velocity.values), 1e-8)
    tolerance = EVENT_PHASE + 4.0 * np.finfo(float).eps / speeds
    assert (np.abs(recorded.event_phase.values - phases) <= tolerance).all()
    unrecorded = simulate(pair, tuning, periods=periods, initial_state=state)
    for run in (recorded, unrecorded):
        np.testing.assert_allclose(
            run.final_state, [float(x), float(v)], rtol=0, atol=state_tolerance
        )
    return recorded


@pytest.mark.parametrize(
    ("damping", "backlash_damping", "tuning"),
    [
        (0.0617, 0.0617, 0.7),  # smooth
        (0.0617, 0.0, 0.9),  # a bounce in every period
        (0.0617, 0.0617, 0.815),  # either side of the fold
        (0.0617, 0.0617, 0.8151),
        (0.0, 0.0617, 0.9),
        (0.3, 0.001, 0.25),
    ],
)
def test_damped_motions_have_the_state_of_50_digits_after_200_periods(
    damping, backlash_damping, tuning
):
    run_that_matches(damping, backlash_damping, 4.0, tuning, 200, DAMPED_STATE)


@pytest.mark.parametrize("tuning", [0.66, 0.82])
def test_undamped_motions_have_the_state_of_50_digits_after_20_periods(tuning):
    run_that_matches(0.0, 0.0, 4.0, tuning, 20, UNDAMPED_STATE)


@pytest.mark.parametrize("miss", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("side", [1, -1])
def test_a_mesh_that_just_misses_the_far_flank_is_distinguished_from_one_that_hits_it(miss, side):
    tuning, damping, gap = 0.8, 0.05, 2.0
    # Backwards in time from rest beside the far flank.
    closest = -gap + side * miss
    x, v = from_rest(decay=-damping / tuning, square=0.0, load=1 / tuning**2, x=closest, t=0.9)
    run = run_that_matches(damping, damping, gap, tuning, 3, 1e-8, state=(float(x), -float(v)))
    # It touches the normal flank (1) next if it misses, and the far flank (-1) if not.
    assert int(run.event_to[0]) == side

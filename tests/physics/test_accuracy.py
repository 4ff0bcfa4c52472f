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


def compare(beta, beta_m, gap, nu, periods, state_tolerance, *, state=(0.0, 0.0)):
    """Compare a run with the reference: events one by one, final state; return the run."""
    x, v, expected = REFERENCES.propagate(EPS, KAPPA, beta, beta_m, gap, nu, periods, state)
    pair = GearPair.from_ratios(
        contact_ratio=EPS,
        stiffness_ratio=KAPPA,
        damping=beta,
        backlash_damping=beta_m,
        backlash=gap,
    )
    recorded = simulate(pair, nu, periods=periods, record_periods=periods, initial_state=state)
    assert recorded.event_from.values.tolist() == [event[1] for event in expected]
    assert recorded.event_to.values.tolist() == [event[2] for event in expected]
    phases = np.array([float(event[0]) for event in expected])
    # Next to grazing the rounding of the displacement, of order one, counts over the speed.
    speeds = np.maximum(np.abs(recorded.event_velocity.values), 1e-8)
    tolerance = EVENT_PHASE + 4.0 * np.finfo(float).eps / speeds
    assert (np.abs(recorded.event_phase.values - phases) <= tolerance).all()
    unrecorded = simulate(pair, nu, periods=periods, initial_state=state)
    for run in (recorded, unrecorded):
        np.testing.assert_allclose(
            run.final_state, [float(x), float(v)], rtol=0, atol=state_tolerance
        )
    return recorded


@pytest.mark.parametrize(
    ("beta", "beta_m", "nu"),
    [
        (0.0617, 0.0617, 0.7),  # smooth
        (0.0617, 0.0, 0.9),  # a bounce in every period
        (0.0617, 0.0617, 0.815),  # either side of the fold
        (0.0617, 0.0617, 0.8151),
        (0.0, 0.0617, 0.9),
        (0.3, 0.001, 0.25),
    ],
)
def test_damped_motions_have_the_state_of_50_digits_after_200_periods(beta, beta_m, nu):
    compare(beta, beta_m, 4.0, nu, 200, DAMPED_STATE)


@pytest.mark.parametrize("nu", [0.66, 0.82])
def test_undamped_motions_have_the_state_of_50_digits_after_20_periods(nu):
    compare(0.0, 0.0, 4.0, nu, 20, UNDAMPED_STATE)


@pytest.mark.parametrize("miss", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("side", [1, -1])
def test_a_mesh_that_just_misses_the_far_flank_is_told_from_one_that_hits_it(miss, side):
    nu, beta_m, gap = 0.8, 0.05, 2.0
    x, v = from_rest(-beta_m / nu, 0.0, 1 / nu**2, -gap + side * miss, 0.9)
    run = compare(0.05, beta_m, gap, nu, 3, 1e-8, state=(float(x), -float(v)))
    # It misses the far flank and lands on the normal one, or the other way round.
    assert int(run.event_to[0]) == side

"""A run that has settled ends where one propagated in full does, and no other is taken for one."""

import math

import numpy as np
import pytest

from gearlib import GearPair, OneDegreePair, periodic_orbit, simulate, sweep
from gearlib.engines import orbit
from gearlib.engines.pair.motion import contact_of, mesh_at_tuning
from gearlib.engines.pair.pair_run import run_unrecorded
from gearlib.engines.pair.propagator import ratios
from gearlib.engines.pair.whole_periods import new_work, set_mesh, set_start
from tests.geometry.drawings import own
from tests.paper import PAPER
from tests.unit.test_whole_periods import LIMIT, bouncing_case, ratios_of, whole_periods

PAIR = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash": 4.0}
#: The small motion of the pair with equal damping ends here in a fold, by bisection over runs of a
#: million periods that start from the state below.
FOLD, AT_FOLD = 0.81685037334556, (-0.16062993275504864, -0.3277925734167014)


def run(m, x, v, periods):
    """Return (x, v, repeat) after so many periods; repeat 0 if it does not settle."""
    work = new_work()
    set_mesh(work, m)
    set_start(work, x, v)
    _, x, v, _, repeat, _ = run_unrecorded(
        m, work, contact_of(m.backlash, x, v), x, v, periods, LIMIT
    )
    return x, v, repeat


def test_settled_runs_end_where_propagating_them_does():
    rng = np.random.default_rng(1)
    repeats = []
    for _ in range(200):
        pair, tuning, x, v = bouncing_case(rng)
        pair[4:6] = 10 ** rng.uniform(-2.5, -0.5, 2)
        m, periods = mesh_at_tuning(pair, tuning), int(rng.integers(100, 4000))
        *end, repeat = run(m, x, v, periods)
        repeats.append(repeat)
        _, *plain, _ = whole_periods(m, x, v, periods)
        # NEAR^2 by the least speed of an event, and rounding by the slowest contraction.
        close = np.abs(np.subtract(end, plain)).max() < 2e-12 * (1.0 + abs(plain[0]))
        assert close or repeat == 0, (m, x, v)
    assert np.count_nonzero(repeats) > 150 and np.count_nonzero(np.array(repeats) > 1) > 5


@pytest.mark.parametrize("past", [1e-8, 1e-11])
def test_the_ghost_of_a_fold_is_not_an_orbit(past):
    # Beyond the fold a run creeps past where the orbit was, by 1e-10 and less a period, for as many
    # as 1e6 periods, and then goes elsewhere.
    m = mesh_at_tuning(ratios_of(1.569, 0.5879, 0.0617, 0.0617, 4.0), FOLD + past)
    creeping = 0
    for periods in (300, 3_000, 30_000, 300_000, 1_000_000):
        x, v, repeat = run(m, *AT_FOLD, periods)
        _, *plain, _ = whole_periods(m, *AT_FOLD, periods)
        assert abs(x - plain[0]) + abs(v - plain[1]) < 1e-12
        assert repeat == 0 or x > 0.28
        creeping += x < 0.0
    assert creeping > 1 and x > 0.28


def test_an_orbit_recorded_once_is_the_orbit_propagated_to_its_end():
    # Recorded from near the orbit by another engine: summary, events and samples.
    periods = set()
    cases = (0.0617, 0.5, 1.4), (0.02, 0.9, 2.2), (0.01, 0.508, 0.511), (0.005, 1.124, 1.126)
    span = {"record_periods": 24, "samples_per_period": 8}
    names = ["displacement_max", "displacement_min", "dynamic_force_max", "fraction_normal"]
    names += ["fraction_min_stiffness", "displacement", "final_state"]
    for damping, first, last in cases:
        pair = GearPair.from_ratios(**PAIR, damping=damping, backlash_damping=damping)
        for nu in np.linspace(first, last, 10):
            once = simulate(pair, nu, periods=3000, **span)
            state = tuple(simulate(pair, nu, periods=2976).final_state.values)
            whole = simulate(OneDegreePair(pair=pair), nu, periods=24, initial_state=state, **span)
            for name in names:
                np.testing.assert_allclose(once[name], whole[name], rtol=0, atol=1e-11)
            phase = 2976 * 2.0 * math.pi + whole.event_phase
            np.testing.assert_allclose(once.event_phase, phase, rtol=0, atol=1e-9)
            # The states before the one recorded period lie where the run has not gone.
            assert simulate(pair, nu, periods=3000, record_periods=1).period == once.period
            periods.add(int(once.period))
    assert {1, 2, 3, 5} <= periods


def plain_period(pair, nu):
    """Return the period of the motion after many periods, none of which is left out."""
    m = mesh_at_tuning(ratios(pair), nu)
    _, x, v, _ = whole_periods(m, 0.0, 0.0, 20_000)
    strobes = [(x, v)]
    for _ in range(2 * orbit.MAX_PERIOD):
        _, x, v, _ = whole_periods(m, x, v, 1)
        strobes.append((x, v))
    return orbit.orbit_period(np.array(strobes), nu, 1.0)


@pytest.mark.parametrize("damping", [0.01, 0.03])
def test_a_period_is_that_of_the_settled_motion(damping):
    # After five revolutions many motions still alternate by more than 1e-6, and less per two.
    pair = GearPair.from_geometry(own(), torque=85.0, damping_ratio=damping)
    span = {"periods": 115, "record_periods": 23}
    tunings = [0.66, *np.linspace(0.5, 1.4, 31)]
    expected = np.array([plain_period(pair, nu) for nu in tunings])
    runs = [simulate(pair, nu, samples_per_period=1, until_settled=True, **span) for nu in tunings]
    single = np.array([int(run.period) for run in runs])
    for periods in (single, sweep(pair, tunings, **span).period.values):
        assert ((periods == expected) | (periods == 0)).all()
    assert (single > 0).mean() > 0.95 and {int(run.followed) for run in runs} - {115}


LIGHT = PAPER.replace(material_damping=600.0, backlash_damping=600.0)


def test_an_orbit_that_draws_nothing_on_is_not_settled_on():
    # From its own state the motion repeats, and goes away with the first disturbance.
    for tuning, pair in ((0.7, PAPER), (1.95, PAPER.replace(material_damping=600.0))):
        pair = OneDegreePair(pair=pair)
        exact = periodic_orbit(pair, tuning, guess=(1.0, 0.0))
        assert np.abs(exact.multipliers[0]) > 1.0 - 1e-6
        run = simulate(pair, tuning, periods=8, initial_state=tuple(exact.state))
        assert int(run.period) == 0

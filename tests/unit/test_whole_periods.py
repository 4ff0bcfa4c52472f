"""Fast runs: whole periods, settled orbits and crossings against engines that take each event."""

import numpy as np
import pytest

from gearlib import GearPair, OneDegreePair, periodic_orbit, simulate, sweep
from gearlib.engines.jit import kernel
from gearlib.engines.pair.events import ARC_COLUMNS, march_period
from gearlib.engines.pair.motion import pair_constants_at_tuning, pair_contact_state
from gearlib.engines.pair.propagator import dimensionless_parameters
from gearlib.engines.pair.whole_periods import (
    advance_periods,
    allocate_workspace,
    prepare_run,
    prepare_workspace,
)
from tests.geometry.stages import own
from tests.paper import PAPER_PAIR
from tests.physics.test_random_meshes import random_mesh

MAX_ARCS = 10**6
PAIR = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash_ratio": 4.0}
#: Tuning and state of the fold at which the small motion of the pair with equal dampings ends, by
#: bisection over runs of a million periods from this state.
FOLD, AT_FOLD = 0.81685037334556, (-0.16062993275504864, -0.3277925734167014)


@kernel
def event_by_event(mesh, x, v, periods):
    """Return (contact, x, v) after a number of mesh periods computed from event to event."""
    no_arcs = np.empty((0, ARC_COLUMNS))
    contact = pair_contact_state(mesh.backlash_ratio, x, v)
    for _ in range(periods):
        contact, x, v, _ = march_period(mesh, contact, x, v, no_arcs, MAX_ARCS)
    return contact, x, v


@kernel
def whole_periods(mesh, x, v, periods):
    """Return (contact, x, v, arcs in the last period) after mesh periods computed as a whole."""
    workspace, no_arcs = allocate_workspace(), np.empty((0, ARC_COLUMNS))
    prepare_workspace(workspace, mesh)
    prepare_run(workspace, x, v)
    contact = pair_contact_state(mesh.backlash_ratio, x, v)
    return advance_periods(mesh, workspace, 0, contact, x, v, periods, MAX_ARCS, no_arcs)


@pytest.mark.parametrize("seed", range(2))
def test_whole_period_steps_match_events_one_by_one(seed):
    """Compare final states of random meshes, within the effect of rounding on the motion."""
    rng, periods = np.random.default_rng(seed), 8
    for _ in range(2000):
        values, tuning, (x, v) = random_mesh(rng)
        mesh = pair_constants_at_tuning(
            dimensionless_parameters(GearPair.from_ratios(**values)), tuning
        )
        _, *end, arcs = whole_periods(mesh, x, v, periods)
        exact = np.array(event_by_event(mesh, x, v, periods)[1:])
        # Starts moved by one part in 1e13, a thousand roundings, show how far rounding changes this
        # motion. Chaotic and undamped motions amplify it by any factor.
        starts = [(x + dx * max(1.0, abs(x)), v) for dx in (1e-13, -1e-13)] + [(x, v + 1e-13)]
        moved = [event_by_event(mesh, *start, periods)[1:] for start in starts]
        spread = np.abs(moved - exact).sum(axis=1).max()
        allowed = 1e-11 * (1.0 + np.abs(exact).sum()) + (10.0 * spread if spread > 1e-11 else 0.0)
        assert arcs <= MAX_ARCS and np.abs(end - exact).sum() <= allowed, (values, tuning, x, v)


@pytest.mark.parametrize("distance", [1e-8, 1e-11])
def test_a_motion_that_creeps_past_a_vanished_orbit_is_not_settled(distance):
    """A motion that slowly passes a vanished orbit must not be reported as periodic."""
    # Just beyond the fold a run moves past the vanished orbit, x = -0.16, by 1e-10 or less in each
    # of up to 1e6 periods, and then goes to another orbit at x > 0.28.
    pair = GearPair.from_ratios(**PAIR, damping=0.0617, backlash_damping=0.0617)
    tuning, creeping_runs = FOLD + distance, 0
    for periods in (300, 3_000, 30_000, 300_000, 1_000_000):
        run = simulate(pair, tuning, periods=periods, initial_state=AT_FOLD)
        _, *exact, _ = whole_periods(
            pair_constants_at_tuning(dimensionless_parameters(pair), tuning), *AT_FOLD, periods
        )
        x, v = run.final_state.values
        assert abs(x - exact[0]) + abs(v - exact[1]) < 1e-12
        assert int(run.period) == 0 or x > 0.28
        creeping_runs += x < 0.0
    assert creeping_runs > 1 and x > 0.28


def test_the_record_of_a_settled_orbit_matches_an_engine_without_shortcut():
    """Compare a settled pair, whose run skips periods, with an engine that computes all of them."""
    # A case is (damping, first tuning, last tuning). The last two ranges have motions of three and
    # five
    # mesh periods.
    cases = (0.0617, 0.5, 1.4), (0.02, 0.9, 2.2), (0.01, 0.508, 0.511), (0.005, 1.124, 1.126)
    span = {"periods": 3000, "record_periods": 24, "samples_per_period": 8}
    names = ["displacement_max", "displacement_min", "dynamic_force_max", "fraction_drive"]
    names += ["fraction_min_stiffness", "displacement", "final_state", "event_phase"]
    periods = set()
    for damping, first_tuning, last_tuning in cases:
        pair = GearPair.from_ratios(**PAIR, damping=damping, backlash_damping=damping)
        for nu in np.linspace(first_tuning, last_tuning, 10):
            settled, full = (
                simulate(single_run, nu, **span) for single_run in (pair, OneDegreePair(pair=pair))
            )
            for name in names:
                atol = 1e-9 if name == "event_phase" else 1e-11
                np.testing.assert_allclose(settled[name], full[name], rtol=0, atol=atol)
            # The period is also reported from one recorded period, although the run skips earlier
            # ones.
            assert simulate(pair, nu, periods=3000, record_periods=1).period == settled.period
            periods.add(int(settled.period))
    assert {1, 2, 3, 5} <= periods


@pytest.mark.parametrize("damping", [0.01, 0.03])
def test_the_reported_period_matches_the_settled_motion(damping):
    """A reported period must match a run of 20,000 periods, or be 0 for unknown."""
    # After five revolutions, 115 mesh periods, many motions differ by more than the tolerance from
    # period to period, but by less over two periods, so that a period of 2 would be reported
    # wrongly.
    pair = GearPair.from_geometry(own(), torque=85.0, damping_ratio=damping)
    span = {"periods": 115, "record_periods": 23}
    tunings = [0.66, *np.linspace(0.5, 1.4, 31)]
    # Another engine computes each of 20,000 mesh periods.
    full = OneDegreePair(pair=pair)
    expected = [int(simulate(full, nu, periods=20_000, record_periods=23).period) for nu in tunings]
    runs = [simulate(pair, nu, samples_per_period=1, until_settled=True, **span) for nu in tunings]
    single = np.array([int(run.period) for run in runs])
    for periods in (single, sweep(pair, tunings, **span).period.values):
        assert ((periods == expected) | (periods == 0)).all()
    # Some single runs continue beyond 115 periods until they settle.
    assert (single > 0).mean() > 0.95 and any(int(run.followed) != 115 for run in runs)


def test_an_orbit_that_does_not_attract_is_not_reported_as_settled():
    """A run on an orbit that does not attract must have the period 0, although it repeats."""
    # The motion from a state on the orbit repeats, but any disturbance persists or grows.
    for tuning, pair in ((0.7, PAPER_PAIR), (1.95, PAPER_PAIR.replace(material_damping=600.0))):
        pair = OneDegreePair(pair=pair)
        exact = periodic_orbit(pair, tuning, guess=(1.0, 0.0))
        assert np.abs(exact.multipliers[0]) > 1.0 - 1e-6
        run = simulate(pair, tuning, periods=8, initial_state=tuple(exact.state))
        assert int(run.period) == 0

"""Compare runs that take whole mesh periods at once with engines that compute each event."""

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
from tests.geometry.stages import documentation_stage
from tests.paper import PAPER_PAIR
from tests.physics.test_random_meshes import random_mesh

MAX_ARCS = 10**6
PAIR_RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash_ratio": 4.0}
#: Tuning and state of the fold at which the small motion of the pair with equal dampings ends, by
#: bisection over runs of a million periods from this state.
FOLD_TUNING, FOLD_STATE = 0.81685037334556, (-0.16062993275504864, -0.3277925734167014)


@kernel
def march_event_by_event(mesh, x, v, periods):
    """Return (contact state, x, v) after mesh periods that are computed from event to event."""
    no_arcs = np.empty((0, ARC_COLUMNS))
    contact = pair_contact_state(mesh.backlash_ratio, x, v)
    for _ in range(periods):
        contact, x, v, _ = march_period(mesh, contact, x, v, no_arcs, MAX_ARCS)
    return contact, x, v


@kernel
def march_whole_periods(mesh, workspace, x, v, periods):
    """Return (contact state, x, v, arc count of the last period) after whole mesh periods."""
    no_arcs = np.empty((0, ARC_COLUMNS))
    prepare_workspace(workspace, mesh)
    prepare_run(workspace, x, v)
    contact = pair_contact_state(mesh.backlash_ratio, x, v)
    return advance_periods(mesh, workspace, 0, contact, x, v, periods, MAX_ARCS, no_arcs)


@pytest.mark.parametrize("seed", range(2))
def test_whole_period_steps_match_events_one_by_one(seed):
    """Final states of random meshes must agree, up to ten times the effect of rounding errors."""
    rng, periods = np.random.default_rng(seed), 8
    for _ in range(2000):
        values, tuning, (x, v) = random_mesh(rng)
        mesh = pair_constants_at_tuning(
            dimensionless_parameters(GearPair.from_ratios(**values)), tuning
        )
        _, *end, arcs = march_whole_periods(mesh, allocate_workspace(), x, v, periods)
        exact = np.array(march_event_by_event(mesh, x, v, periods)[1:])
        # Perturbed initial states show how much the motion amplifies rounding errors, which chaotic
        # and undamped motions do by any factor. A perturbation of 1e-13 is about 1000 roundings.
        dx = 1e-13 * max(1.0, abs(x))
        perturbed_states = [(x + dx, v), (x - dx, v), (x, v + 1e-13)]
        perturbed_ends = [
            march_event_by_event(mesh, *state, periods)[1:] for state in perturbed_states
        ]
        spread = np.abs(perturbed_ends - exact).sum(axis=1).max()
        tolerance = 1e-11 * (1.0 + np.abs(exact).sum())
        if spread > 1e-11:
            tolerance += 10.0 * spread
        assert arcs <= MAX_ARCS and np.abs(end - exact).sum() <= tolerance, (values, tuning, x, v)


@pytest.mark.parametrize("distance", [1e-8, 1e-11])
def test_a_motion_that_slowly_passes_a_vanished_orbit_is_not_settled(distance):
    """A motion that passes the place of a vanished orbit slowly must not be reported as periodic.

    Just beyond the fold, the motion moves by at most 1e-10 per period past the vanished orbit at
    x = -0.16, for up to 1e6 periods. Then it settles on another orbit with x > 0.28.
    """
    pair = GearPair.from_ratios(**PAIR_RATIOS, damping=0.0617, backlash_damping=0.0617)
    tuning, slow_run_count = FOLD_TUNING + distance, 0
    for periods in (300, 3_000, 30_000, 300_000, 1_000_000):
        run = simulate(pair, tuning, periods=periods, initial_state=FOLD_STATE)
        mesh = pair_constants_at_tuning(dimensionless_parameters(pair), tuning)
        _, *exact, _ = march_whole_periods(mesh, allocate_workspace(), *FOLD_STATE, periods)
        x, v = run.final_state.values
        assert abs(x - exact[0]) + abs(v - exact[1]) < 1e-12
        assert int(run.period) == 0 or x > 0.28
        slow_run_count += x < 0.0
    assert slow_run_count > 1 and x > 0.28


def test_the_record_of_a_settled_orbit_matches_an_engine_without_shortcut():
    """A run that skips periods once it has settled must equal one that computes all periods."""
    # A case has the damping ratio and the first and last tuning. The last two ranges have motions
    # that repeat after three and five mesh periods.
    cases = (0.0617, 0.5, 1.4), (0.02, 0.9, 2.2), (0.01, 0.508, 0.511), (0.005, 1.124, 1.126)
    run_options = {"periods": 3000, "record_periods": 24, "samples_per_period": 8}
    names = ["displacement_max", "displacement_min", "dynamic_force_max", "fraction_drive"]
    names += ["fraction_min_stiffness", "displacement", "final_state", "event_phase"]
    periods = set()
    for damping, first_tuning, last_tuning in cases:
        pair = GearPair.from_ratios(**PAIR_RATIOS, damping=damping, backlash_damping=damping)
        for nu in np.linspace(first_tuning, last_tuning, 10):
            run = simulate(pair, nu, **run_options)
            # The engine of this model computes all periods.
            full_run = simulate(OneDegreePair(pair=pair), nu, **run_options)
            for name in names:
                # Phases of events at low velocities are less accurate than displacements.
                atol = 1e-9 if name == "event_phase" else 1e-11
                np.testing.assert_allclose(run[name], full_run[name], rtol=0, atol=atol)
            # The period is also found if only one period is recorded.
            assert simulate(pair, nu, periods=3000, record_periods=1).period == run.period
            periods.add(int(run.period))
    assert {1, 2, 3, 5} <= periods


@pytest.mark.parametrize("damping", [0.01, 0.03])
def test_the_reported_period_matches_the_settled_motion(damping):
    """A period reported after 115 mesh periods must be that after 20,000 ones, or 0 for unknown.

    Many motions of period 1 have not settled after 115 mesh periods (five revolutions): the state
    changes from one period to the next, but by less over two periods. The period 2 would be wrong.
    """
    pair = GearPair.from_geometry(documentation_stage(), torque=85.0, damping_ratio=damping)
    run_options = {"periods": 115, "record_periods": 23}
    tunings = [0.66, *np.linspace(0.5, 1.4, 31)]
    # The engine of this model computes each of the 20,000 mesh periods.
    one_degree_pair = OneDegreePair(pair=pair)
    long_run = {"periods": 20_000, "record_periods": 23}
    expected = [int(simulate(one_degree_pair, nu, **long_run).period) for nu in tunings]
    runs = [
        simulate(pair, nu, samples_per_period=1, until_settled=True, **run_options)
        for nu in tunings
    ]
    periods_of_runs = np.array([int(run.period) for run in runs])
    for periods in (periods_of_runs, sweep(pair, tunings, **run_options).period.values):
        assert ((periods == expected) | (periods == 0)).all()
    # Runs with `until_settled` may continue beyond 115 periods.
    assert (periods_of_runs > 0).mean() > 0.95
    assert any(int(run.followed) != 115 for run in runs)


def test_an_orbit_that_does_not_attract_is_not_reported_as_settled():
    """A run on an orbit that does not attract must have the period 0 (unknown).

    Its motion repeats, but a perturbation would persist or grow.
    """
    for tuning, pair in ((0.7, PAPER_PAIR), (1.95, PAPER_PAIR.replace(material_damping=600.0))):
        pair = OneDegreePair(pair=pair)
        orbit = periodic_orbit(pair, tuning, guess=(1.0, 0.0))
        assert np.abs(orbit.multipliers[0]) > 1.0 - 1e-6
        run = simulate(pair, tuning, periods=8, initial_state=tuple(orbit.state))
        assert int(run.period) == 0

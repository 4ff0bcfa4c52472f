"""Compare attractors, basins, sections and exponents with event-by-event runs and exact orbits."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import GearPair, OneDegreePair, basins, periodic_orbit, simulate, sweep
from gearlib.analysis.global_dynamics.attractors import CHAOTIC, PERIODIC, UNBOUNDED, UNDECIDED
from gearlib.analysis.global_dynamics.stroboscope import Stroboscope
from gearlib.engines.pair.motion import pair_constants_at_tuning
from gearlib.engines.pair.propagator import dimensionless_parameters
from tests.paper import PAPER_PAIR
from tests.unit.test_whole_periods import march_event_by_event


def gear_pair(damping, free_flight_damping=None, backlash_ratio=4.0, **ratios):
    """Return a pair with given damping ratios in contact and in free flight.

    If `free_flight_damping` is None, both are equal. `ratios` replace the contact ratio and the
    stiffness ratio of the paper's pair.
    """
    if free_flight_damping is None:
        free_flight_damping = damping
    ratios = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879} | ratios
    return GearPair.from_ratios(
        **ratios,
        damping=damping,
        backlash_damping=free_flight_damping,
        backlash_ratio=backlash_ratio,
    )


#: The damping of the paper, in contact only. Three orbits of period 1 exist at the tuning 0.72.
DAMPED_IN_CONTACT = gear_pair(0.0617, 0.0)
DAMPED_PAIR = gear_pair(0.0617)
LIGHTLY_DAMPED_PAIR = gear_pair(0.02)
STATE_RANGE = (-6.0, 6.0)


def state_grid(count):
    """Return (start, stop, count) of initial displacements and of velocities."""
    return (*STATE_RANGE, count), (*STATE_RANGE, count)


@pytest.mark.parametrize(
    ("pair", "tuning", "periods"),
    [(DAMPED_IN_CONTACT, 0.72, 1), (DAMPED_PAIR, 1.75, 2), (LIGHTLY_DAMPED_PAIR, 2.05, 3)],
)
def test_basins_match_runs_event_by_event(pair, tuning, periods):
    """The attractor of each initial state must be the one that an event-by-event run reaches."""
    result = basins(pair, tuning, state_grid(17))
    states = np.stack(np.meshgrid(result.displacement, result.velocity, indexing="ij"), axis=-1)
    # After 600 periods all runs have settled: perturbations decay by exp(-0.03) per period or more.
    scaled_mesh = pair_constants_at_tuning(dimensionless_parameters(pair), tuning)
    final_states = np.array(
        [march_event_by_event(scaled_mesh, x, v, 600)[1:] for x, v in states.reshape(-1, 2)]
    )
    distances = np.linalg.norm(final_states[:, None, None] - result.state.values, axis=-1)
    nearest = np.where(np.isnan(distances), np.inf, distances).min(axis=2)
    assert (nearest.min(axis=1) < 1e-6).all()
    np.testing.assert_array_equal(nearest.argmin(axis=1), result.basin.values.ravel())
    # Each point of the orbit with the longest period must lie in its basin and be mapped to the
    # next point.
    longest_attractor = int(np.argmax(result.period.values))
    assert result.period[longest_attractor] == periods
    points = result.state.values[longest_attractor, :periods]
    for x, v in points:
        assert int(basins(pair, tuning, ([x], [v])).period[0]) == periods
        run = sweep(pair, [tuning], periods=64, record_periods=16, initial_state=(x, v))
        assert int(run.period[0]) == periods
    final_states, _ = Stroboscope(pair, tuning)(points, 1)
    np.testing.assert_allclose(final_states, np.roll(points, -1, axis=0), atol=1e-11)


def test_chaotic_and_unbounded_motions_are_classified():
    """Attractors must be classified as chaotic, periodic or unbounded."""
    lightly_damped = gear_pair(
        damping=0.0164, backlash_ratio=7.2, contact_ratio=1.6, stiffness_ratio=0.35
    )
    result = basins(lightly_damped, 0.44, state_grid(4), periods=200)
    assert result.attractor_kind.values.tolist() == [CHAOTIC] and result.exponent[0] > 0.5
    # In the instability tongue at twice the natural frequency, large motions grow without bound and
    # small ones settle.
    result = basins(LIGHTLY_DAMPED_PAIR, 1.9, state_grid(8))
    assert result.attractor_kind.values.tolist() == [PERIODIC, UNBOUNDED]
    run = sweep(
        LIGHTLY_DAMPED_PAIR, [1.9], periods=4000, record_periods=1, initial_state=(6.0, -6.0)
    )
    assert (result.basin.values == 1).mean() > 0.3 and result.basin.values[-1, 0] == 1
    assert abs(run.final_state).max() > 1e9 or int(run.status[0]) != 0


def test_contact_without_damping_has_no_attractor():
    pair = PAPER_PAIR.replace(stiffness_ratio=1.0, backlash_damping=3000.0)
    data = basins(pair, 1.0, ([-1.0, 0.5], [0.0]))
    assert data.attractor_kind.values.tolist() == [UNDECIDED]


def test_lyapunov_exponents_match_the_multipliers():
    """The exponent of a periodic orbit must be the logarithm of its multiplier per mesh period."""
    tunings = np.array([0.62, 0.66, 0.7, 1.0, 1.2])
    diagram = gearlib.bifurcation_diagram(LIGHTLY_DAMPED_PAIR, tunings)
    states, periods = diagram.final_state.values, 4000
    result = gearlib.lyapunov_exponents(
        LIGHTLY_DAMPED_PAIR, tunings, states=states, periods=periods
    )
    for nu, exponent, state, period in zip(
        tunings, result.exponent, states, diagram.period, strict=True
    ):
        orbit = periodic_orbit(LIGHTLY_DAMPED_PAIR, nu, guess=state, period=int(period))
        expected = np.log(np.abs(orbit.multipliers).max()) / orbit.period
        # The direction of the initial perturbation changes the total growth by a bounded factor,
        # here up to exp(3).
        assert float(exponent) == pytest.approx(expected, abs=3.0 / periods)


def test_poincare_sections_match_samples_of_the_time_course():
    """A section at a phase must equal the samples of a time history at this phase."""
    state, nu, samples = (0.3, 0.2), 0.9, 8
    run = simulate(
        DAMPED_PAIR,
        nu,
        periods=30,
        record_periods=10,
        samples_per_period=samples,
        initial_state=state,
    )
    for sample in (0, 3):
        phase = 2.0 * math.pi * sample / samples
        for pair in (DAMPED_PAIR, OneDegreePair(pair=DAMPED_PAIR)):
            section = gearlib.poincare_section(
                pair, nu, [state], periods=10, settle=20, phase=phase
            )
            for name in ("displacement", "velocity"):
                expected = run[name][sample::samples]
                np.testing.assert_allclose(section[name][0], expected, atol=1e-10)
            np.testing.assert_allclose(section.final_state[0], run.final_state, atol=1e-10)


def test_a_bifurcation_diagram_matches_the_sweep():
    """A bifurcation diagram must agree with a sweep with the same number of periods per tuning."""
    tunings = np.linspace(0.6, 1.0, 41)
    for direction in ("up", "down"):
        diagram = gearlib.bifurcation_diagram(
            DAMPED_PAIR, tunings, direction=direction, settle=200, strobes=40
        )
        curve = sweep(DAMPED_PAIR, tunings, periods=240, record_periods=40, direction=direction)
        np.testing.assert_array_equal(diagram.period, curve.period)
        np.testing.assert_allclose(diagram.final_state, curve.final_state, atol=1e-9)


def test_basin_stability_matches_a_fine_grid():
    """Basin stabilities from 400 random states must agree with a fine grid within three errors."""
    tunings = [0.74, 0.75, 0.76, 1.2]
    stability = gearlib.basin_stability(
        DAMPED_PAIR, tunings, (STATE_RANGE, STATE_RANGE), samples=400, seed=1
    )
    np.testing.assert_allclose(stability.share.sum("attractor_family"), 1.0)
    # There are two attractors at the first three tunings and one at the last.
    np.testing.assert_allclose((stability.share > 0).sum("attractor_family"), [2, 2, 2, 1])
    exact = basins(DAMPED_PAIR, 0.75, state_grid(80))
    for family in range(2):
        family_result = stability.isel(attractor_family=family).sel(tuning=0.75)
        error = 3.0 * float(family_result.share_error)
        assert float(family_result.share) == pytest.approx(float(exact.share[family]), abs=error)
        assert float(family_result.displacement_max) == pytest.approx(
            float(exact.displacement_max[family])
        )
    repeated = gearlib.basin_stability(
        DAMPED_PAIR, tunings, (STATE_RANGE, STATE_RANGE), samples=400, seed=1
    )
    assert stability.identical(repeated)

"""Records of an orbit: summary, events, samples, period; growth of a perturbation."""

import math

import numpy as np
import pytest

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.linear.periods import EVENT_COLUMNS, EVENT_MESH, sort_last_event
from gearlib.engines.matrices import propagate_perturbation
from gearlib.engines.polynomial import WORKSPACE_ROWS, bernstein_matrix


def test_a_summary_collects_extrema_times_and_events():
    """Add two parabolas, three durations and two events with known results."""
    summary, work = np.empty(orbit.SUMMARY_COLUMNS), np.empty((WORKSPACE_ROWS, 4))
    orbit.clear_summary(summary)
    for shift in (1.0, -2.0):
        # The curve is s - s^2 + shift.
        curve = np.array([shift, 1.0, -1.0])
        extrema = orbit.X_MAX, orbit.X_MIN
        orbit.add_polynomial_extrema(curve, bernstein_matrix(2), work, summary, *extrema)
    times = {(DRIVE, True): 0.5, (COAST, False): 0.25, (NO_CONTACT, True): 2.0}
    for (code, below_mean), duration in times.items():
        orbit.add_contact_time(code, duration, below_mean, summary)
    for codes in ((DRIVE, NO_CONTACT), (NO_CONTACT, DRIVE)):
        orbit.count_event(*codes, -1.0, summary)
    assert not orbit.has_unresolved_extremum(summary)
    # The columns are extrema of displacement and force, times of each contact and of low stiffness,
    # the number of bounces and a sum.
    expected = [1.25, -2.0, 0.0, 0.0, 0.5, 2.0, 0.25, 0.5, 1.0, 0.0]
    np.testing.assert_allclose(summary, expected, atol=1e-15)
    summary[orbit.FORCE_MIN] = math.nan
    assert orbit.has_unresolved_extremum(summary)


def test_events_are_appended_and_repeated_with_their_samples():
    """Repeat two recorded periods of a settled motion up to six periods."""
    events, summary, count = np.empty((1, 5)), np.zeros(orbit.SUMMARY_COLUMNS), 0
    rows = [(5, 0.5, 1, 0, -0.1), (5, 1.5, 0, 1, 0.2), (6, 0.25, 1, 0, -0.3)]
    for row in rows:
        events, count = orbit.record_event(events, count, *row, summary)
    samples = np.arange(12.0).reshape(6, 2)  # one in each mesh period
    events, count = orbit.repeat_record(samples, events, count, 2, 6)
    expected = [(period + k, *rest) for k in (0, 2, 4) for period, *rest in rows]
    np.testing.assert_array_equal(events[:count], expected)
    np.testing.assert_array_equal(samples, np.tile([[0.0, 1.0], [2.0, 3.0]], (3, 1)))
    assert summary[orbit.BOUNCES] == 2.0
    assert orbit.record_event(np.empty((0, 5)), 0, *rows[0], summary)[1] == 0


def test_events_at_one_phase_are_sorted_by_mesh():
    """Sorting event by event must give the order of `sorted`, by phase and then by mesh."""
    rng, rows = np.random.default_rng(0), np.zeros((40, EVENT_COLUMNS))
    rows[:, orbit.EVENT_PHASE] = np.sort(rng.integers(0, 6, 40))
    rows[:, EVENT_MESH] = rng.integers(0, 9, 40)
    expected = [*rows[:3].tolist(), *sorted(rows[3:].tolist())]
    for row in range(3, 40):
        sort_last_event(rows, row, 3)
    np.testing.assert_array_equal(rows, expected)


@pytest.mark.parametrize("component", [0, 1])
def test_a_motion_repeats_only_if_displacement_and_velocity_both_repeat(component):
    """Add a drift to one component: the motion then has no period."""
    tuning, displacement_range = 0.9, 1.0
    for period in (1, 2, 3, 5, 16):
        strobes = np.zeros((32, 2))  # displacement and velocity once in a mesh period
        strobes[:, component] = np.arange(32) % period
        assert orbit.orbit_period(strobes, tuning, displacement_range) == period
        strobes[:, component] += np.arange(32)
        assert orbit.orbit_period(strobes, tuning, displacement_range) == 0


def test_a_perturbation_grows_with_the_largest_multiplier():
    """A perturbation must grow per map by the largest eigenvalue, 2, and vanish for zero maps."""
    maps, logarithms = np.tile(np.diag([2.0, 0.5]), (60, 1, 1)), np.empty(60)
    perturbation = np.array([1.0, 1.0])
    assert propagate_perturbation(maps, np.array([1.0, 3.0]), perturbation, logarithms)
    assert logarithms[-1] == pytest.approx(math.log(2.0), rel=1e-12)
    assert not propagate_perturbation(0.0 * maps, np.ones(2), perturbation, logarithms)

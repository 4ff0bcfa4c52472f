"""Check records of an orbit: summary, events, samples and period; growth of a perturbation."""

import math

import numpy as np
import pytest

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.linear.periods import EVENT_COLUMNS, EVENT_MESH, sort_last_event
from gearlib.engines.matrices import propagate_perturbation
from gearlib.engines.polynomial import WORKSPACE_ROWS, bernstein_matrix


def test_a_summary_collects_extrema_times_and_events():
    """Two parabolas, three contact times and two events must give the known statistics."""
    summary, workspace = np.empty(orbit.SUMMARY_COLUMNS), np.empty((WORKSPACE_ROWS, 4))
    orbit.clear_summary(summary)
    for shift in (1.0, -2.0):
        # The curve is s - s^2 + shift.
        curve = np.array([shift, 1.0, -1.0])
        extrema = orbit.X_MAX, orbit.X_MIN
        orbit.add_polynomial_extrema(curve, bernstein_matrix(2), workspace, summary, *extrema)
    # Contact states, and whether the stiffness is below its mean, with durations.
    durations = {(DRIVE, True): 0.5, (COAST, False): 0.25, (NO_CONTACT, True): 2.0}
    for (contact, is_below_mean), duration in durations.items():
        orbit.add_contact_time(contact, duration, is_below_mean, summary)
    for contact_before, contact_after in ((DRIVE, NO_CONTACT), (NO_CONTACT, DRIVE)):
        orbit.count_event(contact_before, contact_after, -1.0, summary)
    assert not orbit.has_unresolved_extremum(summary)
    # The columns are extrema of displacement and force, times of drive, no and coast contact and of
    # low stiffness, the number of bounces and a sum.
    expected = [1.25, -2.0, 0.0, 0.0, 0.5, 2.0, 0.25, 0.5, 1.0, 0.0]
    np.testing.assert_allclose(summary, expected, atol=1e-15)
    summary[orbit.FORCE_MIN] = math.nan
    assert orbit.has_unresolved_extremum(summary)


def test_events_are_appended_and_repeated_with_their_samples():
    """The record of two mesh periods must be repeated three times up to six periods."""
    events, summary, count = np.empty((1, 5)), np.zeros(orbit.SUMMARY_COLUMNS), 0
    # Mesh period, phase, contact states before and after, velocity.
    recorded_events = [(5, 0.5, 1, 0, -0.1), (5, 1.5, 0, 1, 0.2), (6, 0.25, 1, 0, -0.3)]
    for event in recorded_events:
        events, count = orbit.record_event(events, count, *event, summary)
    samples = np.arange(12.0).reshape(6, 2)  # one in each mesh period
    recorded_periods, all_periods = 2, 6
    events = orbit.repeat_record(samples, events[:count], recorded_periods, all_periods)
    expected_events = [
        (period + shift, *values)
        for shift in range(0, all_periods, recorded_periods)
        for period, *values in recorded_events
    ]
    np.testing.assert_array_equal(events, expected_events)
    np.testing.assert_array_equal(samples, np.tile([[0.0, 1.0], [2.0, 3.0]], (3, 1)))
    # A record without samples still has events.
    without_samples = orbit.repeat_record(np.empty((0, 2)), events, all_periods, 2 * all_periods)
    assert len(without_samples) == 2 * len(events)
    assert summary[orbit.BOUNCES] == 2.0
    # An array without rows means that events are not recorded.
    _, count = orbit.record_event(np.empty((0, 5)), 0, *recorded_events[0], summary)
    assert count == 0


def test_events_at_one_phase_are_sorted_by_mesh():
    """Sorting each new event must order all events of a period by phase and then by mesh.

    The first three events belong to earlier periods and must keep their order.
    """
    event_count, earlier_count = 40, 3
    rng, events = np.random.default_rng(0), np.zeros((event_count, EVENT_COLUMNS))
    events[:, orbit.EVENT_PHASE] = np.sort(rng.integers(0, 6, event_count))
    events[:, EVENT_MESH] = rng.integers(0, 9, event_count)
    expected = [*events[:earlier_count].tolist(), *sorted(events[earlier_count:].tolist())]
    for row in range(earlier_count, event_count):
        sort_last_event(events, row, earlier_count)
    np.testing.assert_array_equal(events, expected)


@pytest.mark.parametrize("component", [0, 1])
def test_a_motion_repeats_only_if_displacement_and_velocity_both_repeat(component):
    """The period of a motion must be found, and be 0 if displacement or velocity drifts."""
    tuning, displacement_range, mesh_periods = 0.9, 1.0, np.arange(32)
    for period in (1, 2, 3, 5, 16):
        # Displacement and velocity at the start of each mesh period.
        states = np.zeros((mesh_periods.size, 2))
        states[:, component] = mesh_periods % period
        assert orbit.orbit_period(states, tuning, displacement_range) == period
        states[:, component] += mesh_periods
        assert orbit.orbit_period(states, tuning, displacement_range) == 0


def test_a_perturbation_grows_with_the_largest_multiplier():
    """Each map must multiply a perturbation by its largest eigenvalue, 2, after many maps.

    A perturbation that vanishes must be reported.
    """
    map_count, largest_eigenvalue = 60, 2.0
    maps = np.tile(np.diag([largest_eigenvalue, 0.5]), (map_count, 1, 1))
    perturbation, log_growths = np.array([1.0, 1.0]), np.empty(map_count)
    weights = np.array([1.0, 3.0])
    assert propagate_perturbation(maps, weights, perturbation, log_growths)
    assert log_growths[-1] == pytest.approx(math.log(largest_eigenvalue), rel=1e-12)
    assert not propagate_perturbation(0.0 * maps, np.ones(2), perturbation, log_growths)

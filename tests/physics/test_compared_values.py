"""Compare the quantities that fits use with references in 50 digits and numpy's least squares."""

import mpmath as mp
import numpy as np
import pytest

import gearlib
from gearlib.uncertainty import observation
from gearlib.uncertainty.observation import Channel
from tests.independent import differences
from tests.independent.systems import describe, system_of
from tests.physics.test_fits import TRUE_PAIR

#: Largest relative difference.
RELATIVE_TOLERANCE = 1e-9


def test_statistics_of_an_orbit_match_the_independent_program_in_50_digits():
    """Statistics of an orbit with contact loss must equal those of a second code in 50 digits."""
    # Sweeping down reaches the upper branch, where contact is lost.
    tunings = np.linspace(0.7, 1.0, 8)
    run = gearlib.sweep(TRUE_PAIR, tunings, periods=300, record_periods=1, direction="down")
    speed, state = float(run.speed[0]), run.final_state.values[0]
    quantities = observation.orbit_quantities(TRUE_PAIR, speed, state)
    assert quantities["displacement_min"] < 0.0
    with mp.workdps(50):
        pair = describe(TRUE_PAIR)
        nu = mp.mpf(speed) * mp.pi * pair["teeth"] / 30 / system_of(pair, 1.0, mp).speed
        orbit_state, _ = differences.orbit_of(pair, nu, period=1, guess=state)
        system = system_of(pair, nu, mp)
        table = differences.compute_variables(pair, nu, periods=1, state=orbit_state)
        # The second code has displacements in static deflections and forces in units of the load.
        scale = {"displacement": system.length, "dynamic": system.length * system.force}
        for name in observation.STATISTICS:
            reference_value = float(table[name][0] * scale.get(name.partition("_")[0], 1))
            predicted_value = observation.mesh_quantity(quantities, name, mesh=0)
            assert predicted_value == pytest.approx(
                reference_value, rel=RELATIVE_TOLERANCE, abs=1e-30
            ), name


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("offset", [False, True])
def test_gain_and_offset_of_a_sensor_match_least_squares_of_numpy(gain, offset):
    """Residuals with eliminated gain and offset must be those of a linear least-squares problem."""
    rng = np.random.default_rng(5)
    measured, predicted = rng.normal(size=(2, 12))
    deviations = rng.uniform(0.5, 2.0, 12)
    channel = Channel(
        "x", measured, deviations, noise_known=True, unknown_gain=gain, unknown_offset=offset
    )
    residuals = (channel.signal_and_gain(predicted)[0] - measured) / deviations
    # All equations are divided by the standard deviation of their measured value.
    weighted_measured, weighted_predicted = measured / deviations, predicted / deviations
    columns = [np.zeros(12)]
    if gain:
        target = weighted_measured
        columns.append(weighted_predicted)
    else:
        target = weighted_measured - weighted_predicted
    if offset:
        columns.append(1.0 / deviations)
    matrix = np.column_stack(columns)
    expected_residuals = matrix @ np.linalg.lstsq(matrix, target, rcond=None)[0] - target
    assert (
        np.abs(residuals - expected_residuals).max()
        < RELATIVE_TOLERANCE * np.abs(expected_residuals).max()
    )

"""Fit models to synthetic time histories of run-ups, with gaps and unknown phases."""

import json
import re

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline

import gearlib
from gearlib.analysis.order_maps import ShaftRotation
from gearlib.uncertainty.course_observations import _compared_revolutions, regress_mesh_orders
from gearlib.uncertainty.observations import make_observations
from tests.paper import PAPER_PAIR

TRUE_PAIR = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
PARAMETER_BOUNDS = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7)}
INITIAL_GUESS = TRUE_PAIR.replace(material_damping=5000.0, reduced_mass=3.0)
START_SPEED, END_SPEED = TRUE_PAIR.speed(0.6), TRUE_PAIR.speed(0.75)


def measured_run_up(start, seed, gain=1.0, rate=20e3, **known):
    """Return a synthetic measurement of a run-up, with 5 % noise, an offset and an eccentricity.

    `start` is the mesh phase at the beginning, rad. `gain` is the gain of the sensor and `rate` its
    sampling rate, Hz. The known quantities, i.e. the speed course and `known`, are stored as JSON.
    """
    duration, periods_per_revolution = 0.6, 24.0
    # The simulation begins earlier, at constant speed, to reach the phase `start` at the beginning.
    mesh_periods_before = start / (2.0 * np.pi) + 1.0
    time_before = mesh_periods_before / periods_per_revolution / (START_SPEED / 60.0)
    speed = [(0.0, START_SPEED), (time_before, START_SPEED), (time_before + duration, END_SPEED)]
    known["course"] = [(0.0, START_SPEED), (duration, END_SPEED)]
    run = gearlib.run_up(TRUE_PAIR, speed=speed, samples_per_period=128)
    times = np.arange(0.0, duration, 1.0 / rate)
    signal = CubicSpline(run.time.values, run.displacement.values)(times + time_before)
    rng = np.random.default_rng(seed)
    noise_deviation, signal_range = 0.05 * signal.std(), np.ptp(signal)
    values = signal + rng.normal(0.0, noise_deviation, signal.size) + 0.3 * signal_range
    # The eccentricity of the shaft adds a wave with the period of a revolution.
    revolutions = ShaftRotation(known["course"]).revolutions(times)
    values += signal_range * np.cos(2.0 * np.pi * revolutions + 1.0)
    attrs = {"units": "m", "noise_std": gain * noise_deviation, "unknown_gain": int(gain != 1.0)}
    data = xr.Dataset(
        {"displacement": ("sample", gain * values, attrs)}, {"time": ("sample", times)}
    )
    return data.assign_attrs(known=json.dumps(known))


def weighted_residuals(model, data):
    """Return the differences of measured and predicted orders, divided by standard deviations."""
    return make_observations(model, data)[0].residuals(model)


def test_too_few_samples_in_a_mesh_period_are_refused():
    with pytest.raises(ValueError, match="5.75 samples in a mesh period.* of 10 or more"):
        weighted_residuals(TRUE_PAIR, measured_run_up(0.0, seed=1, rate=7e3))


def test_orders_of_a_growing_wave_match_its_fourier_integrals():
    """Orders of a wave with linearly growing amplitude must equal its Fourier integrals.

    They are the integrals of (1 + r / 5) cos(2 pi 24 r) e^{-2 pi i 24 r} over each revolution r.
    """
    samples_per_revolution, teeth = 500, 24
    revolutions = (np.arange(3 * samples_per_revolution + 2) + 0.3) / samples_per_revolution
    signal = (1.0 + 0.2 * revolutions) * np.cos(2.0 * np.pi * teeth * revolutions)
    orders = regress_mesh_orders(revolutions, signal, np.arange(4), teeth)[0]
    integrals = 0.5 * (1.1 + 0.2 * np.arange(3)) + 0.05j / (2.0 * np.pi * teeth)
    # The regression approximates these integrals.
    np.testing.assert_allclose(orders[:, 0], integrals, rtol=0, atol=3e-5)


def assert_fit_recovers_truth(result):
    """Assert that a fit agrees with noise and with the true values within four standard errors."""
    assert 0.6 < result.redchi < 1.4 and not result.unknown
    for name, parameter in result.params.items():
        assert abs(parameter.value - getattr(TRUE_PAIR, name)) < 4.0 * parameter.stderr, name


def test_a_run_up_from_a_known_phase_determines_the_parameters():
    """With a known initial mesh phase a fit must recover the truth; a wrong phase must not fit.

    The wave of the eccentricity, which is as large as the signal, must not count as noise: with the
    right phase, the reduced chi-square must be near 1.
    """
    phase = 4.0
    result = gearlib.fit(
        INITIAL_GUESS, measured_run_up(phase, seed=2, gain=2.0, phase=phase), PARAMETER_BOUNDS
    )
    assert_fit_recovers_truth(result)
    for name, parameter in result.params.items():
        assert parameter.stderr < 0.02 * parameter.value, name
    right_residuals, wrong_residuals = (
        weighted_residuals(TRUE_PAIR, measured_run_up(phase, seed=2, rate=13e3, phase=stated_phase))
        for stated_phase in (phase, phase + 1.0)
    )
    chi_square = right_residuals @ right_residuals
    assert wrong_residuals @ wrong_residuals > 100.0 * chi_square
    assert 0.6 < chi_square / right_residuals.size < 1.4


def test_a_fit_omits_revolutions_with_gaps():
    """Revolutions with missing samples must be omitted with a warning and not affect the fit."""
    data = measured_run_up(0.0, seed=2)
    gap = (data.time > 0.25) & (data.time < 0.27)
    for data_with_gap in (data.isel(sample=~gap.values), data.where(~gap)):
        with pytest.warns(UserWarning, match="2 of 21 revolutions of the run-up are left out"):
            assert_fit_recovers_truth(gearlib.fit(INITIAL_GUESS, data_with_gap, PARAMETER_BOUNDS))
    with pytest.raises(ValueError, match="time = 'of 21 revolutions with gaps' is not allowed"):
        gearlib.fit(
            INITIAL_GUESS, data.isel(sample=data.time.values % 0.02 > 0.003), PARAMETER_BOUNDS
        )


@pytest.mark.parametrize(
    ("contact_ratio", "noise_factor", "pattern"),
    # The reduced chi-square is 1.5, or 0.35 if the stated noise is six times too large.
    [(1.565, 1.0, "a chi-square of .* with 167 degrees"), (1.55, 6.0, "it changes sign 41 times")],
)
def test_a_fit_reports_a_model_that_does_not_describe_data_of_known_noise(
    contact_ratio, noise_factor, pattern
):
    """A wrong contact ratio must be detected by chi-square or by the sign changes of residuals.

    Sign changes detect it if the stated noise is too large.
    """
    data = measured_run_up(0.0, seed=2)
    data.displacement.attrs["noise_std"] *= noise_factor
    wrong_model = TRUE_PAIR.replace(contact_ratio=contact_ratio, reduced_mass=3.1)
    result = gearlib.fit(wrong_model, data, {"reduced_mass": PARAMETER_BOUNDS["reduced_mass"]})
    (message,) = result.unknown
    assert result.redchi < 2.0 and re.search(pattern, message)


def test_a_run_up_whose_jumps_leave_no_whole_revolution_is_refused():
    """A run-up must be refused if all its revolutions lie within 24 revolutions after a jump."""
    data = measured_run_up(0.0, seed=2)
    # From 0.24 s the amplitude is three times as large, like that of another motion.
    data["displacement"] = data.displacement.where(data.time < 0.24, 3.0 * data.displacement)
    with pytest.raises(ValueError, match="time = 'of 27 rev.* jumps in 10' is.* 24 after a jump"):
        weighted_residuals(TRUE_PAIR, data)


def test_a_step_in_the_first_revolutions_hides_no_later_jump():
    """A jump at revolution 80 must be found, although a larger step precedes it at revolution 3.

    The first three revolutions are not compared, and must not affect the search for jumps.
    """
    revolution_count, jump = 160, 80
    orders = np.ones((revolution_count, 3), complex)
    orders[3:] *= 20.0
    orders[jump:] /= 5.0
    _, _, jumps = _compared_revolutions(orders, np.ones(revolution_count))
    assert jumps == [jump]

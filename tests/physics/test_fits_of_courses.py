"""Fits to time courses of synthetic rigs: samples at any times, shafts at any phase."""

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

TRUTH = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
FREE = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7)}
GUESS = TRUTH.replace(material_damping=5000.0, reduced_mass=3.0)
LOW, HIGH = TRUTH.speed(0.6), TRUTH.speed(0.75)


def run_up(start, seed, gain=1.0, rate=20e3, **known):
    """Return a run-up from LOW to HIGH as a sensor records it, with noise of 5 % and an offset.

    `start` is the mesh phase at its beginning, `gain` the gain of the sensor and `rate` its number
    of samples a second. The eccentricity of the shaft adds a wave over each revolution. The facts
    that the fit may use, such as the speed course and `known` ones, are stored as JSON.
    """
    # Before the ramp the speed is constant for one mesh period and the fraction that leads to the
    # phase `start`; there are 24 mesh periods in a revolution.
    wait = (start / (2.0 * np.pi) + 1.0) / 24.0 / (LOW / 60.0)
    speed = [(0.0, LOW), (wait, LOW), (wait + 0.6, HIGH)]
    known["course"] = [(0.0, LOW), (0.6, HIGH)]
    run = gearlib.run_up(TRUTH, speed=speed, samples_per_period=128)
    times = np.arange(0.0, 0.6, 1.0 / rate)
    signal = CubicSpline(run.time.values, run.displacement.values)(times + wait)
    turns = ShaftRotation(known["course"]).revolutions(times)
    rng, noise_deviation, signal_range = (
        np.random.default_rng(seed),
        0.05 * signal.std(),
        np.ptp(signal),
    )
    values = signal + rng.normal(0.0, noise_deviation, signal.size) + 0.3 * signal_range
    values += signal_range * np.cos(2.0 * np.pi * turns + 1.0)
    attrs = {"units": "m", "noise_std": gain * noise_deviation, "unknown_gain": int(gain != 1.0)}
    data = xr.Dataset(
        {"displacement": ("sample", gain * values, attrs)}, {"time": ("sample", times)}
    )
    return data.assign_attrs(known=json.dumps(known))


def residuals(model, data):
    """Return differences of measured and predicted orders over their standard deviations."""
    return make_observations(model, data)[0].residuals(model)


def test_too_few_samples_in_a_mesh_period_are_refused():
    with pytest.raises(ValueError, match="5.75 samples in a mesh period.* of 10 or more"):
        residuals(TRUTH, run_up(0.0, seed=1, rate=7e3))


def test_orders_of_a_growing_wave_match_its_fourier_integrals():
    """Compare order amplitudes of a linearly growing wave with its Fourier integrals per turn."""
    turns = (np.arange(3 * 500 + 2) + 0.3) / 500.0
    signal = (1.0 + 0.2 * turns) * np.cos(2.0 * np.pi * 24.0 * turns)
    orders = regress_mesh_orders(turns, signal, np.arange(4), 24)[0]
    # The closed form is the integral of (1 + t / 5) cos(2 pi 24 t) e^{-2 pi i 24 t} over a turn.
    integrals = 0.5 * (1.1 + 0.2 * np.arange(3)) + 0.05j / (2.0 * np.pi * 24.0)
    np.testing.assert_allclose(orders[:, 0], integrals, rtol=0, atol=3e-5)


def assert_fit_recovers_truth(result):
    """Assert that a fit explains the data within noise and errs by at most four standard errors."""
    assert 0.6 < result.redchi < 1.4 and not result.unknown
    for name, parameter in result.params.items():
        assert abs(parameter.value - getattr(TRUTH, name)) < 4.0 * parameter.stderr, name


def test_a_run_up_from_a_known_phase_determines_the_parameters():
    """Fit a run-up whose initial mesh phase (rad) is known; a wrong phase must not fit."""
    phase = 4.0
    result = gearlib.fit(GUESS, run_up(phase, seed=2, gain=2.0, phase=phase), FREE)
    assert_fit_recovers_truth(result)
    for name, parameter in result.params.items():
        assert parameter.stderr < 0.02 * parameter.value, name
    # A wrong phase must not fit. With the right one the chi-square is near 1, so the wave of the
    # eccentricity, as large as the signal, is not taken for noise.
    right = residuals(TRUTH, run_up(phase, seed=2, rate=13e3, phase=phase))
    wrong = residuals(TRUTH, run_up(phase, seed=2, rate=13e3, phase=phase + 1.0))
    assert wrong @ wrong > 100.0 * (right @ right)
    assert 0.6 < right @ right / right.size < 1.4


def test_a_fit_omits_revolutions_with_gaps():
    """Revolutions with missing samples must be left out with a warning and not spoil the fit."""
    data = run_up(0.0, seed=2)
    gap = (data.time > 0.25) & (data.time < 0.27)
    for data_with_gap in (data.isel(sample=~gap.values), data.where(~gap)):
        with pytest.warns(UserWarning, match="2 of 21 revolutions of the run-up are left out"):
            assert_fit_recovers_truth(gearlib.fit(GUESS, data_with_gap, FREE))
    with pytest.raises(ValueError, match="time = 'of 21 revolutions with gaps' is not allowed"):
        gearlib.fit(GUESS, data.isel(sample=data.time.values % 0.02 > 0.003), FREE)


@pytest.mark.parametrize(
    ("contact_ratio", "stated_noise", "words"),
    # The reduced chi-square is 1.5, and 0.35 where the noise is stated six times too large.
    [(1.565, 1.0, "a chi-square of .* with 167 degrees"), (1.55, 6.0, "it changes sign 41 times")],
)
def test_a_fit_reports_a_model_that_does_not_describe_data_of_known_noise(
    contact_ratio, stated_noise, words
):
    """A wrong contact ratio shows in chi-square or, if the noise is overstated, in sign changes."""
    data = run_up(0.0, seed=2)
    data.displacement.attrs["noise_std"] *= stated_noise
    wrong_model = TRUTH.replace(contact_ratio=contact_ratio, reduced_mass=3.1)
    result = gearlib.fit(wrong_model, data, {"reduced_mass": FREE["reduced_mass"]})
    (message,) = result.unknown
    assert result.redchi < 2.0 and re.search(words, message)


def test_a_run_up_whose_jumps_leave_no_whole_revolution_is_refused():
    """A run-up must be refused if no revolution remains after those near jumps are left out."""
    data = run_up(0.0, seed=2)
    data["displacement"] = data.displacement.where(data.time < 0.24, 3.0 * data.displacement)
    with pytest.raises(ValueError, match="time = 'of 27 rev.* jumps in 10' is.* 24 after a jump"):
        residuals(TRUTH, data)


def test_a_step_in_the_first_revolutions_hides_no_later_jump():
    """A jump at revolution 80 must be found although a larger step precedes it."""
    orders = np.ones((160, 3), complex)
    # The first three revolutions, which are not compared, contain a step larger than the jump.
    orders[3:] *= 20.0
    orders[80:] /= 5.0
    _, _, jumps = _compared_revolutions(orders, np.ones(160))
    assert jumps == [80]

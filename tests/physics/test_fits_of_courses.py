"""Fits to time courses of synthetic rigs: samples at any times, shafts at any phase."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline

import gearlib
from gearlib.analysis.order_maps import ShaftRotation
from gearlib.uncertainty.course_observations import regress_mesh_orders
from gearlib.uncertainty.observations import observations_of
from tests.paper import PAPER

TRUTH = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
FREE = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7)}
GUESS = TRUTH.replace(material_damping=5000.0, reduced_mass=3.0)
LOW, HIGH = TRUTH.speed(0.6), TRUTH.speed(0.75)


def seen(times, signal, turns, seed, gain=1.0, **known):
    """Return what a sensor makes of a signal: noise of 5 %, eccentricity, offset, a gain."""
    rng, noise, span = np.random.default_rng(seed), 0.05 * signal.std(), np.ptp(signal)
    values = signal + rng.normal(0.0, noise, signal.size) + 0.3 * span
    values += span * np.cos(2.0 * np.pi * turns + 1.0)
    attrs = {"units": "m", "noise_std": gain * noise, "unknown_gain": int(gain != 1.0)}
    data = xr.Dataset(
        {"displacement": ("sample", gain * values, attrs)}, {"time": ("sample", times)}
    )
    return data.assign_attrs(known=json.dumps(known))


def run_up(start, seed, gain=1.0, rate=20e3, **known):
    """Return a run-up, sampled at a rate, that begins at the mesh phase `start`."""
    # A mesh period later it is the same.
    wait = (start / (2.0 * np.pi) + 1.0) / 24.0 / (LOW / 60.0)
    course = [(0.0, LOW), (0.6, HIGH)]
    run = gearlib.run_up(
        TRUTH, speed=[(0.0, LOW), (wait, LOW), (wait + 0.6, HIGH)], samples_per_period=128
    )
    times = np.arange(0.0, 0.6, 1.0 / rate)
    signal = CubicSpline(run.time.values, run.displacement.values)(times + wait)
    turns = ShaftRotation(course).revolutions(times)
    return seen(times, signal, turns, seed, gain, course=course, **known)


def steady(tuning, seed, gain=1.0, way=0, truth=TRUTH):
    """Return a time course at constant speed, at any phase of the shaft."""
    speed = TRUTH.speed(tuning)
    first = {0: 1.0, 1: 0.5, -1: 1.6}[way]
    tunings = np.sort(np.linspace(first * tuning, tuning, 40 if way else 1))
    direction = "down" if way < 0 else "up"
    run = gearlib.sweep(truth, tunings, direction=direction, periods=300, record_periods=1)
    state = run.final_state.values[0 if way < 0 else -1]
    orbit = gearlib.periodic_orbit(truth, tuning, guess=state)
    one = gearlib.simulate(
        truth, tuning, initial_state=tuple(orbit.state), periods=1, record_periods=1
    )
    x = one.displacement.values[:256] * float(one.static_deflection)
    times = np.arange(0.0, 0.5, 1.0 / 30e3)
    turns = times * speed / 60.0
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    grid = np.linspace(0.0, 2.0 * np.pi, 257)
    spline = CubicSpline(grid, np.append(x, x[0]), bc_type="periodic")
    signal = spline((2.0 * np.pi * 24.0 * turns + phase) % (2.0 * np.pi))
    data = seen(times, signal, turns, seed, gain, phase=phase)
    return data.assign_coords(
        speed=("sample", np.full(times.size, speed)),
        direction=("sample", np.full(times.size, way, np.int8)),
    )


def residuals(model, data):
    """Return the residuals of a time course."""
    return observations_of(model, data)[0].residuals(model)


def test_orders_are_those_of_samples_at_any_times():
    rest = residuals(TRUTH, run_up(0.0, 1, rate=13e3, phase=0.0))
    # An eccentricity as large as the signal, and an offset, leave the noise alone.
    assert 0.6 < rest @ rest / rest.size < 1.4
    with pytest.raises(ValueError, match="5.75 samples in a mesh period.* of 10 or more"):
        residuals(TRUTH, run_up(0.0, 1, rate=7e3))


def test_orders_of_a_wave_that_grows_are_fourier_integrals():
    turns = (np.arange(3 * 500 + 2) + 0.3) / 500.0
    grown = 1.0 + 0.2 * turns
    result = regress_mesh_orders(
        turns, grown * np.cos(2.0 * np.pi * 24.0 * turns), np.arange(4), 24
    )[0]
    # The integral of (1 + t / 5) cos(2 pi 24 t) e^{-2 pi i 24 t} over one turn.
    expected = 0.5 * (1.1 + 0.2 * np.arange(3)) + 0.05j / (2.0 * np.pi * 24.0)
    np.testing.assert_allclose(result[:, 0], expected, rtol=0, atol=3e-5)


def test_a_run_up_may_begin_at_any_phase():
    for phase, gain in ((4.0, 2.0),):
        data = run_up(phase, 2, gain, phase=phase)
        result = gearlib.fit(GUESS, data, FREE)
        assert 0.6 < result.redchi < 1.4
        for name, one in result.params.items():
            assert abs(one.value - getattr(TRUTH, name)) < 4.0 * one.stderr, name
            assert one.stderr < 0.02 * one.value, name
        # Said to be another one, it is not this model.
        shifted = residuals(TRUTH, run_up(phase, 2, phase=phase + 1.0))
        right = residuals(TRUTH, run_up(phase, 2, phase=phase))
        assert shifted @ shifted > 100.0 * (right @ right) and right @ right < 1.4 * right.size


def conditions(tunings, truth=TRUTH):
    """Return time courses at several speeds as one set."""
    # The phase that is known is that of all: their seeds are the same.
    courses = [steady(tuning, 1, truth=truth) for tuning in tunings]
    names = np.repeat([*map(str, tunings)], [course.sizes["sample"] for course in courses])
    data = xr.concat(courses, "sample", combine_attrs="override")
    return data.assign_coords(condition=("sample", names))


def test_revolutions_with_gaps_are_left_out_of_a_run_up():
    data = run_up(0.0, 2)
    gap = (data.time > 0.25) & (data.time < 0.27)
    for part in (data.isel(sample=~gap.values), data.where(~gap)):
        with pytest.warns(UserWarning, match="2 of 21 revolutions are left out of the run-up"):
            result = gearlib.fit(GUESS, part, FREE)
        assert 0.6 < result.redchi < 1.4
        for name, one in result.params.items():
            assert abs(one.value - getattr(TRUTH, name)) < 4.0 * one.stderr, name
    with pytest.raises(ValueError, match="time = 'of 21 revolutions with gaps' is not allowed"):
        gearlib.fit(GUESS, data.isel(sample=data.time.values % 0.02 > 0.003), FREE)

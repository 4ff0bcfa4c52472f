"""Compare run-ups with runs at constant speed, an independent program and their time histories."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearlib
from gearlib.engines.taylor.teeth import find_contact_mask
from gearlib.geometry import optimum_relief
from gearlib.models import acceleration
from tests.geometry.stages import fzg_c
from tests.independent.systems import RunUp, describe
from tests.paper import PAPER_PAIR
from tests.properties.known_models import GEARS
from tests.trains.random_trains import chain_with_everything

TURNING_PLANETARY_SET = gearlib.planetary(stiffness_ratio=(0.7, 0.7), turning=True)
DAMPED_PAIR = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=2000.0)
#: Excitations for which the motion has no closed form while the speed changes.
EXCITATION_FIELDS = {
    "excitation": gearlib.Harmonics((100.0, 50.0), (20.0,)),
    "deviation": gearlib.Harmonics((1e-6,), (0.0, 5e-7)),
}
EXCITED_PAIR = gearlib.OneDegreePair(pair=DAMPED_PAIR, **EXCITATION_FIELDS)
GEARS_WITHOUT_RUN_OUT = GEARS.replace(eccentricities=(0.0, 0.0))
GEARS_WITH_RUN_OUT = GEARS.replace(
    moving_backlash=False,
    deviation=EXCITATION_FIELDS["deviation"],
    coast_deviation=gearlib.Harmonics((5e-7,)),
)
#: Tooth pairs with tip relief and pitch errors.
LOAD_SHARING_PAIR = gearlib.LoadSharingPair.from_geometry(
    optimum_relief(replace(fzg_c(), backlash=30e-6), 150.0, length="long"),
    torque=300.0,
    damping_ratio=0.05,
    backlash_damping_ratio=0.01,
    pitch_errors=(0.0, -4e-6, 1e-6),
)
#: Pin errors, m, without which several planets would have events at the same time.
PIN_ERRORS = [(0.0, 5e-6), (0.0, 0.0), (2e-6, 0.0)]


@pytest.mark.parametrize(
    ("model", "tuning", "start"),
    [
        (PAPER_PAIR, 0.9, (2.0, -0.5)),
        (EXCITED_PAIR, 0.9, (2.0, -0.5)),
        (GEARS_WITHOUT_RUN_OUT, 0.9, (0, 0)),
        (TURNING_PLANETARY_SET, 0.12, (0, 0)),
        (GEARS_WITH_RUN_OUT, 0.5, (0.0, 0.0)),
        (LOAD_SHARING_PAIR, 0.9, (2.0, -0.5)),
    ],
)
def test_a_run_up_without_acceleration_matches_a_run_at_constant_speed(model, tuning, start):
    """Time histories, events and statistics of a run-up at constant speed must match `simulate`."""
    periods, options = 24, {"samples_per_period": 16, "initial_state": start}
    run = gearlib.simulate(model, tuning, periods=periods, record_periods=periods, **options)
    speed, static_deflection = float(run.speed), float(run.static_deflection)
    duration = periods * math.tau / float(run.mesh_frequency)
    run_up = gearlib.run_up(model, speed, speed, duration=duration, **options)
    # All bounds allow for rounding errors, which contact loss amplifies.
    assert np.abs(run_up.displacement / static_deflection - run.displacement.values).max() < 1e-10
    for name in ("velocity", "acceleration", "dynamic_force"):
        scale = float(run[f"{name.removeprefix('dynamic_')}_scale"])
        difference = run_up[name] / scale - run[name].values
        assert np.abs(difference).max() < 1e-9 * np.abs(run[name].values).max(), name
    assert np.array_equal(run_up.contact, run.contact)
    times = run.event_phase.values / float(run.mesh_frequency)
    assert np.abs(run_up.event_time.values - times).max(initial=0.0) < 1e-10 * duration
    if run_up.sizes["revolution"] == 1:
        assert np.abs(run_up.displacement_max[0] / static_deflection - run.displacement_max) < 1e-12
        assert np.abs(run_up.fraction_drive[0] - run.fraction_drive) < 1e-10
        assert np.abs(run_up.bounces[0] - run.bounces) < 1e-10


def reference_run_up(model, speed, load, pair_acceleration=0.0):
    """Return a run-up of the independent program along courses of speed and load.

    A course has rows (time in s, speed in rpm or load factor). `pair_acceleration` is the
    acceleration of the displacement of a pair, m/s^2, per 1 rad/s^2 of the mesh phase; for models
    with more coordinates, accelerations follow from the model.
    """
    radians_per_rpm = float(model.mesh_frequency(1.0)) / float(model.speed(1.0))
    accelerations = [pair_acceleration]
    if model.size > 2:
        accelerations = acceleration.train_accelerations(model.train or model)
        accelerations = accelerations * model.static_deflection
    return RunUp(describe(model), speed, load, radians_per_rpm, accelerations)


def random_courses(rng, model, tuning, periods, swing):
    """Return random courses of the speed, rows (s, rpm), and the load, rows (s, load factor).

    Their duration is `periods` mesh periods at the tuning. Speeds differ from the speed at the
    tuning by at most the fraction `swing`. The load factor is 1 at both ends and has a step.
    """
    duration = periods * math.tau / float(model.mesh_frequency(tuning))
    times = [0.0, *(duration * np.sort(rng.uniform(0.1, 0.9, 2))).tolist(), duration]
    factors = 1.0 + swing * rng.uniform(-1.0, 1.0, 4)
    speed = list(zip(times, (float(model.speed(tuning)) * factors).tolist(), strict=True))
    load_before, load_after = rng.uniform(0.5, 1.5, 2).tolist()
    step_time = 0.3 * duration
    load = [(0.0, 1.0), (step_time, load_before), (step_time, load_after), (0.7 * duration, 1.0)]
    return speed, load


def assert_motion_matches_reference(run, reference, state, tolerance, frequency):
    """Assert that displacements and event times of a run agree with those of a reference.

    `reference` is a run-up of the independent program, and `state` the initial state in m and m/s.
    The tolerance is that of displacements relative to the largest one, and of event times in units
    of 1 / `frequency`.
    """
    expected, events = reference.move(*np.split(state, 2), run.time.values)
    displacements = run.displacement.values.reshape(expected.shape)
    assert np.abs(displacements - expected).max() < tolerance * np.abs(expected).max()
    assert run.sizes["event"] == len(events) > 2
    event_times = [float(event[0]) for event in events]
    assert np.abs(run.event_time.values - event_times).max() < tolerance / frequency


@pytest.mark.parametrize(
    "model", [EXCITED_PAIR, DAMPED_PAIR, DAMPED_PAIR.replace(contact_ratio=1.2)]
)
@pytest.mark.parametrize("standstill", [False, True])
def test_run_ups_of_pairs_that_drive_a_mass_match_the_independent_program(model, standstill):
    """Run-ups along random courses, also from standstill, must match the independent program."""
    speed, load = random_courses(np.random.default_rng(3), model, 0.7, 20, swing=0.6)
    if standstill:
        speed[0] = 0.0, 0.0
    mass, radius = 0.5 * model.reduced_mass, 0.05
    options = {"load": load, "driven_mass": mass, "base_radius": radius, "samples_per_period": 8}
    run = gearlib.run_up(model, speed=speed, initial_state=(0.0, 0.0), **options)
    assert ("Taylor steps" in run.attrs["source"]) == (model is EXCITED_PAIR)
    # The inertia force of the driven mass acts on the reduced mass of the pair.
    pair_acceleration = mass * radius / model.teeth / model.reduced_mass
    reference = reference_run_up(model, speed, load, pair_acceleration)
    assert_motion_matches_reference(run, reference, np.zeros(2), 1e-12, model.mean_eigenfrequency)


@pytest.mark.parametrize("standstill_index", [0, 3])
def test_run_ups_of_tooth_pairs_without_relief_match_their_gear_pair(standstill_index):
    """Tooth pairs of constant stiffness must move as a pair with rectangular stiffness.

    The speed course begins (index 0) or ends (index 3) with standstill.
    """
    iso_options = {
        "stiffness": "iso",
        "corner_contact": False,
        "torque": 300.0,
        "damping_ratio": 0.05,
    }
    gear_stage = replace(fzg_c(), backlash=2e-6)
    model = gearlib.LoadSharingPair.from_geometry(
        gear_stage, **iso_options, backlash_damping_ratio=0.01
    )
    speed, load = random_courses(np.random.default_rng(3), model, 0.7, 60, swing=0.6)
    speed[standstill_index] = speed[standstill_index][0], 0.0
    mass, radius = 0.5 * model.reduced_mass, 0.05
    options = {"load": load, "driven_mass": mass, "base_radius": radius, "samples_per_period": 8}
    run = gearlib.run_up(model, speed=speed, initial_state=(0.5, 0.0), **options)
    pair_run = gearlib.run_up(model.pair, speed=speed, initial_state=(0.5, 0.0), **options)
    assert run.sizes == pair_run.sizes and run.sizes["event"] > 2
    assert run.sizes["revolution"] > 1
    for name in pair_run.data_vars:
        scale = np.abs(pair_run[name]).max()
        differs = np.abs(run[name] - pair_run[name]) > 1e-9 * scale
        # At a discontinuity of the stiffness, a sample may belong to either side.
        max_count = 2 if name in ("acceleration", "dynamic_force") else 0
        assert int(differs.sum()) <= max_count, name


def test_run_ups_of_tooth_pairs_match_scipy():
    """A ramp of speed and load must end in the state that scipy computes, interval by interval.

    Forces are polynomials of the mesh phase within each interval between two changes of the tooth
    pairs. Time is in rad of a mesh phase at the tuning 1.
    """
    model = LOAD_SHARING_PAIR
    system, mesh_frequency = model.system(1.0), float(model.mesh_frequency(1.0))
    start_tuning, end_tuning = 0.5, 0.9
    duration = 2.0 * system.starts[-1] / (start_tuning + end_tuning)
    ramp_rate, load_rate = (end_tuning - start_tuning) / duration, 0.6 / duration
    times, state = [0.0], np.array([-0.5, 1.5])
    for index, (phase_start, phase_stop) in enumerate(pairwise(system.starts)):
        squared_tunings = start_tuning**2 + 2.0 * ramp_rate * np.array([phase_start, phase_stop])
        tunings = np.sqrt(squared_tunings)
        times.append(times[-1] + 2.0 * (phase_stop - phase_start) / tunings.sum())

        def derivatives(t, state, index=index, interval_start=times[-2], tuning=tunings[0]):
            """Return the time derivatives of displacement and velocity within an interval.

            `tuning` is the tuning at the start of the interval.
            """
            x, v = state
            time = t - interval_start
            phase = time * (tuning + 0.5 * ramp_rate * time)
            overlaps, pair_count = system.overlap_coefficients[index], system.active_pairs[index]
            contacts = find_contact_mask(overlaps, pair_count, system.coast_line, phase, x)
            powers = phase ** np.arange(3)
            stiffness_coefficients, offset_coefficients = np.split(
                system.force_coefficients[index, contacts], 2
            )
            mesh_force = stiffness_coefficients @ powers * x - offset_coefficients @ powers
            gap_rate = system.gap_rate[index] * (tuning + ramp_rate * time)
            damping_force = system.damping[int(contacts > 0)] * (v - gap_rate)
            return v, 1.0 + load_rate * t - mesh_force - damping_force

        solution = solve_ivp(derivatives, times[-2:], state, "DOP853", rtol=1e-11, atol=1e-11)
        state = solution.y[:, -1]
    assert times[-1] == pytest.approx(duration, rel=1e-12)
    seconds = times[-1] / mesh_frequency
    # A break in the speed course puts a sample at the end of the ramp.
    course = [(0.0, start_tuning), (seconds, end_tuning), (1.1 * seconds, end_tuning)]
    run = gearlib.run_up(
        model,
        speed=[(time, float(model.speed(tuning))) for time, tuning in course],
        load=[(0.0, 1.0), (seconds, 1.6)],
        initial_state=(-0.5, 1.5 / start_tuning),
        samples_per_period=1,
    )
    assert run.sizes["event"] > 2
    final_sample = run.isel(time=int(np.abs(run.time.values - seconds).argmin()))
    scales = model.static_deflection * np.array([1.0, mesh_frequency])
    final_state = [final_sample.displacement, final_sample.velocity] / scales
    np.testing.assert_allclose(final_state, state, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "tuning"),
    [
        (GEARS_WITHOUT_RUN_OUT.replace(moving_backlash=False), 0.8),
        (gearlib.planetary(stiffness_ratio=(0.7, 0.7), turning=True, pin_errors=PIN_ERRORS), 0.3),
        (GEARS_WITH_RUN_OUT, 0.8),
        (chain_with_everything(np.random.default_rng(1)), 0.8),
    ],
)
def test_run_ups_with_many_coordinates_match_the_independent_program(model, tuning):
    """Run-ups of gears on bearings and of trains must match the independent program."""
    rng = np.random.default_rng(0)
    speed, load = random_courses(rng, model, tuning, 8, swing=0.2)
    start = "static" if model.mesh_names else tuple(rng.normal(0.0, 1.0, model.size))
    run = gearlib.run_up(model, speed=speed, load=load, initial_state=start, samples_per_period=4)
    reference = reference_run_up(model, speed, load)
    state = model.start_state(start) if model.mesh_names else np.array(start)
    # The reference has displacements in m, and derivatives with respect to its own time.
    scales = np.repeat([1.0, reference.intervals[0].speed], model.size // 2)
    state = state * model.static_deflection * scales
    highest_frequency = math.sqrt((model.train or model).linear_modes[0].max())
    assert_motion_matches_reference(run, reference, state, 1e-11, highest_frequency)


@pytest.mark.parametrize(
    "model",
    [
        DAMPED_PAIR.replace(stiffness_ratio=1.0),
        GEARS_WITHOUT_RUN_OUT.replace(stiffness_ratio=1.0),
        gearlib.planetary(),
    ],
)
@pytest.mark.parametrize("load", [0.4, -0.4])
def test_gears_of_constant_stiffness_stay_in_the_static_state(model, load):
    """Without excitation, the mesh forces must equal the static forces, for loads of both signs."""
    # The load has a step after the last of the 15 revolutions that are compared.
    load_course = [(0.0, load), (0.4, load), (0.4, 1.0)]
    run = gearlib.run_up(model, 3000.0, 3000.0, duration=0.5, load=load_course)
    steady_revolutions = run.isel(revolution=slice(15))
    static_forces = load * np.array(getattr(model, "mean_forces", 1.0)) * model.load
    for name in ("dynamic_force_min", "dynamic_force_max"):
        forces = steady_revolutions[name]
        np.testing.assert_allclose(forces, static_forces + 0.0 * forces, rtol=1e-10)


@pytest.mark.parametrize(
    "model", [PAPER_PAIR.replace(material_damping=3953.7), TURNING_PLANETARY_SET]
)
def test_statistics_of_a_revolution_match_its_time_course(model):
    """Extrema, means and fractions of time of a revolution must agree with its dense samples."""
    # At these speeds, vibrations decay between two changes of the stiffness.
    speeds = (1000.0, 1500.0) if model is TURNING_PLANETARY_SET else (300.0, 700.0)
    steps = {"load": [(0.21, 1.0), (0.21, 0.6)], "samples_per_period": 512}
    run = gearlib.run_up(model, *speeds, duration=0.4, initial_state=(0.0, 0.0), **steps)
    force, static_deflection = float(np.max(run.mean_force)), model.static_deflection
    # The sun of the train has 27 teeth. While it makes a revolution, the carrier makes 3/14 of one.
    periods_per_revolution = 27.0 * 11.0 / 14.0 if model is TURNING_PLANETARY_SET else 24.0
    # A mesh period belongs to the revolution in which its middle lies. In the train, seven
    # revolutions end exactly in the middle of a period, so that 0.382 is added instead of 0.5.
    periods = np.floor(run.phase.values / math.tau + 1e-9)
    revolutions = ((periods + 0.382) / periods_per_revolution).astype(int)
    first_samples = np.searchsorted(revolutions, np.arange(run.sizes["revolution"] + 1))
    assert run.sizes["revolution"] >= 3
    for index, (first, stop) in enumerate(pairwise(first_samples)):
        samples, statistics = run.isel(time=slice(first, stop)), run.isel(revolution=index)
        for name, scale in (("displacement", static_deflection), ("dynamic_force", force)):
            # Extrema between samples exceed them by up to x'' h^2 / 8 with the step h, which is
            # more for fast modes of trains.
            tolerance = scale * (2e-2 if model is TURNING_PLANETARY_SET else 5e-3)
            for excess in (
                statistics[f"{name}_max"] - samples[name].max("time"),
                samples[name].min("time") - statistics[f"{name}_min"],
            ):
                assert -1e-7 * tolerance < excess.min() and excess.max() < tolerance
        mean_force = np.trapezoid(samples.dynamic_force, samples.time, axis=0)
        mean_force /= np.ptp(samples.time.values)
        # Steps of the force between two of 512 samples limit the accuracy.
        assert np.abs(mean_force - statistics.mean_force).max() < 5e-3 * force
        for name, contact_state in (
            ("fraction_drive", 1),
            ("contact_loss_fraction", 0),
            ("fraction_coast", -1),
        ):
            fraction = (samples.contact == contact_state).mean("time")
            assert np.abs(fraction - statistics[name]).max() < 5e-3

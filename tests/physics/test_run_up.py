"""Run-ups: against runs at constant speed, a second code, their own time courses."""

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

TRAIN = gearlib.planetary(stiffness_ratio=(0.7, 0.7), turning=True)
DAMPED = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=2000.0)
#: Waves that have no closed form while the speed changes.
WAVES = {
    "excitation": gearlib.Harmonics((100.0, 50.0), (20.0,)),
    "deviation": gearlib.Harmonics((1e-6,), (0.0, 5e-7)),
}
WAVY = gearlib.OneDegreePair(pair=DAMPED, **WAVES)
SIX = GEARS.replace(eccentricities=(0.0, 0.0))
RUN_OUT = GEARS.replace(
    moving_backlash=False,
    deviation=WAVES["deviation"],
    coast_deviation=gearlib.Harmonics((5e-7,)),
)
#: Pairs of teeth with relief, of which every third touches late.
TEETH = gearlib.LoadSharingPair.from_geometry(
    optimum_relief(replace(fzg_c(), backlash=30e-6), 150.0, length="long"),
    torque=300.0,
    damping_ratio=0.05,
    backlash_damping_ratio=0.01,
    pitch_errors=(0.0, -4e-6, 1e-6),
)
#: Errors of the pins, so that no two planets have events at once.
PINS = [(0.0, 5e-6), (0.0, 0.0), (2e-6, 0.0)]


@pytest.mark.parametrize(
    ("model", "tuning", "start"),
    [
        (PAPER_PAIR, 0.9, (2.0, -0.5)),
        (WAVY, 0.9, (2.0, -0.5)),
        (SIX, 0.9, (0, 0)),
        (TRAIN, 0.12, (0, 0)),
        (RUN_OUT, 0.5, (0.0, 0.0)),
        (TEETH, 0.9, (2.0, -0.5)),
    ],
)
def test_a_run_up_without_acceleration_matches_a_run_at_constant_speed(model, tuning, start):
    """Compare time courses, events and statistics of a run-up at constant speed with `simulate`."""
    periods, options = 24, {"samples_per_period": 16, "initial_state": start}
    run = gearlib.simulate(model, tuning, periods=periods, record_periods=periods, **options)
    speed, static_deflection = float(run.speed), float(run.static_deflection)
    seconds = periods * math.tau / float(run.mesh_frequency)
    run_up = gearlib.run_up(model, speed, speed, duration=seconds, **options)
    # The bounds allow for rounding, which contact loss amplifies.
    assert np.abs(run_up.displacement / static_deflection - run.displacement.values).max() < 1e-10
    for name in ("velocity", "acceleration", "dynamic_force"):
        scale = float(run[f"{name.removeprefix('dynamic_')}_scale"])
        difference = run_up[name] / scale - run[name].values
        assert np.abs(difference).max() < 1e-9 * np.abs(run[name].values).max(), name
    assert np.array_equal(run_up.contact, run.contact)
    times = run.event_phase.values / float(run.mesh_frequency)
    assert np.abs(run_up.event_time.values - times).max(initial=0.0) < 1e-10 * seconds
    if run_up.sizes["revolution"] == 1:
        assert np.abs(run_up.displacement_max[0] / static_deflection - run.displacement_max) < 1e-12
        assert np.abs(run_up.fraction_drive[0] - run.fraction_drive) < 1e-10
        assert np.abs(run_up.bounces[0] - run.bounces) < 1e-10


def reference_run_up(model, speed, load, push=0.0):
    """Return a `RunUp` of the code of `tests.independent` along courses of speed and load.

    `push` is the acceleration of a pair, m/s^2, for 1 rad/s^2 of the mesh; models with more
    coordinates know their accelerations.
    """
    radians_per_rpm, accelerations = (
        float(model.mesh_frequency(1.0)) / float(model.speed(1.0)),
        [push],
    )
    if model.size > 2:
        accelerations = acceleration.train_accelerations(model.train or model)
        accelerations = accelerations * model.static_deflection
    return RunUp(describe(model), speed, load, radians_per_rpm, accelerations)


def random_course(rng, model, tuning, periods, swing):
    """Return random courses of speed, as (s, rpm), and load, as (s, factor).

    They last `periods` mesh periods at the tuning. Speeds differ from the speed of the tuning by at
    most the fraction `swing`. The load factor is 1 at the ends and jumps in between.
    """
    duration = periods * math.tau / float(model.mesh_frequency(tuning))
    times = [0.0, *(duration * np.sort(rng.uniform(0.1, 0.9, 2))).tolist(), duration]
    factors = 1.0 + swing * rng.uniform(-1.0, 1.0, 4)
    speed = list(zip(times, (float(model.speed(tuning)) * factors).tolist(), strict=True))
    factor_before, factor_after = rng.uniform(0.5, 1.5, 2).tolist()
    return speed, [
        (0.0, 1.0),
        (0.3 * duration, factor_before),
        (0.3 * duration, factor_after),
        (0.7 * duration, 1.0),
    ]


def assert_moves_as_the_reference(run, code, state, room, frequency):
    """Assert that displacements and event times of a run agree with the reference `code`.

    `state` is the initial state, m and m/s. `room` bounds the relative error of displacements and
    the error of event times in units of 1 / `frequency`.
    """
    reference_displacements, events = code.move(*np.split(state, 2), run.time.values)
    displacements = run.displacement.values.reshape(reference_displacements.shape)
    assert (
        np.abs(displacements - reference_displacements).max()
        < room * np.abs(reference_displacements).max()
    )
    assert run.sizes["event"] == len(events) > 2
    times = [float(event[0]) for event in events]
    assert np.abs(run.event_time.values - times).max() < room / frequency


@pytest.mark.parametrize("model", [WAVY, DAMPED, DAMPED.replace(contact_ratio=1.2)])
@pytest.mark.parametrize("standstill", [False, True])
def test_run_ups_of_pairs_that_drive_a_mass_match_the_independent_program(model, standstill):
    """Compare run-ups along random courses, from speed or standstill, with a second code."""
    speed, load = random_course(np.random.default_rng(3), model, 0.7, 20, swing=0.6)
    if standstill:
        speed[0] = 0.0, 0.0
    mass, radius = 0.5 * model.reduced_mass, 0.05
    options = {"load": load, "driven_mass": mass, "base_radius": radius, "samples_per_period": 8}
    run = gearlib.run_up(model, speed=speed, initial_state=(0.0, 0.0), **options)
    assert ("Taylor steps" in run.attrs["source"]) == (model is WAVY)
    code = reference_run_up(model, speed, load, mass * radius / model.teeth / model.reduced_mass)
    assert_moves_as_the_reference(run, code, np.zeros(2), 1e-12, model.mean_eigenfrequency)


@pytest.mark.parametrize("standstill", [0, 3])
def test_run_ups_of_tooth_pairs_without_relief_match_their_gear_pair(standstill):
    """Without relief, tooth pairs of constant stiffness equal a rectangular stiffness profile."""
    iso = {"stiffness": "iso", "corner_contact": False, "torque": 300.0, "damping_ratio": 0.05}
    mesh = replace(fzg_c(), backlash=2e-6)
    model = gearlib.LoadSharingPair.from_geometry(mesh, **iso, backlash_damping_ratio=0.01)
    speed, load = random_course(np.random.default_rng(3), model, 0.7, 60, swing=0.6)
    speed[standstill] = speed[standstill][0], 0.0
    mass, radius = 0.5 * model.reduced_mass, 0.05
    options = {"load": load, "driven_mass": mass, "base_radius": radius, "samples_per_period": 8}
    teeth_run = gearlib.run_up(model, speed=speed, initial_state=(0.5, 0.0), **options)
    pair_run = gearlib.run_up(model.pair, speed=speed, initial_state=(0.5, 0.0), **options)
    assert teeth_run.sizes == pair_run.sizes and teeth_run.sizes["event"] > 2
    assert teeth_run.sizes["revolution"] > 1
    for name in pair_run.data_vars:
        scale = np.abs(pair_run[name]).max()
        different = np.abs(teeth_run[name] - pair_run[name]) > 1e-9 * scale
        # The force jumps at a switch of the stiffness, and a sample may lie on either side of it.
        most_different = 2 if name in ("acceleration", "dynamic_force") else 0
        assert int(different.sum()) <= most_different, name


def test_run_ups_of_tooth_pairs_match_scipy():
    """Integrate the forces of teeth with relief and errors, law by law, with scipy."""
    system, turn = TEETH.system(1.0), float(TEETH.mesh_frequency(1.0))
    first, last = 0.5, 0.9
    end = 2.0 * system.starts[-1] / (first + last)
    rate, load_rate = (last - first) / end, 0.6 / end
    times, state = [0.0], np.array([-0.5, 1.5])
    for i, (begin, stop) in enumerate(pairwise(system.starts)):
        speeds = np.sqrt(first**2 + 2.0 * rate * np.array([begin, stop]))
        times.append(times[-1] + 2.0 * (stop - begin) / speeds.sum())

        def rates(t, z, i=i, start=times[-2], speed=speeds[0]):
            """Return the derivatives of the state `z` over time, with the laws of interval `i`."""
            phase = (t - start) * (speed + 0.5 * rate * (t - start))
            overlaps, active = system.overlap_coefficients[i], system.active_pairs[i]
            touching = find_contact_mask(overlaps, active, system.coast_line, phase, z[0])
            law, powers = system.force_coefficients[i, touching], phase ** np.arange(3)
            gap_rate = system.gap_rate[i] * (speed + rate * (t - start))
            damping = system.damping[int(touching > 0)] * (z[1] - gap_rate)
            force = law[:3] @ powers * z[0] - law[3:] @ powers
            return z[1], 1.0 + load_rate * t - force - damping

        motion = solve_ivp(rates, times[-2:], state, "DOP853", rtol=1e-11, atol=1e-11)
        state = motion.y[:, -1]
    seconds = times[-1] / turn
    # A new piece of the speed course puts a sample at the end of the integration.
    course = [(0.0, first), (seconds, last), (1.1 * seconds, last)]
    run = gearlib.run_up(
        TEETH,
        speed=[(t, float(TEETH.speed(tuning))) for t, tuning in course],
        load=[(0.0, 1.0), (seconds, 1.6)],
        initial_state=(-0.5, 1.5 / first),
        samples_per_period=1,
    )
    assert times[-1] == pytest.approx(end, rel=1e-12) and run.sizes["event"] > 2
    final_sample = run.isel(time=int(np.abs(run.time.values - seconds).argmin()))
    scales = TEETH.static_deflection * np.array([1.0, turn])
    np.testing.assert_allclose(
        [final_sample.displacement, final_sample.velocity] / scales, state, atol=1e-9
    )


@pytest.mark.parametrize(
    ("model", "tuning"),
    [
        (SIX.replace(moving_backlash=False), 0.8),
        (gearlib.planetary(stiffness_ratio=(0.7, 0.7), turning=True, pin_errors=PINS), 0.3),
        (RUN_OUT, 0.8),
        (chain_with_everything(np.random.default_rng(1)), 0.8),
    ],
)
def test_run_ups_with_many_coordinates_match_the_independent_program(model, tuning):
    """Compare run-ups along random courses of gears on bearings and trains with a second code."""
    rng = np.random.default_rng(0)
    speed, load = random_course(rng, model, tuning, 8, swing=0.2)
    start = "static" if model.mesh_names else tuple(rng.normal(0.0, 1.0, model.size))
    run = gearlib.run_up(model, speed=speed, load=load, initial_state=start, samples_per_period=4)
    code = reference_run_up(model, speed, load)
    z = model.start_state(start) if model.mesh_names else np.array(start)
    # The reference has displacements in m, and derivatives with respect to its own time.
    z = z * model.static_deflection * np.repeat([1.0, code.pieces[0].speed], model.size // 2)
    highest_frequency = math.sqrt((model.train or model).linear_modes[0].max())
    assert_moves_as_the_reference(run, code, z, 1e-11, highest_frequency)


@pytest.mark.parametrize(
    "model",
    [DAMPED.replace(stiffness_ratio=1.0), SIX.replace(stiffness_ratio=1.0), gearlib.planetary()],
)
@pytest.mark.parametrize("load", [0.4, -0.4])
def test_gears_of_constant_stiffness_stay_in_the_static_state(model, load):
    """Without excitation the mesh forces must equal the static forces, of either sign."""
    # The load changes at the end, after the last revolution that is compared.
    course = [(0.0, load), (0.4, load), (0.4, 1.0)]
    run = gearlib.run_up(model, 3000.0, 3000.0, duration=0.5, load=course)
    steady = run.isel(revolution=slice(15))
    forces = load * np.array(getattr(model, "mean_forces", 1.0)) * model.load
    for name in ("dynamic_force_min", "dynamic_force_max"):
        np.testing.assert_allclose(steady[name], forces + 0.0 * steady[name], rtol=1e-10)


@pytest.mark.parametrize("model", [PAPER_PAIR.replace(material_damping=3953.7), TRAIN])
def test_statistics_of_a_revolution_match_its_time_course(model):
    """Extrema, means and fractions of a revolution must follow from its dense samples."""
    # At these speeds vibrations decay between two switches of the stiffness.
    speeds = (1000.0, 1500.0) if model is TRAIN else (300.0, 700.0)
    steps = {"load": [(0.21, 1.0), (0.21, 0.6)], "samples_per_period": 512}
    run = gearlib.run_up(model, *speeds, duration=0.4, initial_state=(0.0, 0.0), **steps)
    force, static_deflection = float(np.max(run.mean_force)), model.static_deflection
    # In the train the sun has 27 teeth, and the carrier turns by 3/14 of its angle.
    periods_per_revolution = 27.0 * 11.0 / 14.0 if model is TRAIN else 24.0
    # A mesh period belongs to the revolution in which its middle lies. 0.382 is added in place of
    # 0.5, since in the train seven revolutions end just in the middle of a mesh period, 148.5.
    revolutions = (
        (np.floor(run.phase.values / math.tau + 1e-9) + 0.382) / periods_per_revolution
    ).astype(int)
    starts = np.searchsorted(revolutions, np.arange(run.sizes["revolution"] + 1))
    assert run.sizes["revolution"] >= 3
    for i, (begin, end) in enumerate(pairwise(starts)):
        samples, statistics = run.isel(time=slice(begin, end)), run.isel(revolution=i)
        for name in ("displacement", "dynamic_force"):
            scale = {"displacement": static_deflection, "dynamic_force": force}[name]
            excess_of_maximum = statistics[f"{name}_max"] - samples[name].max("time")
            excess_of_minimum = samples[name].min("time") - statistics[f"{name}_min"]
            # Extrema between samples exceed them by up to x'' h^2 / 8, more for fast modes of
            # trains.
            scale *= 2e-2 if model is TRAIN else 5e-3
            assert -1e-7 * scale < excess_of_maximum.min() and excess_of_maximum.max() < scale
            assert -1e-7 * scale < excess_of_minimum.min() and excess_of_minimum.max() < scale
        mean = np.trapezoid(samples.dynamic_force, samples.time, axis=0) / np.ptp(
            samples.time.values
        )
        # The force jumps where the stiffness switches, which costs the mean one step of 512.
        assert np.abs(mean - statistics.mean_force).max() < 5e-3 * force
        for name, code in (
            ("fraction_drive", 1),
            ("contact_loss_fraction", 0),
            ("fraction_coast", -1),
        ):
            share = (samples.contact == code).mean("time")
            assert np.abs(share - statistics[name]).max() < 5e-3

"""Run-ups: against runs at constant speed, a second code, the fold where a slow one jumps."""

import math
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

import gearlib
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.models import acceleration
from tests.independent.systems import RunUp, describe
from tests.paper import PAPER
from tests.trains.random_trains import chain_with_everything

TRAIN = gearlib.planetary(stiffness_ratio=(0.7, 0.7), turning=True)
SIX = gearlib.SixDegreePair(
    pair=PAPER,
    base_radii=(0.06, 0.09),
    inertias=(0.01, 0.04),
    masses=(5.0, 9.0),
    bearing_stiffness=(3e8, 4e8, 2e8, 5e8),
    bearing_damping=(300.0, 400.0, 200.0, 500.0),
    friction=(0.05, 0.05),
)
DAMPED = PAPER.replace(material_damping=3953.7, backlash_damping=2000.0)
#: Waves that have no closed form while the speed changes.
WAVES = {
    "excitation": gearlib.Harmonics((100.0, 50.0), (20.0,)),
    "deviation": gearlib.Harmonics((1e-6,), (0.0, 5e-7)),
}
WAVY = gearlib.OneDegreePair(pair=DAMPED, **WAVES)
RUN_OUT = SIX.replace(
    pair=DAMPED,
    moving_backlash=False,
    eccentricities=(2e-6, 3e-6),
    run_out_phase=0.3,
    teeth=(24, 31),
    deviation=gearlib.Harmonics((1e-6,), (0.0, 5e-7)),
    inverse_deviation=gearlib.Harmonics((5e-7,)),
)
#: Errors of the pins, so that no two planets have events at once.
PINS = [(0.0, 5e-6), (0.0, 0.0), (2e-6, 0.0)]


@pytest.mark.parametrize(
    ("model", "tuning", "start"),
    [
        (PAPER, 0.9, (2.0, -0.5)),
        (WAVY, 0.9, (2.0, -0.5)),
        (SIX, 0.9, (0, 0)),
        (TRAIN, 0.12, (0, 0)),
        (RUN_OUT, 0.5, (0.0, 0.0)),
    ],
)
def test_a_run_up_without_acceleration_is_a_run_at_constant_speed(model, tuning, start):
    periods, samples = 24, 16
    run = gearlib.simulate(
        model,
        tuning,
        periods=periods,
        record_periods=periods,
        samples_per_period=samples,
        initial_state=start,
    )
    speed, length = float(run.speed), float(run.static_deflection)
    seconds = periods * math.tau / float(run.mesh_frequency)
    run_up = gearlib.run_up(
        model, speed, speed, duration=seconds, samples_per_period=samples, initial_state=start
    )
    # The roundings of a run, larger where contact is lost.
    assert np.abs(run_up.displacement / length - run.displacement.values).max() < 1e-10
    for name in ("velocity", "acceleration", "dynamic_force"):
        scale = float(run[f"{name.removeprefix('dynamic_')}_scale"])
        difference = run_up[name] / scale - run[name].values
        assert np.abs(difference).max() < 1e-9 * np.abs(run[name].values).max(), name
    assert np.array_equal(run_up.contact, run.contact)
    times = run.event_phase.values / float(run.mesh_frequency)
    assert np.abs(run_up.event_time.values - times).max(initial=0.0) < 1e-10 * seconds
    if run_up.sizes["revolution"] == 1:
        assert np.abs(run_up.displacement_max[0] / length - run.displacement_max) < 1e-12
        assert np.abs(run_up.fraction_normal[0] - run.fraction_normal) < 1e-10
        assert np.abs(run_up.bounces[0] - run.bounces) < 1e-10


#: The first zero of the Airy function Ai, negative.
AIRY = 2.338107410459767


def random_course(rng, model, tuning, periods, swing=0.2):
    """Return random profiles of the speed, (s, rpm), and of the load, (s, factor), as lists.

    They last so many mesh periods of the tuning, from whose speed they differ by the share `swing`.
    The load is one at the ends and jumps in between.
    """
    span = periods * math.tau / float(model.mesh_frequency(tuning))
    times = [0.0, *(span * np.sort(rng.uniform(0.1, 0.9, 2))).tolist(), span]
    speed = [
        (t, float(model.speed(tuning)) * (1.0 + swing * rng.uniform(-1.0, 1.0))) for t in times
    ]
    before, after = rng.uniform(0.5, 1.5, 2).tolist()
    return speed, [(0.0, 1.0), (0.3 * span, before), (0.3 * span, after), (0.7 * span, 1.0)]


def reference(model, speed, load, accelerations, context=mp.fp):
    """Return the `RunUp` of the code of `tests.independent` along profiles of speed and load.

    `accelerations` of the coordinates, m/s^2, are those of an angular acceleration of 1 rad/s^2.
    """
    turn = float(model.mesh_frequency(1.0)) / float(model.speed(1.0))
    if context is not mp.fp:
        turn = model.mesh.teeth * context.pi / 30
    return RunUp(describe(model), speed, load, turn, accelerations, context)


def run_up_and_reference(model, speed, load, context=mp.fp):
    """Return a run-up with a driven mass, and displacements and event times of its reference.

    Both start at rest; the reference computes with the numbers of an `mpmath` context.
    """
    mass, radius = 0.5 * model.reduced_mass, 0.05
    options = {"load": load, "driven_mass": mass, "base_radius": radius, "samples_per_period": 8}
    run = gearlib.run_up(model, speed=speed, **options)
    # The force of the driven mass over the reduced mass, for 1 rad/s^2 of the mesh phase.
    acceleration_of_mesh = mass * radius / model.teeth / model.reduced_mass
    code = reference(model, speed, load, [acceleration_of_mesh], context)
    displacements, events = code.move([context.mpf(0)], [context.mpf(0)], run.time.values)
    return run, displacements[:, 0].astype(float), [float(event[0]) for event in events]


def test_taylor_steps_agree_with_the_independent_program_on_a_random_course():
    speed, load = random_course(np.random.default_rng(3), WAVY, 0.7, 20, 0.6)
    run, expected, event_times = run_up_and_reference(WAVY, speed, load)
    assert "Taylor steps" in run.attrs["source"]
    assert np.abs(run.displacement.values - expected).max() < 1e-12 * expected.max()
    assert run.sizes["event"] == len(event_times) > 3
    assert np.abs(run.event_time.values - event_times).max() < 1e-12 / WAVY.mean_eigenfrequency


@pytest.mark.parametrize("seed", range(2))
def test_pairs_agree_with_forty_digits_on_random_courses(seed):
    rng = np.random.default_rng(seed)
    damping, backlash_damping = rng.uniform(500.0, 4000.0), rng.uniform(0.0, 4000.0)
    pair = PAPER.replace(material_damping=damping, backlash_damping=backlash_damping)
    pair = pair.replace(contact_ratio=rng.uniform(1.1, 1.9))
    speed, load = random_course(rng, pair, 0.7, 20, 0.6)
    if seed == 1:
        speed[0] = 0.0, 0.0
    with mp.workdps(40):
        run, expected, event_times = run_up_and_reference(pair, speed, load, mp.mp)
    assert run.sizes["event"] == len(event_times) > 2
    assert np.abs(run.displacement.values - expected).max() < 1e-11 * np.abs(expected).max()
    assert np.abs(run.event_time.values - event_times).max() < 1e-11 / pair.mean_eigenfrequency


@pytest.mark.parametrize(
    ("model", "tuning"),
    [
        (SIX.replace(moving_backlash=False), 0.8),
        (gearlib.planetary(stiffness_ratio=(0.7, 0.7), turning=True, pin_errors=PINS), 0.3),
        (RUN_OUT, 0.8),
        (chain_with_everything(np.random.default_rng(1)), 0.8),
    ],
)
def test_models_of_many_coordinates_agree_with_the_independent_program(model, tuning):
    rng, train = np.random.default_rng(0), model.train or model
    speed, load = random_course(rng, model, tuning, 8)
    start = "static" if model.mesh_names else tuple(rng.normal(0.0, 1.0, model.size))
    run = gearlib.run_up(model, speed=speed, load=load, initial_state=start, samples_per_period=4)
    accelerations = acceleration.train_accelerations(train) * model.static_deflection
    code = reference(model, speed, load, accelerations)
    z = model.start_state(start) if model.mesh_names else np.array(start)
    # In m, and its rates by the phase of the mesh as rates by the time of the reference.
    z = z * model.static_deflection * np.repeat([1.0, code.pieces[0].speed], model.size // 2)
    fastest, times = math.sqrt(train.linear_modes[0].max()), run.time.values
    expected, events = code.move(*np.split(z, 2), times)
    result = run.displacement.values.reshape(expected.shape)
    assert np.abs(result - expected).max() < 1e-11 * np.abs(expected).max()
    assert run.sizes["event"] == len(events) > 3
    error = run.event_time.values - [event[0] for event in events]
    assert np.abs(error).max() < 1e-10 / fastest


def test_the_delay_of_the_jump_behind_the_fold_grows_as_the_rate_to_the_power_two_thirds():
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7, teeth=1)
    branch = gearlib.continue_orbit(gearlib.periodic_orbit(pair, 0.9, period=1), to=0.6)
    k = int(np.flatnonzero(branch.label == FOLD)[0])
    fold = float(branch.tuning[k])
    distances = np.abs(branch.tuning.values[k - 2 : k] - fold)
    # Of dy/dn = a (nu - fold) + b y^2 next to the fold: (1 - mu)^2 = 4 a b |nu - fold|, up to terms
    # of the order of y, the root of the distance. See docs/theory/propagation.md.
    multiplier = branch.multiplier_real.values[k - 2 : k].max(axis=1)
    product = np.polyfit(np.sqrt(distances), (1.0 - multiplier) ** 2 / (4.0 * distances), 1)[1]
    lags, rates = [], np.array([1e-8, 1e-7, 1e-6])
    for rate in rates:
        expected = AIRY * rate ** (2.0 / 3.0) / product ** (1.0 / 3.0)
        first, last = fold + 12.0 * expected + 200.0 * rate, fold - 4.0 * expected - 100.0 * rate
        # `rate` is the change of the tuning in a mesh period.
        mean_frequency = (first + last) / 2.0 * pair.mean_eigenfrequency
        seconds = (first - last) / rate * math.tau / mean_frequency
        guess = tuple(branch.state.values[k - 3])
        settled = gearlib.simulate(pair, first, periods=3000, initial_state=guess)
        options = {"duration": seconds, "initial_state": tuple(settled.final_state.values)}
        run = gearlib.run_up(pair, pair.speed(first), pair.speed(last), **options)
        height = run.displacement_max.values / pair.static_deflection
        jump = int(np.argmax(np.abs(height - height[:50].mean()) > 0.3))
        lags.append(fold - float(run.revolution_speed[jump]) / pair.speed(1.0))
        # The next term is of the order of rate^(1/3): the last mesh periods before the jump.
        assert abs(lags[-1] / expected - 1.0) < 0.003 + 4.0 * rate ** (1.0 / 3.0)
    exponent = np.polyfit(np.log(rates), np.log(lags), 1)[0]
    assert abs(exponent - 2.0 / 3.0) < 0.01


@pytest.mark.parametrize("model", [PAPER.replace(material_damping=3953.7), TRAIN])
def test_statistics_of_a_revolution_are_those_of_its_time_course(model):
    # So slow that vibrations die out between two switches of the stiffness.
    speeds = (1000.0, 1500.0) if model is TRAIN else (300.0, 700.0)
    steps = {"load": [(0.21, 1.0), (0.21, 0.6)], "samples_per_period": 512}
    run = gearlib.run_up(model, *speeds, duration=0.4, **steps)
    force, length = float(np.max(run.mean_force)), model.static_deflection
    # Mesh periods of a revolution: a sun of 27 teeth, whose carrier turns by 3/14 of its angle.
    teeth = 27.0 * 11.0 / 14.0 if model is TRAIN else 24.0
    # A mesh period belongs to the revolution in which its middle lies. 0.382 is added in place of
    # 0.5, since in the train seven revolutions end just in the middle of a mesh period, 148.5.
    number = ((np.floor(run.phase.values / math.tau + 1e-9) + 0.382) / teeth).astype(int)
    starts = np.searchsorted(number, np.arange(run.sizes["revolution"] + 1))
    assert run.sizes["revolution"] >= 3
    for i, (begin, end) in enumerate(pairwise(starts)):
        part, own = run.isel(time=slice(begin, end)), run.isel(revolution=i)
        for name in ("displacement", "dynamic_force"):
            scale = {"displacement": length, "dynamic_force": force}[name]
            above = own[f"{name}_max"] - part[name].max("time")
            below = part[name].min("time") - own[f"{name}_min"]
            # A tenth of a radian lies between samples, some of fast modes of trains: x'' h^2 / 8.
            scale *= 2e-2 if model is TRAIN else 5e-3
            assert -1e-7 * scale < above.min() and above.max() < scale
            assert -1e-7 * scale < below.min() and below.max() < scale
        mean = np.trapezoid(part.dynamic_force, part.time, axis=0) / np.ptp(part.time.values)
        # Where the stiffness switches the force jumps, within a step of 512.
        assert np.abs(mean - own.mean_force).max() < 5e-3 * force
        for name, code in (("normal", 1), ("backlash", 0), ("inverse", -1)):
            share = (part.contact == code).mean("time")
            assert np.abs(share - own[f"fraction_{name}"]).max() < 5e-3

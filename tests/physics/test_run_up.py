"""Run-ups: against runs at constant speed, a second code, the fold where a slow one jumps."""

import math

import mpmath as mp
import numpy as np
import pytest

import gearlib
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
#: Waves that have no closed form while the speed changes.
DAMPED = PAPER.replace(material_damping=3953.7, backlash_damping=2000.0)
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
#: Planets that are not alike: no events at once.
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
def test_without_acceleration_it_is_a_run_at_constant_speed(model, tuning, start):
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
    same = gearlib.run_up(
        model, speed, speed, duration=seconds, samples_per_period=samples, initial_state=start
    )
    # The roundings of a run, larger where contact is lost.
    assert np.abs(same.displacement / length - run.displacement.values).max() < 1e-10
    scales = {
        "velocity": "velocity_scale",
        "acceleration": "acceleration_scale",
        "dynamic_force": "force_scale",
    }
    for name, scale in scales.items():
        ours, theirs = same[name] / float(run[scale]), run[name].values
        assert np.abs(ours - theirs).max() < 1e-9 * np.abs(theirs).max(), name
    assert np.array_equal(same.contact, run.contact)
    times = run.event_phase.values / float(run.mesh_frequency)
    assert np.abs(same.event_time.values - times).max(initial=0.0) < 1e-10 * seconds
    if same.sizes["revolution"] == 1:
        assert np.abs(same.displacement_max[0] / length - run.displacement_max) < 1e-12
        assert np.abs(same.fraction_normal[0] - run.fraction_normal) < 1e-10
        assert np.abs(same.bounces[0] - run.bounces) < 1e-10


#: The first zero of the Airy function Ai, negative.
AIRY = 2.338107410459767


def random_course(rng, model, tuning, periods, swing=0.2):
    """Return a course of speed about a tuning and one of the load, that last so many periods."""
    span = periods * math.tau / float(model.mesh_frequency(tuning))
    times = [0.0, *(span * np.sort(rng.uniform(0.1, 0.9, 2))).tolist(), span]
    speed = [
        (t, float(model.speed(tuning)) * (1.0 + swing * rng.uniform(-1.0, 1.0))) for t in times
    ]
    one, two = rng.uniform(0.5, 1.5, 2).tolist()
    return speed, [(0.0, 1.0), (0.3 * span, one), (0.3 * span, two), (0.7 * span, 1.0)]


def reference(model, speed, load, push, context=mp.fp):
    """Return the `RunUp` of a model."""
    turn = float(model.mesh_frequency(1.0)) / float(model.speed(1.0))
    if context is not mp.fp:
        turn = model.mesh.teeth * context.pi / 30
    return RunUp(describe(model), speed, load, turn, push, context)


def in_digits(model, speed, load, push, times, until=math.inf):
    """Return (displacements at rising times, times of events) from rest, in 40 digits."""
    with mp.workdps(40):
        code = reference(model, speed, load, push, mp.mp)
        code.end(until)
        moved, events = code.move(*np.array([[mp.mpf(0)]] * 2), times)
        return moved[:, 0].astype(float), np.array([float(one[0]) for one in events])


def test_taylor_steps_on_random_courses():
    rng, model = np.random.default_rng(3), WAVY
    speed, load = random_course(rng, model, 0.7, 20, 0.6)
    mass, radius = 0.5 * model.reduced_mass, 0.05
    options = {"load": load, "driven_mass": mass, "base_radius": radius, "samples_per_period": 8}
    run = gearlib.run_up(model, speed=speed, **options)
    assert "Taylor steps" in run.attrs["source"]
    push = [mass * radius / model.teeth / model.reduced_mass]
    none = np.zeros(1)
    moved, events = reference(model, speed, load, push).move(none, none, run.time.values)
    assert np.abs(run.displacement.values - moved[:, 0]).max() < 1e-12 * moved.max()
    assert run.sizes["event"] == len(events) > 3
    error = run.event_time.values - [one[0] for one in events]
    assert np.abs(error).max() < 1e-12 / model.mean_eigenfrequency


@pytest.mark.parametrize("seed", range(2))
def test_random_courses_agree_with_forty_digits(seed):
    rng = np.random.default_rng(seed)
    damping, film = rng.uniform(500.0, 4000.0), rng.uniform(0.0, 4000.0)
    pair = PAPER.replace(material_damping=damping, backlash_damping=film)
    pair = pair.replace(contact_ratio=rng.uniform(1.1, 1.9))
    speed, load = random_course(rng, pair, 0.7, 20, 0.6)
    if seed == 1:
        speed[0] = 0.0, 0.0
    mass, radius = 0.5 * pair.reduced_mass, 0.05
    run = gearlib.run_up(
        pair, speed=speed, load=load, driven_mass=mass, base_radius=radius, samples_per_period=8
    )
    push = [mass * radius / pair.teeth / pair.reduced_mass]
    moved, events = in_digits(pair, speed, load, push, run.time.values)
    assert run.sizes["event"] == events.size > 2
    assert np.abs(run.displacement.values - moved).max() < 1e-11 * np.abs(moved).max()
    assert np.abs(run.event_time.values - events).max() < 1e-11 / pair.mean_eigenfrequency


@pytest.mark.parametrize(
    ("model", "tuning"),
    [
        (SIX.replace(moving_backlash=False), 0.8),
        (gearlib.planetary(stiffness_ratio=(0.7, 0.7), turning=True, pin_errors=PINS), 0.3),
        (RUN_OUT, 0.8),
        (chain_with_everything(np.random.default_rng(1)), 0.8),
    ],
)
def test_random_courses_of_many_coordinates_agree(model, tuning):
    rng, train = np.random.default_rng(0), model.train or model
    speed, load = random_course(rng, model, tuning, 8)
    start = "static" if model.mesh_names else tuple(rng.normal(0.0, 1.0, model.size))
    run = gearlib.run_up(model, speed=speed, load=load, initial_state=start, samples_per_period=4)
    push = acceleration.train_accelerations(train) * model.static_deflection
    code = reference(model, speed, load, push)
    z = model.start_state(start) if model.mesh_names else np.array(start)
    # Rates by phase.
    z = z * model.static_deflection * np.repeat([1.0, code.pieces[0].speed], model.size // 2)
    fastest, times = math.sqrt(train.linear_modes[0].max()), run.time.values
    moved, events = code.move(*np.split(z, 2), times)
    result = run.displacement.values.reshape(moved.shape)
    assert np.abs(result - moved).max() < 1e-11 * np.abs(moved).max()
    assert run.sizes["event"] == len(events) > 3
    error = run.event_time.values - [event[0] for event in events]
    assert np.abs(error).max() < 1e-10 / fastest


def test_the_jump_lags_behind_the_fold_by_two_thirds_of_a_power():
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7, teeth=1)
    branch = gearlib.continue_orbit(gearlib.periodic_orbit(pair, 0.9, period=1), to=0.6)
    k = int(np.flatnonzero(branch.label == 1)[0])
    fold, away = (
        float(branch.tuning[k]),
        np.abs(branch.tuning.values[k - 2 : k] - float(branch.tuning[k])),
    )
    # Of dy/dn = a (nu - fold) + b y^2 next to the fold: (1 - mu)^2 = 4 a b |nu - fold|, up to terms
    # of the order of y, the root of the distance. See docs/theory/propagation.md.
    multiplier = branch.multiplier_real.values[k - 2 : k].max(axis=1)
    product = np.polyfit(np.sqrt(away), (1.0 - multiplier) ** 2 / (4.0 * away), 1)[1]
    lags, rates = [], np.array([1e-8, 1e-7, 1e-6])
    for rate in rates:
        expected = AIRY * rate ** (2.0 / 3.0) / product ** (1.0 / 3.0)
        first, last = fold + 12.0 * expected + 200.0 * rate, fold - 4.0 * expected - 100.0 * rate
        seconds = (
            (first - last) / rate * math.tau / ((first + last) / 2.0 * pair.mean_eigenfrequency)
        )
        settled = gearlib.simulate(
            pair, first, periods=3000, initial_state=tuple(branch.state.values[k - 3])
        )
        run = gearlib.run_up(
            pair,
            pair.speed(first),
            pair.speed(last),
            duration=seconds,
            initial_state=tuple(settled.final_state.values),
        )
        height = run.displacement_max.values / pair.static_deflection
        left = int(np.argmax(np.abs(height - height[:50].mean()) > 0.3))
        lags.append(fold - float(run.revolution_speed[left]) / pair.speed(1.0))
        # The next term is of the order of rate^(1/3): the last mesh periods of the way out.
        assert abs(lags[-1] / expected - 1.0) < 0.003 + 4.0 * rate ** (1.0 / 3.0)
    exponent = np.polyfit(np.log(rates), np.log(lags), 1)[0]
    assert abs(exponent - 2.0 / 3.0) < 0.01


@pytest.mark.parametrize("model", [PAPER.replace(material_damping=3953.7), TRAIN])
def test_statistics_of_a_revolution_are_those_of_its_time_course(model):
    # Slow: the modes die out long before the stiffness switches, and no extremum is looked for.
    speeds = (1000.0, 1500.0) if model is TRAIN else (300.0, 700.0)
    steps = {"load": [(0.21, 1.0), (0.21, 0.6)], "samples_per_period": 512}
    run = gearlib.run_up(model, *speeds, duration=0.4, **steps)
    force, length = float(np.max(run.mean_force)), model.static_deflection
    # Of a sun whose frame turns by three elevenths of its speed there; in whole mesh periods.
    teeth = 27.0 * 11.0 / 14.0 if model is TRAIN else 24.0
    # The 148th mesh period has its middle where the seventh revolution ends.
    number = ((np.floor(run.phase.values / math.tau + 1e-9) + 0.382) / teeth).astype(int)
    middle = np.searchsorted(number, np.arange(run.sizes["revolution"] + 1))
    assert run.sizes["revolution"] >= 3
    for i, (begin, end) in enumerate(zip(middle[:-1], middle[1:], strict=True)):
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

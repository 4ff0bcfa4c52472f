"""Run-ups: against runs at constant speed, a second code, the balance of the torques."""

import math

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearlib
from gearlib.models import acceleration
from tests.paper import PAPER

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


@pytest.mark.parametrize(
    ("model", "tuning", "start"),
    [
        (PAPER, 0.6, (0.0, 0.0)),
        (PAPER, 0.9, (2.0, -0.5)),
        (SIX, 0.9, (0, 0)),
        (TRAIN, 0.12, (0, 0)),
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
    teeth = periods if model is not TRAIN else 27
    if teeth == periods:
        assert np.abs(same.displacement_max[0] / length - run.displacement_max) < 1e-12
        assert np.abs(same.fraction_normal[0] - run.fraction_normal) < 1e-10
        assert np.abs(same.bounces[0] - run.bounces) < 1e-10


#: The first zero of the Airy function Ai, negative.
AIRY = 2.338107410459767


class Course:
    """A piecewise linear course of seconds and values."""

    def __init__(self, rows):
        self.rows = rows

    def __call__(self, t, after):
        """Return the value at t; at a step that behind it, if asked for."""
        times, values = zip(*self.rows, strict=True)
        for i in range(len(times) - 1):
            inside = times[i] <= t < times[i + 1] if after else times[i] < t <= times[i + 1]
            if inside:
                share = (t - times[i]) / (times[i + 1] - times[i])
                return values[i] + share * (values[i + 1] - values[i])
        return values[0] if t <= times[0] else values[-1]


def cuts_of(pair, speed, marks):
    """Return (times, phases) between which speed is linear and the stiffness constant."""
    turn, half = pair.teeth * math.tau / 60.0, math.pi * (pair.contact_ratio - 1.0)
    phase, cuts, speeds = 0.0, [(0.0, 0.0)], Course(speed)
    for begin, end in zip(marks[:-1], marks[1:], strict=True):
        first, last = speeds(begin, True) * turn, speeds(end, False) * turn
        rate, gone, own = (last - first) / (end - begin), (first + last) / 2.0 * (end - begin), []
        for k in range(math.floor(phase / math.tau) - 1, math.ceil((phase + gone) / math.tau) + 2):
            for level in (math.tau * k - half, math.tau * k + half):
                roots = np.roots([rate / 2.0, first, phase - level])
                own += [r.real for r in roots if r.imag == 0.0 and 0.0 < r.real < end - begin]
        cuts += [(begin + t, phase + first * t + rate * t * t / 2.0) for t in sorted(own)]
        phase += gone
        cuts.append((end, phase))
    return cuts


def arcs_of(pair, speed, load, push):
    """Return the arcs of a motion from (0, 0) by scipy: begin, end, contact, matrix, line it meets.

    `push` is the force in N that the mesh carries for 1 rpm/s. The matrix is that of displacement,
    velocity, time since the begin, 1; the line is None where a segment ends.
    """
    marks = sorted({t for t, _ in speed} | {t for t, _ in load if t < speed[-1][0]})
    speeds, loads, cuts = Course(speed), Course(load), cuts_of(pair, speed, marks)
    lines, length = (0.0, -pair.backlash), pair.static_deflection
    z, arcs = np.array([0.0, 0.0, 0.0, 1.0]), []
    for (t, before), (end, after) in zip(cuts[:-1], cuts[1:], strict=True):
        low = abs(math.remainder((before + after) / 2.0, math.tau)) > math.pi * (
            pair.contact_ratio - 1.0
        )
        rate = (speeds(end, False) - speeds(t, True)) / (end - t)
        slope = (loads(end, False) - loads(t, True)) / (end - t) * pair.load
        while t < end:
            force = pair.load * loads(t, True) + push * rate
            moving = z[1] or force
            code = 1 if z[0] > 0.0 or (z[0] == 0.0 and moving > 0.0) else 0
            code = -1 if z[0] < lines[1] or (z[0] == lines[1] and moving < 0.0) else code
            k = pair.max_stiffness * (pair.stiffness_ratio if low else 1.0) if code else 0.0
            d = pair.material_damping if code else pair.backlash_damping
            pull = force + (k * lines[1] if code == -1 else 0.0)
            row = np.array([-k, -d, slope, pull]) / pair.reduced_mass
            matrix = np.array([[0.0, 1.0, 0.0, 0.0], row, [0.0, 0.0, 0.0, 1.0], [0.0] * 4])
            tests = []
            for line, way in {1: [(0.0, -1)], -1: [(lines[1], 1)]}.get(
                code, [(0.0, 1), (lines[1], -1)]
            ):

                def test(t, z, line=line):
                    return z[0] - line

                test.terminal, test.direction, test.line = True, way, line
                tests.append(test)
            scale = np.array([length, length * pair.mean_eigenfrequency, 1.0, 1.0])
            z[2] = 0.0
            done = solve_ivp(
                lambda t, z, matrix=matrix: matrix @ z,
                (t, end),
                z,
                "DOP853",
                events=tests,
                rtol=1e-11,
                atol=1e-13 * scale,
                max_step=0.1 / pair.mean_eigenfrequency,  # so that it sees short losses of contact
            )
            z, last = done.y[:, -1].copy(), float(done.t[-1])
            met = [one.line for one, found in zip(tests, done.t_events, strict=True) if found.size]
            if met:
                z[0] = met[0]
            arcs.append((t, last, code, matrix, met[0] if met else None))
            t = last
    return arcs


def in_digits(arcs, times):
    """Return (displacements at times, times of events) of such arcs in 40 digits."""
    moved, events, z, begin = [], [], mp.matrix([0, 0, 0, 1]), mp.mpf(0)
    for _, last, _, matrix, line in arcs:
        a, z[2] = mp.matrix(matrix), mp.mpf(0)
        t = mp.mpf(last) - begin
        for _ in range(4 if line is not None else 0):
            there = mp.expm(a * t) * z
            t -= (there[0] - mp.mpf(line)) / there[1]
        own = [mp.mpf(one) for one in times if begin <= one < begin + t]
        moved += [float((mp.expm(a * (one - begin)) * z)[0]) for one in own]
        z, begin = mp.expm(a * t) * z, begin + t
        if line is not None:
            z[0] = mp.mpf(line)
            events.append(float(begin))
    return np.array(moved), np.array(events)


@pytest.mark.parametrize("seed", range(4))
def test_random_courses_agree_with_forty_digits(seed):
    rng = np.random.default_rng(seed)
    damping, film = rng.uniform(2000.0, 6000.0), rng.uniform(0.0, 4000.0)
    pair = PAPER.replace(material_damping=damping, backlash_damping=film)
    pair = pair.replace(contact_ratio=rng.uniform(1.1, 1.9))
    speeds = rng.uniform(600.0, 4500.0, 4)
    if seed == 1:
        speeds[0] = 0.0
    times = np.array([0.0, *np.sort(rng.uniform(0.005, 0.03, 2)), 0.035])
    loads = [(0.0, 1.0), (0.01, rng.uniform(0.5, 1.5)), (0.01, rng.uniform(0.5, 1.5)), (0.025, 1.0)]
    speed = list(zip(times.tolist(), speeds.tolist(), strict=True))
    mass, radius = 0.5 * pair.reduced_mass, 0.05
    run = gearlib.run_up(
        pair, speed=speed, load=loads, driven_mass=mass, base_radius=radius, samples_per_period=8
    )
    arcs = arcs_of(pair, speed, loads, mass * radius * math.tau / 60.0)
    with mp.workdps(40):
        moved, events = in_digits(arcs, run.time.values)
    assert run.sizes["event"] == events.size > 10
    assert np.abs(run.displacement.values - moved).max() < 1e-11 * np.abs(moved).max()
    assert np.abs(run.event_time.values - events).max() < 1e-11 / pair.mean_eigenfrequency


@pytest.mark.parametrize("model", [TRAIN, SIX.train, gearlib.idler(PAPER)])
def test_inertia_is_that_of_newton(model):
    push = acceleration.of_train(model) * model.static_deflection
    forces = model.structure.mass @ push
    # The free rotation keeps to the speed: nothing is left for it to do.
    assert np.abs(model.free_motions.T @ forces).max() < 1e-9 * np.abs(forces).max()


def test_the_jump_lags_behind_the_fold_by_two_thirds_of_a_power():
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7, teeth=1)
    branch = gearlib.continue_orbit(gearlib.periodic_orbit(pair, 0.9, period=1), to=0.6)
    k = int(np.flatnonzero(branch.label == 1)[0])
    fold, away = (
        float(branch.tuning[k]),
        np.abs(branch.tuning.values[k - 2 : k] - float(branch.tuning[k])),
    )
    # Of dy/dn = a (nu - fold) + b y^2 next to the fold: (1 - mu)^2 = 4 a b |nu - fold|, up to terms
    # of the order of y, the root of the distance. See docs/theory/run_ups.md.
    multiplier = branch.multiplier_real.values[k - 2 : k].max(axis=1)
    product = np.polyfit(np.sqrt(away), (1.0 - multiplier) ** 2 / (4.0 * away), 1)[1]
    lags, rates = [], np.array([1e-9, 1e-8, 1e-7, 1e-6])
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


def test_rigid_bearings_make_a_pair_of_it():
    stiff = SIX.replace(bearing_stiffness=(math.inf,) * 4, friction=(0.0, 0.0))
    torsional = PAPER.replace(reduced_mass=stiff.reduced_mass_torsional, material_damping=3000.0)
    stiff = stiff.replace(pair=torsional)
    mass = stiff.inertias[1] / stiff.base_radii[1] ** 2
    course = {"speed": [(0.0, 500.0), (0.03, 4000.0), (0.04, 3000.0)], "samples_per_period": 8}
    course["load"] = [(0.0, 1.0), (0.01, 0.4), (0.03, 1.3)]
    one = gearlib.run_up(torsional, driven_mass=mass, base_radius=stiff.base_radii[0], **course)
    six = gearlib.run_up(stiff, **course)
    assert np.abs(six.displacement - one.displacement).max() < 1e-11 * one.displacement.max()
    assert np.array_equal(six.event_to, one.event_to)
    # Driven from the other end the mesh has the inertia of gear 3 to pull.
    other = gearlib.run_up(stiff, driver="2", **course)
    mass = -stiff.inertias[0] / stiff.base_radii[0] ** 2
    pull = (six.mean_force - other.mean_force).values / stiff.base_radii[0]
    wanted = (stiff.inertias[1] / stiff.base_radii[1] ** 2 - mass) * math.tau / 60.0
    assert 0.9 < pull[0] / (wanted * 3500.0 / 0.03) < 1.1


def test_there_is_no_revolution_of_rounding():
    # Its end lies 5e-12 before a mesh period of which 7,080 are behind it.
    pair, top = PAPER.replace(material_damping=3953.7), 4900.0
    run = gearlib.run_up(pair, speed=[(0.0, 1000.0), (3.0, top), (6.0, 1000.0)])
    assert run.sizes["revolution"] == 295
    assert abs(run.revolution_speed[-1] - 1000.0) < 40.0
    assert (np.diff(run.revolution_time) > 0.01).all()


def test_a_course_in_two_parts_is_one_course():
    load = [(0.0, 0.3), (0.02, 1.4), (0.05, 0.7)]
    whole = {"load": load, "initial_state": "static", "samples_per_period": 4}
    one = gearlib.run_up(TRAIN, speed=[(0.0, 100.0), (0.06, 2500.0)], **whole)
    cut = [(0.0, 100.0), (0.015, 700.0), (0.031, 1340.0), (0.06, 2500.0)]
    two = gearlib.run_up(TRAIN, speed=cut, **whole)
    for name in ("displacement_max", "dynamic_force_min", "mean_force", "fraction_normal"):
        assert np.abs(two[name] - one[name]).max() < 1e-9 * np.abs(one[name]).max(), name
    assert one.sizes["revolution"] == two.sizes["revolution"]
    assert (one.mean_force[-1].values > 0.0).all()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"start": -1.0, "stop": 10.0, "duration": 1.0}, "start = -1.0 is not allowed"),
        ({"start": 10.0, "stop": math.inf, "duration": 1.0}, "stop = inf is not allowed"),
        ({"start": 10.0, "stop": 20.0}, "must be one of the two"),
        ({"start": 10.0, "stop": 10.0, "acceleration": 5.0}, "duration = 0.0 is not allowed"),
        ({"start": 0.0, "stop": 0.0, "duration": 1.0}, "0 rpm all along"),
        ({"speed": [(0.0, 5.0), (0.0, 6.0)]}, "must be after 0.0 s"),
        ({"speed": [(1.0, 5.0), (2.0, 6.0)]}, "the first at 0 s"),
        ({"speed": [(0.0, 5.0), 3.0]}, "must be 2 values"),
        ({"speed": [(0.0, 5.0), (1.0, 6.0)], "stop": 3.0}, "not allowed together"),
        (
            {"start": 1.0, "stop": 2.0, "duration": 1.0, "load": [(1, 1), (0, 1)]},
            "load[1][0] = 0.0",
        ),
        ({"start": 1.0, "stop": 2.0, "duration": 1.0, "driver": "sun"}, "has no bodies"),
        ({"start": 1.0, "stop": 2.0, "duration": 1.0, "driven_mass": 1.0}, "base_radius = None"),
        ({"start": 1e3, "stop": 2e3, "duration": 1e7, "samples_per_period": 64}, "GB of memory"),
    ],
)
def test_what_is_no_course_is_refused(given, words):
    with pytest.raises(ValueError, match="is not allowed|not allowed") as told:
        gearlib.run_up(PAPER, **given)
    assert words in str(told.value)


def test_models_without_closed_forms_are_refused():
    for model, words in (
        (gearlib.OneDegreePair(pair=PAPER, quadratic_damping=1.0), "linear damping"),
        (SIX.replace(eccentricities=(1e-6, 0.0)), "run-out"),
        (SIX.replace(deviation=gearlib.Harmonics(cosines=(1e-6,))), "run-out"),
        (gearlib.planetary(turning=True, gyroscopic=True), "gyroscopic"),
    ):
        with pytest.raises(ValueError, match="is not allowed") as told:
            gearlib.run_up(model, 10.0, 20.0, duration=1.0)
        assert words in str(told.value)
    with pytest.raises(ValueError, match="driver = 'moon' is not allowed"):
        gearlib.run_up(TRAIN, 10.0, 20.0, duration=1.0, driver="moon")


@pytest.mark.parametrize("model", [PAPER.replace(material_damping=3953.7), TRAIN])
def test_what_a_revolution_has_is_that_of_its_time_course(model):
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

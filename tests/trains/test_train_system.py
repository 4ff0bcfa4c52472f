"""What the kernels get: against the six-degree model, and against a code of its own."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib import (
    planetary,
    simulate,
    split_power_reducer,
    two_stage,
)
from gearlib.engines.exponential import MAX_NORM
from gearlib.engines.linear import propagator as linear_propagator
from gearlib.engines.linear.train_system import matrix_of
from tests.paper import PAPER
from tests.trains.random_trains import random_problem


def test_segments_begin_where_a_stiffness_changes_and_nowhere_else():
    in_phase = planetary(stiffness_ratio=(0.7, 0.7)).system(1.0)
    # 1.4 at phase 0 and 1.6 half a period later switch at the same instants, three by three.
    np.testing.assert_allclose(in_phase.starts / math.pi, [0, 0.4, 1.6, 2], atol=1e-15)
    assert list(in_phase.first_segment) == [0, 3] and in_phase.repeats == 1
    # Thirds of a mesh period: the ends of one stretch are the beginnings of the next, but for
    # their last digits.
    thirds = planetary(teeth=(28, 98), stiffness_ratio=(0.7, 0.7), contact_ratio=(4 / 3, 4 / 3))
    np.testing.assert_allclose(
        thirds.system(1.0).starts / math.pi, [0, 1 / 3, 1, 5 / 3, 2], atol=1e-12
    )
    constant = planetary().system(1.0)
    assert list(constant.starts) == [0.0, 2.0 * math.pi]
    apart = planetary(teeth=(28, 98), stiffness_ratio=(0.7, 0.7)).system(1.0)
    # Two switches of each of six meshes.
    assert apart.starts.size == 1 + 12 + 1
    stages = two_stage(PAPER).system(1.0)
    assert stages.repeats == 3 and stages.first_segment.size == 4
    for k, first in enumerate(stages.first_segment):
        assert stages.starts[first] == 2.0 * math.pi * k
    # Two meshes with 3 and 2 upper stretches each: 10 switches and three bounds of periods.
    assert stages.starts.size == 10 + 3 + 1
    middle = (stages.starts[:-1] + stages.starts[1:]) / 2.0
    for j, (rate, phase) in enumerate(((1.0, 0.0), (2.0 / 3.0, 7.0 / 12.0))):
        away = np.abs((middle * rate / (2.0 * math.pi) - phase + 0.5) % 1.0 - 0.5)
        assert list(stages.low[2, :, j]) == list(away > (PAPER.contact_ratio - 1.0) / 2.0)


def test_the_excitation_repeats_after_the_least_common_period():
    """Stages of 24:36 and 20:25 on shafts, and run-out: thirds, fifths and revolutions."""

    def least(train):
        turning = [train.speeds[body.name] for body in train.bodies if body.eccentricity]
        every = [*train.rates, *turning]
        return next(n for n in range(1, 10**5) if all((n * v).denominator == 1 for v in every))

    stages = two_stage(PAPER)
    pinion, wheel = stages.bodies[0], stages.bodies[-1]

    def eccentric(*names):
        return stages.replace(
            bodies=[replace(b, eccentricity=(b.name in names) * 1e-6) for b in stages.bodies]
        )

    assert least(stages) == stages.repeats == 3
    # Thirds of the mesh period, revolutions of the first and of the last gear.
    counts = {}
    for names in ((pinion.name,), (wheel.name,), (pinion.name, wheel.name)):
        train = eccentric(*names)
        counts[names] = train.repeats
        assert train.repeats == least(train)
    both = counts[pinion.name, wheel.name]
    assert both > counts[pinion.name,] and both > counts[wheel.name,], counts
    rng = np.random.default_rng(5)
    some = [random_problem(rng)[0] for _ in range(12)]
    some += [
        one.replace(bodies=[replace(b, eccentricity=1e-6 * bool(b.teeth)) for b in one.bodies])
        for one in some
    ]
    assert [train.repeats for train in some] == [least(train) for train in some]
    # And what is made of it does repeat: levels a period later are those of the first.
    train = some[-1]
    system, turn = train.system(1.0), 2.0 * math.pi
    for j, rate in enumerate(train.rates):
        assert (train.repeats * rate).denominator == 1, j
    np.testing.assert_allclose(system.starts[-1], turn * train.repeats, rtol=1e-15)


def test_a_back_flank_has_its_own_phase():
    train = planetary(stiffness_ratio=(0.7, 0.7))
    meshes = [
        m if j else m.__class__(**{**vars(m), "inverse_phase": 0.25})
        for j, m in enumerate(train.meshes)
    ]
    system = train.replace(meshes=meshes).system(1.0)
    middle = (system.starts[:-1] + system.starts[1:]) / (4.0 * math.pi)
    assert list(system.low[0, :, 0]) == list(np.abs(middle - 0.25) > 0.2)
    assert list(system.low[2, :, 0]) == list(np.abs((middle + 0.5) % 1.0 - 0.5) > 0.2)
    np.testing.assert_array_equal(system.low[0, :, 1], system.low[2, :, 1])


def test_no_matrix_exceeds_the_norm_of_the_longest_substep():
    for train in (planetary(stiffness_ratio=(0.7, 0.7)), split_power_reducer(PAPER)):
        system, n = train.system(0.9), train.size // 2
        # In coordinates of mass 1, velocities over the highest natural frequency.
        root = np.linalg.cholesky(train.structure.mass)
        largest = 0.0
        rng = np.random.default_rng(1)
        for _ in range(50):
            codes = rng.integers(-1, 2, len(train.meshes))
            segment, a = (
                int(rng.integers(system.starts.size - 1)),
                np.empty_like(system.base_matrix),
            )
            effects = [system.effect[code + 1, segment, j] for j, code in enumerate(codes)]
            matrix_of(system, np.array(effects), a)
            a = a[: 2 * n, : 2 * n]
            k = root.T @ a[n:, :n] @ np.linalg.inv(root.T)
            d = root.T @ a[n:, n:] @ np.linalg.inv(root.T)
            highest = math.sqrt(np.linalg.norm(system_stiffness(train), 2))
            scaled = np.block([[np.zeros((n, n)), highest * np.eye(n)], [k / highest, d]])
            largest = max(largest, np.linalg.norm(scaled, 2))
        assert largest * system.longest <= MAX_NORM * (1.0 + 1e-12)
        # And it is not far from the highest frequency.
        assert system.longest > 0.5 * MAX_NORM / highest


def system_stiffness(train):
    """Return the stiffness with all meshes at their upper level, in theta and masses of 1."""
    lines = train.structure.lines
    upper = np.array([mesh.max_stiffness for mesh in train.meshes])
    k = train.structure.stiffness + lines.T @ (upper[:, None] * lines)
    root = np.linalg.inv(np.linalg.cholesky(train.structure.mass))
    return root @ k @ root.T / train.reference_angular_frequency**2


def with_run_out(**options):
    """Two stages whose stiffness repeats after 5 mesh periods, with their run-out after 35."""
    train = two_stage(PAPER, teeth=(21, 25, 24, 36), **options)
    bodies = [
        replace(body, eccentricity=4e-6, eccentricity_phase=0.3)
        if body.name in ("pinion 1", "wheel 1")
        else body
        for body in train.bodies
    ]
    return train.replace(bodies=tuple(bodies))


@pytest.mark.parametrize(("first", "count"), [(0, 4), (3, 4), (33, 7), (10**12 + 2, 5)])
def test_segments_of_a_stretch_are_those_of_the_whole(first, count):
    train = with_run_out()
    whole, part = train.segments, train.segments_of(first, count)
    for n in range(first, first + count):
        spans = []
        for segments, k in ((whole, n % train.repeats), (part, n % count)):
            own = slice(segments.first_segment[k], segments.first_segment[k + 1])
            bounds = segments.starts[own.start : own.stop + 1] - 2.0 * math.pi * k
            spans.append((bounds, segments.low[:, own], segments.sense[:, own]))
        for one, other in zip(*spans, strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


def test_a_run_does_not_depend_on_the_stretches_of_its_segments(monkeypatch):
    train, found = with_run_out(), []
    for stretch in (10**6, 4):
        monkeypatch.setattr(linear_propagator, "_PERIODS_AT_A_TIME", stretch)
        run = simulate(train, 0.9, periods=13, record_periods=5)
        orbit = train.propagator(0.9).maps(train.start_state("static"), 11, 100, first=30)
        found.append((run, orbit))
    (whole, maps), (parts, other) = found
    xr.testing.assert_allclose(whole, parts, rtol=1e-9, atol=1e-9)
    for one, same in zip(maps, other, strict=True):
        np.testing.assert_allclose(one, same, rtol=1e-9, atol=1e-9)


def test_a_period_of_a_run_out_that_hardly_ever_repeats_costs_a_period():
    train = two_stage(PAPER, teeth=(10007, 10009, 23, 71))
    bodies = [replace(body, eccentricity=1e-6) for body in train.bodies]
    train = train.replace(bodies=tuple(bodies))
    assert train.repeats > 10**9
    run = simulate(train, 0.9, periods=3, record_periods=2)
    assert run.status == 0 and run.period == 0


@pytest.mark.parametrize("kind", ["plain", "with run-out", "gyroscopic"])
def test_what_a_train_keeps_from_one_call_to_the_next_changes_no_bit(kind):
    def build():
        turns = kind == "gyroscopic"
        train = planetary(stiffness_ratio=(0.7, 0.7), turning=turns, gyroscopic=turns)
        if kind == "with run-out":
            sun, *others = train.bodies
            train = train.replace(bodies=(replace(sun, eccentricity=1e-5), *others))
        return train

    def runs(train, tunings):
        asked = {"periods": 4, "record_periods": 1, "initial_state": "static"}
        return [simulate(train, tuning, **asked) for tuning in tunings]

    tunings, train = (0.55, 1.9, 0.56), build()
    # Others before, a turn of the order, and twice.
    runs(train, (0.8, 0.55))
    for one, alone in zip(runs(train, tunings), tunings, strict=True):
        xr.testing.assert_identical(one, runs(build(), [alone])[0])
    # A copy with other numbers has its own.
    softer = train.replace(meshes=tuple(replace(m, max_stiffness=4e8) for m in train.meshes))
    same = build().replace(meshes=softer.meshes)
    xr.testing.assert_identical(*runs(softer, [0.9]), *runs(same, [0.9]))


@pytest.mark.parametrize("internal", [False, True])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_line_of_action_tells_where_the_gears_lie(internal, direction):
    rng = np.random.default_rng(17)
    stiffness = {"max_stiffness": 1e8, "stiffness_ratio": 0.7, "contact_ratio": 1.6}
    for position, alpha in zip(rng.uniform(-3.0, 3.0, 5), rng.uniform(0.1, 0.6, 5), strict=True):
        flanks = {"internal": internal, "direction": direction, "pressure_angle": alpha}
        mesh = gearlib.Mesh(pinion="a", wheel="b", position=position, **stiffness, **flanks)
        again = replace(mesh, position=None, line_of_action=mesh.line)
        assert again.line == mesh.line
        assert again.centres == pytest.approx(position, abs=1e-14)
        # Of a pair outside of each other the pressure parts the axes; a ring gear is pulled along.
        # Across the line of centres it turns the gear with the drive side.
        turned = mesh.line - position
        apart = -math.sin(alpha) if internal else math.sin(alpha)
        assert math.cos(turned) == pytest.approx(apart, abs=1e-14)
        assert math.sin(turned) == pytest.approx(direction * math.cos(alpha), abs=1e-14)

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
    two_stage,
)
from gearlib.engines.linear import propagator as linear_propagator
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


def test_a_run_does_not_depend_on_the_stretches_of_its_segments(monkeypatch):
    train, found = with_run_out(), []
    for stretch in (10**6, 4):
        monkeypatch.setattr(linear_propagator, "_PERIODS_AT_A_TIME", stretch)
        run = simulate(train, 0.9, periods=13, record_periods=5)
        orbit = train.propagator(0.9).maps(train.start_state("static"), 11, 100, first_period=30)
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

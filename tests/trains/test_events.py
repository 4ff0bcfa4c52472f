"""Events of several meshes: one pair as a train, simultaneous and nearly simultaneous ones."""

import math
from dataclasses import replace

import numpy as np
import pytest

import gearlib
from gearlib.engines import orbit
from gearlib.engines.linear.periods import EVENT_MESH
from tests.paper import PAPER
from tests.properties.known_models import pairs_as_train
from tests.trains.random_trains import random_problem, symmetric_problem

#: Bounces once a mesh period.
PAIR = PAPER.replace(material_damping=3953.7, backlash_damping=800.0, backlash=120e-6)
NU = 0.85
#: In phase, all three ring meshes bounce at once.
PLANETS = gearlib.planetary(stiffness_ratio=(0.7, 0.7), reference_frequency=1475.7)


def assert_same_motion(one, train, mesh, periods):
    # Rounding grows with the multipliers of a bounce or two per period; the motion is damped.
    for name in ("displacement", "velocity", "dynamic_force"):
        np.testing.assert_allclose(train[name][:, mesh], one[name], rtol=0, atol=1e-11)
    for name in ("displacement_max", "displacement_min", "dynamic_force_max", "bounces"):
        np.testing.assert_allclose(train[name][mesh], one[name], rtol=0, atol=1e-11)
    for name in ("fraction_normal", "fraction_backlash", "fraction_inverse"):
        np.testing.assert_allclose(train[name][mesh], one[name], rtol=0, atol=1e-12)
    own = train.event_mesh.values == mesh
    np.testing.assert_allclose(train.event_phase[own], one.event_phase, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(train.event_to[own], one.event_to)
    assert int(one.sizes["event"]) >= periods


def test_pairs_that_do_not_touch_one_another_meet_their_flanks_at_once():
    arguments = dict(periods=60, record_periods=20, samples_per_period=16)
    one = gearlib.simulate(PAIR, NU, **arguments)
    train = gearlib.simulate(pairs_as_train(PAIR, 3), NU, **arguments)
    for mesh in range(3):
        assert_same_motion(one, train, mesh, 20)
    # One event of three meshes has one phase, to the last bit.
    phases = train.event_phase.values.reshape(-1, 3)
    assert (phases == phases[:, :1]).all()


@pytest.mark.parametrize("apart", [1e-12, 1e-10, 1e-6])
def test_events_that_are_next_to_one_another_are_two(apart):
    train = pairs_as_train(PAIR, 2)
    propagator = train.propagator(NU)
    state = np.array([0.2, 0.2, 0.2, 0.2, -2.0, -2.0, -2.0, -2.0])
    # The second pair is a little ahead of the first, both on their way out of contact.
    state[2:4] -= 0.5 * apart
    events = propagator.record(state, 1, 100).events
    first = [events[events[:, EVENT_MESH] == j][0] for j in (0, 1)]
    ahead = first[0][orbit.EVENT_PHASE] - first[1][orbit.EVENT_PHASE]
    # On this short way distances keep, and it is passed at the speed of the event.
    expected = -apart / first[0][orbit.EVENT_VELOCITY]
    assert ahead == pytest.approx(expected, rel=0.05) and ahead > 0.0


def test_planets_in_phase_bounce_at_once_and_deviations_go_through():
    propagator = PLANETS.propagator(1.0)
    start = PLANETS.start_state("static")
    record = propagator.record(start, 80, 100)
    events, summary = record.events, record.summary
    phases = events[:, orbit.EVENT_PERIOD] * 2.0 * math.pi + events[:, orbit.EVENT_PHASE]
    late = phases > 2.0 * math.pi * 70
    assert late.sum() >= 60 and set(events[late, EVENT_MESH]) == {3.0, 4.0, 5.0}
    spread = np.ptp(np.sort(phases[late]).reshape(-1, 3), axis=1)
    assert spread.max() < 1e-12
    assert np.ptp(summary[3:, orbit.X_MAX]) < 1e-11
    # The saltation of three meshes at once against finite differences along directions that keep
    # the symmetry and that break it.
    z, _ = propagator.many(start[None], 75, 100)
    _, maps, _ = propagator.maps(z[0], 1, 100)
    rng = np.random.default_rng(3)
    for _ in range(4):
        direction = rng.normal(size=start.size)
        step = 1e-6
        both = z + step * np.array([[1.0], [-1.0]]) * direction
        ends, _ = propagator.many(both, 1, 100)
        slope = (ends[0] - ends[1]) / (2.0 * step)
        # Rounding 1e-15 of states of 10 over the step, and the square of the step.
        np.testing.assert_allclose(maps[0] @ direction, slope, rtol=0, atol=1e-7 * abs(slope).max())


def test_a_train_at_rest_on_its_flanks_begins_in_contact():
    # The force of the load comes to the ring with the fourth power of time, and in the right order.
    train = gearlib.planetary(stiffness_ratio=(0.7, 0.7))
    events = train.propagator(0.5).record(train.start_state((0.0, 0.0)), 1, 100).events
    at_start = events[events[:, orbit.EVENT_PHASE] < 1e-9]
    assert not len(at_start)
    run = gearlib.simulate(train, 0.5, periods=1, samples_per_period=4096)
    assert (run.contact[0] == 1).all() and (run.displacement[1:9] > 0.0).all()


@pytest.mark.parametrize("load", [3000.0, -3000.0, 0.0])
@pytest.mark.parametrize("line", [1, -1])
def test_a_start_at_rest_on_either_flank_line(line, load):
    train = pairs_as_train(PAIR)
    torques = [replace(body, torque=load * body.base_radius) for body in train.bodies]
    train = train.replace(bodies=torques)
    state = np.zeros(train.size)
    if line == -1:
        state[:2] = -0.5 * PAIR.backlash / train.static_deflection
    # The load presses on one side, and opens the other; without it nothing moves, and the coast
    # side counts as open.
    code = {1: int(load >= 0.0), -1: -int(load < 0.0)}[line]
    record = train.propagator(0.9).record(state, 1, 100, 64)
    events, samples = record.events, record.samples
    assert samples[0, orbit.SAMPLE_CONTACT] == samples[1, orbit.SAMPLE_CONTACT] == code
    # What is pressed on stays in contact for a while; what opens strikes later.
    assert not len(events) or events[0, orbit.EVENT_PHASE] > 0.1


# Of sixty each those in which sums of parts of a substep round below the event before.
@pytest.mark.parametrize(
    ("kind", "seed"),
    [(symmetric_problem, seed) for seed in (12, 26, 30, 54)] + [(random_problem, 17)],
)
def test_events_are_recorded_in_their_order(kind, seed):
    train, tuning, state = kind(np.random.default_rng(seed))
    events = train.propagator(tuning).record(state, 40, 10**5).events
    same = np.diff(events[:, orbit.EVENT_PERIOD]) == 0.0
    apart = np.diff(events[:, orbit.EVENT_PHASE])
    assert (apart[same] >= 0.0).all()
    assert (np.diff(events[:, EVENT_MESH])[same & (apart == 0.0)] >= 0).all()
    run = gearlib.simulate(train, tuning, periods=40, record_periods=40, initial_state=state)
    assert run.event.size == len(events) > 10 and (np.diff(run.event_phase) >= 0.0).all()


@pytest.mark.parametrize(
    "options",
    [
        dict(method="rk4", options={"steps_per_period": 60}),
        dict(method="scipy", options={"rtol": 1e-6}),
        dict(method="scipy", options={"events": True, "rtol": 1e-9, "solver": "DOP853"}),
    ],
)
def test_other_methods_record_events_in_their_order(options):
    for train in (PLANETS, gearlib.planetary(teeth=(28, 98), stiffness_ratio=(0.7, 0.7))):
        run = gearlib.simulate(train, 1.0, periods=12, record_periods=12, **options)
        assert run.event.size > 6 and (np.diff(run.event_phase) >= 0.0).all()


def test_a_crossing_where_the_stiffness_switches_is_not_lost():
    propagator = pairs_as_train(PAIR).propagator(NU)
    switch, low, high = propagator.system.starts[1], 1.0, 2.0

    def phase(pressed):
        record = propagator.record(np.array([pressed, pressed, 0.0, 0.0]), 1, 100)
        assert record.status == 0
        return record.events[0, orbit.EVENT_PHASE]

    # From rest, pressed on by more than the load: the more, the sooner the contact ends. Where that
    # is at the switch, the segment behind it begins with a distance that is nothing but rounding.
    while high - low > 1e-15:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if phase(middle) < switch else (middle, high)
    for k in range(-40, 40):
        assert phase(low + k * np.spacing(low)) == pytest.approx(switch, abs=1e-13)

"""Periods of the excitation, what calls share, lines of action, critical damping."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import gearlib
from gearlib import simulate, two_stage
from tests.paper import PAPER
from tests.properties.known_models import pairs_as_train


def test_the_excitation_repeats_after_the_least_common_period():
    stages = two_stage(PAPER)
    # Thirds of a mesh period, of stages of 24:36 and 20:25.
    assert stages.repeats == 3 and stages.frequency_ratios == (1, Fraction(2, 3))
    names = {"first": stages.bodies[0].name, "last": stages.bodies[-1].name}
    for eccentric in ({names["first"]}, {names["last"]}, {*names.values()}):
        train = stages.replace(
            bodies=[replace(b, eccentricity=(b.name in eccentric) * 1e-6) for b in stages.bodies]
        )
        turns = [train.speeds[name] for name in eccentric]
        # A body turns once in as many mesh periods as it has teeth.
        rates = [*train.frequency_ratios, *turns]
        assert all((train.repeats * rate).denominator == 1 for rate in rates)
        fewer = range(1, train.repeats)
        assert not any(all((n * rate).denominator == 1 for rate in rates) for n in fewer)
        system = train.system(1.0)
        assert system.starts[-1] == pytest.approx(2.0 * math.pi * train.repeats, rel=1e-15)


@pytest.mark.parametrize("internal", [False, True])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_line_of_action_determines_the_line_of_centres(internal, direction):
    rng = np.random.default_rng(17)
    stiffness = {"max_stiffness": 1e8, "stiffness_ratio": 0.7, "contact_ratio": 1.6}
    for position, alpha in zip(rng.uniform(-3.0, 3.0, 5), rng.uniform(0.1, 0.6, 5), strict=True):
        flanks = {"internal": internal, "direction": direction, "pressure_angle": alpha}
        mesh = gearlib.Mesh(pinion="a", wheel="b", position=position, **stiffness, **flanks)
        again = replace(mesh, position=None, line_of_action=mesh.line)
        assert again.line == mesh.line
        assert again.centre_line_angle == pytest.approx(position, abs=1e-14)
        # The components along and across the line of centres.
        rotation = mesh.line - position
        radial = -math.sin(alpha) if internal else math.sin(alpha)
        assert math.cos(rotation) == pytest.approx(radial, abs=1e-14)
        assert math.sin(rotation) == pytest.approx(direction * math.cos(alpha), abs=1e-14)


@pytest.mark.parametrize("detuning", [0.0, 1e-10, 1e-4])
def test_deviations_at_an_undamped_resonance_cause_the_motion_of_taylor_steps(detuning):
    pair = PAPER.replace(backlash=math.inf)
    wave = gearlib.Harmonics((1e-6,), (2e-6,))
    train = pairs_as_train(pair)
    train = train.replace(meshes=[replace(train.meshes[0], deviation=wave)])
    # The natural frequency of the upper stiffness level is met exactly.
    tuning = math.sqrt(pair.max_stiffness / pair.mean_stiffness) * (1.0 + detuning)
    settings = {"periods": 4, "record_periods": 4}
    run = simulate(train, tuning, initial_state=train.start_state((0.0, 0.0)), **settings)
    start = float(run.displacement[0, 0]), float(run.velocity[0, 0])
    model = gearlib.OneDegreePair(pair=pair, deviation=wave)
    expected = simulate(model, tuning, method="taylor", initial_state=start, **settings)
    np.testing.assert_allclose(run.displacement[:, 0], expected.displacement, rtol=0, atol=1e-10)

"""Periods of the excitation, and deviations in resonance."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib import Harmonics, OneDegreePair, simulate, two_stage
from tests.paper import PAPER_PAIR
from tests.properties.known_models import pairs_as_train
from tests.trains import random_trains


@pytest.mark.parametrize(
    ("eccentric", "repeats"),
    # In two stages of 24:36 teeth the second has two mesh periods in three of the first. The last
    # wheel turns once in 36 mesh periods of the second stage.
    [((), 3), (("pinion 1",), 24), (("wheel 2",), 54), (("pinion 1", "wheel 2"), 216)],
)
def test_the_excitation_repeats_after_the_least_common_period(eccentric, repeats):
    """Run-out of a gear extends the common period by the turns of this gear."""
    train = two_stage(PAPER_PAIR)
    train = train.replace(
        bodies=[replace(b, eccentricity=(b.name in eccentric) * 1e-6) for b in train.bodies]
    )
    assert train.repeats == repeats
    assert train.system(1.0).starts[-1] == pytest.approx(math.tau * repeats, rel=1e-15)


def test_slow_harmonics_are_kept_in_models_with_rigid_body_motion():
    """The system must have an eigenvalue at each frequency of the excitation."""
    # Three gears with run-out turn once in 18 to 32 mesh periods, and the first one is not in
    # contact.
    train, tuning, _ = random_trains.jamming_problem(np.random.default_rng(107))
    train = train.replace(meshes=[replace(mesh, friction=(0.0, 0.0)) for mesh in train.meshes])
    propagator = train.propagator(tuning)
    basis = propagator.frame.find_basis(propagator.system, np.array([0, 1, 1, 1, 1]))
    eigenvalues = np.concatenate([basis.rates, np.linalg.eigvals(basis.slow_matrix)])
    for frequency in tuning * train.excitation[0]:
        assert np.abs(eigenvalues - 1j * frequency).min() < 1e-9


@pytest.mark.parametrize("detuning", [0.0, 1e-10, 1e-4])
def test_motion_by_deviations_at_an_undamped_resonance_matches_taylor_steps(detuning):
    """Excite a pair at, and close to, the natural frequency of its upper stiffness level."""
    pair, wave = PAPER_PAIR.replace(backlash=math.inf), Harmonics((1e-6,), (2e-6,))
    train = pairs_as_train(pair)
    train = train.replace(meshes=[replace(train.meshes[0], deviation=wave)])
    # The natural frequency of the upper stiffness level is met exactly.
    tuning = math.sqrt(pair.max_stiffness / pair.mean_stiffness) * (1.0 + detuning)
    settings = {"periods": 4, "record_periods": 4}
    run = simulate(train, tuning, initial_state=train.start_state((0.0, 0.0)), **settings)
    start = float(run.displacement[0, 0]), float(run.velocity[0, 0])
    model = OneDegreePair(pair=pair, deviation=wave)
    taylor_run = simulate(model, tuning, method="taylor", initial_state=start, **settings)
    np.testing.assert_allclose(run.displacement[:, 0], taylor_run.displacement, rtol=0, atol=1e-10)

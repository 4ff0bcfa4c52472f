"""What takes trains from event to event: modes of combinations, polynomials, first falls."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import gearlib
from gearlib.engines.linear import grid, modal_frame, propagator
from gearlib.engines.linear.modal_arcs import advance, fill_mode_factors
from gearlib.engines.linear.train_system import matrix_of
from tests.properties.known_models import pairs_as_train
from tests.trains.test_events import PAIR


def combinations_of(train, tuning, rng, count=6):
    """Return a propagator and random combinations of its effects, with their tables filled."""
    propagator = train.propagator(tuning)
    propagator.spare = [(propagator.system, propagator.taken())]
    system, found = propagator.system, []
    for _ in range(count):
        segment = rng.integers(system.effect.shape[1])
        codes = rng.choice([1, 1, 0, -1], size=len(train.meshes))
        codes = np.where(propagator.grid.no_coast_side & (codes < 0), 0, codes)
        effects = np.array([system.effect[code + 1, segment, j] for j, code in enumerate(codes)])
        c = modal_frame.add(propagator.spare[0][1], system, propagator.frame, effects)
        a = np.empty_like(system.base_matrix)
        matrix_of(system, effects, a)
        found.append((c, a, codes))
    return propagator, found


def random_state(propagator, rng):
    """Return a random state z with the constant and harmonics of a random phase."""
    system, n = propagator.system, propagator.components
    h = system.harmonics.size
    z = rng.normal(size=n)
    phase = rng.uniform(0.0, 2.0 * math.pi)
    z[n - 1 - 2 * h] = 1.0
    z[n - 2 * h :: 2], z[n - 2 * h + 1 :: 2] = (
        np.cos(system.harmonics * phase),
        np.sin(system.harmonics * phase),
    )
    return z


def after(propagator, c, z, t):
    """Return the state a time later by the modes of combination c."""
    tables, n = propagator.spare[0][1], propagator.components
    wide = tables.from_modes.shape[2]
    y, term, image, factors = (np.zeros(k) for k in (wide, max(wide, 8 * 24), wide, n))
    y[:n] = z @ tables.to_modes[c][:, :n]
    fill_mode_factors(tables, c, t, factors)
    advance(tables, c, factors, t, y, term, image)
    return y[:n] @ tables.from_modes[c][:, :n], y


@pytest.mark.parametrize("share", [0.999999, 1.0, 1.0 + 1e-9])
def test_a_critical_damping_falls_back_on_one_block(share):
    # Of one mesh: c = 2 sqrt(k m) makes both eigenvalues one.
    critical = 2.0 * math.sqrt(PAIR.max_stiffness * PAIR.reduced_mass)
    pair = PAIR.replace(material_damping=share * critical)
    train = pairs_as_train(pair)
    propagator, found = combinations_of(train, 0.9, np.random.default_rng(1), 1)
    start = train.start_state((0.0, 0.0))
    one = gearlib.simulate(pair, 0.9, periods=20, record_periods=2)
    other = gearlib.simulate(train, 0.9, periods=20, record_periods=2, initial_state=start)
    np.testing.assert_allclose(other.displacement[:, 0], one.displacement, rtol=0, atol=1e-11)
    c, _, codes = found[0]
    if (codes == 1).all():
        assert propagator.spare[0][1].pair_counts[c] == 0


@pytest.mark.parametrize("apart", [0.0, 1e-13, 1e-10, 1e-7, 1e-4, 1e-2])
def test_deviations_at_and_beside_an_undamped_resonance(apart):
    train = pairs_as_train(PAIR.replace(material_damping=0.0, backlash_damping=0.0))
    mesh = replace(train.meshes[0], deviation=gearlib.Harmonics((1e-6,), (2e-6,)))
    train = train.replace(meshes=[mesh])
    # Both stiffness levels of a pair: the upper one of these is met exactly.
    level = math.sqrt(PAIR.max_stiffness / PAIR.mean_stiffness)
    rng = np.random.default_rng(3)
    propagator, found = combinations_of(train, level * (1.0 + apart), rng, 8)
    blocks = set()
    for c, a, _ in found:
        z = random_state(propagator, rng)
        for t in (0.3, 4.0):
            exact = expm(a * t) @ z
            np.testing.assert_allclose(after(propagator, c, z, t)[0], exact, rtol=0, atol=1e-12)
        blocks.add(bool(propagator.spare[0][1].pair_counts[c] == 0))
    # One block only next to the resonance, or where nothing oscillates.
    assert True in blocks or apart > 1e-7


def test_a_lasting_contact_is_proven_and_no_polynomial_asked(monkeypatch):
    train, kept = pairs_as_train(PAIR, 2), []

    def work(*sizes):
        kept.append(grid.new_work(*sizes))
        return kept[-1]

    monkeypatch.setattr(propagator, "new_work", work)
    # Far above the resonance both meshes only tremble.
    run = gearlib.simulate(train, 3.1, periods=30, initial_state="static")
    # The first is that of the run, which is then followed on.
    assert (run.contact == 1).all() and kept[0].stays_off.all()
    assert all((one.contact == 1).all() for one in kept)

"""What takes trains from event to event: modes of combinations, polynomials, first falls."""

import math

import numpy as np
import pytest

import gearlib
from gearlib.engines.linear import modal_frame
from gearlib.engines.linear.modal_arcs import advance_modes, fill_mode_factors
from gearlib.engines.linear.train_system import fill_system_matrix
from tests.properties.known_models import pairs_as_train
from tests.trains.test_events import PAIR


def combinations_of(train, tuning, rng, count=6):
    """Return a propagator and random combinations of its effects, with their tables filled."""
    propagator = train.propagator(tuning)
    propagator.unused_tables = [(propagator.system, propagator.take_tables())]
    system, found = propagator.system, []
    for _ in range(count):
        segment = rng.integers(system.effect.shape[1])
        codes = rng.choice([1, 1, 0, -1], size=len(train.meshes))
        codes = np.where(propagator.constants.no_coast_side & (codes < 0), 0, codes)
        effects = np.array([system.effect[code + 1, segment, j] for j, code in enumerate(codes)])
        c = modal_frame.add_modes(propagator.unused_tables[0][1], system, propagator.frame, effects)
        a = np.empty_like(system.base_matrix)
        fill_system_matrix(system, effects, a)
        found.append((c, a, codes))
    return propagator, found


def after(propagator, c, z, t):
    """Return the state a time later by the modes of combination c."""
    tables, n = propagator.unused_tables[0][1], propagator.components
    wide = tables.from_modes.shape[2]
    y, term, image, factors = (np.zeros(k) for k in (wide, max(wide, 8 * 24), wide, n))
    y[:n] = z @ tables.to_modes[c][:, :n]
    fill_mode_factors(tables, c, t, factors)
    advance_modes(tables, c, factors, t, y, term, image)
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
        assert propagator.unused_tables[0][1].pair_counts[c] == 0

"""Threads that share a model or a propagator find what one thread finds, to the last bit."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from tests.properties.known_models import KNOWN

THREADS, PERIODS = 8, 30
#: One of them on soft bearings far away, so that bases are refined.
MODELS = [KNOWN[name].model for name in ("unequal sides", "free bearings", "idler that deviates")]


@pytest.fixture
def hasty():
    """Threads that give way after a few steps of the interpreter."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.parametrize("known", MODELS)
def test_threads_change_no_bit(known, hasty):
    rng, tunings = np.random.default_rng(1), (0.7, 0.9, 1.1)
    for _ in range(4):
        # New ones, whose bases and tables are still to be made.
        model, alone = known.replace(), known.replace()
        starts = rng.uniform(-2.0, 2.0, (3 * THREADS, 2))
        shared = [model.propagator(tuning) for tuning in tunings]
        start = alone.start_state("static") if alone.mesh_names else np.zeros(alone.size)
        settings = [np.array(start) for _ in starts]
        for z, (x, v) in zip(settings, starts, strict=True):
            z[0] += x
            z[z.size // 2] += v

        def go(propagator, z):
            record = propagator.record(z, PERIODS, 10**5, 4)
            return [np.asarray(part).tobytes() for part in record]

        serial = [go(alone.propagator(tunings[i % 3]), z) for i, z in enumerate(settings)]
        with ThreadPoolExecutor(THREADS) as pool:
            result = list(pool.map(go, [shared[i % 3] for i in range(len(settings))], settings))
        assert result == serial

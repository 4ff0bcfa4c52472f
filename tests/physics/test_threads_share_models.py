"""Threads that share a model or a propagator compute the same bits as a single thread."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from tests.properties.known_models import KNOWN

THREADS, PERIODS = 8, 30
#: One model has soft bearings far from their equilibrium, so that its bases are refined.
MODELS = [KNOWN[name].model for name in ("unequal sides", "free bearings", "idler that deviates")]


@pytest.fixture(autouse=True)
def frequent_switches():
    """Make the interpreter switch threads after each microsecond."""
    switch_interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(switch_interval)


@pytest.mark.parametrize("model", MODELS)
def test_threads_that_share_a_model_record_the_same_bytes_as_one_thread(model):
    """Run the same states on eight threads and one after the other, with cold caches."""
    rng, tunings = np.random.default_rng(1), (0.7, 0.9, 1.1)
    for _ in range(2):
        # Copies still have to compute their bases and tables, which threads might do twice.
        shared_model, serial_model = model.replace(), model.replace()
        starts = rng.uniform(-2.0, 2.0, (3 * THREADS, 2))
        start = model.start_state("static") if model.mesh_names else np.zeros(model.size)
        states = np.tile(start, (len(starts), 1))
        states[:, [0, states.shape[1] // 2]] += starts

        def recorded_bytes(propagator, state):
            """Return the bytes of each array of a recorded motion."""
            record = propagator.record(state, PERIODS, max_events=10**5, samples=4)
            return [np.asarray(part).tobytes() for part in record]

        serial_bytes = [
            recorded_bytes(serial_model.propagator(tunings[index % 3]), state)
            for index, state in enumerate(states)
        ]
        propagators = [shared_model.propagator(tuning) for tuning in tunings] * THREADS
        with ThreadPoolExecutor(THREADS) as pool:
            assert list(pool.map(recorded_bytes, propagators, states)) == serial_bytes

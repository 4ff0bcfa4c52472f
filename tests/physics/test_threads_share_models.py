"""Check that threads which share a model compute the same bits as a single thread."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from tests.properties.known_models import MOTION_CASES

THREAD_COUNT, PERIODS = 8, 30
#: The model "free bearings" starts far from its equilibrium, so that its modal bases are refined.
MODELS = [
    MOTION_CASES[name].model for name in ("unequal sides", "free bearings", "idler that deviates")
]


@pytest.fixture(autouse=True)
def frequent_switches():
    """Make the interpreter switch between threads every microsecond during a test."""
    switch_interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(switch_interval)


@pytest.mark.parametrize("model", MODELS)
def test_threads_that_share_a_model_record_the_same_bytes_as_one_thread(model):
    """Motions from random states must be identical on eight threads and in a single thread.

    The caches of both models are empty at first, so that threads fill them simultaneously.
    """
    rng, tunings = np.random.default_rng(1), (0.7, 0.9, 1.1)
    for _ in range(2):
        # Copies of a model have empty caches.
        shared_model, serial_model = model.replace(), model.replace()
        perturbations = rng.uniform(-2.0, 2.0, (len(tunings) * THREAD_COUNT, 2))
        state = model.start_state("static") if model.mesh_names else np.zeros(model.size)
        states = np.tile(state, (len(perturbations), 1))
        # The first coordinate and its velocity are perturbed.
        states[:, [0, states.shape[1] // 2]] += perturbations

        def record_bytes(propagator, state):
            """Return the bytes of each array of a recorded motion."""
            record = propagator.record(state, PERIODS, max_events=10**5, samples=4)
            return [np.asarray(array).tobytes() for array in record]

        serial_propagators = [serial_model.propagator(tuning) for tuning in tunings] * THREAD_COUNT
        serial_bytes = list(map(record_bytes, serial_propagators, states))
        propagators = [shared_model.propagator(tuning) for tuning in tunings] * THREAD_COUNT
        with ThreadPoolExecutor(THREAD_COUNT) as pool:
            assert list(pool.map(record_bytes, propagators, states)) == serial_bytes

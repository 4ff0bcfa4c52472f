"""Threads that share a model or a propagator find what one thread finds, to the last bit."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gearlib import DeadZoneOscillator, Harmonics, SixDegreePair, Steps, idler
from tests.paper import PAPER

THREADS, PERIODS = 8, 30
PAIR = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)


def dead_zone():
    steps = Steps((0.0, 2.0, 3.5), (1.2, 0.8, 1.0))
    return DeadZoneOscillator(
        upper_stiffness=steps, lower_edge=-0.5, damping=0.1, load=0.1, forcing=Harmonics((0.4,))
    )


def six_degrees():
    # Soft bearings lie far away, so that bases are refined.
    return SixDegreePair(
        pair=PAIR,
        base_radii=(0.1, 0.1),
        inertias=(0.1, 0.1),
        masses=(17.0, 17.0),
        bearing_stiffness=(1e7,) * 4,
        bearing_damping=(500.0,) * 4,
        friction=(0.05, 0.05),
    )


@pytest.fixture
def hasty():
    """Threads that give way after a few steps of the interpreter."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.parametrize("build", [dead_zone, six_degrees, lambda: idler(PAIR)])
def test_threads_change_no_bit(build, hasty):
    rng, tunings = np.random.default_rng(1), (0.7, 0.9, 1.1)
    for _ in range(4):
        # New ones, whose bases and tables are still to be made.
        model, alone = build(), build()
        starts = rng.uniform(-2.0, 2.0, (3 * THREADS, 2))
        shared = [model.propagator(tuning) for tuning in tunings]
        start = alone.start_state("static") if alone.mesh_names else np.zeros(alone.size)
        asked = [np.array(start) for _ in starts]
        for z, (x, v) in zip(asked, starts, strict=True):
            z[0] += x
            z[z.size // 2] += v

        def go(propagator, z):
            record = propagator.record(z, PERIODS, 10**5, 4)
            return [part.tobytes() for part in record]

        serial = [go(alone.propagator(tunings[i % 3]), z) for i, z in enumerate(asked)]
        with ThreadPoolExecutor(THREADS) as pool:
            found = list(pool.map(go, [shared[i % 3] for i in range(len(asked))], asked))
        assert found == serial

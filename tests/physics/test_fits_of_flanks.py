"""Backlash by fits to synthetic rigs of one and two flanks. ``GEARLIB_RIGS=20`` takes so many."""

import os

import numpy as np
import pytest

import gearlib
from gearlib.rig import opening
from gearlib.rig.fits import _improved
from gearlib.rig.synthetic_rigs import synthetic_rig
from tests.paper import PAPER

COUNT = int(os.environ.get("GEARLIB_RIGS", "1"))
FREE = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7), "backlash": (2e-6, 6e-5)}


def rig(seed, struck):
    """Return (truth, data, a model that is off by up to a quarter); struck: the far flank."""
    rng = np.random.default_rng((2000 if struck else 3000) + seed)
    damping = rng.uniform(2500.0, 5500.0) if struck else rng.uniform(5000.0, 8000.0)
    truth = PAPER.replace(
        material_damping=damping,
        backlash_damping=damping,
        reduced_mass=rng.uniform(2.8, 3.4),
        backlash=rng.uniform(6e-6, 1.5e-5) if struck else rng.uniform(3e-5, 5e-5),
    )
    low, high = truth.speed(0.6), truth.speed(1.0)
    data = synthetic_rig(truth, [(0.0, low), (1.0, high), (2.0, low)], seed)
    off = {n: np.clip(getattr(truth, n) * rng.uniform(0.75, 1.25), *FREE[n]) for n in FREE}
    return truth, data, truth.replace(**{n: float(x) for n, x in off.items()})


def test_backlash_is_found_where_the_far_flank_is_struck():
    known = 0
    # From starts alone this one comes to five local minima before.
    for seed in range(COUNT) if COUNT > 1 else (5,):
        truth, data, guess = rig(seed, True)
        found = gearlib.fit(guess, data, FREE, seed=seed, starts=12 if COUNT > 1 else 5)
        one = found.params["backlash"]
        known += one.identifiable and abs(one.value - truth.backlash) < 5.0 * one.stderr < 1e-7
        assert found.redchi < 1.4 and (COUNT > 1 or found.waterfall.size == 1), seed
    assert known >= 0.9 * COUNT


def test_backlash_that_is_never_crossed_is_bounded():
    for seed in range(COUNT) if COUNT > 1 else (3,):
        truth, data, guess = rig(seed, False)
        found = gearlib.fit(guess, data, FREE, seed=seed, starts=12 if COUNT > 1 else 2)
        assert not found.params["backlash"].identifiable, seed
        (said,) = found.unknown
        bound = float(said.split("at least ")[1].split(" m")[0])
        assert said.startswith("backlash is not identifiable") and 2e-6 < bound < truth.backlash
        for name in ("material_damping", "reduced_mass"):
            one = found.params[name]
            assert abs(one.value - getattr(truth, name)) < 4.5 * one.stderr, (seed, name)


def test_an_opening_tells_what_counts_there_and_spreads_the_rest():
    class Line:
        """Residuals of p alone, not of q."""

        kind = "run-up"

        def __init__(self, target):
            self.target, self.noise = target, True

        def opening(self):
            return self

        def residuals(self, model, names):
            rest = 1e3 * (model - self.target) * np.array([1.0, 0.0])
            return rest, 1e3 * np.array([[1.0, 0.0], [0.0, 0.0]])

    class Problem:
        observations, noise, differences = [Line(np.array([0.3, 0.0]))], True, False

        def _replace(self, observations):
            return self

        def residuals(self, share, exact=True):
            return self.observations[0].residuals(share, ())

    tried = [np.array([0.9, 0.5]), np.array([0.1, 0.2])]
    found = np.array(opening.starts(Problem(), tried, 0, _improved))
    assert found.shape == (8, 2)
    np.testing.assert_allclose(found[:, 0], 0.3, atol=1e-6)
    assert np.sort(found[:, 1] * 8).astype(int).tolist() == list(range(8))


@pytest.mark.skipif("GEARLIB_RIGS" not in os.environ, reason="GEARLIB_RIGS: seconds a rig")
def test_differences_come_to_the_same_and_cost_more():
    for seed in range(COUNT):
        _, data, guess = rig(seed, True)
        one, other = (
            gearlib.fit(guess, data, FREE, seed=seed, derivatives=kind)
            for kind in ("exact", "differences")
        )
        assert other.redchi < 1.05 * one.redchi

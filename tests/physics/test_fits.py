"""Fits to synthetic rigs, whose truth is known. ``GEARLIB_RIGS=100`` takes so many."""

import os

import numpy as np
import pytest
import xarray as xr
from scipy.stats import binom

import gearlib
from gearlib.uncertainty.observations import observations_of
from gearlib.uncertainty.synthetic_rigs import synthetic_rig
from tests.paper import PAPER

COUNT = int(os.environ.get("GEARLIB_RIGS", "1"))
TRUTH = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
FREE = {
    "material_damping": (1000.0, 9000.0),
    "reduced_mass": (2.6, 3.7),
    "contact_ratio": (1.4, 1.75),
}


def course(pair, seconds=2.0):
    """Return a course up through the resonance and down again."""
    low, high = pair.speed(0.6), pair.speed(1.0)
    return [(0.0, low), (seconds, high), (2.0 * seconds, low)]


def rig(seed):
    """Return (truth, data, a model that is off by up to a quarter)."""
    rng = np.random.default_rng(1000 + seed)
    damping = rng.uniform(2500.0, 5500.0)
    truth = TRUTH.replace(
        material_damping=damping,
        backlash_damping=damping,
        reduced_mass=rng.uniform(2.8, 3.4),
        contact_ratio=rng.uniform(1.45, 1.68),
    )
    data = synthetic_rig(truth, course(truth), seed)
    off = {n: np.clip(getattr(truth, n) * rng.uniform(0.75, 1.25), *FREE[n]) for n in FREE}
    return truth, data, truth.replace(**{n: float(x) for n, x in off.items()})


def test_intervals_hold_the_truth():
    held = dict.fromkeys(FREE, 0)
    for seed in range(COUNT):
        truth, data, guess = rig(seed)
        found = gearlib.fit(guess, data, FREE)
        assert 0.8 < found.redchi < 1.25 and not found.unknown
        for name, one in found.params.items():
            assert abs(one.value - getattr(truth, name)) < 5.0 * one.stderr, (seed, name)
            held[name] += one.interval[0] <= getattr(truth, name) <= one.interval[1]
    # So few of nominal 95 % come once in a thousand times.
    assert min(held.values()) >= binom.ppf(1e-3, COUNT, 0.95)


def test_an_unknown_gain_is_found_beside_the_parameters():
    data = synthetic_rig(TRUTH, course(TRUTH, 1.0), 5, gain=3.0)
    free = {name: FREE[name] for name in ("material_damping", "reduced_mass")}
    found = gearlib.fit(TRUTH.replace(reduced_mass=3.0), data, free)
    for name, one in found.params.items():
        assert abs(one.value - getattr(TRUTH, name)) < 4.0 * one.stderr
        # Student's factor of 500 degrees of freedom.
        low, high = one.interval
        assert (high - one.value, one.value - low) == pytest.approx(
            [1.965 * one.stderr] * 2, rel=1e-3
        )
    assert data.synthetic == 1
    # Two parameters and the noise: 2 k n / (n - k - 1) is Akaike's penalty, corrected.
    k, n = 3, found.ndata
    (compared,) = observations_of(TRUTH, data)
    squares = float(np.sum(compared.residuals(found.model) ** 2))
    assert found.bic - found.aicc == pytest.approx(k * (np.log(n) - 2.0 * n / (n - k - 1)))
    assert found.bic - k * np.log(n) == pytest.approx(n * np.log(squares / n))
    correlation = found.correlations[0, 1]
    assert f"C(material_damping, reduced_mass) = {correlation:+.4f}" in str(found).splitlines()[-1]
    assert [channel.values.size for channel in compared.channels][1:] == [2]


def test_backlash_is_bounded_where_the_far_flank_is_never_struck():
    data = synthetic_rig(TRUTH, course(TRUTH, 1.0), 3)
    free = {"material_damping": (1000.0, 9000.0), "backlash": (1e-5, 9e-5)}
    found = gearlib.fit(TRUTH.replace(backlash=6e-5), data, free)
    (said,) = found.unknown
    assert said.startswith("backlash is not identifiable: the far flank is never struck in what")
    bound = float(said.split("at least ")[1].split(" m")[0])
    run = gearlib.run_up(TRUTH, speed=course(TRUTH, 1.0))
    # Less than the way at the jumps, which are left out.
    assert 0.7 * bound < -float(run.displacement_min.min()) and bound < 1.01 * TRUTH.backlash
    assert not found.params["backlash"].identifiable and "not known" in str(found)
    assert found.params["material_damping"].identifiable


def jumps_of(pair):
    """Return a measured set of both speeds of jumps."""
    branch = gearlib.continue_orbit(gearlib.periodic_orbit(pair, 1.1), to=0.6)
    folds = np.sort(branch.tuning.values[branch.label.values == 1]) * pair.speed(1.0)
    attrs = {"units": "min-1", "noise_std": 1.0}
    return xr.Dataset({n: ((), x, attrs) for n, x in zip(("jump_down", "jump_up"), folds)})  # noqa: B905


def test_jumps_of_sweeps_alone_tell_two_parameters():
    data = jumps_of(TRUTH)
    free = {name: FREE[name] for name in ("material_damping", "reduced_mass")}
    found = gearlib.fit(TRUTH.replace(reduced_mass=3.05, material_damping=4200.0), data, free)
    for name, one in found.params.items():
        # As many data as parameters: they are met.
        assert one.value == pytest.approx(getattr(TRUTH, name), rel=1e-6), name
    assert "[[Variables]]" in str(found) and found.ndata == 2


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"free": {"mass": (1.0, 2.0)}}, "free = 'mass' is not allowed: it must be one of"),
        ({"free": {"reduced_mass": (1.0, 2.0)}}, "a range that holds reduced_mass = 3.123"),
        ({"free": {"reduced_mass": (4.0, 2.0)}}, "free['reduced_mass'] = (4.0, 2.0)"),
        ({"free": {"contact_ratio": (1.5, 2.5)}}, "contact_ratio = 2.5"),
        ({"free": 7}, "free = 7 is not allowed: it must be a mapping"),
        ({"data": xr.Dataset()}, "it must have a displacement over time, one of"),
        ({"model": 7}, "model = 7 is not allowed"),
    ],
)
def test_what_cannot_be_fitted_is_refused_in_a_sentence(changes, says):
    good = {"model": TRUTH, "data": jumps_of(TRUTH), "free": {"reduced_mass": (2.6, 3.7)}}
    with pytest.raises(ValueError, match="not allowed") as error:
        gearlib.fit(**good | changes)
    assert says in str(error.value) and "\n" not in str(error.value)

"""Models compared by fits to the same data, all synthetic."""

import math

import pytest

import gearlib
from gearlib.rig.synthetic_rigs import synthetic_points
from tests.physics.test_fits import TRUTH

FREE = {"material_damping": (1000.0, 9000.0), "stiffness_ratio": (0.4, 0.8)}
NAMES = ("order_amplitude_1", "order_amplitude_2", "order_amplitude_3", "displacement_max")
RIGID = gearlib.SixDegreePair(
    pair=TRUTH,
    base_radii=(0.0374, 0.0374),
    inertias=(2.0 * 3.123 * 0.0374**2,) * 2,
    masses=(3.0, 3.0),
    bearing_stiffness=(math.inf,) * 4,
)
MODELS = {
    "rectangle": TRUTH,
    "two harmonics": gearlib.OneDegreePair(pair=TRUTH, profile=gearlib.Fourier(2)),
    "six degrees": RIGID,
}


def compared(truth, seed):
    """Return the comparison for data of one of the models, near and off the resonance."""
    speeds = [share * TRUTH.speed(1.0) for share in (0.35, 0.5, 0.6, 1.2, 1.4)]
    data = synthetic_points(MODELS[truth], speeds, NAMES, seed)
    return gearlib.compare_fits(MODELS, data, FREE, starts=0)


@pytest.mark.parametrize("truth", ["rectangle", "two harmonics"])
def test_the_shape_of_the_stiffness_is_told_and_rigid_bearings_are_not(truth):
    found = compared(truth, 1)
    assert sum(found.weights.values()) == pytest.approx(1.0)
    if truth == "two harmonics":
        assert list(found.fits)[0] == truth and found.weights[truth] > 0.999
        assert "the data reject" in found.verdict
    else:
        # Bearings that do not give leave one degree of freedom.
        assert list(found.fits)[-1] == "two harmonics" and found.differences["two harmonics"] > 10.0
        alike = {"rectangle", "six degrees"} - {list(found.fits)[0]}
        assert found.differences[alike.pop()] < 1e-6
        assert "the data reject two harmonics; they cannot tell" in found.verdict
    best = next(iter(found.fits.values()))
    assert best.redchi < 2.0 and "None" not in found.verdict
    for name, one in best.params.items():
        assert abs(one.value - getattr(TRUTH, name)) < 4.0 * one.stderr, name
    text = str(found)
    assert text.splitlines()[1].split()[:3] == ["model", "free", "redchi"] and found.verdict in text


def test_no_model_describes_the_data_is_said():
    bad = {name: MODELS[name] for name in ("two harmonics", "rectangle")}
    truth = gearlib.OneDegreePair(pair=TRUTH, cubic_damping=1e9, profile=gearlib.Fourier(1))
    data = synthetic_points(truth, [0.9 * TRUTH.speed(1.0), 1.2 * TRUTH.speed(1.0)], NAMES, 1)
    found = gearlib.compare_fits(bad, data, {"material_damping": (3000.0, 5000.0)}, starts=0)
    assert found.verdict.endswith("None of them describes the data as well as their noise allows.")


@pytest.mark.parametrize(
    ("models", "free", "says"),
    [
        ({"one": TRUTH}, FREE, "models = {'one': GearPair"),
        (7, FREE, "models = 7 is not allowed"),
        (MODELS, 7, "free = 7 is not allowed: it must be a mapping"),
    ],
)
def test_what_cannot_be_compared_is_refused(models, free, says):
    with pytest.raises(ValueError, match="not allowed") as error:
        gearlib.compare_fits(models, None, free)
    assert says in str(error.value)

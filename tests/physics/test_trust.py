"""Labels that `trust` gives to known motions, and the rules behind them."""

import math

import numpy as np
import pytest
import xarray as xr

from gearlib import Fourier, OneDegreePair, trust
from gearlib.analysis.lyapunov import Exponent
from gearlib.analysis.trust import LABELS, classify_at_tunings, classify_motion
from tests.paper import PAPER_PAIR

DAMPED = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
CUBIC = OneDegreePair(pair=PAPER_PAIR, cubic_damping=4e5, backlash_cubic_damping=4e5)


@pytest.mark.parametrize(
    ("pair", "nu", "label"),
    [
        (DAMPED, 0.9, "periodic"),
        (DAMPED.replace(backlash_damping=0.0), 0.82, "periodic"),
        (CUBIC, 0.9, "periodic"),
        (OneDegreePair(pair=DAMPED, profile=Fourier(5)), 0.9, "undecided"),
        (PAPER_PAIR, 0.7, "quasi-periodic"),
        (PAPER_PAIR, 0.9, "chaotic"),
    ],
)
def test_known_motions_get_the_right_label(pair, nu, label):
    """`trust` must label motions whose kind is known, and support the label by its numbers."""
    result = trust(pair, nu, periods=1500, exponent_periods=2000)
    assert result.label == label, result.message
    if label == "periodic":
        assert result.period == 1 and result.digits > 6 and result.exponent < 0
    if label == "chaotic":
        assert result.exponent > 3 * result.uncertainty > 0


CONVERGENT, CHAOTIC = (-0.1, 0.01, -100.0), (0.1, 0.01, 100.0)


@pytest.mark.parametrize(
    ("high", "low", "period", "status", "exponent", "label", "words"),
    [
        ((2.0, 2.0), (0.0, 0.0), (3, 3), 0, CONVERGENT, "periodic", "agree"),
        ((2.0, 2.1), (0.0, 0.0), (1, 1), 0, CONVERGENT, "undecided", "attractors"),
        ((2.0, 2.0), (0.0, -0.1), (1, 1), 0, CONVERGENT, "undecided", "attractors"),
        ((2.0, 2.0), (0.0, 0.0), (1, 0), 0, CONVERGENT, "undecided", "increase periods"),
        ((2.0, 3.0), (0.0, 0.0), (0, 0), 0, CHAOTIC, "chaotic", "factor of e"),
        ((2.0, 3.0), (0.0, 0.0), (0, 0), 0, (0.1, 0.05, 100.0), "quasi-periodic", "neither"),
        ((2.0, 3.0), (0.0, 0.0), (0, 0), 0, (0.005, 1e-4, 5.0), "quasi-periodic", "neither"),
        ((2.0, 2.0), (0.0, 0.0), (1, 1), 0, (0.0, 0.01, 0.0), "undecided", "increase periods"),
        ((2.0, 2.0), (0.0, 0.0), (1, 1), 2, (-0.1, 0.1, -9.0), "undecided", "run 0"),
        ((2.0, 2.0), (0.0, 0.0), (0, 0), 2, CHAOTIC, "unbounded", "bound"),
        (
            (2.0, 2.0),
            (0.0, 0.0),
            (1, 1),
            1,
            (-0.1, 0.1, -9.0),
            "undecided",
            "some runs failed: run 0",
        ),
    ],
)
def test_a_label_follows_from_two_runs_and_the_exponent(
    high, low, period, status, exponent, label, words
):
    """Classify pairs of runs with made-up extrema, periods and statuses, and an exponent."""
    run_values = {"displacement_max": high, "displacement_min": low, "period": period}
    run_values["status"] = status, status
    data = {name: ("run", np.array(values)) for name, values in run_values.items()}
    runs = xr.Dataset(data, {"run": ["run 0", "run 1"]})
    result = classify_motion(runs, Exponent(*exponent, 1000))
    assert result.label == label and words in result.message


def test_an_exponent_of_linear_growth_is_not_positive():
    """Linear growth of deviations, as of quasi-periodic motions, must not count as chaos."""
    # Deviations of quasi-periodic motions grow in proportion to time, here by `rate` per period.
    for rate in (0.1, 1.0, 500.0):
        growth = math.log(rate * 4000)
        assert not Exponent(
            growth / 4000, uncertainty=1e-9, log_growth=growth, periods=4000
        ).positive
    # Exponential growth counts only if the exponent exceeds its uncertainty.
    assert Exponent(0.02, uncertainty=0.002, log_growth=80.0, periods=4000).positive
    assert not Exponent(0.02, uncertainty=0.02, log_growth=80.0, periods=4000).positive


def test_a_scan_over_tunings_matches_trust_at_each_tuning():
    """A scan must give the labels and numbers that `trust` gives at each single tuning."""
    options = {"periods": 100, "exponent_periods": 500}
    result = classify_at_tunings(PAPER_PAIR, [0.7, 0.9], **options)
    # The CF conventions require a single word for each value of a flag.
    words = result.label.attrs["flag_meanings"].split()
    values = result.label.attrs["flag_values"].tolist()
    assert len(words) == len(values) and all(word.isidentifier() for word in words)
    for tuning, label in zip((0.7, 0.9), result.label.values, strict=True):
        single = trust(PAPER_PAIR, tuning, **options)
        assert single.label == LABELS[label]
        assert words[values.index(label)].replace("_", "-") == single.label
        for name in ("period", "digits", "exponent", "uncertainty"):
            np.testing.assert_equal(float(result[name].sel(tuning=tuning)), getattr(single, name))
    # A scan counts at most ten digits, because further ones are rounding.
    settled = trust(DAMPED, 0.7, periods=500, exponent_periods=500)
    assert settled.digits > 10 and classify_at_tunings(DAMPED, [0.7], periods=500).digits == 10.0

"""Check the labels that `trust` gives to known motions, and its rules on constructed runs."""

import math

import numpy as np
import pytest
import xarray as xr

from gearlib import Fourier, OneDegreePair, trust
from gearlib.analysis.lyapunov import Exponent
from gearlib.analysis.trust import LABELS, classify_at_tunings, classify_motion
from tests.paper import PAPER_PAIR

DAMPED_PAIR = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
CUBICALLY_DAMPED_PAIR = OneDegreePair(
    pair=PAPER_PAIR, cubic_damping=4e5, backlash_cubic_damping=4e5
)


@pytest.mark.parametrize(
    ("pair", "nu", "label"),
    [
        (DAMPED_PAIR, 0.9, "periodic"),
        (DAMPED_PAIR.replace(backlash_damping=0.0), 0.82, "periodic"),
        (CUBICALLY_DAMPED_PAIR, 0.9, "periodic"),
        (OneDegreePair(pair=DAMPED_PAIR, profile=Fourier(5)), 0.9, "undecided"),
        (PAPER_PAIR, 0.7, "quasi-periodic"),
        (PAPER_PAIR, 0.9, "chaotic"),
    ],
)
def test_known_motions_get_the_right_label(pair, nu, label):
    """`trust` must give the known label, with digits and an exponent that agree with it."""
    result = trust(pair, nu, periods=1500, exponent_periods=2000)
    assert result.label == label, result.message
    if label == "periodic":
        assert result.period == 1 and result.digits > 6 and result.exponent < 0
    if label == "chaotic":
        assert result.exponent > 3 * result.uncertainty > 0


#: A negative and a positive Lyapunov exponent: value, uncertainty and logarithm of the growth.
NEGATIVE_EXPONENT, POSITIVE_EXPONENT = (-0.1, 0.01, -100.0), (0.1, 0.01, 100.0)


@pytest.mark.parametrize(
    ("maxima", "minima", "period", "status", "exponent", "label", "message"),
    [
        ((2.0, 2.0), (0.0, 0.0), (3, 3), 0, NEGATIVE_EXPONENT, "periodic", "agree"),
        ((2.0, 2.1), (0.0, 0.0), (1, 1), 0, NEGATIVE_EXPONENT, "undecided", "attractors"),
        ((2.0, 2.0), (0.0, -0.1), (1, 1), 0, NEGATIVE_EXPONENT, "undecided", "attractors"),
        ((2.0, 2.0), (0.0, 0.0), (1, 0), 0, NEGATIVE_EXPONENT, "undecided", "increase periods"),
        ((2.0, 3.0), (0.0, 0.0), (0, 0), 0, POSITIVE_EXPONENT, "chaotic", "factor of e"),
        ((2.0, 3.0), (0.0, 0.0), (0, 0), 0, (0.1, 0.05, 100.0), "quasi-periodic", "neither"),
        ((2.0, 3.0), (0.0, 0.0), (0, 0), 0, (0.005, 1e-4, 5.0), "quasi-periodic", "neither"),
        ((2.0, 2.0), (0.0, 0.0), (1, 1), 0, (0.0, 0.01, 0.0), "undecided", "increase periods"),
        ((2.0, 2.0), (0.0, 0.0), (1, 1), 2, (-0.1, 0.1, -9.0), "undecided", "run 0"),
        ((2.0, 2.0), (0.0, 0.0), (0, 0), 2, POSITIVE_EXPONENT, "unbounded", "bound"),
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
    maxima, minima, period, status, exponent, label, message
):
    """Classify two runs with given extrema, periods and a common status, and an exponent."""
    values = {"displacement_max": maxima, "displacement_min": minima, "period": period}
    values["status"] = status, status
    variables = {name: ("run", np.array(pair)) for name, pair in values.items()}
    runs = xr.Dataset(variables, {"run": ["run 0", "run 1"]})
    result = classify_motion(runs, Exponent(*exponent, 1000))
    assert result.label == label and message in result.message


def test_an_exponent_of_linear_growth_is_not_positive():
    """Perturbations of quasi-periodic motions grow linearly in time, which is not chaos.

    Exponential growth must count as chaos only if the exponent exceeds its uncertainty.
    """
    for growth_per_period in (0.1, 1.0, 500.0):
        growth = math.log(growth_per_period * 4000)
        assert not Exponent(
            growth / 4000, uncertainty=1e-9, log_growth=growth, periods=4000
        ).positive
    assert Exponent(0.02, uncertainty=0.002, log_growth=80.0, periods=4000).positive
    assert not Exponent(0.02, uncertainty=0.02, log_growth=80.0, periods=4000).positive


def test_a_scan_over_tunings_matches_trust_at_each_tuning():
    """A scan over tunings must give the labels and numbers of `trust` at each tuning."""
    options = {"periods": 100, "exponent_periods": 500}
    result = classify_at_tunings(PAPER_PAIR, [0.7, 0.9], **options)
    # The CF conventions require a single word for each value of a flag.
    meanings = result.label.attrs["flag_meanings"].split()
    flags = result.label.attrs["flag_values"].tolist()
    assert len(meanings) == len(flags) and all(word.isidentifier() for word in meanings)
    for tuning, flag in zip((0.7, 0.9), result.label.values, strict=True):
        verdict = trust(PAPER_PAIR, tuning, **options)
        assert verdict.label == LABELS[flag]
        assert meanings[flags.index(flag)].replace("_", "-") == verdict.label
        for name in ("period", "digits", "exponent", "uncertainty"):
            np.testing.assert_equal(float(result[name].sel(tuning=tuning)), getattr(verdict, name))
    # A scan reports at most ten digits, because rounding errors decide about further ones.
    settled = trust(DAMPED_PAIR, 0.7, periods=500, exponent_periods=500)
    assert (
        settled.digits > 10 and classify_at_tunings(DAMPED_PAIR, [0.7], periods=500).digits == 10.0
    )

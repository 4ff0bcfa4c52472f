"""Check that motions which grow without bound, and no others, are reported as unbounded.

At large amplitudes, backlash and load have no influence. If both flanks are alike, the motion obeys
Hill's equation and grows without bound where its largest multiplier exceeds 1.
"""

import numpy as np
import pytest

from gearlib import GearPair, OneDegreePair, basins, lyapunov_exponents, simulate, sweep, trust
from gearlib.analysis.global_dynamics.attractors import PERIODIC
from gearlib.analysis.tongues import meissner
from gearlib.analysis.trust import LABELS, classify_at_tunings
from gearlib.data.status import OK, OVERFLOW
from tests.properties.known_models import pairs_as_train

SYMMETRIC_PAIR = GearPair.from_ratios(
    contact_ratio=1.3, stiffness_ratio=0.4, damping=0.02, backlash_damping=0.01, backlash_ratio=1.0
)
#: Tunings on both sides of the lower edge of the principal tongue, 0.9406, and where motions grow.
TUNINGS = np.array([0.93, 0.94, 0.941, 0.9412, 0.942, 0.9435, 0.945])
GROWS = np.array([False, False, True, True, True, True, True])


def test_motions_inside_the_tongue_are_labelled_unbounded():
    """Motions must be labelled unbounded exactly where the linear motion in contact grows."""
    assert ((meissner.growth(1.3, 0.4, 0.02, TUNINGS) > 0.0) == GROWS).all()
    result = classify_at_tunings(SYMMETRIC_PAIR, TUNINGS)
    names = [LABELS[code] for code in result.label.values]
    assert names == ["unbounded" if grows else "periodic" for grows in GROWS]
    assert (np.isnan(result.exponent.values) == GROWS).all()
    assert "unbounded" in result.label.flag_meanings.split()
    assert "bound" in trust(SYMMETRIC_PAIR, 0.942).message


@pytest.mark.parametrize("direction", ["up", "down"])
def test_sweeps_report_an_overflow_where_motions_grow(direction):
    """Sweeps must report an overflow where motions grow, and continue from rest after it."""
    run = sweep(SYMMETRIC_PAIR, TUNINGS, periods=6000, record_periods=2, direction=direction)
    assert (run.status.values == np.where(GROWS, OVERFLOW, OK)).all()
    assert (run.displacement_max.isnull().values == GROWS).all()
    if direction == "down":
        # After the unbounded motion at 0.941, the sweep continues at 0.94 from rest.
        from_rest = sweep(SYMMETRIC_PAIR, [0.94], periods=6000, record_periods=2)
        assert run.displacement_max.values[1] == from_rest.displacement_max.values[0]


@pytest.mark.parametrize(
    "model", [OneDegreePair(pair=SYMMETRIC_PAIR), pairs_as_train(SYMMETRIC_PAIR)]
)
def test_other_models_report_an_overflow(model):
    """Other models must report an overflow inside the tongue (0.945), but not outside (0.93)."""
    for nu, expected_status in ((0.93, OK), (0.945, OVERFLOW)):
        run = simulate(model, nu, periods=700, samples_per_period=1)
        assert int(run.status) == expected_status
        result = lyapunov_exponents(model, [nu], settle=200, periods=400)
        assert result.status.values.tolist() == [expected_status]
    run = sweep(model, [0.93, 0.945], periods=700, record_periods=1, direction="down")
    assert run.status.values.tolist() == [OK, OVERFLOW]


def test_a_large_initial_state_is_not_taken_for_unbounded_growth():
    """A motion that starts with a large amplitude, but decays, must have the status OK."""
    for state in ((1e9, 0.0), (0.0, 1e9)):
        run = simulate(SYMMETRIC_PAIR, 0.8, periods=2, record_periods=2, initial_state=state)
        assert int(run.status) == OK and float(run.displacement_max) > 1e8
    run = simulate(SYMMETRIC_PAIR, 0.8, periods=4000, initial_state=(1e9, 0.0))
    assert int(run.status) == OK and float(run.displacement_max) < 10.0
    result = basins(SYMMETRIC_PAIR, 0.8, ((1e7, 1e9, 2), (0.0, 0.0, 1)))
    assert result.attractor_kind.values.tolist() == [PERIODIC]

"""Motions that grow without bound, and no others, are reported as unbounded everywhere.

Neither backlash nor load matters at large amplitudes. If both flanks are alike, the motion then
obeys Hill's equation and grows without bound where its largest multiplier is greater than 1.
"""

import numpy as np
import pytest

from gearlib import GearPair, OneDegreePair, basins, lyapunov_exponents, simulate, sweep, trust
from gearlib.analysis.global_dynamics.attractors import PERIODIC
from gearlib.analysis.tongues import meissner
from gearlib.analysis.trust import LABELS, classify_at_tunings
from gearlib.data.status import OK, OVERFLOW
from tests.properties.known_models import pairs_as_train

PAIR = GearPair.from_ratios(
    contact_ratio=1.3, stiffness_ratio=0.4, damping=0.02, backlash_damping=0.01, backlash_ratio=1.0
)
#: Tunings on both sides of the lower end of the principal tongue, 0.9406, and where motions grow.
TUNINGS = np.array([0.93, 0.94, 0.941, 0.9412, 0.942, 0.9435, 0.945])
GROWS = np.array([False, False, True, True, True, True, True])


def test_motions_inside_the_tongue_are_labelled_unbounded():
    """Motions must be labelled unbounded exactly at tunings with parametric growth."""
    # Large motions grow where the linear motion in permanent contact grows.
    assert ((meissner.growth(1.3, 0.4, 0.02, TUNINGS) > 0.0) == GROWS).all()
    result = classify_at_tunings(PAIR, TUNINGS)
    names = [LABELS[code] for code in result.label.values]
    assert names == ["unbounded" if grows else "periodic" for grows in GROWS]
    assert (np.isnan(result.exponent.values) == GROWS).all()
    assert "unbounded" in result.label.flag_meanings.split()
    assert "bound" in trust(PAIR, 0.942).message


@pytest.mark.parametrize("direction", ["up", "down"])
def test_sweeps_report_an_overflow_where_motions_grow(direction):
    """Sweeps must report an overflow at tunings with growth and start anew from rest after it."""
    run = sweep(PAIR, TUNINGS, periods=6000, record_periods=2, direction=direction)
    assert (run.status.values == np.where(GROWS, OVERFLOW, OK)).all()
    assert (run.displacement_max.isnull().values == GROWS).all()
    if direction == "down":
        # After the unbounded motion at 0.941 the sweep starts at the next tuning, 0.94, from rest.
        from_rest = sweep(PAIR, [0.94], periods=6000, record_periods=2)
        assert run.displacement_max.values[1] == from_rest.displacement_max.values[0]


@pytest.mark.parametrize("model", [OneDegreePair(pair=PAIR), pairs_as_train(PAIR)])
def test_other_models_report_an_overflow(model):
    """Other models must report an overflow inside the tongue (0.945) and none outside (0.93)."""
    for nu, code in ((0.93, OK), (0.945, OVERFLOW)):
        run = simulate(model, nu, periods=700, samples_per_period=1)
        assert int(run.status) == code
        result = lyapunov_exponents(model, [nu], settle=200, periods=400)
        assert result.status.values.tolist() == [code]
    run = sweep(model, [0.93, 0.945], periods=700, record_periods=1, direction="down")
    assert run.status.values.tolist() == [OK, OVERFLOW]


def test_a_large_initial_state_is_not_taken_for_unbounded_growth():
    """A large motion that decays must get the status of a normal run."""
    for state in ((1e9, 0.0), (0.0, 1e9)):
        run = simulate(PAIR, 0.8, periods=2, record_periods=2, initial_state=state)
        assert int(run.status) == 0 and float(run.displacement_max) > 1e8
    run = simulate(PAIR, 0.8, periods=4000, initial_state=(1e9, 0.0))
    assert int(run.status) == 0 and float(run.displacement_max) < 10.0
    result = basins(PAIR, 0.8, ((1e7, 1e9, 2), (0.0, 0.0, 1)))
    assert result.attractor_kind.values.tolist() == [PERIODIC]

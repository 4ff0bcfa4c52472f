"""Motions that grow without bound are called so, everywhere, and no others are.

Far out neither backlash nor load matters: with both flanks alike the mesh is Hill's equation, and a
motion grows without bound where the largest multiplier of that is greater than 1.
"""

import math

import numpy as np
import pytest

from gearlib import (
    GearPair,
    OneDegreePair,
    basins,
    bifurcation_diagram,
    lyapunov_exponents,
    poincare_section,
    simulate,
    sweep,
    trust,
)
from gearlib.analysis.trust import LABELS, scan
from gearlib.data import status
from gearlib.data.status import NO_START, OVERFLOW
from tests.properties.known_models import pairs_as_train

PAIR = GearPair.from_ratios(
    contact_ratio=1.3, stiffness_ratio=0.4, damping=0.02, backlash_damping=0.01, backlash=1.0
)
#: Across the lower end of the principal tongue, which lies at 0.9406.
TUNINGS = np.array([0.93, 0.94, 0.941, 0.9412, 0.942, 0.9435, 0.945])
GROWS = np.array([False, False, True, True, True, True, True])
CONSERVATIVE = GearPair.from_ratios(contact_ratio=1.569, stiffness_ratio=0.5879, backlash=4.0)


def growth(pair, tuning):
    """Return the logarithm of the largest multiplier with both flanks always in contact."""
    return math.log(np.abs(np.linalg.eigvals(pairs_as_train(pair).contact_monodromy(tuning))).max())


def test_motions_inside_the_tongue_are_labelled_unbounded():
    assert [growth(PAIR, nu) > 0.0 for nu in TUNINGS] == GROWS.tolist()
    result = scan(PAIR, TUNINGS)
    names = [LABELS[code] for code in result.label.values]
    assert names == ["unbounded" if grows else "periodic" for grows in GROWS]
    assert (np.isnan(result.exponent.values) == GROWS).all()
    assert "unbounded" in result.label.flag_meanings.split()
    assert "bound" in trust(PAIR, 0.942).message


def test_exponents_have_a_status():
    result = lyapunov_exponents(PAIR, TUNINGS)
    assert result.status.values.tolist() == np.where(GROWS, OVERFLOW, 0).tolist()
    assert (np.isnan(result.exponent.values) == GROWS).all()
    states = np.zeros((2, 2))
    states[1] = math.nan
    result = lyapunov_exponents(PAIR, [0.93, 0.94], states=states)
    assert result.status.values.tolist() == [0, NO_START] and np.isnan(result.exponent.values[1])


@pytest.mark.parametrize("direction", ["up", "down"])
def test_sweeps_tell_an_overflow(direction):
    run = sweep(PAIR, TUNINGS, periods=6000, record_periods=2, direction=direction)
    expected = GROWS.copy()
    assert (run.status.values == np.where(expected, OVERFLOW, 0)).all()
    assert (run.displacement_max.isnull().values == expected).all()
    # What follows a motion without bound starts from rest.
    cold = sweep(PAIR, [0.94], periods=6000, record_periods=2)
    if direction != "up":
        np.testing.assert_array_equal(run.displacement_max.values[1], cold.displacement_max[0])


def test_diagrams_and_sections_tell_an_overflow():
    result = bifurcation_diagram(PAIR, [0.94, 0.9435], settle=2000, strobes=4)
    assert result.status.values.tolist() == [0, OVERFLOW]
    assert result.displacement.isnull().values.tolist() == [[False] * 4, [True] * 4]
    one = poincare_section(PAIR, 0.9435, [(0.0, 0.0)], periods=4, settle=2000)
    assert one.status.values.tolist() == [OVERFLOW] and one.final_state.isnull().all()


def test_basins_have_an_unbounded_class():
    grid = ((-2.0, 2.0, 4), (-2.0, 2.0, 4))
    for nu, kind in ((0.93, "periodic"), (0.941, "unbounded"), (0.945, "unbounded")):
        result = basins(PAIR, nu, grid)
        flags = result.attractor_kind.flag_meanings.split()
        assert [flags[code] for code in result.attractor_kind.values] == [kind]


@pytest.mark.parametrize("make", [lambda pair: OneDegreePair(pair=pair), pairs_as_train])
def test_other_models_tell_an_overflow(make):
    model = make(PAIR)
    for nu, code in ((0.93, 0), (0.945, OVERFLOW)):
        run = simulate(model, nu, periods=700, samples_per_period=1)
        assert int(run.status) == code
        result = lyapunov_exponents(model, [nu], settle=200, periods=400)
        assert result.status.values.tolist() == [code]
    run = sweep(model, [0.93, 0.945], periods=700, record_periods=1, direction="down")
    assert run.status.values.tolist() == [0, OVERFLOW]


def test_a_start_far_out_is_no_growth():
    for state in ((1e9, 0.0), (0.0, 1e9)):
        run = simulate(PAIR, 0.8, periods=2, record_periods=2, initial_state=state)
        assert int(run.status) == 0 and float(run.displacement_max) > 1e8
    run = simulate(PAIR, 0.8, periods=4000, initial_state=(1e9, 0.0))
    assert int(run.status) == 0 and float(run.displacement_max) < 10.0
    result = basins(PAIR, 0.8, ((1e7, 1e9, 2), (0.0, 0.0, 1)))
    assert result.attractor_kind.values.tolist() == [0]


@pytest.mark.parametrize(("trains", "method"), [(False, "scipy"), (True, "rk4"), (False, "exact")])
def test_sweeps_of_methods_that_run_one_tuning_after_the_other_say_so_too(trains, method):
    pair = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.3, backlash=0.0)
    curve = sweep(
        pairs_as_train(pair) if trains else pair,
        [0.7, 2.0],
        periods=60,
        record_periods=1,
        method=method,
    )
    # Beyond 1e8, and far from what a float can hold.
    assert math.log(1e9) < 60 * growth(pair, 2.0) < math.log(1e100)
    assert curve.status.values.tolist() == [status.OK, OVERFLOW]
    for name in ("displacement_max", "dynamic_force_min", "fraction_normal", "final_state"):
        gone = np.isnan(curve[name].transpose("tuning", ...)).values.reshape(2, -1)
        assert not gone[0].any() and gone[1].all(), name

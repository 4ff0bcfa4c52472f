"""Order spectra: the balance of every order, a shift of time, whole revolutions."""

import numpy as np
import pytest

from gearlib import DeadZoneOscillator, GearPair, OneDegreePair, orders, simulate
from tests.paper import PAPER

COMMON = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "teeth": 24}
LOSING = GearPair.from_ratios(damping=0.02, backlash=0.5, backlash_damping=0.01, **COMMON)
THRICE = PAPER.replace(material_damping=1000.0)


def run(pair, tuning=1.0, **more):
    return simulate(pair, tuning, **{"periods": 600, "record_periods": 24} | more)


def test_constant_stiffness_has_a_mean_only():
    pair = GearPair.from_ratios(contact_ratio=2.0, stiffness_ratio=0.6, damping=0.05)
    found = orders(run(pair, 0.66))
    assert found.force_amplitude.values[0] == pytest.approx(float(pair.load), rel=1e-12)
    assert found.error_amplitude.values[1:].max() < 1e-9


@pytest.mark.parametrize("tuning", [0.66, 1.0])
def test_the_balance_of_every_order_holds(tuning):
    # (-w^2 + i w d) X + F / nu^2 = 0 at w > 0 by the equation of motion, in contact or not, where
    # both dampings are equal; the mean force is the load.
    pair = GearPair.from_ratios(damping=0.03, backlash=0.5, backlash_damping=0.03, **COMMON)
    found = orders(run(pair, tuning, periods=1500, samples_per_period=2048), count=40)
    w = found.mesh_order.values[24::24]
    x = found.error_amplitude.values[24::24] * np.exp(1j * found.error_phase.values[24::24])
    force = found.force_amplitude.values[24::24] * np.exp(1j * found.force_phase.values[24::24])
    stiffness = x * (w**2 - 1j * w * 0.06 / tuning) * tuning**2
    assert np.abs(stiffness - force).max() < 1e-6
    assert found.force_amplitude.values[0] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("model", [THRICE, OneDegreePair(pair=THRICE)])
def test_every_order_is_the_mean_of_the_motion_with_its_wave(model):
    # Three mesh periods, all phases of contact; the record begins within a revolution. Cosines and
    # sines by hand, no transform.
    asked = {"tuning": 1.055, "periods": 1507, "initial_state": (-2.0, 1.0)}
    found = orders(run(model, **asked), count=4)
    fine = run(model, samples_per_period=4096, **asked)
    phase, x = fine.phase.values, fine.displacement.values
    assert fine.period == 3 and set(fine.contact.values) == {-1, 0, 1}
    for i in range(4 * 24 + 1):
        w, once = i / 24.0, 2.0 if i else 1.0
        cosine, sine = (once * np.mean(x * wave(w * phase)) for wave in (np.cos, np.sin))
        own = found.error_amplitude.values[i] * np.exp(1j * found.error_phase.values[i])
        assert abs(own - THRICE.static_deflection * (cosine - 1j * sine)) < (
            1e-5 * THRICE.static_deflection
        )
    assert found.error_amplitude.values[8] > 0.1 * THRICE.static_deflection


def test_errors_fall_with_the_samples_and_are_estimated():
    few, more, many = (orders(run(LOSING, samples_per_period=n), count=4) for n in (64, 256, 4096))
    for name in ("force", "error"):
        exact = many[f"{name}_amplitude"].values
        wrong = [np.abs(one[f"{name}_amplitude"].values - exact).max() for one in (few, more)]
        assert wrong[1] < 0.1 * wrong[0] < 1e-3 * exact.max()
        for error, one in zip(wrong, (few, more), strict=True):
            assert error <= one[f"{name}_amplitude_error"].values.max()
    with pytest.raises(ValueError, match="samples_per_period = 32 is not allowed for these orders"):
        orders(run(LOSING, samples_per_period=32), count=4)


def test_a_later_record_changes_nothing_and_a_shift_phases_only():
    early, late = (orders(run(LOSING, periods=n), count=6) for n in (600, 607))
    at = early.mesh_order.values % 1 == 0
    for name in ("force", "error"):
        one, other = (found[f"{name}_amplitude"].values[at] for found in (early, late))
        assert np.allclose(one, other, rtol=0.0, atol=1e-9)
        one, other = (found[f"{name}_phase"].values[at] for found in (early, late))
        assert np.allclose(np.exp(1j * one), np.exp(1j * other), atol=1e-6)


def test_what_has_no_revolutions_is_refused():
    with pytest.raises(ValueError, match="multiple of 24"):
        orders(run(LOSING, periods=3, record_periods=3))
    with pytest.raises(ValueError, match="gears that turn"):
        model = DeadZoneOscillator(upper_stiffness=1.0, lower_stiffness=1.0, load=0.3)
        orders(simulate(model, 1.0, periods=3))
    assert orders(run(LOSING, record_periods=2)).order.values[1] == 12.0

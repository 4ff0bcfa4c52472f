"""Parameters of a gear pair: values of the paper, the border to SI, impossible values."""

import dataclasses
import math

import pytest

from gearlib import GearPair

PAPER = GearPair(
    max_stiffness=4.0e8,
    stiffness_ratio=0.5879,
    contact_ratio=1.569,
    reduced_mass=3.123,
    load=3289.5396,
    backlash=40e-6,
    material_damping=4000.0,
    backlash_damping=40.0,
)
RATIOS = {"contact_ratio": 1.5, "stiffness_ratio": 0.6}


def test_values_of_the_paper():
    # Printed with three digits (paper, text to Fig. 2 and 3; model.md, section 2).
    assert PAPER.mean_eigenfrequency == pytest.approx(10263.0, abs=0.5)
    assert PAPER.damping_ratio == pytest.approx(0.0624, abs=5e-5)
    assert PAPER.backlash_damping_ratio == pytest.approx(0.000624, abs=5e-7)
    assert PAPER.static_deflection == pytest.approx(10e-6, rel=1e-9)
    assert PAPER.backlash_ratio == pytest.approx(4.0, rel=1e-9)
    assert PAPER.tuning_max(0.815) == pytest.approx(0.7391, abs=5e-5)
    assert PAPER.tuning_min(0.815) == pytest.approx(0.9639, abs=5e-5)
    assert PAPER.min_stiffness == pytest.approx(0.5879 * 4e8, rel=1e-15)


def test_ratios_come_back():
    pair = GearPair.from_ratios(
        **RATIOS, damping=0.0624, backlash_damping=0.01, backlash=4.0, teeth=31
    )
    # Unit scales: only the rounding of the mean stiffness, one part in 2^52, may show.
    assert pair.damping_ratio == pytest.approx(0.0624, rel=1e-15)
    assert pair.backlash_damping_ratio == pytest.approx(0.01, rel=1e-15)
    # Exactly: a state on the far flank must lie on it.
    assert pair.backlash_ratio == 4.0 and pair.static_deflection == 1.0
    assert pair.mean_eigenfrequency == 1.0
    assert pair.mean_stiffness == pytest.approx(1.0, rel=1e-15)
    assert pair.teeth == 31


def test_infinite_and_zero_backlash():
    assert GearPair.from_ratios(**RATIOS, backlash=math.inf).backlash_ratio == math.inf
    assert GearPair.from_ratios(**RATIOS, backlash=0).backlash_ratio == 0.0


def test_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        PAPER.load = 1.0
    assert PAPER.replace(load=1.0).load == 1.0
    assert PAPER.load == 3289.5396

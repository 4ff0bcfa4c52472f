"""Tolerances of jumps: Sobol' indices and quantities against closed forms, sweeps and runs."""

import numpy as np
import pytest

import gearlib
from gearlib.uncertainty.design_quantities import DesignQuantities
from gearlib.uncertainty.indices import sobol_indices
from tests.paper import PAPER

DAMPED = PAPER.replace(material_damping=4.5e3, backlash_damping=300.0)


def scattered(model, share, names):
    """Return tolerances of a standard deviation of so much of each value."""
    return {
        name: {"mean": getattr(model, name), "std": share * getattr(model, name)} for name in names
    }


def test_indices_are_those_of_a_product():
    # Without damping the onset is a number times (C / m)^(1/2): indices of a product, by moments.
    tolerances = {
        "max_stiffness": {"min": 5e7, "max": 7.5e8},
        "reduced_mass": {"min": 0.3, "max": 6.0},
    }
    found = sobol_indices(PAPER, tolerances, ("onset_of_contact_loss",), 256, seed=3)

    def moments(low, high, power):
        mean = (high ** (power + 1) - low ** (power + 1)) / (power + 1) / (high - low)
        return mean, (np.log(high / low) if power == -0.5 else (high**2 - low**2) / 2.0) / (
            high - low
        )

    first, square = moments(5e7, 7.5e8, 0.5)
    other, inverse = moments(0.3, 6.0, -0.5)
    whole = square * inverse - (first * other) ** 2
    own = (square - first**2) * other**2 / whole, (inverse - other**2) * first**2 / whole
    index = found.first_index.values[0]
    assert index == pytest.approx(own, abs=0.02)
    assert found.total_index.values[0] == pytest.approx([1.0 - own[1], 1.0 - own[0]], abs=0.02)
    low, high = found.first_index_interval.values[0].T
    assert ((low < index) & (index < high)).all()
    assert int(found.missing_designs[0]) == 0


def test_designs_without_a_jump_are_counted():
    model = DAMPED.replace(material_damping=8.4e3)
    tolerances = scattered(model, 0.01, ("material_damping", "contact_ratio"))
    found = sobol_indices(model, tolerances, ("jump_up",), 16)
    assert 0 < int(found.missing_designs[0]) < 4 * 16
    assert np.isfinite(found.total_index.values).all()


@pytest.mark.parametrize(
    "ratio, contact_ratio, damping, backlash, first",
    [(0.429, 1.228, 0.069, 1.11, 0.86), (0.605, 1.797, 0.049, 3.96, 0.645)],
)
def test_a_motion_that_jumps_up_to_the_far_flank_falls_later(
    ratio, contact_ratio, damping, backlash, first
):
    pair = PAPER.replace(stiffness_ratio=ratio, contact_ratio=contact_ratio)
    size = damping * 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
    gap = backlash * pair.static_deflection
    pair = pair.replace(material_damping=size, backlash_damping=size, backlash=gap)
    asked = ("jump_up", "jump_down")
    found = gearlib.scatter(pair, {"load": {"std": "0.1 %"}}, asked, n=4)
    assert all((found[f"{name}_status"] == 0).all() for name in asked)
    # A sweep down over both jumps: the amplitude rises at the first and falls at the second.
    tunings = np.arange(0.6, 1.2, 0.002)
    curve = gearlib.sweep(pair, tunings, direction="down", periods=200, record_periods=1)
    height = curve.displacement_max.values
    i = int(np.argmax(np.diff(height) / height[1:]))
    low, high = curve.tuning.values[i : i + 2] * float(pair.speed(1.0))
    # Of the load alone no speed depends, but by the backlash over the deflection.
    speed = float(found.jump_down_nominal)
    assert low - 2.0 < speed < high + 2.0 < pair.speed(first)
    search = DesignQuantities(pair, ("jump_down",))
    ends = [search(pair.replace(load=share * pair.load))[0][0] for share in (0.999, 1.001)]
    assert float(found.jump_down_deviation) == pytest.approx(abs(ends[1] - ends[0]) / 2.0, rel=0.5)

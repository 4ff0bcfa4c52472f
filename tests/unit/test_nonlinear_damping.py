"""Equivalent damping: equal work per period, and what the study makes of it."""

import csv
import math

import numpy as np
import pytest
from scipy.integrate import quad

from gearlib import GearPair, OneDegreePair
from gearlib.data.files import write_table
from gearlib.studies import nonlinear_damping as study
from tests.paper import PARAMETERS

SETTINGS = {"damping": 3953.7, "amplitude": 1.0, "tuning": 0.8, "shown": [0.82]}
RUN = {"periods": 40, "record_periods": 4}


@pytest.mark.parametrize("power", [1, 2, 3, 4])
def test_work_per_period(power):
    d, amplitude, w = 7.0, 3e-5, 8000.0

    def work(t):
        v = amplitude * w * math.cos(w * t)
        return d * abs(v) ** (power - 1) * v * v

    # Half a period at a time: |v| has no kink inside.
    expected = 2.0 * quad(work, -math.pi / (2 * w), math.pi / (2 * w), epsabs=0)[0]
    assert study.dissipation(d, power, amplitude, w) == pytest.approx(expected, rel=1e-12)
    k = study.equivalent(d, power, amplitude, w)
    assert study.dissipation(k, power, amplitude, w) == pytest.approx(
        study.dissipation(d, 1, amplitude, w), rel=1e-14
    )


def test_textbook_coefficients():
    amplitude, w = 3e-5, 8000.0
    v = amplitude * w
    assert study.equivalent(1.0, 1, amplitude, w) == pytest.approx(1.0)
    assert study.equivalent(1.0, 2, amplitude, w) == pytest.approx(3 * math.pi / (8 * v))
    assert study.equivalent(1.0, 3, amplitude, w) == pytest.approx(4 / (3 * v * v))


def test_models():
    linear, k = study.model(PARAMETERS, "oil", "linear", SETTINGS)
    assert isinstance(linear, GearPair) and linear.backlash_damping == k
    assert k == pytest.approx(3953.7, rel=1e-15)
    cubic, k = study.model(PARAMETERS, "material", "cubic", SETTINGS)
    assert isinstance(cubic, OneDegreePair) and cubic.cubic_damping == k
    assert cubic.pair.material_damping == cubic.backlash_cubic_damping == 0.0


def test_study(tmp_path):
    tunings = np.linspace(0.7, 1.0, 16)
    studies = [
        study.compute(PARAMETERS, "material", power, tunings, SETTINGS, RUN, 16)
        for power in study.POWERS
    ]
    jumps = [float(one.jump.sel(direction="cold")) for one in studies]
    # The linear mesh jumps; cubic damping, stronger at large amplitudes, closes the jump.
    assert 0.81 < jumps[0] < 0.82 and math.isnan(jumps[2])
    peaks = [float(one.peak.sel(direction="cold")) for one in studies]
    assert peaks[0] > peaks[1] > peaks[2]
    write_table(study.rows(studies), tmp_path / "table.csv")
    with open(tmp_path / "table.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 9
    assert [row["unit"] for row in rows[::3]] == ["N s m-1", "N s2 m-2", "N s3 m-3"]


def test_widest_stretch():
    assert study._widest(np.array([0, 1, 0, 1, 1, 0], bool)) == (3, 4)
    assert study._widest(np.array([1, 1], bool)) == (0, 1)
    assert study._widest(np.zeros(3, bool)) == (None, None)

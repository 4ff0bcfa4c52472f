"""Studies of one mesh: the jump, nonlinear damping, the phase lag, the global picture."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from gearlib import simulate
from gearlib.studies import jump, nonlinear_damping, paper
from tests.paper import PAPER, PARAMETERS
from tests.tables import read_back

PAIR = PAPER.replace(material_damping=3953.7)
RUN = {"periods": 120, "record_periods": 24}
SHORT = {"periods": 40, "record_periods": 4}
POWER = {"damping": 3953.7, "amplitude": 1.0, "tuning": 0.8, "shown": [0.82]}


def height(nu, state=(0.0, 0.0)):
    run = simulate(PAIR, nu, initial_state=state, **RUN)
    return float(run.displacement_max - run.displacement_min)


def test_both_sides_of_the_jump_from_rest():
    found = jump.find(PAIR, np.linspace(0.80, 0.83, 31), 1e-9, **RUN)
    assert found.switches == 1
    # The orbits just beside the reported tuning are those reported, as far as they have settled:
    # the closer to the jump, the later a run leaves the unstable orbit between the two.
    assert height(found.tuning - 1e-9) == pytest.approx(found.below, abs=0.2)
    assert height(found.tuning + 1e-9) == pytest.approx(found.above, abs=0.2)
    assert found.above - found.below > 2.0


def test_up_and_down_enclose_a_hysteresis():
    long = {"periods": 400, "record_periods": 4}
    scan = np.linspace(0.58, 0.84, 131)
    up = jump.find(PAIR, scan, 1e-6, "up", **long)
    down = jump.find(PAIR, scan, 1e-6, "down", **long)
    assert 0.6 < down.tuning < 0.7 < 0.815 < up.tuning < 0.82
    # A finer scan follows the same branches to the same ends.
    finer = jump.find(PAIR, np.linspace(0.80, 0.84, 81), 1e-6, "up", **long)
    assert finer.tuning == pytest.approx(up.tuning, abs=1e-4)


@pytest.mark.parametrize("power", [1, 2, 3, 4])
def test_coefficients_are_of_equal_work(power):
    d, amplitude, w = 7.0, 3e-5, 8000.0

    def work(t):
        v = amplitude * w * math.cos(w * t)
        return d * abs(v) ** (power - 1) * v * v

    # Half a period at a time: |v| has no kink inside.
    expected = 2.0 * quad(work, -math.pi / (2 * w), math.pi / (2 * w), epsabs=0)[0]
    found = nonlinear_damping.dissipation(d, power, amplitude, w)
    assert found == pytest.approx(expected, rel=1e-12)
    textbook = {1: 1.0, 2: 3 * math.pi / (8 * amplitude * w), 3: 4 / (3 * (amplitude * w) ** 2)}
    if power in textbook:
        found = nonlinear_damping.equivalent(1.0, power, amplitude, w)
        assert found == pytest.approx(textbook[power])


def test_the_study_of_nonlinear_damping(tmp_path):
    tunings = np.linspace(0.7, 1.0, 16)
    studies = [
        nonlinear_damping.compute(PARAMETERS, "material", power, tunings, POWER, SHORT, 16)
        for power in nonlinear_damping.POWERS
    ]
    jumps = [float(one.jump.sel(direction="cold")) for one in studies]
    # The linear mesh jumps; cubic damping, stronger at large amplitudes, closes the jump.
    assert 0.81 < jumps[0] < 0.82 and math.isnan(jumps[2])
    peaks = [float(one.peak.sel(direction="cold")) for one in studies]
    assert peaks[0] > peaks[1] > peaks[2]
    rows = read_back(nonlinear_damping.rows(studies), tmp_path)
    assert len(rows) == 9
    assert [row["unit"] for row in rows[::3]] == ["N s m-1", "N s2 m-2", "N s3 m-3"]


def test_phase_lag_of_a_mesh_without_resonance():
    # Slowly, in contact and with small stiffness swings, y follows F / C at once: 180 degrees
    # against the stiffness, and damping adds the lag of a first-order system.
    pair = {
        "max_stiffness": 4e8,
        "stiffness_ratio": 0.99,
        "contact_ratio": 1.5,
        "reduced_mass": 3.0,
        "load": 3000.0,
        "backlash": math.inf,
    }
    options = {"harmonics": 1, "periods": 60, "samples_per_period": 4096}
    damping = 2.0 * 0.5 * math.sqrt(3.0 * 3.98e8)
    lags = paper.phase_lag(pair, [damping], 0.05, [0.05, 0.1], **options)
    for nu, lag in zip((0.05, 0.1), lags.first_lag.values[0], strict=True):
        # Transfer function of the mean oscillator, beta = 0.5; the swing is 1 % of it.
        expected = 180.0 + math.degrees(math.atan2(nu, 1.0 - nu * nu))
        assert lag == pytest.approx(expected, abs=0.1)

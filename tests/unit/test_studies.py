"""Studies of one mesh: both sides of the jump, equal work of dampings, the phase lag."""

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


def test_both_sides_of_the_jump_from_rest():
    edge = jump.find(PAIR, np.linspace(0.80, 0.83, 31), 1e-9, **RUN)
    # The orbits just beside the reported tuning are those reported, as far as they have settled:
    # the closer to the jump, the later a run leaves the unstable orbit between the two.
    for tuning, height in ((edge.tuning - 1e-9, edge.below), (edge.tuning + 1e-9, edge.above)):
        run = simulate(PAIR, tuning, **RUN)
        assert float(run.displacement_max - run.displacement_min) == pytest.approx(height, abs=0.2)
    assert edge.switches == 1 and edge.above - edge.below > 2.0
    smooth = jump.find(PAIR, np.linspace(0.70, 0.78, 5), 1e-6, **RUN)
    assert np.isnan(smooth.tuning) and smooth.switches == 0


def test_up_and_down_enclose_a_hysteresis():
    run = {"periods": 400, "record_periods": 4}
    scan = np.linspace(0.58, 0.84, 131)
    up, down = (jump.find(PAIR, scan, 1e-6, direction, **run) for direction in ("up", "down"))
    assert 0.6 < down.tuning < 0.7 < 0.815 < up.tuning < 0.82
    # A finer scan follows the same branches to the same ends.
    finer = jump.find(PAIR, np.linspace(0.80, 0.84, 81), 1e-6, "up", **run)
    assert finer.tuning == pytest.approx(up.tuning, abs=1e-4)


@pytest.mark.parametrize("power", [1, 2, 3, 4])
def test_coefficients_are_of_equal_work(power):
    d, amplitude, w = 7.0, 3e-5, 8000.0

    def work(t):
        v = amplitude * w * math.cos(w * t)
        return d * abs(v) ** (power - 1) * v * v

    # Half a period at a time: |v| has no kink inside.
    expected = 2.0 * quad(work, -math.pi / (2 * w), math.pi / (2 * w), epsabs=0)[0]
    loss = nonlinear_damping.dissipation(d, power, amplitude, w)
    assert loss == pytest.approx(expected, rel=1e-12)
    coefficient = nonlinear_damping.equivalent(1.0, power, amplitude, w)
    assert nonlinear_damping.dissipation(coefficient, power, amplitude, w) == pytest.approx(
        nonlinear_damping.dissipation(1.0, 1, amplitude, w)
    )


def test_the_table_of_nonlinear_damping_has_jumps_peaks_and_units(tmp_path):
    power = {"damping": 3953.7, "amplitude": 1.0, "tuning": 0.8, "shown": [0.82]}
    run, tunings = {"periods": 40, "record_periods": 4}, np.linspace(0.7, 1.0, 16)
    studies = [
        nonlinear_damping.compute(PARAMETERS, "material", name, tunings, power, run, 16)
        for name in nonlinear_damping.POWERS
    ]
    # The linear mesh jumps; cubic damping, stronger at large amplitudes, closes the jump.
    jumps = [float(study.jump.sel(direction="cold")) for study in studies]
    peaks = [float(study.peak.sel(direction="cold")) for study in studies]
    assert 0.81 < jumps[0] < 0.82 and math.isnan(jumps[2]) and peaks[0] > peaks[1] > peaks[2]
    rows = read_back(nonlinear_damping.rows(studies), tmp_path)
    assert len(rows) == 9
    assert [row["unit"] for row in rows[::3]] == ["N s m-1", "N s2 m-2", "N s3 m-3"]


def test_phase_lag_of_a_mesh_without_resonance():
    # Slowly, in contact and with small stiffness swings, y follows F / C at once: 180 degrees
    # against the stiffness, and damping adds the lag of a first-order system.
    pair = PARAMETERS | {"stiffness_ratio": 0.99, "contact_ratio": 1.5, "backlash": math.inf}
    options = {"harmonics": 1, "periods": 60, "samples_per_period": 4096}
    damping = 2.0 * 0.5 * math.sqrt(pair["reduced_mass"] * 0.995 * pair["max_stiffness"])
    lags = paper.phase_lag(pair, [damping], 0.05, [0.05, 0.1], **options)
    for nu, lag in zip((0.05, 0.1), lags.first_lag.values[0], strict=True):
        # Transfer function of the mean oscillator, beta = 0.5; the swing is 1 % of it.
        expected = 180.0 + math.degrees(math.atan2(nu, 1.0 - nu * nu))
        assert lag == pytest.approx(expected, abs=0.1)

"""The jump of the orbit between two tunings: found, bisected, and not invented."""

import numpy as np
import pytest

from gearlib import simulate
from gearlib.studies import jump
from tests.paper import PAPER

PAIR = PAPER.replace(material_damping=3953.7)
RUN = {"periods": 120, "record_periods": 24}


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


def test_the_scan_does_not_matter():
    # Intervals of bisection end within their resolution, 1e-9.
    coarse = jump.find(PAIR, np.linspace(0.79, 0.85, 7), 1e-9, **RUN)
    fine = jump.find(PAIR, np.linspace(0.81, 0.82, 101), 1e-9, **RUN)
    assert abs(coarse.tuning - fine.tuning) <= 2e-9


def test_a_smooth_curve_has_no_jump():
    found = jump.find(PAIR, np.linspace(0.70, 0.78, 5), 1e-6, **RUN)
    assert np.isnan(found.tuning) and found.switches == 0


def test_up_and_down_enclose_a_hysteresis():
    long = {"periods": 400, "record_periods": 4}
    scan = np.linspace(0.58, 0.84, 131)
    up = jump.find(PAIR, scan, 1e-6, "up", **long)
    down = jump.find(PAIR, scan, 1e-6, "down", **long)
    assert 0.6 < down.tuning < 0.7 < 0.815 < up.tuning < 0.82
    # A finer scan follows the same branches to the same ends.
    finer = jump.find(PAIR, np.linspace(0.80, 0.84, 81), 1e-6, "up", **long)
    assert finer.tuning == pytest.approx(up.tuning, abs=1e-4)


def test_variations():
    settings = {
        "resolution": 1e-5,
        "harmonics": [20],
        "factors": [0.9],
        "displacements": [0.1],
        "velocities": [0.1],
        "tolerances": [1e-3, 1e-8],
        "starts": 4,
        "seed": 1,
        "spread": 0.02,
    }
    found = jump.compute(PAIR.as_dict(), np.linspace(0.80, 0.83, 16), settings, RUN)
    kinds = [*jump.KINDS]
    assert found.kind.values.tolist() == [*kinds, "tolerance"]
    shift = dict(zip(found.kind.values, found["shift"].values, strict=True))
    # No orbit of the scan reaches the far flank: its place cannot matter.
    assert shift["base"] == shift["backlash"] == 0.0
    assert shift["damping"] < -1e-3 and shift["displacement"] < -1e-4
    assert abs(shift["harmonics"]) < 2e-5 and abs(shift["tolerance"]) < 1e-4
    assert all("units" in found[name].attrs for name in ("jump", "shift", "height"))

"""Check the jumps in curves of the dynamic factor over speed."""

import numpy as np
import pytest

from gearlib.models.from_values import build_load_sharing_pair
from gearlib.studies.jump import find_jump
from gearlib.studies.teeth_over_speed import sweep_speeds

GEARS = {
    "pinion": {"teeth": 23, "module": 2.5e-3, "width": 20e-3},
    "wheel": {"teeth": 61},
    "torque": 100.0,
}
RUN_OPTIONS = {"periods": 200, "record_periods": 10}


def test_jumps_match_bisection_and_exclude_the_ends_of_the_sweep():
    """Jump speeds of sweeps must agree with a bisection within half the step of the sweep.

    A downward sweep that ends above its jump must report none.
    """
    model = build_load_sharing_pair(GEARS, {"damping_ratio": 0.05}, pitch_errors=False)
    tunings = np.linspace(0.36, 1.1, 149)
    step = float(model.speed(tunings[1] - tunings[0]))
    curves = sweep_speeds(model, model.speed(tunings), **RUN_OPTIONS)
    for name in ("up", "down"):
        jump = find_jump(model, tunings, 1e-4, name, initial_state="static", **RUN_OPTIONS)
        (jump_speed,) = curves[f"jump_{name}_speed"].values
        assert jump_speed == pytest.approx(float(model.speed(jump.tuning)), abs=0.51 * step)
    # The lowest tuning of a shorter sweep lies above the downward jump.
    higher_tunings = tunings[tunings > 0.604]
    curves_above = sweep_speeds(model, model.speed(higher_tunings), **RUN_OPTIONS)
    assert np.isnan(curves_above.jump_down_speed).all()
    assert curves_above.jump_up_speed == curves.jump_up_speed

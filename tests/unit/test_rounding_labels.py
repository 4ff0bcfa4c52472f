"""What rounding decides carries a label: growth of deviations, and the studies that ask for it."""

import numpy as np
import pytest

from gearlib import simulate
from gearlib.analysis import lyapunov
from gearlib.studies import global_picture as studies
from gearlib.studies import jump, nonlinear_damping, paper
from tests.paper import PAPER

LIGHT = PAPER.replace(material_damping=40.0)
OIL, _ = nonlinear_damping.model(
    PAPER.as_dict(), "oil", "linear", {"damping": 3953.7, "amplitude": 1.0, "tuning": 0.8}
)


def test_growth_is_that_of_two_runs_side_by_side():
    beside, periods = 1e-11, 228
    ends = [
        simulate(LIGHT, 0.665, periods=periods, initial_state=(x, x)).final_state.values
        for x in (0.0, beside)
    ]
    away = np.hypot(*((ends[1] - ends[0]) * (1.0, 0.665)))
    growth = lyapunov.largest(LIGHT, 0.665, settle=0, periods=periods).growth
    assert growth == pytest.approx(np.log(away / beside), abs=0.01)
    assert not lyapunov.rounding_decides(LIGHT, [0.665], (0.0, 0.0), periods)
    assert lyapunov.rounding_decides(LIGHT, [0.66], (0.0, 0.0), 400)


def test_lags_behind_chaos_are_left_out():
    # After so many the run happens to repeat after one: it is left out all the same.
    options = {"harmonics": 2, "periods": 6000, "samples_per_period": 16}
    found = paper.phase_lag(PAPER.as_dict(), [4000.0, 40.0], 0.66, [0.65, 0.66], **options)
    assert found.settled.values.tolist() == [[1, 1], [1, 0]]
    assert np.isnan(found.first_lag.values[1, 1]) and np.isfinite(found.first_lag.values[0]).all()
    assert np.isnan(found.displacement.values[1]).all() and np.isnan(found.lag.values[1]).all()
    assert np.isfinite(found.displacement.values[0]).all()


def test_a_carried_motion_is_lost_behind_chaos_until_all_are_on_one_orbit():
    third = PAPER.replace(material_damping=1281.6, backlash_damping=1281.6)
    tunings = np.array([0.575, 0.7, 0.9])
    chaotic, rest = (1.6435, -2.7626), (0.0, 0.0)
    directions, starts = ["up", "cold", "cold"], [chaotic, chaotic, rest]
    options = {"settle": 400, "strobes": 48}
    diagrams = [
        studies.bifurcation_diagram(third, tunings, direction=name, initial_state=start, **options)
        for name, start in zip(directions, starts, strict=True)
    ]
    # At 0.7 the two cold starts end on two orbits, at 0.9 all on one.
    found = lyapunov.settled(third, diagrams, directions, starts)
    assert found.tolist() == [[False, False, True], [False, True, True], [True, True, True]]


def test_a_jump_out_of_a_chaotic_transient_is_known_to_an_interval():
    run = {"periods": 120, "record_periods": 24}
    found = jump.find(OIL, np.linspace(0.588, 1.0, 104), 1e-6, "down", **run)
    # On the branch at 0.612 still, and not at 0.608 any more.
    assert 0.608 < found.tuning < 0.612 and 1e-4 < found.interval < 0.004
    assert found.below < 2.0 and found.above > 8.5
    up = jump.find(OIL, np.linspace(0.79, 0.81, 6), 1e-6, **run)
    assert up.interval < 1e-6


def test_a_method_under_step_control_is_asked_from_many_starts():
    settings = {
        "resolution": 1e-5,
        "harmonics": [],
        "factors": [],
        "displacements": [],
        "velocities": [],
        "tolerances": [1e-2],
        "starts": 3,
        "seed": 1,
        "spread": 0.02,
    }
    pair = PAPER.replace(material_damping=3953.7).as_dict()
    run = {"periods": 120, "record_periods": 24}
    found = jump.compute(pair, np.linspace(0.80, 0.83, 16), settings, run)
    assert found.settled.values.tolist() == [1, 0]
    assert found.shift_low[1] < found["shift"][1] < found.shift_high[1]


def test_sections_have_undecided_motions():
    cases = [{"title": "", "tuning": 0.66, "phase": 0.0, "settle": 0, "pair": PAPER.as_dict()}]
    settings = {"displacement": (-5.0, 6.0), "velocity": (-6.0, 6.0), "orbits": 31, "periods": 600}
    found = studies.sections(cases, settings)
    grown = 600 * found.exponent.values[0]
    kinds = found.chaotic.values[0]
    assert (grown[kinds == 2] < lyapunov.MAX_LOG_GROWTH).all() and (kinds == 2).any()
    assert (grown[kinds == 1] > 14.0).all()

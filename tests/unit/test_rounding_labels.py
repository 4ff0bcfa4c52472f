"""What rounding decides carries a label: growth of deviations, and the studies that ask for it."""

import numpy as np
import pytest

from gearlib import simulate
from gearlib.analysis import lyapunov
from gearlib.studies import global_picture as studies
from gearlib.studies import jump
from tests.paper import PAPER

LIGHT = PAPER.replace(material_damping=40.0)
OIL = PAPER.replace(backlash_damping=3953.7)


def test_growth_is_that_of_two_runs_side_by_side():
    beside, periods = 1e-11, 228
    ends = [
        simulate(LIGHT, 0.665, periods=periods, initial_state=(x, x)).final_state.values
        for x in (0.0, beside)
    ]
    away = np.hypot(*((ends[1] - ends[0]) * (1.0, 0.665)))
    growth = lyapunov.largest_exponent(LIGHT, 0.665, settle=0, periods=periods).growth
    assert growth == pytest.approx(np.log(away / beside), abs=0.01)
    assert not lyapunov.rounding_grows(LIGHT, [0.665], (0.0, 0.0), periods)
    assert lyapunov.rounding_grows(LIGHT, [0.66], (0.0, 0.0), 400)


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
    settled = lyapunov.reproducible_orbits(third, diagrams, directions, starts)
    assert settled.tolist() == [[False, False, True], [False, True, True], [True, True, True]]


def test_a_jump_out_of_a_chaotic_transient_is_known_to_an_interval():
    run = {"periods": 120, "record_periods": 24}
    down = jump.find(OIL, np.linspace(0.588, 1.0, 104), 1e-6, "down", **run)
    # On the branch at 0.612 still, and not at 0.608 any more.
    assert 0.608 < down.tuning < 0.612 and 1e-4 < down.interval < 0.004
    assert down.below < 2.0 and down.above > 8.5
    up = jump.find(OIL, np.linspace(0.79, 0.81, 6), 1e-6, **run)
    assert up.interval < 1e-6

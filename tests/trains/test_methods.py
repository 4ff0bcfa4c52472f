"""Gear trains by methods for comparison: each against the exact one, in all that is recorded."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate

import gearlib
from gearlib.data import status
from tests.paper import PAPER

DEFLECTIONS = ("displacement", "velocity", "dynamic_force", "modified_stiffness", "body_motion")
SUMMARY = ("mean_force", "fraction_normal", "fraction_backlash", "fraction_inverse", "bounces")
MORE = ("fraction_min_stiffness", "final_state")
SPLIT = {"solver": "DOP853", "events": True, "rtol": 1e-12, "atol": 1e-12}


#: From which the idler below strikes the far side.
START = (0.5, 3.0, -2.0, 0.0, 1.0, 0.0)


def bouncing():
    """Return an idler whose flanks part and strike the far side, with friction; its start."""
    train = gearlib.idler(PAPER.replace(backlash=12e-6, material_damping=3000.0))
    return train.replace(meshes=[replace(m, friction=(0.05, 0.03)) for m in train.meshes])


def run(train, method=None, options=None, tuning=0.9, **more):
    known = dict(periods=6, record_periods=3, samples_per_period=50, initial_state="static")
    return gearlib.simulate(train, tuning, method=method, options=options, **(known | more))


def differences(result, expected):
    return {
        name: float(np.abs(result[name] - expected[name]).max())
        for name in (*DEFLECTIONS, *SUMMARY, *MORE)
    }


@pytest.mark.parametrize(
    ("method", "options", "close"),
    [
        # Over switches and contact order one or so is left.
        ("rk4", {"steps_per_period": 1000}, 2e-2),
        ("scipy", {"solver": "DOP853", "rtol": 1e-9, "atol": 1e-9}, 1e-4),
        ("scipy", {"solver": "Radau", "rtol": 1e-6, "atol": 1e-6}, 1e-2),
    ],
)
def test_steps_over_switches_come_close(method, options, close):
    train, state = bouncing(), START
    expected, result = (
        run(train, *way, initial_state=state, periods=2, record_periods=2)
        for way in ((), (method, options))
    )
    difference = differences(result, expected)
    # Contact of a sample near an event may be the other one.
    difference.pop("modified_stiffness")
    assert all(value < close for value in difference.values()), difference
    assert result.event.size == expected.event.size
    np.testing.assert_allclose(result.event_phase, expected.event_phase, rtol=0.0, atol=close)
    # Before errors have grown from bounce to bounce: well within a step of the fixed ones.
    first = [one.event_phase[:3] for one in (result, expected)]
    np.testing.assert_allclose(*first, rtol=0.0, atol=0.01 * close)


def test_runs_that_cannot_go_on_say_so():
    train = bouncing()
    for method, options in (("rk4", {"steps_per_period": 2}), ("scipy", SPLIT)):
        end = run(train, method, options, periods=900 if method == "rk4" else 3, max_events=1)
        assert int(end.status) != 0 and np.isnan(end.final_state).all()


@pytest.mark.parametrize(("state", "code"), [("static", status.STALLED), (1e160, status.OVERFLOW)])
def test_a_solver_that_gives_up_ends_the_run(state, code, monkeypatch):
    solve = scipy.integrate.solve_ivp

    def gives_up(*arguments, **options):
        done = solve(*arguments, **options)
        done.status = -1
        return done

    monkeypatch.setattr(scipy.integrate, "solve_ivp", gives_up)
    train = bouncing()
    start = state if isinstance(state, str) else np.full(train.size, state)
    assert int(run(train, "scipy", SPLIT, initial_state=start).status) == code

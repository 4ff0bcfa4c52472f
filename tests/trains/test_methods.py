"""Gear trains solved by other methods, compared with the exact method in all recorded values."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate

import gearlib
from gearlib.data import status
from tests.paper import PAPER_PAIR
from tests.physics.test_step_methods import SCIPY_WITH_EVENTS

COMPARED_VARIABLES = (
    "displacement",
    "velocity",
    "dynamic_force",
    "body_motion",
    "final_state",
    "bounces",
)
COMPARED_VARIABLES += ("mean_force", "fraction_drive", "contact_loss_fraction", "fraction_coast")
COMPARED_VARIABLES += ("fraction_min_stiffness",)
#: Initial state from which `bouncing_train` strikes the coast side.
INITIAL_STATE = (0.5, 3.0, -2.0, 0.0, 1.0, 0.0)


def bouncing_train():
    """Return an idler train with friction that bounces between both flanks."""
    train = gearlib.idler(PAPER_PAIR.replace(backlash=12e-6, material_damping=3000.0))
    return train.replace(meshes=[replace(m, friction=(0.05, 0.03)) for m in train.meshes])


@pytest.mark.parametrize(
    ("method", "options", "tolerance"),
    [
        # Steps across switches and contact events reduce the order to about one.
        ("rk4", {"steps_per_period": 1000}, 2e-2),
        ("scipy", {"solver": "DOP853", "rtol": 1e-9, "atol": 1e-9}, 1e-4),
        ("scipy", {"solver": "Radau", "rtol": 1e-6, "atol": 1e-6}, 1e-2),
    ],
)
def test_solvers_that_step_over_switches_agree_within_a_tolerance(method, options, tolerance):
    """Compare samples and events of general solvers with the exact motion."""
    settings = {
        "periods": 2,
        "record_periods": 2,
        "samples_per_period": 50,
        "initial_state": INITIAL_STATE,
    }
    exact_run = gearlib.simulate(bouncing_train(), 0.9, **settings)
    result = gearlib.simulate(bouncing_train(), 0.9, method=method, options=options, **settings)
    for name in COMPARED_VARIABLES:
        np.testing.assert_allclose(result[name], exact_run[name], 0.0, tolerance, err_msg=name)
    assert result.event.size == exact_run.event.size
    errors = np.abs(result.event_phase.values - exact_run.event_phase.values)
    # Errors grow from bounce to bounce, so that the first three events are more accurate.
    assert errors.max() < tolerance and errors[:3].max() < 0.01 * tolerance


@pytest.mark.parametrize(
    ("method", "options", "periods"),
    # rk4 is unstable with two steps in a mesh period; scipy has a second event within three
    # periods.
    [("rk4", {"steps_per_period": 2}, 900), ("scipy", SCIPY_WITH_EVENTS, 3)],
)
def test_runs_that_diverge_or_exceed_max_events_have_a_status_and_no_final_state(
    method, options, periods
):
    """Runs that diverge or exceed the event limit must report it and return NaN."""
    settings = {"periods": periods, "max_events": 1, "initial_state": "static"}
    run = gearlib.simulate(bouncing_train(), 0.9, method=method, options=options, **settings)
    assert int(run.status) != status.OK and np.isnan(run.final_state).all()


@pytest.mark.parametrize(("state", "code"), [("static", status.STALLED), (1e160, status.OVERFLOW)])
def test_a_failing_solver_ends_the_run_with_a_status(state, code, monkeypatch):
    """Make solve_ivp report a failure: the run is stalled, or has overflowed if states are huge."""
    solve_ivp = scipy.integrate.solve_ivp

    def failing_solve(*arguments, **options):
        """Solve the problem, but report a failure."""
        result = solve_ivp(*arguments, **options)
        result.status = -1
        return result

    monkeypatch.setattr(scipy.integrate, "solve_ivp", failing_solve)
    start = state if isinstance(state, str) else (state,) * bouncing_train().size
    settings = {"method": "scipy", "options": SCIPY_WITH_EVENTS, "initial_state": start}
    assert int(gearlib.simulate(bouncing_train(), 0.9, periods=6, **settings).status) == code

"""Check partial results of calls with a time limit, and progress bars."""

import io
import json
import sys
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import gearlib
from gearlib import progress
from gearlib.engines import jit
from gearlib.engines.linear import modal_arcs, train_system
from tests.paper import PAPER_PAIR

DAMPED_PAIR = PAPER_PAIR.replace(material_damping=4e3)
ONE_DEGREE_PAIR = gearlib.OneDegreePair(pair=DAMPED_PAIR)
ORBIT = gearlib.periodic_orbit(DAMPED_PAIR, 1.3)
TUNINGS, DAMPING_RATIOS = [0.6, 0.7, 0.8], [0.01, 0.02]
#: Time limits, s.
NEVER_INTERRUPT, INTERRUPT_AT_ONCE = 1e6, 1e-9
SCATTER_OPTIONS = {"tolerances": {"load": {"std": "1 %"}}, "n": 4}
RUN_OPTIONS = {"periods": 20, "record_periods": 2}
STROBE_OPTIONS = {"settle": 9, "strobes": 4}
FORCE_OPTIONS = {"quantities": ["force"], "speed": 3e3}
#: Functions with a time limit `max_seconds`, and the dimension of their result that it shortens.
CALLS = {
    "cold": (partial(gearlib.sweep, DAMPED_PAIR, TUNINGS, **RUN_OPTIONS), "tuning"),
    "up": (
        partial(gearlib.sweep, ONE_DEGREE_PAIR, TUNINGS, direction="up", **RUN_OPTIONS),
        "tuning",
    ),
    "bifurcation": (
        partial(gearlib.bifurcation_diagram, DAMPED_PAIR, TUNINGS, **STROBE_OPTIONS),
        "tuning",
    ),
    "section": (partial(gearlib.poincare_section, DAMPED_PAIR, 0.8, np.eye(2), periods=3), "orbit"),
    "exponents": (
        partial(gearlib.lyapunov_exponents, DAMPED_PAIR, TUNINGS, settle=0, periods=20),
        "tuning",
    ),
    "tongues": (
        partial(gearlib.tongues, DAMPED_PAIR, parameter="damping", values=DAMPING_RATIOS),
        "damping",
    ),
    "scatter": (
        partial(gearlib.scatter, DAMPED_PAIR, **FORCE_OPTIONS, **SCATTER_OPTIONS),
        "sample",
    ),
    "branch": (partial(gearlib.continue_orbit, ORBIT, to=1.2), "point"),
}


@pytest.mark.parametrize(("call", "dimension"), CALLS.values(), ids=CALLS)
def test_an_interrupted_call_returns_the_beginning_of_the_full_result(call, dimension):
    """A call that runs out of time must return the first entries of the full result."""
    full_result, interrupted = call(), call(max_seconds=INTERRUPT_AT_ONCE)
    result_in_time = call(max_seconds=NEVER_INTERRUPT).drop_vars("complete")
    assert result_in_time.identical(full_result.assign_attrs(missing="[]"))
    assert not interrupted.complete
    assert 0 < interrupted.sizes[dimension] < full_result.sizes[dimension]
    for name in ("displacement_max", "displacement", "exponent", "growth", "force", "state"):
        if name in interrupted and name in full_result:
            beginning = full_result[name].isel({dimension: slice(interrupted.sizes[dimension])})
            np.testing.assert_array_equal(
                interrupted[name].values[..., :1], beginning.values[..., :1]
            )


def test_missing_results_are_named():
    """The attribute `missing` must list the tunings, parameters or times without a result."""
    sweep = gearlib.sweep(
        DAMPED_PAIR, TUNINGS, direction="down", **RUN_OPTIONS, max_seconds=INTERRUPT_AT_ONCE
    )
    assert json.loads(sweep.missing) == [0.6, 0.7]
    branch = gearlib.continue_orbit(ORBIT, to=1.2, max_seconds=INTERRUPT_AT_ONCE)
    assert json.loads(branch.missing) == [[branch.tuning[-1], 1.2]]
    derivatives = gearlib.sensitivities(
        lambda model: model.load, DAMPED_PAIR, ("load", "backlash"), max_seconds=INTERRUPT_AT_ONCE
    )
    assert json.loads(derivatives.missing) == ["backlash"]
    run = gearlib.run_up(DAMPED_PAIR, 1e3, 4e3, duration=3.0, max_seconds=INTERRUPT_AT_ONCE)
    ((missing_start, missing_stop),) = json.loads(run.missing)
    assert run.revolution_time[-1] < missing_start < missing_stop == 3.0


def test_motions_not_computed_in_time_are_undecided():
    """Basins and `trust` must call a motion undecided if it was not computed in time."""
    grid = (-3, 3, 9), (-3, 3, 9)
    basins = gearlib.basins(DAMPED_PAIR, 0.8, grid, max_seconds=INTERRUPT_AT_ONCE)
    assert basins.missing == '["undecided"]' and basins.share[-1] > 0.5
    verdict = gearlib.trust(
        DAMPED_PAIR, 0.8, periods=50, exponent_periods=20, max_seconds=INTERRUPT_AT_ONCE
    )
    assert verdict.label == "undecided" and "exponent" in verdict.message


def test_an_interrupted_proof_certifies_the_range_up_to_the_missing_one():
    """An interrupted proof must have the first part of the full one and name the missing range."""
    pytest.importorskip("flint")
    start, stop = 1.3, 1.4
    interrupted = gearlib.certify_range(ORBIT, to=stop, max_seconds=INTERRUPT_AT_ONCE)
    full_proof = gearlib.certify_range(ORBIT, to=stop, max_seconds=NEVER_INTERRUPT)
    assert interrupted.start == start and not interrupted.complete
    assert interrupted.missing == ((interrupted.stop, stop),)
    assert interrupted.pieces == full_proof.pieces[:1]
    assert interrupted.pieces[-1].stop == interrupted.stop < stop
    assert full_proof == gearlib.certify_range(ORBIT, to=stop)
    assert "missing" not in full_proof.as_dict()


@pytest.mark.parametrize("output", ["terminal", "notebook", "file"])
def test_one_progress_bar_is_shown_on_a_terminal(output, monkeypatch):
    """A bar must be shown on terminals and in notebooks, not in files, nor for inner loops."""
    stream = io.StringIO()
    stream.isatty = lambda: output == "terminal"
    shell = SimpleNamespace(kernel=1) if output == "notebook" else None
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setattr(progress, "DELAY", 0.0)
    monkeypatch.setattr(sys, "stderr", stream)
    for _ in progress.with_progress_bar("things", "ab"):
        list(progress.with_progress_bar("inner things", "cd"))
    printed = stream.getvalue()
    assert ("things/s" in printed) == (output != "file") and "inner" not in printed


@pytest.mark.parametrize("is_enabled", [True, False])
def test_the_garbage_collector_pauses_only_while_a_kernel_is_compiled(is_enabled, monkeypatch):
    """A compilation, and others within it, must leave the collector as the user has set it."""
    states = {"is_enabled": is_enabled}
    collector = SimpleNamespace(
        isenabled=lambda: states["is_enabled"],
        disable=lambda: states.update(is_enabled=False),
        enable=lambda: states.update(is_enabled=True),
    )
    monkeypatch.setattr(jit, "gc", collector)
    listener = jit._CompilationListener()
    event = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=gearlib.simulate)})
    for step in (listener.on_start, listener.on_start, listener.on_end):
        step(event)
        assert not states["is_enabled"]
    listener.on_end(event)
    assert states["is_enabled"] == is_enabled


def test_a_run_does_not_depend_on_earlier_runs_if_the_cache_of_modes_is_full(monkeypatch):
    """Contact combinations beyond the cached ones are integrated by series, to rounding errors.

    The final state must then be the same after any other run that fills the cache.
    """
    pair = PAPER_PAIR.replace(material_damping=0.0)
    reducer = gearlib.split_power_reducer(pair, branches=2, structural_damping=0.0)
    final_state_by_modes = gearlib.simulate(reducer, 0.9, periods=12).final_state
    for module in (modal_arcs, train_system):
        monkeypatch.setattr(module, "MAX_COMBINATIONS", 8)

    def final_state(earlier_periods=0):
        """Return the final state of a run, after an earlier run if it has periods."""
        train = reducer.replace()
        if earlier_periods:
            initial_state = tuple(-train.start_state("static"))
            gearlib.simulate(train, 0.9, periods=earlier_periods, initial_state=initial_state)
        return gearlib.simulate(train, 0.9, periods=12).final_state

    np.testing.assert_allclose(final_state(), final_state_by_modes, rtol=0.0, atol=1e-12)
    for earlier_periods in (1, 12):
        np.testing.assert_array_equal(final_state(), final_state(earlier_periods))

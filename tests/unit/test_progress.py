"""Long calls: partial results after a time limit, and progress bars."""

import io
import json
import sys
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import gearlib
from gearlib import progress
from gearlib.engines.linear import modal_arcs, train_system
from tests.paper import PAPER_PAIR

PAIR = PAPER_PAIR.replace(material_damping=4e3)
ONE = gearlib.OneDegreePair(pair=PAIR)
ORBIT = gearlib.periodic_orbit(PAIR, 1.3)
GRID, DAMPINGS, NEVER, AT_ONCE = [0.6, 0.7, 0.8], [0.01, 0.02], 1e6, 1e-9
SCATTERED = {"tolerances": {"load": {"std": "1 %"}}, "n": 4}
RUN = {"periods": 20, "record_periods": 2}
STROBES = {"settle": 9, "strobes": 4}
FORCE = {"quantities": ["force"], "speed": 3e3}
#: Calls with `max_seconds`, and the dimension along which an interrupted result is shorter.
CALLS = {
    "cold": (partial(gearlib.sweep, PAIR, GRID, **RUN), "tuning"),
    "up": (partial(gearlib.sweep, ONE, GRID, direction="up", **RUN), "tuning"),
    "bifurcation": (partial(gearlib.bifurcation_diagram, PAIR, GRID, **STROBES), "tuning"),
    "section": (partial(gearlib.poincare_section, PAIR, 0.8, np.eye(2), periods=3), "orbit"),
    "exponents": (partial(gearlib.lyapunov_exponents, PAIR, GRID, settle=0, periods=20), "tuning"),
    "tongues": (partial(gearlib.tongues, PAIR, parameter="damping", values=DAMPINGS), "damping"),
    "scatter": (partial(gearlib.scatter, PAIR, **FORCE, **SCATTERED), "sample"),
    "branch": (partial(gearlib.continue_orbit, ORBIT, to=1.2), "point"),
}


@pytest.mark.parametrize(("call", "dimension"), CALLS.values(), ids=CALLS)
def test_an_interrupted_call_returns_the_beginning_of_the_full_result(call, dimension):
    """A call that runs out of time must return the first part of the full result."""
    whole, interrupted = call(), call(max_seconds=AT_ONCE)
    assert call(max_seconds=NEVER).drop_vars("complete").identical(whole.assign_attrs(missing="[]"))
    assert not interrupted.complete and 0 < interrupted.sizes[dimension] < whole.sizes[dimension]
    for name in ("displacement_max", "displacement", "exponent", "growth", "force", "state"):
        if name in interrupted and name in whole:
            beginning = whole[name].isel({dimension: slice(interrupted.sizes[dimension])})
            np.testing.assert_array_equal(
                interrupted[name].values[..., :1], beginning.values[..., :1]
            )


def test_missing_results_are_named():
    """Interrupt different studies at once, and read the list of missing results."""
    sweep = gearlib.sweep(PAIR, GRID, direction="down", **RUN, max_seconds=AT_ONCE)
    assert json.loads(sweep.missing) == [0.6, 0.7]
    branch = gearlib.continue_orbit(ORBIT, to=1.2, max_seconds=AT_ONCE)
    assert json.loads(branch.missing) == [[branch.tuning[-1], 1.2]]
    slopes = gearlib.sensitivities(
        lambda m: m.load, PAIR, ("load", "backlash"), max_seconds=AT_ONCE
    )
    assert json.loads(slopes.missing) == ["backlash"]
    run = gearlib.run_up(PAIR, 1e3, 4e3, duration=3.0, max_seconds=AT_ONCE)
    (missing_time,) = json.loads(run.missing)
    assert run.revolution_time[-1] < missing_time[0] < missing_time[1] == 3.0


def test_starts_not_reached_in_time_are_undecided():
    """Initial states that were not computed in time must count as undecided."""
    basins = gearlib.basins(PAIR, 0.8, ((-3, 3, 9), (-3, 3, 9)), max_seconds=AT_ONCE)
    assert basins.missing == '["undecided"]' and basins.share[-1] > 0.5
    verdict = gearlib.trust(PAIR, 0.8, periods=50, exponent_periods=20, max_seconds=AT_ONCE)
    assert verdict.label == "undecided" and "exponent" in verdict.message


def test_an_interrupted_proof_certifies_the_range_up_to_the_missing_one():
    """An interrupted proof must hold its first piece and name the range that is missing."""
    pytest.importorskip("flint")
    interrupted = gearlib.certify_range(ORBIT, to=1.4, max_seconds=AT_ONCE)
    whole = gearlib.certify_range(ORBIT, to=1.4, max_seconds=NEVER)
    assert (interrupted.start, interrupted.missing, interrupted.complete) == (
        1.3,
        ((interrupted.stop, 1.4),),
        False,
    )
    assert (
        interrupted.pieces == whole.pieces[:1]
        and interrupted.pieces[-1].stop == interrupted.stop < 1.4
    )
    assert whole == gearlib.certify_range(ORBIT, to=1.4) and "missing" not in whole.as_dict()


@pytest.mark.parametrize("place", ["terminal", "notebook", "file"])
def test_one_progress_bar_is_shown_on_a_terminal(place, monkeypatch):
    """A bar is shown on terminals and in notebooks, not in files, and never for inner loops."""
    stream = io.StringIO()
    stream.isatty = lambda: place == "terminal"
    shell = SimpleNamespace(kernel=1) if place == "notebook" else None
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setattr(progress, "DELAY", 0.0)
    monkeypatch.setattr(sys, "stderr", stream)
    for _ in progress.with_progress_bar("things", "ab"):
        list(progress.with_progress_bar("inner things", "cd"))
    shown = stream.getvalue()
    assert ("things/s" in shown) == (place != "file") and "inner" not in shown


def test_a_train_with_more_contacts_than_cached_modes_runs_after_any_other_run(monkeypatch):
    """Beyond the cached modes series take over, which are exact to rounding as well."""
    pair = PAPER_PAIR.replace(material_damping=0.0)
    reducer = gearlib.split_power_reducer(pair, branches=2, structural_damping=0.0)
    by_modes = gearlib.simulate(reducer, 0.9, periods=12).final_state
    for module in (modal_arcs, train_system):
        monkeypatch.setattr(module, "MAX_COMBINATIONS", 8)

    def final_state(periods_before=0):
        """Return the final state of a run, after an optional other run that fills the caches."""
        train = reducer.replace()
        if periods_before:
            other = tuple(-train.start_state("static"))
            gearlib.simulate(train, 0.9, periods=periods_before, initial_state=other)
        return gearlib.simulate(train, 0.9, periods=12).final_state

    np.testing.assert_allclose(final_state(), by_modes, rtol=0.0, atol=1e-12)
    for periods_before in (1, 12):
        np.testing.assert_array_equal(final_state(), final_state(periods_before))

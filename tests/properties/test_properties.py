"""Symmetries and invariances of every kind of model, checked for random numbers."""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gearlib import simulate
from tests.properties import changes
from tests.properties.cases import CASES

#: Number of random cases, the same ones in every run. GEARLIB_PROPERTIES increases it.
COUNT = int(os.environ.get("GEARLIB_PROPERTIES", "9"))
MANY = settings(
    max_examples=COUNT,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)
FEW = settings(MANY, max_examples=max(3, COUNT // 3))
PERIODS, SAMPLES = 3, 16


def run(case, periods=PERIODS, **options):
    """Simulate a case with its initial state and record all periods."""
    settings = dict(record_periods=periods, samples_per_period=SAMPLES, initial_state=case.state)
    return simulate(case.model, case.tuning, periods=periods, **settings | options)


def comparison_tolerance(case, case_run, periods=PERIODS):
    """Return (tolerance for another run of the case, whether runs can be compared at all).

    `case_run` is a run of the case. Changes of the initial state by 1e-12 of its size, either way,
    give its sensitivity. Rounding, 1e-15 in each of some hundred arcs, stays below a hundred times
    that.
    """
    signs = np.where(np.arange(len(case.state)) % 2, -1.0, 1.0)
    scale, sensitivity, same_events = 1.0 + np.abs(case_run.final_state.values).max(), 0.0, True
    for relative_change in (1e-12, -1e-12):
        state = tuple(np.array(case.state) + relative_change * signs * (1.0 + np.abs(case.state)))
        changed_run = run(case._replace(state=state), periods)
        for name in ("final_state", "displacement"):
            sensitivity = max(
                sensitivity, np.abs(changed_run[name].values - case_run[name].values).max().item()
            )
        same_events &= changed_run.sizes["event"] == case_run.sizes["event"]
    return 1e-10 * scale + 100.0 * sensitivity, same_events and sensitivity < 1e-7 * scale


def assert_same_run(case, case_run, other, state=None, displacement=None):
    """Assert that two runs have the same motion, and return whether they could be compared.

    `state` and `displacement`, the final state and the displacements of all meshes, replace those
    of `other` if they are in other coordinates.
    """
    assert int(case_run.status) == int(other.status)
    if int(case_run.status):
        return False
    periods = round(case_run.sizes["phase"] / SAMPLES)
    tolerance, comparable = comparison_tolerance(case, case_run, periods)
    if not comparable:
        return False
    state = other.final_state.values if state is None else state
    displacement = other.displacement.values if displacement is None else displacement
    np.testing.assert_allclose(case_run.final_state, state, rtol=0, atol=tolerance)
    np.testing.assert_allclose(case_run.displacement, displacement, rtol=0, atol=tolerance)
    assert case_run.sizes["event"] == other.sizes["event"]
    return True


# An oscillator has no units, and gear geometry is always in metres.
@pytest.mark.parametrize("kind", sorted(CASES.keys() - {"oscillator", "pairs of teeth"}))
@given(data=st.data())
@FEW
def test_results_do_not_depend_on_units(kind, data):
    """Run the same model in other units of length, mass and time: results in ratios stay equal."""
    case = data.draw(CASES[kind])
    case_run = run(case)
    # Products with powers of two have no rounding, so that these results must be equal bit by bit.
    for length, mass, time in ((1e3, 1.0, 1.0), (1024.0, 1.0, 1.0), (0.5, 4096.0, 2.0**-9)):
        other = run(case._replace(model=changes.in_units(case.model, length, mass, time)))
        if length == 1e3 or kind == "train":
            assert_same_run(case, case_run, other)
            continue
        np.testing.assert_array_equal(case_run.final_state, other.final_state)
        np.testing.assert_array_equal(case_run.event_phase, other.event_phase)


def end_of(case, periods):
    """Return the state of all coordinates after some periods, or None if the run fails."""
    propagator = case.model.propagator(case.tuning)
    end, _, code = propagator.maps(propagator.initial_state(case.state), periods, 10**6)
    return tuple(end) if code == 0 else None


@pytest.mark.parametrize("kind", CASES)
@given(data=st.data())
@MANY
def test_a_run_continues_where_another_ends(kind, data):
    """Two runs, one after the other, must equal a run of both lengths."""
    case = data.draw(CASES[kind])
    first_periods = case.model.repeats
    state = end_of(case, first_periods) if first_periods <= 24 else None
    if state is None:
        return
    whole, first = run(case, 2 * first_periods), run(case, first_periods)
    second = run(case._replace(state=state), first_periods)
    displacements = np.concatenate([first.displacement, second.displacement])
    comparable = assert_same_run(case, whole, whole, second.final_state.values, displacements)
    # If a flank is just touched where the runs join, rounding decides whether this is an event.
    if comparable and not (second.event_phase < 1e-6).any():
        assert whole.sizes["event"] == first.sizes["event"] + second.sizes["event"]


@pytest.mark.parametrize("describe", [changes.mirrored, changes.renamed, changes.exchanged])
@given(data=st.data())
@MANY
def test_equivalent_models_of_a_machine_have_the_same_motion(describe, data):
    """A mirrored, renamed or exchanged train must move as the original, in its coordinates."""
    case = data.draw(CASES["train"])
    other, key_of = describe(case.model)
    target_index = {where: i for i, where in enumerate(other.structure.coordinates)}
    source_coordinates = [key_of(key) for key in case.model.structure.coordinates]
    n = len(source_coordinates)
    target_indices = np.array(
        [target_index[key] for key, _ in source_coordinates]
        + [n + target_index[key] for key, _ in source_coordinates]
    )
    signs = np.tile([sign for _, sign in source_coordinates], 2)
    state = np.empty(2 * n)
    state[target_indices] = signs * case.state
    original_run, changed_run = run(case), run(case._replace(model=other, state=tuple(state)))
    meshes = [
        f"mesh {name}" if describe is changes.renamed else name for name in original_run.mesh.values
    ]
    displacements = changed_run.displacement.sel(mesh=meshes).values
    assert_same_run(
        case,
        original_run,
        changed_run,
        signs * changed_run.final_state.values[target_indices],
        displacements,
    )

"""What holds for every model whatever its numbers, drawn at random: no golden number is needed."""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gearlib import simulate
from tests.properties import changes
from tests.properties.cases import CASES

#: More with GEARLIB_PROPERTIES; the same ones in every run, so that a failure is one for all.
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
    """Return the whole course of a run."""
    given = dict(record_periods=periods, samples_per_period=SAMPLES, initial_state=case.state)
    return simulate(case.model, case.tuning, periods=periods, **given | options)


def comparison_tolerance(case, found, periods=PERIODS):
    """Return (by how much another run may differ from `found`, whether runs can be compared).

    Changes of the start by 1e-12 of its size, either way, give the sensitivity; rounding, 1e-15 in
    each of some hundred arcs, stays below a hundred times that.
    """
    signs = np.where(np.arange(len(case.state)) % 2, -1.0, 1.0)
    scale, spread, same_events = 1.0 + np.abs(found.final_state.values).max(), 0.0, True
    for size in (1e-12, -1e-12):
        state = tuple(np.array(case.state) + size * signs * (1.0 + np.abs(case.state)))
        nudged = run(case._replace(state=state), periods)
        for name in ("final_state", "displacement"):
            spread = max(spread, np.abs(nudged[name].values - found[name].values).max().item())
        same_events &= nudged.sizes["event"] == found.sizes["event"]
    return 1e-10 * scale + 100.0 * spread, same_events and spread < 1e-7 * scale


def compare(case, found, other, state=None, displacement=None):
    """Assert that two runs are one motion; return whether they could be compared.

    `state` and `displacement`, the last state and the displacements of all meshes, are given where
    those of `other` are in other coordinates.
    """
    assert int(found.status) == int(other.status)
    if int(found.status):
        return False
    periods = round(found.sizes["phase"] / SAMPLES)
    tolerance, comparable = comparison_tolerance(case, found, periods)
    if not comparable:
        return False
    state = other.final_state.values if state is None else state
    displacement = other.displacement.values if displacement is None else displacement
    np.testing.assert_allclose(found.final_state, state, rtol=0, atol=tolerance)
    np.testing.assert_allclose(found.displacement, displacement, rtol=0, atol=tolerance)
    assert found.sizes["event"] == other.sizes["event"]
    return True


# An oscillator has no units, and gear geometry is always in metres.
@pytest.mark.parametrize("kind", sorted(CASES.keys() - {"oscillator", "pairs of teeth"}))
@given(data=st.data())
@FEW
def test_results_do_not_depend_on_units(kind, data):
    case = data.draw(CASES[kind])
    found = run(case)
    # Powers of two leave every digit of a product alone.
    for length, mass, time in ((1e3, 1.0, 1.0), (1024.0, 1.0, 1.0), (0.5, 4096.0, 2.0**-9)):
        other = run(case._replace(model=changes.in_units(case.model, length, mass, time)))
        if length == 1e3 or kind == "train":
            compare(case, found, other)
            continue
        np.testing.assert_array_equal(found.final_state, other.final_state)
        np.testing.assert_array_equal(found.event_phase, other.event_phase)


def end_of(case, periods):
    """Return the state after some periods in all coordinates, of which runs may record one."""
    propagator = case.model.propagator(case.tuning)
    end, _, code = propagator.maps(propagator.initial_state(case.state), periods, 10**6)
    return tuple(end) if code == 0 else None


@pytest.mark.parametrize("kind", CASES)
@given(data=st.data())
@MANY
def test_a_run_continues_where_another_ends(kind, data):
    case = data.draw(CASES[kind])
    half = case.model.repeats
    state = end_of(case, half) if half <= 24 else None
    if state is None:
        return
    whole, first = run(case, 2 * half), run(case, half)
    second = run(case._replace(state=state), half)
    course = np.concatenate([first.displacement, second.displacement])
    alike = compare(case, whole, whole, second.final_state.values, course)
    # At the cut itself a flank that is just touched may be left, or not, by rounding.
    if alike and not (second.event_phase < 1e-6).any():
        assert whole.sizes["event"] == first.sizes["event"] + second.sizes["event"]


@pytest.mark.parametrize("describe", [changes.mirrored, changes.renamed, changes.exchanged])
@given(data=st.data())
@MANY
def test_equivalent_models_of_a_machine_have_the_same_motion(describe, data):
    case = data.draw(CASES["train"])
    other, key_of = describe(case.model)
    places = {where: i for i, where in enumerate(other.structure.coordinates)}
    own = [key_of(key) for key in case.model.structure.coordinates]
    n = len(own)
    into = np.array([places[key] for key, _ in own] + [n + places[key] for key, _ in own])
    signs = np.tile([sign for _, sign in own], 2)
    state = np.empty(2 * n)
    state[into] = signs * case.state
    found, there = run(case), run(case._replace(model=other, state=tuple(state)))
    meshes = [f"mesh {name}" if describe is changes.renamed else name for name in found.mesh.values]
    course = there.displacement.sel(mesh=meshes).values
    compare(case, found, there, signs * there.final_state.values[into], course)

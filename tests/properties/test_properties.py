"""Symmetries and invariances of every kind of model, checked for random numbers."""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gearlib import simulate
from tests.properties import changes
from tests.properties.cases import CASE_STRATEGIES

#: Number of random examples per test, the same in every run. GEARLIB_PROPERTIES increases it.
EXAMPLE_COUNT = int(os.environ.get("GEARLIB_PROPERTIES", "9"))
MANY_EXAMPLES = settings(
    max_examples=EXAMPLE_COUNT,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)
FEW_EXAMPLES = settings(MANY_EXAMPLES, max_examples=max(3, EXAMPLE_COUNT // 3))
#: Number of simulated mesh periods and of samples per period.
PERIODS, SAMPLES = 3, 16


def simulate_case(case, periods=PERIODS, **options):
    """Simulate a case from its initial state and record all periods."""
    run_options = {"record_periods": periods, "samples_per_period": SAMPLES}
    run_options |= {"initial_state": case.state} | options
    return simulate(case.model, case.tuning, periods=periods, **run_options)


def comparison_tolerance(case, case_run, periods=PERIODS):
    """Return the tolerance for another run of the case, and whether runs are comparable.

    The tolerance is 100 times the largest effect of a relative change of the initial state by
    1e-12, because rounding errors of 1e-15 in some hundred arcs of the motion add up to less.
    Chaotic runs, and runs in which such a change adds or removes an event, are not comparable.
    """
    signs = np.where(np.arange(len(case.state)) % 2, -1.0, 1.0)
    scale = 1.0 + np.abs(case_run.final_state.values).max()
    sensitivity, same_events = 0.0, True
    for relative_change in (1e-12, -1e-12):
        state = tuple(np.array(case.state) + relative_change * signs * (1.0 + np.abs(case.state)))
        changed_run = simulate_case(case._replace(state=state), periods)
        for name in ("final_state", "displacement"):
            sensitivity = max(
                sensitivity, np.abs(changed_run[name].values - case_run[name].values).max().item()
            )
        same_events &= changed_run.sizes["event"] == case_run.sizes["event"]
    return 1e-10 * scale + 100.0 * sensitivity, same_events and sensitivity < 1e-7 * scale


def assert_same_run(case, case_run, other_run, state=None, displacement=None):
    """Assert that two runs have the same motion, and return whether they are comparable.

    If `other_run` uses different coordinates, `state` and `displacement` are its final state and
    its mesh displacements in the coordinates of `case_run`.
    """
    assert int(case_run.status) == int(other_run.status)
    if int(case_run.status):
        return False
    periods = round(case_run.sizes["phase"] / SAMPLES)
    tolerance, comparable = comparison_tolerance(case, case_run, periods)
    if not comparable:
        return False
    state = other_run.final_state.values if state is None else state
    displacement = other_run.displacement.values if displacement is None else displacement
    np.testing.assert_allclose(case_run.final_state, state, rtol=0, atol=tolerance)
    np.testing.assert_allclose(case_run.displacement, displacement, rtol=0, atol=tolerance)
    assert case_run.sizes["event"] == other_run.sizes["event"]
    return True


# An oscillator is dimensionless, and gear geometry is always in metres.
@pytest.mark.parametrize("kind", sorted(CASE_STRATEGIES.keys() - {"oscillator", "pairs of teeth"}))
@given(data=st.data())
@FEW_EXAMPLES
def test_results_do_not_depend_on_units(kind, data):
    """Dimensionless results must not change if length, mass and time have different units."""
    case = data.draw(CASE_STRATEGIES[kind])
    case_run = simulate_case(case)
    # Products with powers of two are exact, so that these results must be equal bit by bit.
    for length, mass, time in ((1e3, 1.0, 1.0), (1024.0, 1.0, 1.0), (0.5, 4096.0, 2.0**-9)):
        other_run = simulate_case(
            case._replace(model=changes.in_units(case.model, length, mass, time))
        )
        # The factor 1000 and the computation of train constants cause rounding errors.
        if length == 1e3 or kind == "train":
            assert_same_run(case, case_run, other_run)
            continue
        np.testing.assert_array_equal(case_run.final_state, other_run.final_state)
        np.testing.assert_array_equal(case_run.event_phase, other_run.event_phase)


def final_state_of(case, periods):
    """Return the state after a number of mesh periods, or None if the run fails."""
    propagator, max_events = case.model.propagator(case.tuning), 10**6
    initial_state = propagator.initial_state(case.state)
    state, _, status = propagator.maps(initial_state, periods, max_events)
    return tuple(state) if status == 0 else None


@pytest.mark.parametrize("kind", CASE_STRATEGIES)
@given(data=st.data())
@MANY_EXAMPLES
def test_a_run_continues_where_another_ends(kind, data):
    """A run that starts from the end of another must equal the rest of one long run."""
    case = data.draw(CASE_STRATEGIES[kind])
    # The second run must start at the same phase of all excitations as the first one.
    first_periods, max_periods = case.model.repeats, 24
    if first_periods > max_periods:  # this would take too long
        return
    state = final_state_of(case, first_periods)
    if state is None:
        return
    whole, first = simulate_case(case, 2 * first_periods), simulate_case(case, first_periods)
    second = simulate_case(case._replace(state=state), first_periods)
    displacements = np.concatenate([first.displacement, second.displacement])
    comparable = assert_same_run(case, whole, whole, second.final_state.values, displacements)
    # If an event lies where the runs join, rounding decides to which run it belongs.
    if comparable and not (second.event_phase < 1e-6).any():
        assert whole.sizes["event"] == first.sizes["event"] + second.sizes["event"]


@pytest.mark.parametrize(
    "transform", [changes.mirror, changes.rename_elements, changes.exchange_pinions_and_wheels]
)
@given(data=st.data())
@MANY_EXAMPLES
def test_equivalent_models_of_a_machine_have_the_same_motion(transform, data):
    """A mirrored, renamed or exchanged train must move like the original: they are one machine."""
    case = data.draw(CASE_STRATEGIES["train"])
    equivalent_train, map_coordinate = transform(case.model)
    indices = {name: i for i, name in enumerate(equivalent_train.structure.coordinates)}
    mapped = [map_coordinate(name) for name in case.model.structure.coordinates]
    displacement_indices = np.array([indices[name] for name, _ in mapped])
    # A state has all displacements first, followed by the velocities in the same order.
    state_indices = np.append(displacement_indices, len(mapped) + displacement_indices)
    signs = np.tile([sign for _, sign in mapped], 2)
    state = np.empty(2 * len(mapped))
    state[state_indices] = signs * case.state
    original_run = simulate_case(case)
    equivalent_run = simulate_case(case._replace(model=equivalent_train, state=tuple(state)))
    mesh_names = list(original_run.mesh.values)
    if transform is changes.rename_elements:
        mesh_names = [f"mesh {name}" for name in mesh_names]
    assert_same_run(
        case,
        original_run,
        equivalent_run,
        signs * equivalent_run.final_state.values[state_indices],
        equivalent_run.displacement.sel(mesh=mesh_names).values,
    )

"""What holds for every model whatever its numbers, drawn at random: no golden number is needed."""

import math
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gearlib import simulate
from tests.properties import changes
from tests.properties.cases import (
    CASES,
    STATES,
    TUNINGS,
    Case,
    between,
    oscillators,
    pairs,
    six_degrees,
)
from tests.trains.random_trains import symmetric_problem

#: More with GEARLIB_PROPERTIES; the same ones in every run, so that a failure is one for all.
COUNT = int(os.environ.get("GEARLIB_PROPERTIES", "12"))
MANY = settings(
    max_examples=COUNT,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)
FEW = settings(MANY, max_examples=max(3, COUNT // 3))
PERIODS, SAMPLES = 3, 16
SEEDS = st.integers(0, 2**32 - 1)


def run(case, periods=PERIODS, **options):
    """Return the whole course of a run."""
    given = dict(record_periods=periods, samples_per_period=SAMPLES, initial_state=case.state)
    return simulate(case.model, case.tuning, periods=periods, **given | options)


def allowed(case, found, periods=PERIODS):
    """Return by how much two runs may differ, and whether they can be compared.

    What a part in 1e12 of the start, to either side, does to this motion, a hundred times: rounding
    is some 1e-15 in each of some hundred arcs.
    """
    signs = np.where(np.arange(len(case.state)) % 2, -1.0, 1.0)
    scale, spread, alike = 1.0 + np.abs(found.final_state.values).max(), 0.0, True
    for size in (1e-12, -1e-12):
        state = tuple(np.array(case.state) + size * signs * (1.0 + np.abs(case.state)))
        nudged = run(case._replace(state=state), periods)
        for name in ("final_state", "displacement"):
            spread = max(spread, np.abs(nudged[name].values - found[name].values).max().item())
        alike &= nudged.sizes["event"] == found.sizes["event"]
    return 1e-10 * scale + 100.0 * spread, alike and spread < 1e-7 * scale


def compare(case, found, other, state=None, displacement=None):
    """Assert that two runs are one motion, by their states and by the courses of all meshes.

    Returns whether they could be compared: the number of events is that of both, too.
    """
    assert int(found.status) == int(other.status)
    if int(found.status):
        return False
    within, comparable = allowed(case, found, round(found.sizes["phase"] / SAMPLES))
    if not comparable:
        return False
    state = other.final_state.values if state is None else state
    displacement = other.displacement.values if displacement is None else displacement
    np.testing.assert_allclose(found.final_state, state, rtol=0, atol=within)
    np.testing.assert_allclose(found.displacement, displacement, rtol=0, atol=within)
    assert found.sizes["event"] == other.sizes["event"]
    return True


@pytest.mark.parametrize("kind", [name for name in CASES if name != "oscillator"])
@given(data=st.data())
@FEW
def test_units_do_not_matter(kind, data):
    case = data.draw(CASES[kind])
    if kind == "pairs of teeth":
        # What is drawn is always in metres: the pair beside it follows the drawing.
        case = case._replace(model=case.model.pair)
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
    """Return all components after some periods: of several coordinates results hold two."""
    propagator = case.model.propagator(case.tuning)
    end, _, code = propagator.maps(propagator.start(case.state), periods, 10**6)
    return tuple(end) if code == 0 else None


@pytest.mark.parametrize("kind", CASES)
@given(data=st.data())
@MANY
def test_a_run_goes_on_where_another_ends(kind, data):
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


@given(data=st.data())
@MANY
def test_a_gear_pair_is_an_oscillator_in_static_deflections(data):
    case, shift = data.draw(CASES["gear pair"]), data.draw(between(-1.0, 1.0))
    edges = {"upper_edge": shift, "lower_edge": shift - case.model.backlash_ratio}
    model = changes.as_oscillator(case.model, **edges)
    found, ends = run(case), np.array([shift, 0.0])
    for method in model.propagators:
        other = Case(model, case.tuning, (case.state[0] + shift, case.state[1]))
        there = run(other, method=method)
        compare(case, found, there, there.final_state - ends, there.displacement - shift)


@given(data=st.data())
@MANY
def test_a_dead_zone_moves_as_its_mirror_image(data):
    model = data.draw(oscillators() | pairs().map(changes.as_oscillator))
    if not math.isfinite(model.lower_edge):
        return
    case = Case(model, data.draw(TUNINGS), data.draw(STATES))
    image = Case(changes.mirrored_oscillator(model), case.tuning, tuple(-x for x in case.state))
    found, other = run(case), run(image)
    compare(case, found, other, -other.final_state.values, -other.displacement.values)
    np.testing.assert_allclose(found.dynamic_force, -other.dynamic_force, atol=1e-6)
    np.testing.assert_array_equal(found.event_to, -other.event_to)


@pytest.mark.parametrize("describe", [changes.mirrored, changes.renamed, changes.exchanged])
@given(data=st.data())
@MANY
def test_a_machine_has_one_motion_however_it_is_described(describe, data):
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


@given(data=st.data())
@MANY
def test_the_two_gears_of_a_pair_may_change_places(data):
    model = data.draw(six_degrees()).replace(run_out_phase=0.0)
    swapped = {
        name: getattr(model, name)[::-1]
        for name in ("base_radii", "inertias", "masses", "eccentricities", "teeth", "torques")
    }
    for name in ("bearing_stiffness", "bearing_damping"):
        swapped[name] = getattr(model, name)[2:] + getattr(model, name)[:2]
    # Both lines of action point the other way.
    places, signs = np.array([1, 0, 4, 5, 2, 3]), np.array([1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
    places, signs = np.append(places, 6 + places), np.tile(signs, 2)
    state = np.array(data.draw(st.lists(between(-2.0, 2.0), min_size=12, max_size=12)))
    case = Case(model, data.draw(TUNINGS), tuple(state))
    other = Case(model.replace(**swapped), case.tuning, tuple(signs * state[places]))
    if compare(case, run(case), run(other)):
        end, there = end_of(case, PERIODS), end_of(other, PERIODS)
        np.testing.assert_allclose(end, signs * np.array(there)[places], rtol=0, atol=1e-6)


@given(data=st.data())
@MANY
def test_six_degrees_are_a_train_of_two_gears(data):
    case = data.draw(CASES["six degrees"])
    train, order = changes.as_train(case.model)
    assert (train.size, train.repeats) == (case.model.size, case.model.repeats)
    unit = case.model.static_deflection
    assert train.static_deflection == pytest.approx(unit, rel=1e-13)
    start, end = case.model.propagator(case.tuning).start(case.state), end_of(case, PERIODS)
    one, other = run(case), Case(train, case.tuning, tuple(start[order]))
    if end is None or not allowed(case, one)[1]:
        return
    found, state = run(other), np.array(end)[order]
    if compare(other, found, one, state, one.displacement.values[:, None]):
        np.testing.assert_array_equal(found.event_to, one.event_to)
        within, _ = allowed(other, found)
        for name in ("velocity", "dynamic_force"):
            np.testing.assert_allclose(found[name][:, 0], one[name], rtol=0, atol=10.0 * within)


@given(data=st.data())
@MANY
def test_whole_turns_of_a_phase_do_not_matter(data):
    case, turns = data.draw(CASES["six degrees"]), data.draw(st.sampled_from([-2, 1, 3]))
    whole = 2.0 * math.pi * turns
    other = case.model.replace(
        run_out_phase=case.model.run_out_phase + whole, pitch_phase=case.model.pitch_phase + whole
    )
    compare(case, run(case), run(case._replace(model=other)))


@given(data=st.data())
@MANY
def test_a_train_begins_at_any_mesh_period(data):
    """A start one reference mesh period later: by that much all else is late, or turned on."""
    case = data.draw(CASES["train"])
    later = changes.later(case.model, 1)
    state = end_of(case, 1)
    if state is None:
        return
    whole, other = run(case, 2), run(case._replace(model=later, state=state), 1)
    course = np.concatenate([run(case, 1).displacement, other.displacement])
    compare(case, whole, whole, other.final_state.values, course)


@given(seed=SEEDS)
@MANY
def test_equal_branches_move_alike(seed):
    train, tuning, state = symmetric_problem(np.random.default_rng(seed))
    # One planet in three begins a little beside the others there; not here.
    state = np.where(np.abs(state) == 1e-12, 0.0, state)
    coordinates = train.structure.coordinates
    first = {axis: i for i, (body, axis) in enumerate(coordinates) if body == "planet 1"}
    n = len(coordinates)
    for i, (body, axis) in enumerate(coordinates):
        if body.startswith("planet"):
            state[[i, n + i]] = state[[first[axis], n + first[axis]]]
    case = Case(train, tuning, tuple(state))
    found = run(case)
    if int(found.status):
        return
    within, comparable = allowed(case, found)
    for central in ("sun", "ring") if comparable else ():
        own = [name.startswith(central) for name in train.mesh_names]
        course = found.displacement.values[:, own]
        assert np.ptp(course, axis=1).max() < within

"""Every model against the program of `tests.independent`: motions, orbits and multipliers.

With ``GEARLIB_TRAINS=500`` it draws 500 random trains instead of a few, which takes minutes.
"""

import math
import os
from itertools import chain, pairwise, product

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

import gearlib
from gearlib import periodic_orbit, simulate
from gearlib.analysis.orbits.shooting import compose, floquet_multipliers
from tests.independent import program
from tests.independent.differences import SHARES
from tests.independent.systems import describe, equations_of, move
from tests.properties.cases import CASE_STRATEGIES, random_train_case
from tests.properties.known_models import (
    CHAIN,
    DAMPED,
    GEARS,
    MOTION_CASES,
    OSCILLATOR,
    PAIR_ON_BOTH_FLANKS,
    MotionCase,
    gears_on_bearings,
)
from tests.properties.test_properties import FEW_EXAMPLES, comparison_tolerance

SAMPLES = 16


def events_by_contact(events, count):
    """Return a list of events (before, after, phase) for each of `count` contacts.

    `events` are tuples (contact, state before, state after, phase). If the backlash is zero, the
    contact changes from one flank to the other at once, and both events become one.
    """
    events_of_contacts = [[] for _ in range(count)]
    for contact, before, after, phase in events:
        previous_events = events_of_contacts[int(contact)]
        if previous_events:
            previous_before, previous_after, previous_phase = previous_events[-1]
            if previous_after == before == 0 and phase - previous_phase < 1e-10:
                before = previous_before
                previous_events.pop()
        previous_events.append((before, after, phase))
    return events_of_contacts


def assert_same_motion(case, run, motion, tolerance):
    """Assert that events, samples and summary of a fully recorded run match the reference motion.

    `tolerance` is the allowed error of the final state, relative to its largest component or to 1,
    the static deflection. Samples may have ten times this error.
    """
    assert int(run.status) == 0
    contact_count = len(motion.equations.contacts)
    columns = [run[f"event_{name}"].values for name in ("from", "to", "phase")]
    meshes = run.event_mesh.values if "event_mesh" in run else np.zeros(run.sizes["event"])
    run_events = events_by_contact(zip(meshes, *columns, strict=True), contact_count)
    all_reference_events = events_by_contact(
        [(event.contact, event.before, event.after, float(event.phase)) for event in motion.events],
        contact_count,
    )
    for events, reference_events in zip(run_events, all_reference_events, strict=True):
        assert [event[:2] for event in events] == [event[:2] for event in reference_events]
        phases = [phase for *_, phase in events]
        reference_phases = [phase for *_, phase in reference_events]
        # Near a grazing the error of a phase grows like the square root of the error of the state.
        np.testing.assert_allclose(phases, reference_phases, rtol=0, atol=1e5 * tolerance)
    end = motion.state if "mesh" in run.dims else motion.mesh_state()
    scale = max(1.0, np.abs(end).max())
    np.testing.assert_allclose(run.final_state, end, rtol=0, atol=tolerance * scale)
    sample_tolerance = 10.0 * tolerance * scale
    phases, *curves, coordinates = map(np.array, zip(*motion.record.samples, strict=True))
    np.testing.assert_array_equal(run.phase, phases)
    # A sample at which a stiffness or a contact switches may be taken before or after it.
    switch_phases = [0.0, *motion.switch_times, *(float(event.phase) for event in motion.events)]
    is_smooth = np.abs(phases[:, None] - switch_phases).min(axis=1) > 1e-6
    for name, values in zip(("displacement", "velocity", "dynamic_force"), curves, strict=True):
        samples = run[name].values.reshape(values.shape)
        np.testing.assert_allclose(
            samples[is_smooth], values[is_smooth], rtol=0, atol=sample_tolerance, err_msg=name
        )
    if hasattr(case.model, "flexible"):
        # Motions across the line of action do not change the displacement of the mesh.
        bearings = [("y3", "z3", "y2", "z2")[i] for i in case.model.elastic_bearings()]
        names = ["rotation_3", "rotation_2", *(f"bearing_{name}" for name in bearings)]
        np.testing.assert_allclose(
            np.transpose([run[name] for name in names]),
            coordinates,
            rtol=0,
            atol=sample_tolerance,
        )
    curves = {"displacement": motion.record.displacements, "dynamic_force": motion.record.forces}
    for (name, values), extremum in product(curves.items(), (max, min)):
        expected = [extremum(row) for row in values]
        run_extrema = np.ravel(run[f"{name}_{extremum.__name__}"])
        np.testing.assert_allclose(
            run_extrema, expected, rtol=0, atol=sample_tolerance, err_msg=name
        )
    # Fractions of time have the errors of event phases.
    time_fractions = np.array(motion.record.durations).T / (2.0 * math.pi * case.periods)
    for name, expected in zip(SHARES, time_fractions, strict=True):
        np.testing.assert_allclose(np.ravel(run[name]), expected, rtol=0, atol=1e5 * tolerance)


def reference_motion(case, **options):
    """Return the motion of a case by the reference program, sampled at the phases of a run."""
    phases = 2.0 * math.pi * np.arange(case.periods * SAMPLES) / SAMPLES
    state = case.model.start_state(case.state) if isinstance(case.state, str) else case.state
    options |= {"recorded": case.periods, "phases": phases.tolist()}
    return move(describe(case.model), case.tuning, case.periods, state, **options)


def fully_recorded_run(case, **options):
    """Return the run of a case with all periods recorded."""
    run_settings = {"periods": case.periods, "record_periods": case.periods}
    run_settings |= {"initial_state": case.state, "samples_per_period": SAMPLES}
    return simulate(case.model, case.tuning, **run_settings | options)


@pytest.mark.parametrize("name", MOTION_CASES)
def test_a_motion_matches_the_reference(name):
    """A run by each propagator must match the motion that an independent program computes."""
    case = MOTION_CASES[name]
    motion, run = reference_motion(case), fully_recorded_run(case)
    for method in case.model.propagators:
        # The tolerance 1e-11 covers rounding errors of up to eight periods, which bounces amplify.
        assert_same_motion(case, fully_recorded_run(case, method=method), motion, 1e-11)
    # The recorded part of a run must not influence its motion.
    partly_recorded_run = fully_recorded_run(case, record_periods=1)
    np.testing.assert_allclose(partly_recorded_run.final_state, run.final_state, rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", [name for name in CASE_STRATEGIES if name != "pairs of teeth"])
@given(data=st.data())
@settings(FEW_EXAMPLES, phases=[Phase.generate])
def test_a_random_motion_matches_the_reference(kind, data):
    assert_case_matches_the_reference(data.draw(CASE_STRATEGIES[kind]))


def assert_case_matches_the_reference(case):
    """Assert that three periods of a random case match the reference, unless they are chaotic."""
    motion = MotionCase(*case, 3)
    run = fully_recorded_run(motion)
    if int(run.status):
        return
    tolerance, comparable = comparison_tolerance(case, run, motion.periods)
    if comparable:
        assert_same_motion(motion, run, reference_motion(motion), tolerance)


@pytest.mark.parametrize("seed", range(int(os.environ.get("GEARLIB_TRAINS", "16"))))
def test_no_event_of_a_random_train_is_missed(seed):
    assert_case_matches_the_reference(random_train_case(seed))


def test_some_random_trains_graze_and_some_have_coinciding_events():
    """The random trains must include the difficult cases that `random_train_case` promises."""
    shortest_contact = math.inf
    for seed in range(2, 16, 4):  # trains that start near a grazing
        events = reference_motion(MotionCase(*random_train_case(seed), 3)).events
        for contact in {event.contact for event in events}:
            phases = [event.phase for event in events if event.contact == contact]
            shortest_contact = min([shortest_contact, *np.diff(phases)])
    coinciding_count = 0
    for seed in range(3, 16, 4):  # trains with coinciding events
        events = reference_motion(MotionCase(*random_train_case(seed), 3)).events
        intervals = [b.phase - a.phase for a, b in pairwise(events) if a.contact != b.contact]
        coinciding_count += min(intervals, default=1.0) < 1e-11
    assert shortest_contact < 0.05 and coinciding_count >= 2


FRICTION = {"friction": (0.06, 0.04), "pitch_phase": 0.7}
SOFT_BEARINGS = gears_on_bearings(3e7, 3953.7, 3953.7, translating=True, bearing_damping_ratio=0.2)
COAST_CONTACT = gears_on_bearings(
    3e9, 1500.0, 300.0, bearing_damping_ratio=0.2, backlash=12e-6, **FRICTION
)
#: Model, tuning and guess of the state of each orbit.
ORBITS = {
    "pair": (DAMPED, 0.9, None),
    "pair in contact": (DAMPED, 0.7, None),
    "pair in oil": (DAMPED.replace(backlash_damping=800.0), 0.82, None),
    "pair on both flanks": (PAIR_ON_BOTH_FLANKS, 0.88, (0.096, -2.833)),
    "cubic damping": (MOTION_CASES["cubic damping"].model, 0.9, None),
    "table": (MOTION_CASES["table"].model.replace(pair=DAMPED), 0.9, None),
    "oscillator": (OSCILLATOR, 0.8, None),
    "cubic damping above": (MOTION_CASES["cubic damping"].model, 1.3, None),
    "six degrees": (SOFT_BEARINGS, 0.9, None),
    "six degrees in contact": (SOFT_BEARINGS, 0.7, None),
    "coast-side contact": (COAST_CONTACT, 0.8, None),
    "run-out": (GEARS.replace(teeth=(3, 3)), 0.7, None),
    "planets": (MOTION_CASES["bouncing planets"].model, 1.0, None),
    "chain": (CHAIN, 0.5, None),
}


def reference_jacobian(model, tuning, period, state):
    """Return the Jacobian of the reference's Poincaré map by central differences.

    The map takes an initial state to the state after `period` mesh periods.
    """
    equations, step = equations_of(describe(model), tuning), 1e-6

    def final_state(change):
        """Return the final state after a change of the initial state."""
        return np.array(program.move(equations, period, state + change).state)

    columns = [
        (final_state(change) - final_state(-change)) / (2 * step)
        for change in step * np.eye(len(state))
    ]
    return np.transpose(columns)


@pytest.mark.parametrize("name", ORBITS)
def test_orbit_multipliers_and_certificate_match_the_reference(name):
    """The reference must return to the orbit, with the same multipliers, inside the enclosures."""
    model, tuning, guess = ORBITS[name]
    orbit = periodic_orbit(model, tuning, guess=guess, period=model.repeats)
    assert orbit.residual <= 1e-12
    assert_stable_and_consistent_over_two_periods(model, tuning, orbit)
    motion = move(describe(model), tuning, orbit.period, tuple(orbit.state))
    reduce, lift = model.reduction()
    difference = reduce @ (np.array(motion.state) - orbit.state)
    np.testing.assert_allclose(difference, 0.0, atol=1e-10 * max(1.0, np.abs(orbit.state).max()))
    jacobian = reference_jacobian(model, tuning, orbit.period, orbit.state)
    monodromy = reduce @ jacobian @ lift
    reference_multipliers = np.linalg.eigvals(monodromy)
    # The error of the differences is 1e-9, so that nearly equal multipliers have its square root.
    np.testing.assert_allclose(
        np.sort(np.abs(orbit.multipliers)),
        np.sort(np.abs(reference_multipliers)),
        rtol=0,
        atol=1e-4,
    )
    np.testing.assert_allclose(orbit.multipliers.sum(), reference_multipliers.sum(), atol=1e-6)
    product, determinant = np.prod(orbit.multipliers), np.linalg.det(monodromy)
    np.testing.assert_allclose(product, determinant, rtol=1e-5, atol=1e-9)
    if model.equation is not None and not model.equation.is_piecewise_linear():
        return
    pytest.importorskip("flint")
    proven = gearlib.certify(orbit)
    assert proven, proven
    assert_reference_passes_through_the_enclosures(model, tuning, orbit, proven)


def assert_stable_and_consistent_over_two_periods(model, tuning, orbit):
    """Assert that a run near a stable orbit settles on it, and that two periods repeat it."""
    reduce, lift = model.reduction()
    # In 2000 mesh periods a deviation of 1e-6 from the orbit must decay below rounding.
    if orbit.stable and (abs(orbit.multipliers) ** (2000 / orbit.period) < 1e-12).all():
        run = simulate(model, tuning, periods=2000, initial_state=tuple(orbit.state + 1e-6))
        assert int(run.period) in (1, orbit.period)
        if run.final_state.size == orbit.state.size:
            difference = reduce @ (run.final_state.values - orbit.state)
            np.testing.assert_allclose(difference, 0.0, rtol=0, atol=1e-9)
    # A search for an orbit of twice the period must return the orbit itself.
    double_orbit = periodic_orbit(model, tuning, guess=orbit.state, period=2 * orbit.period)
    assert double_orbit.period == orbit.period
    np.testing.assert_allclose(reduce @ (double_orbit.state - orbit.state), 0.0, rtol=0, atol=1e-9)
    # The multipliers over two periods must be the squares of those over one.
    _, maps, _ = model.propagator(tuning).maps(orbit.state, 2 * orbit.period, 100_000)
    multipliers = floquet_multipliers(compose(reduce @ maps @ lift))
    squares = orbit.multipliers**2
    # Nearly equal multipliers are accurate only to the square root of the rounding error.
    np.testing.assert_allclose(
        np.sort(np.abs(multipliers)), np.sort(np.abs(squares)), rtol=0, atol=1e-7
    )
    trace = np.sum(squares)
    assert multipliers.sum() == pytest.approx(trace, abs=1e-11 * max(1.0, abs(trace)))
    if isinstance(model, gearlib.GearPair):
        # By Liouville's formula the product of the multipliers follows from the damping ratio,
        # averaged over the times in contact and in free flight.
        run_settings = {"periods": orbit.period, "record_periods": orbit.period}
        run = simulate(model, tuning, initial_state=tuple(orbit.state), **run_settings)
        free_fraction = float(run.contact_loss_fraction)
        mean_damping_ratio = (
            model.damping_ratio * (1.0 - free_fraction)
            + model.backlash_damping_ratio * free_fraction
        )
        expected = math.exp(-4.0 * math.pi * mean_damping_ratio * orbit.period / tuning)
        assert np.prod(orbit.multipliers).real == pytest.approx(expected, rel=1e-10)


def assert_reference_passes_through_the_enclosures(model, tuning, orbit, proven):
    """Assert that the reference motion from the certified state has the certified event phases.

    The motion starts at the centre of the enclosure of the initial state and is computed with 50
    digits.
    """

    def bounds(enclosure):
        """Return the bounds of an enclosure as mpmath numbers."""
        return mpf(str(enclosure.low)), mpf(str(enclosure.high))

    def inside(value, enclosure):
        """Return whether an enclosure contains a value, up to the error of the reference."""
        (low, high), tolerance = bounds(enclosure), mpf(10) ** -25
        return low - tolerance <= value <= high + tolerance

    description = describe(model)
    initial_enclosures = proven.displacement, proven.velocity
    has_coordinates = hasattr(proven, "coordinates")
    if isinstance(model, gearlib.GearTrain):
        # The reference uses the units that a certificate of a train states.
        units = model.static_deflection, model.reference_angular_frequency
        description["derived"] = dict(zip(("length", "omega"), units, strict=True))
    with mp.workdps(50):
        enclosures = chain(*initial_enclosures) if has_coordinates else initial_enclosures
        state = [sum(bounds(enclosure)) / 2 for enclosure in enclosures]
        motion = move(description, tuning, orbit.period, state, context=mp)
        events = sorted(motion.events, key=lambda event: (event.phase, event.contact))
        # Events at equal phases may have any order.
        phase_enclosures = sorted((event.phase for event in proven.events), key=float)
        for event, enclosure in zip(events, phase_enclosures, strict=True):
            assert inside(event.phase, enclosure)
        if not has_coordinates:
            assert all(map(inside, motion.mesh_state(), initial_enclosures))

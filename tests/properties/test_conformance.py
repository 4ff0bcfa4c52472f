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
from tests.properties.cases import CASES, random_trains_case
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
from tests.properties.test_properties import FEW, comparison_tolerance

SAMPLES = 16


def by_contact(events, count):
    """Return lists of rows [before, after, phase], one list for each of `count` contacts.

    `events` are rows (contact, before, after, phase). Two events that cross a gap of no width
    become one row.
    """
    rows_of_contacts = [[] for _ in range(count)]
    for contact, *row in events:
        rows = rows_of_contacts[int(contact)]
        if rows and rows[-1][1] == row[0] == 0 and row[2] - rows[-1][2] < 1e-10:
            row[0] = rows.pop()[0]
        rows.append(row)
    return rows_of_contacts


def assert_same_motion(case, run, motion, tolerance):
    """Assert that a run, recorded from its start, matches a motion of the reference.

    `tolerance` is the allowed error of states of the size of the static deflection.
    """
    assert int(run.status) == 0
    count = len(motion.equations.contacts)
    columns = [run[f"event_{name}"].values for name in ("from", "to", "phase")]
    meshes = run.event_mesh.values if "event_mesh" in run else np.zeros(run.sizes["event"])
    run_events = by_contact(zip(meshes, *columns, strict=True), count)
    rows = [(*event[1:4], float(event.phase)) for event in motion.events]
    for events, reference_events in zip(run_events, by_contact(rows, count), strict=True):
        assert [event[:2] for event in events] == [event[:2] for event in reference_events]
        phases = [event[2] for event in events]
        reference_phases = [event[2] for event in reference_events]
        # Near a grazing a phase has half as many digits as the state.
        np.testing.assert_allclose(phases, reference_phases, rtol=0, atol=1e5 * tolerance)
    end = motion.state if "mesh" in run.dims else motion.mesh_state()
    scale = max(1.0, np.abs(end).max())
    np.testing.assert_allclose(run.final_state, end, rtol=0, atol=tolerance * scale)
    atol = 10.0 * tolerance * scale
    phases, *curves, coordinates = map(np.array, zip(*motion.record.samples, strict=True))
    np.testing.assert_array_equal(run.phase, phases)
    # A sample at which a stiffness or a contact switches may be taken before or after it.
    switches = [0.0, *motion.cuts, *(row[-1] for row in rows)]
    away = np.abs(phases[:, None] - switches).min(axis=1) > 1e-6
    for name, values in zip(("displacement", "velocity", "dynamic_force"), curves, strict=True):
        samples = run[name].values.reshape(values.shape)
        np.testing.assert_allclose(samples[away], values[away], rtol=0, atol=atol, err_msg=name)
    if hasattr(case.model, "flexible"):
        # Motions across the line of action do not change the displacement of the mesh.
        bearings = [("y3", "z3", "y2", "z2")[i] for i in case.model.elastic_bearings()]
        names = ["rotation_3", "rotation_2", *(f"bearing_{name}" for name in bearings)]
        np.testing.assert_allclose(
            np.transpose([run[name] for name in names]), coordinates, 0, atol
        )
    curves = {"displacement": motion.record.heights, "dynamic_force": motion.record.forces}
    for (name, values), extremum in product(curves.items(), (max, min)):
        expected = [extremum(row) for row in values]
        run_extrema = np.ravel(run[f"{name}_{extremum.__name__}"])
        np.testing.assert_allclose(run_extrema, expected, rtol=0, atol=atol, err_msg=name)
    shares = np.array(motion.record.durations).T / (2.0 * math.pi * case.periods)
    for name, expected in zip(SHARES, shares, strict=True):
        np.testing.assert_allclose(np.ravel(run[name]), expected, rtol=0, atol=1e5 * tolerance)


def reference_motion(case, **options):
    """Return the motion of a case by the reference, sampled at the phases of the run."""
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
    """All propagators of a model must follow its reference motion, with any recorded part."""
    case = MOTION_CASES[name]
    motion, run = reference_motion(case), fully_recorded_run(case)
    for method in case.model.propagators:
        # The tolerance allows for rounding over up to eight periods, amplified by bounces.
        assert_same_motion(case, fully_recorded_run(case, method=method), motion, 1e-11)
    late_record = fully_recorded_run(case, record_periods=1)
    np.testing.assert_allclose(late_record.final_state, run.final_state, rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", [name for name in CASES if name != "pairs of teeth"])
@given(data=st.data())
@settings(FEW, phases=[Phase.generate])
def test_a_random_motion_matches_the_reference(kind, data):
    assert_run_matches_the_reference(data.draw(CASES[kind]))


def assert_run_matches_the_reference(case):
    """Compare three periods with the reference, unless tiny changes of the start grow too much."""
    motion = MotionCase(*case, 3)
    run = fully_recorded_run(motion)
    if int(run.status):
        return
    tolerance, comparable = comparison_tolerance(case, run, motion.periods)
    if comparable:
        assert_same_motion(motion, run, reference_motion(motion), tolerance)


@pytest.mark.parametrize("seed", range(int(os.environ.get("GEARLIB_TRAINS", "16"))))
def test_no_event_of_a_random_train_is_missed(seed):
    assert_run_matches_the_reference(random_trains_case(seed))


def test_some_random_trains_graze_and_some_have_coinciding_events():
    """Seeds with the remainder 2 modulo 4 start near a grazing, those with 3 have equal planets."""
    coinciding, shortest_contact = 0, math.inf
    for seed in sorted((*range(2, 16, 4), *range(3, 16, 4))):
        events = reference_motion(MotionCase(*random_trains_case(seed), 3)).events
        if seed % 4 == 2:
            for contact in {event.contact for event in events}:
                phases = [event.phase for event in events if event.contact == contact]
                shortest_contact = min([shortest_contact, *np.diff(phases)])
        else:
            intervals = [b.phase - a.phase for a, b in pairwise(events) if a.contact != b.contact]
            coinciding += min(intervals, default=1.0) < 1e-11
    assert coinciding >= 2 and shortest_contact < 0.05


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


def reference_map(model, tuning, period, state):
    """Return the Jacobian of the reference over an orbit by central differences."""
    equations = equations_of(describe(model), tuning)

    def end(change):
        """Return the final state after a change of the initial state."""
        return np.array(program.move(equations, period, state + change).state)

    return np.transpose([(end(h) - end(-h)) / 2e-6 for h in 1e-6 * np.eye(len(state))])


@pytest.mark.parametrize("name", ORBITS)
def test_orbit_and_its_multipliers_and_certificate_are_confirmed_by_the_reference(name):
    """The reference must return to the orbit, with the same multipliers, inside the enclosures."""
    model, tuning, guess = ORBITS[name]
    orbit = periodic_orbit(model, tuning, guess=guess, period=model.repeats)
    assert orbit.residual <= 1e-12
    assert_stable_and_consistent_over_two_periods(model, tuning, orbit)
    motion = move(describe(model), tuning, orbit.period, tuple(orbit.state))
    reduce, lift = model.reduction()
    difference = reduce @ (np.array(motion.state) - orbit.state)
    np.testing.assert_allclose(difference, 0.0, atol=1e-10 * max(1.0, np.abs(orbit.state).max()))
    differences = reference_map(model, tuning, orbit.period, orbit.state)
    monodromy = reduce @ differences @ lift
    reference_multipliers = np.linalg.eigvals(monodromy)
    # The truncation error of differences is 1e-9, and its root the error of close multipliers.
    by_size = [np.sort(np.abs(values)) for values in (orbit.multipliers, reference_multipliers)]
    np.testing.assert_allclose(*by_size, rtol=0, atol=1e-4)
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
    """Assert that runs near a stable orbit settle on it, and that two periods repeat it."""
    reduce, lift = model.reduction()
    if orbit.stable and (abs(orbit.multipliers) ** (2000 / orbit.period) < 1e-12).all():
        run = simulate(model, tuning, periods=2000, initial_state=tuple(orbit.state + 1e-6))
        assert int(run.period) in (1, orbit.period)
        if run.final_state.size == orbit.state.size:
            difference = reduce @ (run.final_state.values - orbit.state)
            np.testing.assert_allclose(difference, 0.0, rtol=0, atol=1e-9)
    # A search over twice the period must return the orbit itself.
    twice = periodic_orbit(model, tuning, guess=orbit.state, period=2 * orbit.period)
    assert twice.period == orbit.period
    np.testing.assert_allclose(reduce @ (twice.state - orbit.state), 0.0, rtol=0, atol=1e-9)
    _, maps, _ = model.propagator(tuning).maps(orbit.state, 2 * orbit.period, 100_000)
    multipliers = floquet_multipliers(compose(reduce @ maps @ lift))
    # Nearly equal multipliers are accurate to the root of rounding only.
    squares = [np.sort(np.abs(values)) for values in (multipliers, orbit.multipliers**2)]
    np.testing.assert_allclose(*squares, rtol=0, atol=1e-7)
    total = np.sum(orbit.multipliers**2)
    assert multipliers.sum() == pytest.approx(total, abs=1e-11 * max(1.0, abs(total)))
    if isinstance(model, gearlib.GearPair):
        # By Liouville's formula the product of the multipliers follows from the times of contact
        # and of free flight, with their damping ratios.
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
    """Assert that a motion from the centre of the first enclosure passes through all others."""

    def bounds(enclosure):
        """Return both ends of an enclosure as numbers of mpmath."""
        return mpf(str(enclosure.low)), mpf(str(enclosure.high))

    def inside(value, enclosure):
        """Return whether an enclosure contains a value up to rounding."""
        (low, high), room = bounds(enclosure), mpf(10) ** -25
        return low - room <= value <= high + room

    description, start = describe(model), (proven.displacement, proven.velocity)
    has_coordinates = hasattr(proven, "coordinates")
    if isinstance(model, gearlib.GearTrain):
        # The reference uses the units that a certificate of a train states.
        units = model.static_deflection, model.reference_angular_frequency
        description["derived"] = dict(zip(("length", "omega"), units, strict=True))
    with mp.workdps(50):
        first = chain(*start) if has_coordinates else start
        state = [sum(bounds(enclosure)) / 2 for enclosure in first]
        motion = move(description, tuning, orbit.period, state, context=mp)
        events = sorted(motion.events, key=lambda event: (event.phase, event.contact))
        # Events at equal phases may have any order.
        enclosures = sorted((event.phase for event in proven.events), key=float)
        for event, enclosure in zip(events, enclosures, strict=True):
            assert inside(event.phase, enclosure)
        if not has_coordinates:
            assert all(map(inside, motion.mesh_state(), start))

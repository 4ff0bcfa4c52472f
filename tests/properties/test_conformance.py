"""Every model against the program of `tests.independent`: motions, orbits, derivatives.

``GEARLIB_TRAINS=500`` takes so many random trains in place of a few: some minutes.
"""

import math
import os
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

import gearlib
from gearlib import periodic_orbit, simulate
from gearlib.analysis.orbits.shooting import compose, floquet_multipliers
from tests.independent import program
from tests.independent.systems import describe, equations_of, move
from tests.properties.cases import CASES, random_trains_case
from tests.properties.known_models import (
    CHAIN,
    DAMPED,
    GEARS,
    KNOWN,
    OSCILLATOR,
    OTHER,
    Known,
    gears,
)
from tests.properties.test_properties import FEW, allowed

SAMPLES = 16
EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")
TIMES = ("fraction_normal", "fraction_backlash", "fraction_inverse", "fraction_min_stiffness")


def merged(rows):
    """Return events (before, after, phase), those through a gap of no width as one."""
    found = []
    for row in rows:
        if found and found[-1][1] == row[0] == 0 and row[2] - found[-1][2] < 1e-10:
            row = (found.pop()[0], row[1], row[2])
        found.append(row)
    return found


def by_mesh(motion):
    """Return contact -> rows (before, after, phase) of a motion of the reference."""
    found = {j: [] for j in range(len(motion.equations.contacts))}
    for event in motion.events:
        found[event.contact].append((event.before, event.after, float(event.phase)))
    return {j: merged(rows) for j, rows in found.items()}


def events_of(run, count):
    meshes = run.event_mesh.values if "event_mesh" in run else np.zeros(run.sizes["event"], int)
    found = {j: [] for j in range(count)}
    for j, *row in zip(meshes, run.event_from.values, run.event_to.values, run.event_phase.values,
                       strict=True):  # fmt: skip
        found[int(j)].append(tuple(row))
    return {j: merged(rows) for j, rows in found.items()}


def same_motion(case, run, motion, within):
    """Assert that a run, recorded from its start, is a motion of the reference."""
    assert int(run.status) == 0
    periods, theirs = case.periods, by_mesh(motion)
    ours = events_of(run, len(theirs))
    for j in ours:
        assert [row[:2] for row in ours[j]] == [row[:2] for row in theirs[j]], j
        for one, other in zip(ours[j], theirs[j], strict=True):
            # Next to a grazing a phase has half of the digits of the state.
            assert abs(one[2] - other[2]) < 1e5 * within
    several = "mesh" in run.dims
    end = motion.state if several else motion.mesh_state()
    scale = max(1.0, np.abs(end).max())
    np.testing.assert_allclose(run.final_state, end, rtol=0, atol=within * scale)
    assert (run.displacement.values.size > 0) and len(motion.record.samples) > 0
    rows = {float(sample[0]): sample[1:] for sample in motion.record.samples}
    # Where a stiffness switches a sample is on either side.
    cuts = [0.0, *motion.cuts, *(event[2] for every in theirs.values() for event in every)]
    for name, i in (("displacement", 0), ("velocity", 1), ("dynamic_force", 2)):
        values = run[name].values.reshape(len(run.phase), -1)
        for phase, row in zip(run.phase.values, values, strict=True):
            if phase in rows and min([abs(phase - at) for at in cuts], default=1.0) > 1e-6:
                atol = 10.0 * within * scale
                np.testing.assert_allclose(row, rows[phase][i], rtol=0, atol=atol, err_msg=name)
    if hasattr(case.model, "flexible"):
        # What moves across the line of action is felt by no mesh.
        bearings = [("y3", "z3", "y2", "z2")[i] for i in case.model.elastic_bearings()]
        names = ["rotation_3", "rotation_2", *(f"bearing_{name}" for name in bearings)]
        for i, name in enumerate(names):
            expected = [row[3][i] for row in rows.values()]
            atol = 10.0 * within * scale
            np.testing.assert_allclose(run[name], expected, rtol=0, atol=atol, err_msg=name)
    for name, pick, values in zip(EXTREMA, (max, min) * 2, np.repeat([0, 1], 2), strict=True):
        expected = [pick(row) for row in (motion.record.heights, motion.record.forces)[values]]
        atol = 10.0 * within * scale
        np.testing.assert_allclose(np.ravel(run[name]), expected, rtol=0, atol=atol, err_msg=name)
    for i, name in enumerate(TIMES):
        expected = [one[i] / (2.0 * math.pi * periods) for one in motion.record.times]
        np.testing.assert_allclose(np.ravel(run[name]), expected, rtol=0, atol=1e5 * within)


def of_reference(case, **options):
    """Return the motion of a case, sampled beside the switches."""
    phases = 2.0 * math.pi * np.arange(case.periods * SAMPLES) / SAMPLES
    state = case.model.start_state(case.state) if isinstance(case.state, str) else case.state
    return move(
        describe(case.model),
        case.tuning,
        case.periods,
        state,
        recorded=case.periods,
        phases=phases.tolist(),
        **options,
    )


def whole(case, **options):
    """Return the run of a case, all periods recorded."""
    given = {"periods": case.periods, "record_periods": case.periods}
    given |= {"initial_state": case.state, "samples_per_period": SAMPLES}
    return simulate(case.model, case.tuning, **given | options)


@pytest.mark.parametrize("name", KNOWN)
def test_a_motion_is_that_of_the_reference(name):
    case = KNOWN[name]
    motion = of_reference(case)
    for method in case.model.propagators:
        # Rounding of up to eight periods, amplified by bounces.
        same_motion(case, whole(case, method=method), motion, 1e-11)
    fast = whole(case, record_periods=1)
    np.testing.assert_allclose(fast.final_state, whole(case).final_state, rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", [name for name in CASES if name != "pairs of teeth"])
@given(data=st.data())
@settings(FEW, phases=[Phase.generate])
def test_a_random_motion_is_that_of_the_reference(kind, data):
    case = data.draw(CASES[kind])
    _compare(Known(case.model, case.tuning, case.state, 3), case)


def _compare(known, case):
    """Compare with the reference, unless a part in 1e12 of the start makes too much."""
    run = whole(known)
    if int(run.status):
        return None
    within, comparable = allowed(case, run, known.periods)
    if comparable:
        same_motion(known, run, of_reference(known), within)
    return run


@pytest.mark.parametrize("seed", range(int(os.environ.get("GEARLIB_TRAINS", "16"))))
def test_no_event_of_a_random_train_is_missed(seed):
    case = random_trains_case(seed)
    _compare(Known(case.model, case.tuning, case.state, 3), case)


def test_some_of_them_graze_and_some_have_events_at_once():
    together, shortest = 0, math.inf
    for seed in range(16):
        case = random_trains_case(seed)
        events = of_reference(Known(case.model, case.tuning, case.state, 3)).events
        apart = [b.phase - a.phase for a, b in pairwise(events) if a.contact != b.contact]
        together += min(apart, default=1.0) < 1e-11
        for j in range(len(case.model.meshes)) if seed % 4 == 2 else ():
            own = [event.phase for event in events if event.contact == j]
            shortest = min([shortest, *(b - a for a, b in pairwise(own))])
    assert together >= 2 and shortest < 0.05


FRICTION = {"friction": (0.06, 0.04), "pitch_phase": 0.7}
ORBITS = {
    "pair": (DAMPED, 0.9, None),
    "pair in contact": (DAMPED, 0.7, None),
    "pair in oil": (DAMPED.replace(backlash_damping=800.0), 0.82, None),
    "pair on both flanks": (OTHER, 0.88, (0.096, -2.833)),
    "cubic damping": (KNOWN["cubic damping"].model, 0.9, None),
    "table": (KNOWN["table"].model.replace(pair=DAMPED), 0.9, None),
    "oscillator": (OSCILLATOR, 0.8, None),
    "cubic damping above": (KNOWN["cubic damping"].model, 1.3, None),
    "six degrees": (gears(3e7, 3953.7, 3953.7, free=True, share=0.2), 0.9, None),
    "six degrees in contact": (gears(3e7, 3953.7, 3953.7, free=True, share=0.2), 0.7, None),
    "inverse mesh": (
        gears(3e9, 1500.0, 300.0, share=0.2, backlash=12e-6, **FRICTION),
        0.8,
        None,
    ),
    "run-out": (GEARS.replace(teeth=(3, 3)), 0.7, None),
    "planets": (KNOWN["bouncing planets"].model, 1.0, None),
    "chain": (CHAIN, 0.5, None),
}  # fmt: skip


def reference_map(model, tuning, period, state):
    """Return the central differences of the reference over an orbit, all components."""
    state, columns = np.array(state), []
    equations = equations_of(describe(model), tuning)
    for j in range(state.size):
        ends = []
        for side in (1.0, -1.0):
            other = state.copy()
            other[j] += side * 1e-6
            ends.append(np.array(program.move(equations, period, other).state))
        columns.append((ends[0] - ends[1]) / 2e-6)
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("name", ORBITS)
def test_orbits_multipliers_and_certificates(name):
    model, tuning, guess = ORBITS[name]
    orbit = periodic_orbit(model, tuning, guess=guess, period=model.repeats)
    assert orbit.residual <= 1e-12
    _closes(model, tuning, orbit)
    motion = move(describe(model), tuning, orbit.period, tuple(orbit.state))
    reduce, lift = model.reduction()
    away = reduce @ (np.array(motion.state) - orbit.state)
    np.testing.assert_allclose(away, 0.0, atol=1e-10 * max(1.0, np.abs(orbit.state).max()))
    differences = reference_map(model, tuning, orbit.period, orbit.state)
    found = np.linalg.eigvals(reduce @ differences @ lift)
    # Truncation of the differences is 1e-9; multipliers that are close move by its root.
    by_size = [np.sort(np.abs(values)) for values in (orbit.multipliers, found)]
    np.testing.assert_allclose(*by_size, rtol=0, atol=1e-4)
    np.testing.assert_allclose(orbit.multipliers.sum(), found.sum(), atol=1e-6)
    np.testing.assert_allclose(
        np.prod(orbit.multipliers), np.linalg.det(reduce @ differences @ lift), rtol=1e-5, atol=1e-9
    )
    if model.equation is not None and not model.equation.is_piecewise_linear():
        return
    pytest.importorskip("flint")
    proven = gearlib.certify(orbit)
    assert proven, proven
    _overlaps(model, tuning, orbit, proven)


def _closes(model, tuning, orbit):
    """Assert that all runs beside a stable orbit settle on it, and what two repeats of it are."""
    reduce, lift = model.reduction()
    if orbit.stable and (abs(orbit.multipliers) ** (2000 / orbit.period) < 1e-12).all():
        run = simulate(model, tuning, periods=2000, initial_state=tuple(orbit.state + 1e-6))
        assert int(run.period) in (1, orbit.period)
        if run.final_state.size == orbit.state.size:
            away = reduce @ (run.final_state.values - orbit.state)
            np.testing.assert_allclose(away, 0.0, rtol=0, atol=1e-9)
    # Twice its period is none of its own.
    twice = periodic_orbit(model, tuning, guess=orbit.state, period=2 * orbit.period)
    assert twice.period == orbit.period
    np.testing.assert_allclose(reduce @ (twice.state - orbit.state), 0.0, rtol=0, atol=1e-9)
    _, maps, _ = model.propagator(tuning).maps(orbit.state, 2 * orbit.period, 100_000)
    multipliers = floquet_multipliers(compose(reduce @ maps @ lift))
    # Of a cluster each moves by the root of rounding.
    squares = [np.sort(np.abs(one)) for one in (multipliers, orbit.multipliers**2)]
    np.testing.assert_allclose(*squares, rtol=0, atol=1e-7)
    total = np.sum(orbit.multipliers**2)
    assert multipliers.sum() == pytest.approx(total, abs=1e-11 * max(1.0, abs(total)))
    if isinstance(model, gearlib.GearPair):
        # Liouville: the product is that of the time with each damping.
        one = simulate(model, tuning, periods=orbit.period, record_periods=orbit.period,
                       initial_state=tuple(orbit.state))  # fmt: skip
        lost = float(one.fraction_backlash)
        rate = model.damping_ratio * (1.0 - lost) + model.backlash_damping_ratio * lost
        expected = math.exp(-4.0 * math.pi * rate * orbit.period / tuning)
        assert np.prod(orbit.multipliers).real == pytest.approx(expected, rel=1e-10)


def _overlaps(model, tuning, orbit, proven):
    """Assert that the reference goes from the middle of an enclosure through all others."""

    def middle(one):
        return (mpf(str(one.low)) + mpf(str(one.high))) / 2

    def inside(value, one, digits=25):
        room = mpf(10) ** -digits
        return mpf(str(one.low)) - room <= value <= mpf(str(one.high)) + room

    several = hasattr(proven, "coordinates")
    description = describe(model)
    with mp.workdps(50):
        if several:
            state = [*map(middle, proven.displacement), *map(middle, proven.velocity)]
            if "gear" in type(model).__name__.lower() and model.mesh_names:
                description["derived"] = {
                    "length": model.static_deflection,
                    "omega": model.reference_angular_frequency,
                }
        else:
            state = [middle(proven.displacement), middle(proven.velocity)]
        motion = move(description, tuning, orbit.period, state, context=mp)
        events = sorted(motion.events, key=lambda event: (event.phase, event.contact))
        # At one instant in any order.
        theirs = sorted(proven.events, key=lambda event: float(event.phase))
        assert len(events) == len(theirs)
        for event, other in zip(events, theirs, strict=True):
            assert inside(event.phase, other.phase)
        if not several:
            end = motion.mesh_state()
            assert inside(end[0], proven.displacement) and inside(end[1], proven.velocity)

"""Every model against the independent code of `tests.references`: motions, orbits, derivatives.

``GEARLIB_TRAINS=500`` takes so many random trains in place of a few: some minutes.
"""

import math
import os
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

import gearlib
from gearlib import orbit_sensitivities, periodic_orbit, simulate
from tests.properties.cases import CASES, random_trains_case
from tests.properties.known_models import (
    CHAIN,
    DAMPED,
    GEARS,
    KNOWN,
    OSCILLATOR,
    OTHER,
    SETTLING,
    STRIKING,
    Known,
    gears,
)
from tests.properties.test_properties import FEW, allowed
from tests.references import Stored, reference_slopes
from tests.references.described_models import describe, size_of
from tests.references.reference_by_scipy import by_scipy
from tests.references.reference_motion import move

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
    found = {j: [] for j in range(len(motion.machine.contacts))}
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
    machine, periods = motion.machine, case.periods
    ours, theirs = events_of(run, len(machine.contacts)), by_mesh(motion)
    for j in ours:
        assert [row[:2] for row in ours[j]] == [row[:2] for row in theirs[j]], j
        for one, other in zip(ours[j], theirs[j], strict=True):
            # Next to a grazing a phase has half of the digits of the state.
            assert abs(one[2] - other[2]) < 1e5 * within
    several = "mesh" in run.dims
    end = motion.state if several else motion.mesh_state(periods)
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
    force = machine.length * machine.force_unit
    for name, pick, values, unit in (
        (EXTREMA[0], max, motion.record.heights, machine.length),
        (EXTREMA[1], min, motion.record.heights, machine.length),
        (EXTREMA[2], max, motion.record.forces, force),
        (EXTREMA[3], min, motion.record.forces, force),
    ):
        expected = [pick(one) / unit for one in values]
        atol = 10.0 * within * scale
        np.testing.assert_allclose(np.ravel(run[name]), expected, rtol=0, atol=atol, err_msg=name)
    for i, name in enumerate(TIMES):
        expected = [one[i] / (2.0 * math.pi * periods) for one in motion.record.times]
        np.testing.assert_allclose(np.ravel(run[name]), expected, rtol=0, atol=1e5 * within)


def of_reference(case, **options):
    """Return the motion of a case, sampled beside the switches."""
    phases = 2.0 * math.pi * np.arange(case.periods * SAMPLES) / SAMPLES
    return move(
        describe(case.model),
        case.tuning,
        case.periods,
        case.state,
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
    for method in case.model.mathematics:
        # Rounding of up to eight periods, amplified by bounces.
        same_motion(case, whole(case, method=method), motion, 1e-11)
    fast = whole(case, record_periods=1)
    np.testing.assert_allclose(fast.final_state, whole(case).final_state, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", list(KNOWN)[::4])
def test_two_ways_of_the_reference_agree(name):
    case = KNOWN[name]
    end, events = by_scipy(describe(case.model), case.tuning, 2, case.state)
    motion = move(describe(case.model), case.tuning, 2, case.state)
    assert events == len(motion.events)
    # Tolerances of scipy.
    np.testing.assert_allclose(end, motion.state, rtol=0, atol=1e-8 * np.abs(end).max())


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
    "pair on both flanks": (OTHER, 0.88, (0.096, -2.833)),
    "cubic damping": (KNOWN["cubic damping"].model, 0.9, None),
    "table": (KNOWN["table"].model.replace(pair=DAMPED), 0.9, None),
    "oscillator": (OSCILLATOR, 0.8, None),
    "six degrees": (gears(3e7, 3953.7, 3953.7, free=True, share=0.2), 0.9, None),
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
    for j in range(state.size):
        ends = []
        for side in (1.0, -1.0):
            other = state.copy()
            other[j] += side * 1e-6
            ends.append(move(describe(model), tuning, period, tuple(other)).state)
        columns.append((ends[0] - ends[1]) / 2e-6)
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("name", ORBITS)
def test_orbits_multipliers_and_certificates(name):
    model, tuning, guess = ORBITS[name]
    orbit = periodic_orbit(model, tuning, guess=guess, period=model.repeats)
    assert orbit.residual <= 1e-12
    motion = move(describe(model), tuning, orbit.period, tuple(orbit.state))
    reduce, lift = model.reduction()
    away = reduce @ (motion.state - orbit.state)
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
            end = motion.mesh_state(orbit.period)
            assert inside(end[0], proven.displacement) and inside(end[1], proven.velocity)


REFERENCES = Stored("sensitivities")
#: What is asked for: 1e-10 of each derivative, or of 1e-3 of the largest by the same parameter.
SHARE, LEAST = 1e-10, 1e-3
LEFT = ("torque of",)


def random_pair(seed):
    """Return a pair by random ratios; most lose contact, many strike both flanks."""
    rng = np.random.default_rng(seed)
    ratios = {
        "contact_ratio": rng.uniform(1.05, 1.95),
        "stiffness_ratio": rng.uniform(0.1, 0.95),
        "damping": 10 ** rng.uniform(-3, -0.3),
        "backlash_damping": 10 ** rng.uniform(-3, -0.3),
        "backlash": 10 ** rng.uniform(-1, 0.7),
    }
    state = tuple(map(float, rng.uniform(-3.0, 3.0, 2)))
    pair = gearlib.GearPair.from_ratios(**{key: float(x) for key, x in ratios.items()})
    return Known(pair, float(10 ** rng.uniform(-0.5, 0.4)), state, 3)


def _ratios(*values):
    names = ("contact_ratio", "stiffness_ratio", "damping", "backlash_damping", "backlash")
    return gearlib.GearPair.from_ratios(**dict(zip(names, values, strict=True)))


SLOPES = {f"pair {seed}": random_pair(seed) for seed in range(24)} | {
    # One side of a segment of no length.
    "contact ratio 1": Known(_ratios(1.0, 0.6, 0.05, 0.02, 1.0), 0.8, (0.3, -2.0), 3),
    "contact ratio 2": Known(_ratios(2.0, 0.6, 0.05, 0.02, 1.0), 0.8, (0.3, -2.0), 3),
    "no backlash": Known(_ratios(1.5, 0.6, 0.05, 0.3, 0.0), 0.8, (0.3, -2.0), 3),
    "no far flank": Known(_ratios(1.5, 0.6, 0.05, 0.02, math.inf), 0.9, (0.3, -2.0), 3),
    "critical": Known(_ratios(1.5, 1.0, 1.0, 0.0, 1.0), 0.7, (0.3, -6.0), 3),
    "over-damped": Known(_ratios(1.5, 0.6, 2.0, 0.5, 1.0), 0.3, (-3.0, 1.0), 3),
    "undamped": Known(_ratios(1.5, 0.6, 0.0, 0.0, 1.0), 0.9, (0.3, -2.0), 3),
    "pair in SI units": Known(DAMPED, 0.9, (0.5, -3.0), 12),
    "one degree": Known(KNOWN["deviating"].model, 0.7, (1.0, -3.0), 3),
    "oscillator": Known(OSCILLATOR, 0.8, (0.3, -1.0), 3),
    "steps": Known(KNOWN["unequal sides"].model, 1.3, (0.2, 0.9), 2),
    "unequal gears": Known(GEARS, 0.9, (0.3, -5.0), 2),
    "far flank at rest": Known(
        GEARS.replace(moving_backlash=False, preload=False), 0.6, (0.3, -5.0), 1
    ),
    "chain that settles": Known(CHAIN, 0.8, SETTLING, 2),
    "chain that strikes": Known(CHAIN, 0.7, STRIKING, 1),
    "chain from rest": Known(CHAIN, 0.45, "static", 1),
}


def named(case):
    """Return the parameters by which a case is differentiated."""
    names = [name for name in case.model.derivatives if not name.startswith(LEFT)]
    if not isinstance(case.model, gearlib.GearPair):
        edges = ()
    else:
        edges = ("backlash", "backlash_ratio") if math.isinf(case.model.backlash) else ()
    if isinstance(case.state, str):
        # Where nothing holds the train a little stiffness decides where it rests.
        names = [name for name in names if not name.startswith(("initial", "torsional"))]
    return [name for name in names if name not in edges]


@pytest.mark.parametrize("name", SLOPES)
def test_derivatives_have_ten_digits(name):
    case = SLOPES[name]
    names = named(case)
    run = simulate(
        case.model,
        case.tuning,
        periods=case.periods,
        initial_state=case.state,
        sensitivities=names,
    )
    assert int(run.sensitivity_status) == (5 if name.startswith("contact ratio") else 0)
    description = describe(case.model)
    arguments = description, case.tuning, case.periods, case.state
    variables = ("event_phase", "event_velocity", "final_state", *EXTREMA, *TIMES)
    rows = REFERENCES.rows(reference_slopes.of_run, *arguments, names)
    for parameter, reference in zip(names, rows, strict=True):
        found = [np.ravel(run[f"d_{one}_d_{parameter}"].values) for one in sorted(variables)]
        found = np.concatenate(found)
        reference = np.array(reference, float)
        # Where all stiffness is C_min and C_max: the last but one of the variables by name.
        left = (-2,) if description.get("stiffness_ratio") == 1.0 else ()
        close(found, reference, (name, parameter), description, case.tuning, left)


def close(found, reference, about, description, tuning, left=()):
    """Assert that derivatives by one parameter have ten digits, those that are NaN left out."""
    value = abs(float(size_of(description, tuning, about[1]))) or 1.0
    # The force jumps at a segment that appears: these are no numbers.
    there = np.isfinite(found)
    assert there.all() or "contact" in about[1]
    # Nor has the reference those of events that part.
    there &= np.isfinite(reference)
    there[list(left)] = False
    found, reference = found[there], reference[there]
    # By a relative change at least a part in 1e13 of a value of order one.
    size = np.maximum(np.abs(reference), LEAST * np.abs(reference).max())
    size = np.maximum(size, 1e-4 / value)
    off = np.abs(found - reference) / size
    assert off.max() <= SHARE, (*about, off.max())


@pytest.mark.parametrize(
    ("model", "tuning", "guess"),
    [
        (DAMPED, 0.9, None),
        (DAMPED, 0.7, None),
        (OTHER, 0.5, None),
        (OTHER, 0.88, (0.096, -2.833)),
        (OTHER, 0.851, (-0.1022, -1.4451)),
        (OSCILLATOR, 0.8, None),
    ],
)
def test_derivatives_of_orbits_and_multipliers(model, tuning, guess):
    orbit = periodic_orbit(model, tuning, guess=guess)
    names = [name for name in model.derivatives if not name.startswith("initial")]
    found = orbit_sensitivities(orbit, names)
    assert int(found.sensitivity_status) == 0
    start, description = tuple(round(float(x), 6) for x in orbit.state), describe(model)
    rows = REFERENCES.rows(reference_slopes.of_orbit, description, tuning, 1, start, names)
    parts = ("state", "multiplier_real", "multiplier_imaginary")
    for name, reference in zip(names, rows, strict=True):
        row = np.concatenate([np.ravel(found[f"d_{part}_d_{name}"].values) for part in parts])
        close(row, np.array(reference, float), (type(model).__name__, name), description, tuning)


@pytest.mark.parametrize(
    ("pair", "start", "to", "contacts"),
    [
        (OTHER, 0.8, 0.93, ["NB", "NBIB"]),
        (replace(DAMPED, backlash_damping=0.0), 0.79, 0.83, ["NB"]),
    ],
)
def test_derivatives_of_folds(pair, start, to, contacts):
    branch = gearlib.continue_orbit(periodic_orbit(pair, start), to=to)
    folds = np.flatnonzero(branch.label == 1)[: len(contacts)]
    assert branch.contacts.values[folds].tolist() == contacts
    names, description = (
        [n for n in pair.derivatives if n[:3] not in ("ini", "tun")],
        describe(pair),
    )
    for point in folds:
        found = gearlib.fold_sensitivities(pair, branch, int(point), names)
        guess = (*branch.state.values[point], float(branch.tuning[point]))
        guess = tuple(round(float(value), 6) for value in guess)
        rows = REFERENCES.rows(reference_slopes.of_fold, description, 1, guess, names)
        for name, reference in zip(names, rows, strict=True):
            row = np.array([float(found[f"d_tuning_d_{name}"])])
            close(row, np.array(reference, float), ("fold", name), description, 1.0)

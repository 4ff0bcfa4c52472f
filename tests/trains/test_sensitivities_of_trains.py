"""Derivatives of gear trains: against 50 digits, differences of random trains, and one pair."""

import dataclasses
import math

import numpy as np
import pytest

from gearlib import (
    Body,
    GearTrain,
    Mesh,
    Shaft,
    continue_orbit,
    fold_sensitivities,
    orbit_sensitivities,
    periodic_orbit,
    planetary,
    simulate,
)
from gearlib.analysis.orbits.branch_points import Shooting
from gearlib.analysis.orbits.parameters import value_of
from gearlib.models.trains.derivatives import FIELDS
from gearlib.runs.sensitivities import DOUBLE, ONE_SIDED
from tests.paper import PAPER
from tests.references import Stored
from tests.trains import high_precision_trains as exact
from tests.trains.random_trains import random_problem

REFERENCES = Stored("sensitivities_of_trains")
#: What is asked for: 1e-10 of each derivative, or of 1e-3 of the largest by the same parameter.
SHARE, LEAST = 1e-10, 1e-3
EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")
TIMES = ("fraction_normal", "fraction_backlash", "fraction_inverse", "fraction_min_stiffness")
EVENT = ("event_phase", "event_velocity")
#: Motor, pinion, idler and wheel; then bearing, shaft, both meshes, load and tuning.
VALUES = (
    *(0.02, 0.002, 0.01, 0.03),
    *(5.0, 5e8, 4e8, 500.0, 700.0, 2e5, 0.2),
    *(3e8, 0.7, 1.6, 20e-6, 2000.0, 300.0, 1e-6),
    *(2.5e8, 0.6, 1.4, 15e-6, 1500.0, 200.0, -2e-6),
    2000.0,
)
SETTLING = (-4.81, -7.95, -1.49, 2.52, 6.82, 0.66, -2.32, -3.3, 3.14, 6.87, 1.15, -5.18)
STRIKING = (-9.58, 16.0, 2.03, -17.32, -0.84, -11.63, -4.41, -3.42, -4.99, 3.87, -0.44, -4.13)
#: Of the motion from `STRIKING`: components of the start and parameters.
MIXED = (2, 10), (2, 9, 15, 18, exact.TUNING)


def train_of(values):
    """Return the train of `tests.trains.high_precision_trains`."""
    radii = [float(r) for r in exact.RADII]
    inertias, (mass, kx, ky, cx, cy, shaft, rubbing) = values[:4], values[4:11]
    names = ("motor", "pinion", "idler", "wheel")
    torque = values[25] * radii[1]
    more = (
        {"torque": torque},
        {"teeth": 24},
        {"teeth": 36, "mass": mass, "support_stiffness": (kx, ky), "support_damping": (cx, cy)},
        {"teeth": 48, "torque": -2.0 * torque},
    )
    bodies = [
        Body(name=name, inertia=inertia, base_radius=r, **own)
        for name, inertia, r, own in zip(names, inertias, radii, more, strict=True)
    ]
    fields = tuple(FIELDS["mesh"])
    meshes = [
        Mesh(
            pinion=names[1 + j],
            wheel=names[2 + j],
            direction=1 - 2 * j,
            phase=j * float(exact.LAG),
            **dict(zip(fields, values[11 + 7 * j : 18 + 7 * j], strict=True)),
        )
        for j in range(2)
    ]
    shafts = [Shaft(bodies=("motor", "pinion"), stiffness=shaft, damping=rubbing)]
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


TRAIN = train_of(VALUES)


def row_of(run, name):
    """Return the derivatives by a parameter in the columns of the references."""
    row = [*run[f"d_final_state_d_{name}"].values]
    for j in range(2):
        row += [float(run[f"d_{of}_d_{name}"][j]) for of in EXTREMA]
        row += [2.0 * math.pi * float(run[f"d_{of}_d_{name}"][j]) for of in TIMES]
    return row + [
        float(run[f"d_{of}_d_{name}"][i]) for i in range(run.sizes["event"]) for of in EVENT
    ]


def close(row, reference):
    """Return whether derivatives by one parameter have ten digits."""
    reference = np.array(reference, float)
    size = np.maximum(np.abs(reference), LEAST * np.abs(reference).max())
    return bool((np.abs(np.array(row) - reference) <= SHARE * size).all())


@pytest.mark.parametrize(
    ("tuning", "periods", "state"),
    [(0.8, 2, SETTLING), (0.7, 1, STRIKING), (0.45, 1, "static")],
)
def test_all_parameters_against_50_digits(tuning, periods, state):
    options = {"periods": periods, "initial_state": state}
    run = simulate(TRAIN, tuning, sensitivities=exact.NAMES, **options)
    assert (
        int(run.sensitivity_status) == 0
        and run.sizes["event"] == {0.8: 5, 0.7: 10, 0.45: 0}[tuning]
    )
    rows = REFERENCES.rows(exact.of_run, (*VALUES, tuning), periods, state)
    for name, reference in zip(exact.NAMES, rows, strict=True):
        assert close(row_of(run, name), reference), name


def test_starts_and_maps_against_50_digits():
    names = [f"initial_state of {component}" for component in TRAIN.components]
    run = simulate(TRAIN, 0.7, periods=1, initial_state=STRIKING, sensitivities=names)
    rows = REFERENCES.rows(exact.of_start, (*VALUES, 0.7), 1, STRIKING)
    for name, reference in zip(names, rows, strict=True):
        assert close(row_of(run, name), reference), name
    # What the map of small deviations changes by while the start stays.
    components, parameters = MIXED
    propagator = TRAIN.propagator(0.7)
    along = propagator.directions(TRAIN, [exact.NAMES[i] for i in parameters])
    z = propagator.start(STRIKING)
    matrix, rates, _ = propagator.map_rates(z, along, np.zeros((12, len(along))), 1, 1000)
    np.testing.assert_allclose(matrix, propagator.maps(z, 1, 1000)[1][0], rtol=0, atol=1e-11)
    rows = REFERENCES.rows(exact.of_map, (*VALUES, 0.7), 1, STRIKING, *MIXED)
    found = [rates[j, :, i] for i in components for j in range(len(parameters))]
    assert all(close(row, reference) for row, reference in zip(found, rows, strict=True))


def changed(train, name, share):
    """Return a train with a parameter changed by a share of it, and by how much."""
    if name == "load":
        bodies = [dataclasses.replace(b, torque=b.torque * (1.0 + share)) for b in train.bodies]
        return train.replace(bodies=bodies), train.load * share
    parts = {"bodies": train.bodies, "shafts": train.shafts, "meshes": train.meshes}
    field, _, element = name.partition(" of ")
    for kind, elements in parts.items():
        for i, one in enumerate(elements):
            label = "-".join(one.bodies) if kind == "shafts" else one.name
            if element in (f"body {label}", f"shaft {label}", f"mesh {label}"):
                value = getattr(one, field)
                new = dataclasses.replace(one, **{field: value * (1.0 + share)})
                return train.replace(
                    **{kind: [*elements[:i], new, *elements[i + 1 :]]}
                ), value * share
    raise AssertionError(name)


def _sorted(run, variable):
    """Return values of events with those of one instant by their mesh."""
    order = np.lexsort((run.event_mesh, run.event_phase.values.round(9)))
    return run[variable].values[order]


@pytest.mark.parametrize("seed", range(10))
def test_random_trains_against_differences(seed):
    train, tuning, state = random_problem(np.random.default_rng(seed))
    # Modes of one frequency may part.
    train = train.replace(reference_frequency=train.reference_angular_frequency / (2.0 * math.pi))
    rng = np.random.default_rng(100 + seed)
    # One parameter of an element that has only one, and is finite; those of a load balance.
    left = ("torque", "error", "support", "torsional", "initial")
    candidates = [
        name
        for name in train.derivatives
        if " of " in name and not name.startswith(left) and not name.startswith("backlash of")
    ]
    candidates += [
        f"backlash of mesh {mesh.name}" for mesh in train.meshes if np.isfinite(mesh.backlash)
    ]
    names = ["tuning", "load", *rng.choice(candidates, 2, replace=False).tolist()]
    start = "static" if seed % 3 == 0 else tuple(state)
    options = {"periods": 2, "record_periods": 1, "samples_per_period": 8, "initial_state": start}
    run = simulate(train, tuning, sensitivities=names, **options)
    share = 1e-5
    for name in names:
        ends = []
        for sign in (1.0, -1.0):
            moved, speed, step = train, tuning * (1.0 + sign * share), tuning * share
            if name != "tuning":
                moved, step = changed(train, name, sign * share)
                speed, step = tuning, abs(step)
            ends.append(simulate(moved, speed, **options))
        if len({one.sizes["event"] for one in (*ends, run)}) > 1 or not step:
            continue
        for variable in ("final_state", "displacement_max", "dynamic_force_max", *TIMES, *EVENT):
            values = _sorted if variable in EVENT else lambda one, of: one[of].values
            found = run[f"d_{variable}_d_{name}"].values
            if variable in EVENT:
                found = _sorted(run.assign(own=run[f"d_{variable}_d_{name}"]), "own")
            difference = (values(ends[0], variable) - values(ends[1], variable)) / (2.0 * share)
            # By a relative change: truncation is 1e-10 of third derivatives, rounding 1e-13 / 1e-5.
            off = np.abs(found * step / share - difference).max(initial=0.0)
            size = 1.0 + np.abs(difference).max(initial=0.0)
            assert off <= 1e-6 * size, (name, variable, off)


PAIR = PAPER.replace(material_damping=3953.7, backlash_damping=500.0)


def one_pair():
    """Return `PAIR` as a train."""
    fields = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash")
    fields += ("material_damping", "backlash_damping")
    inertia = 2.0 * PAIR.reduced_mass * 0.05**2
    bodies = [
        Body(name=name, inertia=inertia, base_radius=0.05, teeth=24, torque=PAIR.load * 0.05)
        for name in ("pinion", "wheel")
    ]
    values = {name: getattr(PAIR, name) for name in fields}
    return GearTrain(bodies=bodies, meshes=[Mesh(pinion="pinion", wheel="wheel", **values)])


SHARED = (
    *("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash", "material_damping"),
    *("backlash_damping", "load", "tuning"),
)


def same(one, other, variable, name, share):
    """Assert that derivatives by a relative change of a parameter of `PAIR` are the same."""
    values = getattr(PAIR, name, 1.0) * one[f"d_{variable}_d_{name}"].values
    found = getattr(PAIR, name, 1.0) * other[f"d_{variable}_d_{name}"].values
    size = 1.0 + np.abs(values).max(initial=0.0)
    np.testing.assert_allclose(found.reshape(values.shape), values, rtol=0, atol=share * size)


def test_one_pair_as_a_train():
    train, state = one_pair(), (0.3, -6.0)
    own = (0.15, 0.15, -3.0, -3.0)
    for periods in (3, 400):
        runs = [
            simulate(pair, 0.9, periods=periods, initial_state=start, sensitivities=SHARED)
            for pair, start in ((PAIR, state), (train, own))
        ]
        for name in SHARED:
            for variable in ("displacement", "acceleration", *EXTREMA, *TIMES, *EVENT):
                # Both have some 1e-13, and a settled motion as much over the distance of its
                # multipliers from 1.
                same(*runs, variable, name, 1e-11)
    # The inertia of one of two equal gears is a quarter of the reduced mass.
    parts = simulate(train, 0.9, periods=3, sensitivities="inertia of body wheel")
    whole = simulate(PAIR, 0.9, periods=3, sensitivities="reduced_mass")
    np.testing.assert_allclose(
        0.05**2 * parts["d_displacement_d_inertia of body wheel"].values[:, 0],
        0.25 * whole.d_displacement_d_reduced_mass,
        rtol=0,
        atol=1e-12 * float(abs(whole.d_displacement_d_reduced_mass).max()),
    )
    assert parts["d_displacement_d_inertia of body wheel"].attrs["units"] == "kg-1 m-2"


def test_orbits_multipliers_and_folds_of_one_pair_as_a_train():
    train = one_pair()
    orbits = [periodic_orbit(pair, 0.88) for pair in (PAIR, train)]
    assert len(orbits[0].pattern) > 1
    one, other = (orbit_sensitivities(orbit, SHARED) for orbit in orbits)
    for name in SHARED:
        for part in ("multiplier_real", "multiplier_imaginary", "displacement_max", "event_phase"):
            # Orbits are known to 1e-12.
            same(one, other, part, name, 1e-10)
    slopes = []
    for pair in (PAIR, train):
        branch = continue_orbit(periodic_orbit(pair, 0.76), to=0.84)
        fold = int((branch.label == 1).argmax("point"))
        jump = fold_sensitivities(pair, branch, fold, ("material_damping", "load"))
        slopes.append([float(jump[f"d_tuning_d_{name}"]) for name in ("material_damping", "load")])
    # A fold is located to the root of rounding along the branch.
    np.testing.assert_allclose(*slopes, rtol=1e-7, atol=1e-12)


BOUNCING = planetary(stiffness_ratio=(0.7, 0.7), contact_ratio=(1.5, 1.5))


@pytest.mark.parametrize("name", ["contact_ratio", "material_damping", "inertia of body sun"])
def test_orbits_of_planets_against_differences(name):
    train = BOUNCING.replace(reference_frequency=1475.7)
    orbit = periodic_orbit(train, 1.0)
    assert orbit.pattern.count(0) > 2
    found = orbit_sensitivities(orbit, (name,))
    ends, share = [], 1e-6
    for sign in (1.0, -1.0):
        moved, step = train, 0.0
        for mesh in train.mesh_names if " of " not in name else ():
            moved, step = changed(moved, f"{name} of mesh {mesh}", sign * share)
        if " of " in name:
            moved, step = changed(train, name, sign * share)
        ends.append(periodic_orbit(moved, 1.0, guess=orbit.state))
    reduce, _ = train.reduction()
    difference = reduce @ (ends[0].state - ends[1].state) / (2.0 * abs(step))
    slopes = reduce @ found[f"d_state_d_{name}"].values
    # Orbits are known to 1e-12 over the step.
    np.testing.assert_allclose(slopes, difference, rtol=0, atol=1e-5 * np.abs(slopes).max())
    moved = abs(ends[0].multipliers[0]) - abs(ends[1].multipliers[0])
    values = found.multiplier_real.values + 1j * found.multiplier_imaginary.values
    rates = found[f"d_multiplier_real_d_{name}"] + 1j * found[f"d_multiplier_imaginary_d_{name}"]
    size = np.real(np.conj(values[0]) * rates.values[0]) / abs(values[0])
    assert moved / (2.0 * abs(step)) == pytest.approx(size, rel=1e-4)


def test_a_planet_by_itself_parts_double_multipliers():
    train = BOUNCING.replace(reference_frequency=1475.7)
    name = "max_stiffness of mesh sun 1"
    found = orbit_sensitivities(periodic_orbit(train, 0.9), (name,))
    rates = found[f"d_multiplier_real_d_{name}"].values
    assert int(found.sensitivity_status) == DOUBLE
    assert np.isnan(rates).any() and not np.isnan(rates).all()
    assert np.isfinite(found[f"d_state_d_{name}"]).all()
    together = orbit_sensitivities(periodic_orbit(train, 0.9), ("stiffness_ratio",))
    assert int(together.sensitivity_status) == 0
    assert np.isfinite(together.d_multiplier_real_d_stiffness_ratio).all()


@pytest.mark.parametrize("name", list(BOUNCING.parameters))
def test_branches_of_trains_have_exact_derivatives(name):
    value = value_of(BOUNCING, 1.0, name)
    problem = Shooting(BOUNCING, 1.0, 1, (name,), (1.0,), 1000)
    y = problem.unknowns(BOUNCING.start_state("static"), [value])
    found = problem.slopes(y)[:, 0]
    # The difference counts in units of the parameter: that of a damping is small beside it.
    problem.units[-1] = max(value, 1.0)
    y[-1] = value / problem.units[-1]
    difference = problem._difference(y, y.size - 1)
    np.testing.assert_allclose(found, difference, rtol=0, atol=1e-6 * abs(found).max())


def test_a_start_on_flank_lines_that_move():
    # All flanks just touch; an error of assembly opens one or presses it.
    run = simulate(one_pair(), 0.9, periods=1, sensitivities=("error", "load"))
    assert int(run.sensitivity_status) == ONE_SIDED
    assert int(simulate(one_pair(), 0.9, periods=1, sensitivities="load").sensitivity_status) == 0


@pytest.mark.parametrize(
    ("train", "name", "part"),
    [
        (TRAIN, "inertia of body sun", "'inertia of body sun' is not .* 'inertia of body motor'"),
        (
            TRAIN,
            "damping_ratio",
            "'damping_ratio' is not allowed: it must be one of 'tuning', 'load'",
        ),
        (TRAIN, "torque of body motor", "by a torque .* must be 'load'"),
        (
            planetary(stiffness_ratio=(0.7, 0.7)),
            "mass of body planet 1",
            r"reference_frequency = None is not .* as 9647.91 \(Hz\)",
        ),
        (planetary(), "stiffness_ratio", "not allowed at stiffness_ratio = 1.0: it must be < 1"),
        (
            planetary(stiffness_ratio=(0.7, 0.7), contact_ratio=(1.0, 1.5)),
            "contact_ratio",
            "not allowed at contact_ratio = 1.0: it must be > 1 and < 2",
        ),
    ],
)
def test_wrong_input(train, name, part):
    with pytest.raises(ValueError, match=part) as error:
        simulate(train, 0.9, periods=1, sensitivities=(name,))
    assert "\n" not in str(error.value)

"""Derivatives of trains: double multipliers, settled motions, folds, starts on flank lines."""

import numpy as np
import pytest

from gearlib import (
    continue_orbit,
    fold_sensitivities,
    orbit_sensitivities,
    periodic_orbit,
    simulate,
)
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.models.propagators.tangents import Walk
from gearlib.runs.sensitivities import DOUBLE, ONE_SIDED, directions
from tests.physics.test_sensitivities import BOUNCING, moved
from tests.properties.known_models import DAMPED, GEARS, pairs_as_train
from tests.trains.random_trains import random_problem

#: In the order of `recorded_slopes.Tables.best`.
EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")


@pytest.mark.parametrize("name", ["contact_ratio", "material_damping", "inertia of body sun"])
def test_orbits_of_planets_against_differences(name):
    train, share, ends = BOUNCING, 1e-6, []
    orbit = periodic_orbit(train, 1.0)
    assert orbit.pattern.count(0) > 2
    found = orbit_sensitivities(orbit, (name,))
    for sign in (1.0, -1.0):
        other, _, step = moved(train, 1.0, name, sign * share)
        ends.append(periodic_orbit(other, 1.0, guess=orbit.state))
    reduce, _ = train.reduction()
    difference = reduce @ (ends[0].state - ends[1].state) / (2.0 * abs(step))
    slopes = reduce @ found[f"d_state_d_{name}"].values
    # Orbits are known to 1e-12 over the step.
    np.testing.assert_allclose(slopes, difference, rtol=0, atol=1e-5 * np.abs(slopes).max())
    change = abs(ends[0].multipliers[0]) - abs(ends[1].multipliers[0])
    values = found.multiplier_real.values + 1j * found.multiplier_imaginary.values
    rates = found[f"d_multiplier_real_d_{name}"] + 1j * found[f"d_multiplier_imaginary_d_{name}"]
    size = np.real(np.conj(values[0]) * rates.values[0]) / abs(values[0])
    assert change / (2.0 * abs(step)) == pytest.approx(size, rel=1e-4)


def test_a_planet_by_itself_parts_double_multipliers():
    train = BOUNCING
    name = "max_stiffness of mesh sun 1"
    found = orbit_sensitivities(periodic_orbit(train, 0.9), (name,))
    rates = found[f"d_multiplier_real_d_{name}"].values
    assert int(found.sensitivity_status) == DOUBLE
    assert np.isnan(rates).any() and not np.isnan(rates).all()
    assert np.isfinite(found[f"d_state_d_{name}"]).all()
    together = orbit_sensitivities(periodic_orbit(train, 0.9), ("stiffness_ratio",))
    assert int(together.sensitivity_status) == 0
    assert np.isfinite(together.d_multiplier_real_d_stiffness_ratio).all()


def test_a_start_on_flank_lines_that_move():
    # All flanks just touch; an error of assembly opens one or presses it.
    run = simulate(pairs_as_train(DAMPED), 0.9, periods=1, sensitivities=("error", "load"))
    assert int(run.sensitivity_status) == ONE_SIDED
    assert (
        int(
            simulate(
                pairs_as_train(DAMPED), 0.9, periods=1, sensitivities="load"
            ).sensitivity_status
        )
        == 0
    )


def test_settled_derivatives_of_one_pair_as_a_train():
    names, state = (
        ("stiffness_ratio", "material_damping", "load", "tuning"),
        (0.15, 0.15, -3.0, -3.0),
    )
    runs = [
        simulate(pair, 0.9, periods=400, initial_state=start, sensitivities=names)
        for pair, start in ((DAMPED, (0.3, -6.0)), (pairs_as_train(DAMPED), state))
    ]
    for name in names:
        for variable in ("displacement_max", "displacement_min", "fraction_normal", "event_phase"):
            one, other = (np.ravel(run[f"d_{variable}_d_{name}"].values) for run in runs)
            # A settled motion has 1e-13 over the distance of its multipliers from 1.
            np.testing.assert_allclose(other, one, rtol=0, atol=1e-10 * (abs(one).max() + 1e-3))


def test_folds_of_one_pair_as_a_train():
    slopes, names = [], ("material_damping", "load")
    for pair in (DAMPED, pairs_as_train(DAMPED)):
        branch = continue_orbit(periodic_orbit(pair, 0.76), to=0.84)
        fold = int((branch.label == FOLD).argmax("point"))
        jump = fold_sensitivities(pair, branch, fold, names)
        slopes.append([float(jump[f"d_tuning_d_{name}"]) for name in names])
    # A fold is located to the root of rounding along the branch.
    np.testing.assert_allclose(*slopes, rtol=1e-7, atol=1e-12)


def _random_run(seed):
    """Return (model, tuning, state) of slow and fast meshes."""
    rng = np.random.default_rng(seed)
    if seed % 3 == 0:
        damping = {"material_damping": 4000.0 * rng.random(), "backlash_damping": 200.0}
        gears = GEARS.replace(pair=GEARS.pair.replace(**damping))
        return gears, float(10 ** rng.uniform(-2.0, 0.3)), (rng.normal(), 3.0 * rng.normal())
    train, tuning, state = random_problem(rng)
    return train, tuning * 10 ** rng.uniform(-1.5, 0.0), state


@pytest.mark.parametrize("seed", range(12))
def test_extrema_are_those_of_the_run(seed):
    """Where turning points are looked for the largest values are those that a run proves."""
    model, tuning, state = _random_run(seed)
    run, near = (
        simulate(model, tuning, periods=3, record_periods=2, initial_state=tuple(one))
        for one in (state, np.array(state) * (1.0 + 1e-14))
    )
    assert int(run.status) == 0
    propagator, along = model.propagator(tuning), directions(model, ("tuning",))
    state = model.check_state(tuple(state))
    motion, _ = propagator.motion(np.array(propagator.start(state), float), 3, 100_000)
    walk = Walk(propagator.slopes(along), motion, propagator.start_tangents(state, along))
    best = walk.go(1, 8, len(motion.events)).best
    apart = np.ravel(run.fraction_backlash) > 0.0
    for found, name in zip(best, EXTREMA, strict=True):
        wanted, other = np.ravel(run[name]), np.ravel(near[name])
        # A force of zero is that of the backlash.
        kept = ~(apart & (np.abs(wanted) < 1e-9)) if "force" in name else np.full(len(apart), True)
        close = 1e-10 * max(1.0, np.abs(wanted).max()) + 100.0 * np.abs(other - wanted).max()
        np.testing.assert_allclose(found[kept], wanted[kept], rtol=0.0, atol=close)

"""Energy is constant in conservative models and balances the work of load and stiffness.

The energy follows from matrices and distances of `tests.independent`.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearlib
from gearlib import OneDegreePair, simulate
from tests.independent.systems import describe, system_of
from tests.properties.cases import CASE_STRATEGIES
from tests.properties.known_models import OSCILLATOR, UNDAMPED, gears_on_bearings
from tests.properties.test_properties import FEW_EXAMPLES

# At a contact ratio of 2 two tooth pairs are always in contact, so that the stiffness is constant.
CONSTANT_STIFFNESS_PAIR = UNDAMPED.replace(contact_ratio=2.0, backlash=12e-6)
NO_HARMONICS = gearlib.Harmonics()
SIX_DEGREE_PAIR = gears_on_bearings(1e9, bearing_damping_ratio=0.0, backlash=12e-6).replace(
    pair=CONSTANT_STIFFNESS_PAIR
)
PLANETS = {"structural_damping": 0.0, "material_damping": 0.0, "backlash_damping": 0.0}
PLANETS["backlash"] = 1e-6
NONLINEAR_STIFFNESS = {"quadratic_stiffness": 5e3, "cubic_stiffness": 2e9}
NO_DAMPING_OR_FORCING = {
    "damping": 0.0,
    "upper_damping": 0.0,
    "forcing": NO_HARMONICS,
    "deviation": NO_HARMONICS,
}
REDUCER = gearlib.split_power_reducer(CONSTANT_STIFFNESS_PAIR.replace(backlash=2e-6), internal=True)


def _remove_damping(train):
    """Return a train without damping in supports and shafts."""
    bodies = [replace(body, support_damping=0.0, torsional_damping=0.0) for body in train.bodies]
    shafts = [replace(shaft, damping=0.0, bending_damping=0.0) for shaft in train.shafts]
    return train.replace(bodies=bodies, shafts=shafts)


#: Undamped models of constant stiffness, each with an initial state, or with the standard deviation
#: of a random displacement from the state of rest. The motions touch both flanks.
CONSERVATIVE = {
    "gear pair": (CONSTANT_STIFFNESS_PAIR, (1.0, -6.0)),
    "powers": (OneDegreePair(pair=CONSTANT_STIFFNESS_PAIR, **NONLINEAR_STIFFNESS), (1.0, -6.0)),
    "oscillator": (OSCILLATOR.replace(**NO_DAMPING_OR_FORCING), (0.3, -3.0)),
    "six degrees": (SIX_DEGREE_PAIR, (5.0, 0.0)),
    "coast-side flank at rest": (SIX_DEGREE_PAIR.replace(moving_backlash=False), (5.0, 0.0)),
    "planets": (gearlib.planetary(**PLANETS), 3.0),
    "turning planets": (gearlib.planetary(**PLANETS, turning=True, gyroscopic=True), 3.0),
    "reducer": (_remove_damping(REDUCER), 3.0),
}


def energy(system, state):
    """Return the dimensionless energy of a state of a `System` of `tests.independent`.

    It is the sum of the kinetic energy, the elastic energy of supports and flanks, and the
    potential of the load.
    """
    n = system.n
    q, v = state[:n] * system.length, state[n:] * system.length * system.speed
    kinetic_energy, support_energy = 0.5 * (v @ system.mass @ v), 0.5 * (q @ system.stiffness @ q)
    total = kinetic_energy + support_energy - system.load @ q
    for contact in system.contacts:
        for side, sign in zip(contact["sides"], (1.0, -1.0), strict=True):
            compression = max(sign * system.distance(side, q, 0.0), 0.0)
            quadratic_stiffness, cubic_stiffness = contact["nonlinear_stiffness"]
            stiffness = system.level(contact, side, 0.0)
            total += (
                stiffness
                * compression**2
                * (
                    1 / 2
                    + quadratic_stiffness * compression / 3
                    + cubic_stiffness * compression**2 / 4
                )
            )
    return total / (system.force * system.length**2)


@pytest.mark.parametrize("name", CONSERVATIVE)
def test_energy_of_a_conservative_model_is_constant(name):
    """The energy must stay constant for twelve mesh periods, as nothing dissipates or drives."""
    model, initial_state = CONSERVATIVE[name]
    if isinstance(initial_state, float):
        rng, rest = np.random.default_rng(2), model.start_state("static")
        initial_state = tuple(rest + initial_state * rng.normal(size=rest.size))
    tuning, periods = 0.9, 12
    run = simulate(
        model, tuning, periods=periods, record_periods=periods, initial_state=initial_state
    )
    # The motion touches the drive side (1) and the coast side (-1).
    assert {-1, 1} <= set(run.event_to.values) and run.sizes["event"] > periods
    system, propagator = system_of(describe(model), tuning), model.propagator(tuning)
    state, energies = propagator.initial_state(initial_state), []
    for _ in range(periods + 1):
        energies.append(energy(system, state))
        state = propagator.maps(state, 1, 10**5)[0]
    # Each of some hundred events adds a rounding error of 1e-16 to 1e-15.
    energy_scale = max(1.0, np.abs(energies).max())
    np.testing.assert_allclose(energies, energies[0], rtol=0, atol=1e-12 * energy_scale)


@given(data=st.data())
@FEW_EXAMPLES
def test_power_balance_of_pairs_of_teeth_closes(data):
    """The work of load, damping and tooth force must equal the change of the kinetic energy.

    The tooth force is read from the dataset; the other terms follow from the equation of motion.
    """
    model, nu, state = data.draw(CASE_STRATEGIES["pairs of teeth"])
    sample_count = 16 * 1024
    run_options = {"periods": 1, "record_periods": 1, "samples_per_period": sample_count}
    run = simulate(model, nu, initial_state=state, **run_options)
    if int(run.status):
        return
    final_x, final_v = run.final_state.values
    x = np.append(run.displacement.values, final_x)
    v = np.append(run.velocity.values, final_v)
    damping_ratio = np.where(run.contact == 0, model.backlash_damping_ratio, model.damping_ratio)
    acceleration = (1.0 - run.dynamic_force.values) / nu**2 - 2.0 * damping_ratio * v[:-1] / nu
    power = acceleration * v[:-1]
    step = 2.0 * math.pi / sample_count
    # The error of the rectangle rule is at most one step times the largest power for each event,
    # for each of up to six switches of the stiffness, and for both ends.
    jump_count = run.sizes["event"] + 8
    tolerance = jump_count * step * (np.abs(power).max() + np.abs(v).max() * 1e-9)
    work, kinetic_energy_change = power.sum() * step, 0.5 * (v[-1] ** 2 - v[0] ** 2)
    assert abs(work - kinetic_energy_change) <= tolerance
    # The velocity must be the derivative of the displacement, up to the error of a difference.
    largest_acceleration = np.abs(run.acceleration.values).max() + 1.0
    assert np.abs(np.diff(x) / step - v[:-1]).max() < step * largest_acceleration

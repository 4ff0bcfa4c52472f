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
from tests.properties.cases import CASES
from tests.properties.known_models import OSCILLATOR, UNDAMPED, gears_on_bearings
from tests.properties.test_properties import FEW

CONSTANT, NO_WAVE = UNDAMPED.replace(contact_ratio=2.0, backlash=12e-6), gearlib.Harmonics()
SIX = gears_on_bearings(1e9, bearing_damping_ratio=0.0, backlash=12e-6).replace(pair=CONSTANT)
PLANETS = {"structural_damping": 0.0, "material_damping": 0.0, "backlash_damping": 0.0}
PLANETS["backlash"] = 1e-6
POWERS = {"quadratic_stiffness": 5e3, "cubic_stiffness": 2e9}
STILL = {"damping": 0.0, "upper_damping": 0.0, "forcing": NO_WAVE, "deviation": NO_WAVE}
REDUCER = gearlib.split_power_reducer(CONSTANT.replace(backlash=2e-6), internal=True)


def _undamped(train):
    """Return a train without damping in supports and shafts."""
    bodies = [replace(body, support_damping=0.0, torsional_damping=0.0) for body in train.bodies]
    shafts = [replace(shaft, damping=0.0, bending_damping=0.0) for shaft in train.shafts]
    return train.replace(bodies=bodies, shafts=shafts)


#: Undamped models of constant stiffness, with an initial state, or the size of a random
#: displacement
#: from rest, from which both flanks are touched.
CONSERVATIVE = {
    "gear pair": (CONSTANT, (1.0, -6.0)),
    "powers": (OneDegreePair(pair=CONSTANT, **POWERS), (1.0, -6.0)),
    "oscillator": (OSCILLATOR.replace(**STILL), (0.3, -3.0)),
    "six degrees": (SIX, (5.0, 0.0)),
    "coast-side flank at rest": (SIX.replace(moving_backlash=False), (5.0, 0.0)),
    "planets": (gearlib.planetary(**PLANETS), 3.0),
    "turning planets": (gearlib.planetary(**PLANETS, turning=True, gyroscopic=True), 3.0),
    "reducer": (_undamped(REDUCER), 3.0),
}


def energy(system, state):
    """Return the energy of a state, in units, by a `System` of `tests.independent`.

    It is the sum of kinetic energy, elastic energy of supports and flanks, and potential of the
    load.
    """
    n = system.n
    q, v = state[:n] * system.length, state[n:] * system.length * system.speed
    total = 0.5 * (v @ system.mass @ v + q @ system.stiffness @ q) - system.load @ q
    for contact in system.contacts:
        for side, sign in zip(contact["sides"], (1.0, -1.0), strict=True):
            compression = max(sign * system.distance(side, q, 0.0), 0.0)
            square, cube = contact["powers"]
            stiffness = system.level(contact, side, 0.0)
            total += (
                stiffness
                * compression**2
                * (1 / 2 + square * compression / 3 + cube * compression**2 / 4)
            )
    return total / (system.force * system.length**2)


@pytest.mark.parametrize("name", CONSERVATIVE)
def test_energy_of_a_conservative_model_is_constant(name):
    """The energy at the ends of twelve mesh periods must equal the initial energy."""
    model, start = CONSERVATIVE[name]
    if isinstance(start, float):
        # The initial state is a random displacement of this size from rest.
        rng, rest = np.random.default_rng(2), model.start_state("static")
        start = tuple(rest + start * rng.normal(size=rest.size))
    nu, system = 0.9, system_of(describe(model), 0.9)
    run = simulate(model, nu, periods=12, record_periods=12, initial_state=start)
    assert set(run.event_to.values) >= {-1, 1} and run.sizes["event"] > 12
    propagator = model.propagator(nu)
    state, energies = propagator.initial_state(start), []
    for _ in range(13):
        energies.append(energy(system, state))
        state = propagator.maps(state, 1, 10**5)[0]
    # Each of some hundred events costs the rounding of the energy.
    energy_scale = max(1.0, np.abs(energies).max())
    np.testing.assert_allclose(energies, energies[0], rtol=0, atol=1e-12 * energy_scale)


@given(data=st.data())
@FEW
def test_power_balance_of_pairs_of_teeth_closes(data):
    """The work of load, damping and tooth force must equal the change of the kinetic energy.

    The tooth force is taken from the dataset, all other terms are computed anew.
    """
    (model, nu, state), count = data.draw(CASES["pairs of teeth"]), 16 * 1024
    settings = {"periods": 1, "record_periods": 1, "samples_per_period": count}
    run = simulate(model, nu, initial_state=state, **settings)
    if int(run.status):
        return
    final_x, final_v = run.final_state.values
    x = np.append(run.displacement.values, final_x)
    v = np.append(run.velocity.values, final_v)
    ratio = np.where(run.contact == 0, model.backlash_damping_ratio, model.damping_ratio)
    power = ((1.0 - run.dynamic_force.values) / nu**2 - 2.0 * ratio * v[:-1] / nu) * v[:-1]
    step = 2.0 * math.pi / count
    # The rule of rectangles errs by one step of the largest power at each event, at each switch of
    # the stiffness and at both ends.
    jump_count = run.sizes["event"] + 8
    tolerance = jump_count * step * (np.abs(power).max() + np.abs(v).max() * 1e-9)
    assert abs(power.sum() * step - 0.5 * (v[-1] ** 2 - v[0] ** 2)) <= tolerance
    largest_acceleration = np.abs(run.acceleration.values).max() + 1.0
    assert np.abs(np.diff(x) / step - v[:-1]).max() < step * largest_acceleration

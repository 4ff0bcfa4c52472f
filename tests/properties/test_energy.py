"""Energy: constant in conservative models, and in balance where the stiffness changes.

The energy of a state of the library is written by the matrices and flanks of `tests.independent`.
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
from tests.properties.known_models import OSCILLATOR, UNDAMPED, gears
from tests.properties.test_properties import FEW

CONSTANT, NO_WAVE = UNDAMPED.replace(contact_ratio=2.0, backlash=12e-6), gearlib.Harmonics()
SIX = gears(1e9, share=0.0, backlash=12e-6).replace(pair=CONSTANT)
PLANETS = {"structural_damping": 0.0, "material_damping": 0.0, "backlash_damping": 0.0}
PLANETS["backlash"] = 1e-6
POWERS = {"quadratic_stiffness": 5e3, "cubic_stiffness": 2e9}
STILL = {"damping": 0.0, "upper_damping": 0.0, "forcing": NO_WAVE, "deviation": NO_WAVE}
REDUCER = gearlib.split_power_reducer(CONSTANT.replace(backlash=2e-6), internal=True)


def _undamped(train):
    bodies = [replace(body, support_damping=0.0, torsional_damping=0.0) for body in train.bodies]
    shafts = [replace(shaft, damping=0.0, bending_damping=0.0) for shaft in train.shafts]
    return train.replace(bodies=bodies, shafts=shafts)


#: Name -> model without damping and with constant stiffness; a state, or a distance from rest, from
#: which it meets all flanks.
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

    ``powers`` of a contact are the coefficients of quadratic and cubic elastic force.
    """
    n = system.n
    q, v = state[:n] * system.length, state[n:] * system.length * system.speed
    total = 0.5 * (v @ system.mass @ v + q @ system.stiffness @ q) - system.load @ q
    for contact in system.contacts:
        for side, sign in zip(contact["sides"], (1.0, -1.0), strict=True):
            pressed = max(sign * system.distance(side, q, 0.0), 0.0)
            square, cube = contact["powers"]
            c = system.level(contact, side, 0.0)
            total += c * pressed**2 * (1 / 2 + square * pressed / 3 + cube * pressed**2 / 4)
    return total / (system.force * system.length**2)


@pytest.mark.parametrize("name", CONSERVATIVE)
def test_energy_of_a_conservative_model_is_constant(name):
    model, start = CONSERVATIVE[name]
    if isinstance(start, float):
        # A random state at this distance from rest.
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
    # Some hundred events, each placed to rounding times the energies of the parts.
    size = max(1.0, np.abs(energies).max())
    np.testing.assert_allclose(energies, energies[0], rtol=0, atol=1e-12 * size)


@given(data=st.data())
@FEW
def test_power_balance_of_pairs_of_teeth_closes(data):
    """What the load and the changing stiffness put in, motion and damping take.

    The force between the flanks is that of the dataset; the rest is written anew.
    """
    (model, nu, state), count = data.draw(CASES["pairs of teeth"]), 16 * 1024
    span = {"periods": 1, "record_periods": 1, "samples_per_period": count}
    run = simulate(model, nu, initial_state=state, **span)
    if int(run.status):
        return
    x, v = (
        np.append(run[name].values, end)
        for name, end in zip(("displacement", "velocity"), run.final_state.values, strict=True)
    )
    ratio = np.where(run.contact == 0, model.backlash_damping_ratio, model.damping_ratio)
    power = ((1.0 - run.dynamic_force.values) / nu**2 - 2.0 * ratio * v[:-1] / nu) * v[:-1]
    step = 2.0 * math.pi / count
    # By the rule of rectangles: a step of the largest power at each event and each switch, and at
    # both ends.
    jumps = run.sizes["event"] + 8
    within = jumps * step * (np.abs(power).max() + np.abs(v).max() * 1e-9)
    assert abs(power.sum() * step - 0.5 * (v[-1] ** 2 - v[0] ** 2)) <= within
    fastest = np.abs(run.acceleration.values).max() + 1.0
    assert np.abs(np.diff(x) / step - v[:-1]).max() < step * fastest

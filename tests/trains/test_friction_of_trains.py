"""Friction opposes the sliding of flanks, in every mesh.

The sliding is that of `tests.trains.sliding`, from base circles and speeds.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.references.described_models import describe
from tests.references.reference_equations import machine_of
from tests.trains.random_trains import chain_with_everything, planetary_train
from tests.trains.sliding import past, sliding


def trains(rng):
    """Yield trains with friction of all kinds of meshes."""
    yield chain_with_everything(rng)
    carried = planetary_train(rng)
    meshes = [
        replace(
            mesh,
            friction=(0.05, 0.08),
            pitch_phase=rng.uniform(0.0, 6.0),
            backlash=10e-6,
            tooth_thickness=tuple(rng.uniform(0.35, 0.6, 2)),
            phase=rng.uniform(),
        )
        for mesh in carried.meshes
    ]
    yield carried.replace(meshes=meshes)


@pytest.mark.parametrize("seed", range(8))
def test_friction_of_the_reference_takes_power_out(seed):
    """What motions are compared with, against the plane kinematics of two base circles."""
    rng, seen = np.random.default_rng(seed), 0
    for train in trains(rng):
        machine = machine_of(describe(train), 0.9)
        for mesh, contact in zip(train.meshes, machine.contacts, strict=True):
            name = mesh.pinion
            x, y = machine.fixed(name)
            for tau in rng.uniform(0.0, 2.0 * math.pi * train.repeats, 30):
                for code, side in ((1, contact.drive), (-1, contact.coast)):
                    if not side:
                        continue
                    # Pressed by a distance of the sign of its code: force on the pinion, over C d.
                    push = -code * side.friction * contact.sense(machine.context, side, tau)
                    force = push * np.array([contact.across @ x, contact.across @ y])
                    away = past(train, mesh, tau)[1 if code > 0 else 0]
                    _, speed = sliding(train, mesh, code > 0, away)
                    # On the coast side the model keeps the line of action of the drive side.
                    mu = mesh.friction[0 if code > 0 else 1]
                    assert np.hypot(*force) == pytest.approx(mu, rel=1e-9)
                    least = 0.0 if code < 0 else 0.999 * mu * np.hypot(*speed)
                    assert force @ speed <= -least
                    seen += 1
    assert seen > 100

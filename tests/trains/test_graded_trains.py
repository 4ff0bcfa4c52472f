"""Trains whose stiffnesses and inertias lie twelve decades apart: modes, free motions, balance.

Natural frequencies are held against those of the same bodies in 60 digits, by the code of
`tests.independent`, with radii that are exact multiples of their tooth numbers.
"""

import math
import os
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import gearlib
from gearlib import Body, GearPair, GearTrain, Mesh, Shaft
from tests.independent.systems import describe, system_of
from tests.trains.random_trains import chain_train, planetary_train, reducer_train

KINDS = {"chain": chain_train, "planetary": planetary_train, "reducer": reducer_train}
SEEDS = range(int(os.environ.get("GRADED_TRAINS", "4")))


def graded_train(kind, seed):
    """Return a random train, every stiffness and inertia times a random power of ten."""
    rng = np.random.default_rng([seed, len(kind)])

    def scaled(value):
        return value * 10.0 ** rng.uniform(-6.0, 6.0)

    train = KINDS[kind](rng)
    bodies = [
        replace(
            body,
            inertia=scaled(body.inertia),
            mass=None if body.mass is None else scaled(body.mass),
            # The same along x and y, as a turning frame asks for.
            support_stiffness=scaled(body.support_stiffness[0]),
            support_damping=0.0,
            torsional_stiffness=scaled(body.torsional_stiffness),
            torsional_damping=0.0,
        )
        for body in train.bodies
    ]
    meshes = [replace(mesh, max_stiffness=scaled(mesh.max_stiffness)) for mesh in train.meshes]
    shafts = [
        Shaft(
            bodies=shaft.bodies,
            stiffness=scaled(shaft.stiffness),
            bending_stiffness=scaled(shaft.bending_stiffness),
        )
        for shaft in train.shafts
    ]
    return train.replace(bodies=bodies, meshes=meshes, shafts=shafts)


def exact(train):
    """Return the system of `tests.independent` in the digits of mpmath, its radii of one pitch."""
    description = describe(train)
    gears = [body for body in description["bodies"] if body["teeth"]]
    pitches = [body["base_radius"] / body["teeth"] for body in gears]
    # As far as meshes tell; what they do not is exact as it is.
    if np.ptp(pitches) < 1e-12 * pitches[0]:
        for body in gears:
            body["base_radius"] = body["teeth"] * mpf(pitches[0])
    return system_of(description, 1.0, mpmath.mp)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
def test_natural_frequencies_have_all_digits(kind, seed):
    train = graded_train(kind, seed)
    squares, shapes = train.linear_modes
    with mpmath.workdps(60):
        wanted = exact(train).modes()[0]
    free = train.free_motions.shape[1]
    assert free == 1 and abs(float(wanted[0])) < 1e-20 * float(wanted[1])
    # Springs and masses have 1e-16, which moves each of these by no more; and n roundings.
    np.testing.assert_allclose(squares, np.array(wanted[1:], float), rtol=1e-13)
    # Shares of the strain energy: those of a mode, and of a spring in all modes, are at most 1.
    np.testing.assert_allclose((train.strains**2).sum(axis=0), 1.0, rtol=1e-13)
    mass = train.structure.mass
    scale = 1.0 / np.sqrt(np.diagonal(mass))
    every = np.concatenate([train.free_motions, shapes], axis=1) / scale[:, None]
    np.testing.assert_allclose(
        every.T @ (scale[:, None] * mass * scale) @ every, np.eye(len(mass)), atol=1e-12
    )


@pytest.mark.parametrize("kind", KINDS)
def test_static_forces_have_all_digits(kind):
    train = graded_train(kind, 0)
    with mpmath.workdps(60):
        system = exact(train)
        whole = system.modes()[2]
        load = [mpf(float(value)) for value in train.structure.load]
        # One gear held: what its torque lacks to balance is rounding.
        held = system.names.index((train.reference_mesh.pinion, "u"))
        kept = [i for i in range(system.n) if i != held]
        inner = mpmath.matrix(whole[np.ix_(kept, kept)].tolist())
        q = system.zeros(system.n)
        q[kept] = list(mpmath.lu_solve(inner, mpmath.matrix([load[i] for i in kept])))
        forces = [
            mesh.mean_stiffness * (contact["sides"][0]["row"] @ q)
            for mesh, contact in zip(train.meshes, system.contacts, strict=True)
        ]
    largest = float(max(abs(force) for force in forces))
    own = float(abs(forces[train.mesh_names.index(train.reference)]))
    assert own > 1e-6 * largest
    assert train.load == pytest.approx(own, rel=1e-9)
    np.testing.assert_allclose(
        train.mean_forces * train.load, np.array(forces, float), rtol=0, atol=1e-9 * largest
    )


@pytest.mark.parametrize("kind", KINDS)
def test_free_rotations_are_those_of_the_tooth_numbers(kind):
    """Without rounding that springs could see, and so is what balances on them."""
    for seed in range(12):
        train = graded_train(kind, seed)
        (motion,) = train.free_motions.T
        coordinates = train.structure.coordinates
        turns = {
            name: motion[coordinates.index((name, "u"))] / body.base_radius
            for name, body in train.by_name.items()
            if (name, "u") in coordinates
        }
        if kind != "planetary":
            speeds = train.speeds
            first = train.reference_pinion.name
            for name, turn in turns.items():
                assert turn == pytest.approx(
                    turns[first] * float(speeds[name] / speeds[first]), rel=1e-14
                )
        rows = np.concatenate([train.structure.springs[0], train.structure.lines])
        there = np.append(train.structure.springs[1], np.ones(len(train.meshes))) > 0.0
        assert np.all(
            np.abs(rows @ motion)[there] <= 1e-15 * (np.abs(rows) @ np.abs(motion))[there]
        )
        # The torque of the first body, which drives, out of balance by a millionth.
        driving = next(body for body in train.bodies if body.torque)
        for more, allowed in ((1e-12, True), (1e-6, False), (-1e-6, False)):
            other = replace(driving, torque=driving.torque * (1.0 + more))
            bodies = [other if body is driving else body for body in train.bodies]
            if allowed:
                train.replace(bodies=bodies)
            else:
                with pytest.raises(ValueError, match="must balance"):
                    train.replace(bodies=bodies)


def test_the_reducer_of_a_pair_without_dimensions():
    """Its shafts are a million times as stiff as its meshes."""
    pair = GearPair.from_ratios(
        contact_ratio=1.569, stiffness_ratio=0.5879, damping=0.0617, backlash=4
    )
    train = gearlib.split_power_reducer(pair)
    assert train.static_deflection == pytest.approx(pair.load / pair.mean_stiffness, rel=1e-12)
    assert train.structure.lines @ train.free_motions == pytest.approx(0.0, abs=1e-15)


def pairs(**shaft):
    """Return two pairs of gears, each balanced, on bodies that may have more freedom."""
    gears = [
        Body(name=name, teeth=20, base_radius=0.1, inertia=0.02, torque=torque, **more)
        for name, torque, more in (
            ("a", 3.0, {}),
            ("b", 3.0, {}),
            ("c", 5.0, {}),
            ("d", 5.0, {"mass": 2.0, "support_stiffness": (0.0, 1e6)}),
        )
    ]
    meshes = [
        Mesh(
            pinion=pinion,
            wheel=wheel,
            max_stiffness=4e8,
            stiffness_ratio=0.6,
            contact_ratio=1.5,
            # The line of action is that of y, but for the rounding of the angle.
            line_of_action=math.pi / 2.0,
            phase=0.0,
        )
        for pinion, wheel in ("ab", "cd")
    ]
    return GearTrain(bodies=gears, meshes=meshes, shafts=[Shaft(bodies=("a", "c"), **shaft)])


def test_free_motions_other_than_the_rotation():
    # Nothing holds d along x; a shaft of nothing leaves two rotations.
    assert pairs(stiffness=1e5).free_motions.shape[1] == 2
    loose = pairs(stiffness=1e-200)
    assert loose.free_motions.shape[1] == 3
    np.testing.assert_array_less(np.abs(loose.structure.lines @ loose.free_motions), 1e-15)

"""Modes and statics of trains whose stiffnesses and inertias span twelve decades.

Reference values are computed in 60 digits by `tests.independent`, with base radii that are exact
multiples of the tooth numbers.
"""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from gearlib import Shaft
from tests.independent.systems import describe, system_of
from tests.trains.random_trains import chain_train, planetary_train, reducer_train

TRAIN_MAKERS = {"chain": chain_train, "planetary": planetary_train, "reducer": reducer_train}


def graded_train(kind, seed):
    """Return a random train whose stiffness and inertia values span twelve decades."""
    rng = np.random.default_rng([seed, len(kind)])

    def scaled(value):
        """Return a value multiplied by a random power of ten between -6 and 6."""
        return value * 10.0 ** rng.uniform(-6.0, 6.0)

    train = TRAIN_MAKERS[kind](rng)
    bodies = [
        replace(
            body,
            inertia=scaled(body.inertia),
            mass=None if body.mass is None else scaled(body.mass),
            # A turning frame requires equal stiffness along x and y.
            support_stiffness=scaled(body.support_stiffness[0]),
            support_damping=0.0,
            torsional_stiffness=scaled(body.torsional_stiffness),
            torsional_damping=0.0,
        )
        for body in train.bodies
    ]
    meshes = [replace(mesh, max_stiffness=scaled(mesh.max_stiffness)) for mesh in train.meshes]
    names = ("stiffness", "bending_stiffness")
    shafts = [
        Shaft(bodies=shaft.bodies, **{name: scaled(getattr(shaft, name)) for name in names})
        for shaft in train.shafts
    ]
    return train.replace(bodies=bodies, meshes=meshes, shafts=shafts)


def precise_system(train):
    """Return the system of `tests.independent` in the present precision of mpmath.

    Base radii of gears with pitches that are equal up to rounding become exact multiples of a
    pitch.
    """
    description = describe(train)
    gears = [body for body in description["bodies"] if body["teeth"]]
    pitches = [body["base_radius"] / body["teeth"] for body in gears]
    if np.ptp(pitches) < 1e-12 * pitches[0]:
        for body in gears:
            body["base_radius"] = body["teeth"] * mpf(pitches[0])
    return system_of(description, 1.0, mpmath.mp)


def assert_static_forces(train, system, stiffness):
    """Assert that mean forces of a train match a linear system with its mean stiffness."""
    torques = [mpf(float(value)) for value in train.structure.load]
    # The torques are in balance up to rounding, so that one gear can be fixed.
    fixed = system.names.index((train.reference_mesh.pinion, "u"))
    free = [i for i in range(system.n) if i != fixed]
    matrix = mpmath.matrix(stiffness[np.ix_(free, free)].tolist())
    q = system.zeros(system.n)
    q[free] = list(mpmath.lu_solve(matrix, mpmath.matrix([torques[i] for i in free])))
    forces = [
        float(mesh.mean_stiffness * (contact["sides"][0]["row"] @ q))
        for mesh, contact in zip(train.meshes, system.contacts, strict=True)
    ]
    largest, reference = np.abs(forces).max(), abs(forces[train.mesh_names.index(train.reference)])
    assert reference > 1e-6 * largest
    assert train.load == pytest.approx(reference, rel=1e-9)
    np.testing.assert_allclose(train.mean_forces * train.load, forces, rtol=0, atol=1e-9 * largest)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", TRAIN_MAKERS)
def test_modes_and_static_forces_agree_with_60_digits_to_rounding(kind, seed):
    """Compare frequencies, strain energies and shapes of graded trains with 60 digits."""
    train = graded_train(kind, seed)
    squared_frequencies, mode_shapes = train.linear_modes
    with mpmath.workdps(60):
        system = precise_system(train)
        reference_squares, reference_shapes, stiffness = system.modes()
        mesh_rows = np.array([contact["sides"][0]["row"] for contact in system.contacts])
        squared_strains = (mesh_rows @ reference_shapes) ** 2 / np.where(
            reference_squares == 0, 1, reference_squares
        )
        if seed == 0:
            assert_static_forces(train, system, stiffness)
    free_motion_count = train.free_motions.shape[1]
    assert free_motion_count == 1 and abs(float(reference_squares[0])) < 1e-20 * float(
        reference_squares[1]
    )
    # Each spring and mass is rounded by 1e-16, which changes a squared frequency by at most that.
    np.testing.assert_allclose(
        squared_frequencies, np.array(reference_squares[1:], float), rtol=1e-13
    )
    # Squared strains are fractions of the strain energy of a mode, whose sum is 1.
    np.testing.assert_allclose((train.strains**2).sum(axis=0), 1.0, rtol=1e-13)
    energy = np.array(squared_strains.T, float) * [mesh.mean_stiffness for mesh in train.meshes]
    np.testing.assert_allclose(train.modes().strain_energy[1:], energy[1:], rtol=0, atol=1e-9)
    mass = train.structure.mass
    scale = 1.0 / np.sqrt(np.diagonal(mass))
    motions = np.concatenate([train.free_motions, mode_shapes], axis=1) / scale[:, None]
    product = motions.T @ (scale[:, None] * mass * scale) @ motions
    np.testing.assert_allclose(product, np.eye(len(mass)), atol=1e-12)

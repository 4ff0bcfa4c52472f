"""Inertia forces of the rotating bodies during a run-up, as accelerations of the coordinates.

The loads of the model stay constant, and the driver supplies the additional torque of the
acceleration. To accelerate the rigid-body rotation s of a train, in metres per radian of reference
mesh phase, the forces M s are needed, with the mass matrix M. The driver acts with the force X e
along its rotation e. The condition s . (X e - M s) = 0 determines X, and the coordinates relative
to the rigid-body rotation are accelerated by q'' = M^-1 X e - s. A model of one degree of freedom
knows only its reduced mass: in addition to its load, its mesh carries J_2 / r_b2^2 times the
acceleration along the line of action.
"""

from typing import Any

import numpy as np

from gearlib import checks

#: Smaller fractions of a force or a motion count as rounding errors.
_ROUNDING = 1e-9


def pair_acceleration(pair: Any, driven_mass: float, base_radius: float) -> np.ndarray:
    """Return the acceleration that a run-up adds to the displacement of a gear pair, shape (1,).

    While the speed rises, the mesh must also accelerate the driven gear. `pair` is a `GearPair`;
    `driven_mass` is J / r_b^2 in kg, the driven gear's moment of inertia over its squared base
    radius; `base_radius`, in m, belongs to the reference gear, which has `pair.teeth` teeth. The
    result is in static deflections and dimensionless time theta (natural frequency times time), for
    d2tau/dtheta2 = 1 with the mesh phase tau.
    """
    # The gear rotates by tau / teeth, and theta is the eigenfrequency times the time. This is the
    # inertia force in N at d2tau/dtheta2 = 1.
    force = driven_mass * base_radius * pair.mean_eigenfrequency**2 / pair.teeth
    return np.array([force / pair.load])


def train_accelerations(train: Any, driver: str | None = None) -> np.ndarray:
    """Return the accelerations that a run-up adds to the n coordinates of a `GearTrain`, (n,).

    They are in static deflections and dimensionless time theta (natural frequency times time), for
    d2tau/dtheta2 = 1 with the mesh phase tau. `driver` names the body that accelerates the train,
    by default the body with the largest input power. Raises ValueError if the driver cannot
    accelerate all bodies.
    """
    names, structure = list(train.by_name), train.structure
    free_motions, mass = train.free_motions, structure.mass  # columns: rigid-body motions, (n, k)
    if driver is not None:
        checks.check_choice("driver", driver, names)
    motion, speeds = rigid_motion(train, names)
    force = -mass @ motion
    if free_motions.size:
        # The row vector (n,) that maps coordinates to the driver's rotation. It has the index 2,
        # after the motions of the body in x and y.
        rotation = structure.motions[names.index(driver or default_driver(train, speeds)), 2]
        driver_motion = rotation @ motion
        rotates = abs(driver_motion) > _ROUNDING * np.abs(motion).max()
        checks.require(rotates, "driver", driver, "a body that turns")
        # The driver's torque is such that all forces together do no work in the rigid motion.
        force = force - rotation * (motion @ force / driver_motion)
        # With several rigid-body motions, one driver may leave some of them unbalanced.
        unbalanced_forces = np.abs(free_motions.T @ force)
        force_scale = (np.abs(free_motions.T) @ np.abs(mass @ motion)).max()
        if (unbalanced_forces > _ROUNDING * force_scale).any():
            raise ValueError("bodies is not allowed: in a run-up one driver must turn all of them")
    return np.linalg.solve(mass, force) / train.static_deflection


def default_driver(train: Any, speeds: list[float]) -> str:
    """Return the name of the body that drives a `GearTrain`: the one with the largest input power.

    The input power of a body is its torque times its speed. `speeds` are the speeds of all bodies
    in the order of `train.bodies`, in any unit. If no power is positive, return the pinion of the
    reference mesh, the mesh whose frequency defines the mesh phase.
    """
    powers = [body.torque * speed for body, speed in zip(train.bodies, speeds, strict=True)]
    if max(powers) > 0.0:
        return train.bodies[int(np.argmax(powers))].name
    return train.reference_pinion.name


def rigid_motion(train: Any, names: list[str]) -> tuple[np.ndarray, list[float]]:
    """Return (motion, speeds) of a `GearTrain` that rotates as a rigid body, without deflections.

    `motion`, shape (n,), holds the coordinates of the train in m, and `speeds` is a list of the
    rotations of the b bodies in rad, both per radian of phase of the reference mesh. `names` are
    the names of all bodies, in the order of `train.bodies`.
    """
    motions = train.structure.motions  # row vectors of x, y and rotation of each body, (b, 3, n)
    free_motions = train.free_motions  # rigid-body motions in columns, (n, k)
    speeds = [float(train.speeds.in_housing[name]) for name in names]
    body_motions = np.zeros((len(names), 3))  # x, y and arc length on the base circle
    for body_motion, speed, body in zip(body_motions, speeds, train.bodies, strict=True):
        body_motion[2] = speed * body.base_radius
        if body.carrier:
            # The axis of a planet moves on a circle with the pins of its carrier.
            pin_speed = speeds[names.index(body.carrier)] * train.by_name[body.carrier].base_radius
            body_motion[:2] = -np.sin(body.angle) * pin_speed, np.cos(body.angle) * pin_speed
    pinion_index = names.index(train.reference_pinion.name)
    if free_motions.shape[1] == 1:
        pinion_rotation = motions[pinion_index, 2] @ free_motions[:, 0]
        if abs(pinion_rotation) > _ROUNDING * np.abs(free_motions).max():
            # The only rigid-body motion is scaled to the speed of the pinion. In this motion,
            # bodies on torsional supports stand still, although `body_motions` has a speed from
            # their tooth numbers.
            return free_motions[:, 0] * (body_motions[pinion_index, 2] / pinion_rotation), speeds
    # Otherwise the combination of rigid-body motions closest to `body_motions` is taken or, if
    # there are no such motions, the closest vector of coordinates.
    basis = free_motions if free_motions.size else np.eye(motions.shape[2])
    motions_of_basis = motions.reshape(-1, len(basis)) @ basis  # (3 b, number of basis vectors)
    amplitudes = np.linalg.lstsq(motions_of_basis, body_motions.ravel(), rcond=None)[0]
    return basis @ amplitudes, speeds

"""Inertia forces of the rotating bodies during a run-up, as accelerations of the coordinates.

The loads of the model stay constant, and the driver supplies the additional torque of the
acceleration. The rigid rotation s of a train, in metres per radian of reference mesh phase, needs
the forces M s. The driver acts along its rotation e with the force X e. The condition
s . (X e - M s) = 0 keeps the whole train at its speed, and the coordinates relative to the rigid
rotation are accelerated by q'' = M^-1 X e - s. A model of one degree of freedom knows only its
reduced mass: its mesh carries J_2 / r_b2^2 times the acceleration along the line of action in
addition to its load.
"""

from typing import Any

import numpy as np

from gearlib import checks

#: Smaller fractions of a force or a motion are rounding errors.
_ROUNDING = 1e-9


def pair_acceleration(pair: Any, driven_mass: float, base_radius: float) -> np.ndarray:
    """Return the acceleration that a run-up adds to the displacement of a `GearPair`, shape (1,).

    It is dimensionless, per unit of d2tau/dtheta2, the second derivative of the mesh phase tau by
    the dimensionless time theta. `driven_mass` is J_2 / r_b2^2 of the driven gear in kg,
    `base_radius` the base radius of the reference gear in m.
    """
    # The inertia force in N at d2tau/dtheta2 = 1.
    force = driven_mass * base_radius * pair.mean_eigenfrequency**2 / pair.teeth
    return np.array([force / pair.load])


def train_accelerations(train: Any, driver: str | None = None) -> np.ndarray:
    """Return the accelerations that a run-up adds to the n coordinates of a `GearTrain`, (n,).

    They are dimensionless, per unit of d2tau/dtheta2, the second derivative of the mesh phase tau
    by the dimensionless time theta. `driver` names the body that accelerates the train, by default
    the body with the largest input power. Raises ValueError if the driver cannot accelerate all
    bodies.
    """
    names, structure, free = list(train.by_name), train.structure, train.free_motions
    mass = structure.mass
    if driver is not None:
        checks.one_of("driver", driver, names)
    rigid_motion, speeds = _rigid_motion(train, names)
    force = -mass @ rigid_motion
    if free.size:
        powers = [body.torque * speed for body, speed in zip(train.bodies, speeds, strict=True)]
        strongest = names[int(np.argmax(powers))]
        default_driver = strongest if max(powers) > 0.0 else train.reference_pinion.name
        # The row vector (n,) of the rotation, the third motion of a body after x and y.
        rotation = structure.motions[names.index(driver or default_driver), 2]
        driver_motion = rotation @ rigid_motion
        rotates = abs(driver_motion) > _ROUNDING * np.abs(rigid_motion).max()
        checks.require(rotates, "driver", driver, "a body that turns")
        # The driver's force makes the power of all forces on the rigid motion zero.
        force = force - rotation * (rigid_motion @ force / driver_motion)
        unbalanced_forces = np.abs(free.T @ force)
        force_scale = (np.abs(free.T) @ np.abs(mass @ rigid_motion)).max()
        if (unbalanced_forces > _ROUNDING * force_scale).any():
            raise ValueError("bodies is not allowed: in a run-up one driver must turn all of them")
    return np.linalg.solve(mass, force) / train.static_deflection


def _rigid_motion(train: Any, names: list[str]) -> tuple[np.ndarray, list[float]]:
    """Return the rigid rotation of a `GearTrain`, n coordinates in m, and the speeds of its bodies.

    Both are per radian of reference mesh phase. `names` are those of all b bodies in order.
    """
    # Row vectors of x, y and rotation of each body, (b, 3, n), and k free motions, (n, k).
    motions, free = train.structure.motions, train.free_motions
    pinion = train.reference_pinion.name
    speeds = [float(train.speeds.in_housing[name]) for name in names]
    body_motions = np.zeros((len(names), 3))  # x, y and arc length on the base circle
    for body_motion, speed, body in zip(body_motions, speeds, train.bodies, strict=True):
        body_motion[2] = speed * body.base_radius
        if body.carrier:
            pin_speed = speeds[names.index(body.carrier)] * train.by_name[body.carrier].base_radius
            body_motion[:2] = -np.sin(body.angle) * pin_speed, np.cos(body.angle) * pin_speed
    pinion_index = names.index(pinion)
    if free.shape[1] == 1:
        pinion_rotation = motions[pinion_index, 2] @ free[:, 0]
        if abs(pinion_rotation) > _ROUNDING * np.abs(free).max():
            # The only free motion, scaled to the speed of the pinion. In it, bodies on torsional
            # supports stand still, although `body_motions` has a speed from their tooth numbers.
            return free[:, 0] * (body_motions[pinion_index, 2] / pinion_rotation), speeds
    basis = free if free.size else np.eye(motions.shape[2])
    motions_of_basis = motions.reshape(-1, len(basis)) @ basis  # (3 b, number of basis vectors)
    amplitudes = np.linalg.lstsq(motions_of_basis, body_motions.ravel(), rcond=None)[0]
    return basis @ amplitudes, speeds

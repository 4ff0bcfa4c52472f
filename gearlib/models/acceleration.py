"""Inertia forces of the rotating bodies during a run-up, as accelerations of the coordinates.

The external loads stay constant, and the driver supplies the torque that accelerates the train. Let
s be the rigid-body rotation in metres per radian of reference mesh phase, M the mass matrix, and X
the force of the driver along its rotation e. The driver must do the work of the inertia forces,
s . (X e - M s) = 0, which determines X. The coordinates relative to the rigid-body rotation are
then accelerated by q'' = M^-1 X e - s. A model with one degree of freedom has only a reduced mass:
its mesh carries, in addition to its load, J_2 / r_b2^2 times the acceleration along the line of
action.
"""

from typing import Any

import numpy as np

from gearlib import checks
from gearlib.models.trains.structure import AXES

#: Relative tolerance below which forces and motions are treated as zero.
_RELATIVE_TOLERANCE = 1e-9


def pair_acceleration(pair: Any, driven_mass: float, base_radius: float) -> np.ndarray:
    """Return the inertial acceleration of a gear pair in a run-up, an array of shape (1,).

    During a run-up the mesh must also accelerate the driven gear. `pair` is a `GearPair`;
    `driven_mass`, in kg, is the moment of inertia of the driven gear divided by its squared base
    radius; `base_radius`, in m, is the base radius of the reference gear, which has `pair.teeth`
    teeth. With the mesh phase tau and the dimensionless time theta (natural frequency times time),
    the result is the acceleration d2x/dtheta2 for d2tau/dtheta2 = 1, in units of the static
    deflection.
    """
    # The reference gear rotates by tau / teeth. This is the inertia force in N at
    # d2tau/dtheta2 = 1.
    inertia_force = driven_mass * base_radius * pair.mean_eigenfrequency**2 / pair.teeth
    return np.array([inertia_force / pair.load])


def train_accelerations(train: Any, driver: str | None = None) -> np.ndarray:
    """Return the inertial accelerations of a `GearTrain` in a run-up, shape (n,).

    With the mesh phase tau and the dimensionless time theta (natural frequency times time), they
    are the accelerations d2q/dtheta2 of the n coordinates for d2tau/dtheta2 = 1, in units of the
    static deflection. `driver` is the name of the body that accelerates the train; the default is
    the body with the largest input power. Raises ValueError if the driver cannot accelerate all
    bodies.
    """
    names, structure = list(train.by_name), train.structure
    rigid_body_modes, mass = train.free_motions, structure.mass  # modes in columns, (n, k)
    if driver is not None:
        checks.check_choice("driver", driver, names)
    motion, speeds = rigid_motion(train, names)
    force = -mass @ motion
    if rigid_body_modes.size:
        driver_index = names.index(driver or default_driver(train, speeds))
        # This row vector, shape (n,), maps the coordinates to the rotation of the driver.
        rotation = structure.motions[driver_index, AXES.index("rotation")]
        driver_motion = rotation @ motion
        rotates = abs(driver_motion) > _RELATIVE_TOLERANCE * np.abs(motion).max()
        checks.require(rotates, "driver", driver, "a body that rotates")
        # The driver's torque makes the total work on the rigid-body motion zero.
        force = force - rotation * (motion @ force / driver_motion)
        # If there are several rigid-body modes, a single driver may not balance all of them.
        unbalanced_forces = np.abs(rigid_body_modes.T @ force)
        force_scale = (np.abs(rigid_body_modes.T) @ np.abs(mass @ motion)).max()
        if (unbalanced_forces > _RELATIVE_TOLERANCE * force_scale).any():
            raise ValueError(
                "a run-up is not allowed for these bodies: one driver must accelerate all of them"
            )
    return np.linalg.solve(mass, force) / train.static_deflection


def default_driver(train: Any, speeds: list[float]) -> str:
    """Return the name of the body of a `GearTrain` with the largest input power.

    The input power of a body is its torque times its speed. `speeds` are the speeds of all bodies
    in the order of `train.bodies`, in any unit. If no body has a positive input power, the pinion
    of the reference mesh is the driver.
    """
    powers = [body.torque * speed for body, speed in zip(train.bodies, speeds, strict=True)]
    if max(powers) > 0.0:
        return train.bodies[int(np.argmax(powers))].name
    return train.reference_pinion.name


def rigid_motion(train: Any, names: list[str]) -> tuple[np.ndarray, list[float]]:
    """Return (motion, speeds) of a `GearTrain` that rotates without elastic deflections.

    `motion`, shape (n,), is the change of the n coordinates in m, and `speeds` is a list of the
    rotations of the b bodies in rad, both per radian of phase of the reference mesh. `names` are
    the names of all bodies in the order of `train.bodies`.
    """
    motions = train.structure.motions  # row vectors of x, y and rotation of each body, (b, 3, n)
    rigid_body_modes = train.free_motions  # modes in columns, (n, k)
    speeds = [float(train.speeds.in_housing[name]) for name in names]
    body_motions = np.zeros((len(names), 3))  # x, y and the arc length on the base circle
    for body_motion, speed, body in zip(body_motions, speeds, train.bodies, strict=True):
        body_motion[2] = speed * body.base_radius
        if body.carrier:
            # The axis of a planet moves with its pin on a circle about the axis of the carrier.
            pin_speed = speeds[names.index(body.carrier)] * train.by_name[body.carrier].base_radius
            body_motion[:2] = -np.sin(body.angle) * pin_speed, np.cos(body.angle) * pin_speed
    pinion_index = names.index(train.reference_pinion.name)
    if rigid_body_modes.shape[1] == 1:
        mode = rigid_body_modes[:, 0]
        pinion_rotation = motions[pinion_index, 2] @ mode
        if abs(pinion_rotation) > _RELATIVE_TOLERANCE * np.abs(rigid_body_modes).max():
            # Scale the only rigid-body mode to the speed of the pinion. In this mode, bodies on
            # torsional supports stand still, although their tooth numbers give them a speed in
            # `body_motions`.
            return mode * (body_motions[pinion_index, 2] / pinion_rotation), speeds
    # Otherwise fit a combination of the rigid-body modes or, if there are none, of the unit
    # vectors to `body_motions`.
    basis = rigid_body_modes if rigid_body_modes.size else np.eye(motions.shape[2])
    basis_motions = motions.reshape(-1, len(basis)) @ basis  # (3 b, number of basis vectors)
    amplitudes = np.linalg.lstsq(basis_motions, body_motions.ravel(), rcond=None)[0]
    return basis @ amplitudes, speeds

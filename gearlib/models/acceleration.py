"""Accelerations of the coordinates by the acceleration of a run-up: the inertia of all that turns.

The loads of the model stay as they are, and the driver also brings the torque of the acceleration.
Of a train the rigid rotation s, in metres for a radian of reference mesh phase, takes the forces
M s; the driver, by its rotation e, brings X e with s . (X e - M s) = 0, so that the train as a
whole keeps to its speed, and q'' = M^-1 X e - s is left. One degree of freedom knows no inertia but
its reduced mass: there the mesh carries J_2 / r_b2^2 times the acceleration along the line of
action beside its load.
"""

import numpy as np

from gearlib import checks

#: Share of a force or a motion that is rounding.
_ROUNDING = 1e-9


def of_mesh(pair, driven_mass, base_radius):
    """Return the acceleration of the displacement for a unit of d2tau/dtheta2, shape (1,).

    `driven_mass` is J_2 / r_b2^2, kg; `base_radius`, m, is that of the gear whose teeth count.
    """
    force = driven_mass * base_radius * pair.mean_eigenfrequency**2 / pair.teeth
    return np.array([force / pair.load])


def of_train(train, driver=None, mass=None):
    """Return the accelerations of the coordinates for a unit of d2tau/dtheta2, shape (n,).

    `driver` names the body that brings the torque, by default that which brings most of the power;
    `mass` is by default the mass matrix of the train. ValueError if there is no such body, it does
    not turn, or the train turns in parts that no single body can drive.
    """
    names, structure, free = list(train.by_name), train.structure, train.free_motions
    mass = structure.mass if mass is None else mass
    if driver is not None:
        checks.one_of("driver", driver, names)
    rigid_motion, speeds = _rigid_motion(train, names)
    force = -mass @ rigid_motion
    if free.size:
        powers = [body.torque * speed for body, speed in zip(train.bodies, speeds, strict=True)]
        strongest = names[int(np.argmax(powers))]
        by_default = strongest if max(powers) > 0.0 else train.reference_pinion.name
        rotation = structure.motions[names.index(driver or by_default), 2]
        lever = rotation @ rigid_motion
        turns = abs(lever) > _ROUNDING * np.abs(rigid_motion).max()
        checks.require(turns, "driver", driver, "a body that turns")
        force = force - rotation * (rigid_motion @ force / lever)
        unbalanced = np.abs(free.T @ force)
        largest = (np.abs(free.T) @ np.abs(mass @ rigid_motion)).max()
        if (unbalanced > _ROUNDING * largest).any():
            raise ValueError("bodies is not allowed: in a run-up one driver must turn all of them")
    return np.linalg.solve(mass, force) / train.static_deflection


def _rigid_motion(train, names):
    """Return (rigid rotation by reference mesh phase, m, signed speeds of the bodies)."""
    motions, free, pinion = train.structure.motions, train.free_motions, train.reference_pinion.name
    frame = train.carrier_ratio * train.speeds[pinion]
    speeds = [float(train.speeds[name] + frame) for name in names]
    body_motions = np.zeros((len(names), 3))
    for row, speed, body in zip(body_motions, speeds, train.bodies, strict=True):
        row[2] = speed * body.base_radius
        if body.carrier:
            pins = speeds[names.index(body.carrier)] * train.by_name[body.carrier].base_radius
            row[:2] = -np.sin(body.angle) * pins, np.cos(body.angle) * pins
    i = names.index(pinion)
    if free.shape[1] == 1:
        pinion_rotation = motions[i, 2] @ free[:, 0]
        if abs(pinion_rotation) > _ROUNDING * np.abs(free).max():
            # Bodies that the supports hold do not turn, whatever speed the teeth give them.
            return free[:, 0] * (body_motions[i, 2] / pinion_rotation), speeds
    basis = free if free.size else np.eye(motions.shape[2])
    rows = motions.reshape(-1, len(basis)) @ basis
    return basis @ np.linalg.lstsq(rows, body_motions.ravel(), rcond=None)[0], speeds

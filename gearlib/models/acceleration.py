"""What the acceleration of a run-up asks of its meshes: the inertia of all that turns.

The loads of the model stay as they are, and the driver brings what the acceleration takes besides.
Of a train the rigid rotation s, in metres for a radian of reference mesh phase, takes M s; the
driver, by its rotation e, brings X e with s . (X e - M s) = 0, so that the train as a whole keeps
to its speed, and q'' = M^-1 X e - s is what is left. One degree of freedom knows no inertia but
its reduced mass: there the mesh carries J_2 / r_b2^2 times the acceleration along the line of
action beside its load.
"""

import numpy as np

from gearlib import checks

#: Share of a force that is rounding.
_NOTHING = 1e-9


def of_mesh(pair, driven_mass, base_radius):
    """Return the acceleration of the displacement for a unit of d2tau/dtheta2, shape (1,).

    Parameters
    ----------
    pair : GearPair
    driven_mass, base_radius : float
        J_2 / r_b2^2 of what the mesh drives, kg; base radius of the gear whose teeth count, m.
    """
    pull = driven_mass * base_radius * pair.mean_eigenfrequency**2 / pair.teeth
    return np.array([pull / pair.load])


def of_train(train, driver=None, mass=None):
    """Return the accelerations of the coordinates for a unit of d2tau/dtheta2, shape (n,).

    Parameters
    ----------
    train : GearTrain
    driver : str, optional
        Name of the body that brings the torque; by default that which brings most of the power.
    mass : ndarray, shape (n, n), optional
        The mass matrix, by default that of the train.

    Raises
    ------
    ValueError
        If there is no such body, it does not turn, or the train turns in parts that no one body
        can drive.
    """
    names, parts, free = list(train.by_name), train.structure, train.free_motions
    mass = parts.mass if mass is None else mass
    if driver is not None:
        checks.one_of("driver", driver, names)
    motion, turns = _turning(train, names)
    force = -mass @ motion
    if free.size:
        powers = [body.torque * turn for body, turn in zip(train.bodies, turns, strict=True)]
        best = names[int(np.argmax(powers))] if max(powers) > 0.0 else train.reference_pinion.name
        push = parts.motions[names.index(driver or best), 2]
        way = push @ motion
        if not abs(way) > _NOTHING * np.abs(motion).max():
            raise ValueError(f"driver = {driver!r} is not allowed: it must be a body that turns")
        force = force - push * (motion @ force / way)
        left, most = np.abs(free.T @ force), np.abs(free.T) @ np.abs(mass @ motion)
        if (left > _NOTHING * most.max()).any():
            raise ValueError("bodies is not allowed: in a run-up one driver must turn all of them")
    return np.linalg.solve(mass, force) / train.static_deflection


def _turning(train, names):
    """Return (rigid rotation by reference mesh phase, m, speeds of the bodies, signed)."""
    parts, free = train.structure, train.free_motions
    pinion = train.reference_pinion.name
    frame = train.carrier_ratio * train.speeds[pinion]
    turns = [float(train.speeds[name] + frame) for name in names]
    wanted = np.zeros((len(names), 3))
    for row, turn, body in zip(wanted, turns, train.bodies, strict=True):
        row[2] = turn * body.base_radius
        if body.carrier:
            way = turns[names.index(body.carrier)] * train.by_name[body.carrier].base_radius
            row[:2] = -np.sin(body.angle) * way, np.cos(body.angle) * way
    i, own = names.index(pinion), parts.motions
    if free.shape[1] == 1 and abs(own[i, 2] @ free[:, 0]) > _NOTHING * np.abs(free).max():
        # What the supports hold does not turn, whatever the teeth make of its speed.
        return free[:, 0] * (wanted[i, 2] / (own[i, 2] @ free[:, 0])), turns
    basis = free if free.size else np.eye(parts.mass.shape[0])
    found = np.linalg.lstsq(own.reshape(-1, len(basis)) @ basis, wanted.ravel(), rcond=None)[0]
    return basis @ found, turns

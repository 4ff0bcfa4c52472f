"""Derivatives of motions, orbits and folds by differences of `reference_motion.move`.

Of a step of 1e-16 in 34 digits one difference keeps 16, so that one side suffices: of the limits of
the contact ratio, or of no backlash, there is only one. Orbits and folds are solved for on both
sides, in 50 digits.
"""

import mpmath
import numpy as np
from mpmath import mp, mpf

from tests.references.described_models import moved, places, size_of
from tests.references.reference_equations import machine_of
from tests.references.reference_motion import move

mp.dps = 50
_STEP, _APART, _SHORT = mpf(10) ** -22, mpf(10) ** -10, mpf(10) ** -16
_STARTS = ("initial_displacement", "initial_velocity")


def columns(model, tuning, periods, state):
    """Return what is differentiated, dict of lists: as the variables of a run of the library."""
    motion = move(model, tuning, periods, state, context=mp, recorded=1)
    machine, record = motion.machine, motion.record
    several = model["kind"] == "GearTrain"
    found = {"final_state": list(motion.state) if several else list(motion.mesh_state(periods))}
    force = machine.length * machine.force_unit
    for name, pick, values, unit in (
        ("displacement_max", max, record.heights, machine.length),
        ("displacement_min", min, record.heights, machine.length),
        ("dynamic_force_max", max, record.forces, force),
        ("dynamic_force_min", min, record.forces, force),
    ):
        found[name] = [pick(one) / unit for one in values]
    for i, name in enumerate(("normal", "backlash", "inverse", "min_stiffness")):
        found[f"fraction_{name}"] = [one[i] / (2 * mp.pi) for one in record.times]
    last = [event for event in motion.events if event.phase > 2 * mp.pi * (periods - 1)]
    found["event_phase"] = [event.phase for event in last]
    found["event_velocity"] = [event.rate for event in last]
    return found


def flat(found, like):
    """Return all values as one list; NaN where another motion has not as many events."""
    rows = []
    for name in sorted(like):
        same = len(found[name]) == len(like[name])
        rows += found[name] if same else [mp.nan] * len(like[name])
    return rows


def changed(model, tuning, state, name, step):
    """Return (description, tuning, start) with a parameter of the library grown by a step."""
    if name == "tuning":
        return model, mpf(tuning) + step, state
    if name in _STARTS or name.startswith("initial_state"):
        other = [mpf(x) for x in state]
        other[_STARTS.index(name) if name in _STARTS else _place(model, name)] += step
        return model, tuning, other
    slopes = places(model, name)
    if name == "load" and model["kind"] == "GearTrain":
        machine = machine_of(model, tuning, mp)
        force = machine.length * machine.force_unit
        slopes = {
            ("bodies", i, "torque"): body["torque"] / force
            for i, body in enumerate(model["bodies"])
        }
    return moved(model, {path: mpf(s) * step for path, s in slopes.items()}), tuning, state


def _place(model, name):
    """Return the component of a start; coordinates are counted body by body."""
    names = [f"{body} {axis}" for body, axis in machine_of(model, 1.0).names]
    key = name.removeprefix("initial_state of ")
    return len(names) * key.endswith("'") + names.index(key.removesuffix("'"))


def of_run(model, tuning, periods, state, names):
    """Return the derivatives of `columns` by parameters of the library, a list each."""
    with mp.workdps(34):
        return _of_run(model, tuning, periods, state, names)


def _of_run(model, tuning, periods, state, names):
    like, rows = columns(model, tuning, periods, state), []
    base = flat(like, like)
    for name in names:
        size = abs(size_of(model, tuning, name)) or 1
        step = _SHORT * size
        if name == "contact_ratio" and size == 2:
            step = -step
        other, nu, start = changed(model, tuning, state, name, step)
        other = flat(columns(other, nu, periods, start), like)
        rows.append([(b - a) / step for a, b in zip(base, other, strict=True)])
    return rows


def _end(model, tuning, period, z):
    motion = move(model, tuning, period, list(z), context=mp)
    if model["kind"] == "GearTrain":
        return np.array(motion.state, object)
    return np.array(motion.mesh_state(period), object)


def _map(model, tuning, period, z):
    """Return (end, map) of one repeat of two components, the map by differences."""
    end, columns = _end(model, tuning, period, z), []
    for j in range(2):
        other = list(z)
        other[j] += _STEP
        columns.append((_end(model, tuning, period, other) - end) / _STEP)
    return mpmath.matrix(list(end)), mpmath.matrix([[c[i] for c in columns] for i in range(2)])


def _orbit(model, tuning, period, guess):
    """Return (state, multipliers, largest first and with positive imaginary part first)."""
    z = mpmath.matrix(list(map(mpf, guess)))
    for _ in range(4):
        end, matrix = _map(model, tuning, period, list(z))
        z = z + mpmath.lu_solve(mpmath.eye(2) - matrix, end - z)
    _, matrix = _map(model, tuning, period, list(z))
    half, product = (matrix[0, 0] + matrix[1, 1]) / 2, mpmath.det(matrix)
    root = mpmath.sqrt(half * half - product)
    return z, sorted((half + root, half - root), key=lambda mu: (-abs(mu), -mpmath.im(mu)))


def _sides(model, tuning, name, value):
    """Return the central difference of lists of numbers by a parameter."""
    size = abs(size_of(model, tuning, name)) or 1
    both = []
    for sign in (1, -1):
        other, nu, _ = changed(model, tuning, (0, 0), name, sign * _APART * size)
        both.append(value(other, nu))
    return [(a - b) / (2 * _APART * size) for a, b in zip(*both, strict=True)]


def of_orbit(model, tuning, period, guess, names):
    """Return the derivatives of state, real and imaginary parts of both multipliers, a row each."""

    def parts(other, nu):
        z, multipliers = _orbit(other, nu, period, guess)
        return [*z, *map(mpmath.re, multipliers), *map(mpmath.im, multipliers)]

    return [_sides(model, tuning, name, parts) for name in names]


def _fold(model, period, guess):
    """Return the tuning of a fold: an orbit whose map has the multiplier 1."""

    def residual(y):
        end, matrix = _map(model, y[2], period, [y[0], y[1]])
        return mpmath.matrix([end[0] - y[0], end[1] - y[1], mpmath.det(matrix - mpmath.eye(2))])

    y, step = mpmath.matrix(list(map(mpf, guess))), mpf(10) ** -11
    for _ in range(5):
        miss, jacobian = residual(y), mpmath.matrix(3, 3)
        for j in range(3):
            other = y.copy()
            other[j] += step
            jacobian[:, j] = (residual(other) - miss) / step
        y = y - mpmath.lu_solve(jacobian, miss)
    return y[2]


def of_fold(model, period, guess, names):
    """Return the derivatives of the tuning of a fold, one row."""
    return [
        [_sides(model, 1.0, name, lambda other, _: [_fold(other, period, guess)])[0]]
        for name in names
    ]

"""Gear trains for methods with steps: the right-hand side, and classical Runge-Kutta steps."""

import math

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, JAMMED, NORMAL, OK, OVERFLOW
from gearlib.engines.jit import kernel
from gearlib.engines.linear.train_system import behind, dot, set_harmonics
from gearlib.integrators.steps.equation_of_motion import SIDE


@kernel
def rate(system, t, z):
    """Return dz/dtau of a `TrainSystem` at a phase, z of shape (2 N,); contact is that of z."""
    size = z.shape[0]
    full, out = np.empty(system.free.shape[0]), np.empty(size)
    for i in range(size):
        full[i] = z[i]
    set_harmonics(system.harmonics, full, t)
    place, segment = (t + SIDE) % system.starts[-1], 0
    while segment < system.starts.shape[0] - 2 and system.starts[segment + 1] <= place:
        segment += 1
    for r in range(size):
        out[r] = dot(system.free[r], full)
    for j in range(system.near.shape[0]):
        code = BACKLASH
        if dot(system.near[j], full) >= 0.0:
            code = NORMAL
        elif dot(system.far[j], full) <= 0.0:
            code = INVERSE
        effect = system.effect[code + 1, segment, j]
        for k in range(2):
            force = dot(system.grip[j, effect, k], full)
            for r in range(size):
                out[r] += system.push[j, effect, k, r] * force
    for r in range(size):
        out[r] /= system.tuning
    return out


@kernel
def jammed(system, closing, t, z):
    """Return whether both flanks touch at once in one of the meshes in which they might."""
    if not closing.any():
        return False
    full = np.empty(system.free.shape[0])
    full[: z.shape[0]] = z
    set_harmonics(system.harmonics, full, t)
    for j in range(closing.shape[0]):
        if closing[j] and dot(system.near[j], full) >= 0.0 and behind(system.far[j], full):
            return True
    return False


@kernel
def set_states(frequencies, phases, states, full):
    """Fill rows of `full`, shape (k, n), with states, shape (k, size), constant and harmonics."""
    for i in range(phases.shape[0]):
        full[i, : states.shape[1]] = states[i]
        set_harmonics(frequencies, full[i], phases[i])


@kernel
def take_runge_kutta_steps(system, closing, period, steps, states, largest):
    """Fill states, shape (k + 1, size), from the first, at the start of a mesh period.

    Returns (status, steps taken): the run ends where a state leaves `largest`, or is NaN, and
    where flanks are `jammed`.
    """
    h = 2.0 * math.pi / steps
    for i in range(states.shape[0] - 1):
        t, z = 2.0 * math.pi * (period + i // steps) + (i % steps) * h, states[i]
        k1 = rate(system, t, z)
        k2 = rate(system, t + h / 2.0, z + h / 2.0 * k1)
        k3 = rate(system, t + h / 2.0, z + h / 2.0 * k2)
        k4 = rate(system, t + h, z + h * k3)
        states[i + 1] = z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if jammed(system, closing, t + h, states[i + 1]):
            return JAMMED, i + 1
        if not np.abs(states[i + 1]).max() < largest:
            return OVERFLOW, i + 1
    return OK, states.shape[0] - 1

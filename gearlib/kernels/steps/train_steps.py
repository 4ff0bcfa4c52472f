"""Gear trains for methods with steps: the right-hand side, and classical Runge-Kutta steps."""

import math

import numpy as np

from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.jit import kernel
from gearlib.kernels.several_meshes.train_system import behind, dot, set_harmonics
from gearlib.kernels.steps.equation_of_motion import SIDE


@kernel
def rate(system, t, z):
    """Return dz/dtau of a `TrainSystem` at a phase, z of shape (2 N,); contact is that of z."""
    size = z.shape[0]
    full, out = np.empty(system.free.shape[0]), np.empty(size)
    for i in range(size):
        full[i] = z[i]
    set_harmonics(system.harmonics, full, t)
    place, segment = (t + SIDE) % (2.0 * math.pi * system.repeats), 0
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
def runge_kutta_step(system, t, h, z):
    """Return z after one step from (t, z)."""
    k1 = rate(system, t, z)
    k2 = rate(system, t + h / 2.0, z + h / 2.0 * k1)
    k3 = rate(system, t + h / 2.0, z + h / 2.0 * k2)
    k4 = rate(system, t + h, z + h * k3)
    return z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@kernel
def runge_kutta_period(system, closing, n, steps, z, largest):
    """Return (z after mesh period n, steps taken, whether the flanks are `jammed` there).

    Fewer steps where z leaves `largest`, or is NaN, and where flanks jam.
    """
    h = 2.0 * math.pi / steps
    for i in range(steps):
        z = runge_kutta_step(system, 2.0 * math.pi * n + i * h, h, z)
        if not np.abs(z).max() < largest:
            return z, i + 1, False
        if jammed(system, closing, 2.0 * math.pi * n + (i + 1) * h, z):
            return z, i + 1, True
    return z, steps, False

"""Automatic differentiation, forwards, of diffrax's steps through a `GearPair`.

The right-hand side chooses contact and stiffness by state and phase, as one writes it in JAX. Its
derivative is that of the branch taken.
"""

import math
from functools import cache

import numpy as np

_TOLERANCE, _MOST_STEPS = 1e-9, 200_000


@cache
def _compiled():
    """Return the compiled derivatives of the end by (ratios, tuning), (start, length) given."""
    import diffrax
    import jax
    import jax.numpy as jnp

    def rate(t, z, p):
        x, v = z
        contact, kappa, beta, oil, gap, nu = p
        mean = kappa + (1.0 - kappa) * (contact - 1.0)
        phase = jnp.abs((t + math.pi) % (2.0 * math.pi) - math.pi)
        stiffness = jnp.where(phase <= math.pi * (contact - 1.0), 1.0, kappa) / mean
        deflection = jnp.where(x >= 0.0, x, jnp.where(x <= -gap, x + gap, 0.0))
        loss = jnp.where((x >= 0.0) | (x <= -gap), beta, oil)
        return v, (1.0 - stiffness * deflection) / (nu * nu) - 2.0 * loss / nu * v

    def end(p, state, length):
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(rate),
            diffrax.Dopri8(),
            0.0,
            length,
            0.01,
            (state[0], state[1]),
            p,
            stepsize_controller=diffrax.PIDController(rtol=_TOLERANCE, atol=_TOLERANCE),
            adjoint=diffrax.ForwardMode(),
            max_steps=_MOST_STEPS,
            throw=False,
        )
        return jnp.stack([solution.ys[0][-1], solution.ys[1][-1]])

    return jax.jit(jax.jacfwd(end))


def derivatives(pair, tuning, state, periods):
    """Return the derivatives of the final state by `GearPair.RATIOS` and the tuning, (6, 2)."""
    import jax
    import jax.numpy as jnp

    values = [min(getattr(pair, name), 1e9) for name in pair.RATIOS]
    with jax.enable_x64(True):
        p, start = jnp.array([*values, tuning]), jnp.array(state, float)
        return np.array(_compiled()(p, start, 2.0 * math.pi * periods)).T

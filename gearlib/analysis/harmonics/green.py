"""The periodic Green's function of the mean-stiffness oscillator, and the size of its remainders.

The periodic solution of x'' + 2 d x' + w^2 x = h(tau), d = beta / nu, w = 1 / nu, is

    x(tau) = int_0^T G(tau - sigma) h(sigma) dsigma,

with the kernel of period T, l1 and l2 the roots of l^2 + 2 d l + w^2,

    G(s) = [exp(l1 s) / (1 - exp(l1 T)) - exp(l2 s) / (1 - exp(l2 T))] / (l1 - l2),  0 <= s < T:

the free motion that follows an impulse, and all impulses a whole number of periods before it.
On harmonics G is one over the oscillator's symbol. E. Schmidt's splitting takes the harmonics on
which that is large for a degenerate kernel, of finite rank; `remainder_norm` bounds what is left.
"""

import numpy as np

#: Roots closer than this, relative, are one double root.
_DOUBLE = 1e-7


def green(phase, tuning, damping, period=1):
    """Return the periodic Green's function at phases s since the impulse, rad, in closed form.

    Displacement per impulse in dx/dtau, rad, for a tuning nu and a damping ratio beta >= 0, over
    `period` mesh periods; infinite or NaN at an undamped resonance nu = period / k.
    """
    length = 2.0 * np.pi * period
    s = np.mod(np.asarray(phase, float), length)
    d, w = damping / tuning, 1.0 / tuning
    root = np.sqrt(complex(d * d - w * w))
    with np.errstate(divide="ignore", invalid="ignore"):
        if abs(root) < _DOUBLE * w:
            # A double root -d: the derivative by l of exp(l s) / (1 - exp(l T)).
            gain = np.exp(-d * length)
            return np.exp(-d * s) * (s + length * gain / (1.0 - gain)) / (1.0 - gain)
        first, second = (np.exp(x * s) / (1.0 - np.exp(x * length)) for x in (-d + root, -d - root))
        return ((first - second) / (2.0 * root)).real


def weights(equation, force):
    """Return how much each harmonic of the kernel can enlarge a deviation, shape (harmonics + 1,).

    |G_k| (sup |n_x| + k sup |n_v|), where n = f - 2 d x' - w^2 x is the force that the
    mean-stiffness oscillator lacks, n_x and n_v its derivatives. Damping that jumps at a flank
    line counts by n_v alone: its deviation is the derivative of (jump of damping) times y.
    """
    by_x = np.abs(force.slope - equation.unit).max()
    by_v = np.abs(force.by_velocity - equation.rate).max()
    with np.errstate(divide="ignore"):
        return (by_x + equation.orders * by_v) / np.abs(equation.symbol)


def remainder_norm(weights, degenerate):
    """Return a bound of the norm of the remainder in mean squares.

    Below 1 its Neumann series converges. Weights as of `weights`, shape (harmonics + 1,), and
    the harmonics of the degenerate part.
    """
    left = np.delete(weights, degenerate)
    return float(left.max()) if left.size else 0.0

"""The one equation of all models with one degree of freedom: an oscillator between two contacts.

    x'' + e x + d(x') + c(tau) (g + p2 |g| g + p3 g^3)
        = F + sum_n (a_n cos n tau + b_n sin n tau) + f''(tau),        tau = nu t,

    g(x) = x - upper     x >= upper           NORMAL contact, c and d of the near side
         = 0             lower < x < upper    BACKLASH, d of the gap
         = x - lower     x <= lower           INVERSE contact, c and d of the far side

with d(v) = d1 v + d2 |v| v + d3 v^3 and x' in units of the model's own time t; nu is the frequency
of the excitation in that unit. Models give their parameters as an `Equation`; the kernels get it
as a `Law` (Taylor steps) or, where all phases are linear with constant coefficients, as a
`TrainSystem` of one mesh (modes).
"""

from dataclasses import dataclass

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.taylor.series import Law
from gearlib.models import one_mesh_system
from gearlib.models.profiles import Pieces


@dataclass(frozen=True)
class Equation:
    """Parameters of the equation above, in a unit of length and of time."""

    upper: float  #: finite
    lower: float  #: <= upper, may be -inf: no far side
    near: Pieces  #: c(tau) of the near side
    far: Pieces  #: c(tau) of the far side; the same object where both are alike
    damping: np.ndarray  #: d1, d2, d3 of far side, gap and near side, shape (3, 3)
    powers: np.ndarray  #: p2, p3, shape (2,)
    ground: float  #: e
    load: float  #: F
    force: np.ndarray  #: rows (n, a_n, b_n), shape (k, 3)
    deviation: np.ndarray  #: rows (n, cosine, sine) of f, shape (j, 3)
    natural: float  #: frequency of the motion in contact, to choose steps by

    def is_piecewise_linear(self):
        """Return whether the phases between events have closed forms."""
        curved = self.damping[:, 1:].any() or self.powers.any()
        constant = all(
            not side.harmonics.size and not side.lines[:, 1].any() for side in (self.near, self.far)
        )
        return bool(constant and not curved)

    def law(self, tuning, tolerance):
        """Return the `Law` at one frequency for Taylor steps of a `tolerance`."""
        unit, (near, far) = 1.0 / tuning**2, self.sides()
        # Velocities are by phase: each power of x' comes with nu, all with 1 / nu^2.
        damping = self.damping * np.array([1.0 / tuning, 1.0, tuning])
        waves = np.array([1.0, unit, unit])
        return Law(
            tuning,
            self.upper - self.lower,
            damping[NORMAL + 1],
            damping[BACKLASH + 1],
            self.powers,
            near.breaks,
            near.lines * unit,
            near.low,
            near.harmonics * waves,
            np.vstack([[0.0, self.load * unit, 0.0], self._excitation(unit)]),
            tolerance,
            self.upper,
            self.lower,
            self.ground * unit,
            damping[INVERSE + 1],
            far.lines * unit,
            far.harmonics * waves,
        )

    def system(self, tuning):
        """Return the `TrainSystem` at one frequency, if the equation is piecewise linear.

        Components q = x - f, dq/dt, 1 and a cosine and a sine of each order, over the model's own
        time t: the deviation f moves the flanks, and its inertia falls out of the equation.
        """
        near, far = self.sides()
        orders = np.unique(np.concatenate([self.force[:, 0], self.deviation[:, 0]]))
        n = 3 + 2 * orders.size
        upper, lower, push = np.zeros((3, n), np.result_type(tuning))
        upper[0], push[1] = 1.0, -1.0
        gap = self.damping[BACKLASH + 1, 0]
        free = one_mesh_system.waves(n, 3, tuning * orders).astype(push.dtype)
        free[0, 1] = 1.0
        free[1, 2] = self.load
        for row, functional in ((free[1], self.force), (upper, self.deviation)):
            for order, cosine, sine in functional:
                column = 3 + 2 * int(np.searchsorted(orders, order))
                row[column : column + 2] += cosine, sine
        # Of x and its rate, the functional and its image, depend the spring e and the damping.
        free[1] -= self.ground * upper + gap * (upper @ free)
        lower[:] = upper
        upper[2] = -self.upper
        flanks = {NORMAL: (upper, near.lines[:, 0], self.damping[NORMAL + 1, 0] - gap)}
        if np.isfinite(self.lower):
            lower[2] = -self.lower
            flanks[INVERSE] = lower, far.lines[:, 0], self.damping[INVERSE + 1, 0] - gap
        return one_mesh_system.one_mesh(free, push, flanks, near.low, near.breaks, orders, tuning)

    def _excitation(self, unit):
        """Return rows (order, cosine, sine) of force and deviation in phase, shape (n, 3)."""
        deviation = self.deviation.copy()
        # f'' of a harmonic of order n is -n^2 times the harmonic.
        deviation[:, 1:] *= -(deviation[:, :1] ** 2)
        return np.vstack([self.force * np.array([1.0, unit, unit]), deviation])

    def sides(self):
        """Return the stiffness of near and far side over the same breaks."""
        if self.near is self.far:
            return self.near, self.far
        breaks = np.union1d(self.near.breaks, self.far.breaks)
        return self.near.at(breaks), self.far.at(breaks)


def linear_equation(pair, pieces: Pieces) -> Equation:
    """Return the `Equation` of a pair in static deflections and 1 / Omega_s of time."""
    material = 2.0 * pair.damping_ratio, 0.0, 0.0
    oil = 2.0 * pair.backlash_damping_ratio, 0.0, 0.0
    return Equation(
        upper=0.0,
        lower=-pair.backlash_ratio,
        near=pieces,
        far=pieces,
        damping=np.array([material, oil, material]),
        powers=np.zeros(2),
        ground=0.0,
        load=1.0,
        force=np.empty((0, 3)),
        deviation=np.empty((0, 3)),
        natural=1.0,
    )

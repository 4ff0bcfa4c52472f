"""Taylor series of the nonlinear mesh, Eq. (3) with one degree of freedom.

In static deflections and mesh phase, while one contact code and one sign of x' last,

    x'' = F(tau) - e x - d1 x' - d2 |x'| x' - d3 x'^3 - c(tau) (g + p2 |g| g + p3 g^3),

every term is a polynomial in x, x' and the series of c and F, so that the coefficients of the
solution follow from each other by Cauchy products. F, e and c come with the factor 1 / nu^2.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.core.jit import inlined, kernel
from gearlib.core.mesh import BACKLASH, INVERSE, NORMAL

#: Terms of the series beyond the constant. The cost of a step grows with its square, the length
#: of a step with its logarithm at most; between 16 and 24 the cost per phase is flat.
ORDER = 20
_INVERSE = 1.0 / np.arange(1, ORDER + 2).repeat([2] + [1] * ORDER)[: ORDER + 1]


class Law(NamedTuple):
    """Dimensionless constants and tables of the nonlinear mesh at one tuning."""

    tuning: float
    gap: float  #: backlash in static deflections, upper - lower
    material: np.ndarray  #: d1, d2, d3 in normal contact, shape (3,)
    oil: np.ndarray  #: d1, d2, d3 in the backlash, shape (3,)
    powers: np.ndarray  #: p2, p3 of the contact stiffness, shape (2,)
    breaks: np.ndarray  #: phases that bound the pieces of c(tau), shape (m + 1,), 0 to 2 pi
    pieces: np.ndarray  #: c at the start of a piece and its slope, shape (m, 2)
    low: np.ndarray  #: whether c lies below its mean on a piece, shape (m,)
    stiffness: np.ndarray  #: harmonics added to c: order, cosine, sine, shape (j, 3)
    force: np.ndarray  #: harmonics of F (order 0 the mean): order, cosine, sine, shape (k, 3)
    tolerance: float  #: truncation error of a step, in static deflections
    # Of gear pairs the normal flank lies at 0, both flanks are alike and nothing else pulls.
    upper: float  #: displacement of the normal flank
    lower: float  #: displacement of the far flank
    ground: float  #: e, stiffness towards x = 0 that never parts
    far_damping: np.ndarray  #: d1, d2, d3 in inverse contact, shape (3,)
    far_pieces: np.ndarray  #: as `pieces`, of the far flank
    far_stiffness: np.ndarray  #: as `stiffness`, of the far flank


class Storage(NamedTuple):
    """Arrays that a march writes to, shapes (ORDER + 1,) unless stated."""

    x: np.ndarray
    v: np.ndarray
    u: np.ndarray  #: series of the elastic deflection
    c: np.ndarray  #: series of the stiffness
    g: np.ndarray  #: series of the elastic deflection with its powers
    k: np.ndarray  #: series of the mesh force c g
    square: np.ndarray  #: of the elastic deflection
    speed_square: np.ndarray
    scaled: np.ndarray
    work: np.ndarray  #: shape (50, ORDER + 2), of `polynomial.first_fall`


@kernel
def storage():
    """Return fresh `Storage`."""
    n = ORDER + 1
    return Storage(
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty((50, n + 1)),
    )


@inlined
def add_harmonics(table, phase, series):
    """Add the Taylor coefficients at `phase` of the harmonics in `table` to `series`."""
    for j in range(table.shape[0]):
        n = table[j, 0]
        if n == 0.0:
            series[0] += table[j, 1]
            continue
        cosine, sine = math.cos(n * phase), math.sin(n * phase)
        even = table[j, 1] * cosine + table[j, 2] * sine
        odd = n * (table[j, 2] * cosine - table[j, 1] * sine)
        series[0] += even
        series[1] += odd
        for k in range(2, series.shape[0]):
            even, odd = odd, -n * n * even / (k * (k - 1.0))
            series[k] += odd


@inlined
def _square(a, k):
    """Return the k-th coefficient of the square of the series `a`."""
    total = 0.0
    for i in range((k + 1) // 2):
        total += a[i] * a[k - i]
    total *= 2.0
    if k % 2 == 0:
        total += a[k // 2] * a[k // 2]
    return total


@inlined
def _product(a, b, k):
    """Return the k-th coefficient of the product of the series `a` and `b`."""
    # Two sums, so that an addition need not wait for the one before it.
    even, odd = 0.0, 0.0
    for i in range(0, k, 2):
        even += a[i] * b[k - i]
        odd += a[i + 1] * b[k - i - 1]
    if k % 2 == 0:
        even += a[k] * b[0]
    return even + odd


@inlined
def damping_of(law, contact):
    """Return d1, d2, d3 of a contact code, shape (3,)."""
    if contact == BACKLASH:
        return law.oil
    return law.material if contact == NORMAL else law.far_damping


@inlined
def expand(law, piece, phase, contact, sign, x, v, s):
    """Fill the series of x, v, c and the mesh force at `phase`, inside piece `piece` of c(tau).

    `sign` is that of x' throughout the step.
    """
    damping = damping_of(law, contact)
    d1, d2, d3 = damping[0], sign * damping[1], damping[2]
    pieces, waves = law.pieces, law.stiffness
    if contact == INVERSE:
        pieces, waves = law.far_pieces, law.far_stiffness
    c = s.c
    c[:] = 0.0
    c[0] = pieces[piece, 0] + pieces[piece, 1] * (phase - law.breaks[piece])
    c[1] = pieces[piece, 1]
    add_harmonics(waves, phase, c)
    constant = pieces[piece, 1] == 0.0 and waves.shape[0] == 0
    force = s.scaled
    force[:] = 0.0
    add_harmonics(law.force, phase, force)
    side = 1.0 if contact == NORMAL else -1.0
    line = law.upper if contact == NORMAL else law.lower
    ground = law.ground
    p2, p3 = side * law.powers[0], law.powers[1]
    curved = p2 != 0.0 or p3 != 0.0
    touching = contact != BACKLASH
    # Local names: every attribute access counts references, which costs more than the sums.
    xs, vs, us, gs, ks, us2, vs2 = s.x, s.v, s.u, s.g, s.k, s.square, s.speed_square
    xs[0], vs[0] = x, v
    for k in range(ORDER):
        if touching:
            us[k] = xs[k] if k > 0 else x - line
            gs[k] = us[k]
            if curved:
                us2[k] = _square(us, k)
                gs[k] += p2 * us2[k] + p3 * _product(us2, us, k)
            ks[k] = c[0] * gs[k] if constant else _product(c, gs, k)
        else:
            ks[k] = 0.0
        drag = d1 * vs[k]
        if d2 != 0.0 or d3 != 0.0:
            vs2[k] = _square(vs, k)
            drag += d2 * vs2[k]
            if d3 != 0.0:
                drag += d3 * _product(vs2, vs, k)
        xs[k + 1] = vs[k] * _INVERSE[k + 1]
        vs[k + 1] = (force[k] - drag - ks[k] - ground * xs[k]) * _INVERSE[k + 1]
    # The motion does not need the last term of the mesh force, and its record is as good without.
    ks[ORDER] = 0.0


@inlined
def step_length(law, s):
    """Return the longest step whose truncation error stays below the tolerance.

    The last two terms are compared (one may vanish by symmetry); velocities count as the
    displacement they make in 1 / nu of phase.
    """
    size = max(1.0, abs(s.x[0]))
    limit = law.tolerance * size
    h = math.inf
    for k in range(ORDER - 1, ORDER + 1):
        term = max(abs(s.x[k]), law.tuning * abs(s.v[k]))
        if term > 0.0:
            h = min(h, (limit / term) ** (1.0 / k))
    return h

"""The equation of motion at one phase and state, as methods with steps see it.

In static deflections and mesh phase

    x'' = F(tau) - d1 x' - d2 |x'| x' - d3 x'^3 - c(tau) g(x),

with contact decided by the displacement alone, H1 = [x >= 0], H2 = [x <= -s], or, smoothed,
H1 = (1 + tanh(sharpness x)) / 2 and H2 = (1 - tanh(sharpness (x + s))) / 2.
"""

import math
from typing import NamedTuple

from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.jit import inlined, kernel

#: Phases this close to a switch of stiffness count as the switch: far above the rounding of a
#: phase, far below any step.
SIDE = 1e-12


class Contact(NamedTuple):
    """The contact law as plain floats, which kernels pass on at no cost."""

    d1: float  #: damping while the flanks touch
    d2: float
    d3: float
    e1: float  #: damping in the backlash
    e2: float
    e3: float
    p2: float  #: powers of the contact stiffness
    p3: float
    gap: float  #: backlash in static deflections
    sharpness: float  #: of the smoothed law, per static deflection; 0: not smoothed
    plain: bool  #: whether the law is sharp, its damping and stiffness linear


@kernel
def contact_law(law, sharpness):
    """Return the `Contact` of a `gearlib.kernels.taylor.series.Law`."""
    plain = sharpness == 0.0 and law.powers[0] == 0.0 and law.powers[1] == 0.0
    for damping in (law.material, law.oil):
        plain = plain and damping[1] == 0.0 and damping[2] == 0.0
    return Contact(
        law.material[0],
        law.material[1],
        law.material[2],
        law.oil[0],
        law.oil[1],
        law.oil[2],
        law.powers[0],
        law.powers[1],
        law.gap,
        sharpness,
        plain,
    )


@inlined
def side_of(gap, x):
    """Return the contact code of a displacement; a flank line belongs to contact."""
    if x >= 0.0:
        return NORMAL
    return INVERSE if x <= -gap else BACKLASH


@inlined
def _curve(m, u):
    return u + (m.p2 * abs(u) + m.p3 * u * u) * u


@inlined
def _smoothed(m, x):
    """Return g(x) with its powers, and H1 + H2, both smoothed."""
    near, far = 0.5 * (1.0 + math.tanh(m.sharpness * x)), 0.0
    total = near * _curve(m, x)
    if m.gap < math.inf:
        far = 0.5 * (1.0 - math.tanh(m.sharpness * (x + m.gap)))
        total += far * _curve(m, x + m.gap)
    return total, near + far


@inlined
def spring(m, x):
    """Return g(x), with its powers."""
    if m.sharpness > 0.0:
        return _smoothed(m, x)[0]
    if x >= 0.0:
        return _curve(m, x)
    return _curve(m, x + m.gap) if x <= -m.gap else 0.0


@inlined
def _material(m, v):
    return (m.d1 + (m.d2 + m.d3 * abs(v)) * abs(v)) * v


@inlined
def _oil(m, v):
    return (m.e1 + (m.e2 + m.e3 * abs(v)) * abs(v)) * v


@inlined
def drag(m, x, v):
    """Return the damping force over the mass, of the sharp law."""
    return _material(m, v) if x >= 0.0 or x <= -m.gap else _oil(m, v)


@inlined
def acceleration(m, c, f, x, v):
    """Return x'' at stiffness c and force f."""
    if m.plain:
        # Half the time of the general law, which comparisons of methods should not pay for.
        if x >= 0.0:
            return f - m.d1 * v - c * x
        if x <= -m.gap:
            return f - m.d1 * v - c * (x + m.gap)
        return f - m.e1 * v
    if m.sharpness > 0.0:
        total, share = _smoothed(m, x)
        return f - share * _material(m, v) - (1.0 - share) * _oil(m, v) - c * total
    return f - drag(m, x, v) - c * spring(m, x)


@inlined
def waves_at(table, phase):
    """Return the sum of the harmonics in `table`, rows (order, cosine, sine)."""
    total = 0.0
    for j in range(table.shape[0]):
        n = table[j, 0]
        if n == 0.0:
            total += table[j, 1]
        else:
            total += table[j, 1] * math.cos(n * phase) + table[j, 2] * math.sin(n * phase)
    return total


@inlined
def stiffness_at(breaks, lines, waves, phase, side):
    """Return c just after (`side` = SIDE) or just before (-SIDE) a phase from 0 to 2 pi."""
    p = phase + side
    if p < 0.0:
        p += 2.0 * math.pi
    elif p >= 2.0 * math.pi:
        p -= 2.0 * math.pi
    i = 0
    while i + 2 < breaks.shape[0] and p >= breaks[i + 1]:
        i += 1
    return lines[i, 0] + lines[i, 1] * (p - side - breaks[i]) + waves_at(waves, phase)

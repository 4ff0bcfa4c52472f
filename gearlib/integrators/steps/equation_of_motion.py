"""Equations of motion at one phase and state, for methods with steps.

That of one degree of freedom is, in static deflections and mesh phase,

    x'' = F(tau) - e x - d1 x' - d2 |x'| x' - d3 x'^3 - c(tau) g(x),

with contact where the displacement lies beyond a flank, or, smoothed, with the shares
H1 = (1 + tanh(sharpness (x - upper))) / 2 and H2 = (1 - tanh(sharpness (x - lower))) / 2 of both
flanks in spring force and damping.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.linear.train_system import dot, is_behind, set_harmonics

#: Phases this close to a switch of stiffness count as the switch: far above the rounding of a
#: phase, far below any step.
SIDE = 1e-12


class Contact(NamedTuple):
    """The contact law as plain floats, which kernels pass on at no cost."""

    normal_damping: tuple  #: d1, d2, d3 while the normal flanks touch
    backlash_damping: tuple  #: d1, d2, d3 in the backlash
    inverse_damping: tuple  #: d1, d2, d3 while the inverse flanks touch
    powers: tuple  #: p2, p3 of the contact stiffness
    upper: float  #: displacement of the normal flank, static deflections
    lower: float  #: displacement of the inverse flank
    ground: float  #: e, stiffness towards x = 0 that never parts
    sharpness: float = 0.0  #: of the smoothed law, per static deflection; 0: not smoothed
    plain: bool = False  #: whether the law is sharp, its damping and stiffness linear


def contact_law(law, sharpness=0.0):
    """Return the `Contact` of a `gearlib.engines.taylor.series.Law`."""
    damping = [tuple(row.tolist()) for row in (law.material, law.oil, law.far_damping)]
    powers = tuple(law.powers.tolist())
    curved = any(powers) or any(any(row[1:]) for row in damping)
    plain = sharpness == 0.0 and not curved and damping[0] == damping[2] and law.ground == 0.0
    edges = float(law.upper), float(law.lower), float(law.ground)
    return Contact(*damping, powers, *edges, float(sharpness), plain)


@inlined
def side_of(m, x):
    """Return the contact code of a displacement; a flank line belongs to contact."""
    if x >= m.upper:
        return NORMAL
    return INVERSE if x <= m.lower else BACKLASH


@inlined
def damping_force(coefficients, v):
    """Return d1 v + d2 |v| v + d3 v^3."""
    return (coefficients[0] + (coefficients[1] + coefficients[2] * abs(v)) * abs(v)) * v


@inlined
def _spring(m, u):
    return u + (m.powers[0] * abs(u) + m.powers[1] * u * u) * u


@inlined
def branch_of(m, code):
    """Return (1 in contact, else 0; displacement of its flank; damping) of a contact code."""
    if code == NORMAL:
        return 1.0, m.upper, m.normal_damping
    if code == INVERSE:
        return 1.0, m.lower, m.inverse_damping
    return 0.0, m.upper, m.backlash_damping


@inlined
def forces_at(m, code, x, v):
    """Return (g, damping force) of a contact code, of the sharp law."""
    touching, line, damping = branch_of(m, code)
    return touching * _spring(m, x - line), damping_force(damping, v)


@inlined
def _smoothed(m, x):
    """Return g and the share of contact, H1 + H2, both smoothed."""
    near, far = 0.5 * (1.0 + math.tanh(m.sharpness * (x - m.upper))), 0.0
    total = near * _spring(m, x - m.upper)
    if m.lower > -math.inf:
        far = 0.5 * (1.0 - math.tanh(m.sharpness * (x - m.lower)))
        total += far * _spring(m, x - m.lower)
    return total, near + far


@inlined
def on_branch(m, code, c, f, x, v):
    """Return (g, x'') of a contact code (if not smoothed) at stiffness c and force f."""
    if m.sharpness > 0.0:
        g, share = _smoothed(m, x)
        drag = share * damping_force(m.normal_damping, v)
        return g, f - drag - (1.0 - share) * damping_force(m.backlash_damping, v) - c * g
    g, drag = forces_at(m, code, x, v)
    return g, f - m.ground * x - drag - c * g


@inlined
def acceleration(m, c, f, x, v):
    """Return x'' at stiffness c and force f, with the contact of the displacement."""
    if m.plain:
        # Half the time of the general law, which comparisons of methods should not pay for.
        if x >= m.upper:
            return f - m.normal_damping[0] * v - c * (x - m.upper)
        if x <= m.lower:
            return f - m.normal_damping[0] * v - c * (x - m.lower)
        return f - m.backlash_damping[0] * v
    return on_branch(m, side_of(m, x), c, f, x, v)[1]


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


@inlined
def rate_at(breaks, lines, waves, force, m, t, x, v):
    """Return x'' at a phase of the run and a state, with the contact of the displacement."""
    phase = t - 2.0 * math.pi * math.floor(t * (0.5 / math.pi))
    c = stiffness_at(breaks, lines, waves, phase, SIDE)
    return acceleration(m, c, waves_at(force, phase), x, v)


@kernel
def rate(m, law, t, x, v):
    """Return x'' at a phase of the run and a state, with the contact of the displacement."""
    if m.sharpness == 0.0 and x <= m.lower:
        return rate_at(law.breaks, law.far_pieces, law.far_stiffness, law.force, m, t, x, v)
    return rate_at(law.breaks, law.pieces, law.stiffness, law.force, m, t, x, v)


@inlined
def _stiffness_on(breaks, lines, waves, piece, t):
    """Return c on a piece, also where rounding puts t just before it."""
    inside = (t - breaks[piece] + 1e-6) % (2.0 * math.pi) - 1e-6
    return lines[piece, 0] + lines[piece, 1] * inside + waves_at(waves, t)


@kernel
def on_branches(m, law, phases, pieces, codes, states):
    """Return rows (c, g, x'') of states, shape (k, 2), on pieces of the stiffness.

    Contact codes are given; a smoothed law does not ask for them.
    """
    # Local names: every attribute access counts references.
    breaks, lines, waves, force = law.breaks, law.pieces, law.stiffness, law.force
    far_lines, far_waves = law.far_pieces, law.far_stiffness
    table = np.empty((phases.shape[0], 3))
    for i in range(phases.shape[0]):
        t, piece, code = phases[i], pieces[i], codes[i]
        if code == INVERSE and m.sharpness == 0.0:
            c = _stiffness_on(breaks, far_lines, far_waves, piece, t)
        else:
            c = _stiffness_on(breaks, lines, waves, piece, t)
        f = waves_at(force, t)
        g, a = on_branch(m, code, c, f, states[i, 0], states[i, 1])
        table[i, 0], table[i, 1], table[i, 2] = c, g, a
    return table


@kernel
def train_rate(system, t, z):
    """Return dz/dtau of a `TrainSystem` at a phase, z of shape (2 N,); contact is that of z."""
    size = z.shape[0]
    full, out = np.empty(system.base_matrix.shape[0]), np.empty(size)
    for i in range(size):
        full[i] = z[i]
    set_harmonics(system.harmonics, full, t)
    place, segment = (t + SIDE) % system.starts[-1], 0
    while segment < system.starts.shape[0] - 2 and system.starts[segment + 1] <= place:
        segment += 1
    for r in range(size):
        out[r] = dot(system.base_matrix[r], full)
    for j in range(system.drive_lines.shape[0]):
        code = BACKLASH
        if dot(system.drive_lines[j], full) >= 0.0:
            code = NORMAL
        elif dot(system.coast_lines[j], full) <= 0.0:
            code = INVERSE
        effect = system.effect[code + 1, segment, j]
        for k in range(2):
            force = dot(system.force_output[j, effect, k], full)
            for r in range(size):
                out[r] += system.force_input[j, effect, k, r] * force
    for r in range(size):
        out[r] /= system.tuning
    return out


@kernel
def jammed(system, closing, t, z):
    """Return whether both flanks touch at once in one of the meshes in which they might."""
    if not closing.any():
        return False
    full = np.empty(system.base_matrix.shape[0])
    full[: z.shape[0]] = z
    set_harmonics(system.harmonics, full, t)
    for j in range(closing.shape[0]):
        if (
            closing[j]
            and dot(system.drive_lines[j], full) >= 0.0
            and is_behind(system.coast_lines[j], full)
        ):
            return True
    return False


@kernel
def set_harmonics_of_rows(frequencies, states, phases):
    """Set the constant and the harmonics of rows of states, shape (k, n), at phases."""
    for i in range(phases.shape[0]):
        set_harmonics(frequencies, states[i], phases[i])

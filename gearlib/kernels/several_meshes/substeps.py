"""A substep of a gear train, and parts of one: where the state goes, whether a line is reached.

On a substep the distance of every mesh from a flank is a polynomial of the phase, whose
coefficients are rows times the state. Its first terms mostly prove that the line is not reached;
otherwise the first crossing is proved by the shape of the polynomial, or isolated in Bernstein form
(`gearlib.kernels.polynomial`).
"""

from gearlib.kernels.arrays import copy
from gearlib.kernels.codes import BACKLASH, NORMAL
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.piecewise_linear.system import ORDER, REACH, next_contact
from gearlib.kernels.polynomial import fall_by_shape, first_fall, horner, lowest_of_parabola
from gearlib.kernels.several_meshes.combinations import LOOK, multiply

#: Terms of a series below this share of the state are nothing, with room for unlike scales.
_NOTHING = 1e-19


@kernel
def advance(rate, c, spin, longest, t, z, term, image):
    """Take z by t <= longest along A of combination c, by its Taylor series.

    Its k-th term is at most (|A| t)^k / k! of the state; arrays of `Combinations` and `Work`.
    """
    n = rate.shape[1]
    h = spin.shape[0]
    coordinates = (n - 1) // 2 - h
    for r in range(n):
        term[r] = z[r]
    k, size = 0, 1.0
    while size > _NOTHING:
        k += 1
        size *= REACH * t / (longest * k)
        share = t / k
        multiply(rate, c, term, image)
        for r in range(coordinates):
            term[r] = share * term[coordinates + r]
            term[coordinates + r] = share * image[r]
            z[r] += term[r]
            z[coordinates + r] += term[coordinates + r]
        term[2 * coordinates] = 0.0
        for j in range(h):
            column = 2 * coordinates + 1 + 2 * j
            cosine = -share * spin[j] * term[column + 1]
            term[column + 1] = share * spin[j] * term[column]
            term[column] = cosine
            z[column] += term[column]
            z[column + 1] += term[column + 1]


@kernel
def polynomial(look, rows, row, behind, z, j, scale, curve):
    """Fill `curve` with the distance of mesh j over a part of a substep, drive side."""
    multiply(rows, row, z, behind)
    power = 1.0
    for k in range(ORDER + 1):
        curve[k] = power * (look[LOOK * j + k] if k < LOOK else behind[k - LOOK])
        power *= scale


@kernel
def to_far(apart, j, scale, constants, curve):
    """Turn the distance of mesh j from its drive side into that from its coast side."""
    power = 1.0
    for k in range(ORDER + 1):
        for i in range(constants.shape[0]):
            curve[k] += power * apart[j, k, i] * constants[i]
        power *= scale
        if constants.shape[0] == 1:
            break


@inlined
def look_ahead(rows, tails, apart, c, z, contact, never, closing, look, tail, term, clear):
    """Fill `clear`, which meshes provably come to no flank line within the longest substep.

    Their parabolas stay clear of the line by more than all higher terms can make. Fills look and
    tail for the state; arrays of `Combinations`, `Grid` and `Work`. Returns whether all are clear.
    """
    multiply(rows, c, z, look)
    for r in range(rows.shape[1]):
        term[r] = abs(z[r])
    multiply(tails, c, term, tail)
    quiet = True
    for j in range(contact.shape[0]):
        i, code = LOOK * j, contact[j]
        x, v, a = look[i], look[i + 1], look[i + 2]
        reach = (abs(look[i + 3]) + abs(look[i + 4])) + (abs(look[i + 5]) + abs(look[i + 6]))
        reach += abs(look[i + 7]) + tail[j]
        if code == NORMAL:
            alone = not closing[j] and lowest_of_parabola(x, v, a) > reach
        else:
            # Deviations that differ from flank to flank are left to the whole polynomial.
            alone = never[j] or apart.shape[2] == 1
            if code == BACKLASH:
                alone &= lowest_of_parabola(-x, -v, -a) > reach
            if not never[j]:
                side = 1.0 if code == BACKLASH else -1.0
                x += apart[j, 0, 0]
                alone &= lowest_of_parabola(side * x, side * v, side * a) > reach
        clear[j] = alone
        quiet &= alone
    return quiet


@kernel
def _fall(curve, scaled, rest, to_bernstein, bernstein):
    """Return (where a curve falls through zero first, as `first_fall`; rounding of that)."""
    for k in range(rest):
        curve[k] = 0.0
    copy(curve, scaled)
    found = fall_by_shape(curve, rest) if rest < 2 else -1.0
    if found < 0.0:
        found = first_fall(curve, to_bernstein, bernstein)
    spread = 0.0
    if 0.0 <= found <= 1.0:
        for k in range(ORDER + 1):
            spread += abs(scaled[k])
        spread *= 4e-16 / abs(horner(scaled, found)[1])
    return found, spread


@kernel
def first_events(system, grid, tables, c, w, left, to_bernstein):
    """Find when each mesh crosses a flank line first; fill share, target and spread of `Work`.

    Returns the smallest share of what is left of the substep, 2 if there is none, -1 if rounding
    hides whether there is one.
    """
    m, n = system.near.shape
    scale = left / system.longest
    constants = w.z[n - 1 - 2 * grid.spin.shape[0] : n]
    look, z, curve = w.look, w.z, w.curve
    best = 2.0
    for j in range(m):
        w.share[j], code = 2.0, w.contact[j]
        if w.clear[j] and w.rest[j] == 0:
            continue
        for line in (1, -1):
            # The drive side bounds the backlash from above, the coast side from below; in contact
            # the other flank matters only where it might touch too.
            if (code == -line and not grid.closing[j]) or (line == -1 and grid.open[j]):
                continue
            side = float(line if code == line else -line)
            rest = w.rest[j] if w.line[j] == line else 0
            polynomial(look, tables.behind, m * c + j, w.behind, z, j, scale, curve)
            if line == -1:
                to_far(grid.apart, j, scale, constants, curve)
            for k in range(ORDER + 1):
                curve[k] *= side
            share, spread = _fall(curve, w.scaled, rest, to_bernstein, w.bernstein)
            if share < 0.0:
                return -1.0
            if share < w.share[j]:
                w.share[j], w.spread[j] = share, spread
                w.target[j] = next_contact(code, line)
        best = min(best, w.share[j])
    return best

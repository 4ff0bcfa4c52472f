"""Runs in many decimal digits: power series of the motion between changes of contact.

While a contact code and a segment of the mesh period last, the state z follows

    z' = A z - d z[1]^3 e_1,

with d the cubic damping. A step is as long as the terms that are left out allow, at most a quarter
of a radian of the natural oscillation, and ends where the contact code changes, which bisection
finds. Nothing is shared with the methods that are measured but the matrices of six degrees of
freedom, whose floats are taken as they are.
"""

from decimal import Decimal, getcontext, localcontext
from functools import reduce
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.models.one_mesh_system import by_phase

#: Digits carried beyond those asked for: a step rounds some thousand sums.
GUARD_DIGITS = 10
_CODES = (INVERSE, BACKLASH, NORMAL)
#: Makes arrays of decimals from arrays and lists of numbers.
decimals = np.vectorize(Decimal, otypes=[object])


class Equations(NamedTuple):
    """One model at one tuning; all arrays hold decimals."""

    matrices: dict  #: (contact code, segment) -> A, shape (n, n)
    cubic: dict  #: contact code -> d
    bounds: list  #: phases that bound the segments, 0 to 2 pi
    lines: np.ndarray  #: distances from the normal and the inverse flank line, shape (2, n)
    start: np.ndarray  #: z at rest on the normal flank line


def run(model, tuning, periods, digits, state=None):
    """Run mesh periods; return the end (x, dx/dtau), phases of events and their contact codes.

    model: `GearPair`, `SixDegreePair`, or `OneDegreePair` with cubic damping; digits: how many
    decimal digits of each step are right; state: (x, dx/dtau) at tau = 0 of one degree of freedom,
    None for rest on the normal flank line. Codes (before, after) have the shape (n, 2).
    """
    with localcontext(prec=digits + GUARD_DIGITS):
        equations = (_six_degrees if model.equation is None else _one_degree)(model, tuning)
        z, contact, phases, codes = equations.start, NORMAL, [], []
        if state is not None:
            z = decimals([*state, 1])
            # That just behind the start, which may lie on a flank line.
            ahead = z + equations.matrices[BACKLASH, 0] @ z * Decimal(10) ** -digits
            contact = _contact_of(equations.lines @ ahead)
        for period in range(periods):
            for segment, (phase, end) in enumerate(pairwise(equations.bounds)):
                while phase < end:
                    matrix, cubic = equations.matrices[contact, segment], equations.cubic[contact]
                    series = _series(matrix, cubic, z)
                    length = min(_step_length(series), Decimal(tuning) / 4, end - phase)
                    distances = (equations.lines @ series.T).tolist()
                    length, after = _end_of_step(contact, distances, length)
                    z, phase = _value(series, length), phase + length
                    if after != contact:
                        phases.append(2 * period * _pi() + phase)
                        codes.append((contact, after))
                        contact = after
        rates = equations.matrices[BACKLASH, 0] @ z
        end_state = np.array([equations.lines[0] @ z, equations.lines[0] @ rates])
        return end_state, np.array(phases, object), np.array(codes, np.int8).reshape(-1, 2)


def _one_degree(model, tuning):
    """Return the `Equations` of one degree of freedom, z = (x, dx/dtau, 1)."""
    pair, nu = model.mesh, Decimal(tuning)
    ratios = pair.contact_ratio, pair.stiffness_ratio, pair.backlash_ratio
    epsilon, kappa, backlash = map(Decimal, ratios)
    mean, matrices = kappa + (1 - kappa) * (epsilon - 1), {}
    for code in _CODES:
        ratio = Decimal(pair.damping_ratio if code else pair.backlash_damping_ratio)
        for segment, level in enumerate((Decimal(1), kappa, Decimal(1))):
            stiffness = level / mean / nu**2 if code else 0
            load = 1 / nu**2 - (stiffness * backlash if code == INVERSE else 0)
            rows = [[0, 1, 0], [-stiffness, -2 * ratio / nu, load], [0, 0, 0]]
            matrices[code, segment] = decimals(rows)
    cubic = {code: Decimal(model.equation.damping[code + 1, 2]) * nu for code in _CODES}
    far = [0, 0, 1] if backlash.is_infinite() else [1, 0, backlash]
    lines = decimals([[1, 0, 0], far])
    return Equations(matrices, cubic, _bounds(epsilon), lines, decimals([0, 0, 1]))


def _six_degrees(model, tuning):
    """Return the `Equations` of six degrees of freedom, z as in its `TrainSystem`."""
    system, turn = model.system(tuning), Decimal(model.pitch_phase)
    segments = range(system.starts.size - 1)
    matrices = {
        (code, segment): decimals(by_phase(system, [code], segment))
        for code in _CODES
        for segment in segments
    }
    # Which segments there are is known from the floats; where they end, in all digits.
    exact = _bounds(Decimal(model.pair.contact_ratio))
    exact += [(turn + k * _pi()) % (2 * _pi()) for k in range(2)]
    bounds = [min(exact, key=lambda phase: abs(float(phase) - start)) for start in system.starts]
    lines = decimals([system.drive_lines[0], system.coast_lines[0]])
    z = decimals(model.initial(system, (0.0, 0.0)))
    # At rest on the line in all digits; the first rotation is in the distance with 1.
    z[0] -= lines[0] @ z
    z[len(model.flexible()) + 2] -= lines[0] @ (matrices[BACKLASH, 0] @ z)
    return Equations(matrices, dict.fromkeys(_CODES, 0), bounds, lines, z)


def _pi():
    """Return pi in the present precision, by the iteration of Gauss and Legendre."""
    a, b, total = Decimal(1), Decimal("0.5").sqrt(), Decimal("0.25")
    for k in range(getcontext().prec.bit_length()):
        total -= 2**k * ((a - b) / 2) ** 2
        a, b = (a + b) / 2, (a * b).sqrt()
    return (a + b) ** 2 / (4 * total)


def _bounds(epsilon):
    """Return the phases that bound the segments of constant stiffness."""
    return [_pi() * share for share in (0, epsilon - 1, 3 - epsilon, 2)]


def _contact_of(distances):
    """Return the contact code at distances from the normal and the inverse flank line."""
    if distances[0] >= 0:
        return NORMAL
    return INVERSE if distances[1] < 0 else BACKLASH


def _series(matrix, cubic, z):
    """Return the coefficients of the power series of z, shape (digits + 1, n)."""
    count = getcontext().prec
    series, squares = np.zeros((count + 1, len(z)), object), np.zeros(count, object)
    series[0] = z
    for k in range(count):
        rates, speeds = matrix @ series[k], series[: k + 1, 1]
        if cubic:
            squares[k] = speeds @ speeds[::-1]
            rates[1] -= cubic * (squares[: k + 1] @ speeds[::-1])
        series[k + 1] = rates / (k + 1)
    return series


def _step_length(series):
    """Return the length at which the last two terms reach the last digit."""
    order = len(series) - 1
    exponent = np.abs(series[-2:]).max().adjusted()
    return Decimal(10.0 ** ((-getcontext().prec - exponent) / order))


def _value(series, length):
    """Return the sum of a power series, or of several, at a length."""
    return reduce(lambda value, coefficients: value * length + coefficients, series[::-1])


def _end_of_step(contact, distances, length):
    """Return (length, contact code) just behind the change of contact in a step, or at its end."""

    def contact_at(place):
        return _contact_of([_value(distance, place) for distance in distances])

    if contact_at(length) == contact:
        return length, contact
    low, high = Decimal(0), length
    for _ in range(4 * getcontext().prec):
        middle = (low + high) / 2
        low, high = (middle, high) if contact_at(middle) == contact else (low, middle)
    return high, contact_at(high)

"""Runs in as many decimal digits as are asked for: power series of the motion between its events.

The references of `gearlib.studies.trials.problems`, for any parameters of its models. While a
contact code and a segment of the mesh period last, the equation is

    z' = A z - (p |z[1]| z[1] + d z[1]^3) e_1,

linear (p = d = 0, the series is that of the matrix exponential) or with nonlinear damping. Steps
are so short that the series ends below the last digit, and with p they end where the motion turns;
the first zero of a flank line's series is isolated by bounds of its derivatives, not sampled. All
of it is Python's `decimal`, which the library has anyway: the same bytes on every machine. Nothing
is shared with the methods that are measured by it, but the matrices of six degrees of freedom,
whose floats are taken as they are.
"""

import math
from decimal import Decimal, getcontext, localcontext
from itertools import pairwise
from typing import NamedTuple

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.models.one_mesh_system import by_phase
from gearlib.models.profiles import Rectangular

#: Coefficients of a series, per digit: steps of about a radian of the fastest oscillation.
_ORDER_PER_DIGIT = 0.8
#: Digits carried beyond those asked for: a step rounds some thousand sums.
_GUARD = 10
_ZERO, _ONE = Decimal(0), Decimal(1)


class Unresolved(ArithmeticError):
    """A motion grazes a flank line beyond the digits, or its flanks jam."""


class Equations(NamedTuple):
    """One model at one tuning; rows and functionals are lists of (component, coefficient)."""

    rows: dict  #: (contact code, segment) -> rows of A
    nonlinear: dict  #: contact code -> (p, d)
    starts: list  #: phases that bound the segments, 0 to 2 pi
    near: list  #: functional y, displacement over the normal flank
    far: list  #: functional y - s, displacement over the far flank
    start: list  #: z at rest on the normal flank line


class Event(NamedTuple):
    """A crossing of a flank line."""

    phase: Decimal  #: rad from the start of the run
    before: int  #: contact codes
    after: int


class Motion(NamedTuple):
    """A run: (x, dx/dtau) at its end, and the `Event`s on the way."""

    state: tuple
    events: list


def run(model, tuning, periods, digits=50, state=(0, 0)):
    """Run mesh periods from a state at tau = 0.

    model (`GearPair`, `SixDegreePair`, or `OneDegreePair` with rectangular linear stiffness and
    neither excitation nor deviation); digits (how many decimal
    digits of the step are right; what a motion makes of them is another thing: compare two runs);
    state ((x, dx/dtau); six degrees of freedom start from rest on the line only).

    Unresolved if the motion grazes a flank line so closely that the digits do not tell whether it
    crosses, or both flanks are in contact at once; ValueError for another model.
    """
    with localcontext(prec=digits + _GUARD):
        equations = equations_of(model, tuning)
        z = list(equations.start)
        if any(state):
            z[:2] = map(Decimal, state)
        return _integrate(equations, z, periods, digits)


def equations_of(model, tuning):
    """Return the `Equations` of a model, in the digits of the present context."""
    if model.equation is None:
        return _six_degrees(model, tuning)
    return _one_degree(model, Decimal(tuning))


def _one_degree(model, nu):
    pair, equation = model.mesh, model.equation
    plain = model is pair or model.profile == Rectangular()
    if not plain or equation.powers.any() or len(equation.force) + len(equation.deviation):
        raise ValueError(
            f"model = {type(model).__name__} with these parameters is not allowed: in many digits "
            "its stiffness must be rectangular and linear, without excitation and deviation"
        )
    epsilon, kappa = Decimal(pair.contact_ratio), Decimal(pair.stiffness_ratio)
    mean = kappa + (1 - kappa) * (epsilon - 1)
    high, low = (1 / mean / nu**2, kappa / mean / nu**2)
    two_sided = math.isfinite(pair.backlash_ratio)
    gap = Decimal(pair.backlash_ratio) if two_sided else _ZERO
    rows = {}
    for code in (INVERSE, BACKLASH, NORMAL):
        ratio = pair.backlash_damping_ratio if code == BACKLASH else pair.damping_ratio
        for segment, c in enumerate((high, low, high)):
            push = [] if code == BACKLASH else [(0, -c)]
            load = 1 / nu**2 - (c * gap if code == INVERSE else 0)
            force = [*push, (1, -2 * Decimal(ratio) / nu), (2, load)]
            rows[code, segment] = [[(1, _ONE)], force, []]
    starts = [_pi() * share for share in (0, epsilon - 1, 3 - epsilon, 2)]
    far = [(0, _ONE), (2, gap)] if two_sided else [(2, _ONE)]
    damping = {
        code: (Decimal(square), Decimal(cube) * nu)
        for code, (_, square, cube) in zip(
            (INVERSE, BACKLASH, NORMAL), equation.damping.tolist(), strict=True
        )
    }
    return Equations(rows, damping, starts, [(0, _ONE)], far, [_ZERO, _ZERO, _ONE])


def _six_degrees(model, tuning):
    system = model.system(tuning)
    count = system.starts.size - 1
    rows = {
        (code, segment): [_sparse(row) for row in by_phase(system, [code], segment)]
        for code in (INVERSE, BACKLASH, NORMAL)
        for segment in range(count)
    }
    pi, epsilon, turn = _pi(), Decimal(model.pair.contact_ratio), Decimal(model.pitch_phase)
    exact = [pi * share for share in (0, epsilon - 1, 3 - epsilon, 2)]
    exact += [(turn + k * pi) % (2 * pi) for k in range(2)]
    # Which segments there are is known from the floats; where they end, in all digits.
    starts = [min(exact, key=lambda cut: abs(cut - Decimal(phase))) for phase in system.starts]
    near, far = _sparse(system.near[0]), _sparse(system.far[0])
    z = [Decimal(value) for value in model.initial(system, (0.0, 0.0)).tolist()]
    # At rest on the line in all digits, not in those of floats; u3 is in y with 1.
    z[0] -= _dot(near, z)
    z[len(model.flexible()) + 2] -= _dot(near, _image(rows[BACKLASH, 0], z))
    return Equations(
        rows, dict.fromkeys((INVERSE, BACKLASH, NORMAL), (_ZERO, _ZERO)), starts, near, far, z
    )


def _sparse(values):
    return [(i, Decimal(value)) for i, value in enumerate(values.tolist()) if value != 0.0]


def _dot(functional, z):
    return sum((a * z[i] for i, a in functional), _ZERO)


def _image(rows, z):
    return [_dot(row, z) for row in rows]


def _pi():
    """Return pi in the present context, by Machin's formula."""

    def arctan(n):
        total = term = _ONE / n
        k = 1
        while total + term / (k + 2) != total:
            k, term = k + 2, -term / n**2
            total += term / k
        return total

    with localcontext() as context:
        context.prec += 5
        pi = 16 * arctan(Decimal(5)) - 4 * arctan(Decimal(239))
    return +pi


def _integrate(equations, z, periods, digits):
    turn, tiny = equations.starts[-1], Decimal(10) ** (3 - digits)
    contact, line = _start(equations, z, tiny)
    events, turning = [], False
    for n in range(periods):
        for segment, (t, end) in enumerate(pairwise(equations.starts)):
            while t < end:
                series, length = _step(equations, contact, segment, z, digits, turning)
                left, hit, turning = end - t, None, False
                length = min(length, left)
                if equations.nonlinear[contact][0]:
                    # |v| v has a kink: the series ends where v turns.
                    rates = _from_the_line(series[1], tiny)
                    rates = rates if rates[0] > 0 else [-value for value in rates]
                    root = _first_zero(rates, length) if rates[0] > tiny else None
                    length, turning = (length, False) if root is None else (root, True)
                for exit_line, sign, after in _exits(contact):
                    course = _course(equations, exit_line, sign, series)
                    if exit_line == line:
                        course = _from_the_line(course, tiny)
                    root = _first_zero(course, length)
                    if root is not None:
                        length, hit, turning = root, (exit_line, after), False
                z = [_at(component, length) for component in series]
                if hit is None:
                    # The sum may round short of the end.
                    line, t = 0, end if length == left else t + length
                    continue
                (line, after), t = hit, t + length
                other = _dot(equations.far if line == NORMAL else equations.near, z)
                if after == BACKLASH and abs(other) < tiny:
                    # Without backlash one flank takes over from the other.
                    after = line = -contact
                elif after == BACKLASH and line * other < 0:
                    raise Unresolved("moving bearings have closed the backlash")
                events.append(Event(n * turn + t, contact, after))
                contact = after
    speed = _dot(equations.near, _image(equations.rows[BACKLASH, 0], z))
    return Motion((_dot(equations.near, z), speed), events)


def _start(equations, z, tiny):
    """Return (contact code, line that the state lies on: 1 near, -1 far, 0 none)."""
    near, far = _dot(equations.near, z), _dot(equations.far, z)
    rate = _dot(equations.near, _image(equations.rows[BACKLASH, 0], z))
    # The load pulls up what is at rest.
    if abs(near) < tiny and rate > -tiny:
        return NORMAL, NORMAL
    if abs(far) < tiny:
        return (INVERSE if rate < -tiny else BACKLASH), INVERSE
    if abs(near) < tiny:
        return BACKLASH, NORMAL
    if near > 0:
        return NORMAL, 0
    return (INVERSE if far < 0 else BACKLASH), 0


def _exits(contact):
    """Return (line, sign with which its displacement is positive here, contact code behind)."""
    if contact == NORMAL:
        return [(NORMAL, 1, BACKLASH)]
    if contact == INVERSE:
        return [(INVERSE, -1, BACKLASH)]
    return [(NORMAL, -1, NORMAL), (INVERSE, 1, INVERSE)]


def _step(equations, contact, segment, z, digits, turning):
    """Return (series of every component, length at which they end below the last digit).

    turning: whether z[1] is zero but for rounding.
    """
    order = round(_ORDER_PER_DIGIT * digits)
    rows, (square, cubic) = equations.rows[contact, segment], equations.nonlinear[contact]
    series, squares, sign = [[value] for value in z], [], 0
    if turning:
        series[1][0] = _ZERO
    for k in range(order):
        rates = [sum((a * series[i][k] for i, a in row), _ZERO) for row in rows]
        if square or cubic:
            v = series[1]
            squares.append(_product(v, v, k))
            sign = sign or (v[k] > 0) - (v[k] < 0)
            rates[1] -= square * sign * squares[k]
            if cubic:
                rates[1] -= cubic * _product(squares, v, k)
        for component, rate in zip(series, rates, strict=True):
            component.append(rate / (k + 1))
    # The last two, of which one may be small by chance.
    lengths = [
        10.0 ** ((-digits - 1 - max(c[k].copy_abs() for c in series).adjusted()) / k)
        for k in (order - 1, order)
    ]
    return series, Decimal(min(lengths))


def _product(a, b, k):
    """Return coefficient k of the product of two series."""
    return sum((a[j] * b[k - j] for j in range(k + 1)), _ZERO)


def _at(series, t):
    value = _ZERO
    for coefficient in reversed(series):
        value = value * t + coefficient
    return value


def _course(equations, line, sign, series):
    """Return the series of the displacement over a flank line, positive in this contact."""
    functional = equations.near if line == NORMAL else equations.far
    return [sign * sum(a * series[i][k] for i, a in functional) for k in range(len(series[0]))]


def _from_the_line(course, tiny):
    """Return a series that starts at zero without its factors t."""
    while len(course) > 1 and abs(course[0]) < tiny:
        course = course[1:]
    return course


def _slope(series):
    return [k * coefficient for k, coefficient in enumerate(series)][1:]


def _bound(series, t):
    """Return a bound of |series| from 0 to t."""
    return _at([abs(coefficient) for coefficient in series], t)


def _first_zero(course, length):
    """Return the first t in (0, length] behind which a series, positive at 0, is negative.

    None if there is none. By bisection, until a bound of the slope rules a zero out, or a bound of
    the curvature makes the course monotone; a zero of that is polished by Newton's method.
    """
    slope = _slope(course)
    if course[0] > length * _bound(slope, length):
        return None
    steepest, most_curved = _bound(slope, length), _bound(_slope(slope), length)
    parts, least = [(_ZERO, length)], length * _half_the_digits()
    while parts:
        low, high = parts.pop()
        middle, half = (low + high) / 2, (high - low) / 2
        if half < least:
            raise Unresolved("a flank line is touched, or crossed twice, within half the digits")
        if _at(course, middle) > half * steepest:
            continue
        if abs(_at(slope, middle)) > half * most_curved:
            if _at(course, high) < 0:
                return _polished(course, slope, low, high)
            continue
        parts += [(middle, high), (low, middle)]
    return None


def _half_the_digits():
    return Decimal(10) ** -(getcontext().prec // 2)


def _polished(course, slope, low, high):
    """Return the zero of a falling course between low, where it is positive, and high."""
    t = (low + high) / 2
    while True:
        value = _at(course, t)
        low, high = (t, high) if value > 0 else (low, t)
        new = t - value / _at(slope, t)
        if not low <= new <= high:
            new = (low + high) / 2
        # Newton's steps shrink by squares: a step of less leaves a zero right to the last digit.
        if abs(new - t) <= abs(t) * _half_the_digits() / 1000:
            return new
        t = new

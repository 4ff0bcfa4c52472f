"""Zeros of systems of equations, proven: Newton's method, then the test of Krawczyk.

With Y near the inverse of the derivative at m and a box X about m, let

    K(X) = m - Y F(m) + (I - Y F'(X)) (X - m).

If K(X) lies in the interior of X, F has exactly one zero in X, and it lies in K(X) (Krawczyk,
Computing 4 (1969) 187-201; Moore, SIAM J. Numer. Anal. 14 (1977) 611-615; Rump, Acta Numerica 19
(2010) 287-449).

A *system* is a function of a list of balls that returns residuals and rows of their derivatives
first. The test says nothing where these are not the derivatives. So they are held against a
difference of the residuals: F(b) - F(m) lies in F'(X) (b - m) if b is in X.
"""

from gearlib.analysis.proofs.balls import column_of, flint, identity
from gearlib.analysis.proofs.certificate_files import Uncertain

_MAX_NEWTON_STEPS = 12
#: Boxes that are tried for the largest one with a single zero, and the largest radius of one.
_MAX_BOXES, MAX_RADIUS = 60, 0.1
#: A derivative whose inverse is larger than this is singular.
_SINGULAR = 1e13
#: Status and sentence where the library is at fault, and where the derivative is singular.
WRONG = (
    "derivative",
    "the derivative of the equations is not that of their differences: a fault of the library",
)
FOLD = (
    "fold",
    "the derivative of the equations has no inverse: a multiplier 1 is here, or too near to tell",
)


def polish(system, start):
    """Return (midpoints of a zero near `start`, inverse of the derivative there).

    Plain Newton with midpoints, which proves nothing.
    """
    module = flint()
    zero = [value.mid() for value in start]
    # A step this small squares its error to less than rounding.
    goal = module.arb(2) ** -(0.6 * module.ctx.prec)
    for _ in range(_MAX_NEWTON_STEPS):
        residuals, rows, *_ = system(zero)
        inverse = _inverse(rows)
        steps = [step.mid() for step in times(inverse, residuals)]
        zero = [(value - step).mid() for value, step in zip(zero, steps, strict=True)]
        largest = max(abs(step) / max(1, abs(x)) for step, x in zip(steps, zero, strict=True))
        if not largest.is_finite():
            break
        if largest < goal:
            return zero, inverse
    raise Uncertain("distance", "Newton's method did not converge at the candidate")


def _inverse(rows):
    try:
        inverse = flint().arb_mat(rows).mid().inv().mid()
    except ZeroDivisionError:
        raise Uncertain(*FOLD) from None
    if not max(abs(entry) for entry in inverse.entries()) < _SINGULAR:
        raise Uncertain(*FOLD)
    return inverse


def times(matrix, values):
    """Return the product of a matrix and a list."""
    return (matrix * column_of(values)).entries()


def image(system, centre, radii, inverse, residuals):
    """Return K(X) - m for the box of `radii` about the centre m, a list of balls."""
    module = flint()
    box = [module.arb(m, r) for m, r in zip(centre, radii, strict=True)]
    _, rows, *_ = system(box)
    remainder = identity(len(centre)) - inverse * module.arb_mat(rows)
    spread = times(remainder, [module.arb(0, r) for r in radii])
    return [a - b for a, b in zip(spread, times(inverse, residuals), strict=True)]


def inside(shift, radii):
    """Return whether K(X) lies in the interior of X."""
    return all(abs(s) < r for s, r in zip(shift, radii, strict=True))


def check_derivative(system, centre, residuals):
    """Hold the derivative against a difference of the residuals, along all unknowns at once.

    Each has its own step, so that no entry that is wrong makes up for another one.
    """
    module, n = flint(), len(centre)
    # So far that differences have many digits, and so near that the derivative hardly changes.
    unit = module.arb(2) ** -(0.4 * module.ctx.prec)
    steps = [unit * max(1, abs(m)) * (n + i) / n for i, m in enumerate(centre)]
    moved = [(m + step).mid() for m, step in zip(centre, steps, strict=True)]
    steps = [b - m for m, b in zip(centre, moved, strict=True)]
    _, rows, *_ = system([m.union(b) for m, b in zip(centre, moved, strict=True)])
    moved_residuals, *_ = system(moved)
    for row, after, before in zip(rows, moved_residuals, residuals, strict=True):
        change = sum((entry * step for entry, step in zip(row, steps, strict=True)), module.arb(0))
        if not change.overlaps(after - before):
            raise Uncertain(*WRONG)


def enclose(system, centre, inverse):
    """Return a box, a list of balls, with exactly one zero of the system."""
    module = flint()
    residuals, *_ = system(centre)
    check_derivative(system, centre, residuals)
    tiny = module.arb(2) ** (24 - module.ctx.prec)
    radii = [
        (8 * abs(step) + tiny * max(1, abs(m))).upper()
        for step, m in zip(times(inverse, residuals), centre, strict=True)
    ]
    shift = image(system, centre, radii, inverse, residuals)
    if not inside(shift, radii):
        raise Uncertain(*FOLD)
    # The zero lies in the image, which is smaller than the box.
    return [m + s for m, s in zip(centre, shift, strict=True)]


def uniqueness_radius(system, centre, inverse):
    """Return a radius, a float: the box of it about `centre` has exactly one zero.

    The first radius that passes is not the largest possible one.
    """
    residuals, *_ = system(centre)
    radius = MAX_RADIUS
    for _ in range(_MAX_BOXES):
        radii = [radius] * len(centre)
        shift = image(system, centre, radii, inverse, residuals)
        if inside(shift, radii):
            # Half of it leaves room for a second program, whose enclosures are others.
            return 0.5 * radius
        share = float(max(abs(s) for s in shift).upper()) / radius
        # The share falls with the radius; where it has no bound, a much smaller box is tried.
        radius *= 0.1 if not share < 1e3 else min(0.5, 0.5 / share)
    raise Uncertain(*FOLD)

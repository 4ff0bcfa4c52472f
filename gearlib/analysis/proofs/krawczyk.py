"""Zeros of systems of equations, proven: Newton's method, then the test of Krawczyk.

With Y near the inverse of the derivative at m and a box X about m, let

    K(X) = m - Y F(m) + (I - Y F'(X)) (X - m).

If K(X) lies in the interior of X, F has exactly one zero in X, and it lies in K(X) (Krawczyk,
Computing 4 (1969) 187-201; Moore, SIAM J. Numer. Anal. 14 (1977) 611-615; Rump, Acta Numerica 19
(2010) 287-449).

A *system* is a function of a list of balls that returns (residuals, rows of their derivatives).
The test says nothing where these are not the derivatives. So they are held against a difference of
the residuals: F(b) - F(m) lies in F'(X) (b - m) if b is in X.
"""

from gearlib.analysis.proofs.balls import flint, middle
from gearlib.analysis.proofs.certificate_files import Uncertain

_MAX_NEWTON = 12
#: Boxes that are tried for the largest one with a single zero, and the first of them.
_TRIES, LARGEST = 40, 0.1
#: A derivative whose inverse is larger than this is singular.
_SINGULAR = 1e13
#: Status and sentence where the library is at fault.
WRONG = (
    "derivative",
    "the derivative of the equations is not that of their differences: a fault of the library",
)


def polish(system, start, singular):
    """Return (midpoints of a zero near `start`, inverse of the derivative there).

    Plain Newton with midpoints, which proves nothing.
    """
    module = flint()
    u = middle(start)
    # A step this small squares its error to less than rounding.
    goal = module.arb(2) ** -(0.6 * module.ctx.prec)
    for _ in range(_MAX_NEWTON):
        residuals, rows = system(u)
        inverse = _inverse(rows, singular)
        steps = middle(times(inverse, residuals))
        u = middle([value - step for value, step in zip(u, steps, strict=True)])
        largest = max(abs(step) / max(1, abs(x)) for step, x in zip(steps, u, strict=True))
        if not largest.is_finite():
            break
        if largest < goal:
            return u, inverse
    raise Uncertain("distance", "Newton's method did not converge at the candidate")


def _inverse(rows, singular):
    module = flint()
    try:
        inverse = module.arb_mat(rows).mid().inv().mid()
    except ZeroDivisionError:
        raise Uncertain(*singular) from None
    if not max(abs(entry) for entry in inverse.entries()) < _SINGULAR:
        raise Uncertain(*singular)
    return inverse


def times(matrix, values):
    """Return the product of a matrix and a list."""
    return (matrix * flint().arb_mat([[value] for value in values])).entries()


def image(system, centre, radii, inverse, residuals):
    """Return K(X) - m for the box of `radii` about the centre m, a list of balls."""
    module = flint()
    box = [module.arb(m, r) for m, r in zip(centre, radii, strict=True)]
    _, rows = system(box)
    rest = inverse * module.arb_mat(rows) * -1
    for i in range(len(centre)):
        rest[i, i] += 1
    spread = times(rest, [module.arb(0, r) for r in radii])
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
    other = [(m + step).mid() for m, step in zip(centre, steps, strict=True)]
    steps = [b - m for m, b in zip(centre, other, strict=True)]
    _, rows = system([m.union(b) for m, b in zip(centre, other, strict=True)])
    moved, _ = system(other)
    for row, after, before in zip(rows, moved, residuals, strict=True):
        slope = sum((entry * step for entry, step in zip(row, steps, strict=True)), module.arb(0))
        if not slope.overlaps(after - before):
            raise Uncertain(*WRONG)


def enclose(system, centre, inverse):
    """Return a box, a list of balls, with exactly one zero of the system; None: not proven."""
    module = flint()
    residuals, _ = system(centre)
    check_derivative(system, centre, residuals)
    tiny = module.arb(2) ** (24 - module.ctx.prec)
    steps = times(inverse, residuals)
    radii = [
        (8 * abs(step) + tiny * max(1, abs(m))).upper()
        for step, m in zip(steps, centre, strict=True)
    ]
    shift = image(system, centre, radii, inverse, residuals)
    # The zero lies in the image, which is smaller than the box.
    return [m + s for m, s in zip(centre, shift, strict=True)] if inside(shift, radii) else None


def uniqueness(system, centre, inverse, singular, largest=LARGEST):
    """Return a radius, a float: the box of it about `centre` has exactly one zero.

    `largest` is tried first. The first radius that passes is not the largest possible one.
    """
    residuals, _ = system(centre)
    radius = largest
    for _ in range(_TRIES):
        radii = [radius] * len(centre)
        shift = image(system, centre, radii, inverse, residuals)
        if inside(shift, radii):
            # Half of it leaves room for a second program, whose enclosures are others.
            return 0.5 * radius
        grown = float(max(abs(s) for s in shift).upper()) / radius
        # The share falls with the radius; where it has no bound, a much smaller box is tried.
        radius *= 0.1 if not grown < 1e3 else min(0.5, 0.5 / grown)
    raise Uncertain(*singular)

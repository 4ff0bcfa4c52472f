"""Zeros of systems of equations, proven by Krawczyk's test; eigenvalues and stability.

With Y near the inverse of the derivative at m, if K(X) = m - Y F(m) + (I - Y F'(X)) (X - m) lies in
the interior of a box X about m, F has exactly one zero in X, and it lies in K(X) (Krawczyk,
Computing 4 (1969) 187-201; Rump, Acta Numerica 19 (2010) 287-449). A *system* is a function of a
list of balls that returns residuals and rows of their derivatives first.
"""

from functools import reduce
from itertools import chain

from gearlib.analysis.proofs.balls import column_of, flint, identity
from gearlib.analysis.proofs.certificate_files import Uncertain

_MAX_NEWTON_STEPS = 12
#: Number of boxes that are tried for uniqueness, and the radius of the largest one.
_MAX_BOXES, _MAX_RADIUS = 60, 0.1
#: Largest entry of the inverse of a derivative that does not count as singular.
_MAX_INVERSE = 1e13
#: Status and sentence for an error of the library, and for a singular derivative.
WRONG = (
    "derivative",
    "the derivative of the equations is not that of their differences: a fault of the library",
)
FOLD = (
    "fold",
    "the derivative of the equations has no inverse: a multiplier 1 is here, or too near to tell",
)
#: Status and sentence for multipliers that may lie on either side of the unit circle.
UNDECIDED = "undecided", "the enclosure of a multiplier meets the unit circle"


def polish(system, start):
    """Return (zero near `start` by Newton's method, inverse of the derivative), without proof."""
    module = flint()
    zero = [value.mid() for value in start]
    # A step this small squares its error to less than rounding.
    goal = module.arb(2) ** -(0.6 * module.ctx.prec)
    for _ in range(_MAX_NEWTON_STEPS):
        residuals, rows, *_ = system(zero)
        try:
            inverse = module.arb_mat(rows).mid().inv().mid()
        except ZeroDivisionError:
            raise Uncertain(*FOLD) from None
        if not max(map(abs, inverse.entries())) < _MAX_INVERSE:
            raise Uncertain(*FOLD)
        steps = [step.mid() for step in times(inverse, residuals)]
        zero = [(value - step).mid() for value, step in zip(zero, steps, strict=True)]
        largest = max(abs(step) / max(1, abs(x)) for step, x in zip(steps, zero, strict=True))
        if not largest.is_finite():
            break
        if largest < goal:
            return zero, inverse
    raise Uncertain("distance", "Newton's method did not converge at the candidate")


def times(matrix, values):
    """Return the product of a matrix and a list as a list."""
    return (matrix * column_of(values)).entries()


def box_of(centre, radii):
    """Return balls with these centres and radii."""
    return list(map(flint().arb, centre, radii))


def image(system, centre, radii, inverse, residuals):
    """Return K(X) - m for the box of `radii` about the centre m, a list of balls."""
    _, rows, *_ = system(box_of(centre, radii))
    remainder = identity(len(centre)) - inverse * flint().arb_mat(rows)
    spread = times(remainder, box_of([0] * len(centre), radii))
    return [a - b for a, b in zip(spread, times(inverse, residuals), strict=True)]


def inside(shift, radii):
    """Return whether K(X) lies in the interior of X."""
    return all(abs(s) < r for s, r in zip(shift, radii, strict=True))


def check_derivative(system, centre, residuals):
    """Compare the derivative with a difference of the residuals; refuse if they differ.

    The difference goes along all unknowns at once.
    """
    module, n = flint(), len(centre)
    # A step so large that differences have many digits, and so small that the derivative hardly
    # changes.
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
    """Return a radius, a float, of a box about `centre` that has exactly one zero."""
    radius, (residuals, *_) = _MAX_RADIUS, system(centre)
    for _ in range(_MAX_BOXES):
        radii = [radius] * len(centre)
        try:
            shift = image(system, centre, radii, inverse, residuals)
        except Uncertain:
            radius *= 0.1
            continue
        if inside(shift, radii):
            # Half of it leaves room for the enclosures of a second program.
            return 0.5 * radius
        share = float(max(abs(s) for s in shift).upper()) / radius
        # The share decreases with the radius; if it is not bounded, a much smaller box is tried.
        radius *= 0.1 if not share < 1e3 else min(0.5, 0.5 / share)
    raise Uncertain(*FOLD)


def eigenvalues(matrix):
    """Return enclosures of all eigenvalues by Gershgorin discs, complex, the largest first."""
    module = flint()
    complex_matrix = module.acb_mat(matrix)
    _, vectors = complex_matrix.mid().eig(right=True, algorithm="approx")
    try:
        diagonal = vectors.mid().solve(complex_matrix * vectors.mid())
    except ZeroDivisionError:
        raise Uncertain("precision", "the eigenvectors of the map are not told apart") from None
    clusters: list = []
    for i, row in enumerate(diagonal.tolist()):
        radius = sum((abs(entry).upper() for j, entry in enumerate(row) if j != i), module.arb(0))
        ball = module.arb(0, radius.upper())
        disc = row[i] + module.acb(ball, ball)
        # Overlapping discs together contain as many eigenvalues as there are discs.
        touching = [cluster for cluster in clusters if any(map(disc.overlaps, cluster))]
        clusters = [cluster for cluster in clusters if cluster not in touching]
        clusters.append([disc, *chain(*touching)])
    unions = [[reduce(lambda a, b: a.union(b), cluster)] * len(cluster) for cluster in clusters]
    values = list(chain(*unions))
    values = [_real(value, values) for value in values]
    return sorted(values, key=lambda value: (-float(abs(value).mid()), -float(value.imag.mid())))


def _real(value, values):
    """Return an eigenvalue, as a real ball if its conjugate can be no other eigenvalue."""
    conjugate = flint().acb(value.real, -value.imag)
    if sum(map(conjugate.overlaps, values)) == 1 and conjugate.overlaps(value):
        return flint().acb(value.real)
    return value


def verdict(multipliers, matrix, determinant):
    """Return (stability, reason) by enclosures of the Floquet multipliers.

    For two multipliers with a known determinant Jury's conditions decide.
    """
    outside = any(abs(value) > 1 for value in multipliers)
    inside, name = all(abs(value) < 1 for value in multipliers), "all"
    if matrix.nrows() == 2 and determinant is not None:
        trace, name = abs(matrix.trace()), "both"
        outside = determinant > 1 or trace > 1 + determinant
        inside = determinant < 1 and trace < 1 + determinant
        if determinant == 1 and trace < 2:
            return (
                "undecided",
                "nothing is damped on its way: both multipliers lie on the unit circle, exactly, "
                "and decide nothing",
            )
    if outside:
        return "unstable", "a multiplier lies outside the unit circle"
    if inside:
        return "stable", f"{name} multipliers lie inside the unit circle"
    return UNDECIDED

"""Zeros of systems of equations, proven by Krawczyk's test; eigenvalues and stability.

With Y near the inverse of the derivative at m, if K(X) = m - Y F(m) + (I - Y F'(X)) (X - m) lies in
the interior of a box X about m, F has exactly one zero in X, and it lies in K(X) (Krawczyk,
Computing 4 (1969) 187-201; Rump, Acta Numerica 19 (2010) 287-449). A *system* is a function of the
unknowns, a list of balls. Its first results are residuals and rows of their derivatives.
"""

from collections.abc import Callable
from functools import reduce
from itertools import chain
from typing import Any

from gearlib.analysis.proofs.balls import column_of, flint, identity
from gearlib.analysis.proofs.certificate_files import Uncertain

#: Newton's method doubles the digits in each step, so few steps suffice for any precision.
_MAX_NEWTON_STEPS = 12
#: Number of boxes that are tried for uniqueness, and the radius of the largest one.
_MAX_BOXES, _MAX_RADIUS = 60, 0.1
#: Largest entry of the inverse of a derivative that does not count as singular.
_MAX_INVERSE = 1e13
#: Status and sentence for a wrong derivative, which is an error of the library.
WRONG_DERIVATIVE = (
    "derivative",
    "the derivative of the equations is not that of their differences: a fault of the library",
)
#: Status and sentence for a singular derivative.
FOLD = (
    "fold",
    "the derivative of the equations has no inverse: a multiplier 1 is here, or too near to tell",
)
#: Status and sentence for multipliers that may lie on either side of the unit circle.
UNDECIDED = "undecided", "the enclosure of a multiplier meets the unit circle"


def polish(system: Callable, start: list) -> tuple[list, Any]:
    """Return (zero of a system near a start, inverse of the derivative there), without proof.

    ``system(unknowns)`` returns residuals and rows of derivatives, as lists of balls. The zero is
    found by Newton's method on the midpoints of the balls.
    """
    module = flint()
    zero = [value.mid() for value in start]
    # After a step this small the error, its square, is below rounding.
    tolerance = module.arb(2) ** -(0.6 * module.ctx.prec)
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
        if largest < tolerance:
            return zero, inverse
    raise Uncertain("distance", "Newton's method did not converge at the candidate")


def times(matrix: Any, values: list) -> list:
    """Return the product of a matrix of balls and a vector, both vectors as lists."""
    return (matrix * column_of(values)).entries()


def box_of(centre: list, radii: list) -> list:
    """Return the list of balls with given centres and radii."""
    return list(map(flint().arb, centre, radii))


def image(system: Callable, centre: list, radii: list, inverse: Any, residuals: list) -> list:
    """Return K(X) - m, Krawczyk's image of the box X about its centre m, as a list of balls.

    ``system(unknowns)`` returns residuals and rows of derivatives. The inverse is near that of the
    derivative at the centre, where the system has the residuals.
    """
    _, rows, *_ = system(box_of(centre, radii))
    remainder = identity(len(centre)) - inverse * flint().arb_mat(rows)
    spread = times(remainder, box_of([0] * len(centre), radii))
    newton_step = times(inverse, residuals)
    return [width - step for width, step in zip(spread, newton_step, strict=True)]


def is_inside(shift: list, radii: list) -> bool:
    """Return whether a box K(X) - m lies in the interior of the box X - m with given radii."""
    return all(abs(ball) < radius for ball, radius in zip(shift, radii, strict=True))


def check_derivative(system: Callable, centre: list, residuals: list) -> None:
    """Compare the derivative of a system with a difference; raise `Uncertain` if they differ.

    ``system(unknowns)`` returns residuals, given at the centre, and rows of derivatives. The
    difference of residuals goes along all unknowns at once.
    """
    module, n = flint(), len(centre)
    # The step is large enough for a difference with many digits, and small enough for a nearly
    # constant derivative.
    step_size = module.arb(2) ** -(0.4 * module.ctx.prec)
    steps = [step_size * max(1, abs(m)) * (n + i) / n for i, m in enumerate(centre)]
    moved = [(m + step).mid() for m, step in zip(centre, steps, strict=True)]
    steps = [end - m for m, end in zip(centre, moved, strict=True)]
    between = [m.union(end) for m, end in zip(centre, moved, strict=True)]
    derivative_rows = system(between)[1]
    moved_residuals = system(moved)[0]
    for row, after, before in zip(derivative_rows, moved_residuals, residuals, strict=True):
        change = sum((entry * step for entry, step in zip(row, steps, strict=True)), module.arb(0))
        if not change.overlaps(after - before):
            raise Uncertain(*WRONG_DERIVATIVE)


def enclose(system: Callable, centre: list, inverse: Any) -> list:
    """Return a box, a list of balls, that is proven to hold exactly one zero of a system.

    ``system(unknowns)`` returns residuals and rows of derivatives; the inverse is near that of the
    derivative at the centre, which is near the zero.
    """
    module = flint()
    residuals, *_ = system(centre)
    check_derivative(system, centre, residuals)
    tiny = module.arb(2) ** (24 - module.ctx.prec)
    radii = [
        (8 * abs(step) + tiny * max(1, abs(m))).upper()
        for step, m in zip(times(inverse, residuals), centre, strict=True)
    ]
    shift = image(system, centre, radii, inverse, residuals)
    if not is_inside(shift, radii):
        raise Uncertain(*FOLD)
    # The zero lies in the image, which is smaller than the box.
    return [m + s for m, s in zip(centre, shift, strict=True)]


def uniqueness_radius(system: Callable, centre: list, inverse: Any) -> float:
    """Return the radius of a box about a centre that is proven to hold exactly one zero.

    ``system(unknowns)`` returns residuals and rows of derivatives; the inverse is near that of the
    derivative at the centre.
    """
    radius, (residuals, *_) = _MAX_RADIUS, system(centre)
    for _ in range(_MAX_BOXES):
        radii = [radius] * len(centre)
        try:
            shift = image(system, centre, radii, inverse, residuals)
        except Uncertain:
            radius *= 0.1
            continue
        if is_inside(shift, radii):
            # Half of the radius leaves room for the wider enclosures of a second program.
            return 0.5 * radius
        share = float(max(abs(s) for s in shift).upper()) / radius
        # The share decreases with the radius; if it is not bounded, a much smaller box is tried.
        radius *= 0.1 if not share < 1e3 else min(0.5, 0.5 / share)
    raise Uncertain(*FOLD)


def eigenvalues(matrix: Any) -> list:
    """Return enclosures of all eigenvalues of a matrix of balls as complex balls, largest first.

    They are Gershgorin discs of the matrix in the basis of its approximate eigenvectors.
    """
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
    values = [_real_if_single(value, values) for value in values]
    return sorted(values, key=lambda value: (-float(abs(value).mid()), -float(value.imag.mid())))


def _real_if_single(value: Any, values: list) -> Any:
    """Return an eigenvalue, as a real ball if no other one of `values` can be its conjugate."""
    conjugate = flint().acb(value.real, -value.imag)
    if sum(map(conjugate.overlaps, values)) == 1 and conjugate.overlaps(value):
        return flint().acb(value.real)
    return value


def verdict(multipliers: list, matrix: Any, determinant: Any) -> tuple[str, str]:
    """Return (stability, reason) of an orbit with enclosures of its Floquet multipliers.

    For two multipliers and a determinant of the monodromy matrix that is not None, Jury's
    conditions decide.
    """
    is_unstable = any(abs(value) > 1 for value in multipliers)
    is_stable, name = all(abs(value) < 1 for value in multipliers), "all"
    if matrix.nrows() == 2 and determinant is not None:
        trace, name = abs(matrix.trace()), "both"
        is_unstable = determinant > 1 or trace > 1 + determinant
        is_stable = determinant < 1 and trace < 1 + determinant
        if determinant == 1 and trace < 2:
            return (
                "undecided",
                "nothing is damped on its way: both multipliers lie on the unit circle, exactly, "
                "and decide nothing",
            )
    if is_unstable:
        return "unstable", "a multiplier lies outside the unit circle"
    if is_stable:
        return "stable", f"{name} multipliers lie inside the unit circle"
    return UNDECIDED

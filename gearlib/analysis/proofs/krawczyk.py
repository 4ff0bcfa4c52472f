"""Proofs of zeros of systems of equations by Krawczyk's test; eigenvalues and stability.

Let Y be an approximate inverse of the Jacobian matrix of F at m. If the set K(X) = m - Y F(m) + (I
- Y F'(X)) (X - m) lies in the interior of a box X around m, F has exactly one zero in X, and this
zero lies in K(X) (Krawczyk, Computing 4 (1969) 187-201; Rump, Acta Numerica 19 (2010) 287-449). A
*system* is a function of the unknowns, a list of balls (intervals with error bounds), that returns
(residuals, rows of their Jacobian matrix, ...).
"""

from collections.abc import Callable
from functools import reduce
from itertools import chain
from typing import Any

from gearlib.analysis.proofs.balls import flint, identity, to_column
from gearlib.analysis.proofs.certificate_files import ProofFailed

#: Newton's method doubles the number of digits per step, so a few steps suffice.
_MAX_NEWTON_STEPS = 12
#: Largest number of boxes that are tested for uniqueness, and radius of the first box.
_MAX_BOXES, _MAX_RADIUS = 60, 0.1
#: A Jacobian matrix counts as singular if its inverse has a larger entry than this.
_MAX_INVERSE = 1e13
#: Status and message for a wrong derivative, a bug in gearlib.
WRONG_DERIVATIVE = (
    "derivative",
    "the Jacobian matrix does not agree with finite differences: this is a bug in gearlib",
)
#: Status and message for a singular Jacobian matrix.
FOLD = (
    "fold",
    "the Jacobian matrix may be singular: a Floquet multiplier is 1 or too close to 1",
)
#: Status and message for multipliers that may lie on either side of the unit circle.
UNDECIDED = "undecided", "the enclosure of a multiplier intersects the unit circle"


def refine_zero(system: Callable, start: list) -> tuple[list, Any]:
    """Refine an approximate zero of a system of equations by Newton's method.

    `system` returns (residuals, rows of their Jacobian matrix, ...) for a list of unknowns, and
    `start` is the initial guess. Return (zero, inverse of the Jacobian matrix there). Both are
    approximate: balls (intervals) of radius 0. Raise `ProofFailed` if the matrix is singular or the
    method does not converge.
    """
    module = flint()
    zero = [value.mid() for value in start]
    # The error after a step is of the order of its square, here below the rounding error.
    tolerance = module.arb(2) ** -(0.6 * module.ctx.prec)
    for _ in range(_MAX_NEWTON_STEPS):
        residuals, rows, *_ = system(zero)
        # Midpoints of balls are sufficient, because the zero is only approximate.
        try:
            inverse = module.arb_mat(rows).mid().inv().mid()
        except ZeroDivisionError:
            raise ProofFailed(*FOLD) from None
        if not max(map(abs, inverse.entries())) < _MAX_INVERSE:
            raise ProofFailed(*FOLD)
        steps = [step.mid() for step in matrix_vector_product(inverse, residuals)]
        zero = [(value - step).mid() for value, step in zip(zero, steps, strict=True)]
        max_step = max(
            abs(step) / max(1, abs(value)) for step, value in zip(steps, zero, strict=True)
        )
        if not max_step.is_finite():
            break
        if max_step < tolerance:
            return zero, inverse
    raise ProofFailed("distance", "Newton's method did not converge at the candidate")


def matrix_vector_product(matrix: Any, values: list) -> list:
    """Return the product of a matrix of balls and a list of balls as a list."""
    return (matrix * to_column(values)).entries()


def krawczyk_shift(system: Callable, centre, radii, inverse: Any, residuals: list) -> list:
    """Return K(X) - m for the Krawczyk operator K and a box X with the centre m, a list of balls.

    K(X) - m = (I - Y F'(X)) (X - m) - Y F(m). `centre` is m, `radii` are the half widths of the box
    X, `inverse` is Y, an approximate inverse of the Jacobian matrix F'(m), and `residuals` are
    F(m). `system` returns (residuals F, rows of their Jacobian matrix, ...) for a list of balls
    (intervals).
    """
    arb = flint().arb
    # The Jacobian matrix of the whole box encloses the Jacobian matrices at all of its points.
    _, rows, *_ = system(list(map(arb, centre, radii)))
    remainder = identity(len(centre)) - inverse * flint().arb_mat(rows)
    spread = matrix_vector_product(remainder, [arb(0, radius) for radius in radii])
    newton_step = matrix_vector_product(inverse, residuals)
    return [ball - step for ball, step in zip(spread, newton_step, strict=True)]


def maps_into_interior(shift: list, radii: list) -> bool:
    """Return whether the Krawczyk operator maps a box X into its interior.

    If so, the system of equations has exactly one zero in X. `shift` is K(X) - m, a result of
    `krawczyk_shift`, where m is the centre of X, and `radii` are the half widths of X.
    """
    return all(abs(ball) < radius for ball, radius in zip(shift, radii, strict=True))


def check_derivative(system: Callable, centre: list, residuals: list) -> None:
    """Raise `ProofFailed` if the Jacobian matrix contradicts a finite difference of the residuals.

    `system` returns (residuals, rows of their Jacobian matrix, ...) for a list of balls
    (intervals); `residuals` are its values at the unknowns `centre`. All unknowns are changed at
    once by a small step. By the mean value theorem, the change of the residuals lies in the product
    of the step and an enclosure of the Jacobian matrix along the step.
    """
    module, n = flint(), len(centre)
    # The step is large enough for an accurate difference and small enough for a nearly constant
    # derivative.
    step_size = module.arb(2) ** -(0.4 * module.ctx.prec)
    # Different steps prevent errors in several columns of the matrix from cancelling.
    steps = [step_size * max(1, abs(value)) * (n + i) / n for i, value in enumerate(centre)]
    shifted = [(value + step).mid() for value, step in zip(centre, steps, strict=True)]
    # The end of the step has been rounded, so the step is computed again.
    steps = [end - value for value, end in zip(centre, shifted, strict=True)]
    hull = [value.union(end) for value, end in zip(centre, shifted, strict=True)]
    jacobian_rows = system(hull)[1]
    shifted_residuals = system(shifted)[0]
    for row, after, before in zip(jacobian_rows, shifted_residuals, residuals, strict=True):
        change = sum((entry * step for entry, step in zip(row, steps, strict=True)), module.arb(0))
        if not change.overlaps(after - before):
            raise ProofFailed(*WRONG_DERIVATIVE)


def enclose_zero(system: Callable, centre: list, inverse: Any) -> list:
    """Return a box, a list of balls, that is proven to contain exactly one zero of a system.

    `system` returns (residuals, rows of their Jacobian matrix, ...) for a list of balls (intervals
    with error bounds). `centre` is an approximate zero and `inverse` the approximate inverse of the
    Jacobian matrix there, from `refine_zero`. Raise `ProofFailed` if Krawczyk's test fails.
    """
    module = flint()
    residuals, *_ = system(centre)
    check_derivative(system, centre, residuals)
    smallest_radius = module.arb(2) ** (24 - module.ctx.prec)
    # The box is wider than the last Newton step and the rounding error.
    radii = [
        (8 * abs(step) + smallest_radius * max(1, abs(value))).upper()
        for step, value in zip(matrix_vector_product(inverse, residuals), centre, strict=True)
    ]
    shift = krawczyk_shift(system, centre, radii, inverse, residuals)
    if not maps_into_interior(shift, radii):
        raise ProofFailed(*FOLD)
    # The zero lies in the image of the box under the Krawczyk operator, which is smaller.
    return [value + ball for value, ball in zip(centre, shift, strict=True)]


def uniqueness_radius(system: Callable, centre: list, inverse: Any) -> float:
    """Return the radius of a box around `centre` that is proven to contain exactly one zero.

    `system` returns (residuals, rows of their Jacobian matrix, ...) for a list of balls. `centre`
    is an approximate zero and `inverse` the approximate inverse of the Jacobian matrix there, from
    `refine_zero`. The box has the same half width in all unknowns, and is reduced until it passes
    Krawczyk's test. Return half of this half width, at most half of _MAX_RADIUS.
    """
    residuals, *_ = system(centre)
    radius = _MAX_RADIUS
    for _ in range(_MAX_BOXES):
        radii = [radius] * len(centre)
        try:
            shift = krawczyk_shift(system, centre, radii, inverse, residuals)
        except ProofFailed:
            # The box is too large to evaluate the equations.
            radius *= 0.1
            continue
        if maps_into_interior(shift, radii):
            # Half of the radius allows for wider enclosures in an independent program.
            return 0.5 * radius
        # The relative size of the image decreases with the radius, so a moderate ratio indicates
        # how much smaller the box must be.
        ratio = float(max(abs(ball) for ball in shift).upper()) / radius
        if ratio < 1e3:
            radius *= min(0.5, 0.5 / ratio)
        else:
            radius *= 0.1
    raise ProofFailed(*FOLD)


def eigenvalues(matrix: Any) -> list:
    """Return complex balls that enclose all eigenvalues of a matrix, largest modulus first.

    The entries of the matrix are balls (intervals with error bounds). The enclosures are the
    Gershgorin discs of the matrix in the basis of its approximate eigenvectors, in which it is
    nearly diagonal. Each of several overlapping discs is replaced by a ball around their union.
    """
    module = flint()
    complex_matrix = module.acb_mat(matrix)
    _, vectors = complex_matrix.mid().eig(right=True, algorithm="approx")
    try:
        diagonal = vectors.mid().solve(complex_matrix * vectors.mid())
    except ZeroDivisionError:
        raise ProofFailed("precision", "the eigenvectors may be linearly dependent") from None
    clusters: list = []  # lists of discs that overlap
    for i, row in enumerate(diagonal.tolist()):
        other_entries = [entry for j, entry in enumerate(row) if j != i]
        radius = sum((abs(entry).upper() for entry in other_entries), module.arb(0))
        ball = module.arb(0, radius.upper())
        disc = row[i] + module.acb(ball, ball)
        # The union of overlapping discs contains as many eigenvalues as there are discs.
        overlapping = [cluster for cluster in clusters if any(map(disc.overlaps, cluster))]
        clusters = [cluster for cluster in clusters if cluster not in overlapping]
        clusters.append([disc, *chain(*overlapping)])
    enclosures: list = []
    for cluster in clusters:
        union = reduce(lambda disc, other: disc.union(other), cluster)
        enclosures += [union] * len(cluster)
    values = enclosures.copy()
    for i, value in enumerate(values):
        conjugate = module.acb(value.real, -value.imag)
        # An eigenvalue is real if no other eigenvalue can be its conjugate.
        if conjugate.overlaps(value) and sum(map(conjugate.overlaps, enclosures)) == 1:
            values[i] = module.acb(value.real)
    return sorted(values, key=lambda value: (-float(abs(value).mid()), -float(value.imag.mid())))


def stability_verdict(multipliers: list, matrix: Any, determinant: Any) -> tuple[str, str]:
    """Return (stability, reason) of an orbit from its Floquet multipliers and monodromy matrix.

    `multipliers` are complex balls (intervals with error bounds), so each comparison is a proof.
    The stability is "stable", "unstable" or "undecided". `determinant` is an enclosure of the
    determinant of `matrix` that is narrower than a computation from the matrix, or None. If it is
    given and the matrix is 2 x 2, Jury's conditions for trace and determinant are used instead of
    the multipliers: with determinant 1 and |trace| < 2 both multipliers lie exactly on the unit
    circle.
    """
    is_unstable = any(abs(value) > 1 for value in multipliers)
    is_stable = all(abs(value) < 1 for value in multipliers)
    quantifier = "all"
    if matrix.nrows() == 2 and determinant is not None:
        trace, quantifier = abs(matrix.trace()), "both"
        is_unstable = determinant > 1 or trace > 1 + determinant
        is_stable = determinant < 1 and trace < 1 + determinant
        if determinant == 1 and trace < 2:
            text = (
                "both multipliers lie exactly on the unit circle, which does not decide stability"
            )
            return "undecided", f"the orbit is undamped: {text}"
    if is_unstable:
        return "unstable", "a multiplier lies outside the unit circle"
    if is_stable:
        return "stable", f"{quantifier} multipliers lie inside the unit circle"
    return UNDECIDED

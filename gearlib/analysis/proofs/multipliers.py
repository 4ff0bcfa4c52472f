"""Eigenvalues of a real matrix of balls, enclosed, multiple ones too; what they say of stability.

In the basis of approximate eigenvectors, whose inverse is enclosed, the matrix is nearly diagonal:
its eigenvalues lie in the discs of Gershgorin about the diagonal, m of them in m discs that hang
together and meet no other (Varga, *Gersgorin and His Circles*, 2004).
"""

from gearlib.analysis.proofs.balls import flint
from gearlib.analysis.proofs.certificate_files import Uncertain

#: Where the enclosures of multipliers decide nothing.
UNDECIDED = "undecided", "the enclosure of a multiplier meets the unit circle"


def eigenvalues(matrix):
    """Return enclosures of all eigenvalues, the largest first: complex balls."""
    module = flint()
    whole = module.acb_mat(matrix)
    _, vectors = whole.mid().eig(right=True, algorithm="approx")
    try:
        near = vectors.mid().solve(whole * vectors.mid())
    except ZeroDivisionError:
        raise Uncertain("precision", "the eigenvectors of the map are not told apart") from None
    discs = []
    for i in range(near.nrows()):
        radius = sum(
            (abs(near[i, j]).upper() for j in range(near.ncols()) if j != i), module.arb(0)
        )
        discs.append(near[i, i] + _square(radius))
    found = []
    while discs:
        # Each of the discs that hang together holds none, or one, or more of their eigenvalues.
        cluster, others = [discs.pop()], discs
        while True:
            joined = [disc for disc in others if any(disc.overlaps(one) for one in cluster)]
            if not joined:
                break
            others = [disc for disc in others if not any(disc.overlaps(one) for one in cluster)]
            cluster += joined
        discs = others
        whole = cluster[0]
        for one in cluster[1:]:
            whole = whole.union(one)
        found += [whole] * len(cluster)
    found = [_real(one, found) for one in found]
    return sorted(found, key=lambda one: (-float(abs(one).mid()), -float(one.imag.mid())))


def _square(radius):
    ball = flint().arb(0, radius.upper())
    return flint().acb(ball, ball)


def _real(one, found):
    """Return an eigenvalue with the imaginary part 0 where its conjugate can be no other one."""
    conjugate = flint().acb(one.real, -one.imag)
    if sum(conjugate.overlaps(other) for other in found) == 1 and conjugate.overlaps(one):
        return flint().acb(one.real)
    return one


def judge(multipliers):
    """Return (stability, reason) from the enclosures of all multipliers."""
    if any(abs(one) > 1 for one in multipliers):
        return "unstable", "a multiplier lies outside the unit circle"
    if all(abs(one) < 1 for one in multipliers):
        return "stable", "all multipliers lie inside the unit circle"
    return UNDECIDED


def of_two(trace, determinant):
    """Return the eigenvalues of a map of two components, the larger first."""
    module, half = flint(), trace / 2
    acb, square = module.acb, half * half - determinant
    if square < 0:
        root = (-square).sqrt()
        return acb(half, root), acb(half, -root)
    if square > 0:
        root = square.sqrt()
        # The larger root without cancellation, the other by the product.
        large = half + root if trace > 0 else half - root
        return acb(large), acb(determinant / large)
    size = module.arb(0, abs(square).upper().sqrt().upper())
    return (acb(half + size, size),) * 2


def judge_two(trace, determinant):
    """Return (stability, reason): Jury's conditions on trace and determinant."""
    if determinant > 1 or abs(trace) > 1 + determinant:
        return "unstable", "a multiplier lies outside the unit circle"
    if determinant < 1 and abs(trace) < 1 + determinant:
        return "stable", "both multipliers lie inside the unit circle"
    if determinant == 1 and abs(trace) < 2:
        return (
            "undecided",
            "nothing is damped on its way: both multipliers lie on the unit circle, exactly, and "
            "decide nothing",
        )
    return UNDECIDED


def verdict(matrix, determinant):
    """Return (stability, reason) from a map of small deviations and its determinant."""
    if matrix.nrows() == 2:
        return judge_two(matrix[0, 0] + matrix[1, 1], determinant)
    return judge(eigenvalues(matrix))

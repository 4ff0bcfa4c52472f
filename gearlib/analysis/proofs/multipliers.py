"""Eigenvalues of a real matrix of balls, enclosed, multiple ones too; what they say of stability.

In the basis of approximate eigenvectors, whose inverse is enclosed, the matrix is nearly diagonal:
its eigenvalues lie in the discs of Gershgorin about the diagonal, m of them in m discs that hang
together and meet no other (Varga, *Gersgorin and His Circles*, 2004).
"""

from functools import reduce
from itertools import chain

from gearlib.analysis.proofs.balls import flint
from gearlib.analysis.proofs.certificate_files import Uncertain

#: Where the enclosures of multipliers decide nothing.
UNDECIDED = "undecided", "the enclosure of a multiplier meets the unit circle"


def eigenvalues(matrix):
    """Return enclosures of all eigenvalues, the largest first: complex balls."""
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
        # Discs that hang together hold as many eigenvalues as they are, each none, one or more.
        touching = [cluster for cluster in clusters if any(map(disc.overlaps, cluster))]
        clusters = [cluster for cluster in clusters if cluster not in touching]
        clusters.append([disc, *chain(*touching)])
    values = []
    for cluster in clusters:
        values += [reduce(lambda a, b: a.union(b), cluster)] * len(cluster)
    values = [_real(value, values) for value in values]
    return sorted(values, key=lambda value: (-float(abs(value).mid()), -float(value.imag.mid())))


def _real(value, values):
    """Return an eigenvalue with the imaginary part 0 where its conjugate can be no other one."""
    conjugate = flint().acb(value.real, -value.imag)
    if sum(map(conjugate.overlaps, values)) == 1 and conjugate.overlaps(value):
        return flint().acb(value.real)
    return value


def verdict(multipliers, matrix, determinant):
    """Return (stability, reason) from a map of small deviations and its multipliers.

    Where the determinant is known, trace and determinant of two multipliers are judged, by Jury's
    conditions.
    """
    outside = any(abs(value) > 1 for value in multipliers)
    inside, name = all(abs(value) < 1 for value in multipliers), "all"
    if matrix.nrows() == 2 and determinant is not None:
        trace, name = abs(matrix[0, 0] + matrix[1, 1]), "both"
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

"""Enclosures hold what they have to, and are hardly wider than that."""

from flint import acb, arb, arb_mat

from gearlib.analysis.proofs.balls import precision
from gearlib.analysis.proofs.krawczyk import eigenvalues, stability_verdict


def test_multiple_eigenvalues_are_enclosed():
    """Enclose the eigenvalues of a transformed matrix, one of which is double and defective."""
    with precision(128):
        # The eigenvalues are 1/2, double with one eigenvector, a pair on the unit circle, and -2.
        rows = [[0.5, 1, 0, 0, 0], [0, 0.5, 0, 0, 0], [0, 0, 0.6, -0.8, 0], [0, 0, 0.8, 0.6, 0]]
        matrix = arb_mat([*rows, [0, 0, 0, 0, -2]])
        transformation = arb_mat(
            [[arb(1) / (i + j + 1) + (i == j) for j in range(5)] for i in range(5)]
        )
        values = eigenvalues(transformation.solve(matrix * transformation))
    approximate_values = [-2, complex(0.6, 0.8), complex(0.6, -0.8), 0.5, 0.5]
    exact = [acb(-2), acb(arb(0.6), arb(0.8)), acb(arb(0.6), arb(-0.8)), acb(0.5), acb(0.5)]
    for ball, value, number in zip(values, approximate_values, exact, strict=True):
        assert ball.contains(number) and abs(complex(ball.mid()) - value) < 1e-15
    # A simple real eigenvalue is proven to be real, but not the two that coincide.
    assert values[0].imag == 0 and values[3].imag.rad() > 0
    verdicts = {0: "unstable", 3: "stable", 1: "undecided"}
    for first, stability in verdicts.items():
        assert stability_verdict(values[first:], matrix, None)[0] == stability


def test_eigenvalues_of_all_matrices_of_a_ball_are_enclosed():
    """Enclose 1.5 +- sqrt(0.25 + a^2), the eigenvalues of [[1, a], [a, 2]] with |a| <= 0.1."""
    with precision(128):
        values = eigenvalues(arb_mat([[1, arb(0, 0.1)], [arb(0, 0.1), 2]]))
        for off in (-0.1, 0.0, 0.1):
            for enclosure, sign in zip(values, (1, -1), strict=True):
                assert enclosure.contains(acb(1.5 + sign * (arb(0.25) + arb(off) ** 2).sqrt()))

"""Enclosures of eigenvalues contain the exact values and are hardly wider than necessary."""

from flint import acb, arb, arb_mat

from gearlib.analysis.proofs.balls import precision
from gearlib.analysis.proofs.krawczyk import eigenvalues, stability_verdict


def test_multiple_eigenvalues_are_enclosed():
    """Enclosures must contain the known eigenvalues of a matrix, one double and defective.

    A similarity transformation hides the eigenvalues without changing them.
    """
    with precision(128):
        # The eigenvalues are 1/2 (double, with one eigenvector), 0.6 +- 0.8 i on the unit circle,
        # and -2.
        rows = [[0.5, 1, 0, 0, 0], [0, 0.5, 0, 0, 0], [0, 0, 0.6, -0.8, 0], [0, 0, 0.8, 0.6, 0]]
        matrix = arb_mat([*rows, [0, 0, 0, 0, -2]])
        transformation = arb_mat(
            [[arb(1) / (i + j + 1) + (i == j) for j in range(5)] for i in range(5)]
        )
        values = eigenvalues(transformation.solve(matrix * transformation))
    approximate_values = [-2, complex(0.6, 0.8), complex(0.6, -0.8), 0.5, 0.5]
    exact_values = [acb(-2), acb(arb(0.6), arb(0.8)), acb(arb(0.6), arb(-0.8)), acb(0.5), acb(0.5)]
    for ball, approximate, exact in zip(values, approximate_values, exact_values, strict=True):
        assert ball.contains(exact) and abs(complex(ball.mid()) - approximate) < 1e-15
    # A simple real eigenvalue is proven to be real, but not the two that coincide.
    assert values[0].imag == 0 and values[3].imag.rad() > 0
    # All eigenvalues include -2; the last two are 1/2; the last four include the unit circle.
    expected_verdicts = {5: "unstable", 2: "stable", 4: "undecided"}
    for count, expected in expected_verdicts.items():
        verdict, *_ = stability_verdict(values[-count:], matrix, None)
        assert verdict == expected


def test_eigenvalues_of_all_matrices_of_a_ball_are_enclosed():
    """The matrices [[1, a], [a, 2]] with |a| <= 0.1 have eigenvalues 1.5 +- sqrt(0.25 + a^2)."""
    with precision(128):
        values = eigenvalues(arb_mat([[1, arb(0, 0.1)], [arb(0, 0.1), 2]]))
        for a in (-0.1, 0.0, 0.1):
            root = (arb(0.25) + arb(a) ** 2).sqrt()
            larger, smaller = values
            assert larger.contains(acb(1.5 + root)) and smaller.contains(acb(1.5 - root))

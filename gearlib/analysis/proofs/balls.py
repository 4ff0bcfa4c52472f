"""Ball arithmetic with python-flint, and conversions between balls, numbers and decimals.

A ball is an interval with a midpoint and a radius. An operation of Arb returns a ball that contains
the results for all numbers in its operands (Johansson, IEEE Transactions on Computers 66 (2017)
1281-1292). A comparison of balls is true only if it holds for all numbers in them, so that the
inequality is proven.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any

import numpy as np

#: Number of reliable digits of a ball with the radius 0.
_EXACT_DIGITS = 10**6


def flint() -> Any:
    """Import and return python-flint; raise ImportError with the install command if it is missing.

    The import is late, because only proofs need this optional package.
    """
    try:
        import flint as module
    except ImportError:
        raise ImportError(
            "proofs need python-flint, which is not installed: pip install 'gearlib[proof]'"
        ) from None
    return module


@contextmanager
def precision(bits: int):
    """Set the precision of ball arithmetic in bits for a ``with`` block; yield the class of balls.

    Balls are intervals with guaranteed error bounds; their class is ``arb`` of python-flint. The
    previous precision is restored at the end of the block.
    """
    with flint().ctx.workprec(bits):
        yield flint().arb


def to_ball(fraction: Fraction) -> Any:
    """Convert a rational number to a ball (flint's ``arb``) that contains it."""
    return flint().arb(fraction.numerator) / fraction.denominator


def to_column(values: list) -> Any:
    """Convert a list of n balls or numbers to a column matrix of balls, shape (n, 1)."""
    return flint().arb_mat([[value] for value in values])


def to_matrix(array: np.ndarray) -> Any:
    """Convert a two-dimensional array of balls or numbers to a matrix of balls."""
    return flint().arb_mat(array.tolist())


def first_column(matrix: Any) -> Any:
    """Return the first column of a matrix of balls, shape (n, 1)."""
    return to_column([row[0] for row in matrix.tolist()])


def identity(n: int) -> Any:
    """Return the identity matrix of balls, shape (n, n)."""
    return flint().arb_mat(n, n, 1)


def norm_bound(matrix: Any) -> Any:
    """Return an upper bound of the infinity norm (largest row sum) of a matrix of balls."""
    row_sums = [sum(map(abs, row), flint().arb(0)) for row in matrix.tolist()]
    return max(row_sum.upper() for row_sum in row_sums)


@dataclass(frozen=True)
class Enclosure:
    """A closed interval between two exact decimals that is proven to contain a number."""

    low: Decimal
    high: Decimal

    def __float__(self) -> float:
        """Return the midpoint of the interval as a float."""
        return float((Fraction(self.low) + Fraction(self.high)) / 2)

    def __contains__(self, value: float | Decimal | Fraction) -> bool:
        """Return whether the interval contains a number, without rounding."""
        return Fraction(self.low) <= Fraction(value) <= Fraction(self.high)

    def __str__(self) -> str:
        """Return "centre +- radius", rounded to an interval that still contains this one.

        The radius has two digits and is rounded up. If both ends are equal, return this number.
        """
        width = self.high - self.low
        if not width:
            return str(self.low)
        # With 400 digits the sum, the difference and half of them are exact.
        exact, rounded_up = Context(prec=400), Context(prec=2, rounding="ROUND_UP")
        centre = exact.divide(exact.add(self.low, self.high), Decimal(2))
        radius = rounded_up.divide(width, Decimal(2))
        # The rounded centre has one digit more than the radius justifies.
        digits = max(1, centre.adjusted() - radius.adjusted() + 2)
        rounded_centre = Context(prec=digits).plus(centre)
        rounding_error = abs(exact.subtract(rounded_centre, centre))
        radius = rounded_up.add(radius, rounding_error)
        return f"{rounded_centre} +- {radius}"


def to_decimals(ball: Any, digits: int) -> Enclosure:
    """Convert a ball to an `Enclosure`, rounded outwards to `digits` + 2 decimal places.

    A `ball`, flint's ``arb``, is an interval with midpoint and radius; the result contains it.
    """
    module = flint()
    places = digits + 2
    # A decimal digit needs about 3.3 bits, so with 4 bits per digit rounding errors are negligible.
    with precision(module.ctx.prec + 4 * places + 64):
        scaled = ball * module.arb(10) ** places
        low = int(scaled.lower().floor().unique_fmpz())
        high = int(scaled.upper().ceil().unique_fmpz())
    exact = Context(prec=len(str(max(abs(low), abs(high)))) + 1)
    return Enclosure(Decimal(low).scaleb(-places, exact), Decimal(high).scaleb(-places, exact))


def reliable_digits(ball: Any) -> int:
    """Return the number of reliable decimal digits of a ball (an interval, midpoint and radius).

    The error is the radius relative to max(1, |midpoint|); a ball of radius 0 has _EXACT_DIGITS.
    """
    relative_radius = ball.rad() / max(1, abs(ball.mid()))
    if relative_radius == 0:
        return _EXACT_DIGITS
    return int((-relative_radius.log() / flint().arb(10).log()).lower().floor().unique_fmpz())

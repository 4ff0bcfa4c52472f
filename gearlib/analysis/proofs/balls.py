"""Ball arithmetic by python-flint, with conversions from numbers and to decimals.

A ball is an interval, given by midpoint and radius. An operation of Arb returns a ball with the
results for all numbers in its operands (Johansson, IEEE Transactions on Computers 66 (2017)
1281-1292). A comparison of balls is true only if it holds for all numbers in them: then the
inequality is proven.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any

import numpy as np

#: Number of decimal digits of a ball with the radius 0.
_EXACT_DIGITS = 10**6


def flint() -> Any:
    """Return the module python-flint, or raise an ImportError with the command to install it.

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
    former precision returns at the end of the block.
    """
    with flint().ctx.workprec(bits):
        yield flint().arb


def ball_of(fraction: Fraction) -> Any:
    """Return a ball (flint's ``arb``) that contains a rational number."""
    return flint().arb(fraction.numerator) / fraction.denominator


def column_of(values: list) -> Any:
    """Convert a list of n balls or numbers to a column matrix of balls, shape (n, 1)."""
    return flint().arb_mat([[value] for value in values])


def matrix_of(array: np.ndarray) -> Any:
    """Convert a two-dimensional array of balls or numbers to a matrix of balls."""
    return flint().arb_mat(array.tolist())


def first_column(matrix: Any) -> Any:
    """Return the first column of a matrix of balls as a matrix, shape (n, 1)."""
    return column_of([row[0] for row in matrix.tolist()])


def identity(n: int) -> Any:
    """Return the identity matrix of balls, shape (n, n)."""
    return flint().arb_mat(n, n, 1)


def norm(matrix: Any) -> Any:
    """Return an upper bound of the infinity norm of a matrix of balls, its largest row sum."""
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
        """Return "centre +- radius" with rounded numbers that still contain the interval.

        The radius has two digits and is rounded up. If both ends are equal, return that number.
        """
        width = self.high - self.low
        if not width:
            return str(self.low)
        # With 400 digits sums, differences and halves of the ends are exact.
        exact, rounded_up = Context(prec=400), Context(prec=2, rounding="ROUND_UP")
        centre = exact.divide(exact.add(self.low, self.high), Decimal(2))
        radius = rounded_up.divide(width, Decimal(2))
        # The rounded centre has one digit more than the radius determines.
        digits = max(1, centre.adjusted() - radius.adjusted() + 2)
        rounded_centre = Context(prec=digits).plus(centre)
        rounding_error = abs(exact.subtract(rounded_centre, centre))
        radius = rounded_up.add(radius, rounding_error)
        return f"{rounded_centre} +- {radius}"


def enclosure(ball: Any, digits: int) -> Enclosure:
    """Convert a ball to an interval of decimals, rounded outwards to `digits` + 2 places.

    A `ball`, flint's ``arb``, is an interval with midpoint and radius; the result contains it.
    """
    module = flint()
    places = digits + 2
    # A decimal digit needs about 3.3 bits: with 4 bits each, rounding errors are negligible.
    with precision(module.ctx.prec + 4 * places + 64):
        scaled = ball * module.arb(10) ** places
        low = int(scaled.lower().floor().unique_fmpz())
        high = int(scaled.upper().ceil().unique_fmpz())
    exact = Context(prec=len(str(max(abs(low), abs(high)))) + 1)
    return Enclosure(Decimal(low).scaleb(-places, exact), Decimal(high).scaleb(-places, exact))


def digits_of(ball: Any) -> int:
    """Return the number of reliable decimal digits of a ball (an interval, midpoint and radius).

    The radius is taken relative to max(1, |midpoint|); a ball of radius 0 has _EXACT_DIGITS.
    """
    relative_radius = ball.rad() / max(1, abs(ball.mid()))
    if relative_radius == 0:
        return _EXACT_DIGITS
    return int((-relative_radius.log() / flint().arb(10).log()).lower().floor().unique_fmpz())

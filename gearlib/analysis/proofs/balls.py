"""Ball arithmetic by python-flint, with conversions from numbers and to decimals.

A ball is a midpoint with a radius. Every operation of Arb returns a ball that contains all results
for numbers in its operands (Johansson, IEEE Transactions on Computers 66 (2017) 1281-1292).
Therefore an inequality between balls is proven if it holds.
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
    """Return the module python-flint, or raise an ImportError with the command to install it."""
    try:
        import flint as module
    except ImportError:
        raise ImportError(
            "proofs need python-flint, which is not installed: pip install 'gearlib[proof]'"
        ) from None
    return module


@contextmanager
def precision(bits: int):
    """Set the precision of ball arithmetic in bits for a ``with`` block; yield flint's ``arb``."""
    with flint().ctx.workprec(bits):
        yield flint().arb


def ball_of(fraction: Fraction) -> Any:
    """Return a ball (flint's ``arb``) that contains a fraction."""
    return flint().arb(fraction.numerator) / fraction.denominator


def column_of(values: list) -> Any:
    """Return a list of n balls or numbers as a column matrix of balls, shape (n, 1)."""
    return flint().arb_mat([[value] for value in values])


def matrix_of(array: np.ndarray) -> Any:
    """Return a two-dimensional array of balls or numbers as a matrix of balls."""
    return flint().arb_mat(array.tolist())


def first_column(matrix: Any) -> Any:
    """Return the first column of a matrix of balls, shape (n, 1)."""
    return column_of([row[0] for row in matrix.tolist()])


def identity(n: int) -> Any:
    """Return the unit matrix of balls, shape (n, n)."""
    return flint().arb_mat(n, n, 1)


def norm(matrix: Any) -> Any:
    """Return an upper bound of the maximum norm of a matrix of balls, its largest row sum."""
    return max(sum(map(abs, row), flint().arb(0)).upper() for row in matrix.tolist())


@dataclass(frozen=True)
class Enclosure:
    """A closed interval between two exact decimals that is proven to contain a number."""

    low: Decimal
    high: Decimal

    def __float__(self) -> float:
        """Return the middle of the interval."""
        return float((Fraction(self.low) + Fraction(self.high)) / 2)

    def __contains__(self, value: float | Decimal | Fraction) -> bool:
        """Return whether the interval contains a number, exactly."""
        return Fraction(self.low) <= Fraction(value) <= Fraction(self.high)

    def __str__(self) -> str:
        """Return "centre +- radius" with rounded numbers that still contain the interval."""
        width = self.high - self.low
        if not width:
            return str(self.low)
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
    """Return a ball as an interval of decimals, rounded outwards to `digits` + 2 decimal places."""
    module = flint()
    places = digits + 2
    with precision(module.ctx.prec + 4 * places + 64):
        scaled = ball * module.arb(10) ** places
        low = int(scaled.lower().floor().unique_fmpz())
        high = int(scaled.upper().ceil().unique_fmpz())
    exact = Context(prec=len(str(max(abs(low), abs(high)))) + 1)
    return Enclosure(Decimal(low).scaleb(-places, exact), Decimal(high).scaleb(-places, exact))


def digits_of(ball: Any) -> int:
    """Return to how many decimal digits a ball is known, relative to max(1, |value|)."""
    relative_radius = ball.rad() / max(1, abs(ball.mid()))
    if relative_radius == 0:
        return _EXACT_DIGITS
    return int((-relative_radius.log() / flint().arb(10).log()).lower().floor().unique_fmpz())

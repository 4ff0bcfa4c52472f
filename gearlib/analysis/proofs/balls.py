"""Ball arithmetic by python-flint, with conversions from numbers and to decimals.

A ball is a midpoint with a radius; every operation of Arb widens the radius so that it holds all
results of the numbers that it stands for (Johansson, IEEE Transactions on Computers 66 (2017)
1281-1292). So an inequality between balls that holds is proven.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction


def flint():
    """Return the module of python-flint; an ImportError says how to install it."""
    try:
        import flint as module
    except ImportError:
        raise ImportError(
            "proofs need python-flint, which is not installed: pip install 'gearlib[proof]'"
        ) from None
    return module


@contextmanager
def precision(bits):
    """Set the precision of ball arithmetic in bits for a block; yield the class of balls."""
    with flint().ctx.workprec(bits):
        yield flint().arb


def ball_of(fraction):
    """Return a fraction as a ball."""
    return flint().arb(fraction.numerator) / fraction.denominator


def column_of(values):
    """Return a matrix of one column."""
    return flint().arb_mat([[value] for value in values])


def matrix_of(array):
    """Return a matrix of balls from an array of two dimensions."""
    return flint().arb_mat(array.tolist())


def first_column(matrix):
    """Return the first column of a matrix, shape (n, 1)."""
    return column_of([row[0] for row in matrix.tolist()])


def identity(n):
    """Return the unit matrix."""
    return flint().arb_mat(n, n, 1)


def norm(matrix):
    """Return an upper bound of the maximum norm of a matrix, its largest row sum."""
    return max(sum(map(abs, row), flint().arb(0)).upper() for row in matrix.tolist())


@dataclass(frozen=True)
class Enclosure:
    """A closed interval between two exact decimals that is proven to hold a number."""

    low: Decimal
    high: Decimal

    def __float__(self):
        return float((Fraction(self.low) + Fraction(self.high)) / 2)

    def __contains__(self, value):
        return Fraction(self.low) <= Fraction(value) <= Fraction(self.high)

    def __str__(self):
        width = self.high - self.low
        if not width:
            return str(self.low)
        exact = Context(prec=400)
        centre = exact.divide(exact.add(self.low, self.high), Decimal(2))
        radius = Context(prec=2, rounding="ROUND_UP").divide(width, Decimal(2))
        # All significant digits of the centre, and one more.
        shown = Context(prec=max(1, centre.adjusted() - radius.adjusted() + 2)).plus(centre)
        off = abs(exact.subtract(shown, centre))
        radius = Context(prec=2, rounding="ROUND_UP").add(radius, off)
        return f"{shown} +- {radius}"


def enclosure(ball, digits):
    """Return the `Enclosure` of a ball, rounded outwards to two digits more than `digits`."""
    module = flint()
    places = digits + 2
    with precision(module.ctx.prec + 4 * places + 64):
        scaled = ball * module.arb(10) ** places
        low = int(scaled.lower().floor().unique_fmpz())
        high = int(scaled.upper().ceil().unique_fmpz())
    exact = Context(prec=len(str(max(abs(low), abs(high)))) + 1)
    return Enclosure(*(Decimal(end).scaleb(-places, exact) for end in (low, high)))


def digits_of(ball):
    """Return the number of correct decimal digits of a ball, behind the point if it is below 1."""
    share = ball.rad() / max(1, abs(ball.mid()))
    if share == 0:
        return 10**6
    return int((-share.log() / flint().arb(10).log()).lower().floor().unique_fmpz())

"""Ball arithmetic: `flint` where it is installed, numbers in and decimals out.

A ball is a midpoint with a radius; every operation of Arb widens the radius so that it holds all
results of the numbers that it stands for (Johansson, IEEE Transactions on Computers 66 (2017)
1281-1292). So an inequality between balls that holds is proven.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction

#: Bits where few will do: for derivatives, for polynomials, and where a radius is looked for.
COARSE = 64


def flint():
    """Return the module of python-flint.

    Raises
    ------
    ImportError
        Saying what to install.
    """
    try:
        import flint as module
    except ImportError:
        raise ImportError(
            "proofs need python-flint, which is not installed: pip install 'gearlib[proof]'"
        ) from None
    return module


@contextmanager
def precision(bits):
    """Compute with so many bits; yields the class of balls."""
    module = flint()
    with module.ctx.workprec(bits):
        yield module.arb


def middle(values):
    """Return the midpoints of balls, as exact balls."""
    return [value.mid() for value in values]


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
        # Digits of the centre that mean something, and one more.
        shown = Context(prec=max(1, centre.adjusted() - radius.adjusted() + 2)).plus(centre)
        off = abs(exact.subtract(shown, centre))
        radius = Context(prec=2, rounding="ROUND_UP").add(radius, off)
        return f"{shown} +- {radius}"

    def as_list(self):
        """Return both ends as texts."""
        return [str(self.low), str(self.high)]


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
    """Return the decimal digits of a ball, behind the point where it is below 1."""
    share = ball.rad() / max(1, abs(ball.mid()))
    if share == 0:
        return 10**6
    lost = share.log() / flint().arb(10).log()
    return int((-lost).lower().floor().unique_fmpz())

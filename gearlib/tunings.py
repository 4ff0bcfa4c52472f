"""Tunings: their names in paths and back, equidistant grids, windows of a grid.

A tuning is a float wherever it goes; only here it is counted in decimals, which keeps
``start + i step`` the very float that a reader would type, whichever window of the grid it is
reached from; in binary the 331st step of 0.0005 from 0.5 and the first from 0.665 need not agree.
"""

from decimal import Decimal

#: Decimals that every name shows; a tuning with more digits keeps them all.
NAME_DECIMALS = 4


def name_of(*tunings):
    """Return what names the files of a tuning or a window: ``0.6600``, ``0.5000-1.4000``."""
    exact = [_decimal(tuning) for tuning in tunings]
    return "-".join(f"{one:.{max(NAME_DECIMALS, -one.as_tuple().exponent)}f}" for one in exact)


def values_of(name):
    """Return the tunings, list of float, that `name_of` has named."""
    return [float(text) for text in name.split("-")]


def steps(start, stop, step):
    """Return ``(stop - start) / step`` as an exact `Decimal`; a whole number on a closed grid."""
    return (_decimal(stop) - _decimal(start)) / _decimal(step)


def grid(start, stop, step):
    """Return the tunings ``start, start + step, ..., stop``, floats.

    ``stop - start`` is a whole multiple of `step`.
    """
    first, distance = _decimal(start), _decimal(step)
    return [float(first + i * distance) for i in range(int(steps(start, stop, step)) + 1)]


def windows(start, stop, step, width):
    """Return the windows of a grid, as pairs (first tuning, last tuning).

    The windows are ``[start, start + width]``, ``(start + width, start + 2 width]`` and so on:
    half open, so that no tuning is computed twice, and counted from `start`, so that a later
    `stop` adds windows and leaves the earlier ones as they are. `width` is a whole multiple of
    `step`; the last window may be shorter.
    """
    distance, per_window = _decimal(step), int(steps(0.0, width, step))
    last = int(steps(start, stop, step))
    firsts = [0, *range(per_window + 1, last + 1, per_window)]
    lasts = [*(first - 1 for first in firsts[1:]), last]
    origin = _decimal(start)
    return [
        (float(origin + i * distance), float(origin + j * distance))
        for i, j in zip(firsts, lasts, strict=True)
    ]


def _decimal(value):
    # repr() gives the shortest decimal that reads back as the same float: what was typed.
    # normalize() drops trailing zeros, so that 0.50 and 0.5 have the same name.
    return Decimal(repr(float(value))).normalize()

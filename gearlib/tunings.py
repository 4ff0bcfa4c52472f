"""Tunings: their names in paths and back, equidistant grids, windows of a grid.

Steps are counted in decimals, so that every window of a grid reaches a tuning as the same float:
in binary the 331st step of 0.0005 from 0.5 and the first from 0.665 need not agree.
"""

from decimal import Decimal

#: Decimals that every name shows; a tuning with more digits keeps them all.
NAME_DECIMALS = 4


def name_of(*tunings):
    """Return the file name of a tuning or of a window: ``0.6600``, ``0.5000-1.4000``."""
    decimals = [_decimal(tuning) for tuning in tunings]
    return "-".join(f"{x:.{max(NAME_DECIMALS, -x.as_tuple().exponent)}f}" for x in decimals)


def values_of(name):
    """Return the tunings, a list of float, of a name by `name_of`."""
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
    """Return the shortest decimal that reads back as the same float, without trailing zeros."""
    return Decimal(repr(float(value))).normalize()

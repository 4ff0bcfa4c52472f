"""Tunings in names of files, equidistant grids of tunings, and windows of a grid.

Steps are added as decimals, so that a tuning is the same float in every window of a grid.
"""

from decimal import Decimal

#: Smallest number of decimals in a name.
NAME_DECIMALS = 4


def name_of(*tunings):
    """Return text for file names: "0.6600" for a tuning, "0.5000-1.4000" for a window of tunings.

    `tunings` (mesh frequency over natural frequency) are one tuning, or the first and the last one
    of a window. Each number has as many decimals as it needs, at least `NAME_DECIMALS`.
    """
    decimals = [_decimal(tuning) for tuning in tunings]
    return "-".join(f"{x:.{max(NAME_DECIMALS, -x.as_tuple().exponent)}f}" for x in decimals)


def values_of(name):
    """Return the list of tunings in a name made by `name_of`."""
    return [float(text) for text in name.split("-")]


def steps(start, stop, step):
    """Return the number of steps from `start` to `stop` as a Decimal, exact if it is whole."""
    return (_decimal(stop) - _decimal(start)) / _decimal(step)


def grid(start, stop, step):
    """Return a list of the tunings from `start` to `stop`, which are a `step` apart.

    A tuning is the mesh frequency over the natural frequency. Steps are added as decimals, because
    sums of floats would depend on the start of the grid.
    """
    start_decimal, step_decimal = _decimal(start), _decimal(step)
    count = int(steps(start, stop, step)) + 1
    return [float(start_decimal + i * step_decimal) for i in range(count)]


def windows(start, stop, step, width):
    """Divide a grid of tunings into windows; return a list of pairs (first tuning, last tuning).

    A tuning is the mesh frequency over the natural frequency; neighbours are a `step` apart. The
    first window goes from `start` to `start` + `width`, the next from the following tuning to
    `start` + 2 `width`, and so on, so that a larger `stop` only adds windows. `width` is a whole
    multiple of `step`; the last window may be shorter.
    """
    window_steps, last_step = int(steps(0.0, width, step)), int(steps(start, stop, step))
    first_steps = [0, *range(window_steps + 1, last_step + 1, window_steps)]
    last_steps = [*(i - 1 for i in first_steps[1:]), last_step]
    start_decimal, step_decimal = _decimal(start), _decimal(step)
    return [
        (float(start_decimal + i * step_decimal), float(start_decimal + j * step_decimal))
        for i, j in zip(first_steps, last_steps, strict=True)
    ]


def _decimal(value):
    """Return the shortest decimal that equals the float `value`, without trailing zeros."""
    return Decimal(repr(float(value))).normalize()

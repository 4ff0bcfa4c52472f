"""Tunings in file names, equidistant grids of tunings, and windows of a grid.

A tuning is the mesh frequency over the natural frequency. Steps are added as decimals, so that a
tuning is the same float in every window of a grid.
"""

from decimal import Decimal

#: Minimum number of decimals in a name.
MIN_DECIMALS = 4


def format_name(*tunings):
    """Format tunings for file names: "0.6600", or "0.5000-1.4000" for a window of tunings.

    `tunings` are one tuning, or the first and the last one of a window. Each number has as many
    decimals as it needs, but at least `MIN_DECIMALS`.
    """
    decimals = [_decimal(tuning) for tuning in tunings]
    return "-".join(f"{x:.{max(MIN_DECIMALS, -x.as_tuple().exponent)}f}" for x in decimals)


def parse_name(name):
    """Return the list of tunings in a name made by `format_name`."""
    return [float(text) for text in name.split("-")]


def count_steps(start, stop, step):
    """Return (stop - start) / step as a Decimal; whole numbers of steps are exact."""
    return (_decimal(stop) - _decimal(start)) / _decimal(step)


def grid(start, stop, step):
    """Return the equidistant tunings from `start` to `stop` as a list of floats.

    Steps are added as decimals, because sums of floats would depend on the start of the grid.
    """
    start_decimal, step_decimal = _decimal(start), _decimal(step)
    count = int(count_steps(start, stop, step)) + 1
    return [float(start_decimal + i * step_decimal) for i in range(count)]


def windows(start, stop, step, width):
    """Divide a grid of tunings into windows; return a list of pairs (first tuning, last tuning).

    `grid` describes the grid. The first window goes from `start` to `start + width`, the second
    from the next tuning to `start + 2 * width`, and so on, so that a larger `stop` only adds
    windows. `width` is an integer multiple of `step`; the last window may be shorter.
    """
    window_steps = int(count_steps(0.0, width, step))
    last_step = int(count_steps(start, stop, step))
    first_steps = [0, *range(window_steps + 1, last_step + 1, window_steps)]
    last_steps = [*(i - 1 for i in first_steps[1:]), last_step]
    start_decimal, step_decimal = _decimal(start), _decimal(step)
    return [
        (float(start_decimal + i * step_decimal), float(start_decimal + j * step_decimal))
        for i, j in zip(first_steps, last_steps, strict=True)
    ]


def _decimal(value):
    """Return the shortest Decimal that rounds to the float `value`, without trailing zeros."""
    return Decimal(repr(float(value))).normalize()

"""Colours of categories, without end and never those of kinds of motion.

The first are of Okabe and Ito, which readers with red-green blindness can distinguish.
"""

import colorsys
import itertools
from collections.abc import Iterable, Iterator

#: Colours of Okabe and Ito, of curves that a figure names itself.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#4D4D4D", "#D55E00", "#CC79A7", "#56B4E9")
#: Kind of motion, by its code in `gearlib.analysis.trust`, -> colour.
MOTIONS = {
    "periodic": "#A6DBA0",
    "quasi-periodic": "#ABD9E9",
    "chaotic": "#D55E00",
    "undecided": "#F4C2D7",
    "unbounded": "#999999",
}
#: Colours of categories that come first, also told apart in grey.
_FIRST = (*(colour for colour in PALETTE if colour not in MOTIONS.values()), "#882255")
#: Colours of areas and backgrounds, of which those of categories keep their distance.
_OTHERS = ("#FFFFFF", "#CFCFCF", "#000000")
#: Distance, as in `_distance`, that further colours keep; it shrinks with every vain attempt.
_DISTANCE, _SHRINKING = 0.5, 0.98
#: Steps of hue and lightness between attempts, the multiples of which fill a square evenly.
_HUE_STEP, _LIGHTNESS_STEP = 0.7548776662466927, 0.5698402909980532


def of_categories(taken: Iterable[str] = ()) -> Iterator[str]:
    """Yield different colours without end, none of which is in `taken` or that of a motion."""
    taken = {colour.upper() for colour in taken}
    yielded = [*taken, *MOTIONS.values(), *_OTHERS]
    for colour in itertools.chain(_FIRST, _further_colours(yielded)):
        if colour not in taken:
            yielded.append(colour)
            yield colour


def _further_colours(others: list[str]) -> Iterator[str]:
    """Yield colours that differ from `others`, to which the caller adds those that it uses."""
    distance = _DISTANCE
    for i in itertools.count(1):
        lightness = 0.25 + 0.5 * (i * _LIGHTNESS_STEP % 1.0)
        values = colorsys.hls_to_rgb(i * _HUE_STEP % 1.0, lightness, 0.75)
        colour = "#" + "".join(f"{round(255.0 * value):02X}" for value in values)
        if min(_distance(colour, other) for other in others) > distance:
            yield colour
        else:
            distance *= _SHRINKING


def _distance(colour: str, other: str) -> float:
    """Return how far two colours "#rrggbb" lie apart: 0 if equal, 3 for black and white."""
    pairs = zip(bytes.fromhex(colour[1:]), bytes.fromhex(other[1:]), strict=True)
    red, green, blue = ((a - b) / 255.0 for a, b in pairs)
    # Eyes see differences of green best.
    return (2.0 * red**2 + 4.0 * green**2 + 3.0 * blue**2) ** 0.5

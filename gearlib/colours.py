"""Colours of categories, as many as needed, none of which is the colour of a kind of motion.

The first colours are of Okabe and Ito; readers with red-green blindness can distinguish them.
"""

import colorsys
import itertools
from collections.abc import Iterable, Iterator

#: Colours of Okabe and Ito, for curves that a figure styles itself.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#4D4D4D", "#D55E00", "#CC79A7", "#56B4E9")
#: Kind of motion, by its code in `gearlib.analysis.trust`, -> colour.
MOTIONS = {
    "periodic": "#A6DBA0",
    "quasi-periodic": "#ABD9E9",
    "chaotic": "#D55E00",
    "undecided": "#F4C2D7",
    "unbounded": "#999999",
}
#: First colours of categories, which also differ in grey.
_FIRST = (*(colour for colour in PALETTE if colour not in MOTIONS.values()), "#882255")
#: Colours of areas and backgrounds, from which colours of categories must differ.
_BACKGROUNDS = ("#FFFFFF", "#CFCFCF", "#000000")
#: Smallest distance, as in `_distance`, between further colours; factor on it at a failed attempt.
_DISTANCE, _SHRINKING = 0.5, 0.98
#: Steps of hue and lightness between attempts, whose multiples fill a square evenly.
_HUE_STEP, _LIGHTNESS_STEP = 0.7548776662466927, 0.5698402909980532


def of_categories(taken: Iterable[str] = ()) -> Iterator[str]:
    """Yield different colours without end, for curves that stand for categories.

    A colour is a string such as "#0072B2". None of them is in `taken`, and none has a meaning of
    its own, as the colours of the kinds of motion (chaotic etc.) and of shaded areas have. The
    first colours are a fixed palette; later ones are computed.
    """
    taken = {colour.upper() for colour in taken}
    used_colours = [*taken, *MOTIONS.values(), *_BACKGROUNDS]
    for colour in itertools.chain(_FIRST, _further_colours(used_colours)):
        if colour not in taken:
            used_colours.append(colour)
            yield colour


def _further_colours(used_colours: list[str]) -> Iterator[str]:
    """Yield colours that are clearly different from all `used_colours`, a list of "#rrggbb".

    The caller adds each colour that it uses to the list. Candidates step through hue and lightness.
    Whenever a candidate is too close to a used colour, the required distance shrinks a little, so
    that the search always ends.
    """
    min_distance = _DISTANCE
    for i in itertools.count(1):
        # Lightness stays between 0.25 and 0.75, far from black and white.
        lightness = 0.25 + 0.5 * (i * _LIGHTNESS_STEP % 1.0)
        values = colorsys.hls_to_rgb(i * _HUE_STEP % 1.0, lightness, 0.75)
        colour = "#" + "".join(f"{round(255.0 * value):02X}" for value in values)
        if min(_distance(colour, used_colour) for used_colour in used_colours) > min_distance:
            yield colour
        else:
            min_distance *= _SHRINKING


def _distance(colour: str, other: str) -> float:
    """Return the distance of two colours "#rrggbb": 0 if they are equal, 3 for black and white."""
    pairs = zip(bytes.fromhex(colour[1:]), bytes.fromhex(other[1:]), strict=True)
    red, green, blue = ((a - b) / 255.0 for a, b in pairs)
    # The weights are large for green, because eyes see differences of green best.
    return (2.0 * red**2 + 4.0 * green**2 + 3.0 * blue**2) ** 0.5

"""Any number of distinct colours for categories; none is the colour of a kind of motion.

The first colours are from the palette of Okabe and Ito, which readers with red-green colour
blindness can distinguish.
"""

import colorsys
import itertools
from collections.abc import Iterable, Iterator

#: Palette of Okabe and Ito, also for figures that choose the colours of their curves.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#4D4D4D", "#D55E00", "#CC79A7", "#56B4E9")
#: Colour of each kind of motion of `gearlib.analysis.trust`.
MOTIONS = {
    "periodic": "#A6DBA0",
    "quasi-periodic": "#ABD9E9",
    "chaotic": "#D55E00",
    "undecided": "#F4C2D7",
    "unbounded": "#999999",
}
#: First colours of categories, which also differ in greyscale.
_FIRST_COLOURS = (*(colour for colour in PALETTE if colour not in MOTIONS.values()), "#882255")
#: Colours of areas and backgrounds, from which colours of categories must differ.
_BACKGROUNDS = ("#FFFFFF", "#CFCFCF", "#000000")
#: Initial minimum `_colour_distance` between computed colours, and its factor for each candidate
#: that is too close.
_INITIAL_MIN_DISTANCE, _DISTANCE_FACTOR = 0.5, 0.98
#: Steps of hue and lightness between candidates: their multiples modulo 1 fill a square evenly.
_HUE_STEP, _LIGHTNESS_STEP = 0.7548776662466927, 0.5698402909980532


def distinct_colours(excluded: Iterable[str] = ()) -> Iterator[str]:
    """Yield any number of distinct colours, such as "#0072B2", for curves of different categories.

    Colours in `excluded`, `MOTIONS` and `_BACKGROUNDS` are skipped. The first colours are a fixed
    palette; later ones are computed.
    """
    excluded = {colour.upper() for colour in excluded}
    used_colours = [*excluded, *MOTIONS.values(), *_BACKGROUNDS]
    for colour in itertools.chain(_FIRST_COLOURS, _compute_colours(used_colours)):
        if colour not in excluded:
            used_colours.append(colour)
            yield colour


def _compute_colours(used_colours: list[str]) -> Iterator[str]:
    """Yield colours "#rrggbb" that are clearly different from all `used_colours`.

    The caller appends each colour that it uses to `used_colours`. Candidates step through hue and
    lightness. The required distance shrinks a little whenever a candidate is too close to a used
    colour, so that the search always ends.
    """
    min_distance = _INITIAL_MIN_DISTANCE
    for i in itertools.count(1):
        # Lightness stays between 0.25 and 0.75, far from black and white.
        lightness = 0.25 + 0.5 * (i * _LIGHTNESS_STEP % 1.0)
        rgb = colorsys.hls_to_rgb(i * _HUE_STEP % 1.0, lightness, 0.75)
        colour = "#" + "".join(f"{round(255.0 * value):02X}" for value in rgb)
        if (
            min(_colour_distance(colour, used_colour) for used_colour in used_colours)
            > min_distance
        ):
            yield colour
        else:
            min_distance *= _DISTANCE_FACTOR


def _colour_distance(colour: str, other_colour: str) -> float:
    """Return the distance of two colours "#rrggbb": 0 if they are equal, 3 for black and white."""
    pairs = zip(bytes.fromhex(colour[1:]), bytes.fromhex(other_colour[1:]), strict=True)
    red, green, blue = ((a - b) / 255.0 for a, b in pairs)
    # Green has the largest weight, because the eye is most sensitive to green.
    return (2.0 * red**2 + 4.0 * green**2 + 3.0 * blue**2) ** 0.5

"""All constants of one mesh at one tuning."""

from typing import NamedTuple

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import kernel
from gearlib.engines.pair.damped_oscillator import Level, level


class Mesh(NamedTuple):
    """Dimensionless constants of the rectangular mesh at one tuning."""

    low: Level  #: C_min
    high: Level  #: C_max
    half_high: float  #: phase length of half the C_max segment
    whole_low: float  #: phase length of the C_min segment
    drag: float  #: b = beta_m / nu
    pull: float  #: f = 1 / nu^2
    gap: float  #: backlash in static deflections
    tuning: float  #: nu


@kernel
def mesh(ratios, tuning):
    """Return the `Mesh` at one tuning.

    `ratios`, shape (7,): C_max / C_s, C_min / C_s, half the C_max segment, the C_min segment,
    beta, beta_m, backlash in static deflections.
    """
    return Mesh(
        level(ratios[1], ratios[4], tuning),
        level(ratios[0], ratios[4], tuning),
        ratios[2],
        ratios[3],
        ratios[5] / tuning,
        1.0 / (tuning * tuning),
        ratios[6],
        tuning,
    )


@kernel
def contact_of(gap, x, v):
    """Return the contact code of a state; on a flank line, that of the motion just after.

    The load pulls up, so a state at rest on a flank line moves up.
    """
    return contact_between(0.0, -gap, x, v)


@kernel
def contact_between(upper, lower, x, v):
    """Return the contact code of a state between two contact lines, as `contact_of`."""
    if x > upper or (x == upper and v >= 0.0):
        return NORMAL
    if x < lower or (x == lower and v < 0.0):
        return INVERSE
    return BACKLASH

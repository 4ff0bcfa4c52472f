"""A mesh whose pairs of teeth touch one by one, as the kernels see it.

While the pairs of one set touch, the displacement x over the phase tau follows

    x'' = (1 - a x + b) / nu^2 - d (x' - e'),

a and b straight lines on each segment of phase. A set of the k pairs is an integer with a bit for
each; set 0 is the backlash and set 2^k contact of the coast side. Pair i overlaps by p x - r beside
the other pairs of a set: it touches where that is > 0. Displacements are in static deflections,
forces over the load.
"""

from typing import NamedTuple

import numpy as np

#: Columns of the tables: value at the start of a segment and slope, of the factor of x (a, p) and
#: of what is taken off (b, r).
FACTOR, FACTOR_SLOPE, OFFSET, OFFSET_SLOPE = range(4)


class ToothPairSystem(NamedTuple):
    """One mesh at one tuning: k pairs of teeth, p segments of phase."""

    starts: np.ndarray  #: phases that bound the segments, shape (p + 1,)
    first_segment: np.ndarray  #: int, where each mesh period begins, shape (repeats + 1,)
    renewed: np.ndarray  #: bool, whether pairs come or go where a segment starts, shape (p,)
    inside: np.ndarray  #: int, set of the pairs on their path of contact, shape (p,)
    force: np.ndarray  #: of a set, a and b, shape (p, 2^k + 1, 4)
    overlap: np.ndarray  #: of a pair beside a set without it, p and r, shape (p, 2^k, k, 4)
    slip: np.ndarray  #: e', rate of the gap without load, shape (p,)
    damping: np.ndarray  #: d in the backlash and in contact, over nu, shape (2,)
    lower: float  #: displacement of the coast side, may be -inf
    longest: float  #: phase of the longest step
    tuning: float  #: nu
    repeats: int  #: mesh periods after which the pairs of teeth repeat
    closing: bool  #: whether pairs of teeth and the coast side might touch at once

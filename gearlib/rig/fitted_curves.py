"""What a fit compared, as curves and places that can be drawn: measured and fitted."""

from typing import NamedTuple

import numpy as np


class Curve(NamedTuple):
    """A measured quantity over the speed, or over the mesh phase, and what the fit makes of it."""

    name: str
    units: str
    over: str  #: speed (rpm) or phase (mesh periods)
    at: np.ndarray
    heights: tuple  #: (measured, fitted) as the sensor sees them; NaN where left out
    falls: np.ndarray  #: whether the speed falls


class Place(NamedTuple):
    """A measured speed, rpm."""

    name: str
    measured: float
    deviation: float
    fitted: float


def left_over(curves):
    """Return the share of the variance of measured curves that is left, of one unit at most."""
    left, whole = {}, {}
    for one in curves:
        own, fitted = one.heights
        there = np.isfinite(fitted)
        rest = np.sum((fitted - own)[there] ** 2)
        left[one.units] = left.get(one.units, 0.0) + rest
        whole[one.units] = whole.get(one.units, 0.0) + np.sum((own - own[there].mean())[there] ** 2)
    return max((left[units] / whole[units] for units in left if whole[units] > 0.0), default=0.0)

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

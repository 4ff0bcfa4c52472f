"""An observation: measured values, and the function that predicts them of a model."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.analysis.orbits.tracing import Lost

#: Residual of a speed that the model does not have.
MISSING_RESIDUAL = 100.0
#: A step from one measured value to the next that is a jump, as a share of the value.
JUMP_SHARE = 0.15
START_REFUSAL = (
    "model is not allowed: a motion with its values, where the fit starts, could not be run to the "
    "end"
)


class Channel(NamedTuple):
    """Measured values of one sensor."""

    name: str
    values: np.ndarray
    deviations: np.ndarray  #: standard deviations; a common scale where the noise is unknown
    noise_known: bool
    unknown_gain: bool = False
    unknown_offset: bool = False
    #: Numbers of the values in the order in which they were measured, shape (sequences, steps).
    sequences: Any = None
    joined: bool = False  #: whether its deviations are weighted with those of the channel before it

    @property
    def eliminated(self) -> int:
        """Return how many numbers of the sensor are taken from the data."""
        return self.unknown_gain + self.unknown_offset

    def sensed(self, predicted: np.ndarray) -> tuple:
        """Return predicted values as the sensor shows them, and its gain.

        An unknown gain and offset enter linearly: those that suit the measured values best are
        eliminated (variable projection, Golub and Pereyra 1973).
        """
        columns = [predicted] * self.unknown_gain + [np.ones(predicted.size)] * self.unknown_offset
        if not columns:
            return predicted, 1.0
        constant = 0.0 if self.unknown_gain else predicted
        matrix = np.stack(columns, axis=1) / self.deviations[:, None]
        sizes = np.linalg.norm(matrix, axis=0)
        sizes[sizes == 0.0] = 1.0
        wanted = (self.values - constant) / self.deviations
        best = np.linalg.lstsq(matrix / sizes, wanted, rcond=None)[0] / sizes
        gain = float(best[0]) if self.unknown_gain else 1.0
        return constant + np.stack(columns, axis=1) @ best, gain


class Observation(NamedTuple):
    """A part of a measured set and the function that predicts it."""

    kind: str
    channels: list
    #: model -> (values of each channel, largest way into the backlash, m)
    predict: Callable
    #: values of each channel as the sensors show them -> curves to be drawn
    draw: Callable
    warning: str = ""

    def sensed(self, model: Any) -> list | None:
        """Return what the sensors show of a model, None where a motion could not go on."""
        try:
            predicted = self.predict(model)[0]
        except (NoOrbit, Lost, ArithmeticError, ValueError):
            return None
        pairs = zip(self.channels, predicted, strict=True)
        return [channel.sensed(values)[0] for channel, values in pairs]

    def residuals(self, model: Any) -> np.ndarray | None:
        """Return predicted less measured values over their deviations, None as `sensed`."""
        sensed = self.sensed(model)
        if sensed is None:
            return None
        pairs = zip(self.channels, sensed, strict=True)
        rows = [(values - channel.values) / channel.deviations for channel, values in pairs]
        return np.nan_to_num(np.concatenate(rows), nan=MISSING_RESIDUAL)


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

"""Revolutions of a shaft whose speed is linear in time between given instants."""

import numpy as np
from scipy.integrate import cumulative_trapezoid


class Turning:
    """A course of speed, rows of s and rpm; revolutions count from its first row."""

    def __init__(self, rows):
        self._time, speed = np.array(rows, float).T
        self._rate = speed / 60.0
        self._slope = np.diff(self._rate) / np.diff(self._time)
        self._turned = cumulative_trapezoid(self._rate, self._time, initial=0.0)

    def revolutions(self, time):
        """Return how far the shaft has turned (array); behind the last row its speed stays."""
        i = np.clip(np.searchsorted(self._time, time, "right") - 1, 0, None)
        t = time - self._time[i]
        return self._turned[i] + (self._rate[i] + 0.5 * np.append(self._slope, 0.0)[i] * t) * t

    def at(self, revolutions):
        """Return (time, speed in rpm) after so many revolutions (arrays)."""
        i = np.searchsorted(self._turned, revolutions, "right") - 1
        i = np.clip(i, 0, self._slope.size - 1)
        first, ahead = self._rate[i], revolutions - self._turned[i]
        rate = np.sqrt(np.maximum(first**2 + 2.0 * self._slope[i] * ahead, 0.0))
        # From rest, the root of a difference would cancel.
        passed = np.divide(2.0 * ahead, first + rate, where=ahead > 0.0, out=np.zeros(ahead.shape))
        return self._time[i] + passed, 60.0 * rate

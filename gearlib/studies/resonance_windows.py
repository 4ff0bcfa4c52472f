"""The resonance characteristic, window by window: one damping, one direction."""

import numpy as np

from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep, sweep_down
from gearlib.tunings import grid


def compute(pair, window, step, run, damping, direction, threads, lowest=None):
    """Return the orbit summaries of a window (first, last tuning), labelled with the names.

    A downward sweep goes on below, to the tuning `lowest` unless that is None, until it has jumped.
    """
    tunings, model = np.array(grid(window[0], window[1], step)), GearPair(**pair)
    if direction == "down" and lowest is not None:
        summaries, _ = sweep_down(model, tunings, lowest, threads=threads, **run)
    else:
        summaries = sweep(model, tunings, direction=direction, threads=threads, **run)
    return describe(summaries.assign_coords(damping=damping, direction=direction))

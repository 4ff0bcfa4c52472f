"""The resonance characteristic, window by window: one damping, one direction."""

from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep
from gearlib.tunings import grid


def compute(pair, window, step, run, damping, direction, threads):
    """Return the orbit summaries of a window (first, last tuning), labelled with the names."""
    tunings = grid(window[0], window[1], step)
    summaries = sweep(GearPair(**pair), tunings, direction=direction, threads=threads, **run)
    return describe(summaries.assign_coords(damping=damping, direction=direction))

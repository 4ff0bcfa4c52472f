"""Words for a motion: whether it is steady, and where it settles."""

import numpy as np

#: What a plot shows of an orbit, over its height: a line of 0.3 mm in a phase plane 3 cm high, of
#: which Fig. 5 has 24.
LINE = 0.01


def spread(run):
    """Return how far the mesh periods of a record lie apart at most, over the height of the orbit.

    What is below `LINE` is a single line in a plot.
    """
    x, share = run.displacement.values, run.phase.values / (2.0 * np.pi) % 1.0
    group = np.unique(np.round(share, 9) % 1.0, return_inverse=True)[1]
    highest, lowest = np.full((2, group.max() + 1), [[-np.inf], [np.inf]])
    np.maximum.at(highest, group, x)
    np.minimum.at(lowest, group, x)
    return float((highest - lowest).max() / np.ptp(x))


def not_settled(run):
    """Return in words that the motion of a run of `gearlib.simulate` has not settled."""
    return f"not settled after {int(run.followed)} mesh periods"


def ending(run):
    """Return on which orbit a run settles, in words, or that it has not settled."""
    if not (period := int(run.period)):
        return not_settled(run)
    return f"settles later on {period} mesh period{'s'[: period > 1]}"


def steadiness(run):
    """Return in words whether a record is a single line in a plot, and where the motion settles."""
    if spread(run) > LINE:
        return f"unsteady, {ending(run)}"
    return "steady, 1 mesh period" if int(run.period) == 1 else f"a single line, {ending(run)}"

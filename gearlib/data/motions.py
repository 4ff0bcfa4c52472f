"""Contact loss, growth and settling of the motion that a dataset holds."""

import numpy as np

#: Shares of time that are this close to each other differ by the rounding of sums.
FRACTION_TOLERANCE = 1e-9
#: Width of a line in a plot over the height of the orbit: 0.3 mm in a phase plane of 3 cm.
LINE_WIDTH = 0.01
#: A motion so many times as large as its model grows; undamped ones reach 1e8 and more.
MAX_GROWTH = 1e3


def float_array(numbers):
    """Return numbers as an array of floats, or an empty array if they cannot be converted."""
    try:
        return np.asarray(numbers, float)
    except (TypeError, ValueError):
        return np.empty(0)


def true_intervals(condition):
    """Return the (first, last) indices of each run of true values in `condition`, shape (n,)."""
    padded = np.concatenate([[0], np.asarray(condition, np.int8), [0]])
    edges = np.flatnonzero(np.diff(padded))
    return [(int(i), int(j) - 1) for i, j in zip(edges[::2], edges[1::2], strict=True)]


def contact_loss_fraction(fraction_normal):
    """Return the share of time without drive-side contact, 0 where only rounding makes it differ.

    `fraction_normal` is the share of time with drive-side contact, from 0 to 1.
    """
    loss = 1.0 - fraction_normal
    return loss * (loss > FRACTION_TOLERANCE)


def without_growth(curve, extent):
    """Return a result of `gearlib.sweep` with NaN at tunings where the motion grows.

    `extent` is the largest length of the model in static deflections, see `Model.extent`; motions
    beyond `MAX_GROWTH` times this length grow.
    """
    largest = np.maximum(abs(curve.displacement_max), abs(curve.displacement_min))
    other_dims = [dim for dim in largest.dims if dim != "tuning"]
    bounded = largest.max(other_dims) <= MAX_GROWTH * extent
    return curve.assign(
        {
            name: values.where(bounded)
            for name, values in curve.data_vars.items()
            if "tuning" in values.dims and values.dtype.kind == "f"
        }
    )


def spread(run):
    """Return how much the displacement differs between mesh periods, over the orbit's height.

    `run` is a dataset of `gearlib.simulate`. A spread below `LINE_WIDTH` is a single line in plots.
    """
    displacements, period_shares = run.displacement.values, run.phase.values / (2.0 * np.pi) % 1.0
    # Samples at the same share of a mesh period form a group.
    groups = np.unique(np.round(period_shares, 9) % 1.0, return_inverse=True)[1]
    highest = np.full(groups.max() + 1, -np.inf)
    lowest = np.full(groups.max() + 1, np.inf)
    np.maximum.at(highest, groups, displacements)
    np.minimum.at(lowest, groups, displacements)
    return float((highest - lowest).max() / np.ptp(displacements))


def not_settled(run):
    """Return a phrase that the motion of a run of `gearlib.simulate` has not settled."""
    return f"not settled after {int(run.followed)} mesh periods"


def ending(run):
    """Return a phrase with the period on which a run settles, or that it has not settled."""
    period = int(run.period)
    if not period:
        return not_settled(run)
    return f"settles later on {period} mesh period" + ("s" if period > 1 else "")


def steadiness(run):
    """Return a phrase on whether a run's mesh periods coincide in a plot, and how it settles."""
    if spread(run) > LINE_WIDTH:
        return f"unsteady, {ending(run)}"
    return "steady, 1 mesh period" if int(run.period) == 1 else f"a single line, {ending(run)}"


def description(run):
    """Return a sentence on the period and contact loss of a run of `gearlib.simulate`."""
    if int(run.status):
        return run.status.attrs["message"]
    period, bounces = int(run.period), f"{float(run.bounces):.3g} times"
    motion = f"repeats every {period} mesh periods" if period > 1 else "repeats every mesh period"
    if not period:
        motion = f"has {not_settled(run)}"
    contact = "the flanks never part"
    if float(run.fraction_inverse) > 0.0:
        contact = "it strikes both flanks"
    elif float(run.bounces) > 0.0:
        times = "once" if bounces == "1 times" else bounces
        contact = f"it loses contact {times} per mesh period"
    return f"The motion from rest {motion}; {contact}."

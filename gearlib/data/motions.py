"""Contact loss, growth and settling of the motion in a dataset."""

import numpy as np

#: Fractions of time that differ by less are equal up to rounding errors.
FRACTION_TOLERANCE = 1e-9
#: Line width of a plot relative to the width of an orbit: 0.3 mm in a phase plane of 3 cm.
LINE_WIDTH = 0.01
#: Largest displacement, relative to the extent of the model, of motions that count as bounded.
MAX_RELATIVE_DISPLACEMENT = 1e3


def float_array(numbers):
    """Return an array of floats, empty if the argument is anything but numbers."""
    try:
        array = np.asarray(numbers)
        return array.astype(float, copy=False) if array.dtype.kind in "iufO" else np.empty(0)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def true_intervals(condition):
    """Return the (first, last) indices of each run of true values in `condition`, shape (n,)."""
    padded = np.concatenate([[0], np.asarray(condition, np.int8), [0]])
    edges = np.flatnonzero(np.diff(padded))
    return [(int(i), int(j) - 1) for i, j in zip(edges[::2], edges[1::2], strict=True)]


def largest_force(data):
    """Return the largest dynamic mesh force in a dataset, without its sign, as a DataArray."""
    largest = np.maximum(data.dynamic_force_max, -data.dynamic_force_min)
    return largest.assign_attrs(data.dynamic_force_max.attrs)


def force_ratio(data):
    """Return the largest over the static mesh force in a dataset of a model that states it."""
    return data["dynamic_factor" if "dynamic_factor" in data else "peak_force_ratio"]


def mask_unbounded(sweep, extent):
    """Return a result of `gearlib.sweep` with NaN at tunings where the motion is unbounded.

    `extent` is the largest length of the model in static deflections, as returned by
    `Model.extent`. Motions beyond `MAX_RELATIVE_DISPLACEMENT` times this length are unbounded.
    """
    displacement = np.maximum(abs(sweep.displacement_max), abs(sweep.displacement_min))
    other_dims = [dim for dim in displacement.dims if dim != "tuning"]
    is_bounded = displacement.max(other_dims) <= MAX_RELATIVE_DISPLACEMENT * extent
    over_tuning = [name for name, values in sweep.data_vars.items() if "tuning" in values.dims]
    floats = [name for name in over_tuning if sweep[name].dtype.kind == "f"]
    return sweep.assign({name: sweep[name].where(is_bounded) for name in floats})


def period_spread(run):
    """Return the largest displacement difference between mesh periods at the same phase.

    It is relative to the peak-to-peak displacement. `run` is a result of `gearlib.simulate`. With a
    spread below `LINE_WIDTH` all mesh periods coincide in plots.
    """
    import pandas

    # Samples at the same phase of a mesh period form a group.
    phases = np.round(run.phase.values / (2.0 * np.pi) % 1.0, 9) % 1.0
    groups = pandas.Series(run.displacement.values).groupby(phases)
    return float((groups.max() - groups.min()).max() / np.ptp(run.displacement.values))


def describe_unsettled(run):
    """Return the phrase that the motion of a run has not settled."""
    return f"not settled after {int(run.followed)} mesh periods"


def describe_settling(run):
    """Return a phrase on the period of the orbit on which a run settles after its record."""
    period = int(run.period)
    if not period:
        return describe_unsettled(run)
    return f"settles later on {period} mesh period" + ("s" if period > 1 else "")


def describe_steadiness(run):
    """Return a phrase on whether mesh periods of a run coincide in a plot, and how it settles."""
    settling = describe_settling(run)
    if period_spread(run) > LINE_WIDTH:
        return f"unsteady, {settling}"
    # Mesh periods may coincide within the width of a line before the run settles.
    return "steady, 1 mesh period" if int(run.period) == 1 else f"a single line, {settling}"


def describe_contact_loss(sweeps):
    """Return a sentence on the speeds at which sweeps of pairs of teeth lose contact.

    `sweeps` are results of `gearlib.sweep` over ``tuning``, with further dimensions or without.
    """
    others = [dim for dim in sweeps.contact_loss_fraction.dims if dim != "tuning"]
    loses = (sweeps.contact_loss_fraction > FRACTION_TOLERANCE).any(others).values
    speed, factor = sweeps.speed.values, float(sweeps.dynamic_factor.max())
    intervals = [
        f"{speed[i]:.0f} to {speed[j]:.0f}" if j > i else f"{speed[i]:.0f}"
        for i, j in true_intervals(loses)
    ]
    lost = f"lose contact at {', '.join(intervals)} rpm" if intervals else "keep contact"
    return f"Pairs of teeth {lost}; their largest dynamic factor is {factor:.3g}."


def describe(run, start="rest"):
    """Return a sentence on the period and the contact loss of a run of `gearlib.simulate`.

    `start` says from which state the motion started.
    """
    if int(run.status):
        return run.status.attrs["message"]
    period, bounces = int(run.period), f"{float(run.bounces):.3g} times"
    motion = f"repeats every {period} mesh periods" if period > 1 else "repeats every mesh period"
    if not period:
        motion = f"has {describe_unsettled(run)}"
    contact = "the flanks never part"
    if float(run.fraction_coast) > 0.0:
        contact = "it strikes both flanks"
    elif float(run.bounces) > 0.0:
        times = "once" if bounces == "1 times" else bounces
        contact = f"it loses contact {times} per mesh period"
    return f"The motion from {start} {motion}; {contact}."

"""Contact loss, growth and settling of the motion in a dataset."""

import numpy as np

#: Fractions of time that differ by less count as equal, because of rounding errors.
FRACTION_TOLERANCE = 1e-9
#: Line width of a plot relative to the width of an orbit: 0.3 mm in a phase plane of 3 cm.
LINE_WIDTH = 0.01
#: Largest displacement, relative to the extent of the model, of motions that count as bounded.
MAX_RELATIVE_DISPLACEMENT = 1e3


def float_array(numbers):
    """Return numbers as an array of floats, or an empty array if they are not all numbers.

    `numbers` is a number or a sequence. The caller can reject an empty array with its own message.
    """
    try:
        array = np.asarray(numbers)
        # Bool and text arrays do not count as numbers; object arrays may hold numbers.
        if array.dtype.kind in "iufO":
            return array.astype(float, copy=False)
        return np.empty(0)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def true_intervals(condition):
    """Return (first index, last index) of each interval of true values in a sequence.

    `condition`, shape (n,), holds the bool values; an interval is a run of successive true values.
    """
    padded = np.concatenate([[0], np.asarray(condition, np.int8), [0]])
    changes = np.flatnonzero(np.diff(padded))
    # Intervals start at the even changes and end before the odd changes.
    starts, ends = changes[::2], changes[1::2]
    return [(int(start), int(end) - 1) for start, end in zip(starts, ends, strict=True)]


def largest_force(data):
    """Return the largest absolute dynamic mesh force in a dataset as a DataArray."""
    largest = np.maximum(data.dynamic_force_max, -data.dynamic_force_min)
    return largest.assign_attrs(data.dynamic_force_max.attrs)


def force_ratio(data):
    """Return the ratio of largest to static mesh force in a dataset.

    It is called dynamic_factor in models with pairs of teeth under load, and peak_force_ratio in
    models with a given stiffness.
    """
    if "dynamic_factor" in data:
        return data["dynamic_factor"]
    return data["peak_force_ratio"]


def mask_unbounded(sweep, extent):
    """Return a result of `gearlib.sweep` with NaN at tunings where the motion is unbounded.

    `extent` is the largest length of the model, such as its backlash, in static deflections.
    Motions beyond `MAX_RELATIVE_DISPLACEMENT` times this length count as unbounded. Integer
    variables such as the status are kept.
    """
    displacement = np.maximum(abs(sweep.displacement_max), abs(sweep.displacement_min))
    other_dims = [dim for dim in displacement.dims if dim != "tuning"]
    is_bounded = displacement.max(other_dims) <= MAX_RELATIVE_DISPLACEMENT * extent
    masked = {}
    for name, variable in sweep.data_vars.items():
        if "tuning" in variable.dims and variable.dtype.kind == "f":
            masked[name] = variable.where(is_bounded)
    return sweep.assign(masked)


def period_spread(run):
    """Return the largest difference of displacements at the same phase of different mesh periods.

    It is relative to the peak-to-peak displacement. `run` is a result of `gearlib.simulate`. If it
    is below `LINE_WIDTH`, all mesh periods coincide in plots.
    """
    import pandas

    # Samples at the same phase of a mesh period form a group.
    phases = np.round(run.phase.values / (2.0 * np.pi) % 1.0, 9) % 1.0
    groups = pandas.Series(run.displacement.values).groupby(phases)
    return float((groups.max() - groups.min()).max() / np.ptp(run.displacement.values))


def describe_unsettled(run):
    """Return a phrase that a run has not become periodic, with the mesh periods followed."""
    return f"not settled after {int(run.followed)} mesh periods"


def describe_settling(run):
    """Return a phrase on the periodic orbit that a run reaches after its record.

    `run` is a result of `gearlib.simulate`. Its variable `period` is the number of mesh periods
    after which the motion repeats, 0 if it has not settled, that is, become periodic.
    """
    period = int(run.period)
    if period == 0:
        return describe_unsettled(run)
    plural = "s" if period > 1 else ""
    return f"settles later on {period} mesh period{plural}"


def describe_steadiness(run):
    """Return a phrase on whether the mesh periods of a run coincide in a plot, and how it settles.

    `run` is a result of `gearlib.simulate`; its `period` is the number of mesh periods after which
    the motion repeats once it has settled, that is, become periodic.
    """
    settling = describe_settling(run)
    if period_spread(run) > LINE_WIDTH:
        return f"unsteady, {settling}"
    if int(run.period) == 1:
        return "steady, 1 mesh period"
    # Mesh periods may coincide within the width of a line before the run settles.
    return f"a single line, {settling}"


def describe_contact_loss(sweeps):
    """Return a sentence on the speeds at which pairs of teeth lose contact in sweeps.

    `sweeps` is a dataset of one or more results of `gearlib.sweep`, over ``tuning`` (mesh frequency
    over natural frequency) and possibly further dimensions.
    """
    other_dims = [dim for dim in sweeps.contact_loss_fraction.dims if dim != "tuning"]
    loses_contact = (sweeps.contact_loss_fraction > FRACTION_TOLERANCE).any(other_dims).values
    speeds = sweeps.speed.values
    intervals = []
    for start, end in true_intervals(loses_contact):
        interval = f"{speeds[start]:.0f}"
        if end > start:
            interval += f" to {speeds[end]:.0f}"
        intervals.append(interval)
    contact = "keep contact"
    if intervals:
        contact = f"lose contact at {', '.join(intervals)} rpm"
    factor = float(sweeps.dynamic_factor.max())
    return f"Pairs of teeth {contact}; their largest dynamic factor is {factor:.3g}."


def describe(run, start="rest"):
    """Return a sentence on the period and the contact loss of a run of `gearlib.simulate`.

    `start` names the state from which the motion started. If the run failed, its status is not 0,
    and the sentence is the message of the status.
    """
    if int(run.status):
        return run.status.attrs["message"]
    period = int(run.period)
    if period == 0:
        motion = f"has {describe_unsettled(run)}"  # It has not become periodic.
    elif period == 1:
        motion = "repeats every mesh period"
    else:
        motion = f"repeats every {period} mesh periods"
    if float(run.fraction_coast) > 0.0:
        contact = "it strikes both flanks"
    elif float(run.bounces) > 0.0:
        bounces = f"{float(run.bounces):.3g}"
        times = "once" if bounces == "1" else f"{bounces} times"
        contact = f"it loses contact {times} per mesh period"
    else:
        contact = "the flanks never part"
    return f"The motion from {start} {motion}; {contact}."

"""Contact loss, boundedness and settling of motions, evaluated from datasets of runs."""

import numpy as np

#: Differences of time fractions below this value may be rounding errors.
FRACTION_TOLERANCE = 1e-9
#: Line width relative to the width of the plotted orbit: 0.3 mm in a phase plane of 3 cm.
LINE_WIDTH = 0.01
#: Motions with larger displacements, relative to the size of the model, count as unbounded.
MAX_RELATIVE_DISPLACEMENT = 1e3


def as_float_array(numbers):
    """Return a number or a sequence of numbers as an array of floats.

    If it contains anything but numbers, return an empty array, which the caller can reject.
    """
    try:
        array = np.asarray(numbers)
        # Booleans and strings are not numbers; object arrays may contain numbers.
        if array.dtype.kind in "iufO":
            return array.astype(float, copy=False)
        return np.empty(0)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def true_intervals(condition):
    """Return (first index, last index) of each run of consecutive true values.

    `condition` is a sequence of n bools.
    """
    padded = np.concatenate([[0], np.asarray(condition, np.int8), [0]])
    changes = np.flatnonzero(np.diff(padded))
    starts, ends = changes[::2], changes[1::2]
    return [(int(start), int(end) - 1) for start, end in zip(starts, ends, strict=True)]


def largest_force(data):
    """Return the largest absolute dynamic mesh force in a dataset as a DataArray."""
    largest = np.maximum(data.dynamic_force_max, -data.dynamic_force_min)
    return largest.assign_attrs(data.dynamic_force_max.attrs)


def force_ratio(data):
    """Return the largest mesh force over its static value, from a dataset.

    It is called dynamic_factor in models with load sharing between tooth pairs, else
    peak_force_ratio.
    """
    if "dynamic_factor" in data:
        return data["dynamic_factor"]
    return data["peak_force_ratio"]


def mask_unbounded(sweep, extent):
    """Replace the variables of a sweep by NaN at tunings where the motion is unbounded.

    A motion counts as unbounded if its displacement exceeds `MAX_RELATIVE_DISPLACEMENT` times
    `extent`, the largest length of the model, e.g. its backlash, in units of the static deflection.
    Integer variables such as the status are kept. `sweep` is a result of `gearlib.sweep`.
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
    """Return the largest difference of the displacement between mesh periods at equal phase.

    It is relative to the peak-to-peak displacement; below `LINE_WIDTH`, all mesh periods coincide
    in plots. `run` is a result of `gearlib.simulate`.
    """
    import pandas

    # Samples at the same phase of their mesh periods form a group.
    phases = np.round(run.phase.values / (2.0 * np.pi) % 1.0, 9) % 1.0
    groups = pandas.Series(run.displacement.values).groupby(phases)
    return float((groups.max() - groups.min()).max() / np.ptp(run.displacement.values))


def describe_unsettled(run):
    """Return "not settled after ... mesh periods", for a run that has not become periodic."""
    return f"not settled after {int(run.followed)} mesh periods"


def describe_settling(run):
    """Describe in a phrase on which periodic orbit a run settles after its record, if any.

    `run` is a result of `gearlib.simulate`. Its variable `period` is the number of mesh periods
    after which the motion repeats, 0 if it has not settled.
    """
    period = int(run.period)
    if period == 0:
        return describe_unsettled(run)
    plural = "s" if period > 1 else ""
    return f"settles later on {period} mesh period{plural}"


def describe_steadiness(run):
    """Describe in a phrase whether the mesh periods of a run coincide in a plot, and if it settles.

    `run` is a result of `gearlib.simulate`.
    """
    settling = describe_settling(run)
    if period_spread(run) > LINE_WIDTH:
        return f"unsteady, {settling}"
    if int(run.period) == 1:
        return "steady, 1 mesh period"
    # Mesh periods may coincide within the line width before the run has settled.
    return f"a single line, {settling}"


def describe_contact_loss(sweeps):
    """Describe in a sentence at which speeds tooth pairs lose contact, and their dynamic factor.

    `sweeps` is a dataset of results of `gearlib.sweep` over ``tuning`` and possibly further
    dimensions.
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
    contact = f"lose contact at {', '.join(intervals)} rpm" if intervals else "keep contact"
    dynamic_factor = float(sweeps.dynamic_factor.max())
    return f"Pairs of teeth {contact}; their largest dynamic factor is {dynamic_factor:.3g}."


def describe_motion(run, start="rest"):
    """Describe in a sentence the period and the contact loss of a run of `gearlib.simulate`.

    `start` names the initial state. If the run failed, return the message of its status.
    """
    if int(run.status):
        return run.status.attrs["message"]
    period = int(run.period)
    if period == 0:
        motion = f"has {describe_unsettled(run)}"
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

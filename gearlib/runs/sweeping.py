"""`sweep`: summaries of the orbits of a model at many tunings."""

import functools
import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gearlib import checks
from gearlib.data import summary
from gearlib.data.result import make_result
from gearlib.parameters import Count, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import (
    DIRECTIONS,
    MAX_EVENTS,
    Direction,
    MaxSeconds,
    RunArguments,
    SweepTables,
    Threads,
    check_run_arguments,
    check_sweep_memory,
    check_tuning,
    is_valid_tuning,
    require_tuning_or_speed,
    tuning_at_speed,
)

#: Directions of warm-started sweeps, in which each run starts from the final state of the previous
#: run.
WARM_STARTED = DIRECTIONS[1:]

#: Smallest and largest number of tunings in the chunk of a thread: larger chunks have less
#: overhead, smaller chunks balance the load of the threads.
_MIN_CHUNK, _MAX_CHUNK = 16, 128
#: A downward sweep is extended down to this fraction of its lowest tuning.
EXTENSION_RATIO = 0.2
#: Motions agree if their extrema differ by less than this, relative to the displacement range.
_SAME_MOTION_TOLERANCE = 1e-3


@checked
def sweep(
    model,
    tunings=None,
    *,
    speeds=None,
    periods: Count,
    record_periods: Count,
    initial_state=(0.0, 0.0),
    direction: Direction = "cold",
    method=None,
    options=None,
    max_events: Count = MAX_EVENTS,
    threads: Threads = None,
    max_seconds: MaxSeconds = None,
):
    """Run a model at many tunings and summarise the last mesh periods of each run.

    Parameters
    ----------
    model : GearPair, LoadSharingPair, OneDegreePair, SixDegreePair, DeadZoneOscillator or GearTrain
        The model to run.
    tunings : array_like of float, shape (n,)
        Tunings nu = mesh frequency / mean eigenfrequency, finite, > 0, all different. Give either
        `tunings` or `speeds`.
    speeds : array_like of float, shape (n,)
        Speeds in rpm, finite, > 0, all different, of the gear whose teeth define the mesh frequency
        (for a train, the reference pinion).
    periods, record_periods : int
        Number of mesh periods of each run, and of mesh periods at its end that are summarised.
    initial_state : tuple of float, default (0, 0)
        Displacement in units of the static deflection and velocity dx/dtau at tau = 0.
    direction : {"cold", "up", "down"}
        "cold" starts every run from `initial_state`. "up" and "down" show hysteresis: the tuning
        increases from the lowest or decreases from the highest value, and each run starts from the
        final state of the previous run, or from `initial_state` if the previous run failed. Tunings
        must increase for "up", and increase or decrease for "down". With run-out, the gears keep
        their angles from run to run, as in a slow run-up. Six degrees of freedom require the method
        "exact".
    method : str, optional
        A name of `gearlib.methods`. By default "exact" if that method can run the model, otherwise
        "taylor". The other methods are for comparison; they evaluate extrema only at step ends.
    options : dict, optional
        Options of the method, see `gearlib.methods`.
    max_events : int
        Largest number of arcs (intervals of contact or free flight) in a mesh period. A run that
        needs more is stopped.
    threads : int, optional
        Number of threads of a cold sweep, by default one per processor. The result does not
        depend on it.
    max_seconds : float, optional
        Time limit in seconds, after which the results computed so far are returned; see
        `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Along ``tuning``, in the order of the argument: displacement_max, displacement_min,
        dynamic_force_max, dynamic_force_min, the extrema of the closed-form solution;
        fraction_drive, contact_loss_fraction, fraction_coast, fraction_min_stiffness (contact at
        the minimum stiffness), fractions of time; bounces, losses of drive-side contact per mesh
        period; period, the number of mesh periods, up to 16, after which the steady state repeats,
        proven by its Floquet multipliers and its distance from grazing, or 0 if it is not proven
        (see `until_settled` of `simulate`). With run-out, period may also be 1 to 16 times the
        period of the run-out. With a comparison method, a motion repeats if its states agree to
        1e-6 of the displacement range. final_state (tuning, component); status (where it is not 0,
        all other variables are NaN); the scales to SI.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its name, its value and what is allowed.
    """
    require_tuning_or_speed(model, "tunings", tunings, "speeds", speeds)
    if speeds is None:
        argument_name = "tunings"
        tunings = check_tunings("tunings", tunings, check_tuning)
    else:
        argument_name = "speeds"
        check_speed = functools.partial(tuning_at_speed, model)
        speeds = check_tunings("speeds", speeds, check_speed, model.tuning_at)
        tunings = model.tuning_at(speeds)
    arguments = check_run_arguments(
        model, periods, record_periods, initial_state, method, options, max_events
    )
    _check_tuning_order(direction, tunings, argument_name)
    allowed = f"'cold' for six degrees of freedom with the method {arguments.method!r}, unlike "
    allowed += "with 'exact', which records the full final state"
    # Other methods do not return all six coordinates of the final state.
    is_full_state = arguments.method == "exact" or model.size == 2
    checks.require(direction == "cold" or is_full_state, "direction", direction, allowed)
    limit = TimeLimit(max_seconds)
    check_sweep_memory(model, f"a sweep of {tunings.size:,} tunings", tunings.size)
    rows = _run_sweep(model, tunings, arguments, direction, threads or os.cpu_count(), limit)
    data = {
        **summary.summary_variables(model, ("tuning",), *rows[1:], record_periods),
        **model.scales(),
        **{name: ("tuning", scale) for name, scale in model.speed_scales(tunings).items()},
    }
    coords = {"tuning": tunings, **model.coordinates()}
    attributes = arguments.attributes() | {"direction": direction}
    title = "Resonance characteristic of a gear mesh"
    dataset = make_result(title, model, data, coords, **attributes)
    return limit.record_missing(dataset, tuning=rows.outcomes[:, 1] >= 0)


def _run_sweep(
    model, tunings, arguments: RunArguments, direction, threads: int, limit
) -> SweepTables:
    """Run a model at all tunings of a sweep; return `SweepTables` with one row per tuning.

    `tunings`, shape (n,), are ratios of mesh frequency to natural frequency in any order.
    `arguments` are the initial state, the mesh periods and the integration method of each run. With
    the direction "cold" all runs start from the initial state and are distributed to `threads`
    threads; with "up" or "down" each starts from the final state of the previous one. Rows that are
    not computed when the time `limit` is over have the status -1.
    """
    _, _, summary_table = model.empty_record()
    rows = SweepTables(
        # A motion with a larger displacement counts as unbounded.
        max_displacement=model.displacement_limit(float(tunings.max()), arguments.state),
        summaries=np.full((tunings.size, *summary_table.shape), np.nan),
        final_states=np.full((tunings.size, len(model.components)), np.nan),
        outcomes=np.full((tunings.size, 2), -1),  # period and status; -1: not yet computed
    )
    is_warm_started = direction != "cold"
    run_arguments = arguments.state, is_warm_started, arguments.span, rows

    def run_tunings(indices):
        """Run the model at the tunings with the given indices, in this order; fill their rows."""
        arguments.module.sweep(model, tunings, indices, *run_arguments, **arguments.options)

    order = np.argsort(tunings)
    if direction == "down":
        order = order[::-1].copy()
    chunk_size = min(max(order.size // (4 * threads), _MIN_CHUNK), _MAX_CHUNK)
    chunks = [order[i : i + chunk_size] for i in range(0, order.size, chunk_size)]
    # The kernel of a `GearPair` processes an array of tunings; other models run one by one.
    takes_arrays = arguments.method == "exact" and model.pair is model and not limit.is_set
    if is_warm_started or threads == 1 or len(chunks) < 2:
        run_tunings(
            order
            if takes_arrays
            else with_progress_bar("tunings", limit.iterate(order), order.size)
        )
    else:
        parts = chunks if takes_arrays else map(limit.iterate, chunks)
        # Kernels release the interpreter lock, so threads run in parallel.
        with ThreadPoolExecutor(threads) as pool:
            list(with_progress_bar("parts of the sweep", pool.map(run_tunings, parts), len(chunks)))
    return rows


def _check_tuning_order(direction: str, tunings: np.ndarray, name: str):
    """Raise ValueError unless the order of the tunings, shape (n,), is allowed for the direction.

    Tunings must increase for the direction "up" and either increase or decrease for "down". Any
    order is allowed for "cold", where runs are independent. `name` is the name of the argument in
    the error message.
    """
    if direction == "cold":
        return
    steps = np.diff(tunings)
    if direction == "up":
        order, is_allowed = "increasing", (steps > 0.0).all()
    else:
        order = "increasing or decreasing"
        is_allowed = (steps > 0.0).all() or (steps < 0.0).all()
    if not is_allowed:
        raise ValueError(
            f"{name} are out of order: direction {direction!r} requires {order} values"
        )


def sweep_down(model, tunings: np.ndarray, min_tuning: float, **sweep_options):
    """Sweep a model downwards to a tuning at which the motion agrees with an upward sweep.

    Below this tuning (mesh frequency / natural frequency) there is no hysteresis. `tunings`, shape
    (n,), increase in equal steps; the downward sweep continues in these steps below the lowest of
    them, at most to the tuning `min_tuning`. `sweep_options` are other arguments of `sweep`, such
    as periods. Return (dataset of the downward sweep, whether the motions agree anywhere). The
    dataset starts at the highest tuning <= `tunings[0]` at which they agree, or else at the lowest
    tuning.
    """
    first_tuning, step = float(tunings[0]), float(tunings[1] - tunings[0])
    # The added 1e-9 allows for rounding errors, so that `min_tuning` itself is included.
    added_count = max(0, math.floor((first_tuning - min_tuning) / step + 1e-9))
    added_tunings = np.round(first_tuning - step * np.arange(added_count, 0, -1), 12)
    curve = sweep(
        model, np.concatenate([added_tunings, tunings]), direction="down", **sweep_options
    )
    if not curve.get("complete", True):
        # The time limit ended the sweep.
        return curve, False
    down = curve.isel(tuning=slice(added_count + 1))
    up = sweep(model, down.tuning.values, direction="up", **sweep_options)
    agreeing_indices = np.flatnonzero(motions_agree(up, down))
    if not agreeing_indices.size:
        return curve, False
    return curve.isel(tuning=slice(agreeing_indices[-1], None)), True


def motions_agree(up, down) -> np.ndarray:
    """Return a mask, shape (n,), of the tunings at which two sweeps have the same motion.

    `up` and `down` are datasets of `sweep` over the same tunings. Motions are the same if their
    displacement extrema agree to 0.1 % of the displacement range.
    """
    displacement_range = up.displacement_max - up.displacement_min
    max_differences = np.abs(down.displacement_max - up.displacement_max)
    min_differences = np.abs(down.displacement_min - up.displacement_min)
    differences = np.maximum(max_differences, min_differences)
    return (differences <= _SAME_MOTION_TOLERANCE * displacement_range).values


def check_tunings(name: str, tunings, check, tuning_at=np.asarray) -> np.ndarray:
    """Return the tunings or speeds of a sweep as a float array, shape (n,), or raise ValueError.

    They must be valid and all different. `name` is the name of the argument in error messages,
    `check(name, value)` is a function that raises ValueError if a value is invalid, and `tuning_at`
    converts an array of values to tunings (ratios of mesh frequency to natural frequency). By
    default the values are tunings.
    """
    try:
        values = np.atleast_1d(np.asarray(tunings))
    except (TypeError, ValueError):
        values = np.empty((0, 0))
    allowed = "a non-empty sequence of numbers"
    checks.require(values.ndim == 1 and values.size != 0, name, tunings, allowed)
    # The values must be integers or floats in the allowed range.
    if values.dtype.kind not in "iuf" or not is_valid_tuning(tuning_at(values.astype(float))).all():
        # The check raises an error that states the first invalid value.
        for i, value in enumerate(values.tolist()):
            check(f"{name}[{i}]", value)
    values = values.astype(float)
    unique, counts = np.unique(values, return_counts=True)
    if unique.size < values.size:
        repeated = float(unique[counts > 1][0])
        raise ValueError(f"{name} contain {repeated!r} more than once: all must be different")
    return values

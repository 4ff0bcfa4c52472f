"""`sweep`: summaries of the orbits of a model at many tunings."""

import functools
import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gearlib import checks, notebook
from gearlib.data import summary
from gearlib.data.result import result
from gearlib.runs.run_arguments import (
    MAX_EVENTS,
    Rows,
    RunArguments,
    allowed,
    check_either,
    check_rows,
    check_run,
    check_speed,
    check_tuning,
)

DIRECTIONS = ("cold", "up", "down")
#: Directions in which runs are warm-started: each starts from the final state of the last one.
CARRIED = DIRECTIONS[1:]

#: Limits of the number of tunings that a thread gets at a time: larger chunks have less overhead,
#: smaller chunks balance the load of the threads.
_MIN_CHUNK, _MAX_CHUNK = 16, 128
#: Lowest tuning of the extension of a downward sweep, as a share of its first tuning.
LOWEST_SHARE = 0.2
#: Motions count as equal if their extrema differ by less than this share of their height.
_SAME_MOTION_TOLERANCE = 1e-3


def sweep(
    pair,
    tunings=None,
    *,
    speeds=None,
    periods,
    record_periods,
    initial_state=(0.0, 0.0),
    direction="cold",
    method=None,
    options=None,
    max_events=MAX_EVENTS,
    threads=None,
):
    """Run a model at many tunings and summarise the last mesh periods of each run.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair, DeadZoneOscillator or GearTrain
        The model to run.
    tunings : array_like of float, shape (n,)
        Tunings nu = mesh frequency / mean eigenfrequency, finite, > 0, all different. Give either
        `tunings` or `speeds`.
    speeds : array_like of float, shape (n,)
        Speeds in rpm, finite, > 0, all different, of the gear whose teeth define the mesh frequency
        (of a train, the reference pinion).
    periods, record_periods : int
        Number of mesh periods of each run, and of those that are summarised at its end.
    initial_state : tuple of float, default (0, 0)
        Displacement in static deflections and velocity dx/dtau at tau = 0.
    direction : {"cold", "up", "down"}
        "cold" starts every run from `initial_state`. "up" and "down" show hysteresis: they run from
        the lowest tuning up or from the highest down, and each run starts from the final state of
        the last one, or from `initial_state` if that has failed. Tunings must rise for "up", and
        rise or fall for "down". With run-out the gears keep their angles from run to run, as in a
        slow run-up; six degrees of freedom need the method "exact".
    method : str, optional
        A name of `gearlib.methods`. By default "exact" if that method can run the model, otherwise
        "taylor". The other methods serve for comparison and give extrema of step ends.
    options : dict, optional
        Options of the method, see `gearlib.methods`.
    max_events : int
        Largest number of arcs (phases of contact and flights) in one mesh period. A run that needs
        more is stopped.
    threads : int, optional
        Number of threads of a cold sweep, by default one for each processor. The result does not
        depend on it.

    Returns
    -------
    xarray.Dataset
        Along ``tuning``, in the order of the argument: displacement_max, displacement_min,
        dynamic_force_max, dynamic_force_min, extrema of the closed forms (not of samples);
        fraction_normal, fraction_backlash, fraction_inverse, fraction_min_stiffness (contact at
        C_min), shares of time; bounces, losses of drive-side contact per mesh period; period, the
        number of mesh periods, up to 16, after which the settled orbit repeats, proven by its
        Floquet multipliers and its distance from grazing; 0 without a proof, see `until_settled` of
        `simulate`. With run-out, period may also be 1 to 16 times the period of the run-out. The
        methods for comparison compare states, to 1e-6 of the height of the orbit. final_state
        (tuning, component); status, with NaN in all other variables where it is not 0; the scales
        to SI.

    Raises
    ------
    ValueError
        If an argument is wrong; the message gives its name, its value and the allowed range.
    """
    check_either(pair, "tunings", tunings, "speeds", speeds)
    if speeds is None:
        tunings = check_tunings("tunings", tunings, check_tuning)
    else:
        check = functools.partial(check_speed, pair)
        tunings = pair.tuning_at(check_tunings("speeds", speeds, check, pair.tuning_at))
    checked = check_run(pair, periods, record_periods, initial_state, method, options, max_events)
    checks.one_of("direction", direction, DIRECTIONS)
    _check_order(direction, tunings, "tunings" if speeds is None else "speeds")
    if direction != "cold" and checked.method != "exact" and pair.size > 2:
        raise ValueError(
            f"direction = {direction!r} is not allowed for six degrees of freedom by method "
            f"{checked.method!r}: it must be 'cold', or the method 'exact', which carries all "
            "coordinates along"
        )
    threads = os.cpu_count() if threads is None else checks.integer("threads", threads, 1)

    check_rows(pair, f"a sweep of {tunings.size:,} tunings", tunings.size)
    rows = _rows(pair, tunings, checked, direction, threads)
    data = {
        **summary.variables(pair, ("tuning",), *rows[1:], checked.span.recorded),
        **pair.scales(),
        **{name: (("tuning",), x) for name, x in pair.speed_scales(tunings).items()},
    }
    coords = {"tuning": tunings, **pair.coordinates()}
    attributes = checked.attributes() | {"direction": direction}
    return result("Resonance characteristic of a gear mesh", pair, data, coords, **attributes)


def _rows(pair, tunings: np.ndarray, checked: RunArguments, direction: str, threads: int) -> Rows:
    """Run a sweep of a model with the arguments `checked`; return its `Rows`, one per tuning.

    `direction` is "cold", "up" or "down", see `sweep`; a cold sweep uses several threads.
    """
    rows = Rows(
        pair.bound(float(tunings.max()), checked.state),
        np.empty((tunings.size, *pair.empty_record()[2].shape)),
        np.empty((tunings.size, len(pair.components))),
        np.full((tunings.size, 2), -1),  # -1: not yet computed
    )
    is_warm_started = direction != "cold"

    def run_tunings(order):
        arguments = checked.state, is_warm_started, checked.span, rows
        checked.module.sweep(pair, tunings, order, *arguments, **checked.options)

    order = np.argsort(tunings)
    if direction == "down":
        order = order[::-1].copy()
    chunk_size = min(max(order.size // (4 * threads), _MIN_CHUNK), _MAX_CHUNK)
    chunks = [order[i : i + chunk_size] for i in range(0, order.size, chunk_size)]
    with notebook.bar("tunings", tunings.size, lambda: int((rows.codes[:, 1] >= 0).sum())):
        if is_warm_started or threads == 1 or len(chunks) < 2:
            run_tunings(order)
        else:
            # Kernels release the interpreter lock, so threads run in parallel.
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(run_tunings, chunks))
    return rows


def _check_order(direction: str, tunings: np.ndarray, name: str):
    """Raise ValueError, naming the argument `name`, unless the tunings suit the sweep direction.

    They must rise for "up", rise or fall for "down", and may have any order for "cold".
    """
    rises, falls = (np.diff(tunings) > 0.0).all(), (np.diff(tunings) < 0.0).all()
    is_allowed = {"cold": True, "up": rises, "down": rises or falls}
    if not is_allowed[direction]:
        order = "rising" if direction == "up" else "rising or falling"
        raise ValueError(f"{name} out of order are not allowed: {direction!r} needs {order} values")


def sweep_down(pair, tunings: np.ndarray, lowest: float, **settings):
    """Sweep down until the motion agrees with an upward sweep; return (dataset, agree).

    `tunings`, shape (n,), rise in equal steps; the sweep continues below them in the same steps, to
    the tuning `lowest` at most. `settings` are other arguments of `sweep`. The tunings of the
    dataset rise and begin where both motions agree; `agree` is False if they agree nowhere.
    """
    first, step = float(tunings[0]), float(tunings[1] - tunings[0])
    count = max(0, math.floor((first - lowest) / step + 1e-9))
    below = np.round(first - step * np.arange(count, 0, -1), 12)
    curve = sweep(pair, np.concatenate([below, tunings]), direction="down", **settings)
    down = curve.isel(tuning=slice(count + 1))
    up = sweep(pair, down.tuning.values, direction="up", **settings)
    height = up.displacement_max - up.displacement_min
    errors = [np.abs(down[name] - up[name]) for name in ("displacement_max", "displacement_min")]
    same = np.flatnonzero(np.maximum(*errors) <= _SAME_MOTION_TOLERANCE * height)
    first_index = same[-1] if same.size else 0
    return curve.isel(tuning=slice(first_index, None)), bool(same.size)


def check_tunings(name: str, tunings, check, tuning_at=np.asarray) -> np.ndarray:
    """Return the tunings or speeds of a sweep as a float array, shape (n,), or raise ValueError.

    `name` is the name of the argument for messages. `check(name, value)` raises ValueError for a
    wrong value; `tuning_at` converts an array of speeds to tunings. All values must be different.
    """
    try:
        values = np.atleast_1d(np.asarray(tunings))
    except ValueError:
        values = np.empty((0, 0))
    if values.ndim != 1 or values.size == 0:
        raise ValueError(
            f"{name} = {tunings!r} is not allowed: it must be a non-empty sequence of numbers"
        )
    if values.dtype.kind not in "iuf" or not allowed(tuning_at(values.astype(float))).all():
        # The check of each value raises an error that names the first wrong value.
        for i, value in enumerate(values.tolist()):
            check(f"{name}[{i}]", value)
    values = values.astype(float)
    unique, counts = np.unique(values, return_counts=True)
    if unique.size < values.size:
        repeated = float(unique[counts > 1][0])
        raise ValueError(f"{name} contains {repeated!r} twice: all {name} must be different")
    return values

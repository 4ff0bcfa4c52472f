"""`sweep`: one gear pair over many tunings, the summary of each orbit."""

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
#: Directions in which each run starts from the final state of the run before.
CARRIED = DIRECTIONS[1:]

#: Limits of the number of tunings that a thread gets at a time: larger chunks have less overhead,
#: smaller chunks balance the load of the threads.
_MIN_CHUNK, _MAX_CHUNK = 16, 128
#: End of a downward sweep as a share of its range, and tolerance of extrema of the same motion.
LOWEST_SHARE, _SAME_MOTION_TOLERANCE = 0.2, 1e-3


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
    """Run a gear pair at many tunings and summarise the end of each run.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
    tunings : array_like of float, shape (n,)
        Each finite and > 0, all different. Or instead of them:
    speeds : array_like of float, shape (n,)
        In rpm, of the gear whose teeth count (the reference pinion of a train).
    periods, record_periods : int
        Mesh periods of each run, and how many of them, at the end, are summarised.
    initial_state : tuple of float, default (0, 0)
        Displacement in static deflections and dx/dtau at tau = 0.
    direction : {"cold", "up", "down"}
        "cold" starts every tuning from `initial_state`. "up" goes through rising tunings, "down"
        through rising or falling ones from the highest on, each run starting from the final state
        of the one before it, which shows hysteresis; after a run that could not go on, from
        `initial_state`.
        With run-out the gears go on turning from where they are, as in a slow run-up; six degrees
        of freedom do so by method "exact" only.
    method : str, optional
        A name of `gearlib.methods`; by default "exact" where it takes the model, else "taylor".
        The others are for comparison; their extrema are those of their step ends.
    options : dict, optional
        Options of the method, see `gearlib.methods`.
    max_events : int
        Most phases of contact and flights in one mesh period before a run gives up.
    threads : int, optional
        Threads of a cold sweep, all processors by default. The result does not depend on it.

    Returns
    -------
    xarray.Dataset
        Over ``tuning``, in the order given: displacement_max, displacement_min,
        dynamic_force_max, dynamic_force_min, extrema of the closed forms (not of samples);
        fraction_normal, fraction_backlash, fraction_inverse, fraction_min_stiffness (in mesh at
        C_min), shares of time; bounces, losses of normal contact per mesh period; period, the
        mesh periods, up to 16, after which the orbit repeats on which the motion has settled: its
        Floquet multipliers draw what is left of the transient onto it, clear of any grazing. 0
        where that is not shown, `simulate` goes on until it is, if asked; with run-out period may
        also be 1 to 16 times the mesh periods after which that repeats. Methods for comparison
        compare states, to 1e-6 of the orbit's height. final_state (tuning, component);
        status, with NaN in all other variables where it is not 0; the scales to SI.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
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
    """Run a sweep and return its `Rows` in the order of the tunings."""
    rows = Rows(
        pair.bound(float(tunings.max()), checked.state),
        np.empty((tunings.size, *pair.empty_record()[2].shape)),
        np.empty((tunings.size, len(pair.components))),
        np.full((tunings.size, 2), -1),  # -1: not yet computed
    )
    carry = direction != "cold"

    def run_tunings(order):
        arguments = checked.state, carry, checked.span, rows
        checked.module.sweep(pair, tunings, order, *arguments, **checked.options)

    order = np.argsort(tunings)
    if direction == "down":
        order = order[::-1].copy()
    size = min(max(order.size // (4 * threads), _MIN_CHUNK), _MAX_CHUNK)
    chunks = [order[i : i + size] for i in range(0, order.size, size)]
    with notebook.bar("tunings", tunings.size, lambda: int((rows.codes[:, 1] >= 0).sum())):
        if carry or threads == 1 or len(chunks) < 2:
            run_tunings(order)
        else:
            # Kernels release the interpreter lock, so threads run in parallel.
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(run_tunings, chunks))
    return rows


def _check_order(direction, tunings, name):
    """Raise ValueError unless the tunings of a sweep up or down are sorted."""
    rises, falls = (np.diff(tunings) > 0.0).all(), (np.diff(tunings) < 0.0).all()
    if not {"cold": True, "up": rises, "down": rises or falls}[direction]:
        order = "rising" if direction == "up" else "rising or falling"
        raise ValueError(f"{name} out of order are not allowed: {direction!r} needs {order} values")


def sweep_down(pair, tunings, lowest, **settings):
    """Sweep down until the motion agrees with an upward sweep; return (dataset, agreement).

    `tunings`, (n,), rise in equal steps; the sweep continues below them in the same steps to
    `lowest` at most. `settings` are arguments of `sweep`. The tunings of the dataset rise and begin
    where both motions agree; `agreement` tells whether they do anywhere.
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
    return curve.isel(tuning=slice(same[-1] if same.size else 0, None)), bool(same.size)


def check_tunings(name, tunings, check, tuning_at=np.asarray):
    """Return different tunings or speeds as a float array, (n,), or raise ValueError.

    `check(name, value)` raises ValueError for a wrong value; `tuning_at` converts speeds.
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
        # The check of single values names the first wrong one.
        for i, value in enumerate(values.tolist()):
            check(f"{name}[{i}]", value)
    values = values.astype(float)
    unique, counts = np.unique(values, return_counts=True)
    if unique.size < values.size:
        repeated = float(unique[counts > 1][0])
        raise ValueError(f"{name} contains {repeated!r} twice: all {name} must be different")
    return values

"""Find the tuning at which the motion from rest jumps to another orbit, and what shifts the jump.

The jump is the largest change of orbit height between neighbouring tunings of a scan. It is refined
by bisection. If the heights on both sides become equal, the curve is continuous and has no jump.
The bisection stops where rounding errors decide on which side a motion ends. For step-controlled
methods, whose errors are much larger, jumps are computed from many initial states, each relative to
the exact jump from the same state.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib.analysis.lyapunov import SETTLED_FLAGS, are_sensitive_to_rounding
from gearlib.data.result import evaluate_on_grid
from gearlib.data.variables import add_metadata
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.runs.sweeping import sweep
from gearlib.studies import many_starts

#: Orbit heights that differ by less (in units of the static deflection) count as equal.
SAME_HEIGHT = 0.1
#: Inexact methods search for their jump within this number of tuning steps of the exact jump.
_SEARCH_STEPS = 4


class Jump(NamedTuple):
    """A jump of the orbit from rest between two tunings."""

    tuning: float  #: middle of the final interval; NaN if there is no jump
    below: float  #: peak-to-peak displacement below the jump, in static deflections
    above: float  #: peak-to-peak displacement above the jump, in static deflections
    large_steps: int  #: number of steps of the height in the scan, at least half the largest
    interval: float  #: width of the final interval; large if rounding errors stopped bisection


def find_jump(
    model: Any, tunings: Sequence[float], resolution: float, direction: str = "cold", **run: Any
) -> Jump:
    """Find the largest jump of the peak-to-peak displacement in a scan of increasing tunings.

    The tuning is mesh frequency over natural frequency. Bisection stops at an interval width of
    `resolution`. `run` has arguments of `gearlib.sweep`. In the direction "cold" all runs start
    from the same initial state, and tunings at which rounding errors decide the motion are
    excluded. In the directions "up" and "down", runs of the bisection start from the last state
    before the jump.
    """
    tunings = np.asarray(tunings, float)
    start = run.get("initial_state", (0.0, 0.0))
    # For step methods, rounding errors are negligible compared with their truncation errors.
    is_exact = "method" not in run
    scan = sweep(model, tunings, direction=direction, **run)
    heights = orbit_heights(scan)

    def depends_on_rounding(tunings: Sequence[float]) -> np.ndarray:
        """Return a mask of tunings at which rounding errors decide the motion."""
        return is_exact * are_sensitive_to_rounding(model, tunings, start, run["periods"])

    steps, is_large = height_steps(heights)
    while direction == "cold" and is_large.any():
        i = int(np.argmax(steps))
        is_uncertain = depends_on_rounding(tunings[i : i + 2])
        if not is_uncertain.any():
            break
        heights[i : i + 2][is_uncertain] = np.nan  # steps from or to NaN are 0
        steps, is_large = height_steps(heights)
    i = int(np.argmax(steps))
    lower, upper = tunings[i : i + 2]
    below, above = heights[i : i + 2]
    if direction != "cold":
        start = tuple(scan.final_state.values[i if direction == "up" else i + 1])
    while upper - lower > resolution:
        middle = 0.5 * (lower + upper)
        if depends_on_rounding([middle]).any():
            break
        point = sweep(model, [middle], **run | {"initial_state": start})
        height = float(orbit_heights(point)[0])
        is_below = abs(height - below) <= abs(height - above)
        if is_below:
            lower, below = middle, height
        else:
            upper, above = middle, height
        is_before_jump = is_below if direction == "up" else not is_below
        if direction != "cold" and is_before_jump:
            start = tuple(point.final_state.values[0])
    # If the heights on both sides are equal or NaN, there is no jump.
    if not abs(above - below) > SAME_HEIGHT:
        return Jump(np.nan, np.nan, np.nan, large_steps=0, interval=upper - lower)
    # Runs close to the jump settle slowly, so the heights are taken from the scan.
    below, above = float(heights[i]), float(heights[i + 1])
    return Jump(0.5 * (lower + upper), below, above, int(is_large.sum()), upper - lower)


def orbit_heights(curve: xr.Dataset) -> np.ndarray:
    """Return the peak-to-peak displacements of a sweep, in units of the static deflection."""
    return (curve.displacement_max - curve.displacement_min).values


def height_steps(heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the absolute steps between neighbouring orbit heights, and a mask of large steps.

    `heights`, shape (n,), are peak-to-peak displacements in units of the static deflection. A step
    is large if it is at least half the largest step and at least `SAME_HEIGHT`. Steps from or to
    NaN are 0.
    """
    steps = np.nan_to_num(np.abs(np.diff(heights)), nan=0.0)
    return steps, steps >= max(0.5 * steps.max(), SAME_HEIGHT)


def iterate_variations(pair: GearPair, settings: dict) -> Iterator[tuple[str, float, Any, dict]]:
    """Yield variations of a run as (kind, value, model, arguments of `gearlib.sweep`).

    `settings` has lists of values: harmonics (numbers of harmonics of a truncated stiffness),
    factors (for damping and backlash), displacements and velocities (initial states in units of the
    static deflection; velocities are derivatives with respect to the mesh phase).
    """
    for count in settings["harmonics"]:
        yield "harmonics", count, OneDegreePair(pair=pair, profile=Fourier(count)), {}
    for factor in settings["factors"]:
        names = ("material_damping", "backlash_damping")
        damping = {name: factor * getattr(pair, name) for name in names}
        yield "damping", factor, pair.replace(**damping), {}
    for factor in settings["factors"]:
        yield "backlash", factor, pair.replace(backlash=factor * pair.backlash), {}
    for displacement in settings["displacements"]:
        yield "displacement", displacement, pair, {"initial_state": (displacement, 0.0)}
    for velocity in settings["velocities"]:
        yield "velocity", velocity, pair, {"initial_state": (0.0, velocity)}


def compute_jump_and_shifts(
    pair: GearPair, tunings: Sequence[float], settings: dict, run: dict
) -> xr.Dataset:
    """Compute the tuning at which the motion from rest jumps, and how variations shift it.

    The tuning is mesh frequency over natural frequency. `run` has arguments of `gearlib.sweep`.
    `settings` has the keys of `iterate_variations`, tolerances (of Runge-Kutta steps 4(5)),
    resolution (of the jump), and starts, seed and spread of the random initial states for each
    tolerance. In the dataset, height is the peak-to-peak displacement, switches the number of large
    height steps in the scan, and settled is 0 where the jump depends on the initial state, so that
    median and range over several states are given. Values are NaN without a jump in the scan.
    """
    tunings = np.asarray(tunings, float)
    resolution = settings["resolution"]
    reference = find_jump(pair, tunings, resolution, **run)
    base_shift = reference.tuning - reference.tuning  # NaN without a jump
    shifts_by_variation = [("base", 0.0, [base_shift], reference.large_steps)]
    for kind, value, varied, arguments in iterate_variations(pair, settings):
        jump = find_jump(varied, tunings, resolution, **run | arguments)
        shifts = [jump.tuning - reference.tuning]
        shifts_by_variation.append((kind, value, shifts, jump.large_steps))
    if settings["tolerances"]:
        shifts_by_variation += _compute_tolerance_shifts(pair, tunings, settings, run)

    def summary(variation: tuple) -> dict:
        """Return the variables of a variation (kind, value, shifts in tuning, large step count).

        Variations of the kind "tolerance" have shifts from several initial states, summarized by
        median and range. The other kinds have one shift and count as settled.
        """
        kind, value, shifts, large_step_count = variation
        finite = [shift for shift in shifts if np.isfinite(shift)] or [np.nan]
        return {
            "kind": kind,
            "value": float(value),
            "jump": reference.tuning + np.median(finite),
            "shift": np.median(finite),
            "shift_low": min(finite),
            "shift_high": max(finite),
            "switches": np.int32(large_step_count),
            "settled": np.int8(kind != "tolerance"),
        }

    curve = sweep(pair, tunings, **run)
    data = evaluate_on_grid({"variation": shifts_by_variation}, summary)
    data |= {"height": ("tuning", orbit_heights(curve))}
    coords = {"tuning": tunings, "variation": np.arange(len(shifts_by_variation))}
    attrs = curve.attrs | {"title": "Jump of the motion from rest, and what moves it"}
    dataset = add_metadata(xr.Dataset(data, coords, attrs))
    dataset["settled"].attrs |= SETTLED_FLAGS
    return dataset


def _compute_tolerance_shifts(
    pair: GearPair, tunings: np.ndarray, settings: dict, run: dict
) -> list:
    """Compute how each tolerance of a Runge-Kutta method shifts the jump in tuning.

    Each shift is relative to the exact jump from the same initial state. Return a list of (kind,
    tolerance, shifts from several initial states, median number of large steps of the orbit
    height). `settings` has the keys tolerances, resolution (of the jump), and starts (number), seed
    and spread of the initial states. `run` has arguments of `gearlib.sweep`.
    """
    resolution = settings["resolution"]
    rest = run.get("initial_state", (0.0, 0.0))
    states = [*map(tuple, many_starts.random_initial_states(pair, rest, settings))]
    runs = [run | {"initial_state": state} for state in states]
    exact_tunings = [find_jump(pair, tunings, resolution, **exact).tuning for exact in runs]
    # The jump is searched near the exact one. The half step is a margin for rounding errors.
    max_distance = (_SEARCH_STEPS + 0.5) * float(tunings[1] - tunings[0])
    variations = []
    for rtol in settings["tolerances"]:
        # The ratio of the tolerances is the default of MATLAB's ode45.
        method = {"method": "rk45", "options": {"rtol": rtol, "atol": 1e-3 * rtol}}
        jumps = []
        shifts = []
        for exact, exact_tuning in zip(runs, exact_tunings, strict=True):
            # If there is no exact jump, `exact_tuning` is NaN and all tunings are searched.
            nearby = tunings[~(np.abs(tunings - exact_tuning) > max_distance)]
            jump = find_jump(pair, nearby, resolution, **exact | method)
            jumps.append(jump)
            shifts.append(jump.tuning - exact_tuning)
        large_step_count = np.median([jump.large_steps for jump in jumps])
        variations.append(("tolerance", rtol, shifts, large_step_count))
    return variations

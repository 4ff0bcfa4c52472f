"""Where the motion from rest jumps between two orbits over the tuning, and what moves the jump.

The jump is the largest change of the orbit's height between neighbouring tunings of a scan, then
bisected. A continuous curve ends with two equal heights and has no jump. Bisection ends where
rounding decides to which side a motion goes. Under step control rounding shows at every tuning: by
such a method the jump is found from many seeded starts, each beside the exact jump from it.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from gearlib.analysis.lyapunov import SETTLED_FLAGS, rounding_decides
from gearlib.data.result import stacked
from gearlib.data.variables import describe
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.runs.sweeping import sweep
from gearlib.studies import many_starts

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.integrators import embedded_pair  # noqa: F401

#: Difference of heights, static deflections, below which orbits count as one.
SAME_HEIGHT = 0.1
#: Steps of the scan to both sides of the exact jump in which that by another method is sought.
_STEPS_BESIDE = 4


class Jump(NamedTuple):
    """A jump of the orbit from rest between two tunings."""

    tuning: float  #: middle of the last interval; NaN: there is no jump
    below: float  #: height of the orbit below, static deflections, where it jumps in the scan
    above: float  #: and above
    switches: int  #: changes of height in the scan at least half as large as the largest
    interval: float  #: width of the last interval; wider than asked where rounding decides


def find(pair, tunings, resolution, direction="cold", **run):
    """Return the largest `Jump` of the motions from one start within a scan of rising tunings.

    `resolution` is the width to which it is bisected, `run` holds arguments of `gearlib.sweep`.
    Motions that are carried up or down reach the jump from one side, and so does the bisection.
    """
    tunings = np.asarray(tunings, float)
    start, exact = run.get("initial_state", (0.0, 0.0)), "method" not in run
    scan = sweep(pair, tunings, direction=direction, **run)
    heights = orbit_heights(scan)

    def lost(places):
        return exact * rounding_decides(pair, places, start, run["periods"])

    steps, large = height_steps(heights)
    while direction == "cold" and large.any():
        i = int(np.argmax(steps))
        unknown = lost(tunings[i : i + 2])
        if not unknown.any():
            break
        heights[i : i + 2][unknown] = np.nan
        steps, large = height_steps(heights)
    i = int(np.argmax(steps))
    (low, high), (below, above) = tunings[i : i + 2], heights[i : i + 2]
    if direction != "cold":
        start = tuple(scan.final_state.values[i if direction == "up" else i + 1])
    while high - low > resolution and not lost([middle := 0.5 * (low + high)]).any():
        point = sweep(pair, [middle], **run | {"initial_state": start})
        height = float(orbit_heights(point)[0])
        is_below = abs(height - below) <= abs(height - above)
        if is_below:
            low, below = middle, height
        else:
            high, above = middle, height
        if direction == ("up" if is_below else "down"):
            start = tuple(point.final_state.values[0])
    if not abs(above - below) > SAME_HEIGHT:
        return Jump(np.nan, np.nan, np.nan, 0, high - low)
    # The nearer to the jump, the less a run has settled: heights are those of the scan.
    below, above, count = float(heights[i]), float(heights[i + 1]), int(large.sum())
    return Jump(0.5 * (low + high), below, above, count, high - low)


def orbit_heights(curve):
    """Return the heights of the orbits of a sweep, static deflections."""
    return (curve.displacement_max - curve.displacement_min).values


def height_steps(heights):
    """Return the steps between neighbouring heights, and which of them count as switches.

    A NaN is no orbit and makes no step. A switch is at least half as large as the largest step.
    """
    steps = np.nan_to_num(np.abs(np.diff(heights)), nan=0.0)
    return steps, steps >= max(0.5 * steps.max(), SAME_HEIGHT)


def variations(pair, settings):
    """Yield (kind, value, model, arguments of `sweep`) of every variation of an exact run."""
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


def compute(pair, tunings, settings, run):
    """Return the height of the motion from rest over tuning, its jump, and what moves that.

    `settings` hold the values of `variations`, tolerances of a pair 4(5), the resolution, and
    starts, seed and spread of the starts of each tolerance. NaN: no jump in the scan.
    """
    pair, tunings = GearPair(**pair), np.asarray(tunings, float)

    def jump_of(model, scan, **changed):
        return find(model, scan, settings["resolution"], **run | changed)

    base = jump_of(pair, tunings)
    rows = [("base", 0.0, [0.0 * base.tuning], base.switches)]
    for kind, value, model, changed in variations(pair, settings):
        jump = jump_of(model, tunings, **changed)
        rows.append((kind, value, [jump.tuning - base.tuning], jump.switches))
    rest = run.get("initial_state", (0.0, 0.0))
    starts = (
        [*map(tuple, many_starts.seeded_states(pair, rest, settings))]
        if settings["tolerances"]
        else []
    )
    exact = [(start, jump_of(pair, tunings, initial_state=start).tuning) for start in starts]
    reach = (_STEPS_BESIDE + 0.5) * float(tunings[1] - tunings[0])
    for rtol in settings["tolerances"]:
        # The ratio of both is that of the defaults of ode45.
        method = {"method": "rk45", "options": {"rtol": rtol, "atol": 1e-3 * rtol}}
        jumps = [
            jump_of(pair, tunings[~(np.abs(tunings - at) > reach)], initial_state=start, **method)
            for start, at in exact
        ]
        shifts = [jump.tuning - at for jump, (_, at) in zip(jumps, exact, strict=True)]
        rows.append(("tolerance", rtol, shifts, np.median([jump.switches for jump in jumps])))

    def facts(row):
        kind, value, shifts, switches = row
        finite = [shift for shift in shifts if np.isfinite(shift)] or [np.nan]
        return {
            "kind": kind,
            "value": float(value),
            "jump": base.tuning + np.median(finite),
            "shift": np.median(finite),
            "shift_low": min(finite),
            "shift_high": max(finite),
            "switches": np.int32(switches),
            "settled": np.int8(kind != "tolerance"),
        }

    curve = sweep(pair, tunings, **run)
    data = stacked({"variation": rows}, facts) | {"height": ("tuning", orbit_heights(curve))}
    coords = {"tuning": tunings, "variation": np.arange(len(rows))}
    attrs = curve.attrs | {"title": "Jump of the motion from rest, and what moves it"}
    dataset = describe(xr.Dataset(data, coords, attrs))
    dataset["settled"].attrs |= SETTLED_FLAGS
    return dataset

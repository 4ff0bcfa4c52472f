"""Where the motion from rest jumps between two orbits over the tuning, and what moves the jump.

Two tunings a step apart may belong to different attractors (Fig. 6 of the paper: 0.815 and
0.8151). The jump is looked for as what it is, the largest change of the orbit's height between
neighbouring tunings of a cold scan, and bisected: of the middle tuning the height decides to which
side it belongs. A continuous curve ends with two equal heights, and has no jump. Where rounding
decides to which side a motion goes the bisection ends, since more is not known of the jump.

Under step control rounding shows at every tuning. So the jump by such a method is asked from many
seeded starts, each beside the exact jump from the same start: median and range of the differences.
"""

from copy import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from gearlib.analysis import lyapunov
from gearlib.data.result import stacked
from gearlib.data.variables import describe
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.runs.sweeping import sweep
from gearlib.studies import many_starts

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.integrators import embedded_pair  # noqa: F401

#: Heights closer than this, in static deflections, are those of one orbit.
SAME_HEIGHT = 0.1
#: Steps of the scan to both sides of the exact jump in which another method is asked for its own.
_BESIDE = 4
#: Heights of one orbit agree to this, static deflections, where starts have settled.
_ONE_ORBIT = 1e-6
#: Starts beside a carried motion that rounding has led, and of a method.
_STARTS = {"starts": 8, "seed": 1, "spread": 0.02}

#: Kinds of variation, and what their value means.
KINDS = {
    "base": "the scene itself",
    "harmonics": "stiffness harmonics",
    "damping": "factor on the damping",
    "backlash": "factor on the backlash",
    "displacement": "initial displacement (static defl.)",
    "velocity": "initial velocity (static defl./rad)",
    "tolerance": "relative tolerance of a 4(5) pair",
}


class Jump(NamedTuple):
    """A jump of the orbit from rest between two tunings."""

    tuning: float  #: middle of the last interval; NaN: there is no jump
    #: Height of the orbit below, static deflections, where it jumps in the scan; NaN: not known.
    below: float
    above: float  #: and above
    switches: int  #: changes of height in the scan at least half as large as the largest
    interval: float  #: width of the last interval; more than asked where rounding decides


def find(pair, tunings, resolution, direction="cold", **run):
    """Return the `Jump` of a pair within a scan.

    tunings: shape (n,), the scan, rising, n >= 2; resolution: width of the last interval;
    direction: {"cold", "up", "down"}, of the scan. When the state is carried along, the bisection
    starts from the state on the side from which the jump is reached; **run: further arguments of
    `gearlib.sweep`.
    """
    tunings = np.asarray(tunings, float)
    scan = sweep(pair, tunings, direction=direction, **run)
    height = _heights(scan)
    exact, lost = "method" not in run, np.zeros(0, bool)
    steps, large = height_steps(height)
    while exact and large.any():
        i = int(np.argmax(steps))
        places, lost = _lost(pair, scan, height, i, direction, run)
        if not places.size:
            break
        height[places] = np.nan
        steps, large = height_steps(height)
    i = int(np.argmax(steps))
    low, high = tunings[i], tunings[i + 1]
    below, above = beside = height[i], height[i + 1]
    states, deviation = scan.final_state.values, lyapunov.Deviation(pair)
    if direction != "cold":
        run["initial_state"] = tuple(states[i if direction == "up" else i + 1])
    while high - low > resolution and not lost.any():
        middle = 0.5 * (low + high)
        if exact:
            start = run.get("initial_state", (0.0, 0.0))
            carried = copy(deviation)
            if carried.exceeds_limit(middle, start, run["periods"]):
                break
        one = sweep(pair, [middle], **run)
        height = float(_heights(one)[0])
        is_below = abs(height - below) <= abs(height - above)
        if is_below:
            low, below = middle, height
        else:
            high, above = middle, height
        if (direction == "up" and is_below) or (direction == "down" and not is_below):
            run["initial_state"] = tuple(one.final_state.values[0])
            if exact:
                deviation = carried
    if not abs(above - below) > SAME_HEIGHT:
        return Jump(np.nan, float(below), float(above), 0, high - low)
    # The nearer to the jump, the less a run has settled: its heights are those of the scan.
    below, above = (np.nan, np.nan) if lost.any() else beside
    return Jump(0.5 * (low + high), float(below), float(above), int(large.sum()), high - low)


def _lost(pair, scan, height, i, direction, run):
    """Return which heights count no more beside step `i`, and whether rounding decides of others.

    Where rounding has led a carried motion, starts beside it are asked: what all of them do counts.
    """
    tunings, start = scan.tuning.values, run.get("initial_state", (0.0, 0.0))
    periods = run["periods"]
    if direction == "cold":
        lost = lyapunov.rounding_decides(pair, tunings[i : i + 2], start, periods)
        return i + np.flatnonzero(lost), lost
    order = np.arange(tunings.size)[:: 1 if direction == "up" else -1]
    way = order[: max(np.argmax(order == i), np.argmax(order == i + 1)) + 1]
    ends = scan.final_state.values[way]
    lost = lyapunov.rounding_decides(pair, tunings[way], start, periods, ends)
    if not lost.any():
        return order[:0], lost
    k = int(np.argmax(lost))
    begin = ends[k - 1] if k and np.isfinite(ends[k - 1]).all() else start
    rest, step, apart = way[k:], height[i + 1] - height[i], 0.0
    for state in many_starts.starts(pair, begin, _STARTS):
        other = run | {"initial_state": tuple(state), "direction": direction}
        theirs = height.copy()
        theirs[rest] = _heights(sweep(pair, tunings[rest], **other))
        if not (theirs[i + 1] - theirs[i]) / step > 0.5:
            return order[k:], lost
        apart = max(apart, np.abs(theirs - height)[i : i + 2].max())
    # All on one orbit again: nothing is left of where they have been.
    return order[:0], lost & (apart > _ONE_ORBIT)


def height_steps(height):
    """Return the steps between neighbouring heights of a scan, and which count as switches.

    height (shape (n,), n >= 2; NaN for a run that could not go on: no orbit is like it).

    The steps; large: at least half as large as the largest, and no difference within one orbit.
    """
    steps = np.nan_to_num(np.abs(np.diff(height)), nan=0.0)
    return steps, steps >= max(0.5 * steps.max(), SAME_HEIGHT)


def _heights(curve):
    return (curve.displacement_max - curve.displacement_min).values


def variations(pair, settings):
    """Yield (kind, value, model, changed arguments of `sweep`) of every variation.

    settings (harmonics, factors, displacements, velocities, tolerances: lists of values).
    """
    yield "base", 0.0, pair, {}
    for n in settings["harmonics"]:
        yield "harmonics", n, OneDegreePair(pair=pair, profile=Fourier(n)), {}
    for factor in settings["factors"]:
        damped = pair.replace(
            material_damping=factor * pair.material_damping,
            backlash_damping=factor * pair.backlash_damping,
        )
        yield "damping", factor, damped, {}
    for factor in settings["factors"]:
        yield "backlash", factor, pair.replace(backlash=factor * pair.backlash), {}
    for x in settings["displacements"]:
        yield "displacement", x, pair, {"initial_state": (x, 0.0)}
    for v in settings["velocities"]:
        yield "velocity", v, pair, {"initial_state": (0.0, v)}
    for rtol in settings["tolerances"]:
        # ode45's defaults keep this ratio of the two.
        options = {"rtol": rtol, "atol": 1e-3 * rtol}
        yield "tolerance", rtol, pair, {"method": "rk45", "options": options}


def compute(pair, tunings, settings, run):
    """Return the jump of the motion from rest and of all its variations.

    pair: keyword arguments of `GearPair`; tunings: shape (n,), the scan; settings (as of
    `variations`, and resolution; starts, seed and spread for tolerances, as of
    `gearlib.studies.many_starts.starts`); run: periods, record_periods, initial_state.

    Of tolerances, which are asked from all starts, medians. NaN: no jump in the scan.
    """
    pair = GearPair(**pair)
    rows, others = [], None
    for kind, value, model, changed in variations(pair, settings):
        if kind == "tolerance":
            others = others or _from_starts(pair, tunings, settings, run)
            found, shifts = _by_method(pair, tunings, settings, run | changed, others)
            found = found._replace(tuning=rows[0][2].tuning + many_starts.spread_of(shifts)[1])
        else:
            found = find(model, tunings, settings["resolution"], **run | changed)
            shifts = np.array([found.tuning - rows[0][2].tuning if rows else 0.0 * found.tuning])
        rows.append((kind, float(value), found, shifts))
    base = sweep(pair, tunings, **run)

    def facts(row):
        kind, value, found, shifts = row
        low, _, high = many_starts.spread_of(shifts)
        return {
            "kind": kind,
            "value": value,
            "jump": found.tuning,
            "shift": found.tuning - rows[0][2].tuning,
            "shift_low": low,
            "shift_high": high,
            "jump_interval": found.interval,
            "jump_share": np.isfinite(shifts).mean(),
            "height_below": found.below,
            "height_above": found.above,
            "switches": np.int32(found.switches),
            "settled": np.int8(kind != "tolerance"),
        }

    data = stacked({"variation": rows}, facts) | {"height": ("tuning", _heights(base))}
    coords = {"tuning": base.tuning.values, "variation": np.arange(len(rows))}
    dataset = describe(xr.Dataset(data, coords))
    dataset["settled"].attrs |= lyapunov.SETTLED_FLAGS
    title = "Jump of the motion from rest, and what moves it"
    return dataset.assign_attrs(base.attrs | {"title": title})


def _from_starts(pair, tunings, settings, run):
    """Return (start, exact `Jump`) of all starts."""
    states = many_starts.starts(pair, run.get("initial_state", (0.0, 0.0)), _STARTS | settings)
    return [
        (state, find(pair, tunings, settings["resolution"], **run | {"initial_state": state}))
        for state in map(tuple, states)
    ]


def _by_method(pair, tunings, settings, run, others):
    """Return the median `Jump` by a method, and its distances from the exact one of each start."""
    found, step = [], float(tunings[1] - tunings[0])
    for state, exact in others:
        away = np.abs(np.asarray(tunings) - exact.tuning)
        near = np.asarray(tunings)[~(away > (_BESIDE + 0.5) * step)]
        found.append(find(pair, near, settings["resolution"], **run | {"initial_state": state}))
    columns = (np.array(column) for column in zip(*found, strict=True))
    pairs = zip(found, others, strict=True)
    shifts = np.array([one.tuning - exact.tuning for one, (_, exact) in pairs])
    return Jump(*(many_starts.spread_of(column)[1] for column in columns)), shifts
